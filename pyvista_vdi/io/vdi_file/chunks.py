"""Arrays as sequences of independently compressed chunks: Blosc, by numcodecs, or zlib.

Chunks bound the memory that writing takes beside the arrays, and are what runs in parallel. Blosc
shuffles bytes before it compresses: exponents, which hardly change, come to lie beside each other.
For zlib that is done here.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from os import cpu_count
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.io.vdi_file.layout import DEFLATE, Layout

#: Compressors that files may name: two of Blosc, and zlib.
CODECS = ("lz4", "zstd", DEFLATE)

#: Level of each that is taken where none is asked for. LZ4 is fast at its highest; Zstandard's
#: higher levels take several times as long for a few percent.
DEFAULT_LEVELS = {"lz4": 9, "zstd": 1, DEFLATE: 6, "none": 1}

#: Most bytes that one compressed byte of Blosc can stand for. Zstandard's best is a block of
#: 128 KiB from 4 bytes (RFC 8878, section 3.1.1.2); LZ4 stays below 255. Of zlib: 258 from 2 bits.
MAX_RATIO = 1 << 15
_DEFLATE_RATIO = 1032

#: Blosc's header: version, compressor's version, flags, type size; bytes of the data, of a block,
#: and of the chunk with its header (c-blosc, README_CHUNK_FORMAT.rst).
_HEADER = struct.Struct("<BBBBIII")

_MAX_THREADS = 8


class DamagedChunkError(Exception):
    """A chunk is not what the array's description says; the message says how."""


def write_chunks(
    stream: Any,
    layout: Layout,
    codec: str,
    level: int,
    encoded: Callable[[int, int], NDArray[Any]],
    done: Callable[[], object],
) -> list[tuple[int, int]]:
    """Compress an array chunk by chunk and write it.

    ``stream``: where the chunks go, one behind the other. ``layout``: length of the array and of
    its chunks. ``codec``: one of :data:`CODECS`, or ``"none"`` for the bare bytes. ``level``:
    effort of the compressor, 1 to 9. ``encoded``: ``encoded(first, last)`` gives those rows as they
    are stored: little-endian, contiguous. ``done``: called after each chunk. Returns: Bytes of each
    chunk, and their CRC-32.
    """

    def compressed(first: int) -> tuple[bytes, int]:
        rows = encoded(first, min(first + layout.chunk_rows, layout.n_rows))
        if codec == "none":
            chunk = rows.tobytes()
        elif codec == DEFLATE:
            planes = rows.reshape(-1).view(np.uint8).reshape(len(rows), layout.row_bytes).T
            # Codes that are made anew more often: a percent less, in less time
            packer = zlib.compressobj(level, memLevel=7)
            chunk = packer.compress(planes.tobytes()) + packer.flush()
        else:
            from numcodecs import blosc

            chunk = blosc.compress(rows.reshape(-1), codec.encode(), level, blosc.SHUFFLE, 0)
        return chunk, zlib.crc32(chunk)

    # Always in worker threads: there numcodecs lets each call compress with one thread, so that
    # the bytes do not depend on which of Blosc's own threads finishes first.
    with workers() as pool:
        index: list[tuple[int, int]] = []
        firsts, ahead = range(0, layout.n_rows, layout.chunk_rows), 4 * _n_threads()
        for start in range(0, len(firsts), ahead):
            for chunk, checksum in pool.map(compressed, firsts[start : start + ahead]):
                stream.write(chunk)
                index.append((len(chunk), checksum))
                done()
    return index


