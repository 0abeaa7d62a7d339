"""One entrance to volumes in files: what a file holds, and the one that is asked for."""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pyvista_vdi.errors import (
    InvalidVolumeError,
    MissingDependencyError,
    UnsupportedError,
    VDIError,
)
from pyvista_vdi.io.stores import StoredVolume, names_in, store_at
from pyvista_vdi.io.volumes.formats import VolumeFormat, format_of
from pyvista_vdi.io.volumes.in_file import REMEDY, VolumeInFile, chosen, placed, volume_of
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.model.whole_file import as_path


def read_volume(
    path: str | os.PathLike[str],
    *,
    array: int | str | None = None,
    series: int | str | None = None,
    channel: int | str | None = None,
    time: int | None = None,
    level: int | str | None = None,
    spacing: Sequence[float] | None = None,
    origin: Sequence[float] | None = None,
) -> Volume:
    """Read a volume from a file, a folder of slices or a store of chunks.

    The format is known by the name, or else by the content. Coordinates are the file's own:
    those of NIfTI grow to the right, the front and the head, those of DICOM and of most MetaImages
    to the left, the back and the head. Of a store only the
    metadata are read now, and its voxels chunk by chunk, where a part is needed: it is a
    :class:`StoredVolume` (docs/large_volumes.md).

    Parameters
    ----------
    path : path-like
        Any file of the table in ``docs/files.md``; a store, ``"x.zarr"``, ``"x.ome.zarr"``
        (OME-Zarr 0.4 or 0.5), or an HDF5 file; ``"x.h5::/path"`` is an array in it.
    array, series : int or str, optional
        Which one, by its number or its name, where a file holds several; both mean the same.
    channel : int or str, optional
        Which channel, by its number or its name, where there are several.
    time : int, optional
        Which time step, where there are several.
    level : int or "auto", optional
        Level of a store's multi-scale image, 0 is the finest; by default it is left to the view.
    spacing, origin : (float, float, float), optional
        In place of those of the file, along x, y and z.

    Returns
    -------
    Volume
        Its ``unit`` is that of lengths, where the file says one.

    Raises
    ------
    InvalidVolumeError
        If the file is absent, truncated or damaged, or holds no volume.
    UnsupportedError
        If it holds several and none is asked for, or is of a format that is not read.
    InvalidArgumentError
        If it does not hold what is asked for.
    MissingDependencyError
        If the format's library is not installed.
    """
    file, asked = Path(as_path(path)), series if array is None else array
    if (volumes_in := (kind := format_of(path)).volumes_in) is None:
        inside = f"{os.fspath(path)}::{asked}" if isinstance(asked, str) else path
        told: Any = {"level": level, "channel": channel, "time": time}
        told = {name: value for name, value in told.items() if value is not None}
        return placed(StoredVolume(store_at(inside), **told), spacing, origin)
    if level not in (None, "auto", 0):
        raise UnsupportedError(f"{file} has no levels, as stores have: leave level={level!r} out")
    with _explained(file, kind):
        found = volumes_in(file)
        meant = [each for each in found if each.meant]
        found = meant if asked is None and len(meant) == 1 else found
        names, listed = [each.name or "values" for each in found], "; ".join(map(str, found[:20]))
        number = chosen(file, "volume", names, asked, "array= or series=", listed)
        return placed(volume_of(found[number], file, channel, time), spacing, origin)


def list_volumes(path: str | os.PathLike[str]) -> list[VolumeInFile]:
    """Return what volumes a file holds.

    Parameters
    ----------
    path : path-like
        As for :func:`read_volume`, which says what is raised, too.

    Returns
    -------
    list of VolumeInFile
        Their ``name``, ``dimensions``, ``dtype``, ``spacing``, ``unit`` and ``channels``; ``str()``
        of one is a line for people.
    """
    file = Path(as_path(path))
    if (volumes_in := (kind := format_of(path)).volumes_in) is not None:
        with _explained(file, kind):
            return volumes_in(file)
    inside = [f"{file}::{name}" for name in names_in(path)] if file.is_file() else [path]
    found = []
    for store in map(store_at, inside):
        axes = "".join(axis[:1] for axis in store.axes)
        for level in store.levels:
            known = (level.grid.index_to_model, level.path, store.unit, store.channels)
            found.append(VolumeInFile(level.array, axes, *known))
    return found


@contextmanager
def _explained(file: Path, kind: VolumeFormat) -> Iterator[None]:
    """Turn what a library raises, or logs and reads on, into errors of ours."""
    damage: list[str] = []
    mine = threading.get_ident()

    def passes(record: logging.LogRecord) -> bool:
        if heard := record.thread == mine and record.levelno >= logging.ERROR:
            damage.append(record.getMessage())
        return not heard

    # A filter of this thread's records: handlers are the process's, and its other threads' as well
    logger = logging.getLogger("tifffile")
    logger.addFilter(passes)
    try:
        yield
        if damage:
            raise ValueError(damage[0])
    except ImportError as error:
        raise MissingDependencyError(
            f"{file} is {kind.name}, read by {kind.library}, which is not installed: install it "
            f'by pip install "pyvista-vdi[{kind.extra}]"'
        ) from error
    except (MemoryError, Warning):  # a warning, where those are errors
        raise
    except Exception as error:  # each library has exceptions of its own
        if isinstance(error, VDIError):
            raise error if str(file) in str(error) else type(error)(f"{file}: {error}") from error
        why = " ".join(str(error).split())[-500:] or type(error).__name__
        said_of = f"{file} cannot be read as {kind.name} ({why})"
        raise InvalidVolumeError(f"{said_of}: is it whole? Write it anew, or {REMEDY}") from error
    finally:
        logger.removeFilter(passes)
