"""What a folder of DICOM slices says of itself, as far as a volume needs it.

VTK's reader takes all slices of a folder for one volume and drops where they lie in the patient.
So the headers are read here as well: only the elements of :data:`_WANTED`, from files that are not
compressed (DICOM PS3.5, section 7 and annex A).
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVolumeError, UnsupportedError

#: Bytes before the first element: 128 of any content and a mark.
_PREAMBLE, _MARK = 128, b"DICM"

#: No header that is read here is longer; what follows is left alone.
_MAX_HEADER = 1 << 20

#: Element (group, number) and what it is called here.
_WANTED = {
    (0x0002, 0x0010): "transfer_syntax",
    (0x0008, 0x103E): "description",
    (0x0018, 0x0050): "thickness",
    (0x0020, 0x000E): "series",
    (0x0020, 0x0032): "position",
    (0x0020, 0x0037): "orientation",
    (0x0028, 0x0010): "rows",
    (0x0028, 0x0030): "spacing",
}

#: Transfer syntaxes whose pixels VTK reads; the first has no value representations.
_IMPLICIT = "1.2.840.10008.1.2"
_UNCOMPRESSED = (_IMPLICIT, "1.2.840.10008.1.2.1")

#: Value representations whose length has four bytes, behind two that are reserved.
_LONG = (b"OB", b"OD", b"OF", b"OL", b"OV", b"OW", b"SQ", b"SV", b"UC", b"UN", b"UR", b"UT", b"UV")

_UNDEFINED = 0xFFFFFFFF
_ITEM_END, _SEQUENCE_END = (0xFFFE, 0xE00D), (0xFFFE, 0xE0DD)


@dataclass(frozen=True)
class Slice:
    """One slice of a scan.

    Parameters
    ----------
    path : pathlib.Path
        Its file.
    series : str
        Identifier of the series that it belongs to.
    description : str
        What the series is called.
    transfer_syntax : str
        Identifier of how the file is encoded.
    position : numpy.ndarray or None
        Centre of its first pixel, float64 (3,), millimetres in the patient's frame: to the left,
        to the back, to the head.
    orientation : numpy.ndarray or None
        Directions in which columns and rows are counted, float64 (2, 3).
    thickness : float or None
        Of what the slice shows, millimetres.
    spacing : numpy.ndarray or None
        Between the centres of rows and of columns, in this order, float64 (2,), millimetres.
    """

    path: Path
    series: str
    description: str
    transfer_syntax: str
    position: NDArray[np.float64] | None
    orientation: NDArray[np.float64] | None
    thickness: float | None
    spacing: NDArray[np.float64] | None


def slices_of(folder: Path) -> list[Slice]:
    """Return the slices in a folder, which must be those of one series.

    Raises
    ------
    InvalidVolumeError
        If there are none, or several series.
    UnsupportedError
        If their pixels are compressed.
    """
    files = sorted(path for path in folder.iterdir() if path.is_file())
    found = [each for each in (read_slice(path) for path in files) if each is not None]
    if not found:
        raise InvalidVolumeError(
            f"the folder {folder} holds no DICOM slices ({len(files)} files, none of them is one): "
            "give the folder that holds the slices themselves"
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
    """Return what a file says of its slice, or None where it is no DICOM image."""
    with path.open("rb") as stream:
        data = stream.read(_MAX_HEADER)
    if data[_PREAMBLE : _PREAMBLE + len(_MARK)] != _MARK:
        return None
    try:
        found = _found(data)
        if "rows" not in found:  # a directory, a report, a plan ...
            return None
        thickness = _numbers(found, "thickness", ())
        return Slice(
            path,
            _text(found.get("series", b"")),
            _text(found.get("description", b"")),
            _text(found["transfer_syntax"]),
            _numbers(found, "position", (3,)),
            _numbers(found, "orientation", (2, 3)),
            None if thickness is None else float(thickness),
            _numbers(found, "spacing", (2,)),
        )
    except (KeyError, ValueError, IndexError, struct.error, RecursionError):
        return None


def _found(data: bytes) -> dict[str, bytes]:
    """Return the values of the elements that are wanted."""
    found: dict[str, bytes] = {}

    def explicit() -> bool:
        return _text(found.get("transfer_syntax", b"")) != _IMPLICIT

    for tag, begin, end in _elements(data, _PREAMBLE + len(_MARK), explicit):
        if tag > max(_WANTED):
            break
        if tag in _WANTED:
            found[_WANTED[tag]] = data[begin:end]
    return found


def _elements(
    data: bytes, place: int, is_explicit: Callable[[], bool]
) -> Iterator[tuple[tuple[int, int], int, int]]:
    """Yield each element's tag and where its value begins and ends."""
    while place + 8 <= len(data):
        tag = struct.unpack_from("<HH", data, place)
        explicit = tag[0] == 0x0002 or is_explicit()  # group 2 always is
        if not explicit or tag[0] == 0xFFFE:
            length, begin = struct.unpack_from("<I", data, place + 4)[0], place + 8
        elif data[place + 4 : place + 6] in _LONG:
            length, begin = struct.unpack_from("<I", data, place + 8)[0], place + 12
        else:
            length, begin = struct.unpack_from("<H", data, place + 6)[0], place + 8
        if length == _UNDEFINED:
            end = place = _end_of(data, begin, is_explicit)
        else:
            end = place = begin + length
        yield tag, begin, end


def _end_of(data: bytes, place: int, is_explicit: Callable[[], bool]) -> int:
    """Return where a sequence or an item of undefined length ends, behind its delimiter."""
    for tag, _, end in _elements(data, place, is_explicit):
        if tag in (_ITEM_END, _SEQUENCE_END):
            return end
    raise ValueError("a sequence does not end")


def _text(value: bytes) -> str:
    return value.decode("latin-1").strip("\0 ")


def _numbers(
    found: dict[str, bytes], name: str, shape: tuple[int, ...]
) -> NDArray[np.float64] | None:
    if not _text(found.get(name, b"")):
        return None
    values = np.array([float(v) for v in _text(found[name]).split("\\")])
    return values.reshape(shape)
