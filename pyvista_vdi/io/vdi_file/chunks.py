"""Arrays as sequences of independently compressed chunks: Blosc, by numcodecs, or zlib.

Chunks bound the memory that writing takes beside the arrays, and are what runs in parallel. Blosc
shuffles bytes before it compresses: exponents, which hardly change, come to lie beside each other.
For zlib that is done here.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
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

#: Threads for work on chunks; in them Blosc starts none of its own.
THREADS = min(8, cpu_count() or 1)


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
    """Compress an array chunk by chunk, write it, and return each chunk's bytes and its CRC-32.

    ``codec``: one of :data:`CODECS`, or ``"none"`` for the bare bytes. ``level``: effort of the
    compressor, 1 to 9. ``encoded(first, last)`` gives those rows as they are stored: little-endian,
    contiguous. ``done`` is called after each chunk.
    """

    def compressed(rows_of: tuple[int, int]) -> tuple[bytes, int]:
        rows = encoded(*rows_of)
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
    with ThreadPoolExecutor(THREADS) as pool:
        index: list[tuple[int, int]] = []
        ranges, ahead = layout.ranges(), 4 * THREADS
        for start in range(0, len(ranges), ahead):
            for chunk, checksum in pool.map(compressed, ranges[start : start + ahead]):
                stream.write(chunk)
                index.append((len(chunk), checksum))
                done()
    return index


class PackedArray:
    """An array as it lies in a file; its chunks are known, and nothing is allocated for it.

    So what is allocated afterwards is bounded by what the file really holds.

    ``name``: of the array, for errors. ``sizes``: bytes of each chunk. ``n_bytes``: what they must
    add up to. ``fetch(k, begin, end)`` gives the bytes of chunk k, which lie there among the
    array's; it raises DamagedChunkError where they are not what was written. Raises
    DamagedChunkError if the chunks are not as many and as long as such an array needs.
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
        self.layout, self._name, self._codec, self._fetch = layout, name, codec, fetch
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

    def read(self, first: int, out: NDArray[Any]) -> None:
        """Decompress the chunk that begins with row ``first`` into rows as they were stored.

        Raises DamagedChunkError if the chunk is not what was written, or does not decompress.
        """
        k, rows = first // self.layout.chunk_rows, out.reshape(-1)
        try:
            chunk = self._fetch(k, self._ends[k], self._ends[k + 1])
            if self._codec == "none":
                rows.view(np.uint8)[:] = np.frombuffer(chunk, np.uint8)
            elif self._codec == DEFLATE:
                # Nothing more than belongs is ever unpacked
                stream = zlib.decompressobj()
                data = stream.decompress(chunk, rows.nbytes + 1)
                if len(data) != rows.nbytes or not stream.eof or stream.unused_data:
                    raise DamagedChunkError(
                        f"a stream of zlib does not end after the {rows.nbytes} bytes that belong"
                    )
                planes = np.frombuffer(data, np.uint8).reshape(self.layout.row_bytes, -1)
                rows.view(np.uint8).reshape(-1, self.layout.row_bytes)[:] = planes.T
            else:
                self._check_blosc(chunk, rows.nbytes)
                from numcodecs import blosc

                blosc.decompress(chunk, rows)
        except DamagedChunkError as error:
            raise self._damaged(str(error)) from error
        except (RuntimeError, ValueError, zlib.error) as error:
            last = first + len(out) - 1
            raise self._damaged(f"rows {first} to {last} do not decompress") from error

    def _check_blosc(self, chunk: bytes, raw: int) -> None:
        """Raise DamagedChunkError if a chunk does not begin with the header of so many bytes."""
        version, _, flags, _, n_bytes, block_bytes, chunk_bytes = _HEADER.unpack_from(chunk)
        stored = bool(flags & 0x02)  # not compressible: the bytes follow as they are
        if version != 2 or (not stored and flags >> 5 != {"lz4": 1, "zstd": 4}[self._codec]):
            raise DamagedChunkError(f"a chunk is not in Blosc's format with {self._codec}")
        belong = raw + _HEADER.size if stored else len(chunk)
        if not (n_bytes == raw and chunk_bytes == len(chunk) == belong and 0 < block_bytes <= raw):
            raise DamagedChunkError(
                f"a chunk declares {n_bytes} bytes in {chunk_bytes} where {raw} belong"
            )

    def _damaged(self, why: str) -> DamagedChunkError:
        return DamagedChunkError(f"array {self._name!r}: {why}")


def check_level(level: Any) -> None:
    """Raise InvalidArgumentError unless a compressor's effort is None or 1 to 9."""
    if level is not None and (type(level) is not int or not 1 <= level <= 9):
        raise InvalidArgumentError(f"level must be a whole number from 1 to 9; got {level!r}")
