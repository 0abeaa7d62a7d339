"""DICOM by pydicom: folders of slices, and files of several frames (enhanced, dose, NM).

Coordinates are the patient's: left, back, head; millimetres. Rows count downwards, slices along the
normal, the cross product of the directions of columns and rows.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVolumeError, UnsupportedError, warn_external
from pyvista_vdi.io.axes import to_world
from pyvista_vdi.io.volumes.in_file import REMEDY, Lazy, VolumeInFile, head_of

_APART = "put those that belong together into a folder of their own"
#: Functional groups that say where a frame lies, how large its pixels are, what its values mean.
_GROUPS = ("PlanePosition", "PlaneOrientation", "PixelMeasures", "PixelValueTransformation")


def dicom(path: Path) -> list[VolumeInFile]:
    """Return the series of a folder, or that of a file of several frames."""
    import pydicom

    series, found = defaultdict(list), []
    wrong: list[Exception] = []
    files = sorted(file for file in path.iterdir() if file.is_file()) if path.is_dir() else [path]
    with pydicom.config.disable_value_validation():  # else it warns of each long number
        for file in files:
            try:
                for one in _slices(file):
                    series[one.header.get("SeriesInstanceUID", "")].append(one)
            except Exception as error:  # damage shows at whatever pydicom comes to first
                wrong.append(InvalidVolumeError(f"{file} cannot be read as DICOM: {error}"))
        for uid, those in series.items():
            try:
                if len(those) > 1:  # a localiser is one
                    name = str(those[0].header.get("SeriesDescription") or uid)
                    found.append(_volume(path, those, name))
            except Exception as error:  # of ours, or of what decodes pixels
                wrong.append(error)
    if not series and not wrong and path.is_dir():
        found = _pictures(path)
    if not found:
        none = f"{path} holds no slices of DICOM, PNG or TIFF, or one: give the folder of them all"
        raise wrong[-1] if wrong else InvalidVolumeError(none)
    if wrong:
        left_out = f"{len(wrong)} files or series in the folder {path} are left out"
        warn_external(f"{left_out}; the first: {wrong[0]}")
    return found


def _pictures(folder: Path) -> list[VolumeInFile]:
    """Return PNG and TIFF pictures as slices along z, the 10th after the 9th; top rows are last."""
    from skimage.io import imread

    files = [each for each in folder.iterdir() if each.suffix.lower() in (".png", ".tif", ".tiff")]
    if len(files) < 2:
        return []
    files.sort(key=lambda file: re.sub(r"\d+", lambda number: number[0].zfill(24), file.name))
    first = imread(files[0])
    shape, whole = (len(files), *first.shape), lambda: np.stack([*map(imread, files)])[:, ::-1]
    return [VolumeInFile(Lazy(shape, first.dtype, whole), "zyxs"[: len(shape)])]


def _slices(file: Path) -> list[Any]:
    """Return the frames of a file, none where it is no DICOM image.

    Each has its ``frame`` in the ``file``, the ``header`` of that; ``position``, the centre of its
    first pixel, (3,), in the patient's frame; ``turn``, directions of columns and rows, (6,);
    ``spacing`` between rows and between columns, millimetres: of these what the file does not say
    is empty.
    """
    import pydicom

    if head_of(file)[128:132] != b"DICM":
        return []
    data = pydicom.dcmread(file, stop_before_pixels=True)
    if "Rows" not in data:  # a directory, a report, a plan ...
        if pydicom.uid.UID(data.get("SOPClassUID", "")).name.endswith("Image Storage"):
            raise EOFError("it ends within its header")
        return []
    if len(data.get("SegmentSequence", ())) > 1:
        raise InvalidVolumeError(f"it holds several segments: {REMEDY}")
    count = int(data.get("NumberOfFrames") or 1)
    shared = (data.get("SharedFunctionalGroupsSequence") or [{}])[0]
    own = data.get("PerFrameFunctionalGroupsSequence")
    detector = (data.get("DetectorInformationSequence") or [{}])[0]
    apart = data.get("SpacingBetweenSlices") or data.get("SliceThickness") or np.nan
    offsets = np.array(data.get("GridFrameOffsetVector") or np.arange(count) * float(apart))
    found = []
    for i in range(count):
        # Take what is said of the detector, the file, all its frames and this one, the last first
        header = pydicom.Dataset()
        frames = (shared, own[i]) if own else (shared,)
        groups = [each.get(f"{name}Sequence") for each in frames for name in _GROUPS]
        for said in (detector, data, *(group[0] for group in groups if group)):
            header.update(said)
        names = ("ImagePositionPatient", "ImageOrientationPatient", "PixelSpacing")
        position, turn, spacing = (np.array(header.get(n) or (), np.float64) for n in names)
        if count > 1 and not (len(position) and len(turn)):
            raise InvalidVolumeError(f"it holds {count} frames that do not say where they lie")
        if count > 1 and not own:
            position = position + (offsets[i] - offsets[0]) * np.cross(turn[:3], turn[3:])
        told = {"position": position, "turn": turn, "spacing": spacing}
        found.append(SimpleNamespace(file=file, frame=i, header=header, **told))
    return found


def _volume(path: Path, slices: list[Any], name: str) -> VolumeInFile:
    """Return a series in the order of its places."""
    slices.sort(key=lambda one: (one.header.get("InstanceNumber") or 0, one.file.name, one.frame))
    first, what = slices[0], f"slices in {path}"
    if first.header.get("SamplesPerPixel", 1) != 1:
        raise UnsupportedError(f"{what} hold colours: convert them to grey values")
    rows, columns = first.spacing if len(first.spacing) and first.spacing.min() > 0 else (1.0, 1.0)
    if not len(first.spacing):
        warn_external(f"{what} do not say how large pixels are, and 1 mm is taken: give spacing=")
    if any(len(one.position) != 3 or len(one.turn) != 6 for one in slices):
        raise InvalidVolumeError(
            f"{what} do not say where they lie or how they are turned: {REMEDY}"
        )
    if any(
        not np.array_equal(one.spacing, first.spacing)
        or not np.allclose(one.turn, first.turn, atol=1e-3)
        or (one.header.Rows, one.header.Columns) != (first.header.Rows, first.header.Columns)
        for one in slices
    ):
        raise InvalidVolumeError(
            f"{what} are turned against each other, or are of several sizes: {_APART}"
        )
    along, down = first.turn.reshape(2, 3)
    slices.sort(key=lambda one: one.position @ np.cross(along, down))
    gaps = np.diff([one.position @ np.cross(along, down) for one in slices])
    if not gaps.min() > 0.01 * gaps.mean():
        raise InvalidVolumeError(f"several {what} lie in the same place, or in none: {_APART}")
    if np.ptp(gaps) > 0.01 * gaps.mean():  # more are missing slices
        apart = f"{gaps.min():g} to {gaps.max():g} apart, and are taken as {gaps.mean():g} apart"
        warn_external(f"{what} are {apart}: some are missing, or resample them")
    # The step is along the normal, unless a gantry was tilted
    step = (slices[-1].position - slices[0].position) / len(gaps)
    place = to_world(np.column_stack([along * columns, down * rows, step]), slices[0].position)
    return VolumeInFile(_stack(slices), "zyx", place, name, "mm")


def _stack(slices: list[Any]) -> Lazy:
    """Return slices of one size along z, of a type that holds the values of all."""
    from pydicom.pixels import pixel_array

    decoded = lru_cache(maxsize=1)(pixel_array)  # once for all frames of a file

    def one(i: int) -> NDArray[Any]:
        try:
            return _values(slices[i], decoded)
        except Exception as error:  # of whatever decodes it
            why = f"({' '.join(str(error).split())}): write it anew, uncompressed"
            raise InvalidVolumeError(f"{slices[i].file} cannot be read as a slice {why}") from error

    first, count = one(0), len(slices)
    return Lazy((count, *first.shape), first.dtype, lambda: np.stack([*map(one, range(count))]))


def _values(one: Any, decoded: Callable[[Path], NDArray[Any]]) -> NDArray[Any]:
    """Return the values that a slice means: whole numbers where slope and intercept are."""
    from pydicom.pixels import apply_modality_lut

    header = one.header
    stored = decoded(one.file).reshape(-1, header.Rows, header.Columns)[one.frame]
    if header.get("ModalityLUTSequence"):  # in place of a line
        return np.asarray(apply_modality_lut(stored, header))
    slope = float(header.get("DoseGridScaling") or header.get("RescaleSlope") or 1)
    intercept = float(header.get("RescaleIntercept") or 0)
    if slope == 1 and intercept == 0:
        return stored
    means = stored * slope + intercept
    if slope.is_integer() and intercept.is_integer():
        # By what may be stored, so that the slices of a series have one type
        bits, signed = int(header.BitsStored), int(header.PixelRepresentation)
        may = np.array([-signed << bits - 1, (1 << bits - signed) - 1]) * slope + intercept
        least, most = min(*may, means.min()), max(*may, means.max())
        for kind in ("uint8", "int16", "uint16", "int32"):
            if np.iinfo(kind).min <= least and most <= np.iinfo(kind).max:
                return means.astype(kind)
    return means.astype(np.float32)
