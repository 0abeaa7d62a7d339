"""Writes .vdi files."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..vdi import VDI
from .chunks import CHUNK_ROWS, write_chunks
from .description import describe, to_json
from .layout import DESCRIPTION, Layout, layouts
from .whole_file import whole_file

#: The oldest time that ZIP knows; a real one would make equal VDIs differ.
_NO_TIME = (1980, 1, 1, 0, 0, 0)


def write(
    vdi: VDI, path: str | os.PathLike[str], *, compression: str = "zstd", level: int = 1
) -> Path:
    """Write a VDI to a file, exactly.

    The file appears whole or not at all: it is written under a temporary name in the same folder
    and moved into place, and what was there before stays until then.

    Parameters
    ----------
    vdi : VDI
        What to write.
    path : path-like
        The target; its name ends in ``.vdi``.
    compression : {"zstd", "lz4", "none"}
        ``"zstd"`` makes the smallest files, ``"lz4"`` is about three times faster to write,
        ``"none"`` leaves plain little-endian arrays.
    level : int
        Effort of the compressor, 1 to 9; higher levels are slower to write, not to read.

    Returns
    -------
    pathlib.Path
        The file, links followed.

    Raises
    ------
    VDIFileError
        If the target cannot be written, or the metadata hold what JSON cannot.

    See Also
    --------
    pyvista_vdi.io.write : checks the options first.
    """
    counts = _smallest(np.diff(vdi.offsets))
    arrays = layouts(
        vdi.window_size, vdi.n_supersegments, counts.dtype, filtered=compression != "none"
    )
    description = _described(vdi, arrays, compression)
    with whole_file(path) as stream, zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(_member(DESCRIPTION), description)
        for name, layout in arrays.items():
            with archive.open(_member(name), "w", force_zip64=True) as member:
                encoded = _encoder(name, layout, vdi, counts)
                write_chunks(member, layout.n_rows, compression, level, encoded)
    return Path(os.path.realpath(path))


def _member(name: str) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name, date_time=_NO_TIME)
    info.create_system = 3  # the same bytes on every system
    info.external_attr = 0o644 << 16
    return info


def _smallest(counts: NDArray[Any]) -> NDArray[Any]:
    """Return whole numbers >= 0 in the shortest unsigned type that holds them."""
    largest = int(counts.max(initial=0))
    kind = next(k for k in ("<u1", "<u2", "<u4", "<u8") if largest <= np.iinfo(k).max)
    return counts.astype(kind)


def _described(vdi: VDI, arrays: Mapping[str, Layout], codec: str) -> str:
    entries = describe(vdi)
    metadata = entries.pop("metadata")
    return to_json(
        {
            **entries,
            "codec": codec,
            "chunk_rows": CHUNK_ROWS,
            "arrays": {name: layout.to_dict() for name, layout in arrays.items()},
            "metadata": metadata,
        }
    )


def _encoder(
    name: str, layout: Layout, vdi: VDI, counts: NDArray[Any]
) -> Callable[[int, int], NDArray[Any]]:
    if name == "depth":
        encode = _depth_differences if layout.filter == "difference" else _depth_pairs
        return lambda first, last: encode(vdi.front[first:last], vdi.back[first:last])
    array = counts if name == "counts" else getattr(vdi, name)
    return lambda first, last: np.ascontiguousarray(array[first:last], dtype=layout.dtype)


def _depth_pairs(front: NDArray[np.float32], back: NDArray[np.float32]) -> NDArray[Any]:
    return np.stack([front, back], axis=1).astype("<f4", copy=False)


def _depth_differences(front: NDArray[np.float32], back: NDArray[np.float32]) -> NDArray[Any]:
    """Return the depths' bit patterns less those of the depth before, as uint32 (n, 2).

    Depths rise along a list and supersegments often touch: then the difference of front and
    preceding back is 0, and that of back and front is small. Taken of the bit patterns modulo
    2**32, it is exact.
    """
    pairs = np.stack([front, back], axis=1).view(np.uint32).reshape(-1)
    pairs[1:] = np.diff(pairs)
    return pairs.astype("<u4", copy=False).reshape(-1, 2)
