"""One volume rendered by VTK's mappers, our volume raycaster and a VDI, side by side.

Pictures are compared at half the smallest spacing unless given, frames are timed with steps of one
voxel. The candidates take turns, after one frame each that is not counted; medians are reported.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.io.progress import Pieces
from pyvista_vdi.measure import bench as measuring
from pyvista_vdi.measure.bench import Bench, Image, accuracy, take_turns
from pyvista_vdi.model.arguments import records_of
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.metrics import over_background
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.raycasting.prepared import prepared_vdi

#: Who draws, by the keys of times and pictures, in the order of the panels in a row.
NAMES = {
    "gpu": "VTK GPU mapper",
    "fixed_point": "VTK fixed-point mapper",
    "raycaster": "our volume raycaster",
    "vdi": "VDI",
}

#: Pairs of pictures that are compared.
PAIRS = (("vdi", "raycaster"), ("raycaster", "gpu"), ("fixed_point", "gpu"))

#: Widest panel of the picture, what is between two of them, and a caption's height, pixels.
_PANEL, _GAP, _CAPTION = 640, 4, 26

Images = dict[str, Image]


def measure(
    volume: Volume,
    classification: Mapping[str, Any],
    window_size: tuple[int, int] = (1280, 720),
    *,
    angles: Sequence[float] = (0.0, 5.0, 30.0),
    repeats: int = 3,
    vtk: bool = True,
    device: Any = None,
    name: str = "volume",
    progress: Callable[[float], object] | None = None,
    **options: Any,
) -> tuple[dict[str, Any], VDI, dict[float, Images]]:
    """Render one volume in every way, compare the pictures and time the frames.

    ``classification`` has arguments of :func:`pyvista_vdi.generate`, ``options`` are those of
    generation, of which ``sample_distance`` is the accuracy step. ``window_size`` is that of the
    VDI and of all frames, ``angles`` are degrees of ``Azimuth`` from V_O, and ``repeats`` are timed
    frames of each candidate and view; with 0 nothing is timed.

    Returns the figures, what was generated from V_O, and the pictures by angle and by the keys of
    :data:`NAMES`, float32 (H, W, 3 or 4) over black. Each of the figures' ``views`` has ``near``,
    the comparisons, ``seconds`` by candidate, and ``ratio_to_vtk``, the VDI's seconds over those of
    the faster of VTK's mappers.
    """
    measuring.check_plan(angles, least=0, repeats=repeats)
    (looks,) = records_of(classification, "compare", Classification)
    done = Pieces(progress, 1 + len(angles))
    table = looks.transfer_function_of(volume)
    asked = GenerationOptions(**options)
    more: dict[str, Any] = {"device": device, "vtk": vtk, "sample_distance": asked.sample_distance}
    more["volume_property"] = looks.volume_property
    with closing(Bench(volume, table, window_size, **more)) as bench:
        vdi = bench.generate(**options)
        made = take_turns({"vdi": partial(bench.generate, **options)}, repeats, warm_up=False)
        done()
        images: dict[float, Images] = {}
        views = []
        for angle in angles:
            camera = bench.view.azimuth(angle)
            found = {n: mapper.image(camera, bench.step) for n, mapper in bench.vtk.items()}
            found |= {"raycaster": bench.reference(camera), "vdi": bench.draw(vdi, camera)}
            pairs = [pair for pair in PAIRS if {*pair} <= {*found}]
            near = {f"{a}_to_{b}": accuracy(found[a], found[b]) for a, b in pairs}
            # Frames at steps of one voxel, our raycaster's without passing by empty space
            work = bench.frames(camera, vdi)
            del work["volume"]
            work["raycaster"] = partial(bench.raycast, camera, bench.voxel, skip_empty=False)
            taken = take_turns(work, repeats) if repeats else {}
            seconds = {name: statistics.median(times) for name, times in taken.items()}
            theirs = [time for mapper, time in seconds.items() if mapper in bench.vtk]
            over = seconds["vdi"] / min(theirs) if theirs else None
            views.append({"angle": angle, "near": near, "seconds": seconds, "ratio_to_vtk": over})
            images[angle] = found
            done()
        report = {
            "case": {
                "name": name,
                "dimensions": volume.dimensions,
                "spacing": volume.spacing,
                "dtype": str(volume.array.dtype),
                "classification": looks.describe(),
                "window_size": window_size,
                "max_supersegments": asked.max_supersegments,
                "precision": asked.precision,
                "sample_distance": bench.step,
                "repeats": repeats,
                "camera": bench.view.to_dict(),
            },
            "system": measuring.describe_system(bench),
            "sizes": {
                "volume_bytes": volume.array.nbytes,
                "supersegments": vdi.n_supersegments,
                "occupied_lists": int(np.count_nonzero(vdi.counts)),
                "lists": vdi.counts.size,
                "vdi_bytes": vdi.nbytes,
                "device_bytes": prepared_vdi(bench.runtime, vdi).list_bytes,
                "dense_bytes": vdi.counts.size * asked.max_supersegments * 24,
            },
            "generation_seconds": statistics.median(made["vdi"]) if repeats else None,
            "views": views,
        }
    return report, vdi, images


def table(report: Mapping[str, Any]) -> str:
    """Return what :func:`measure` found as text of fixed width, without a newline at the end."""
    case, sizes, views = report["case"], report["sizes"], report["views"]
    points, size = (" x ".join(map(str, case[name])) for name in ("dimensions", "window_size"))
    longest = f"at most {case['max_supersegments']} supersegments ({case['precision']})"
    lines = [
        f"{case['name']}: {points} {case['dtype']}, {size} lists of {longest}",
        f"step: {case['sample_distance']:g} model units",
        *(f"{name}: {value}" for name, value in report["system"].items()),
        *("", "Pictures                degrees      SSIM   PSNR dB  worst/255  brightness"),
    ]
    for pair in views[0]["near"]:
        for view in views:
            near = view["near"][pair]
            lines.append(
                f"{pair.replace('_', ' '):<23} {view['angle']:7g}  {near['ssim']:8.5f}  "
                f"{near['psnr']:8.2f}  {near['worst_pixel']:9.2f}  {near['brightness']:10.4f}"
            )
    if case["repeats"]:
        names = [name for name in NAMES if name in views[0]["seconds"]]
        lines += ["", f"Frames, ms (median of {case['repeats']}; steps of one voxel)"]
        lines += ["degrees" + "  ".join(f"{NAMES[n]:>22}" for n in names) + "   VDI / VTK"]
        for view in views:
            times = "  ".join(f"{view['seconds'][n] * 1e3:22.1f}" for n in names)
            over = "-" if view["ratio_to_vtk"] is None else f"{view['ratio_to_vtk']:9.2f}"
            lines += [f"{view['angle']:7g}{times}   {over}"]
        lines += ["VDI / VTK: the VDI's frame time over that of the faster of VTK's two mappers"]
        lines += ["", f"Generation {report['generation_seconds']:.2f} s"]
    mebibytes = (f"{n[:-6]} {b / 2**20:.1f} MiB" for n, b in sizes.items() if n.endswith("_bytes"))
    lines += ["", f"Sizes: {', '.join(mebibytes)}; {sizes['supersegments']} supersegments in "]
    lines[-1] += f"{sizes['occupied_lists']} of {sizes['lists']} lists"
    return "\n".join(lines)


def contact_sheet(report: Mapping[str, Any], images: Mapping[float, Images]) -> NDArray[np.uint8]:
    """Return all panels in one picture: a row per angle, a column per renderer, uint8 (H, W, 3)."""
    from PIL import Image, ImageDraw, ImageFont

    columns = [name for name in NAMES if name in next(iter(images.values()))]
    width, height = report["case"]["window_size"]
    panel = (min(width, _PANEL), max(1, round(height * min(width, _PANEL) / width)))
    step = (panel[0] + _GAP, panel[1] + _CAPTION + _GAP)
    size = ((len(columns) + 1) * step[0] - _GAP, len(images) * step[1] - _GAP)
    sheet = Image.new("RGB", size, "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(16)
    for row, (angle, found) in enumerate(images.items()):
        pictures = {n: over_background(found[n]) for n in columns}
        panels = [(f"{NAMES[n]}, {angle:g} degrees", pictures[n]) for n in columns]
        off = 8 * np.abs(pictures["vdi"] - pictures["raycaster"])
        panels.append(("|VDI - our raycaster| x 8", off))
        for column, (caption, picture) in enumerate(panels):
            x, y = column * step[0], row * step[1]
            draw.text((x + 4, y + 4), caption, fill="black", font=font)
            pixels = np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8)
            scaled = Image.fromarray(pixels).resize(panel, Image.Resampling.LANCZOS)
            sheet.paste(scaled, (x, y + _CAPTION))
    return np.asarray(sheet)
