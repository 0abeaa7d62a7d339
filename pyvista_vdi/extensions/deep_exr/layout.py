"""Deep scan line images: the part of the OpenEXR 2 file layout that they need.

Written and read here with NumPy and zlib; https://openexr.com/en/latest/OpenEXRFileLayout.html is
the source. A file is a header of attributes, a table of where each scan line's chunk begins, and
the chunks, top line first. A chunk holds how many samples each pixel has, as a running sum along
the line, and then the samples, channel by channel.

The OpenEXR package is not in the place of this: it makes an array object of each pixel and channel,
about a hundred bytes each, and takes memory for what a header merely declares. It reads the forms
that are not read here (``package.py``). Reading and writing share one file, as one layout.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from os import cpu_count
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import VDIFileError
from pyvista_vdi.io.progress import Pieces, Progress
from pyvista_vdi.model.camera import MAX_WINDOW_EDGE

#: The first four bytes of every OpenEXR file.
MAGIC = bytes((0x76, 0x2F, 0x31, 0x01))

#: The version field: file format 2, and what its flags mean.
_VERSION, _TILED, _LONG_NAMES, _DEEP, _MULTI_PART = 2, 0x200, 0x400, 0x800, 0x1000

#: The codes of the compressions that are read and written here. Before OpenEXR 3.5 there were no
#: others for deep scan lines.
COMPRESSIONS = {"none": 0, "rle": 1, "zips": 2}

#: Most bytes that one compressed byte can stand for: 1032 with deflate (zlib's technical notes);
#: with run lengths 128 bytes from 2.
_MAX_RATIO = {"none": 1, "rle": 64, "zips": 1032}

#: OpenEXR's codes of a channel's type.
_PIXEL_TYPES: dict[int, np.dtype[Any]] = {
    0: np.dtype("<u4"),
    1: np.dtype("<f2"),
    2: np.dtype("<f4"),
}

#: Before a chunk's data: y, bytes of the packed counts, of the packed and of the unpacked samples.
_CHUNK = struct.Struct("<iQQQ")

#: A row's running sum of counts is an int32.
_MAX_ROW_SAMPLES = 2**31 - 1

_MAX_THREADS = 8

_REMEDY = "copy it from its source again"

_R = TypeVar("_R")


class OtherFormError(Exception):
    """A deep image in a form that is not read here: tiles, several parts, another compression."""


@dataclass(frozen=True)
class DeepImage:
    """The samples of a deep image, list by list in our order."""

    #: Of the header, by name: text, numbers and matrices (float64 (4, 4), as the file has them, for
    #: row vectors); others are left out
    attributes: dict[str, Any]
    #: (x_min, y_min, x_max, y_max), y downwards, both ends included
    data_window: tuple[int, int, int, int]
    #: (x_min, y_min, x_max, y_max), y downwards, both ends included
    display_window: tuple[int, int, int, int]
    compression: str  # what the header names
    #: dtype of every channel in the file, also of those that were not read
    channel_types: dict[str, np.dtype[Any]]
    #: int64 (H, W), samples per pixel of the data window, bottom row first
    counts: NDArray[np.int64]
    channels: dict[str, NDArray[Any]]  # arrays (n,) by name, in the order of the lists


def write_image(
    stream: Any,
    counts: NDArray[Any],
    channel_types: Mapping[str, Any],
    samples: Callable[[int, int], Mapping[str, NDArray[Any]]],
    attributes: Mapping[str, tuple[str, bytes]],
    *,
    compression: str,
    level: int,
    progress: Progress | None = None,
) -> None:
    """Write a deep scan line image to a seekable stream.

    ``counts``: samples per pixel, bottom row first. ``samples(first, last)`` gives those
    samples of all channels, and is called from several threads. ``attributes``: type and value
    of further ones.
    """
    height, width = counts.shape
    ends = np.cumsum(counts.sum(axis=1, dtype=np.int64))
    if int(np.diff(ends, prepend=0).max()) > _MAX_ROW_SAMPLES:
        raise VDIFileError(
            "a row of lists holds more samples than an OpenEXR file can: 2147483647; write a .vdi"
        )
    names = sorted(channel_types)
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    header = {
        "channels": ("chlist", _channel_list(channel_types)),
        "chunkCount": ("int", struct.pack("<i", height)),
        "compression": ("compression", bytes((COMPRESSIONS[compression],))),
        "dataWindow": ("box2i", window),
        "displayWindow": ("box2i", window),
        "lineOrder": ("lineOrder", b"\0"),
        "maxSamplesPerPixel": ("int", struct.pack("<i", int(counts.max()))),
        "pixelAspectRatio": ("float", struct.pack("<f", 1)),
        "type": ("string", b"deepscanline"),
        "version": ("int", struct.pack("<i", 1)),
        **attributes,
    }
    stream.write(MAGIC + struct.pack("<I", _VERSION | _DEEP))
    for name, (kind, value) in sorted(header.items()):
        stream.write(name.encode() + b"\0" + kind.encode() + b"\0")
        stream.write(struct.pack("<i", len(value)) + value)
    stream.write(b"\0")
    table_at = stream.tell()
    stream.write(bytes(8 * height))

    def chunk(y: int) -> bytes:
        row = height - 1 - y
        arrays = samples(int(ends[row - 1]) if row else 0, int(ends[row]))
        types = (np.dtype(channel_types[name]).newbyteorder("<") for name in names)
        data = b"".join(
            arrays[name].astype(kind, copy=False).tobytes()
            for name, kind in zip(names, types, strict=True)
        )
        sums = _packed(np.cumsum(counts[row]).astype("<i4").tobytes(), compression, level)
        packed = _packed(data, compression, level)
        return _CHUNK.pack(y, len(sums), len(packed), len(data)) + sums + packed

    offsets, done = [], Pieces(progress, height)
    for written in _in_threads(chunk, range(height)):
        offsets.append(stream.tell())
        stream.write(written)
        done()
    stream.seek(table_at)
    stream.write(np.array(offsets, "<u8").tobytes())
    stream.seek(0, os.SEEK_END)


def matrix_attribute(matrix: NDArray[np.float64]) -> tuple[str, bytes]:
    """Return an attribute from a matrix that multiplies column vectors.

    OpenEXR's (Imath's) matrices multiply row vectors from the right: they are the transposes.
    """
    return "m44f", np.ascontiguousarray(matrix.T, "<f4").tobytes()


def _channel_list(types: Mapping[str, Any]) -> bytes:
    codes = {kind: code for code, kind in _PIXEL_TYPES.items()}
    entries = (
        name.encode() + b"\0" + struct.pack("<iB3xii", codes[np.dtype(types[name])], 0, 1, 1)
        for name in sorted(types)
    )
    return b"".join(entries) + b"\0"


def _packed(data: bytes, compression: str, level: int) -> bytes:
    """Return bytes compressed, or as they are where that is not shorter (as OpenEXR does)."""
    if compression == "none" or not data:
        return data
    raw = np.frombuffer(data, np.uint8)
    mixed = np.concatenate([raw[::2], raw[1::2]])
    mixed[1:] = mixed[1:] - mixed[:-1] + np.uint8(128)
    packed = zlib.compress(mixed.tobytes(), level)
    return packed if len(packed) < len(data) else data


def read_image(
    path: Path, wanted: Callable[[str], bool], progress: Progress | None = None
) -> DeepImage:
    """Read a deep scan line image, trusting nothing that it says before it is checked.

    Raises OtherFormError if it is a deep image in another form.
    """
    return _Image(path).read(wanted, progress)


class _Image:
    """A file whose header has been read and checked."""

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            self._data = memoryview(path.read_bytes())
        except (OSError, ValueError) as error:
            raise VDIFileError(
                f"{path} cannot be read: {getattr(error, 'strerror', None) or error}"
            ) from error
        flags = self._checked_start()
        self._at = 8
        self._raw = self._read_header(255 if flags & _LONG_NAMES else 31)
        self.attributes = {
            name: value
            for name, (kind, data) in self._raw.items()
            if (value := _decoded(kind, data)) is not None
        }
        self._check_form(flags)
        self._check_windows()
        self._types = self._read_channel_list()

    def read(self, wanted: Callable[[str], bool], progress: Progress | None) -> DeepImage:
        counts, chunks = self._read_counts()
        names = [name for name in self._types if wanted(name)]
        return DeepImage(
            attributes=self.attributes,
            data_window=self.attributes["dataWindow"],
            display_window=self.attributes["displayWindow"],
            compression=self._compression,
            channel_types=self._types,
            counts=counts,
            channels=self._read_channels(counts, chunks, names, progress),
        )

    def _checked_start(self) -> int:
        start = bytes(self._data[:8])
        if not start:
            self._refuse("it is empty")
        if start[:4] != MAGIC[: len(start)]:
            raise VDIFileError(
                f"{self._path} is not an OpenEXR file: it begins with {start!r}; "
                "a file's name must end in what it is"
            )
        if len(start) < 8:
            self._refuse("it ends within its header")
        version = int.from_bytes(start[4:], "little")
        if version & 0xFF != _VERSION:
            self._refuse(f"its version is {version & 0xFF}, not {_VERSION}")
        if not version & _DEEP:
            raise VDIFileError(
                f"{self._path} is an OpenEXR file of a flat image: it says nothing about depth; "
                "write it as a deep image"
            )
        return version

    def _read_header(self, longest: int) -> dict[str, tuple[str, memoryview]]:
        attributes: dict[str, tuple[str, memoryview]] = {}
        while name := self._text(longest):
            kind = self._text(longest)
            (size,) = struct.unpack("<i", self._take(4))
            attributes[name] = (kind, self._take(size))
        return attributes

    def _text(self, longest: int) -> str:
        piece = bytes(self._data[self._at : self._at + longest + 1])
        end = piece.find(b"\0")
        if end < 0:
            self._refuse("a name in its header has no end")
        self._at += end + 1
        return piece[:end].decode("utf-8", "replace")

    def _take(self, size: int) -> memoryview:
        if not 0 <= size <= len(self._data) - self._at:
            self._refuse(f"it ends within its header: {size} bytes are declared at {self._at}")
        self._at += size
        return self._data[self._at - size : self._at]

    def _check_form(self, flags: int) -> None:
        if flags & _MULTI_PART:
            raise OtherFormError("has several parts")
        kind = self.attributes.get("type")
        if flags & _TILED or kind == "deeptile":
            raise OtherFormError("is stored in tiles")
        if kind != "deepscanline":
            self._refuse(f"its type is {kind!r}, not 'deepscanline'")
        code = self.attributes.get("compression")
        names = {number: name for name, number in COMPRESSIONS.items()}
        if code not in names:
            raise OtherFormError(f"is compressed by method {code}")
        self._compression = names[code]

    def _check_windows(self) -> None:
        for name in ("dataWindow", "displayWindow"):
            box = self.attributes.get(name)
            if not isinstance(box, tuple):
                self._refuse(f"its {name} is missing")
            edges = (box[2] - box[0] + 1, box[3] - box[1] + 1)
            if not all(1 <= edge <= MAX_WINDOW_EDGE for edge in edges):
                self._refuse(
                    f"its {name} is {edges[0]} x {edges[1]} pixels; 1 to {MAX_WINDOW_EDGE} along "
                    "each edge are possible"
                )

    def _read_channel_list(self) -> dict[str, np.dtype[Any]]:
        kind, data = self._raw.get("channels", ("", memoryview(b"")))
        types: dict[str, np.dtype[Any]] = {}
        entries, at = bytes(data), 0
        while kind == "chlist" and (end := entries.find(b"\0", at)) > at:
            name = entries[at:end].decode("utf-8", "replace")
            if end + 17 > len(entries):
                break
            code, _, x_step, y_step = struct.unpack_from("<iB3xii", entries, end + 1)
            if code not in _PIXEL_TYPES or (x_step, y_step) != (1, 1) or name in types:
                self._refuse(f"its channel {name!r} is of type {code}, every {x_step} x {y_step}")
            types[name] = _PIXEL_TYPES[code]
            at = end + 17
        if not types or at != len(entries) - 1:
            self._refuse("its list of channels is missing or incomplete")
        return types

    def _read_counts(self) -> tuple[NDArray[np.int64], list[tuple[memoryview, int]]]:
        """Return the samples per pixel, and each row's packed samples with their unpacked size.

        Bottom row first. What the rows declare is held against the counts and the packed size.
        """
        x_min, y_min, x_max, y_max = self.attributes["dataWindow"]
        width, height = x_max - x_min + 1, y_max - y_min + 1
        offsets = np.frombuffer(self._take(8 * height), "<u8").tolist()
        sample_bytes = sum(kind.itemsize for kind in self._types.values())

        def row(y: int) -> tuple[NDArray[np.int32], memoryview, int]:
            sums, packed, unpacked = self._chunk(offsets[y - y_min], y, 4 * width)
            counts = np.diff(sums, prepend=np.int32(0))
            if int(sums.min()) < 0 or int(counts.min()) < 0:
                self._refuse(f"in scan line {y} pixels have fewer than 0 samples")
            if int(sums[-1]) * sample_bytes != unpacked:
                self._refuse(
                    f"scan line {y} declares {unpacked} bytes for {sums[-1]} samples of "
                    f"{sample_bytes} bytes"
                )
            if unpacked > len(packed) * _MAX_RATIO[self._compression]:
                self._refuse(
                    f"scan line {y} declares {unpacked} bytes, which {len(packed)} packed bytes "
                    "cannot hold"
                )
            return counts, packed, unpacked

        rows = list(_in_threads(row, range(y_max, y_min - 1, -1)))
        counts = np.array([row[0] for row in rows], np.int64)
        return counts, [(packed, unpacked) for _, packed, unpacked in rows]

    def _chunk(
        self, offset: int, y: int, sums_bytes: int
    ) -> tuple[NDArray[np.int32], memoryview, int]:
        end = offset + _CHUNK.size
        if end > len(self._data):
            self._refuse(f"scan line {y} is missing: the file ends before it")
        at, n_sums, n_packed, unpacked = _CHUNK.unpack(self._data[offset:end])
        if at != y:
            self._refuse(f"where scan line {y} should be is scan line {at}")
        if end + n_sums + n_packed > len(self._data):
            self._refuse(f"it ends within scan line {y}")
        sums = self._unpacked(self._data[end : end + n_sums], sums_bytes, y)
        packed = self._data[end + n_sums : end + n_sums + n_packed]
        return np.frombuffer(sums, "<i4"), packed, unpacked

    def _read_channels(
        self,
        counts: NDArray[np.int64],
        chunks: list[tuple[memoryview, int]],
        wanted: list[str],
        progress: Progress | None,
    ) -> dict[str, NDArray[Any]]:
        ends = np.cumsum(counts.sum(axis=1)).tolist()
        arrays = {name: np.empty(ends[-1], self._types[name]) for name in wanted}

        def unpack(row: int) -> None:
            packed, size = chunks[row]
            y = self.attributes["dataWindow"][3] - row
            data, at = self._unpacked(packed, size, y), 0
            first, last = ends[row - 1] if row else 0, ends[row]
            for name, kind in self._types.items():
                end = at + (last - first) * kind.itemsize
                if name in arrays:
                    arrays[name][first:last] = np.frombuffer(data[at:end], kind)
                at = end

        done = Pieces(progress, len(chunks))
        for _ in _in_threads(unpack, range(len(chunks))):
            done()
        return arrays

    def _unpacked(self, packed: memoryview, size: int, y: int) -> memoryview:
        """Return ``size`` bytes; what did not become shorter was stored as it is."""
        if len(packed) == size:
            return packed
        if self._compression == "zips":
            mixed = _inflated(packed, size)
        elif self._compression == "rle":
            mixed = _run_lengths(packed, size)
        else:
            mixed = b""
        if len(mixed) != size:
            self._refuse(f"scan line {y} does not hold {size} bytes")
        steps = np.frombuffer(mixed, np.uint8).copy()
        steps[1:] -= np.uint8(128)
        values = np.cumsum(steps, dtype=np.uint8)
        data, half = np.empty_like(values), (size + 1) // 2
        data[::2], data[1::2] = values[:half], values[half:]
        return memoryview(data.tobytes())

    def _refuse(self, why: str) -> NoReturn:
        raise VDIFileError(f"{self._path} is damaged: {why}; {_REMEDY}")


def _decoded(kind: str, data: memoryview) -> Any:
    """Return an attribute's value, or None for a type that nothing here asks for."""
    forms = {"int": "<i", "float": "<f", "v2f": "<2f", "box2i": "<4i", "compression": "<B"}
    if kind == "string":
        return bytes(data).decode("utf-8", "replace")
    if kind == "m44f" and len(data) == 64:
        return np.frombuffer(data, "<f4").reshape(4, 4).astype(np.float64)
    if kind in forms and len(data) == struct.calcsize(forms[kind]):
        values = struct.unpack(forms[kind], data)
        return values[0] if len(values) == 1 else values
    return None


def _inflated(packed: memoryview, size: int) -> bytes:
    """Return what zlib makes of the bytes, but never more than one byte too many."""
    inflate = zlib.decompressobj()
    try:
        return inflate.decompress(packed, size + 1)
    except zlib.error:
        return b""


def _run_lengths(packed: memoryview, size: int) -> bytes:
    """Undo OpenEXR's run lengths: -n and n bytes as they are, or n and a byte n + 1 times."""
    out, at = bytearray(), 0
    while at + 1 < len(packed) and len(out) <= size:
        length = packed[at] - 256 if packed[at] > 127 else packed[at]
        if length < 0:
            out += packed[at + 1 : at + 1 - length]
            at += 1 - length
        else:
            out += bytes(packed[at + 1 : at + 2]) * (length + 1)
            at += 2
    return bytes(out)


def _in_threads(work: Callable[[int], _R], items: range) -> Iterator[_R]:
    """Yield the results in order, a few ahead: zlib lets other threads run."""
    n_threads = min(_MAX_THREADS, cpu_count() or 1)
    batch = 8 * n_threads
    with ThreadPoolExecutor(n_threads) as pool:
        for start in range(0, len(items), batch):
            yield from pool.map(work, items[start : start + batch])
