"""What ``tests/insitu/test_mpi.py`` runs on several ranks, by the names of cases and a folder."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from pyvista_vdi.errors import DeviceError, InvalidArgumentError
from pyvista_vdi.insitu import InSitu
from pyvista_vdi.large.on_mpi import generate_on_mpi
from pyvista_vdi.model.grid import Grid

sys.path.insert(0, str(Path(__file__).parents[1]))
from support.march_ways import VIEWS, WINDOW, transfer_for, volume_of

COMM = MPI.COMM_WORLD
#: Where the volume's 47 x 41 x 50 points (z, y, x) are cut for four ranks.
CUTS = ((0, 20, 47), (0, 41), (0, 27, 50))


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
    """Write the VDI of four blocks, with gradients and occlusion, which need others' points."""
    volume = volume_of("uint8")
    values, first = own_block(volume, (COMM.rank + 3) % 4)
    function = transfer_for(volume, "linear", gradient_opacities=[0.2, 1], gradient_range=(0, 30))
    vdi = generate_on_mpi(
        values,
        first,
        Grid.of(volume),
        VIEWS["all of it"](volume),
        WINDOW,
        function,
        max_supersegments=8,
        ambient_occlusion=8.0,
        comm=COMM,
    )
    assert (vdi is None) == (COMM.rank > 0)
    if vdi is not None:
        vdi.save(folder / "mpi.vdi")


def failing(_folder):
    """One rank's driver fails: all must say so, and nobody waits."""
    volume = volume_of("uint8")
    values, first = own_block(volume, COMM.rank)
    device = "nobody" if COMM.rank == 2 else None
    arguments = (Grid.of(volume), VIEWS["all of it"](volume), WINDOW, transfer_for(volume))
    with pytest.raises(DeviceError, match="rank 2: .*nobody"):
        generate_on_mpi(values, first, *arguments, comm=COMM, device=device)
    with pytest.raises(InvalidArgumentError, match="one grid of blocks"):
        generate_on_mpi(values[:, :, 1:], first, *arguments, comm=COMM)


def series(folder):
    """Write a series of four steps, of which every second is left out, and single files."""
    volume = volume_of("float32")
    volume.array[np.isnan(volume.array)] = 0
    values, first = own_block(volume, COMM.rank)
    camera = VIEWS["all of it"](volume)
    options = {"clim": (0, 200), "every": 2, "max_supersegments": 6}
    dimensions = volume.dimensions
    with (
        InSitu(folder / "run.vdis", camera, WINDOW, dimensions, comm=COMM, **options) as show,
        InSitu(
            str(folder / "s{:02d}.vdi"), camera, WINDOW, dimensions, comm=COMM, **options
        ) as one,
    ):
        for step in range(4):
            for writer in (show, one):
                writer(values * (1 - 0.1 * step), first, 0.5 * step)
        assert len(show.seconds) == 2


if __name__ == "__main__":
    for case in sys.argv[1].split(","):
        {"same": same, "failing": failing, "series": series}[case](Path(sys.argv[2]))
