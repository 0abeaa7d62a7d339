"""What a comparison looks like: a table of plain text, and one picture with all panels."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.measure.compare.measure import NAMES, Images, Report
from pyvista_vdi.model.metrics import Comparison, over_background

#: Panels of a row, in this order; those that were not rendered are left out.
_COLUMNS = ("gpu", "fixed_point", "raycaster", "vdi")

#: Width of a panel in the picture, pixels; larger frames are scaled down to it.
PANEL_WIDTH = 640

#: The last panel: absolute difference of VDI and raycaster, times this.
DIFFERENCE_GAIN = 8

_CAPTION_HEIGHT = 26
_GAP = 4


def table(report: Report) -> str:
    """Return a report as text of fixed width.

    Parameters
    ----------
    report : Report
        What :func:`measure` found.

    Returns
    -------
    str
        Lines without a newline at the end.
    """
    case, sizes = report.case, report.sizes
    width, height = case["window_size"]
    dimensions = " x ".join(str(n) for n in case["dimensions"])
    lines = [
        f"{case['name']}: {dimensions} {case['dtype']}, {width} x {height} lists",
        f"at most {case['max_supersegments']} supersegments ({case['precision']})",
        f"step: {case['sample_distance']:g} model units",
        *(f"{name}: {value}" for name, value in report.system.items()),
        "",
        "Pictures                   degrees      SSIM   PSNR dB  worst/255  brightness",
    ]
    pairs = {
        "VDI / our raycaster": "vdi_to_raycaster",
        "our raycaster / VTK GPU": "raycaster_to_gpu",
        "VTK fixed-point / VTK GPU": "fixed_point_to_gpu",
    }
    for label, attribute in pairs.items():
        for result in report.angles:
            comparison = getattr(result, attribute)
            if comparison is not None:
                lines.append(_picture_line(label, result.angle, comparison))
    if case["repeats"]:
        lines += _timing_lines(report)
    lines += [
        "",
        f"Sizes: volume {_mebibytes(sizes['volume_bytes'])}, VDI "
        f"{_mebibytes(sizes['vdi_bytes'])} in memory, {_mebibytes(sizes['device_bytes'])} on the "
        f"device ({sizes['supersegments']} supersegments in "
        f"{sizes['occupied_lists']} of {sizes['lists']} lists), dense form "
        f"{_mebibytes(sizes['dense_bytes'])}"
        + (f", file {_mebibytes(sizes['file_bytes'])}" if "file_bytes" in sizes else ""),
    ]
    return "\n".join(lines)


def _timing_lines(report: Report) -> list[str]:
    lines = [
        "",
        f"Frames, ms (median of {report.case['repeats']}; steps of one voxel)",
        "degrees" + "  ".join(f"{NAMES[n]:>22}" for n in _candidates(report)) + "   VDI / VTK",
    ]
    for result in report.angles:
        times = "  ".join(f"{result.seconds[n].median * 1e3:22.1f}" for n in _candidates(report))
        ratio = result.ratio_to_vtk
        lines.append(f"{result.angle:7g}{times}   {'-' if ratio is None else f'{ratio:9.2f}'}")
    lines.append("VDI / VTK: the VDI's frame time over that of the faster of VTK's two mappers")
    if report.generation_seconds is not None:
        against = f"{report.generation_ratio:.2f} x our raycaster"
        lines += [
            "",
            f"Generation {report.generation_seconds.median:.2f} s",
            f"that is {against}, same step, no early termination",
        ]
    return lines


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
    n_columns = len(columns) + 1
    sheet = Image.new("RGB", (n_columns * step[0] - _GAP, len(images) * step[1] - _GAP), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(16)
    for row, result in enumerate(report.angles):
        pictures = {n: over_background(images[result.angle][n]) for n in columns}
        captions = {n: f"{NAMES[n]}, {result.angle:g} degrees" for n in columns}
        pictures["difference"] = DIFFERENCE_GAIN * np.abs(pictures["vdi"] - pictures["raycaster"])
        captions["difference"] = (
            f"|VDI - our raycaster| x {DIFFERENCE_GAIN}, SSIM {result.vdi_to_raycaster.ssim:.4f}"
        )
        for column, (name, picture) in enumerate(pictures.items()):
            corner = (column * step[0], row * step[1])
            draw.text((corner[0] + 4, corner[1] + 4), captions[name], fill="black", font=font)
            pixels = np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8)
            scaled = Image.fromarray(pixels).resize(panel, Image.Resampling.LANCZOS)
            sheet.paste(scaled, (corner[0], corner[1] + _CAPTION_HEIGHT))
    return np.asarray(sheet)


def _candidates(report: Report) -> list[str]:
    return [name for name in NAMES if name in report.angles[0].seconds]


def _picture_line(label: str, angle: float, comparison: Comparison) -> str:
    return (
        f"{label:<26} {angle:7g}  {comparison.ssim:8.5f}  {comparison.psnr:8.2f}  "
        f"{comparison.worst_pixel:9.2f}  {comparison.mean_brightness_ratio:10.4f}"
    )


def _mebibytes(n: int) -> str:
    return f"{n / 2**20:.1f} MiB"
