"""What ``tests/extensions/insitu/test_mpi.py`` runs on ranks: names of cases, and a folder."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from pyvista_vdi.errors import InvalidArgumentError, NoDeviceError
from pyvista_vdi.extensions.insitu import InSitu

sys.path.insert(0, str(Path(__file__).parents[1]))
from support.march_ways import VIEWS, WINDOW, transfer_for, volume_of

COMM = MPI.COMM_WORLD
#: Where the volume's 47 x 41 x 50 points (z, y, x) are cut for four ranks.
CUTS = ((0, 24, 47), (0, 41), (0, 27, 50))


def own_block(volume, rank):
    """Return a rank's points and the index x, y, z of the first of them."""
    boxes = [
        (slice(z0, z1), slice(y0, y1), slice(x0, x1))
        for z0, z1 in zip(CUTS[0], CUTS[0][1:])  # noqa: B905
        for y0, y1 in zip(CUTS[1], CUTS[1][1:])  # noqa: B905
        for x0, x1 in zip(CUTS[2], CUTS[2][1:])  # noqa: B905
    ]
    box = boxes[rank]
    return volume.array[box].copy(), tuple(part.start for part in reversed(box))


def same(folder):
    """Write the VDI of four blocks, with gradients, which need others' points."""
    volume = volume_of("float32")
    function = transfer_for(volume, "linear", gradient_opacities=[0.2, 1], gradient_range=(0, 30))
    options = {"max_supersegments": 8, "precision": "exact"}
    options |= {"transfer_function": function, "comm": COMM}
    camera = VIEWS["all of it"](volume)
    with InSitu(folder / "mpi.vdis", camera, WINDOW, volume.dimensions, **options) as show:
        show(*own_block(volume, (COMM.rank + 3) % 4), 0.0)


def failing(folder):
    """One rank has no device: all must say so, and nobody waits."""
    volume = volume_of("uint8")
    values, first = own_block(volume, COMM.rank)
    scene = VIEWS["all of it"](volume), WINDOW, volume.dimensions
    options = {"clim": (0, 200), "comm": COMM, "overwrite": True}
    device = "nobody" if COMM.rank == 2 else None
    with (
        InSitu(folder / "f.vdis", *scene, device=device, **options) as show,
        pytest.raises(NoDeviceError, match="rank 2: .*nobody"),
    ):
        show(values, first, 0.0)
    with InSitu(folder / "f.vdis", *scene, **options) as show:
        with pytest.raises(InvalidArgumentError, match="one grid of blocks"):
            show(values[:, :, 1:], first, 0.0)
        with pytest.raises(InvalidArgumentError, match="values must be the same on all ranks"):
            show(values.astype("u1" if COMM.rank else "f4"), first, 0.0)


def series(folder):
    """Write a series of four steps, of which every second is left out."""
    volume = volume_of("float32")
    volume.array[np.isnan(volume.array)] = 0
    values, first = own_block(volume, COMM.rank)
    camera = VIEWS["all of it"](volume)
    options = {"clim": (0, 200), "every": 2, "max_supersegments": 6, "comm": COMM}
    with InSitu(folder / "run.vdis", camera, WINDOW, volume.dimensions, **options) as show:
        for step in range(4):
            show(values * (1 - 0.1 * step), first, 0.5 * step)
        assert len(show.seconds) == 2


if __name__ == "__main__":
    for case in sys.argv[1].split(","):
        {
            "same": same,
            "failing": failing,
            "series": series,
        }[case](Path(sys.argv[2]))
