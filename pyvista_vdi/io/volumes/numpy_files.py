"""Arrays of NumPy, .npy and .npz, and raw files whose names say what they hold."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from pyvista_vdi.errors import InvalidVolumeError
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile
from pyvista_vdi.model.volume import VOXEL_TYPES

_NAMED = re.compile(r"_(\d+)x(\d+)x(\d+)_([a-z]+\d+)\.raw$", re.IGNORECASE)


def volumes_in(file: Path) -> list[VolumeInFile]:
    """Return the array of an .npy file, or those of three axes in an .npz file."""
    if file.suffix.lower() == ".raw":
        return [_raw(file)]
    with file.open("rb") as stream:
        if stream.read(2) != b"PK":  # no .npz
            # In place: a header's claims are held against the file's size, objects are refused
            array = np.lib.format.open_memmap(file, mode="r")
            return [VolumeInFile(array, _axes(array.shape, array.dtype))]
    found = []
    with zipfile.ZipFile(file) as archive:
        for member in archive.namelist():
            name = member.removesuffix(".npy")
            with archive.open(member) as packed:
                version = np.lib.format.read_magic(packed)
                read = getattr(np.lib.format, f"read_array_header_{version[0]}_0")
                shape, _, dtype = read(packed)
            if len(shape) > 2:

                def read_one(name: str = name) -> Any:
                    with np.load(file, allow_pickle=False) as again:
                        return again[name]

                lazy = Lazy(shape, dtype, read_one)
                found.append(VolumeInFile(lazy, _axes(shape, dtype), name=name))
    return found


def _axes(shape: tuple[int, ...], dtype: np.dtype[Any]) -> str:
    """Return the axes of an array, which does not say them: z, y, x, colours behind them."""
    if len(shape) == 3:
        return "zyx"
    if len(shape) == 4 and shape[3] == 4 and dtype == np.uint8:
        return "zyxs"
    raise InvalidVolumeError(
        f"it holds an array of shape {shape}, which does not say what its axes are: a volume has "
        "three, (z, y, x): save one of them"
    )


def _raw(file: Path) -> VolumeInFile:
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
    return VolumeInFile(np.memmap(file, dtype, "r", shape=(nz, ny, nx)))