class PackedArray:
    """An array as it lies in a file; its chunks are known, and nothing is allocated for it.

    So what is allocated afterwards is bounded by what the file really holds.

    ``name``: of the array, for errors. ``layout``: what the array must be. ``codec``: as written.
    ``sizes``: bytes of each chunk. ``n_bytes``: what the sizes must add up to. ``fetch``:
    ``fetch(k, begin, end)`` gives the bytes of chunk k, which lie there among the array's; it
    raises DamagedChunkError where they are not what was written. Raises DamagedChunkError if the
    chunks are not as many and as long as such an array needs.
    """

    def __init__(
        self,
        name: str,
        layout: Layout,
        codec: str,
        sizes: ArrayLike,
        n_bytes: int,
        fetch: Callable[[int, int, int], Any],
    ) -> None:
        self.layout = layout
        self._name = name
        self._codec = codec
        self._fetch = fetch
        bytes_of = np.asarray(sizes, dtype=np.int64)
        if len(bytes_of) != layout.n_chunks:
            raise self._damaged(f"{len(bytes_of)} chunks where {layout.n_chunks} belong")
        raw = np.full(layout.n_chunks, layout.chunk_rows * layout.row_bytes)
        raw[-1:] -= (-layout.n_rows % layout.chunk_rows) * layout.row_bytes
        if codec == "none":
            possible = bytes_of == raw
        elif codec == DEFLATE:
            possible = raw <= bytes_of * _DEFLATE_RATIO
        else:
            possible = (bytes_of > _HEADER.size) & (raw <= bytes_of * MAX_RATIO)
        if not possible.all():
            k = int(np.argmin(possible))
            raise self._damaged(f"{bytes_of[k]} bytes cannot hold the {raw[k]} of chunk {k}")
        self._ends = np.concatenate([[0], np.cumsum(bytes_of)]).tolist()
        if self._ends[-1] != n_bytes:
            raise self._damaged(f"its chunks have {self._ends[-1]} bytes, but {n_bytes} are there")

    def ranges(self) -> Iterator[tuple[int, int]]:
        """Yield the first row of each chunk and the one behind its last."""
        layout = self.layout
        for first in range(0, layout.n_rows, layout.chunk_rows):
            yield first, min(first + layout.chunk_rows, layout.n_rows)

    def read(self, first: int, out: NDArray[Any]) -> None:
        """Decompress the chunk that begins with row ``first``.

        ``first``: as :meth:`ranges` says. ``out``: takes the chunk's rows as they were stored;
        contiguous. Raises DamagedChunkError if the chunk is not what was written, or does not
        decompress.
        """
        k, rows = first // self.layout.chunk_rows, out.reshape(-1)
        try:
            chunk = self._fetch(k, self._ends[k], self._ends[k + 1])
            if self._codec == "none":
                rows.view(np.uint8)[:] = np.frombuffer(chunk, np.uint8)
                return
            if self._codec == DEFLATE:
                planes = np.frombuffer(_inflated(chunk, rows.nbytes), np.uint8)
                by_row = rows.view(np.uint8).reshape(-1, self.layout.row_bytes)
                by_row[:] = planes.reshape(self.layout.row_bytes, -1).T
                return
            if chunk_size(chunk, rows.nbytes, self._codec) != len(chunk):
                raise DamagedChunkError(f"chunk {k} has another length than it says")
            from numcodecs import blosc

            blosc.decompress(chunk, rows)
        except (DamagedChunkError, RuntimeError, ValueError, zlib.error) as error:
            why = f"rows {first} to {first + len(out) - 1} do not decompress"
            known = isinstance(error, DamagedChunkError)
            raise self._damaged(str(error) if known else why) from error

    def _damaged(self, why: str) -> DamagedChunkError:
        return DamagedChunkError(f"array {self._name!r}: {why}")


def check_level(level: Any) -> None:
    """Raise InvalidArgumentError unless a compressor's effort is None or 1 to 9."""
    if level is not None and (type(level) is not int or not 1 <= level <= 9):
        raise InvalidArgumentError(f"level must be a whole number from 1 to 9; got {level!r}")


def smallest(values: NDArray[Any]) -> NDArray[Any]:
    """Return whole numbers >= 0 in the shortest unsigned type that holds them."""
    largest = int(values.max(initial=0))
    kind = next(k for k in ("<u1", "<u2", "<u4", "<u8") if largest <= np.iinfo(k).max)
    return values.astype(kind)


def workers() -> ThreadPoolExecutor:
    """Return threads for work on chunks; in them Blosc starts none of its own."""
    return ThreadPoolExecutor(_n_threads())


def chunk_size(view: memoryview, raw: int, codec: str) -> int:
    """Return the bytes of the compressed chunk that begins here, its header checked.

    Raises DamagedChunkError if it is not the header of ``raw`` bytes compressed by that codec.
    """
    if len(view) < _HEADER.size:
        raise DamagedChunkError("the data end before the last chunk")
    version, _, flags, _, n_bytes, block_bytes, chunk_bytes = _HEADER.unpack_from(view)
    stored = bool(flags & 0x02)  # not compressible: the bytes follow as they are
    if version != 2 or (not stored and flags >> 5 != {"lz4": 1, "zstd": 4}[codec]):
        raise DamagedChunkError(f"a chunk is not in Blosc's format with {codec}")
    if n_bytes != raw or chunk_bytes <= _HEADER.size or not 0 < block_bytes <= raw:
        raise DamagedChunkError(
            f"a chunk declares {n_bytes} bytes in {chunk_bytes} where {raw} belong"
        )
    if stored and chunk_bytes != raw + _HEADER.size:
        raise DamagedChunkError(f"a stored chunk of {raw} bytes declares {chunk_bytes}")
    if raw > chunk_bytes * MAX_RATIO:
        raise DamagedChunkError(f"{chunk_bytes} bytes cannot hold the {raw} that they declare")
    return int(chunk_bytes)


def _inflated(chunk: bytes, raw: int) -> bytes:
    """Return the ``raw`` bytes that a zlib stream stands for; nothing more is ever unpacked."""
    stream = zlib.decompressobj()
    data = stream.decompress(chunk, raw + 1)
    if len(data) != raw or not stream.eof or stream.unused_data:
        raise DamagedChunkError(f"a stream of zlib does not end after the {raw} bytes that belong")
    return data


def _n_threads() -> int:
    return min(_MAX_THREADS, cpu_count() or 1)
