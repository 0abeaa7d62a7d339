"""What each parameter of generation costs and brings: one is changed at a time.

Writes ``parameters_WxH.json`` and ``.md``; SSIM is against our volume raycaster at the same step.
"""

from __future__ import annotations

import argparse
import sys
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
from tqdm import tqdm

from pyvista_vdi.api import render, render_volume
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.measure.report import table, write_text
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume

#: What is changed; the first row is the default. ``lists`` is the VDI's window over the frame's.
VARIANTS: tuple[dict[str, float], ...] = (
    {},
    *({"max_supersegments": n} for n in (5, 10, 15, 30, 40)),
    *({"tolerance": t} for t in (0.01, 0.03, 0.1)),
    *({"view_cone": degrees} for degrees in (0, 30, 90)),
    *({"lists": factor} for factor in (0.5, 2.0)),
)

ANGLES = (5.0, 30.0, 60.0)


def main() -> int:
    """Measure, and write what was found."""
    parser = new_parser(__doc__)
    add_size(parser)
    add_volumes(parser, ["brain", "rayleigh_taylor"])
    add_looks(parser, tf="nearly-opaque", max_supersegments=None)
    options = parser.parse_args()
    rows = []
    names = at_hand(options.volumes)
    with tqdm(total=len(names) * len(VARIANTS), unit="VDI") as bar:
        for name in names:
            for row in measured(name, options):
                rows.append(row)
                bar.update()
    target = results_file("parameters", options)
    results = {
        "window_size": list(options.size),
        "transfer_function": options.tf,
        "interpolation": options.interpolation,
        "rows": rows,
    }
    save(results, target)
    write_text(target.with_suffix(".md"), "\n".join([*described(results), ""]))
    return 0


def measured(name: str, options: argparse.Namespace) -> Any:
    """Yield a row for each variant."""
    volume, classified, view = subject_of(name, options)
    references = {
        angle: render_volume(
            volume, view.azimuth(angle), options.size, transfer_function=classified
        )
        for angle in ANGLES
    }
    for variant in VARIANTS:
        vdi = generated(volume, view, options.size, classified, **variant)
        occupied = int(np.count_nonzero(np.diff(vdi.offsets)))
        found = {
            angle: compare_images(render(vdi, view.azimuth(angle), options.size), references[angle])
            for angle in ANGLES
        }
        yield {
            "volume": name,
            "variant": variant,
            "per_list": vdi.n_supersegments / max(1, occupied),
            "bytes": vdi.nbytes,
            "ssim": [found[angle].ssim for angle in ANGLES],
            "brightness": [found[angle].mean_brightness_ratio for angle in ANGLES],
        }


def generated(
    volume: Volume,
    view: Any,
    size: tuple[int, int],
    classified: Any,
    *,
    lists: float = 1.0,
    **arguments: Any,
) -> VDI:
    """Generate a VDI with ``lists`` times as many lists along each edge as the frame has pixels."""
    window = (round(size[0] * lists), round(size[1] * lists))
    return generate_vdi(volume, view, window, classified, **arguments)


def described(results: dict[str, Any]) -> list[str]:
    """Return the rows as Markdown."""
    width, height = results["window_size"]
    looks = f"transfer function {results['transfer_function']}, `{results['interpolation']}`"
    lines = [
        f"{width} x {height}, {looks}; default: 20 supersegments, tolerance 0, view cone 60,",
        "one list per pixel of the frame.",
        "",
    ]
    heads = ("volume", "changed", "per list", "MiB", "SSIM 5°", "30°", "60°", "brightness 5°")
    rows = []
    for row in results["rows"]:
        changed = ", ".join(f"{k} = {v:g}" for k, v in row["variant"].items()) or "nothing"
        cells = [row["volume"], changed, f"{row['per_list']:.1f}", f"{row['bytes'] / 2**20:.1f}"]
        cells += [f"{value:.4f}" for value in (*row["ssim"], *row["brightness"])]
        rows.append(cells)
    return [*lines, *table((*heads, "30°", "60°"), rows)]


if __name__ == "__main__":
    sys.exit(main())
