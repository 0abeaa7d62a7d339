"""The .vdis format: what its writer and its reader agree on; ``docs/series.md`` describes it.

A head, and then one frame for each step, written one behind the other and never changed. A frame
says how long it is and carries checksums of its header and of what follows, so that whoever reads
while others write sees every finished step. An index behind the last frame saves looking for them.
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Mapping
from io import BytesIO
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.io.vdi_file.chunks import DamagedChunkError, PackedArray, workers, write_chunks
from pyvista_vdi.io.vdi_file.description import from_json, to_json
from pyvista_vdi.io.vdi_file.layout import MAX_DESCRIPTION_BYTES, Layout
from pyvista_vdi.model.host_memory import aligned_empty

#: Highest version of the format.
FORMAT_VERSION = 1
FORMAT_NAME = "pyvista-vdi-series"
SUFFIX = ".vdis"

#: The first bytes; those of PNG's kind, which tell a file that was sent as text.
MAGIC = b"\x89VDIS\r\n\x1a"
#: Behind them: version, bytes of the head's text, CRC-32 of both and the text.
HEAD = struct.Struct("<III")

#: A frame's header: what it is, number of the step, kind, step that it was written by or -1, time,
#: bytes that follow, their CRC-32; and the CRC-32 of the header so far.
_HEADER = struct.Struct("<4sIIidQI")
_CHECKSUM = struct.Struct("<I")
HEADER_BYTES = _HEADER.size + _CHECKSUM.size
STEP, INDEX = b"STEP", b"INDX"

#: Where the index begins, at the file's end.
TRAILER = struct.Struct("<Q8s")
TRAILER_MAGIC = b"VDISEND\n"
#: An entry of the index, before the step's header.
ENTRY = struct.Struct("<Q")

#: Kinds of steps: a whole .vdi file; lists; the supersegments of another step.
VDI_FILE, LISTS, AGAIN = range(3)

#: Rows of an array that are compressed together.
CHUNK_ROWS = 1 << 18
_TYPES = ("|u1", "<u2", "<u4", "<u8", "<f4")
_INDEX = np.dtype([("bytes", "<u4"), ("crc32", "<u4")])
_TEXT = struct.Struct("<II")


class FrameHeader(NamedTuple):
    """What stands before a frame's content."""

    what: bytes
    number: int
    kind: int
    by: int
    time: float
    n_bytes: int
    checksum: int

    def to_bytes(self) -> bytes:
        """Return the header as it is written."""
        header = _HEADER.pack(*self)
        return header + _CHECKSUM.pack(zlib.crc32(header))

    @classmethod
    def of_bytes(cls, data: bytes) -> FrameHeader | None:
        """Return the header that these bytes are, or None."""
        if len(data) != HEADER_BYTES:
            return None
        if zlib.crc32(data[: _HEADER.size]) != _CHECKSUM.unpack(data[_HEADER.size :])[0]:
            return None
        return cls(*_HEADER.unpack(data[: _HEADER.size]))


def content_bytes(
    text: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]], codec: str, level: int
) -> bytes:
    """Return what a frame holds: what is to be said in JSON, and numbers, compressed by themselves.

    The arrays are one-dimensional; or there is one named ``"vdi"``, uint8: a whole .vdi file.
    """
    stream, index = BytesIO(), []
    for array in arrays.values():
        index += write_chunks(
            stream,
            _layout(array.dtype, len(array)),
            codec,
            level,
            lambda first, last, rows=array: np.ascontiguousarray(rows[first:last]),  # type: ignore[misc]
            lambda: None,
        )
    kinds = {name: [array.dtype.str, len(array)] for name, array in arrays.items()}
    packed = zlib.compress(to_json({**text, "arrays": kinds}).encode(), 9)
    chunks = np.array(index, _INDEX).tobytes()
    return _TEXT.pack(len(packed), len(index)) + packed + chunks + stream.getvalue()


