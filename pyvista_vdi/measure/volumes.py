"""Volumes in files that need no PyVista to be read, and how volumes look without it."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVolumeError
from pyvista_vdi.examples import read_nrrd
from pyvista_vdi.measure import image_stack
from pyvista_vdi.model.host_memory import require_free_memory
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import VOXEL_TYPES, Volume

#: Entries of the transfer functions, as ``add_volume`` has them by default.
_ENTRIES = 256

#: Opacity at equidistant scalars, by look.
_OPACITIES: Mapping[str, tuple[float, ...]] = {
    # What add_volume's opacity="linear" is
    "ramp": (0.0, 1.0),
    # Air and its noise are transparent; tissue is translucent, bone is not
    "empty below a fifth": (0.0, 0.0, 0.02, 0.05, 0.3, 0.8),
    # One fluid is transparent, the other translucent
    "one of two fluids": (0.0, 0.0, 0.0, 0.01, 0.05, 0.15, 0.05, 0.01, 0.005),
}

#: RGB at equidistant scalars: black, blue-grey, white.
_COLORS = ((0.0, 0.0, 0.0), (0.25, 0.3, 0.45), (0.7, 0.7, 0.6), (1.0, 1.0, 1.0))

#: What NumPy raises for files that are no arrays: their header is a Python expression.
_BAD_ARRAY = (ValueError, TypeError, SyntaxError, OverflowError, RecursionError, TokenError)


def look(name: str, scalar_range: tuple[float, float], interpolation: str) -> TransferFunction:
    """Return a transfer function by its name: a key of the opacities above."""
    return TransferFunction(
        np.stack([_resampled(channel) for channel in zip(*_COLORS, strict=True)], axis=1),
        _resampled(_OPACITIES[name]),
        scalar_range,
        interpolation=interpolation,
    )


def _resampled(nodes: tuple[float, ...]) -> NDArray[np.float64]:
    at = np.linspace(0, len(nodes) - 1, _ENTRIES)
    return np.interp(at, np.arange(len(nodes)), nodes)


def read_file(file: Path) -> Any:
    """Read a volume of any format that can be read here, or a folder of slices.

    Raw files are those of the Open Scientific Visualization Datasets, whose names tell what they
    hold: ``kingsnake_1024x1024x795_uint8.raw``. NumPy's ``.npy`` holds scalars (nz, ny, nx). These,
    NRRD and folders of TIFF or PNG become a Volume and need no PyVista; others, folders of DICOM
    among them, become a ``pyvista.ImageData``.
    """
    if os.path.isdir(file):  # noqa: PTH112 - pathlib's raises for a name that is too long
        slices = image_stack.slices_in(file)
        if slices:
            return image_stack.read_stack(slices)
    suffix = file.suffix.lower()
    if suffix == ".raw":
        return _read_raw(file)
    if suffix == ".npy":
        return _read_npy(file)
    if suffix in (".nrrd", ".nhdr"):
        # By pynrrd: VTK takes the first axis for components in files that do not say what their
        # axes are
        return read_nrrd(file, "values")
    from pyvista_vdi.plotting.imports import import_pyvista

    import_pyvista()
    from pyvista_vdi.plotting.volume_files import read_volume

    return read_volume(file)


def _read_raw(file: Path) -> Volume:
    found = re.search(r"_(\d+)x(\d+)x(\d+)_([a-z]+\d+)\.raw$", file.name, re.IGNORECASE)
    if found is None or found[4].lower() not in VOXEL_TYPES:
        raise InvalidVolumeError(
            f"{file} does not say what it holds: name raw files like "
            f"kingsnake_1024x1024x795_uint8.raw, with a type of {', '.join(VOXEL_TYPES)}"
        )
    nx, ny, nz = (int(found[i]) for i in (1, 2, 3))
    if not os.path.isfile(file):  # noqa: PTH113 - pathlib's raises for a name that is too long
        raise InvalidVolumeError(f"{file} does not exist: check the volume's path")
    dtype = np.dtype(found[4].lower()).newbyteorder("<")
    expected = nx * ny * nz * dtype.itemsize
    if file.stat().st_size != expected:
        raise InvalidVolumeError(
            f"{file} has {file.stat().st_size} bytes; {nx} x {ny} x {nz} of {found[4].lower()} "
            f"are {expected}"
        )
    require_free_memory(expected, f"the volume in {file.name}", "take a smaller one")
    array: NDArray[Any] = np.fromfile(file, dtype).reshape(nz, ny, nx)
    return Volume(array.astype(dtype.newbyteorder("="), copy=False))


def _read_npy(file: Path) -> Volume:
    try:
        # In place: what a header declares is held against the file's size, and objects are refused
        array = np.lib.format.open_memmap(file, mode="r")
    except OSError as error:
        raise InvalidVolumeError(f"{file} cannot be read: {error.strerror or error}") from error
    except _BAD_ARRAY as error:
        raise InvalidVolumeError(
            f"{file} cannot be read as an array ({error}): write one by numpy.save"
        ) from error
    return Volume(array)
