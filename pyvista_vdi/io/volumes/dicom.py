"""DICOM by pydicom: folders of slices, and files of several frames (enhanced, dose, SEG, NM).

Coordinates are the patient's: left, back, head; millimetres. Rows count downwards, slices along the
normal, the cross product of the directions of columns and rows.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVolumeError, UnsupportedError, VDIError, warn_external
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile, stack
from pyvista_vdi.io.volumes.table import BARE_DICOM

#: What is read of a header, by DICOM's keywords.
_WANTED = (
    "SOPClassUID SeriesDescription SliceThickness SeriesInstanceUID ImagePositionPatient "
    "ImageOrientationPatient Rows Columns PixelSpacing InstanceNumber NumberOfFrames ImageType "
    "SamplesPerPixel PhotometricInterpretation"
)

#: By how much of their mean the distances of slices may differ: more are missing slices.
_EVEN = 0.01


@dataclass(frozen=True)
class Slice:
    """One slice of a scan; lengths are millimetres, ``None`` where the file does not say."""

    path: Path
    series: str  # identifier of the series that it belongs to, and the series' name
    description: str
    # Centre of its first pixel, (3,), in the patient's frame
    position: NDArray[np.float64] | None
    orientation: NDArray[np.float64] | None  # directions of columns and rows, (2, 3)
    thickness: float | None
    spacing: NDArray[np.float64] | None  # between rows and between columns
    number: int  # in the order in which they were taken; 0 where the file does not say
    frames: int
    mosaic: bool


def volumes_in(path: Path) -> list[VolumeInFile]:
    """Return the series of a folder, or what a file of several frames holds."""
    slices = _slices_of(path) if path.is_dir() else [one for one in [_header(path)] if one]
    if not slices:
        raise InvalidVolumeError(f"{path} holds no DICOM image")
    if any(one.mosaic for one in slices):
        raise UnsupportedError(
            f"{path} holds Siemens mosaics, all slices of a time in one picture: convert them to "
            "NIfTI, for instance by dcm2niix"
        )
    found = [each for one in slices if one.frames > 1 for each in _of_frames(one.path)]
    series = defaultdict(list)
    for one in slices:
        if one.frames == 1:
            series[one.series].append(one)
    several = len(series) + len(found) > 1
    for uid, those in series.items():
        if len(those) > 1:
            those.sort(key=lambda one: (one.number, one.path.name))
            name = those[0].description or uid
            if sum((other[0].description or u) == name for u, other in series.items()) > 1:
                name = f"{name} {uid}"
            found.append(_of_slices(path, those, name, checked=not several))
    if not found:
        if path.is_dir():
            raise InvalidVolumeError(f"the folder {path} holds one DICOM slice: a volume needs two")
        data = _pixels(path)
        raise InvalidVolumeError(
            f"{path} holds one slice of {data.shape[1]} x {data.shape[0]} pixels: give the folder "
            "that holds all slices of its series"
        )
    return found


def _slices_of(folder: Path) -> list[Slice]:
    files = sorted(path for path in folder.iterdir() if path.is_file())
    found, damaged = [], []
    for path in files:
        try:
            if (one := _header(path)) is not None:
                found.append(one)
        except InvalidVolumeError as error:
            damaged.append(error)
    if not found:
        if damaged:
            raise damaged[0]
        raise InvalidVolumeError(
            f"the folder {folder} holds no slices ({len(files)} files, no DICOM, TIFF or PNG among "
            "them): give the folder that holds the slices themselves"
        )
    if damaged:
        warn_external(
            f"{len(damaged)} of {len(files)} files in the folder {folder} are left out, as they "
            f"are damaged; the first: {damaged[0]}"
        )
    return found


def _dataset(path: Path, **how: Any) -> Any:
    """Read a file, also one as before 1993, which begins at once with its first element."""
    import pydicom

    with path.open("rb") as stream:
        bare = stream.read(4) in BARE_DICOM
    data = pydicom.dcmread(path, force=bare, **how)
    if bare:
        data.file_meta.TransferSyntaxUID = pydicom.uid.ImplicitVRLittleEndian
    return data


def _header(path: Path) -> Slice | None:
    """Return what a file says of its slice, or None where it is no DICOM image.

    Raises InvalidVolumeError if it is a damaged one.
    """
    import pydicom

    try:
        header = _dataset(path, stop_before_pixels=True, specific_tags=_WANTED.split())
        if "Rows" not in header:  # a directory, a report, a plan ...
            uid = pydicom.uid.UID(_text(header, "SOPClassUID"), pydicom.config.IGNORE)
            if uid.name.endswith("Image Storage"):
                raise EOFError("it ends within its header")
            return None
        thickness = _numbers(header, "SliceThickness", ())
        return Slice(
            path,
            _text(header, "SeriesInstanceUID"),
            _text(header, "SeriesDescription"),
            _numbers(header, "ImagePositionPatient", (3,)),
            _numbers(header, "ImageOrientationPatient", (2, 3)),
            None if thickness is None else float(thickness),
            _numbers(header, "PixelSpacing", (2,)),
            int(_text(header, "InstanceNumber") or 0),
            int(_text(header, "NumberOfFrames") or 1),
            "MOSAIC" in _text(header, "ImageType"),
        )
    except pydicom.errors.InvalidDicomError:  # it does not begin as one
        return None
    except Exception as error:  # damage shows at whatever pydicom comes to first
        raise InvalidVolumeError(f"{path} cannot be read as a DICOM slice: {error}") from error


def _of_slices(folder: Path, slices: list[Slice], name: str, *, checked: bool) -> VolumeInFile:
    """Return a series in the order of its places; what makes no volume is refused when it is read.

    ``checked``: whether it is refused now, as the only one.
    """
    try:
        place, order = _placed(folder, slices)
    except VDIError as error:
        if checked:
            raise
        refusal = error

        def refused() -> Any:
            raise refusal

        return VolumeInFile(Lazy((len(slices), 2, 2), np.int16, refused), name=name)
    files, upwards = [slices[i].path for i in order], -1 if slices[0].position is None else 1
    array = stack(files, lambda file: _pixels(file)[::upwards], mixed=True)
    return VolumeInFile(array, "zyx", place, name, "mm")


def _placed(folder: Path, slices: list[Slice]) -> tuple[NDArray[np.float64], Sequence[int]]:
    """Return the map to the patient, and the order of slices along their normal."""
    spacings = [one.spacing for one in slices]
    known = [s for s in spacings if s is not None]
    if known and any(not np.allclose(s, known[0], rtol=1e-3) for s in known):
        raise InvalidVolumeError(
            f"slices in the folder {folder} have pixels of several sizes, "
            f"{sorted({tuple(s.tolist()) for s in known})}: put those of one into a folder"
        )
    sized = bool(known) and bool((known[0] > 0).all())
    rows, columns = known[0] if sized else (1.0, 1.0)
    if not sized:
        warn_external(
            f"slices in the folder {folder} do not say how large pixels are, and 1 mm is taken: "
            "give spacing=(x, y, z)"
        )
    positions, turns = [s.position for s in slices], [s.orientation for s in slices]
    if any(p is None for p in positions) or any(t is None for t in turns):
        apart = slices[0].thickness or columns
        warn_external(
            f"slices in the folder {folder} do not say where they lie or how they are turned: rows "
            f"are taken to run along y, slices along z, {apart:g} apart, in an order that may be "
            "the wrong one"
        )
        return np.diag([columns, rows, apart, 1.0]), range(len(slices))
    along, down = turns[0]  # type: ignore[misc]
    if any(not np.allclose(t, turns[0], atol=1e-3) for t in turns):  # type: ignore[arg-type]
        raise InvalidVolumeError(
            f"slices in the folder {folder} are turned against each other, as of a localiser: "
            "put those that are parallel into a folder of their own"
        )
    return _stack(f"slices in the folder {folder}", np.array(positions), along, down, rows, columns)


def _stack(
    what: str, positions: NDArray[np.float64], along: Any, down: Any, rows: float, columns: float
) -> tuple[NDArray[np.float64], Sequence[int]]:
    """Return the map to the patient of parallel slices, and their order along the normal."""
    places = positions @ np.cross(along, down)
    order = np.argsort(places, kind="stable")
    gaps = np.diff(places[order])
    if not gaps.min() > _EVEN * gaps.mean():
        raise InvalidVolumeError(
            f"several {what} lie in the same place, as those of several times or echoes do: put "
            "those of one into a folder of their own"
        )
    if np.ptp(gaps) > _EVEN * gaps.mean():
        warn_external(
            f"{what} are {gaps.min():g} to {gaps.max():g} apart, and are taken as "
            f"{gaps.mean():g} apart: some are missing, or resample them"
        )
    place = np.eye(4)
    place[:3, 0], place[:3, 1] = np.multiply(along, columns), np.multiply(down, rows)
    # Of a tilted gantry not the normal
    place[:3, 2] = (positions[order[-1]] - positions[order[0]]) / (len(order) - 1)
    place[:3, 3] = positions[order[0]]
    return place, order.tolist()


def _of_frames(path: Path) -> list[VolumeInFile]:
    """Return what a file of several frames holds: a volume, or one for each segment."""
    import pydicom

    data = _dataset(path, stop_before_pixels=True)
    count = int(data.NumberOfFrames)
    shared = (data.get("SharedFunctionalGroupsSequence") or [pydicom.Dataset()])[0]
    frames = list(data.get("PerFrameFunctionalGroupsSequence") or [])[:count]

    def of(frame: int, group: str, name: str) -> Any:
        """Return an element of a frame's, of all frames' or of the file's."""
        for where in (frames[frame] if frames else None, shared):
            if where is not None and where.get(group):
                return where[group].value[0].get(name)
        return data.get(name)

    turn = of(0, "PlaneOrientationSequence", "ImageOrientationPatient")
    detector = (data.get("DetectorInformationSequence") or [pydicom.Dataset()])[0]
    turn = turn or detector.get("ImageOrientationPatient")
    spacing = of(0, "PixelMeasuresSequence", "PixelSpacing") or (1.0, 1.0)
    positions = [of(i, "PlanePositionSequence", "ImagePositionPatient") for i in range(count)]
    segments = [
        of(i, "SegmentIdentificationSequence", "ReferencedSegmentNumber") or 0 for i in range(count)
    ]
    if turn is not None:
        along, down = np.array(turn, dtype=np.float64).reshape(2, 3)
        offsets = data.get("GridFrameOffsetVector")
        apart = data.get("SpacingBetweenSlices") or data.get("SliceThickness")
        first = positions[0] or detector.get("ImagePositionPatient")
        if not frames and first is not None and (offsets is not None or apart):
            steps = np.array(offsets or np.arange(count) * float(apart), dtype=np.float64)
            steps = steps - (steps[0] if steps[0] == 0 else 0)
            first = np.array(first, dtype=np.float64)
            positions = list(first + steps[:, None] * np.cross(along, down))
    if turn is None or any(p is None for p in positions):
        raise UnsupportedError(
            f"{path} holds {count} frames that do not say where they lie, as those of a film: only "
            "frames that are slices make a volume"
        )
    where = np.array(positions, dtype=np.float64)
    numbers = sorted(set(segments))
    names = {
        int(s.SegmentNumber): str(s.get("SegmentLabel", s.SegmentNumber))
        for s in data.get("SegmentSequence") or []
    }
    # Frames of several segments lie in the same place, and empty ones are left out
    unique = np.unique(where.round(4), axis=0) if len(numbers) > 1 else where
    place, order = _stack(f"frames of {path}", unique, along, down, *map(float, spacing))
    shape = (len(numbers), len(unique), int(data.Rows), int(data.Columns))
    sample = _rescale_of(
        data, of, 0, np.zeros(1, np.uint16 if data.BitsAllocated > 8 else np.uint8)
    )

    def read() -> NDArray[Any]:
        pixels = _pixels(path, rescaled=False).reshape(count, *shape[2:])
        array: NDArray[Any] | None = None
        slots = np.argsort(order)
        for i in range(count):
            values = _rescale_of(data, of, i, pixels[i])
            array = np.zeros(shape, values.dtype) if array is None else array
            if values.dtype != array.dtype:
                array = array.astype(np.promote_types(array.dtype, values.dtype))
            at = i if len(numbers) == 1 else int(np.abs(unique - where[i]).sum(axis=1).argmin())
            array[numbers.index(segments[i]), slots[at]] = values
        assert array is not None
        return array

    labels = tuple(names.get(int(n), str(n)) for n in numbers) if len(numbers) > 1 else ()
    name = str(data.get("SeriesDescription", "") or path.name)
    return [VolumeInFile(Lazy(shape, sample.dtype, read), "czyx", place, name, "mm", labels)]


