"""Sets of VDIs: bytes, seconds, SSIM from random directions, frames on a path around the object.

Writes ``sets_WxH.json`` (all figures) and ``.md`` (the tables). See README.md in this folder.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from common import (  # beside this file
    add_looks,
    add_redo,
    add_size,
    add_volumes,
    at_hand,
    begun,
    looks_of,
    marked,
    new_parser,
    results_file,
    save,
)
from tqdm import tqdm

import pyvista_vdi as pvdi
from pyvista_vdi import examples
from pyvista_vdi.measure.clock import median, take_turns
from pyvista_vdi.measure.report import describe_system, system_line, table, write_text
from pyvista_vdi.measure.vtk_baselines import (
    MAPPERS,
    VTKBaseline,
    property_from_transfer_function,
)
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.sets.sphere import orbit
from pyvista_vdi.sets.vdi_set import BLEND

VOLUMES = ("brain", "visible_female_head", "rayleigh_taylor")

#: Degrees within which what is about as near is blended in: the default, and others.
BLENDS = (0.0, BLEND, 20.0)
#: Light below which rays end where frames are timed: as VTK's mappers do.
CUTOFF = 0.004
#: Degrees from the first view at which frames are timed, and of the steps of the path.
TIMED, PATH = range(30, 91, 4), range(181)

#: What must be reached.
LEAST_SSIM, LEAST_PERCENTILE = 0.97, 0.98
MOST_BYTES, MOST_SECONDS = 100e6, 120.0
MOST_FRAME, MOST_JUMP = 0.25, 1.5

LEGEND = (
    "SSIM is that of the whole picture over black, against `render_volume`, from random "
    "directions; blended within 6 degrees, which is the default, unless it says otherwise. "
    "Seconds are those of `generate_set`, and of saving. Jump: the largest mean absolute "
    "difference between neighbouring frames of a path in steps of one degree, half around, over "
    "the largest of volume rendering. Frame: the median time of a frame at 30 to 90 degrees from "
    "the first V_O over that of VTK's faster mapper, with steps of one voxel; both end rays at "
    ".004. Bold: what must be reached is not."
)


def main() -> int:
    """Measure what is missing, and write what was found."""
    parser = new_parser(__doc__, repeats=5, repeated="timed frames of each view")
    add_size(parser, (640, 360))
    add_volumes(parser, VOLUMES)
    add_looks(parser, max_supersegments=None)
    add_redo(parser)
    parser.add_argument("--directions", type=int, default=500, help="random ones (default: 500)")
    parser.add_argument("--target-ssim", type=float, default=0.98)
    parser.add_argument("--max-bytes", type=int, help="of a file")
    parser.add_argument(
        "--timings", action="store_true", help="time again what is there, and nothing else"
    )
    parser.add_argument("--sets", type=Path, metavar="FOLDER", help="where files of sets are kept")
    options = parser.parse_args()
    target = results_file("sets", options)
    case = {
        "window_size": list(options.size),
        "look": looks_of(options),
        "target_ssim": options.target_ssim,
        "max_bytes": options.max_bytes,
        "system": describe_system(options.device),
    }
    results = begun(target, case)
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.sets or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        for name in at_hand(options.volumes):
            found = results["volumes"].get(name, {})
            if options.timings or options.redo or not found:
                found |= made(name, folder, options)
                found |= timed(name, folder, options)
            if not options.timings and (options.redo or "ssim" not in found):
                found |= seen(name, folder, options)
            results["volumes"][name] = found
            save(results, target)
    write_text(target.with_suffix(".md"), report(results))
    print(f"Written: {target}, and .md beside it")
    return 0


def scene(name: str, options: argparse.Namespace) -> tuple[pvdi.Volume, Camera]:
    """Return a volume and the view that it fills."""
    volume = examples.load_data(name, as_volume=True)
    return volume, filling_camera(volume.bounds, options.size)


def made(name: str, folder: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Make a set and its file; return what they took."""
    volume, _ = scene(name, options)
    # What is compiled once is not of the set
    pvdi.generate_set(
        volume, "sphere", (32, 18), target_ssim=0.1, max_views=2, lists=1, max_supersegments=4,
        device=options.device, **looks_of(options),
    )  # fmt: skip
    start = time.perf_counter()
    vdi_set = pvdi.generate_set(
        volume,
        "sphere",
        options.size,
        target_ssim=options.target_ssim,
        max_bytes=options.max_bytes,
        device=options.device,
        **looks_of(options),
    )
    generated = time.perf_counter()
    path = vdi_set.save(folder / f"{name}.vdiset")
    return {
        "views": len(vdi_set),
        "about": vdi_set.about,
        "bytes": path.stat().st_size,
        "seconds": generated - start,
        "seconds_saving": time.perf_counter() - generated,
    }


