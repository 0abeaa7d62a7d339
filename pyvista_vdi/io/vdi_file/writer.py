"""Writes .vdi files."""

from __future__ import annotations

import io
import os
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.io.progress import Pieces, Progress
from pyvista_vdi.io.vdi_file.chunks import DEFAULT_LEVELS, smallest, write_chunks
from pyvista_vdi.io.vdi_file.coarse import coarser
from pyvista_vdi.io.vdi_file.description import describe, to_json
from pyvista_vdi.io.vdi_file.layout import (
    CHUNK_ROWS,
    COARSE,
    COARSE_STEP,
    DEFERRED_NAME,
    DEFLATE,
    DESCRIPTION,
    INDEX,
    INDEX_DTYPE,
    Layout,
    layouts,
    version_of,
)
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.packing import DEPTH_CODES, channel_differences, stored_rows
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.whole_file import whole_file

#: The oldest time that ZIP knows; a real one would make equal VDIs differ.
_NO_TIME = (1980, 1, 1, 0, 0, 0)


def write(
    vdi: VDI | DeferredVDI,
    path: str | os.PathLike[str],
    *,
    compression: str = "lz4",
    level: int | None = None,
    precision: str | None = None,
    progress: Progress | None = None,
) -> Path:
    """Write a VDI to a file, exactly or packed: see :func:`pyvista_vdi.io.write`.

    ``vdi``, ``path``: as there; the name ends in ``.vdi``. ``compression`` ("lz4", "zstd",
    "deflate", "none"): ``"lz4"`` is the fastest to write and to read, ``"zstd"`` makes files a few
    percent smaller, ``"deflate"`` is for pages: browsers decode it, and draw a coarse level that it
    begins with while they read the rest. ``"none"`` leaves plain little-endian arrays. ``level``:
    effort of the compressor, 1 to 9; 9 for lz4, 6 for deflate and 1 for zstd by default. Higher
    levels are slower to write, not to read. ``precision`` ("exact", "8-byte"): bytes of
    a supersegment before they are compressed, as for :meth:`pyvista_vdi.VDI.with_precision`; the
    VDI's own by default. ``progress``: as for :func:`pyvista_vdi.io.write`.
    """
    vdi = vdi if precision is None else vdi.with_precision(precision)
    lists, about = (vdi.lists, vdi.about) if isinstance(vdi, DeferredVDI) else (vdi, None)
    with whole_file(path) as stream:
        write_to(stream, lists, compression, level, progress, deferred=about)
    return Path(os.path.realpath(path))


def write_to(
    stream: IO[bytes],
    vdi: VDI,
    compression: str,
    level: int | None = None,
    progress: Progress | None = None,
    *,
    coarse: bool = True,
    deferred: Mapping[str, Any] | None = None,
) -> None:
    """Write a .vdi file to a stream that can be sought in.

    ``stream``: takes the bytes. ``vdi``, ``compression``, ``level``, ``progress``: as for
    :func:`write`; the VDI has the precision to write. ``coarse``: whether a file of version 4
    begins with a coarse level. ``deferred``: what a :class:`DeferredVDI` is about, whose lists
    ``vdi`` are; they have no coarse level, as values do not mix as media do.
    """
    counts = smallest(np.diff(vdi.offsets))
    arrays = layouts(
        vdi.window_size,
        vdi.n_supersegments,
        counts.dtype,
        filtered=compression != "none",
        version=version_of(vdi.precision, compression),
        precision=vdi.precision,
    )
    description = _described(vdi, arrays, compression, deferred)
    effort = DEFAULT_LEVELS[compression] if level is None else level
    done = Pieces(progress, sum(layout.n_chunks for layout in arrays.values()))
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(stored(DESCRIPTION), description)
        shrinks = min(vdi.window_size) >= COARSE_STEP and int(vdi.counts.max()) <= DEPTH_CODES
        if coarse and compression == DEFLATE and shrinks and deferred is None:
            small = coarser(vdi, COARSE_STEP).with_precision("8-byte")
            few = io.BytesIO()
            write_to(few, small, DEFLATE, effort, coarse=False)
            archive.writestr(stored(COARSE), few.getvalue())
        index: list[tuple[int, int]] = []
        for name, layout in arrays.items():
            with archive.open(stored(name), "w", force_zip64=True) as member:
                encoded = _encoder(name, layout, vdi, counts)
                index += write_chunks(member, layout, compression, effort, encoded, done)
        archive.writestr(stored(INDEX), np.array(index, INDEX_DTYPE).tobytes())


def stored(name: str) -> zipfile.ZipInfo:
    """Return how a member is written: the same bytes at any time, on every system."""
    info = zipfile.ZipInfo(name, date_time=_NO_TIME)
    info.create_system = 3
    info.external_attr = 0o644 << 16
    return info


def _described(
    vdi: VDI, arrays: Mapping[str, Layout], codec: str, deferred: Mapping[str, Any] | None
) -> str:
    version = version_of(vdi.precision, codec)
    entries = describe(vdi, version)
    if deferred is not None:
        entries |= {"format": DEFERRED_NAME, "deferred": dict(deferred)}
    metadata = entries.pop("metadata")
    packed: dict[str, Any] = {} if version < 3 else {"precision": vdi.precision}
    if vdi.packing is not None:
        packed["depth_step"] = vdi.packing.step
    return to_json(
        {
            **entries,
            **packed,
            "codec": codec,
            "chunk_rows": CHUNK_ROWS,
            "arrays": {name: layout.to_dict() for name, layout in arrays.items()},
            "metadata": metadata,
        }
    )


def _encoder(
    name: str, layout: Layout, vdi: VDI, counts: NDArray[Any]
) -> Callable[[int, int], NDArray[Any]]:
    packing = vdi.packing
    if packing is not None and name != "counts":

        def encoded(first: int, last: int) -> NDArray[Any]:
            rows = stored_rows(packing, name, first, last)
            if layout.filter == "channel-difference":
                rows = channel_differences(rows)
            return np.ascontiguousarray(rows, dtype=layout.dtype)

        return encoded
    if layout.filter == "difference":
        # Bit patterns modulo 2**32, exact: of fronts less those of the backs before (the first as
        # it stands, 0 where supersegments touch), and of backs less those of their fronts
        front, back = vdi.front.view(np.uint32), vdi.back.view(np.uint32)

        def differences(first: int, last: int) -> NDArray[Any]:
            if name == "back":
                return np.subtract(back[first:last], front[first:last]).astype("<u4", copy=False)
            gaps = front[first:last].astype("<u4")
            gaps[1:] -= back[first : last - 1]
            return gaps

        return differences
    array = counts if name == "counts" else getattr(vdi, name)
    return lambda first, last: np.ascontiguousarray(array[first:last], dtype=layout.dtype)
