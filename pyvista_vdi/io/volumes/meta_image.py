"""MetaImage, .mha and .mhd: its header is text. VTK's reader ends the process on some of them."""

from __future__ import annotations

import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVolumeError, UnsupportedError
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile

_TYPES = {
    "CHAR": "i1",
    "UCHAR": "u1",
    "SHORT": "i2",
    "USHORT": "u2",
    "INT": "i4",
    "UINT": "u4",
    "LONG": "i4",
    "ULONG": "u4",
    "LONG_LONG": "i8",
    "ULONG_LONG": "u8",
    "FLOAT": "f4",
    "DOUBLE": "f8",
}
#: Bytes of a header, at most: some twenty lines of text.
_MOST = 1 << 16
_DIRECTIONS = ("TransformMatrix", "Rotation", "Orientation")  # the first is written today
_ORIGINS = ("Offset", "Position", "Origin")


def volumes_in(file: Path) -> list[VolumeInFile]:
    """Return the volume of a MetaImage; ITK's coordinates are left, back, head."""
    with file.open("rb") as stream:
        head = stream.read(_MOST)
    said = re.match(rb"(?s).*?\bElementDataFile[ \t]*=[ \t]*([^\r\n]*)\r?\n?", head)
    text = head[: said.end() if said else None].decode("latin-1")
    entries = dict(re.findall(r"^\s*(\w+)\s*=\s*(.*?)\s*$", text, re.MULTILINE))
    missing = [n for n in ("NDims", "DimSize", "ElementType") if n not in entries]
    if missing or said is None:
        raise InvalidVolumeError(
            f"it is no MetaImage, for it does not say its {' and '.join(missing or ['data file'])}"
        )
    sizes = [int(n) for n in entries["DimSize"].split()]
    n_axes = int(entries["NDims"])
    kind = entries["ElementType"].removeprefix("MET_").removesuffix("_ARRAY")
    if n_axes not in (3, 4) or len(sizes) != n_axes or min(sizes) < 1:
        raise UnsupportedError(
            f"it has {n_axes} axes of {sizes} points: 3, or 4 with time, are read"
        )
    if kind not in _TYPES:
        raise UnsupportedError(
            f"voxels of type {entries['ElementType']} are not read: convert them"
        )
    big = _true(entries, "BinaryDataByteOrderMSB") or _true(entries, "ElementByteOrderMSB")
    dtype = np.dtype((">" if big else "<") + _TYPES[kind])
    n = int(entries.get("ElementNumberOfChannels", 1))
    shape, axes = sizes[::-1], "zyx" if n_axes == 3 else "tzyx"
    if n > 1:
        shape, axes = [*shape, n], axes + ("s" if n in (3, 4) and dtype.itemsize == 1 else "c")
    name, at = said[1].decode("latin-1").strip(), said.end()

    def read() -> NDArray[Any]:
        raw = _data(file, name, entries, at)
        if int(entries.get("HeaderSize", 0)) < 0:  # the data are the last bytes
            raw = raw[-int(np.prod(shape, dtype=object)) * dtype.itemsize :]
        if entries.get("BinaryData", "True").lower() == "false":
            array = np.array(raw.split(), dtype=dtype)
        else:
            array = np.frombuffer(raw, dtype)
        if array.size != np.prod(shape, dtype=object):
            raise InvalidVolumeError(
                f"its data have {array.size} numbers of {kind}, and {' x '.join(map(str, shape))} "
                "are said: it is cut off, or its header is wrong"
            )
        return array.reshape(shape).astype(dtype.newbyteorder("="), copy=False)

    place = np.eye(4)
    turn = _numbers(entries, _DIRECTIONS, np.eye(n_axes).ravel(), n_axes**2)
    spacing = _numbers(entries, ("ElementSpacing", "ElementSize"), np.ones(n_axes), n_axes)
    place[:3, :3] = turn.reshape(n_axes, n_axes)[:3, :3].T * spacing[:3]  # axis after axis
    place[:3, 3] = _numbers(entries, _ORIGINS, np.zeros(n_axes), n_axes)[:3]
    unit = entries.get("DistanceUnits", "?").strip("?")
    array = Lazy(shape, dtype.newbyteorder("="), read)
    return [VolumeInFile(array, axes, place, "MetaImage", unit)]


def _true(entries: dict[str, str], name: str) -> bool:
    return entries.get(name, "").lower() in ("true", "1")


def _numbers(entries: dict[str, str], names: tuple[str, ...], default: Any, n: int) -> Any:
    text = next((entries[name] for name in names if name in entries), None)
    numbers = default if text is None else np.array(text.split(), dtype=np.float64)
    if len(numbers) != n:
        raise InvalidVolumeError(f"it has {len(numbers)} numbers for {names[0]}: {n} are needed")
    return numbers


def _data(file: Path, name: str, entries: dict[str, str], at: int) -> bytes:
    """Return the bytes of all data: in the file itself, in another, or in several."""
    words = name.split()
    if words[:1] == ["LIST"]:
        lines = file.read_text(encoding="latin-1")[at:].splitlines()
        names = [line.strip() for line in lines if line.strip()]
    elif re.search(r"%\d*d", name) and len(words) >= 4:
        names = [words[0] % i for i in range(int(words[1]), int(words[2]) + 1, int(words[3]))]
    else:
        names = [name]
    pieces = []
    for one in names:
        local = one.upper() == "LOCAL"
        try:
            raw = file.read_bytes()[at:] if local else (file.parent / one).read_bytes()
        except OSError as error:
            raise InvalidVolumeError(
                f"its data file {one} cannot be read ({error.strerror}): it must lie beside it"
            ) from error
        raw = raw[max(0, int(entries.get("HeaderSize", 0))) :]
        if _true(entries, "CompressedData"):
            raw = zlib.decompressobj(wbits=47).decompress(raw)
        pieces.append(raw)
    return b"".join(pieces)
