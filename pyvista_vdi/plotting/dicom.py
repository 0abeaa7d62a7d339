"""What a folder of DICOM slices holds and says of itself, as far as a volume needs it.

VTK's reader takes all slices of a folder for one volume, in an order that is not always theirs, and
drops where they lie in the patient: pydicom reads slices one by one.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import (
    InvalidVolumeError,
    MissingDependencyError,
    UnsupportedError,
    warn_external,
)
from pyvista_vdi.model.host_memory import require_free_memory

#: What is read of a header, by DICOM's keywords.
_WANTED = [
    "SOPClassUID",
    "SeriesDescription",
    "SliceThickness",
    "SeriesInstanceUID",
    "ImagePositionPatient",
    "ImageOrientationPatient",
    "Rows",
    "PixelSpacing",
    "InstanceNumber",
]

#: Transfer syntaxes whose pixels VTK reads.
_UNCOMPRESSED = ("1.2.840.10008.1.2", "1.2.840.10008.1.2.1")


@dataclass(frozen=True)
class Slice:
    """One slice of a scan; lengths are millimetres, ``None`` where the file does not say."""

    path: Path
    series: str  # identifier of the series that it belongs to, and the series' name
    description: str
    transfer_syntax: str  # identifier of how the file is encoded
    # Centre of its first pixel, (3,), in the patient's frame: to the left, to the back, to the head
    position: NDArray[np.float64] | None
    orientation: NDArray[np.float64] | None  # directions of columns and rows, (2, 3)
    thickness: float | None
    spacing: NDArray[np.float64] | None  # between rows and between columns
    number: int  # in the order in which they were taken; 0 where the file does not say


def slices_of(folder: Path) -> list[Slice]:
    """Return the slices in a folder, which must be those of one series, not compressed."""
    files = sorted(path for path in folder.iterdir() if path.is_file())
    found, damaged = [], []
    for path in files:
        try:
            if (one := read_slice(path)) is not None:
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
    series = Counter(each.series for each in found)
    if len(series) > 1:
        names = {each.series: each.description for each in found}
        listed = ", ".join(f"{uid} {names[uid]!r} ({n} slices)" for uid, n in series.items())
        raise InvalidVolumeError(
            f"the folder {folder} holds {len(series)} DICOM series: {listed}; "
            "put the slices of one into a folder of their own"
        )
    for each in found:
        require_uncompressed(each)
    return found


def require_uncompressed(one: Slice) -> None:
    """Raise UnsupportedError if VTK cannot read a slice's pixels."""
    if one.transfer_syntax not in _UNCOMPRESSED:
        raise UnsupportedError(
            f"{one.path} is encoded by the transfer syntax {one.transfer_syntax}, which VTK's "
            "DICOM reader does not decode: convert the slices by gdcmconv --raw or dcmdjpeg"
        )


def read_slice(path: Path) -> Slice | None:
    """Return what a file says of its slice, or None where it is no DICOM image.

    Raises InvalidVolumeError if it is a damaged one.
    """
    pydicom = _pydicom()
    try:
        header = pydicom.dcmread(path, stop_before_pixels=True, specific_tags=_WANTED)
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
            _text(header.file_meta, "TransferSyntaxUID"),
            _numbers(header, "ImagePositionPatient", (3,)),
            _numbers(header, "ImageOrientationPatient", (2, 3)),
            None if thickness is None else float(thickness),
            _numbers(header, "PixelSpacing", (2,)),
            int(_text(header, "InstanceNumber") or 0),
        )
    except pydicom.errors.InvalidDicomError:  # it does not begin as one
        return None
    except Exception as error:  # damage shows at whatever pydicom comes to first
        raise InvalidVolumeError(f"{path} cannot be read as a DICOM slice: {error}") from error


def values_of(slices: list[Slice]) -> NDArray[Any]:
    """Return the values of slices in their order, (slices, rows, columns), the first row lowest.

    They are as the files mean them: rescaled, whole numbers where slope and intercept are.
    """
    first = _values(slices[0])
    require_free_memory(
        first.nbytes * len(slices),
        f"the {len(slices)} slices in {slices[0].path.parent}",
        "take fewer of them",
    )
    array = np.empty((len(slices), *first.shape), first.dtype)
    for i, one in enumerate(slices):
        values = _values(one)
        if values.shape != first.shape:
            raise InvalidVolumeError(
                f"{one.path} is {' x '.join(map(str, values.shape))} pixels, and "
                f"{slices[0].path.name} is {' x '.join(map(str, first.shape))}: the slices of a "
                "volume have one size"
            )
        if values.dtype != array.dtype:  # rescaled in another way than those before
            array = array.astype(np.promote_types(array.dtype, values.dtype))
        array[i] = values[::-1]
    return array


def _values(one: Slice) -> NDArray[Any]:
    try:
        data = _pydicom().dcmread(one.path)
        values: NDArray[Any] = data.pixel_array
        slope = float(data.get("RescaleSlope", 1) or 1)
        intercept = float(data.get("RescaleIntercept", 0) or 0)
    except Exception as error:  # damage shows at whatever pydicom comes to first
        raise InvalidVolumeError(f"{one.path} cannot be read as a DICOM slice: {error}") from error
    if values.ndim != 2:
        raise UnsupportedError(
            f"{one.path} holds pixels of {values.shape}, not one slice of grey values: extract the "
            "frames, or convert colours to grey values"
        )
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


def _pydicom() -> Any:
    try:
        import pydicom
    except ImportError as error:
        raise MissingDependencyError(
            "DICOM slices are read by pydicom, which is not installed: install it by "
            'pip install "pyvista-vdi[plot]"'
        ) from error
    return pydicom
