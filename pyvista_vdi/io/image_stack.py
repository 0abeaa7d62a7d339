"""A folder of TIFF or PNG pictures as a volume, one slice each."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVolumeError, UnsupportedError, warn_external
from pyvista_vdi.io.time_steps import natural_key
from pyvista_vdi.model.host_memory import require_free_memory
from pyvista_vdi.model.volume import Volume

#: What pictures of slices are called, kind by kind.
_KINDS = ((".tif", ".tiff"), (".png",))

#: Where a DICOM file says that it is one.
_DICOM_AT, _DICOM = 128, b"DICM"


def slices_in(folder: Path) -> list[Path]:
    """Return the pictures in a folder, in natural order; none where there are DICOM slices."""
    files = [path for path in folder.iterdir() if path.is_file() and path.name[0] != "."]
    kinds = [[f for f in files if f.suffix.lower() in kind] for kind in _KINDS]
    pictures = [file for kind in kinds for file in kind]
    if not pictures or any(_is_dicom(file) for file in set(files) - set(pictures)):
        return []
    if all(kinds):
        raise InvalidVolumeError(
            f"the folder {folder} holds {len(kinds[0])} TIFF and {len(kinds[1])} PNG files: put "
            "the slices of one volume into a folder of their own"
        )
    return sorted(pictures, key=lambda file: natural_key(file.name.lower()))


def read_stack(files: list[Path]) -> Volume:
    """Read pictures as slices along z: rows run along x, the lowest first, as VTK has pictures.

    Grey values keep their type; RGBA of 8 bits is taken as colours with opacity. Spacing is 1.
    """
    folder = files[0].parent
    if len(files) < 2:
        raise InvalidVolumeError(f"the folder {folder} holds one slice: a volume needs two")
    found = [re.findall(r"\d+", file.stem) for file in files]
    numbers = [int(each[-1]) for each in found if each]
    if len(numbers) == len(files) and len(set(np.diff(numbers))) > 1:
        warn_external(
            f"the numbers of the slices in the folder {folder} are not evenly spaced "
            f"({files[0].name} to {files[-1].name}, {len(files)} files), and are taken as if: are "
            "some missing?"
        )
    first = _read(files[0])
    require_free_memory(
        first.nbytes * len(files), f"the {len(files)} slices in {folder}", "take fewer of them"
    )
    array = np.empty((len(files), *first.shape), dtype=first.dtype)
    for i, file in enumerate(files):
        picture = _read(file)
        if picture.shape != first.shape or picture.dtype != first.dtype:
            raise InvalidVolumeError(
                f"{file} is {_form(picture)}, and {files[0].name} is {_form(first)}: the slices of "
                "a volume have one size and one type"
            )
        array[i] = picture[::-1]
    return Volume(_grey(array, folder))


def _is_dicom(file: Path) -> bool:
    try:
        with file.open("rb") as stream:
            return stream.read(_DICOM_AT + len(_DICOM))[_DICOM_AT:] == _DICOM
    except OSError:
        return False


def _read(file: Path) -> NDArray[Any]:
    from skimage.io import imread

    try:
        picture = np.asarray(imread(file))
    except Exception as error:  # each format has readers, and exceptions, of its own
        raise InvalidVolumeError(f"{file} cannot be read as a picture: {error}") from error
    if picture.ndim != 2 and not (picture.ndim == 3 and picture.shape[2] in (2, 3, 4)):
        raise InvalidVolumeError(
            f"{file} is {_form(picture)}, not one slice: a file of several pages is a volume by "
            "itself, give its name in place of the folder's"
        )
    return picture


def _form(picture: NDArray[Any]) -> str:
    return f"{' x '.join(str(n) for n in picture.shape)} {picture.dtype}"


def _grey(array: NDArray[Any], folder: Path) -> NDArray[Any]:
    """Return scalars where colours are all grey and opaque, as many programs write them."""
    if array.ndim == 3:
        return array
    n_colors = array.shape[3] - 1 + array.shape[3] % 2  # without opacity
    most = 1 if array.dtype.kind == "f" else np.iinfo(array.dtype).max
    opaque = n_colors == array.shape[3] or bool((array[..., -1] == most).all())
    if opaque and all((array[..., 0] == array[..., i]).all() for i in range(1, n_colors)):
        return np.ascontiguousarray(array[..., 0])
    if array.shape[3] == 4 and array.dtype == np.uint8 and not opaque:
        return array
    raise UnsupportedError(
        f"the slices in the folder {folder} are coloured: write them as grey values, or as 8-bit "
        "RGBA whose fourth channel is the opacity"
    )
