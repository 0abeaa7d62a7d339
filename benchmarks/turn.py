"""A path once around volumes at a frame rate: SSIM of what was shown, and how late, VTK's and ours.

Every frame is drawn as while a hand moves and held against the own full picture of its view: that
of `render_volume` for ours, that of the same mapper for VTK's, which sets its image sample distance
by itself (`AutoAdjustSampleDistances`). A frame is late that takes over 1.2 periods of the rate.
"""

from __future__ import annotations

import time
from collections import Counter
from typing import Any

import numpy as np
from common import (
    Subject,
    add_looks,
    add_size,
    add_volumes,
    at_hand,
    looks_of,
    new_parser,
    results_file,
    save,
    subject_of,
)

from pyvista_vdi.measure.front import OurVolume
from pyvista_vdi.measure.report import table, write_text
from pyvista_vdi.measure.vtk_baselines import VTKBaseline, property_from_transfer_function
from pyvista_vdi.model.metrics import compare_images

#: Frames once around, and parts that are reported.
FRAMES, PARTS = 180, 10
#: Update rate at which nobody moves, 1/s.
STILL = 1e-4
#: By how much of a period a frame may be late.
LATE = 1.2


def way_of(drawn_by: Any) -> str:
    """Return what the last frame was raycast from."""
    return drawn_by.mapper.painter.status().drawn if isinstance(drawn_by, OurVolume) else "volume"


def shown(drawn_by: Any, views: list[Any], rate: float, every: int) -> dict[str, Any]:
    """Go along the path; times, what was raycast, and the pictures that are judged."""
    window = drawn_by.renderer.GetRenderWindow()
    window.SetDesiredUpdateRate(STILL)
    drawn_by.render(views[0])
    window.SetDesiredUpdateRate(rate)
    drawn_by.render(views[0])
    times, ways, pictures = [], [], []
    for number, view in enumerate(views):
        began = time.perf_counter()
        drawn_by.render(view)
        times.append(time.perf_counter() - began)
        ways.append(way_of(drawn_by))
        if number % every == 0:
            pictures.append(drawn_by.pixels())
        # A hand that waits for the next frame of the rate
        time.sleep(max(0.0, 1 / rate - times[-1]))
    window.SetDesiredUpdateRate(STILL)
    return {"times": times, "ways": ways, "pictures": pictures}


def main() -> None:
    """Measure, print and write."""
    parser = new_parser(__doc__)
    add_size(parser)
    add_volumes(parser, ["brain", "visible_female_head", "catphan"])
    add_looks(parser)
    parser.add_argument("--target-fps", type=float, default=30.0)
    parser.add_argument("--every", type=int, default=3, help="frames for one that is judged (3)")
    options = parser.parse_args()
    results, tables = {}, []
    for name in at_hand(options.volumes):
        subject = subject_of(name, options)
        volume = subject.volume
        voxel = min(volume.spacing)
        views = [subject.view.azimuth(360 * k / FRAMES) for k in range(FRAMES)]
        exact = own(subject, options, "volume", "never")
        prop = property_from_transfer_function(volume, subject.classified)
        candidates: dict[str, Any] = {
            "ours": (own(subject, options, "auto", "auto"), exact),
            "a VDI alone": (own(subject, options, "vdi", "never"), exact),
        }
        for mapper in ("gpu", "fixed_point"):
            theirs = VTKBaseline(volume, prop, options.size, mapper, voxel)
            theirs.adjust_by_rate()
            full = VTKBaseline(volume, prop, options.size, mapper, voxel / 2)
            candidates[mapper] = (theirs, full)
        results[name] = {}
        for who, (drawn_by, full) in candidates.items():
            found = shown(drawn_by, views, options.target_fps, options.every)
            ssim = [
                float(compare_images(picture, full.image(view)).ssim)
                for picture, view in zip(
                    found.pop("pictures"), views[:: options.every], strict=True
                )
            ]
            late = float(np.mean(np.array(found["times"]) > LATE / options.target_fps))
            tenths = [float(np.mean(part)) for part in np.array_split(ssim, PARTS)]
            results[name][who] = {**found, "ssim": ssim, "late": late, "tenths": tenths}
            drawn_by.close()
        for full in {id(full): full for _, full in candidates.values()}.values():
            full.close()
        tables.append(report(name, results[name]))
        print(tables[-1], flush=True)
    given = {n: getattr(options, n) for n in ("size", "tf", "target_fps", "interpolation")}
    target = results_file("turn", options)
    save({"options": given, "volumes": results}, target)
    write_text(target.with_suffix(".md"), "\n".join(tables))


def own(subject: Subject, options: Any, draw: str, regenerate: str) -> OurVolume:
    """Return our actor in a window that counts as watched."""
    volume, step = subject.volume, min(subject.volume.spacing) / 2
    look = looks_of(options)
    actor = OurVolume(volume, look, options.size, draw, step, subject.view, options.device)
    actor.mapper.SetInteractiveOffScreen(True)
    actor.mapper.SetRegenerate(regenerate)
    actor.mapper.SetTargetFrameRate(options.target_fps)
    return actor


def report(name: str, found: dict[str, Any]) -> str:
    """Return a table of what was found for a volume."""
    rows = [
        [
            who,
            f"{np.mean(of['ssim']):.4f}",
            " ".join(f"{x:.3f}"[1:] for x in of["tenths"]),
            f"{of['late']:.1%}",
            f"{1e3 * np.median(of['times']):.0f}",
            ", ".join(f"{way} {n}" for way, n in Counter(of["ways"]).items()),
        ]
        for who, of in found.items()
    ]
    heads = [name, "mean SSIM", "by tenths of the path", "late", "median ms", "frames of"]
    return "\n".join([*table(heads, rows), ""])


if __name__ == "__main__":
    main()
