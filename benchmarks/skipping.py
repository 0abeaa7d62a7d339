"""What skipping empty space gains, volume by volume and angle by angle, and that no bit changes.

Writes ``skipping_WxH.json`` (all figures) and ``.md`` (the table). See README.md in this folder.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from standard_table import window_size  # beside this file
from tqdm import tqdm

from pyvista_vdi import examples
from pyvista_vdi.camera import Camera
from pyvista_vdi.classification import Classification
from pyvista_vdi.compare import describe_system
from pyvista_vdi.generation import generate_vdi
from pyvista_vdi.io import read, whole_file
from pyvista_vdi.occupancy import OccupancyGrid
from pyvista_vdi.opencl_runtime import Runtime, get_runtime
from pyvista_vdi.raycast import PreparedVDI
from pyvista_vdi.standard_cases import TRANSFER_FUNCTIONS, WINDOW_SIZE, filling_camera
from pyvista_vdi.vdi import VDI

#: Azimuths from V_O, degrees.
ANGLES = (0.0, 5.0, 30.0, 60.0, 90.0, 180.0)

LEGEND = (
    "Time without skipping over time with it, by wall clock (in brackets by the process's CPU "
    "time). `occupied`: occupied cells over cells within the bounds. `skips`: whether "
    "`skip_empty=True` skips, which it does where enough is empty. `grid`: time to build it, and "
    "its counts and masks."
)


def main() -> int:
    """Measure what is missing, and write what was found."""
    options = parsed()
    width, height = options.size
    options.out.mkdir(parents=True, exist_ok=True)
    target = options.out / f"skipping_{width}x{height}.json"
    case = {
        "window_size": [width, height],
        "transfer_function": options.tf,
        "max_supersegments": options.max_supersegments,
        "system": describe_system(options.device),
    }
    results = json.loads(target.read_text()) if target.exists() else {**case, "volumes": {}}
    if any(results[name] != value for name, value in case.items()):
        sys.exit(f"{target} was measured otherwise or elsewhere: choose another --out")
    at_hand = examples.available()
    absent = [name for name in options.volumes if name not in at_hand]
    if absent:
        print(f"Left out, not in {examples.DATA_VARIABLE}: {', '.join(absent)}", file=sys.stderr)
    for name in tqdm([name for name in options.volumes if name in at_hand], unit="volume"):
        if name in results["volumes"] and not options.redo:
            continue
        results["volumes"][name] = measured(vdi_of(name, options), options)
        with whole_file(target) as stream:
            stream.write(json.dumps(results, indent=1).encode() + b"\n")
    with whole_file(target.with_suffix(".md")) as stream:
        stream.write(report(results).encode())
    print(f"Written: {target}, and .md beside it")
    same = all(a["identical"] for v in results["volumes"].values() for a in v["angles"])
    return 0 if same else 1


def parsed() -> argparse.Namespace:
    """Return the options."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results")
    parser.add_argument("--size", type=window_size, default=WINDOW_SIZE, metavar="WxH")
    names = sorted(examples.VOLUMES)
    parser.add_argument("--volumes", nargs="+", choices=names, default=names, metavar="NAME")
    parser.add_argument("--tf", choices=TRANSFER_FUNCTIONS, default="soft")
    parser.add_argument("--max-supersegments", type=int, default=20, metavar="N")
    parser.add_argument("--repeats", type=int, default=9, help="timed frames of each kind")
    parser.add_argument("--device", help="OpenCL device, see: pyvista-vdi devices")
    parser.add_argument(
        "--vdi-cache",
        type=Path,
        metavar="FOLDER",
        help="read VDIs from there that an earlier run has written, and write those it lacks",
    )
    parser.add_argument("--redo", action="store_true", help="measure what is there as well")
    return parser.parse_args()


def vdi_of(name: str, options: argparse.Namespace) -> VDI:
    """Return the volume's VDI: from the cache, or generated and written there."""
    path = None
    if options.vdi_cache is not None:
        width = options.size[0]
        file = f"{name}_{options.tf}_{width}_{options.max_supersegments}.vdi"
        path = options.vdi_cache / file
        if path.exists():
            vdi = read(path)
            if vdi.window_size == tuple(options.size):
                return vdi
    volume = examples.load_data(name, as_volume=True)
    classification = Classification(TRANSFER_FUNCTIONS[options.tf], "skipping")
    vdi = generate_vdi(
        volume,
        filling_camera(volume.bounds, options.size),
        options.size,
        classification.transfer_function(volume),
        max_supersegments=options.max_supersegments,
        device=options.device,
    )
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        vdi.save(path)
    return vdi


