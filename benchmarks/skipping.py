"""What skipping empty space gains, volume by volume and angle by angle, and that no bit changes.

Writes ``skipping_WxH.json`` (all figures) and ``.md`` (the table). See README.md in this folder.
"""

from __future__ import annotations

import argparse
import statistics
import sys
from typing import Any

import numpy as np
from common import (  # beside this file
    add_vdi_options,
    at_hand,
    marked,
    measure_missing,
    new_parser,
    timed,
    vdi_of,
)
from numpy.typing import NDArray

from pyvista_vdi.device import Runtime, get_runtime
from pyvista_vdi.measure.report import system_line, table
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.render_options import FrameRequest, RenderOptions
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.occupancy import OccupancyGrid
from pyvista_vdi.raycasting.prepared import PreparedVDI
from pyvista_vdi.raycasting.raycast import draw

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
    case = {
        "transfer_function": options.tf,
        "max_supersegments": options.max_supersegments,
    }
    results = measure_missing(
        "skipping",
        options,
        case,
        at_hand(options.volumes),
        lambda volume: measured(vdi_of(volume, options), options),
        report,
    )
    same = all(a["identical"] for v in results["volumes"].values() for a in v["angles"])
    return 0 if same else 1


def parsed() -> argparse.Namespace:
    """Return the options."""
    parser = new_parser(__doc__, repeats=9, repeated="timed frames of each kind")
    add_vdi_options(parser)
    return parser.parse_args()


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
        runtime.upload(vdi.offsets.astype(np.int32)) as offsets,
        runtime.upload(vdi.front) as front,
        runtime.upload(vdi.back) as back,
    ):

        def build() -> None:
            grid = OccupancyGrid(
                runtime,
                vdi,
                offsets,
                (front, back),
                nearest=0.0,
                shifted=False,
                long_offsets=False,
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

            def frame(skip: bool) -> None:
                options = RenderOptions(skip_empty=skip)
                draw(self._prepared, FrameRequest(camera, self._size, options), image)

            def bits(skip: bool) -> NDArray[np.uint32]:
                frame(skip)
                return self._runtime.download(image).view(np.uint32)

            identical = np.array_equal(bits(False), bits(True))  # builds the kernels, too
            times = timed({"plain": lambda: frame(False), "skipping": lambda: frame(True)}, repeats)
        return {
            "identical": identical,
            **times,
            **{
                f"{clock}_ratio": times["plain"][clock]["median"]
                / max(times["skipping"][clock]["median"], 1e-9)
                for clock in ("wall", "cpu")
            },
        }


def report(results: dict[str, Any]) -> str:
    """Return the table: a line per volume."""
    width, height = results["window_size"]
    case = f"{results['transfer_function']}, {results['max_supersegments']} supersegments"
    lines = [
        f"# Skipping empty space, {width}x{height}, {case}",
        "",
        LEGEND,
        "",
    ]
    rows, spreads = [], []
    for name, found in sorted(results["volumes"].items(), key=lambda item: item[1]["occupied"]):
        cells = [f"{a['wall_ratio']:.2f} ({a['cpu_ratio']:.2f})" for a in found["angles"]]
        same = all(a["identical"] for a in found["angles"])
        cells.append("the same" if same else marked("differ", False))
        cells.append(f"{1e3 * found['grid_seconds']:.0f} ms, {found['grid_bytes'] / 2**20:.2f} MiB")
        skips = "yes" if found["skips"] else "no"
        rows.append([name, f"{found['occupied']:.2f}", skips, *cells])
        for angle in found["angles"]:
            for way in ("plain", "skipping"):
                wall = angle[way]["wall"]
                spreads.append((wall["most"] - wall["least"]) / wall["median"])
    angles = [f"{angle:g}°" for angle in ANGLES]
    lines += table(("volume", "occupied", "skips", *angles, "bits", "grid"), rows)
    if spreads:
        spread = statistics.median(spreads)
        lines += ["", f"Spread of the repeated frames, (most - least) / median: {spread:.0%}."]
    return "\n".join([*lines, "", system_line(results["system"]), ""])


if __name__ == "__main__":
    sys.exit(main())
