"""Raw files, whose names say what they hold."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import numpy as np

from pyvista_vdi.errors import InvalidVolumeError
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile
from pyvista_vdi.model.volume import VOXEL_TYPES

_NAMED = re.compile(r"_(\d+)x(\d+)x(\d+)_([a-z]+\d+)\.raw$", re.IGNORECASE)


def volumes_in(file: Path) -> list[VolumeInFile]:
    """Return bare scalars, little-endian, x fastest."""
    found = _NAMED.search(file.name)
    if found is None or found[4].lower() not in VOXEL_TYPES:
        raise InvalidVolumeError(
            f"{file} does not say what it holds: name raw files like "
            f"kingsnake_1024x1024x795_uint8.raw, with a type of {', '.join(VOXEL_TYPES)}"
        )
    nx, ny, nz = (int(found[i]) for i in (1, 2, 3))
    dtype = np.dtype(found[4].lower()).newbyteorder("<")
    expected, size = nx * ny * nz * dtype.itemsize, file.stat().st_size
    if size != expected or not size:
        raise InvalidVolumeError(
            f"{file} has {size} bytes; {nx} x {ny} x {nz} of {found[4].lower()} are {expected}"
        )
    # Read, not mapped: a file that shrinks under a map kills the process
    values = partial(np.fromfile, file, dtype)
    return [VolumeInFile(Lazy((nz, ny, nx), dtype, lambda: values().reshape(nz, ny, nx)))]
