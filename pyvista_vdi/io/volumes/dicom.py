"""DICOM by pydicom: folders of slices, and files of several frames (enhanced, dose, NM).

Coordinates are the patient's: left, back, head; millimetres. Rows count downwards, slices along the
normal, the cross product of the directions of columns and rows.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from functools import lru_cache, partial
from operator import itemgetter
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVolumeError, UnsupportedError, VDIError, warn_external
from pyvista_vdi.io.axes import to_world
from pyvista_vdi.io.volumes.in_file import REMEDY, VolumeInFile, head_of, stack

_APART = "put those that belong together into a folder of their own"


def dicom(path: Path) -> list[VolumeInFile]:
    """Return the series of a folder, or that of a file of several frames."""
    import pydicom

    series, found = defaultdict(list), []
    wrong: list[tuple[int, Exception]] = []  # and how many slices cannot be shown; 0: damage
    files = sorted(file for file in path.iterdir() if file.is_file()) if path.is_dir() else [path]
    with pydicom.config.disable_value_validation():  # else it warns of each long number
        for file in files:
            try:
                for one in _slices(file):
                    series[one.header.get("SeriesInstanceUID", "")].append(one)
            except UnsupportedError as error:
                wrong.append((len(files), error))
            except Exception as error:  # damage shows at whatever pydicom comes to first
                said = f"{file} cannot be read as a DICOM slice: {error}"
                wrong.append((0, InvalidVolumeError(said)))
        damaged = [why for count, why in wrong if not count]
        for uid, those in series.items():
            try:
                name = str(those[0].header.get("SeriesDescription") or uid)
                found.append(_volume(path, those, name))
            except VDIError as error:
                wrong.append((len(those), error))
    if not found:
        none = f"{path} holds no slices of DICOM, TIFF or PNG: give the folder that holds them"
        raise max(wrong, key=itemgetter(0), default=(0, InvalidVolumeError(none)))[1]
    if damaged:
        left_out = f"{len(damaged)} of {len(files)} files in the folder {path} are left out"
        warn_external(f"{left_out}, as they are damaged; the first: {damaged[0]}")
    for count, why in wrong:
        if count > 1:
            warn_external(f"a series of {count} slices is left out: {why}")
    return found


def _slices(file: Path) -> list[Any]:
    """Return the frames of a file, none where it is no DICOM image.

    Each has its ``frame`` in the ``file``, the ``header`` of that; ``position``, the centre of its
    first pixel, (3,), in the patient's frame; ``turn``, directions of columns and rows, (6,);
    ``spacing`` between rows and between columns, millimetres: of these what the file does not say
    is empty; and ``line``, slope and intercept of its values.
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
        raise UnsupportedError(f"{file} holds several segments: {REMEDY}")
    count = int(data.get("NumberOfFrames") or 1)
    own = data.get("PerFrameFunctionalGroupsSequence")
    shared = data.get("SharedFunctionalGroupsSequence") or [{}]
    detector = (data.get("DetectorInformationSequence") or [{}])[0]

    def of(i: int, group: str, name: str, default: Any) -> NDArray[np.float64]:
        """Return numbers of a frame's, of all frames', of the file's or of its detector's."""
        for where in ((own or shared)[i if own else 0], shared[0]):
            if where.get(group):
                return np.array(where[group].value[0].get(name, default), dtype=np.float64)
        return np.array(data.get(name) or detector.get(name) or default, dtype=np.float64)

    apart = data.get("SpacingBetweenSlices") or data.get("SliceThickness") or np.nan
    offsets = np.array(data.get("GridFrameOffsetVector") or np.arange(count) * float(apart))
    found = []
    for i in range(count):
        position = of(i, "PlanePositionSequence", "ImagePositionPatient", ())
        turn = of(i, "PlaneOrientationSequence", "ImageOrientationPatient", ())
        if count > 1 and not own and len(position) and len(turn):
            position = position + (offsets[i] - offsets[0]) * np.cross(turn[:3], turn[3:])
        if count > 1 and not (len(turn) and len(position) and np.isfinite(position).all()):
            raise UnsupportedError(f"{file} holds {count} frames that do not say where they lie")
        values = "PixelValueTransformationSequence"
        slope = data.get("DoseGridScaling") or of(i, values, "RescaleSlope", 1)
        line = float(slope) or 1.0, float(of(i, values, "RescaleIntercept", 0))
        spacing = of(i, "PixelMeasuresSequence", "PixelSpacing", ())
        told = {"position": position, "turn": turn, "spacing": spacing, "line": line}
        found.append(SimpleNamespace(file=file, frame=i, header=data, **told))
    return found


