"""One entrance to volumes in files: what a file holds, and the one that is asked for."""

from __future__ import annotations

import logging
import os
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from pyvista_vdi.errors import (
    InvalidVolumeError,
    MissingDependencyError,
    UnsupportedError,
    VDIError,
    warn_external,
)
from pyvista_vdi.io.stores import is_store, names_in, open_store
from pyvista_vdi.io.time_steps import lists_steps
from pyvista_vdi.io.volumes.formats import FORMATS, VolumeFormat, slices_in
from pyvista_vdi.io.volumes.in_file import (
    REMEDY,
    VolumeInFile,
    chosen,
    head_of,
    placed,
    volume_of,
)
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
    to the left, the back and the head. A store is opened, not read: see :func:`open_volume`.

    Parameters
    ----------
    path : path-like
        Any file of the table in ``docs/files.md``; ``"x.h5::/path"`` is an array in a store.
    array, series : int or str, optional
        Which one, by its number or its name, where a file holds several; both mean the same.
    channel : int or str, optional
        Which channel, by its number or its name, where there are several.
    time : int, optional
        Which time step, where there are several.
    level : int or "auto", optional
        Level of a store's multi-scale image; 0, the finest, by default.
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
    if (volumes_in := (kind := _format(path)).volumes_in) is None:
        store = open_store(
            f"{os.fspath(path)}::{asked}" if isinstance(asked, str) else path,
            level="auto" if level is None else level,
            channel=0 if channel is None else channel,
            time=0 if time is None else time,
        )
        return placed(store, spacing, origin)
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
    if (volumes_in := (kind := _format(path)).volumes_in) is not None:
        with _explained(file, kind):
            return volumes_in(file)
    inside = [f"{file}::{name}" for name in names_in(path)] if file.is_file() else [path]
    return [
        VolumeInFile(
            *(level.array, "".join(axis[:1] for axis in store.axes), level.grid.index_to_model),
            *(level.path, store.unit, store.channels),
        )
        for store in (open_store(each).store for each in inside)
        for level in store.levels
    ]


def _format(path: str | os.PathLike[str]) -> VolumeFormat:
    """Return the format of a file, by its name or else by its content, or of a folder.

    HDF5 of any store. What cannot be opened, or is of no format, is refused with a remedy.
    """
    file = Path(path)
    try:
        if is_store(path):
            return FORMATS["HDF5"]
        if os.path.isdir(file):  # noqa: PTH112 - pathlib's raises for a name that is too long
            return FORMATS["PNG slices" if slices_in(file) else "DICOM"]
        why, name = "", file.name.lower()
        if not os.path.exists(file):  # noqa: PTH110
            why = "does not exist: check the volume's path, or name a shipped volume by --example"
            why += " (pyvista_vdi.examples)"
        elif not file.is_file() or not file.stat().st_size:
            why = "cannot be read as a volume: it is empty, or no file"
        elif lists_steps(file):
            why = "lists time steps, and one volume is asked for: name the file of one, or "
            why += "make a series of all (pyvista-vdi series)"
        elif name.endswith((".vdi", ".exr", ".html")):
            why = "is a VDI, not a volume: 'pyvista-vdi render' and 'view' show it"
        if why:
            raise InvalidVolumeError(f"{file} {why}")
        head = head_of(file)
        for each in FORMATS.values():
            if name.endswith(each.suffixes) and not head.startswith(b"CDF"):  # as MINC 1 is
                return each
        for each in FORMATS.values():
            if each.magic and (head.startswith(each.magic) or head[128:].startswith(each.magic)):
                return each
        raise UnsupportedError(f"{file} is of no format that is read here: {REMEDY}")
    except (OSError, ValueError) as error:
        if isinstance(error, VDIError):
            raise
        why = getattr(error, "strerror", None) or str(error)
        raise InvalidVolumeError(f"{file} cannot be read ({why}): check its path") from error


@contextmanager
def _explained(file: Path, kind: VolumeFormat) -> Iterator[None]:
    """Turn what a library raises and logs into errors and warnings of ours."""
    said: list[logging.LogRecord] = []
    mine = threading.get_ident()

    def passes(record: logging.LogRecord) -> bool:
        own = record.thread == mine and record.levelno >= logging.WARNING
        said.extend([record] * own)
        return not own

    # A filter of this thread's records: handlers are the process's, and its other threads' as well
    loggers = [logging.getLogger(name) for name in ("tifffile", "pydicom")]
    for each in loggers:
        each.addFilter(passes)
    try:
        yield
        if any(record.levelno >= logging.ERROR for record in said):
            raise ValueError(said[0].getMessage())
    except ImportError as error:
        raise MissingDependencyError(
            f"{file} is {kind.name}, read by {kind.library}, which is not installed: install it "
            f'by pip install "pyvista-vdi[{kind.extra}]"'
        ) from error
    except (MemoryError, Warning):  # a warning, where those are errors
        raise
    except Exception as error:  # each library has exceptions of its own
        if isinstance(error, VDIError) and str(file) in str(error):
            raise
        raised = type(error) if isinstance(error, VDIError) else InvalidVolumeError
        why = " ".join(str(error).split())[-500:] or type(error).__name__
        said_of = f"{file} cannot be read as {kind.name} ({why})"
        raise raised(f"{said_of}: is it whole? Write it anew, or {REMEDY}") from error
    finally:
        for each in loggers:
            each.removeFilter(passes)
    for record in said:
        warn_external(f"{kind.name} of {file}: {record.getMessage()}")