def seen(name: str, folder: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Return the SSIM from random directions, and how much frames of a path differ."""
    volume, around = scene(name, options)
    vdi_set = pvdi.read(folder / f"{name}.vdiset")
    random = np.random.default_rng(21).normal(size=(options.directions, 3))
    random /= np.linalg.norm(random, axis=1)[:, None]
    ssim: dict[str, list[float]] = {f"{blend:g}": [] for blend in BLENDS}
    for i, view in enumerate(tqdm(orbit(around, volume.bounds, random), desc=name, leave=False)):
        truth = pvdi.render_volume(
            volume, view, options.size, device=options.device, **looks_of(options)
        )
        for blend in BLENDS if i % 5 == 0 else (BLEND,):
            vdi_set.blend = blend
            picture = pvdi.render(vdi_set, view, device=options.device)
            ssim[f"{blend:g}"].append(compare_images(picture, truth).ssim)
    steps: dict[str, list[float]] = {}
    for picture in tqdm(path_of(volume, around, vdi_set, options), desc=name, leave=False):
        for way, difference in picture.items():
            steps.setdefault(way, []).append(difference)
    vdi_set.blend = BLEND
    angles = [vdi_set.distances(view).min() for view in orbit(around, volume.bounds, random)]
    return {
        "ssim": {blend: spread(values) for blend, values in ssim.items()},
        "steps": {way: {"most": max(v), "mean": float(np.mean(v))} for way, v in steps.items()},
        "angle": {"most": float(max(angles)), "mean": float(np.mean(angles))},
    }


def spread(values: list[float]) -> dict[str, float]:
    """Return the least, the first percentile and the median of SSIMs, and how many they are."""
    return {
        "n": len(values),
        "least": float(min(values)),
        "percentile": float(np.percentile(values, 1)),
        "median": float(np.median(values)),
    }


def path_of(
    volume: pvdi.Volume, around: Camera, vdi_set: pvdi.VDISet, options: argparse.Namespace
) -> Iterator[dict[str, float]]:
    """Yield the mean absolute differences between neighbouring frames of a path, by who draws."""
    before: dict[str, np.ndarray] = {}
    for angle in PATH:
        view = around.azimuth(angle)
        now = {
            "volume": pvdi.render_volume(
                volume, view, options.size, device=options.device, **looks_of(options)
            )
        }
        for blend in BLENDS:
            vdi_set.blend = blend
            now[f"{blend:g}"] = pvdi.render(vdi_set, view, device=options.device)
        if before:
            yield {
                way: float(np.abs(picture[..., :3] - before[way][..., :3]).mean())
                for way, picture in now.items()
            }
        before = now


def timed(name: str, folder: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Return the median time of frames at each angle, of the set and of VTK's mappers."""
    volume, _ = scene(name, options)
    vdi_set = pvdi.read(folder / f"{name}.vdiset")
    # The first V_O's direction, as far away as the path
    centre = np.reshape(volume.bounds, (3, 2)).mean(axis=1)
    towards = np.subtract(vdi_set.cameras[0].position, centre)
    first = orbit(vdi_set.camera, volume.bounds, [towards / np.linalg.norm(towards)])[0]
    classified = Classification(looks_of(options), "a benchmark").transfer_function(volume)
    prop = property_from_transfer_function(volume, classified)
    step = min(volume.spacing)
    vtk = {m: VTKBaseline(volume, prop, options.size, m, step) for m in MAPPERS}
    frames: list[dict[str, Any]] = []
    for angle in TIMED:
        view = turned(first, angle)
        work: dict[str, Any] = {m: partial(vtk[m].render, view) for m in MAPPERS}
        work |= {f"{b:g}": partial(drawn, vdi_set, view, b, options) for b in BLENDS}
        taken = take_turns(work, options.repeats)
        frames.append({"angle": angle, **{way: median(times) for way, times in taken.items()}})
    for each in vtk.values():
        each.close()
    return {"frames": frames}


def drawn(vdi_set: pvdi.VDISet, view: Camera, blend: float, options: argparse.Namespace) -> None:
    """Draw a frame as it is timed."""
    vdi_set.blend = blend
    pvdi.render(vdi_set, view, transmittance_cutoff=CUTOFF, device=options.device)


def turned(first: Camera, angle: float) -> Camera:
    """Return a view turned away from the first, whichever way is not about its own axis."""
    up = np.asarray(first.view_up)
    steep = abs(float(first.axes[2] @ up) / float(np.linalg.norm(up))) > 0.9
    return first.elevation(angle) if steep else first.azimuth(angle)


def over_vtk(frames: list[dict[str, Any]], blend: float) -> float:
    """Return the median time of a set's frame over that of the faster of VTK's mappers."""
    ours, *theirs = (
        statistics.median(frame[way] for frame in frames) for way in (f"{blend:g}", *MAPPERS)
    )
    return ours / min(theirs)


def report(results: dict[str, Any]) -> str:
    """Return the tables."""
    width, height = results["window_size"]
    heads = ("volume", "V_Os", "farthest", "lists, N_S", "MB", "seconds", "saving")
    heads += ("SSIM least", "1 %", "median", "jump", "frame", "ms", "VTK ms")
    rows, others = [], []
    for name, found in results["volumes"].items():
        chosen, frames = found["about"]["chosen"], found["frames"]
        ours = 1e3 * statistics.median(frame[f"{BLEND:g}"] for frame in frames)
        theirs = 1e3 * min(statistics.median(f[m] for f in frames) for m in MAPPERS)
        ratio = over_vtk(frames, BLEND)
        row = [
            name,
            found["views"],
            "" if "angle" not in found else f"{found['angle']['most']:.0f}°",
            f"{chosen['lists']:g}, {chosen['max_supersegments']}",
            figure(found["bytes"] / 1e6, found["bytes"] <= MOST_BYTES, "{:.1f}"),
            figure(found["seconds"], found["seconds"] <= MOST_SECONDS, "{:.0f}"),
            f"{found['seconds_saving']:.0f}",
        ]
        for blend in BLENDS if "ssim" in found else ():
            ssim, steps = found["ssim"][f"{blend:g}"], found["steps"]
            jump = steps[f"{blend:g}"]["most"] / steps["volume"]["most"]
            cells = [
                figure(ssim["least"], ssim["least"] >= LEAST_SSIM, "{:.4f}"),
                figure(ssim["percentile"], ssim["percentile"] >= LEAST_PERCENTILE, "{:.4f}"),
                f"{ssim['median']:.4f}",
                figure(jump, jump <= MOST_JUMP),
            ]
            others.append(
                [name, f"{blend:g}°", ssim["n"], *cells, f"{over_vtk(frames, blend):.2f}"]
            )
            if blend == BLEND:
                row += cells
        rows.append([*row, figure(ratio, ratio <= MOST_FRAME), f"{ours:.1f}", f"{theirs:.1f}"])
    by_angle = [
        [name, *(f"{f[f'{BLEND:g}'] / min(f[m] for m in MAPPERS):.2f}" for f in found["frames"])]
        for name, found in results["volumes"].items()
    ]
    return "\n".join(
        [
            f"# Sets of VDIs, {width}x{height}",
            "",
            LEGEND,
            "",
            *table(heads, rows),
            "",
            "By how far a V_O may be beyond the nearest to be blended in:",
            "",
            *table(
                ("volume", "blend", "directions", "least", "1 %", "median", "jump", "frame"), others
            ),
            "",
            "Frame time over VTK's faster mapper at each angle from the first V_O, degrees:",
            "",
            *table(("volume", *(str(angle) for angle in TIMED)), by_angle),
            "",
            system_line(results["system"]),
            "",
        ]
    )


def figure(value: float, good: bool, form: str = "{:.2f}") -> str:
    """Return a figure, bold where it must be another."""
    return marked(form.format(value), good)


if __name__ == "__main__":
    sys.exit(main())