def _rescale_of(data: Any, of: Any, frame: int, values: NDArray[Any]) -> NDArray[Any]:
    group = "PixelValueTransformationSequence"
    slope = float(data.get("DoseGridScaling") or of(frame, group, "RescaleSlope") or 1)
    return _rescaled(data, values, slope, float(of(frame, group, "RescaleIntercept") or 0))


def _pixels(path: Path, *, rescaled: bool = True) -> NDArray[Any]:
    """Return the values that a file means: whole numbers where slope and intercept are."""
    import pydicom

    try:
        data = _dataset(path)
        syntax = data.file_meta.get("TransferSyntaxUID", pydicom.uid.ImplicitVRLittleEndian)
        try:
            values: NDArray[Any] = data.pixel_array
        except Exception as error:
            if not pydicom.uid.UID(syntax).is_encapsulated:
                raise
            why = " ".join(str(error).split())
            raise UnsupportedError(
                f"{path} is compressed as {pydicom.uid.UID(syntax).name} ({syntax}), which cannot "
                f'be decoded here ({why}): install decoders by pip install "pyvista-vdi[medical]"'
                ", or decode the slices by gdcmconv --raw"
            ) from error
        slope = float(data.get("RescaleSlope", 1) or 1)
        intercept = float(data.get("RescaleIntercept", 0) or 0)
    except UnsupportedError:
        raise
    except Exception as error:  # damage shows at whatever pydicom comes to first
        raise InvalidVolumeError(f"{path} cannot be read as a DICOM slice: {error}") from error
    if not rescaled:
        return values
    if values.ndim != 2:
        raise UnsupportedError(
            f"{path} holds pixels of {values.shape}, not one slice of grey values: convert colours "
            "to grey values"
        )
    if data.get("ModalityLUTSequence"):  # in place of a line
        found: NDArray[Any] = pydicom.pixels.apply_modality_lut(values, data)
        return found
    return _rescaled(data, values, slope, intercept)


