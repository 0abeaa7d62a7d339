"""Writes .vdi files."""

from __future__ import annotations

import io
import os
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.io.progress import Pieces, Progress
from pyvista_vdi.io.vdi_file.chunks import DEFAULT_LEVELS, write_chunks
from pyvista_vdi.io.vdi_file.coarse import coarser
from pyvista_vdi.io.vdi_file.codes import stored_rows
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
from pyvista_vdi.model.packing import DEPTH_CODES
from pyvista_vdi.model.vdi import VDI, Lists
from pyvista_vdi.model.whole_file import whole_file

#: The oldest time that ZIP knows; a real one would make equal VDIs differ.
_NO_TIME = (1980, 1, 1, 0, 0, 0)


def write(
    vdi: Lists,
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
    with whole_file(path) as stream:
        write_to(stream, vdi.lists, compression, level, progress)
    return Path(os.path.realpath(path))


def write_to(
    stream: IO[bytes],
    vdi: VDI,
    compression: str,
    level: int | None = None,
    progress: Progress | None = None,
    *,
    coarse: bool = True,
) -> None:
    """Write a .vdi file to a stream that can be sought in.

    ``stream``: takes the bytes. ``vdi``, ``compression``, ``level``, ``progress``: as for
    :func:`write`; the VDI has the precision to write. ``coarse``: whether a file of version 4
    begins with a coarse level; lists that keep values have none, as these do not mix as media do.
    """
    longest = int(vdi.counts.max())
    kind = next(kind for kind in ("<u1", "<u2", "<u4", "<u8") if longest <= np.iinfo(kind).max)
    counts = vdi.counts.ravel().astype(kind)
    version, packing = version_of(vdi.precision, compression), vdi.packing
    arrays = layouts(
        vdi.window_size,
        vdi.n_supersegments,
        counts.dtype,
        filtered=compression != "none",
        version=version,
        precision=vdi.precision,
    )
    # Describe them
    entries = describe(vdi, version)
    if vdi.kept is not None:
        entries |= {"format": DEFERRED_NAME, "deferred": vdi.kept}
    metadata = entries.pop("metadata")
    if version >= 3:
        entries["precision"] = vdi.precision
    if packing is not None:
        entries["depth_step"] = packing.step
    entries |= {"codec": compression, "chunk_rows": CHUNK_ROWS}
    entries["arrays"] = {name: layout.to_dict() for name, layout in arrays.items()}
    description = to_json({**entries, "metadata": metadata})
    effort = DEFAULT_LEVELS[compression] if level is None else level
    done = Pieces(progress, sum(layout.n_chunks for layout in arrays.values()))
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(stored(DESCRIPTION), description)
        shrinks = min(vdi.window_size) >= COARSE_STEP and longest <= DEPTH_CODES
        if coarse and compression == DEFLATE and shrinks and vdi.kept is None:
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


def _encoder(
    name: str, layout: Layout, vdi: VDI, counts: NDArray[Any]
) -> Callable[[int, int], NDArray[Any]]:
    """Return what gives rows of an array as they are stored."""
    packing = vdi.packing

    def encoded(first: int, last: int) -> NDArray[Any]:
        if name == "counts":
            rows = counts[first:last]
        elif packing is not None:
            rows = stored_rows(packing, name, first, last)
            if layout.filter == "channel-difference":
                # Most colour maps' channels rise and fall together: small numbers, or the same
                red, green, blue = rows.T
                rows = np.stack([blue, green - blue, red - blue], axis=1)
        elif layout.filter == "difference":
            # Bit patterns modulo 2**32, exact: of fronts less those of the backs before (the first
            # as it stands, 0 where supersegments touch), and of backs less those of their fronts
            front, back = (face[first:last].view(np.uint32) for face in (vdi.front, vdi.back))
            rows = back - front
            if name == "front":
                rows = np.append(front[:1], front[1:] - back[:-1])
        else:
            rows = getattr(vdi, name)[first:last]
        return np.ascontiguousarray(rows, dtype=layout.dtype)

    return encoded
