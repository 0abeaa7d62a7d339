"""Arrays as sequences of independently compressed chunks (Blosc, by numcodecs).

Chunks bound the memory that writing and reading take beside the arrays, and are what runs in
parallel. Blosc shuffles bytes before it compresses: exponents, which hardly change, come to lie
beside each other.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from os import cpu_count
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Rows of an array in one chunk: 1 to 3 MiB, so that a VDI of 1280 x 720 makes some dozens.
CHUNK_ROWS = 1 << 18

#: Compressors of Blosc that files may name.
CODECS = ("zstd", "lz4")

#: Most bytes that one compressed byte can stand for. Zstandard's best is a block of 128 KiB from
#: 4 bytes (RFC 8878, section 3.1.1.2); LZ4 stays below 255.
MAX_RATIO = 1 << 15

#: Blosc's header: version, compressor's version, flags, type size; bytes of the data, of a block,
#: and of the chunk with its header (c-blosc, README_CHUNK_FORMAT.rst).
_HEADER = struct.Struct("<BBBBIII")

_MAX_THREADS = 8


class DamagedChunkError(Exception):
    """A chunk is not what the array's description says; the message says how."""


def write_chunks(
    stream: Any, n_rows: int, codec: str, level: int, encoded: Callable[[int, int], NDArray[Any]]
) -> None:
    """Compress an array chunk by chunk and write it.

    Parameters
    ----------
    stream : file-like
        Where the chunks go, one behind the other.
    n_rows : int
        Length of the array.
    codec : str
        One of :data:`CODECS`, or ``"none"`` for the bare bytes.
    level : int
        Effort of the compressor, 1 to 9.
    encoded : callable
        ``encoded(first, last)`` gives those rows as they are stored: little-endian, contiguous.
    """

    def compressed(first: int) -> bytes:
        rows = encoded(first, min(first + CHUNK_ROWS, n_rows))
        if codec == "none":
            return rows.tobytes()
        from numcodecs import blosc

        return bytes(blosc.compress(rows.reshape(-1), codec.encode(), level, blosc.SHUFFLE, 0))

    # Always in worker threads: there numcodecs lets each call compress with one thread, so that
    # the bytes do not depend on which of Blosc's own threads finishes first.
    n_threads = _n_threads()
    with ThreadPoolExecutor(n_threads) as pool:
        firsts = range(0, n_rows, CHUNK_ROWS)
        for start in range(0, len(firsts), 2 * n_threads):
            for chunk in pool.map(compressed, firsts[start : start + 2 * n_threads]):
                stream.write(chunk)


def read_chunks(
    data: bytes,
    codec: str,
    out: NDArray[Any],
    finish: Callable[[int, int], None] | None = None,
) -> None:
    """Decompress an array chunk by chunk.

    Parameters
    ----------
    data : bytes
        What :func:`write_chunks` wrote; :func:`check_chunks` has passed on it.
    codec : str
        As written.
    out : numpy.ndarray
        Takes the rows as they were stored; contiguous, little-endian.
    finish : callable, optional
        ``finish(first, last)`` is called when those rows are there, from several threads.

    Raises
    ------
    DamagedChunkError
        If a chunk does not decompress.
    """
    view = memoryview(data)

    def decompress(chunk: tuple[int, int, int, int]) -> None:
        first, last, begin, end = chunk
        rows = out[first:last].reshape(-1)
        if codec == "none":
            rows[:] = np.frombuffer(view[begin:end], dtype=out.dtype)
        else:
            from numcodecs import blosc

            try:
                blosc.decompress(view[begin:end], rows)
            except (RuntimeError, ValueError) as error:
                raise DamagedChunkError(f"rows {first} to {last - 1} do not decompress") from error
        if finish is not None:
            finish(first, last)

    chunks = list(_located(view, len(out), out.itemsize * _items(out), codec))
    with ThreadPoolExecutor(_n_threads()) as pool:
        for _ in pool.map(decompress, chunks):
            pass


def check_chunks(data: bytes, n_rows: int, row_bytes: int, codec: str) -> None:
    """Check that the chunks are as many, as long and as large as an array of that size needs.

    Reads the chunks' headers only and allocates nothing, so that what is allocated afterwards is
    bounded by what the file really holds.

    Raises
    ------
    DamagedChunkError
        If they are not.
    """
    for _ in _located(memoryview(data), n_rows, row_bytes, codec):
        pass


def _located(
    view: memoryview, n_rows: int, row_bytes: int, codec: str
) -> Iterator[tuple[int, int, int, int]]:
    """Yield first row, last row, first byte and last byte of each chunk (last: one beyond)."""
    begin = 0
    for first in range(0, n_rows, CHUNK_ROWS):
        last = min(first + CHUNK_ROWS, n_rows)
        raw = (last - first) * row_bytes
        size = raw if codec == "none" else _chunk_size(view[begin:], raw, codec)
        if begin + size > len(view):
            raise DamagedChunkError(f"the data end before row {last} of {n_rows}")
        yield first, last, begin, begin + size
        begin += size
    if begin != len(view):
        raise DamagedChunkError(f"{len(view) - begin} bytes follow the last of {n_rows} rows")


def _chunk_size(view: memoryview, raw: int, codec: str) -> int:
    """Return the bytes of the compressed chunk that begins here, its header checked."""
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


def _items(array: NDArray[Any]) -> int:
    """Return how many elements a row has."""
    return int(np.prod(array.shape[1:], dtype=np.int64))


def _n_threads() -> int:
    return min(_MAX_THREADS, cpu_count() or 1)
