"""What a comparison looks like: a table of plain text, and one picture with all panels."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.measure.compare.measure import NAMES, Images, Report
from pyvista_vdi.model.metrics import over_background

#: Panels of a row, in this order; those that were not rendered are left out.
_COLUMNS = ("gpu", "fixed_point", "raycaster", "vdi")

#: Pairs of pictures, by the names that a view's comparisons have.
_PAIRS = {
    "vdi_to_raycaster": "VDI / our raycaster",
    "raycaster_to_gpu": "our raycaster / VTK GPU",
    "fixed_point_to_gpu": "VTK fixed-point / VTK GPU",
}

#: Width of a panel in the picture, pixels; larger frames are scaled down to it.
PANEL_WIDTH = 640

#: The last panel: absolute difference of VDI and raycaster, times this.
DIFFERENCE_GAIN = 8

_CAPTION_HEIGHT, _GAP = 26, 4


def table(report: Report) -> str:
    """Return what :func:`measure` found as text of fixed width, without a newline at the end."""
    return "\n".join(_lines(report))


def _lines(report: Report) -> Iterator[str]:
    case = report.case
    width, height = case["window_size"]
    dimensions = " x ".join(str(n) for n in case["dimensions"])
    yield f"{case['name']}: {dimensions} {case['dtype']}, {width} x {height} lists"
    yield f"at most {case['max_supersegments']} supersegments ({case['precision']})"
    yield f"step: {case['sample_distance']:g} model units"
    yield from (f"{name}: {value}" for name, value in report.system.items())
    yield from ("", "Pictures                   degrees      SSIM   PSNR dB  worst/255  brightness")
    for name, label in _PAIRS.items():
        for result in report.angles:
            if (near := getattr(result, name)) is not None:
                yield (
                    f"{label:<26} {result.angle:7g}  {near.ssim:8.5f}  {near.psnr:8.2f}  "
                    f"{near.worst_pixel:9.2f}  {near.mean_brightness_ratio:10.4f}"
                )
    if case["repeats"]:
        yield from _timing_lines(report)
    sizes = {name: f"{n / 2**20:.1f} MiB" for name, n in report.sizes.items() if "bytes" in name}
    saved = f", file {sizes['file_bytes']}" if "file_bytes" in sizes else ""
    yield ""
    yield (
        f"Sizes: volume {sizes['volume_bytes']}, VDI {sizes['vdi_bytes']} in memory, "
        f"{sizes['device_bytes']} on the device ({report.sizes['supersegments']} supersegments in "
        f"{report.sizes['occupied_lists']} of {report.sizes['lists']} lists), dense form "
        f"{sizes['dense_bytes']}{saved}"
    )


def _timing_lines(report: Report) -> Iterator[str]:
    names = [name for name in NAMES if name in report.angles[0].seconds]
    yield from ("", f"Frames, ms (median of {report.case['repeats']}; steps of one voxel)")
    yield "degrees" + "  ".join(f"{NAMES[n]:>22}" for n in names) + "   VDI / VTK"
    for result in report.angles:
        times = "  ".join(f"{result.seconds[n].median * 1e3:22.1f}" for n in names)
        ratio = result.ratio_to_vtk
        yield f"{result.angle:7g}{times}   {'-' if ratio is None else f'{ratio:9.2f}'}"
    yield "VDI / VTK: the VDI's frame time over that of the faster of VTK's two mappers"
    if report.generation_seconds is not None:
        yield from ("", f"Generation {report.generation_seconds.median:.2f} s")
        against = f"{report.generation_ratio:.2f} x our raycaster"
        yield f"that is {against}, same step, no early termination"


def contact_sheet(report: Report, images: Mapping[float, Images]) -> NDArray[np.uint8]:
    """Return all panels in one picture: a row per angle, a column per renderer.

    Parameters
    ----------
    report : Report
        What :func:`measure` found.
    images : mapping of float to dict
        Its pictures, by angle and renderer.

    Returns
    -------
    numpy.ndarray
        uint8 (height, width, 3), top row first; black behind the panels, captions above them.
    """
    from PIL import Image, ImageDraw, ImageFont

    columns = [name for name in _COLUMNS if name in next(iter(images.values()))]
    width, height = report.case["window_size"]
    panel = (min(width, PANEL_WIDTH), max(1, round(height * min(width, PANEL_WIDTH) / width)))
    step = (panel[0] + _GAP, panel[1] + _CAPTION_HEIGHT + _GAP)
    size = ((len(columns) + 1) * step[0] - _GAP, len(images) * step[1] - _GAP)
    sheet = Image.new("RGB", size, "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(16)
    for row, result in enumerate(report.angles):
        pictures = {n: over_background(images[result.angle][n]) for n in columns}
        panels = [(f"{NAMES[n]}, {result.angle:g} degrees", pictures[n]) for n in columns]
        off = DIFFERENCE_GAIN * np.abs(pictures["vdi"] - pictures["raycaster"])
        ssim = f"SSIM {result.vdi_to_raycaster.ssim:.4f}"
        panels.append((f"|VDI - our raycaster| x {DIFFERENCE_GAIN}, {ssim}", off))
        for column, (caption, picture) in enumerate(panels):
            x, y = column * step[0], row * step[1]
            draw.text((x + 4, y + 4), caption, fill="black", font=font)
            pixels = np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8)
            scaled = Image.fromarray(pixels).resize(panel, Image.Resampling.LANCZOS)
            sheet.paste(scaled, (x, y + _CAPTION_HEIGHT))
    return np.asarray(sheet)
