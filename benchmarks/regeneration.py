"""What frames notice of a VDI being made in the background, and whether anything stays behind.

Frames follow each other without pause, 15 degrees from V_O, as fast as they can: the hardest case
for whoever wants to work beside them. Writes ``regeneration_WxH.json`` and ``.png``. See README.md
in this folder for what is judged.
"""

from __future__ import annotations

import argparse
import gc
import statistics
import sys
import threading
import time
from pathlib import Path
from typing import Any

from common import (  # beside this file
    add_looks,
    add_size,
    add_volumes,
    at_hand,
    new_parser,
    results_file,
    save,
    subject_of,
)
from tqdm import tqdm

from pyvista_vdi.device import get_runtime
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.measure.report import describe_system, new_figure, save_figure
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.background import BackgroundGeneration
from pyvista_vdi.raycasting.prepared import prepared_vdi
from pyvista_vdi.raycasting.raycast import draw

VOLUMES = ("aneurism", "brain", "heptane", "rayleigh_taylor")

#: Degrees from V_O at which frames are drawn; the new VDI is made there.
ANGLE = 15.0

#: What a frame may take, over the undisturbed median: the median frame meanwhile, and the one in
#: which the new VDI appears.
MEDIAN_BOUND, SWAP_BOUND = 1.5, 2.0

#: Undisturbed frames before a generation, and after it.
FRAMES = 20

#: The window of the regenerations in a row: what could stay behind does so at any size.
ROW_WINDOW = (320, 180)


def main() -> int:
    """Measure, write and plot."""
    options = parsed()
    tqdm.monitor_interval = 0  # no thread but those that are looked for
    results: dict[str, Any] = {
        "window_size": list(options.size),
        "max_supersegments": options.max_supersegments,
        "angle": ANGLE,
        "transfer_function": options.tf,
        "interpolation": options.interpolation,
        "system": describe_system(options.device),
        "volumes": {},
    }
    for name in tqdm(at_hand(options.volumes), unit="volume"):
        bench = Bench(name, options)
        rounds = [bench.regenerate() for _ in range(options.rounds)]
        results["volumes"][name] = {"judged": judged(rounds), "rounds": rounds}
        bench.close()
    if options.times:
        results["row"] = row(options)
    target = results_file("regeneration", options)
    save(results, target)
    write_plot(results, target.with_suffix(".png"))
    report(results)
    print(f"Written: {target}, and .png beside it")
    return 0


def parsed() -> argparse.Namespace:
    """Return the options."""
    parser = new_parser(__doc__)
    add_size(parser)
    add_volumes(parser, VOLUMES)
    add_looks(parser)
    parser.add_argument("--rounds", type=int, default=3, help="regenerations of each volume")
    parser.add_argument("--times", type=int, default=200, help="regenerations in a row; 0: none")
    return parser.parse_args()


class Bench:
    """A volume whose VDI is drawn and made anew, from view to view.

    Parameters
    ----------
    name : str
        The volume.
    options : argparse.Namespace
        The script's.
    size : (int, int), optional
        Width and height in pixels; the script's by default.
    """

    def __init__(
        self, name: str, options: argparse.Namespace, size: tuple[int, int] | None = None
    ) -> None:
        self._volume, self._classified, _ = subject_of(name, options)
        self._size = options.size if size is None else size
        self._limit = options.max_supersegments
        self._runtime = get_runtime(options.device)
        width, height = self._size
        self._image = self._runtime.buffer((height, width, 4), name="image")
        self._background = BackgroundGeneration(options.device)
        view = filling_camera(self._volume.bounds, self._size)
        self._vdi = self._made(view)[0]
        self.turn()

    def close(self) -> None:
        """Release what is on the device."""
        self._background.close()
        self._image.release()

    def regenerate(self) -> dict[str, Any]:
        """Draw the VDI, while a new one is made as well; then go on with the new one.

        Returns
        -------
        dict
            Seconds: each frame before, meanwhile (from when the generation began), and after;
            the swap; the generation in the background, and alone.
        """
        alone = self._made(self._vdi.camera.azimuth(ANGLE))[1]
        self.turn()
        before = [self.frame() for _ in range(FRAMES)]
        renewed = self.renew()
        after = [self.frame() for _ in range(FRAMES)]
        return {
            "before": before,
            **renewed,
            "after": after,
            "generation_alone": alone,
            "supersegments": self._vdi.n_supersegments,
        }

    def renew(self) -> dict[str, Any]:
        """Draw until a new VDI from the present view has taken the old one's place."""
        view = self._camera
        start = time.perf_counter()
        self._background.start(
            self._volume, view, self._size, self._classified, max_supersegments=self._limit
        )
        meanwhile = []
        while True:
            began = time.perf_counter()
            new = self._background.take()
            if new is not None:
                break
            self.frame()
            meanwhile.append({"at": began - start, "seconds": time.perf_counter() - began})
        generation = began - start
        # The frame that shows the new VDI: taking it and dropping the old one are part of it
        self._vdi, new = new, None
        self.frame()
        swap = time.perf_counter() - began
        return {"meanwhile": meanwhile, "swap": swap, "generation": generation}

    def frame(self) -> float:
        """Draw a frame, and return its seconds, from its request to the picture on the host."""
        start = time.perf_counter()
        with self._runtime.foreground():
            prepared = prepared_vdi(self._runtime, self._vdi)
            draw(prepared, FrameRequest(self._camera, self._size), self._image)
            self._runtime.download(self._image)
        return time.perf_counter() - start

    def _made(self, view: Camera) -> tuple[VDI, float]:
        """Make a VDI with nothing else to do; return it and its seconds."""
        start = time.perf_counter()
        vdi = generate_vdi(
            self._volume,
            view,
            self._size,
            self._classified,
            max_supersegments=self._limit,
            device=self._runtime,
        )
        return vdi, time.perf_counter() - start

    def turn(self) -> None:
        """Turn away from V_O, and draw as often as the machine needs to forget what was before."""
        self._camera = self._vdi.camera.azimuth(ANGLE)
        for _ in range(5):
            self.frame()


