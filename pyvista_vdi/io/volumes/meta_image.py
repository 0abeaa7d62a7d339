"""MetaImage, .mha and .mhd: its header is text. VTK's reader ends the process on some of them."""

from __future__ import annotations

import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidVolumeError, UnsupportedError
from pyvista_vdi.io.axes import to_world
from pyvista_vdi.io.volumes.in_file import Lazy, VolumeInFile
from pyvista_vdi.io.volumes.pieces import files_of

_TYPES = {"CHAR": "i1", "SHORT": "i2", "INT": "i4", "LONG": "i4", "LONG_LONG": "i8"}
_TYPES |= {f"U{name}": f"u{kind[1]}" for name, kind in _TYPES.items()}
_TYPES |= {"FLOAT": "f4", "DOUBLE": "f8"}
#: Bytes of a header, at most: some twenty lines of text.
_MOST = 1 << 16


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

    def true(*names: str) -> bool:
        return any(entries.get(name, "").lower() in ("true", "1") for name in names)

    def numbers(default: NDArray[np.float64], *names: str) -> NDArray[np.float64]:
        said = next((entries[n].split() for n in names if n in entries), default)
        if np.size(said) != default.size:
            raise InvalidVolumeError(
                f"it has {len(said)} numbers for {names[0]}: {default.size} are needed"
            )
        return np.array(said, dtype=np.float64).reshape(default.shape)

    n_axes, sizes = int(entries["NDims"]), [int(n) for n in entries["DimSize"].split()]
    kind = entries["ElementType"].removeprefix("MET_").removesuffix("_ARRAY")
    if n_axes not in (3, 4) or len(sizes) != n_axes or min(sizes) < 1 or kind not in _TYPES:
        raise UnsupportedError(
            f"it has {n_axes} axes of {sizes} points, and voxels of type {kind}: 3 axes are read, "
            f"or 4 with time, of {', '.join(_TYPES)}: convert it"
        )
    big = true("BinaryDataByteOrderMSB", "ElementByteOrderMSB")
    dtype = np.dtype((">" if big else "<") + _TYPES[kind])
    n = int(entries.get("ElementNumberOfChannels", 1))
    shape, axes = sizes[::-1], "tzyx"[-n_axes:]
    if n > 1:
        shape, axes = [*shape, n], axes + ("s" if n in (3, 4) and dtype.itemsize == 1 else "c")
    count, name = int(np.prod(shape, dtype=object)), said[1].decode("latin-1")

    def read() -> NDArray[Any]:
        parts, skipped = [file.read_bytes()[said.end() :]], int(entries.get("HeaderSize", 0))
        if name.upper() != "LOCAL":
            listed = parts[0].decode("latin-1").splitlines() if name.startswith("LIST") else []
            parts = [piece.read_bytes() for piece in files_of(file.parent, name, listed)]
        parts = [one[max(0, skipped) :] for one in parts]
        if true("CompressedData"):
            parts = [zlib.decompressobj(wbits=47).decompress(one) for one in parts]
        raw = b"".join(parts)
        if skipped < 0:  # the data are the last bytes
            raw = raw[-count * dtype.itemsize :]
        text = entries.get("BinaryData", "True").lower() == "false"
        array = np.array(raw.split(), dtype=dtype) if text else np.frombuffer(raw, dtype)
        if array.size != count:
            raise InvalidVolumeError(
                f"its data have {array.size} numbers of {kind}, and {' x '.join(map(str, shape))} "
                "are said: it is cut off, or its header is wrong"
            )
        return array.reshape(shape).astype(dtype.newbyteorder("="), copy=False)

    turn = numbers(np.eye(n_axes), "TransformMatrix", "Rotation", "Orientation")
    spacing = numbers(np.ones(n_axes), "ElementSpacing", "ElementSize")
    origin = numbers(np.zeros(n_axes), "Offset", "Position", "Origin")
    place = to_world(turn[:3, :3].T * spacing[:3], origin[:3])  # axis after axis
    unit = entries.get("DistanceUnits", "?").strip("?")
    array = Lazy(shape, dtype.newbyteorder("="), read)
    return [VolumeInFile(array, axes, place, "MetaImage", unit)]