def read_text(data: memoryview) -> tuple[dict[str, Any], int, int]:
    """Return what a frame's content says, where its index begins, and that one's entries."""
    if len(data) < _TEXT.size:
        raise ValueError("its content is too short")
    n_text, n_chunks = _TEXT.unpack_from(data)
    begin = _TEXT.size + n_text
    if begin + n_chunks * _INDEX.itemsize > len(data):
        raise ValueError("its content is shorter than it says")
    text = from_json(unpacked(data[_TEXT.size : begin]))
    if not isinstance(text, dict) or not isinstance(text.get("arrays"), dict):
        raise ValueError("its content is not described")
    return text, begin, n_chunks


class FrameArrays(dict[str, NDArray[Any]]):
    """The arrays of a frame, all in one memory, which a device may use as it lies."""

    memory: NDArray[np.uint8]


def read_arrays(data: memoryview, codec: str) -> FrameArrays:
    """Return the arrays of a frame's content, decompressed."""
    text, begin, n_chunks = read_text(data)
    index = np.frombuffer(data, _INDEX, n_chunks, begin)
    body = data[begin + index.nbytes :]
    packed: dict[str, PackedArray] = {}
    tasks: list[tuple[PackedArray, int, NDArray[Any]]] = []
    for name, (kind, rows) in text["arrays"].items():
        if kind not in _TYPES or isinstance(rows, bool) or not 0 <= int(rows) < 1 << 40:
            raise ValueError(f"its array {name!r} is of a kind that is unknown")
        layout = _layout(np.dtype(kind), int(rows))
        chunks, index = index[: layout.n_chunks], index[layout.n_chunks :]
        n_bytes = int(chunks["bytes"].sum(dtype=np.int64))
        if n_bytes > len(body):
            raise ValueError(f"its array {name!r} is cut off")
        packed[name] = _packed(name, layout, codec, chunks, body[:n_bytes])
        body = body[n_bytes:]
    sizes = [
        -(-each.layout.n_rows * each.layout.dtype.itemsize // 8) * 8 for each in packed.values()
    ]
    arrays = FrameArrays()
    arrays.memory = aligned_empty(sum(sizes), np.uint8)
    begin = 0
    for size, (name, each) in zip(sizes, packed.items(), strict=True):
        kind, rows = each.layout.dtype, each.layout.n_rows
        array = arrays.memory[begin : begin + rows * kind.itemsize].view(kind)
        arrays[name] = array
        tasks += [(each, first, array[first:last]) for first, last in each.ranges()]
        begin += size
    with workers() as pool:
        for _ in pool.map(lambda task: task[0].read(task[1], task[2]), tasks):
            pass
    return arrays


def _packed(
    name: str, layout: Layout, codec: str, sizes: NDArray[Any], body: memoryview
) -> PackedArray:
    checksums = sizes["crc32"].tolist()

    def fetch(k: int, begin: int, end: int) -> memoryview:
        if zlib.crc32(body[begin:end]) != checksums[k]:
            raise DamagedChunkError(f"chunk {k} is not what was written: its checksum differs")
        return body[begin:end]

    return PackedArray(name, layout, codec, sizes["bytes"], len(body), fetch)


def _layout(dtype: np.dtype[Any], n_rows: int) -> Layout:
    return Layout(dtype, (), n_rows, "none", CHUNK_ROWS)


def unpacked(data: memoryview | bytes) -> bytes:
    """Return a text that zlib has compressed, which may not be longer than descriptions are."""
    stream = zlib.decompressobj()
    try:
        text = stream.decompress(data, MAX_DESCRIPTION_BYTES)
    except zlib.error as error:
        raise ValueError(f"its description does not decompress ({error})") from error
    if not stream.eof:
        raise ValueError("its description is longer than any")
    return text


def index_bytes(steps: int) -> int:
    """Return the bytes of the index of so many steps, with what stands around it."""
    return HEADER_BYTES + steps * (ENTRY.size + HEADER_BYTES) + TRAILER.size


def head_bytes(head: Mapping[str, Any], magic: bytes = MAGIC) -> bytes:
    """Return the bytes that a file begins with."""
    text = json.dumps(head, allow_nan=False).encode()
    checksum = zlib.crc32(text, zlib.crc32(struct.pack("<II", FORMAT_VERSION, len(text))))
    return magic + HEAD.pack(FORMAT_VERSION, len(text), checksum) + text
