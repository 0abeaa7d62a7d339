"""MRC and CCP4 maps of electron microscopy, by mrcfile."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pyvista_vdi.io.axes import to_world
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile

#: A cell that the header does not give is of voxels of size 1.
_ANGSTROM = "angstrom"


def volumes_in(file: Path) -> list[VolumeInFile]:
    """Return the map, axes as MAPC, MAPR and MAPS have them; lengths in angstrom."""
    import mrcfile

    with mrcfile.open(file, header_only=True) as mrc:
        header = mrc.header
        dtype = mrcfile.utils.dtype_from_mode(header.mode)
        shape: tuple[int, ...] = int(header.nz), int(header.ny), int(header.nx)
        axes = "".join(
            "?xyz"[n] if n in (1, 2, 3) else "?"
            for n in (int(header.maps), int(header.mapr), int(header.mapc))
        )
        if sorted(axes) != ["x", "y", "z"]:  # as programs before 2000 leave them
            axes = "zyx"
        cell = [float(header.cella[a]) for a in "xyz"]
        counts = [int(n) for n in (header.mx, header.my, header.mz)]
        origin = np.array([float(header.origin[a]) for a in "xyz"])
        first = dict(zip(axes[::-1], (header.nxstart, header.nystart, header.nzstart), strict=True))
        several = int(header.ispg) > 400  # volumes
    step = np.array([c / n if c > 0 and n > 0 else 1.0 for c, n in zip(cell, counts, strict=True)])
    if not origin.any():  # CCP4's maps have whole voxels in place of an origin
        origin = np.array([int(first[a]) for a in "xyz"]) * step
    if several and counts[2] > 0 and shape[0] % counts[2] == 0:
        shape, axes = (shape[0] // counts[2], counts[2], *shape[1:]), "t" + axes

    def read() -> Any:
        with mrcfile.open(file) as mrc:
            return np.array(mrc.data).reshape(shape)

    return [VolumeInFile(Lazy(shape, dtype, read), axes, to_world(step, origin), unit=_ANGSTROM)]