def _volume(path: Path, slices: list[Any], name: str) -> VolumeInFile:
    """Return a series in the order of its places."""
    if len(slices) < 2:
        raise InvalidVolumeError(f"{path} holds one slice: give the folder of all of its series")
    slices.sort(key=lambda one: (one.header.get("InstanceNumber") or 0, one.file.name, one.frame))
    first, what = slices[0], f"slices in {path}"
    read = partial(_pixels, lru_cache(maxsize=1)(_decoded))  # once for all frames of a file
    rows, columns = first.spacing if len(first.spacing) and first.spacing.min() > 0 else (1.0, 1.0)
    if not len(first.spacing):
        warn_external(f"{what} do not say how large pixels are, and 1 mm is taken: give spacing=")
    if any(len(one.position) != 3 or len(one.turn) != 6 for one in slices):
        step = float(first.header.get("SliceThickness") or columns)
        warn_external(
            f"{what} do not say where they lie or how they are turned: rows are taken to run along "
            f"y, slices along z, {step:g} apart, in an order that may be the wrong one"
        )
        array = stack(slices, lambda one: read(one)[::-1], mixed=True)
        return VolumeInFile(array, "zyx", to_world((columns, rows, step)), name, "mm")
    if any(
        not np.array_equal(one.spacing, first.spacing)
        or not np.allclose(one.turn, first.turn, atol=1e-3)
        for one in slices
    ):
        raise InvalidVolumeError(
            f"{what} are turned against each other, or have pixels of several sizes: {_APART}"
        )
    along, down = first.turn.reshape(2, 3)
    slices.sort(key=lambda one: one.position @ np.cross(along, down))
    gaps = np.diff([one.position @ np.cross(along, down) for one in slices])
    if not gaps.min() > 0.01 * gaps.mean():
        raise InvalidVolumeError(
            f"several {what} lie in the same place, as those of several times do: {_APART}"
        )
    if np.ptp(gaps) > 0.01 * gaps.mean():  # more are missing slices
        apart = f"{gaps.min():g} to {gaps.max():g} apart, and are taken as {gaps.mean():g} apart"
        warn_external(f"{what} are {apart}: some are missing, or resample them")
    # The step is along the normal, unless a gantry was tilted
    step = (slices[-1].position - slices[0].position) / len(gaps)
    place = to_world(np.column_stack([along * columns, down * rows, step]), slices[0].position)
    return VolumeInFile(stack(slices, read, mixed=True), "zyx", place, name, "mm")


def _decoded(file: Path) -> tuple[Any, NDArray[Any]]:
    """Return a file's data set and what is stored of its pixels: (frames, rows, columns)."""
    import pydicom

    data = pydicom.dcmread(file)
    if data.SamplesPerPixel != 1:
        raise UnsupportedError(f"{file} holds colours: convert them to grey values")
    try:
        return data, data.pixel_array.reshape(-1, data.Rows, data.Columns)
    except Exception as error:
        syntax = pydicom.uid.UID(data.file_meta.TransferSyntaxUID)
        if not syntax.is_encapsulated:
            raise
        raise UnsupportedError(
            f"{file} is compressed as {syntax.name} ({syntax}), which cannot be decoded here "
            f"({' '.join(str(error).split())}): decode the slices by gdcmconv --raw"
        ) from error


def _pixels(decoded: Callable[[Path], tuple[Any, NDArray[Any]]], one: Any) -> NDArray[Any]:
    """Return the values that a slice means: whole numbers where slope and intercept are."""
    from pydicom.pixels import apply_modality_lut

    data, stored = decoded(one.file)
    values = stored[one.frame]
    if data.get("ModalityLUTSequence"):  # in place of a line
        return np.asarray(apply_modality_lut(values, data))
    slope, intercept = one.line
    if slope == 1 and intercept == 0:
        return values
    if slope.is_integer() and intercept.is_integer():
        # By what may be stored, so that the slices of a series have one type
        bits, signed = int(data.BitsStored), int(data.PixelRepresentation)
        ends = (-signed << bits - 1, (1 << bits - signed) - 1, int(values.min()), int(values.max()))
        limits = [int(slope) * n + int(intercept) for n in ends]
        for kind in ("uint8", "int16", "uint16", "int32"):
            if np.iinfo(kind).min <= min(limits) and max(limits) <= np.iinfo(kind).max:
                return (values.astype(np.int64) * int(slope) + int(intercept)).astype(kind)
    return (values * slope + intercept).astype(np.float32)
