"""Folders of TIFF or PNG pictures, one slice each, by tifffile and scikit-image."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVolumeError, warn_external
from pyvista_vdi.io.time_steps import natural_key
from pyvista_vdi.io.volumes.in_file import VolumeInFile, form, stack
from pyvista_vdi.io.volumes.table import head_of

#: What pictures of slices are called, kind by kind.
_KINDS = ((".tif", ".tiff"), (".png",))


def slices_in(folder: Path) -> list[Path]:
    """Return the pictures in a folder, in natural order; none where there are DICOM slices."""
    files = [path for path in folder.iterdir() if path.is_file() and path.name[0] != "."]
    kinds = [[f for f in files if f.suffix.lower() in kind] for kind in _KINDS]
    pictures = [file for kind in kinds for file in kind]
    if not pictures or any(
        head_of(file)[128:132] == b"DICM" for file in set(files) - set(pictures)
    ):
        return []
    if all(kinds):
        raise InvalidVolumeError(
            f"the folder {folder} holds {len(kinds[0])} TIFF and {len(kinds[1])} PNG files: put "
            "the slices of one volume into a folder of their own"
        )
    return sorted(pictures, key=lambda file: natural_key(file.name.lower()))


def volumes_in(path: Path) -> list[VolumeInFile]:
    """Return pictures as slices along z: the top row is the last along y, as VTK has pictures.

    Grey values keep their type; RGBA of 8 bits is taken as colours with opacity. Spacing is 1.
    """
    files = slices_in(path)
    if len(files) < 2:
        raise InvalidVolumeError(f"the folder {path} holds one slice: a volume needs two")
    found = [re.findall(r"\d+", file.stem) for file in files]
    numbers = [int(each[-1]) for each in found if each]
    if len(numbers) == len(files) and len(set(np.diff(numbers))) > 1:
        warn_external(
            f"the numbers of the slices in the folder {path} are not evenly spaced "
            f"({files[0].name} to {files[-1].name}, {len(files)} files), and are taken as if: are "
            "some missing?"
        )
    array = stack(files, _read)
    return [VolumeInFile(array, "zyxs"[: len(array.shape)])]


def _read(file: Path) -> NDArray[Any]:
    try:
        if file.suffix.lower() in _KINDS[0]:
            import tifffile

            picture = tifffile.imread(file)
        else:
            from skimage.io import imread

            with file.open("rb") as stream:
                picture = np.asarray(imread(stream))
    except Exception as error:  # each format has readers, and exceptions, of its own
        raise InvalidVolumeError(f"{file} cannot be read as a picture: {error}") from error
    if picture.ndim != 2 and not (picture.ndim == 3 and picture.shape[2] in (2, 3, 4)):
        raise InvalidVolumeError(
            f"{file} is {form(picture)}, not one slice: a file of several pages is a volume by "
            "itself, give its name in place of the folder's"
        )
    return picture[::-1]