def _rescaled(data: Any, values: NDArray[Any], slope: float, intercept: float) -> NDArray[Any]:
    if (slope, intercept) == (1, 0):
        return values
    if slope.is_integer() and intercept.is_integer():
        # By what may be stored, so that the slices of a series have one type
        bits, signed = int(data.BitsStored), int(data.PixelRepresentation)
        stored = (-signed << bits - 1, (1 << bits - signed) - 1, values.min(), values.max())
        limits = [int(slope) * int(n) + int(intercept) for n in stored]
        for kind in ("uint8", "int16", "uint16", "int32"):
            if np.iinfo(kind).min <= min(limits) and max(limits) <= np.iinfo(kind).max:
                return (values.astype(np.int64) * int(slope) + int(intercept)).astype(kind)
    return (values * slope + intercept).astype(np.float32)


def _numbers(header: Any, name: str, shape: tuple[int, ...]) -> NDArray[np.float64] | None:
    text = _text(header, name)
    return np.array(text.split("\\"), dtype=np.float64).reshape(shape) if text else None


def _text(header: Any, name: str) -> str:
    """Return an element as it is in the file: pydicom's values warn where they break a rule."""
    element = header.get_item(name)
    value = b"" if element is None else element.value or b""
    text = value.decode(errors="replace") if isinstance(value, bytes) else str(value)
    return text.strip(" \0")
