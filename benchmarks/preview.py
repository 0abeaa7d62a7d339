"""Ways to give up accuracy for speed, tried on the same frames: what each brings at equal speed.

Writes ``preview_WxH.json`` (every setting tried), ``.md`` (SSIM at equal speed) and ``.png``. The
default case is the paper's for its Table 2: 1920x1080, 15 supersegments, 30 degrees from V_O.
"""

from __future__ import annotations

import argparse
import math
import statistics
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
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
from numpy.typing import NDArray
from tqdm import tqdm

from pyvista_vdi.api import render_volume
from pyvista_vdi.device import get_runtime
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.measure.clock import take_turns
from pyvista_vdi.measure.report import (
    describe_system,
    new_figure,
    save_figure,
    system_line,
    table,
    write_text,
)
from pyvista_vdi.measure.session import enlarged
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.render_options import FrameRequest, RenderOptions
from pyvista_vdi.model.thinned import thinned
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.prepared import prepared_vdi
from pyvista_vdi.raycasting.raycast import draw

#: Speeds, as multiples of the full frame's, at which the ways are compared.
SPEEDS = (2.0, 3.0, 4.0)

#: Shares of the pixels that are drawn, of the lists that are stepped through, samples per ray.
SHARES = (0.75, 0.6, 0.5, 0.4, 0.33, 0.25, 0.2, 0.15)
FEWER_LISTS = (2, 3, 4)
SAMPLES = (1, 2, 4, 8, 16, 32)

LEGEND = (
    "SSIM against the full frame / against `render_volume`, between the settings tried; speed "
    "against the full frame with empty space skipped; `-`: not reached."
)

Image = NDArray[np.float32]


def main() -> int:
    """Measure, and write what was found."""
    options = parsed()
    rows = []
    for name in tqdm(at_hand(options.volumes), unit="volume"):
        rows += measured(name, options)
    results = {
        "window_size": list(options.size),
        "angle": options.angle,
        "max_supersegments": options.max_supersegments,
        "transfer_function": options.tf,
        "interpolation": options.interpolation,
        "system": describe_system(options.device),
        "rows": rows,
    }
    target = results_file("preview", options)
    save(results, target)
    write_text(target.with_suffix(".md"), report(results))
    write_plot(results, target.with_suffix(".png"))
    print(f"Written: {target}, and .md and .png beside it")
    return 0


def parsed() -> argparse.Namespace:
    """Return the options."""
    parser = new_parser(__doc__, repeats=5, repeated="timed frames of each setting")
    add_size(parser, (1920, 1080))
    add_volumes(parser, ["brain", "rayleigh_taylor", "aneurism", "heptane", "visible_female_head"])
    add_looks(parser, max_supersegments=15)
    parser.add_argument("--angle", type=float, default=30.0, help="azimuth from V_O, degrees")
    return parser.parse_args()


