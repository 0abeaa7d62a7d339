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
from common import add_looks, add_size, add_volumes, at_hand, looks_of, new_parser, save, subject_of

from pyvista_vdi.measure.front import OurVolume
from pyvista_vdi.measure.report import table
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


def shown(drawn_by: Any, views: list[Any], rate: float) -> dict[str, Any]:
    """Go along the path; times, what was raycast, and pictures."""
    window = drawn_by.renderer.GetRenderWindow()
    window.SetDesiredUpdateRate(STILL)
    drawn_by.render(views[0])
    window.SetDesiredUpdateRate(rate)
    drawn_by.render(views[0])
    times, ways, pictures = [], [], []
    for view in views:
        began = time.perf_counter()
        drawn_by.render(view)
        times.append(time.perf_counter() - began)
        ways.append(way_of(drawn_by))
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
    results = {}
    for name in at_hand(options.volumes):
        subject = subject_of(name, options)
        volume, look, size = subject.volume, looks_of(options), options.size
        voxel = min(volume.spacing)
        views = [subject.view.azimuth(360 * k / FRAMES) for k in range(FRAMES)]
        ours = OurVolume(volume, look, size, "auto", voxel / 2, subject.view, options.device)
        ours.mapper.SetInteractiveOffScreen(True)
        ours.mapper.SetRegenerate("auto")
        ours.mapper.SetTargetFrameRate(options.target_fps)
        exact = OurVolume(volume, look, size, "volume", voxel / 2, subject.view, options.device)
        prop = property_from_transfer_function(volume, subject.classified)
        candidates = {"ours": (ours, exact)}
        for mapper in ("gpu", "fixed_point"):
            theirs = VTKBaseline(volume, prop, size, mapper, voxel)
            theirs.adjust_by_rate()
            full = VTKBaseline(volume, prop, size, mapper, voxel / 2)
            candidates[mapper] = (theirs, full)
        results[name] = {}
        for who, (drawn_by, full) in candidates.items():
            found = shown(drawn_by, views, options.target_fps)
            ssim = [
                float(compare_images(picture, full.image(view)).ssim)
                for picture, view in zip(
                    found.pop("pictures")[:: options.every], views[:: options.every], strict=True
                )
            ]
            late = float(np.mean(np.array(found["times"]) > LATE / options.target_fps))
            tenths = [float(np.mean(part)) for part in np.array_split(ssim, PARTS)]
            results[name][who] = {**found, "ssim": ssim, "late": late, "tenths": tenths}
            drawn_by.close()
            full.close()
        report(name, results[name])
    given = {n: getattr(options, n) for n in ("size", "tf", "target_fps", "interpolation")}
    save({"options": given, "volumes": results}, options.out / "turn.json")


def report(name: str, found: dict[str, Any]) -> None:
    """Print what was found for a volume."""
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
    print("\n".join(table(heads, rows)), flush=True)


if __name__ == "__main__":
    main()