def measured(vdi: VDI, options: argparse.Namespace) -> dict[str, Any]:
    """Measure one VDI from all angles."""
    runtime = get_runtime(options.device)
    prepared = PreparedVDI(runtime, vdi)
    grid = prepared.occupancy
    draw = Drawing(runtime, prepared, tuple(options.size))
    return {
        "supersegments": vdi.n_supersegments,
        "empty_lists": float((vdi.counts == 0).mean()),
        "occupied": grid.occupied,
        "skips": grid.worthwhile,
        "grid_seconds": build_seconds(runtime, vdi, options.repeats),
        "grid_bytes": grid.counts.nbytes + grid.masks.nbytes,
        "angles": [
            {"angle": angle, **draw.compared(vdi.camera.azimuth(angle), options.repeats)}
            for angle in ANGLES
        ],
    }


def build_seconds(runtime: Runtime, vdi: VDI, repeats: int) -> float:
    """Return the time to build the grid from arrays that are on the device, median."""
    with (
        runtime.upload(vdi.offsets.astype(np.uint32)) as offsets,
        runtime.upload(vdi.front) as front,
        runtime.upload(vdi.back) as back,
    ):

        def build() -> None:
            grid = OccupancyGrid(
                runtime, vdi, offsets, front, back, nearest=0.0, shifted=False, long_offsets=False
            )
            grid.counts.release()
            grid.masks.release()

        build()  # builds the kernels, too
        seconds: float = timed({"build": build}, repeats)["build"]["wall"]["median"]
        return seconds


class Drawing:
    """Draws frames that stay on the device: neither the VDI's upload nor a download is timed.

    Parameters
    ----------
    runtime : Runtime
        The device.
    prepared : PreparedVDI
        What is drawn.
    size : (int, int)
        Width and height of the picture, pixels.
    """

    def __init__(self, runtime: Runtime, prepared: PreparedVDI, size: tuple[int, int]) -> None:
        self._runtime = runtime
        self._prepared = prepared
        self._size = size

    def compared(self, camera: Camera, repeats: int) -> dict[str, Any]:
        """Time a frame without and with skipping, in turns, and compare their bits."""
        width, height = self._size
        with self._runtime.buffer((height, width, 4), name="image") as image:

            def draw(skip: bool) -> None:
                self._prepared.render(camera, self._size, image, skip_empty=skip)

            def bits(skip: bool) -> NDArray[np.uint32]:
                draw(skip)
                return self._runtime.download(image).view(np.uint32)

            identical = np.array_equal(bits(False), bits(True))  # builds the kernels, too
            times = timed({"plain": lambda: draw(False), "skipping": lambda: draw(True)}, repeats)
        return {
            "identical": identical,
            **times,
            **{
                f"{clock}_ratio": times["plain"][clock]["median"]
                / max(times["skipping"][clock]["median"], 1e-9)
                for clock in ("wall", "cpu")
            },
        }


def timed(ways: dict[str, Callable[[], object]], repeats: int) -> dict[str, dict[str, Any]]:
    """Time several ways in turns: seconds by wall clock and by CPU, with the spread."""
    taken: dict[str, list[tuple[float, float]]] = {name: [] for name in ways}
    for _ in range(repeats):
        for name, way in ways.items():
            wall, cpu = time.perf_counter(), time.process_time()
            way()
            taken[name].append((time.perf_counter() - wall, time.process_time() - cpu))
    return {
        name: {
            clock: {"median": statistics.median(s), "least": min(s), "most": max(s)}
            for clock, s in zip(("wall", "cpu"), zip(*pairs, strict=True), strict=True)
        }
        for name, pairs in taken.items()
    }


def report(results: dict[str, Any]) -> str:
    """Return the table: a line per volume."""
    width, height = results["window_size"]
    heads = " | ".join(f"{angle:g}°" for angle in ANGLES)
    case = f"{results['transfer_function']}, {results['max_supersegments']} supersegments"
    lines = [
        f"# Skipping empty space, {width}x{height}, {case}",
        "",
        LEGEND,
        "",
        f"| volume | occupied | skips | {heads} | bits | grid |",
        f"|---|---|---|{'---|' * len(ANGLES)}---|---|",
    ]
    spreads = []
    for name, found in sorted(results["volumes"].items(), key=lambda item: item[1]["occupied"]):
        cells = [f"{a['wall_ratio']:.2f} ({a['cpu_ratio']:.2f})" for a in found["angles"]]
        same = all(a["identical"] for a in found["angles"])
        cells.append("the same" if same else "**differ**")
        cells.append(f"{1e3 * found['grid_seconds']:.0f} ms, {found['grid_bytes'] / 2**20:.2f} MiB")
        skips = "yes" if found["skips"] else "no"
        lines.append(f"| {name} | {found['occupied']:.2f} | {skips} | {' | '.join(cells)} |")
        for angle in found["angles"]:
            for way in ("plain", "skipping"):
                wall = angle[way]["wall"]
                spreads.append((wall["most"] - wall["least"]) / wall["median"])
    if spreads:
        spread = statistics.median(spreads)
        lines += ["", f"Spread of the repeated frames, (most - least) / median: {spread:.0%}."]
    system = ", ".join(f"{k} {v}" for k, v in results["system"].items())
    return "\n".join([*lines, "", system, ""])


if __name__ == "__main__":
    sys.exit(main())