def measured(name: str, options: argparse.Namespace) -> list[dict[str, Any]]:
    """Draw one frame of a volume in every way, and hold each picture against the full one."""
    volume, table, view = subject_of(name, options)

    def generated(size: tuple[int, int]) -> VDI:
        limit = options.max_supersegments
        return generate_vdi(
            volume, view, size, table, max_supersegments=limit, device=options.device
        )

    camera = view.azimuth(options.angle)
    vdi = generated(options.size)
    draw = Drawing(camera, options.size, options.device)
    ways = [("full frame", 1.0, lambda: draw(vdi))]
    for share in SHARES:
        ways.append(("fewer pixels", share, pixels(draw, vdi, share)))
    for samples in SAMPLES:
        ways.append(("samples per ray", samples, sampled(draw, vdi, samples)))
    for factor in FEWER_LISTS:
        width, height = options.size
        coarse = generated((width // factor, height // factor))
        ways.append(("coarser VDI", 1 / factor, lambda vdi=coarse: draw(vdi)))
        few = thinned(vdi, factor, factor)
        ways.append(("several lists at once", 1 / factor, lambda vdi=few: draw(vdi)))

    pictures = [draw.whole(way()) for _, _, way in ways]  # builds and uploads what is needed
    work = {str(k): way for k, (_, _, way) in enumerate(ways)}
    found = take_turns(work, options.repeats, warm_up=False)
    times = [taken["clock"] for taken in found.values()]
    reference = render_volume(
        volume, camera, options.size, transfer_function=table, device=options.device
    )
    full = statistics.median(times[0])
    return [
        {
            "volume": name,
            "way": way,
            "setting": setting,
            "speed": full / statistics.median(taken),
            "spread": (max(taken) - min(taken)) / statistics.median(taken),
            "ssim_to_full": compare_images(picture, pictures[0]).ssim,
            "ssim_to_volume": compare_images(picture, reference).ssim,
        }
        for (way, setting, _), taken, picture in zip(ways, times, pictures, strict=True)
    ]


class Drawing:
    """Draws VDIs on the device for one view; a frame stays there, as a texture would.

    Parameters
    ----------
    camera : Camera
        The view.
    size : (int, int)
        Width and height of the picture, pixels.
    device : str, optional
        Where.
    """

    def __init__(self, camera: Camera, size: tuple[int, int], device: str | None) -> None:
        self._camera = camera
        self._size = size
        self._runtime = get_runtime(device)

    def __call__(
        self, vdi: VDI, size: tuple[int, int] | None = None, samples: int | None = None
    ) -> Image:
        """Draw, in the full size unless another is given."""
        width, height = size or self._size
        prepared = prepared_vdi(self._runtime, vdi)
        with self._runtime.buffer((height, width, 4), name="image") as image:
            options = RenderOptions(preview_samples=samples)
            draw(prepared, FrameRequest(self._camera, (width, height), options), image)
            return self._runtime.download(image)

    def whole(self, image: Image) -> Image:
        """Return an image in the full size, by linear interpolation as the texture unit's."""
        return enlarged(image, self._size)


def pixels(draw: Drawing, vdi: VDI, share: float) -> Callable[[], Image]:
    """Return what draws a share of the pixels."""
    width, height = draw._size
    edge = math.sqrt(share)
    size = (round(width * edge), round(height * edge))
    return lambda: draw(vdi, size)


def sampled(draw: Drawing, vdi: VDI, samples: int) -> Callable[[], Image]:
    """Return what draws the paper's preview."""
    return lambda: draw(vdi, samples=samples)


# -- what was found --------------------------------------------------------------------------------


def at_speed(rows: list[dict[str, Any]], speed: float, figure: str) -> float | None:
    """Return a figure at a speed, between the settings on either side; None if out of reach."""
    points = sorted((row["speed"], row[figure]) for row in rows)
    speeds, figures = zip(*points, strict=True)
    if not speeds[0] <= speed <= speeds[-1]:
        return None
    return float(np.interp(math.log(speed), np.log(speeds), figures))


def case_of(results: dict[str, Any]) -> str:
    """Name what all rows have in common."""
    return ", ".join(
        [
            f"{results['max_supersegments']} supersegments",
            f"{results['angle']:g} degrees",
            results["transfer_function"],
            results["interpolation"],
        ]
    )


def report(results: dict[str, Any]) -> str:
    """Return the table: a line per volume and way."""
    width, height = results["window_size"]
    heads = [f"{speed:g}x" for speed in SPEEDS]
    lines = [
        f"# Previews at equal speed, {width}x{height}, {case_of(results)}",
        "",
        LEGEND,
        "",
    ]
    rows: list[list[str]] = []
    for volume in dict.fromkeys(row["volume"] for row in results["rows"]):
        of_volume = [row for row in results["rows"] if row["volume"] == volume]
        full = next(row for row in of_volume if row["way"] == "full frame")
        whole = f"{full['ssim_to_volume']:.4f} to the volume"
        rows.append([volume, "full frame", whole, *[""] * (len(heads) - 1)])
        for way in dict.fromkeys(row["way"] for row in of_volume if row is not full):
            chosen = [full, *(row for row in of_volume if row["way"] == way)]
            cells = []
            for speed in SPEEDS:
                pair = [at_speed(chosen, speed, f"ssim_to_{k}") for k in ("full", "volume")]
                cells.append(" / ".join("-" if v is None else f"{v:.4f}" for v in pair))
            rows.append([volume, way, *cells])
    lines += table(("volume", "way", *heads), rows)
    return "\n".join([*lines, "", system_line(results["system"]), ""])


def write_plot(results: dict[str, Any], target: Path) -> None:
    """Plot SSIM over speed, a panel per volume."""
    volumes = list(dict.fromkeys(row["volume"] for row in results["rows"]))
    figure = new_figure((3.2 * len(volumes), 3.4))
    axes = figure.subplots(1, len(volumes), sharey=True, squeeze=False)
    for panel, volume in zip(axes[0], volumes, strict=True):
        rows = [row for row in results["rows"] if row["volume"] == volume]
        for way in dict.fromkeys(row["way"] for row in rows[1:]):
            points = sorted(
                (row["speed"], row["ssim_to_full"])
                for row in rows
                if row["way"] in (way, "full frame")
            )
            panel.plot(*zip(*points, strict=True), marker=".", label=way)
        panel.set(title=volume, xlabel="speed / full frame", xlim=(0.8, 6), ylim=(0.7, 1.0))
        panel.grid(alpha=0.3)
    axes[0][0].set_ylabel("SSIM to the full frame")
    axes[0][-1].legend(fontsize="small")
    figure.tight_layout()
    save_figure(figure, target)


if __name__ == "__main__":
    sys.exit(main())
