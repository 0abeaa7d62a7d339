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
from pyvista_vdi.io.vdi_file.layout import (
    CHUNK_ROWS,
    COARSE,
    COARSE_STEP,
    DEFERRED_NAME,
    DEFLATE,
    DESCRIPTION,
    FORMAT_VERSION,
    INDEX,
    INDEX_DTYPE,
    VERSION_OF,
    Layout,
    describe,
    layouts,
    to_json,
)
from pyvista_vdi.model.packing import DEPTH_CODES, Packed8
from pyvista_vdi.model.vdi import VDI, DeferredVDI, length_per_depth, made_vdi
from pyvista_vdi.model.whole_file import whole_file

#: The oldest time that ZIP knows; a real one would make equal VDIs differ.
_NO_TIME = (1980, 1, 1, 0, 0, 0)


def write(
    vdi: Any,
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
        write_to(stream, vdi, compression, level, progress)
    return Path(os.path.realpath(path))


def write_to(
    stream: IO[bytes],
    vdi: VDI | DeferredVDI,
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
    about = getattr(vdi, "about", None)
    longest = int(vdi.counts.max())
    kind = next(kind for kind in ("<u1", "<u2", "<u4", "<u8") if longest <= np.iinfo(kind).max)
    counts = vdi.counts.ravel().astype(kind)
    version = FORMAT_VERSION if compression == DEFLATE else VERSION_OF[vdi.precision]
    packing = vdi.packing
    filtered = compression != "none"
    arrays = layouts(vdi, counts.dtype, filtered=filtered, version=version)
    # Describe them
    entries = describe(vdi, version)
    if about is not None:
        entries |= {"format": DEFERRED_NAME, "deferred": about}
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
        if coarse and compression == DEFLATE and shrinks and isinstance(vdi, VDI):
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


def coarser(vdi: VDI, step: int = 4) -> VDI:
    """Return a VDI of every ``step``-th list along each edge, of the same view.

    A list of the result is the one of ``vdi`` that the middle of its pixel lies in. The medium of
    its supersegments is the same, so their optical depths follow the length along the new middle.

    ``vdi``: what it stands for. ``step``: lists along an edge that one takes the place of. Returns:
    Of ⌈W / step⌉ by ⌈H / step⌉ lists, exact and without metadata.
    """
    camera, (width, height) = vdi.camera, vdi.window_size
    window = (-(-width // step), -(-height // step))
    # Middles of the new pixels in list coordinates of both; the viewports' shapes differ where
    # the window is no multiple of the step
    grown = np.divide(camera.half_extent(window), camera.half_extent(vdi.window_size))
    new = [(2 * np.arange(n) + 1) / n - 1 for n in window]
    places = [
        np.floor(((middles + centre) * g - centre + 1) / 2 * n).astype(np.int64)
        for middles, centre, g, n in zip(
            new, camera.window_center, grown, vdi.window_size, strict=True
        )
    ]
    inside = [(p >= 0) & (p < n) for p, n in zip(places, vdi.window_size, strict=True)]
    x, y = (np.clip(p, 0, n - 1) for p, n in zip(places, vdi.window_size, strict=True))
    taken = (y[:, np.newaxis] * width + x).ravel()
    counts = np.where(np.outer(*inside[::-1]).ravel(), vdi.counts.reshape(-1)[taken], 0)
    # Offsets of the lists that are taken, one after the other, and which supersegments are theirs
    offsets = np.concatenate([[0], np.cumsum(counts)])
    rows = np.repeat(vdi.offsets.view(np.int64)[taken] - offsets[:-1], counts)
    rows += np.arange(offsets[-1])
    stretch = length_per_depth(camera, window) / length_per_depth(camera, vdi.window_size, x, y)
    tau = vdi.optical_depth[rows] * np.repeat(stretch.ravel(), counts)
    arrays = vdi.arrays.take(offsets, rows)._replace(optical_depth=tau.astype(np.float32))
    return made_vdi(arrays, vdi, camera=camera, window_size=window, metadata={})


def stored(name: str) -> zipfile.ZipInfo:
    """Return how a member is written: the same bytes at any time, on every system."""
    info = zipfile.ZipInfo(name, date_time=_NO_TIME)
    info.create_system = 3
    info.external_attr = 0o644 << 16
    return info


def stored_rows(packed: Packed8, name: str, first: int, last: int) -> NDArray[Any]:
    """Return rows of an array as files store it: see :func:`packed_of_stored`.

    Of ``front`` how far it is behind the back before it, in codes, and of ``back`` how far it is
    behind its front. The first gap of a list is 0, as its code is; that of row ``first`` is its
    front's code.
    """
    if name in ("origin", "stride"):
        return (packed.origins if name == "origin" else packed.strides)[first:last]
    front, back, tau, color = packed.codes(slice(first, last))
    if name == "back":
        return back - front
    if name == "optical_depth":
        return tau
    if name == "color":
        return color.astype("<u4").view(np.uint8).reshape(-1, 4)[:, 1:]
    gaps = np.append(front[:1], front[1:] - back[:-1])
    begin, end = np.searchsorted(packed.offsets, [first, last])
    gaps[packed.offsets[begin:end].astype(np.int64) - first] = 0
    return gaps


def _encoder(
    name: str, layout: Layout, vdi: VDI | DeferredVDI, counts: NDArray[Any]
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
            rows = getattr(vdi.arrays, name)[first:last]
        return np.ascontiguousarray(rows, dtype=layout.dtype)

    return encoded
