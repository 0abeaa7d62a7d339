"""Volumes in files: raw, NumPy's and folders of pictures here, others by who can read them."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVolumeError
from pyvista_vdi.io import image_stack
from pyvista_vdi.io.time_steps import listed_steps, lists_steps
from pyvista_vdi.model.host_memory import require_free_memory
from pyvista_vdi.model.providers import provider
from pyvista_vdi.model.volume import VOXEL_TYPES, Volume

#: What NumPy raises for files that are no arrays: their header is a Python expression.
_BAD_ARRAY = (ValueError, TypeError, SyntaxError, OverflowError, RecursionError, TokenError)


def read_file(file: Path, by_pyvista: Callable[[Path], Any] | None = None) -> Any:
    """Read a volume of any format that can be read here, or a folder of slices.

    Raw files are those of the Open Scientific Visualization Datasets, whose names tell what they
    hold: ``kingsnake_1024x1024x795_uint8.raw``. NumPy's ``.npy`` holds scalars (nz, ny, nx). These,
    NRRD and folders of TIFF or PNG become a Volume and need no PyVista; others, folders of DICOM
    among them, become a ``pyvista.ImageData``, by another function where one is given.
    """
    if os.path.isdir(file):  # noqa: PTH112 - pathlib's raises for a name that is too long
        slices = image_stack.slices_in(file)
        if slices:
            return image_stack.read_stack(slices)
    suffix = file.suffix.lower()
    if lists_steps(file):
        return read_file(_only_step(file), by_pyvista)
    if suffix == ".raw":
        # Read bare scalars, little-endian, whose name says what they are
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
    if suffix == ".npy":
        return _read_npy(file)
    if suffix in (".nrrd", ".nhdr"):
        # By pynrrd: VTK takes the first axis for components in files that do not say what their
        # axes are
        return provider("read_nrrd")(file, "values")
    return (by_pyvista or provider("read_by_pyvista"))(file)


def needs_pyvista(file: Path) -> bool:
    """Whether a file, no folder, is read by PyVista: by its name."""
    known = (".raw", ".npy", ".nrrd", ".nhdr")
    folder = os.path.isdir(file)  # noqa: PTH112 - pathlib's raises for a name that is too long
    return not folder and file.suffix.lower() not in known


def _only_step(file: Path) -> Path:
    """Return the file that a list of time steps has, if it is one."""
    steps = listed_steps(file)
    if len(steps) > 1:
        raise InvalidVolumeError(
            f"{file} lists {len(steps)} time steps, and one volume is asked for: name the file of "
            f"one, such as {steps[0][0]}, or make a series of all (pyvista-vdi series)"
        )
    return steps[0][0]


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
