"""What packed supersegments lose and gain, for every volume: pictures, bytes, frame times.

Writes ``packed_WxH.json`` (all figures) and ``.md`` (the table). See README.md in this folder.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from common import (  # beside this file
    add_vdi_options,
    at_hand,
    measure_missing,
    new_parser,
    timed,
    vdi_of,
)
from files import DENSE_BYTES, mebibytes

from pyvista_vdi.cli.declare import parse_size
from pyvista_vdi.device import get_runtime
from pyvista_vdi.measure.report import system_line, table
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.packing import PRECISIONS
from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.prepared import PreparedVDI
from pyvista_vdi.raycasting.raycast import draw as draw_frame

#: Degrees about the centre, from V_O.
ANGLES = (0, 5, 30)

#: Largest loss of SSIM that is allowed.
MOST_LOSS = 0.001

LEGEND = (
    "`loss`: 1 - SSIM of the packed VDI's picture and the exact one's, over black, the worst of "
    f"{', '.join(map(str, ANGLES))} degrees, in millionths; `worst`: the worst pixel in steps of "
    "1/255, and `PSNR` in dB, of the same. `time`: frames over the exact ones at 5 and 30 degrees, "
    "by the process's CPU time, medians of turns. `MiB`: on the device (lists and supersegments) / "
    "in a file (lz4). `dense / file`: bytes of width x height x longest list x 24 over the file's."
)


def main() -> int:
    """Measure what is missing, and write what was found."""
    options = parsed()
    case = {
        "frame": list(options.frame or options.size),
        "transfer_function": options.tf,
        "max_supersegments": options.max_supersegments,
    }
    results = measure_missing(
        "packed",
        options,
        case,
        at_hand(options.volumes),
        lambda volume: measured(vdi_of(volume, options), options),
        report,
    )
    return 0 if most_loss(results) <= MOST_LOSS else 1


def parsed() -> argparse.Namespace:
    """Return the options."""
    parser = new_parser(__doc__, repeats=5, repeated="timed frames of each kind")
    add_vdi_options(parser)
    parser.add_argument("--frame", type=parse_size, metavar="WxH", help="of the pictures")
    return parser.parse_args()


def measured(vdi: VDI, options: argparse.Namespace) -> dict[str, Any]:
    """Return losses, bytes and times of one VDI in every form."""
    runtime, size = get_runtime(options.device), tuple(options.frame or options.size)
    width, height = options.size
    exact = vdi.with_precision("exact")
    forms = {precision: exact.with_precision(precision) for precision in PRECISIONS}
    prepared = {precision: PreparedVDI(runtime, form) for precision, form in forms.items()}
    found: dict[str, Any] = {
        "supersegments": vdi.n_supersegments,
        "dense_bytes": width * height * options.max_supersegments * DENSE_BYTES,
        "device_bytes": {name: form.list_bytes for name, form in prepared.items()},
        "file_bytes": {name: file_bytes(form) for name, form in forms.items()},
        "angles": [],
    }
    with runtime.buffer((size[1], size[0], 4), name="image") as image:
        for angle in ANGLES:
            camera = vdi.camera.azimuth(angle)
            ways = {
                name: partial(draw_frame, form, FrameRequest(camera, size), image)
                for name, form in prepared.items()
            }
            pictures = {}
            for name, draw in ways.items():
                draw()
                pictures[name] = runtime.download(image)
            row: dict[str, Any] = {"angle": angle, "loss": {}}
            for name in PRECISIONS[1:]:
                compared = compare_images(pictures[name], pictures["exact"])
                row["loss"][name] = {
                    "ssim": 1 - compared.ssim,
                    "psnr": compared.psnr if np.isfinite(compared.psnr) else None,
                    "worst_pixel": compared.worst_pixel,
                }
            if angle:
                row["seconds"] = timed(ways, options.repeats)
            found["angles"].append(row)
    return found


def file_bytes(vdi: VDI) -> int:
    """Return the size of a VDI's file."""
    with tempfile.TemporaryDirectory() as folder:
        return vdi.save(Path(folder) / "a.vdi").stat().st_size


def most_loss(results: dict[str, Any]) -> float:
    """Return the largest loss of SSIM in all cases."""
    return max(
        (
            loss["ssim"]
            for found in results["volumes"].values()
            for row in found["angles"]
            for loss in row["loss"].values()
        ),
        default=0.0,
    )


def report(results: dict[str, Any]) -> str:
    """Return the table: a line per volume and form."""
    width, height = results["window_size"]
    case = f"{results['transfer_function']}, {results['max_supersegments']} supersegments"
    lines = [
        f"# Packed supersegments, {width}x{height} lists, {case}",
        "",
        f"{LEGEND} Pictures of {results['frame'][0]}x{results['frame'][1]}.",
        "",
    ]
    rows = []
    for name, found in results["volumes"].items():
        for form in PRECISIONS:
            cells = [name if form == PRECISIONS[0] else "", form]
            losses = [row["loss"][form] for row in found["angles"] if form in row["loss"]]
            if losses:
                psnr = min(loss["psnr"] or np.inf for loss in losses)
                cells.append(f"{1e6 * max(loss['ssim'] for loss in losses):.0f}")
                cells += [f"{psnr:.1f}", f"{max(loss['worst_pixel'] for loss in losses):.2f}"]
                for row in found["angles"]:
                    if "seconds" in row:
                        own, base = (
                            row["seconds"][kind]["cpu"]["median"] for kind in (form, "exact")
                        )
                        cells.append(f"{own / base:.2f}")
            else:
                cells += ["", "", "", "1", "1"]
            size = found["file_bytes"][form]
            cells.append(f"{mebibytes(found['device_bytes'][form])} / {mebibytes(size)}")
            cells.append(f"{found['dense_bytes'] / size:.1f}")
            rows.append(cells)
    times = [f"time {angle}°" for angle in ANGLES if angle]
    heads = ("volume", "form", "loss", "PSNR", "worst", *times, "MiB", "dense / file")
    lines += table(heads, rows)
    lines += ["", f"Largest loss of SSIM: {most_loss(results):.6f} (allowed: {MOST_LOSS})."]
    return "\n".join([*lines, "", system_line(results["system"]), ""])


if __name__ == "__main__":
    sys.exit(main())
