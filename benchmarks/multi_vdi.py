"""What a joint frame of two VDIs costs, over the two frames by themselves.

    python benchmarks/multi_vdi.py
    python benchmarks/multi_vdi.py --volumes brain heptane --vdi-cache FOLDER

The second volume is scaled to the size of the first and put beside its centre, so that they share
about a third of their bounds. Candidates take turns; medians of the process's CPU time (and of the
wall clock) are printed as ratios. See README.md in this folder.
"""

from __future__ import annotations

import argparse

import numpy as np
from common import (  # beside this file
    add_looks,
    add_size,
    add_vdi_cache,
    new_parser,
    timed,
    vdi_of,
)
from numpy.typing import NDArray

from pyvista_vdi.api import render
from pyvista_vdi.model.vdi import VDI

#: Azimuths from the first VDI's generating view, degrees.
ANGLES = (0.0, 5.0, 30.0, 90.0)

#: Where the second volume's centre is, from the first one's, in extents of its bounds.
ASIDE = (0.3, 0.2, 0.1)


def main() -> None:
    """Measure, and print a table."""
    options = parsed()
    first, second = (vdi_of(name, options) for name in options.volumes)
    place = beside(first, second)
    print("| angle | joint / single frames, CPU time | wall clock | single frames, CPU ms |")
    print("|---|---|---|---|")
    for angle in ANGLES:
        camera = first.camera.azimuth(angle)
        moved = camera.replace(model_transform=place)

        def single(camera=camera, moved=moved):  # type: ignore[no-untyped-def]
            render(first, camera, options.size, device=options.device)
            render(second, moved, options.size, device=options.device)

        def joint(camera=camera):  # type: ignore[no-untyped-def]
            transforms = [np.eye(4), place]
            render(
                [first, second],
                camera,
                options.size,
                model_transforms=transforms,
                device=options.device,
            )

        for way in (single, joint):  # not counted
            way()
        times = timed({"single": single, "joint": joint}, options.repeats)
        cpu, wall = (
            [times[way][clock]["median"] for way in ("single", "joint")]
            for clock in ("cpu", "wall")
        )
        ratios = f"{cpu[1] / cpu[0]:.2f} | {wall[1] / wall[0]:.2f}"
        print(f"| {angle:g} | {ratios} | {1e3 * cpu[0]:.0f} |")


def beside(first: VDI, second: VDI) -> NDArray[np.float64]:
    """Return the matrix that puts the second volume beside the first one's centre."""
    (low, high), (low_2, high_2) = (np.reshape(v.bounds, (3, 2)).T for v in (first, second))
    scale = np.linalg.norm(high - low) / np.linalg.norm(high_2 - low_2)
    matrix = np.diag([scale, scale, scale, 1.0])
    centre = (low + high) / 2 + np.multiply(ASIDE, high - low)
    matrix[:3, 3] = centre - scale * (low_2 + high_2) / 2
    return matrix


def parsed() -> argparse.Namespace:
    """Return the options."""
    parser = new_parser(__doc__, repeats=7, repeated="timed frames of each kind", writes=False)
    parser.add_argument("--volumes", nargs=2, default=("brain", "rayleigh_taylor"))
    add_size(parser)
    add_looks(parser, interpolation=None)
    add_vdi_cache(parser)
    return parser.parse_args()


if __name__ == "__main__":
    main()
