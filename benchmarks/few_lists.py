"""Fewer lists and fewer pixels in turned views: SSIM lost, lists crossed, time over all of both.

Lists are thinned along the direction that rays cross them in (`--along crossed`), as previews do,
or along both edges (`--along both`). Losses are against volume rendering; fewer pixels are
interpolated linearly. Times are frames' of the raycaster, in turns.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from common import add_looks, add_size, add_volumes, at_hand, new_parser, save, subject_of

import pyvista_vdi as pvdi
from pyvista_vdi.measure.clock import median, take_turns
from pyvista_vdi.measure.report import table
from pyvista_vdi.measure.session import enlarged
from pyvista_vdi.model.thinned import lists_crossed, thinned

ANGLES = (15.0, 30.0, 60.0)
LOOKS = ("soft", "steep")
LISTS, PIXELS = (1, 2, 4), (1, 2, 4)
VOLUMES = ("brain", "bonsai", "rayleigh_taylor", "tooth", "heptane", "visible_female_head")


def main() -> None:
    """Measure, print and write."""
    parser = new_parser(__doc__, repeats=5, repeated="timed frames of each")
    add_size(parser, (640, 360))
    add_volumes(parser, list(VOLUMES))
    add_looks(parser, tf=None)
    parser.add_argument("--along", choices=("crossed", "both"), default="crossed")
    options = parser.parse_args()
    size, results = options.size, []
    for name in at_hand(options.volumes):
        for look in LOOKS:
            volume, classified, view = subject_of(name, options, look)
            shown = {"transfer_function": classified, "device": options.device}
            longest = options.max_supersegments
            vdi = pvdi.generate(volume, view, size, max_supersegments=longest, **shown)
            for angle in ANGLES:
                camera = view.azimuth(angle)
                truth = pvdi.render_volume(volume, camera, size, **shown)
                both = options.along == "both"
                few = {k: thinned(vdi, k, k if both else 1) for k in LISTS}
                work: dict[str, Any] = {}
                for k in LISTS:
                    for step in PIXELS:
                        small = (size[0] // step, size[1] // step)
                        work[f"{k} {step}"] = partial(
                            pvdi.render, few[k], camera, small, device=options.device
                        )
                taken = take_turns(work, options.repeats)
                for key, draw in work.items():
                    k, step = map(int, key.split())
                    picture = enlarged(draw(), size)
                    loss = 1 - float(pvdi.compare_images(picture, truth).ssim)
                    crossed = float(lists_crossed(few[k], camera).sum()) / step**2
                    row = (angle, k, step, loss, crossed, median(taken[key]))
                    results.append((f"{name}, {look}", *row))
            print(f"{name}, {look}", flush=True)
    heads = ["degrees", "every list", "every pixel", "SSIM lost, mean", "worst"]
    rows = []
    for angle in ANGLES:
        for k in LISTS:
            for step in PIXELS:
                found = [row for row in results if row[1:4] == (angle, k, step)]
                whole = [row for row in results if row[1:4] == (angle, 1, 1)]
                pairs = list(zip(found, whole, strict=True))
                crossed, times = (
                    np.exp(np.mean([np.log(f[i] / w[i]) for f, w in pairs])) for i in (5, 6)
                )
                lost = [row[4] for row in found]
                rows.append(
                    [
                        *(f"{x:g}" for x in (angle, k, step)),
                        *(f"{x:.4f}" for x in (np.mean(lost), max(lost))),
                        *(f"{x:.3f}" for x in (crossed, times)),
                    ]
                )
    print("\n".join(table([*heads, "lists crossed", "time"], rows)))
    save({"along": options.along, "size": size, "results": results}, options.out / "few_lists.json")


if __name__ == "__main__":
    main()
