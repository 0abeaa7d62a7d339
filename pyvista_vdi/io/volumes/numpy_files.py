"""Arrays of NumPy, .npy and .npz."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np

from pyvista_vdi.errors import InvalidVolumeError
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile


def volumes_in(file: Path) -> list[VolumeInFile]:
    """Return the array of an .npy file, or those of three axes in an .npz file."""
    if not zipfile.is_zipfile(file):  # no .npz
        with file.open("rb") as stream:
            only = _array_in(lambda: file.open("rb"), stream)
        return [] if only is None else [only]
    with zipfile.ZipFile(file) as archive:
        found = []
        for member in archive.namelist():
            with archive.open(member) as packed:
                name = member.removesuffix(".npy")
                found.append(_array_in(partial(_opened, file, member), packed, name))
    return [volume for volume in found if volume is not None]


def _opened(file: Path, member: str) -> IO[bytes]:
    return zipfile.ZipFile(file).open(member)


def _array_in(
    opened: Callable[[], IO[bytes]], stream: IO[bytes], name: str = ""
) -> VolumeInFile | None:
    """Return an array by its header; ``None`` for one of an .npz file that is no volume."""
    version = np.lib.format.read_magic(stream)
    read = getattr(np.lib.format, f"read_array_header_{version[0]}_0")
    shape, _, dtype = read(stream)
    if name and len(shape) < 3:
        return None

    def values() -> Any:
        with opened() as again:
            return np.lib.format.read_array(again)  # which refuses objects

    return VolumeInFile(Lazy(shape, dtype, values), _axes(shape, dtype), name=name)


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