def judged(rounds: list[dict[str, Any]]) -> dict[str, Any]:
    """Return each figure's median over the rounds, and the worst of the two that are bounded."""
    figures: dict[str, list[float]] = {}
    for each in rounds:
        undisturbed = statistics.median(each["before"])
        frames = [frame["seconds"] for frame in each["meanwhile"]]
        for name, value in (
            ("undisturbed_seconds", undisturbed),
            ("median_ratio", statistics.median(frames) / undisturbed),
            ("worst_ratio", max(frames) / undisturbed),
            ("undisturbed_worst_ratio", max(each["before"]) / undisturbed),
            ("swap_ratio", each["swap"] / undisturbed),
            ("swap_to_own_ratio", each["swap"] / statistics.median(each["after"])),
            ("generation_ratio", each["generation"] / each["generation_alone"]),
        ):
            figures.setdefault(name, []).append(value)
    return {
        **{name: statistics.median(values) for name, values in figures.items()},
        "passed": max(figures["median_ratio"]) <= MEDIAN_BOUND
        and max(figures["swap_ratio"]) <= SWAP_BOUND,
    }


def row(options: argparse.Namespace) -> dict[str, Any]:
    """Regenerate many times in a row, and watch memory and threads."""
    bench = Bench(options.volumes[0], options, ROW_WINDOW)
    runtime = get_runtime(options.device)
    samples = []
    for number in tqdm(range(options.times), desc="in a row", unit="regeneration"):
        bench.turn()
        bench.renew()
        if number % 10 == 9:
            gc.collect()
            samples.append(
                {
                    "regenerations": number + 1,
                    "resident_bytes": resident_bytes(),
                    "allocated_bytes": runtime.allocated,
                    "threads": threading.active_count(),
                }
            )
    bench.close()
    return {
        "volume": options.volumes[0],
        "window_size": list(ROW_WINDOW),
        "samples": samples,
        "threads_after": threading.active_count(),
    }


def resident_bytes() -> int | None:
    """Return this process' memory in RAM; None where the system does not say in this way."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        return None
    import resource

    return pages * resource.getpagesize()


def report(results: dict[str, Any]) -> None:
    """Print what was found."""
    for name, volume in results["volumes"].items():
        found = volume["judged"]
        print(
            f"{name}: {found['undisturbed_seconds'] * 1e3:.1f} ms undisturbed; meanwhile median "
            f"x{found['median_ratio']:.2f}, worst x{found['worst_ratio']:.2f} (undisturbed worst "
            f"x{found['undisturbed_worst_ratio']:.2f}); swap x{found['swap_ratio']:.2f}, of its "
            f"own x{found['swap_to_own_ratio']:.2f}; generation x{found['generation_ratio']:.1f}"
            f"{'' if found['passed'] else ' MISSED'}"
        )
    samples = results.get("row", {}).get("samples")
    if samples:
        for number in (0, len(samples) // 2, -1):
            print(", ".join(f"{name} {value}" for name, value in samples[number].items()))


def write_plot(results: dict[str, Any], target: Path) -> None:
    """Plot the frames of each volume's last round, over the undisturbed median."""
    volumes = results["volumes"]
    figure = new_figure((9, 1 + 1.6 * len(volumes)))
    axes = figure.subplots(len(volumes), 1, squeeze=False)
    for axis, (name, volume) in zip(axes[:, 0], volumes.items(), strict=True):
        last = volume["rounds"][-1]
        undisturbed = statistics.median(last["before"])
        frames = last["meanwhile"]
        axis.plot([f["at"] for f in frames], [f["seconds"] / undisturbed for f in frames], ".-")
        axis.plot([last["generation"]], [last["swap"] / undisturbed], "o", color="C3")
        for bound in (1, MEDIAN_BOUND, SWAP_BOUND):
            axis.axhline(bound, color="0.7", linewidth=0.8)
        axis.set(ylabel=f"{name}\nframe / undisturbed", ylim=(0, None))
    axes[-1, 0].set_xlabel("seconds since the generation began; red: the new VDI's first frame")
    figure.tight_layout()
    save_figure(figure, target, 90)


if __name__ == "__main__":
    sys.exit(main())
