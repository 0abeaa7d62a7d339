"""One door to volumes in files: what a file holds, and the one that is asked for."""

from __future__ import annotations

import logging
import os
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TypeAlias

from pyvista_vdi import registry
from pyvista_vdi.errors import (
    InvalidArgumentError,
    InvalidVolumeError,
    MissingDependencyError,
    UnsupportedError,
    VDIError,
    warn_external,
)
from pyvista_vdi.io.stores import is_store, open_store
from pyvista_vdi.io.time_steps import listed_steps, lists_steps
from pyvista_vdi.io.volumes import pictures, table
from pyvista_vdi.io.volumes.in_file import VolumeInFile, placed, volume_of
from pyvista_vdi.io.volumes.table import VolumeFormat
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.model.whole_file import as_path

#: Libraries that write to the terminal by ``logging``.
_LOGGERS = ("tifffile", "pydicom", "nibabel.global", "nibabel", "mrcfile", "astropy", "h5netcdf")

#: Says what a file holds.
Adapter: TypeAlias = Callable[[Path], list[VolumeInFile]]

_PICTURES = VolumeFormat("a folder of pictures", (), "pictures", bool, "scikit-image", ("skimage",))


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

    The format is known by the content, and then by the name. Coordinates are the file's own:
    those of NIfTI grow to the right, the front and the head, those of DICOM and of most MetaImages
    to the left, the back and the head. A store is opened, not read: see :func:`open_volume`.

    Parameters
    ----------
    path : path-like
        Any file of the table in ``docs/files.md``; ``"x.h5::/path"`` is an array in a store.
    array, series : int or str, optional
        Which one, by its number or its name, where a file holds several. DICOM and TIFF have
        series, other formats arrays.
    channel : int or str, optional
        Which channel, by its number or its name, where there are several.
    time : int, optional
        Which time step, where there are several.
    level : int or "auto", optional
        Level of a multi-scale image; 0, the finest, by default.
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

    See Also
    --------
    list_volumes : what there is in a file.
    """
    file = Path(as_path(path))
    if lists_steps(file):
        steps = listed_steps(file)
        if len(steps) > 1:
            raise InvalidVolumeError(
                f"{file} lists {len(steps)} time steps, and one volume is asked for: name the file "
                f"of one, such as {steps[0][0]}, or make a series of all (pyvista-vdi series)"
            )
        file = steps[0][0]
    choices = {"array": array, "series": series}
    if is_store(path) or _is_hdf5(file):
        inner = f"::{array}" if isinstance(array, str) else ""
        store = open_store(
            f"{os.fspath(path)}{inner}",
            level="auto" if level is None else level,
            channel=0 if channel is None else channel,
            time=0 if time is None else time,
        )
        return placed(store, spacing, origin)
    if (own := _own_reader(file)) is not None:
        return own
    kind = _format(file)
    volumes_in = _adapter(file, kind)
    with _listening(file, kind):
        found = _found(file, kind, volumes_in)
        if level not in (None, "auto", 0) and level not in {each.level for each in found}:
            raise InvalidArgumentError(f"{file} has no level {level!r}")
        found = [each for each in found if each.level == (level if isinstance(level, int) else 0)]
        one = _one(file, kind, found, choices)
        return volume_of(one, file, channel, time, spacing, origin)


def list_volumes(path: str | os.PathLike[str]) -> list[VolumeInFile]:
    """Return what volumes a file holds; no voxel is read.

    Parameters
    ----------
    path : path-like
        As for :func:`read_volume`.

    Returns
    -------
    list of VolumeInFile
        Their ``name``, ``dimensions``, ``dtype``, ``spacing``, ``unit``, ``channels`` and
        ``level``; ``str()`` of one is a line for people.

    Raises
    ------
    InvalidVolumeError, UnsupportedError, MissingDependencyError
        As for :func:`read_volume`.
    """
    file = Path(as_path(path))
    if is_store(path) and "::" not in str(path) and not file.is_file():
        store = open_store(path).store
        return [
            VolumeInFile(
                level.array,
                "".join(axis[:1] for axis in store.axes),
                level.grid.index_to_model,
                level.path,
                store.unit,
                store.channels,
                number,
            )
            for number, level in enumerate(store.levels)
        ]
    kind = _format(file)
    volumes_in = _adapter(file, kind)
    with _listening(file, kind):
        return _found(file, kind, volumes_in)


def needs_pyvista(file: Path) -> bool:
    """Whether a file, no folder, is read by PyVista: by its content, or else by its name."""
    if os.path.isdir(file):  # noqa: PTH112 - pathlib's raises for a name that is too long
        return False
    try:
        return table.format_of(file) is table.VTK
    except UnsupportedError:
        return False
    except (OSError, ValueError):
        name = file.name.lower()
        return not any(name.endswith(each.suffixes) for each in table.FORMATS)


def _own_reader(file: Path) -> Volume | None:
    """Return what an extension's reader makes of a file of its name; None where there is none."""
    read = registry.reader(file.suffix.lower()) if file.suffix else None
    return None if read is None else read(file)


def _is_hdf5(file: Path) -> bool:
    try:
        return file.is_file() and table.format_of(file).name == "HDF5"
    except (OSError, ValueError):  # of a name that is none, or of no format
        return False


def _format(file: Path) -> VolumeFormat:
    """Return a file's or a folder's format; what cannot be opened is refused."""
    try:
        if os.path.isdir(file):  # noqa: PTH112
            return _PICTURES if pictures.slices_in(file) else _named("DICOM")
        if not os.path.exists(file):  # noqa: PTH110 - pathlib's raises for a name that is too long
            raise InvalidVolumeError(
                f"{file} does not exist: check the volume's path, or name a shipped volume by "
                "--example (pyvista_vdi.examples)"
            )
        if not file.is_file():
            raise InvalidVolumeError(f"{file} is neither a file nor a folder")
        if not file.stat().st_size:
            raise InvalidVolumeError(f"{file} cannot be read as a volume: it is empty")
        return table.format_of(file)
    except (OSError, ValueError) as error:
        if isinstance(error, VDIError):
            raise
        why = getattr(error, "strerror", None) or error
        raise InvalidVolumeError(
            f"{file} cannot be read ({why}): check the volume's path"
        ) from error


def _named(name: str) -> VolumeFormat:
    return next(each for each in table.FORMATS if each.name == name)


def _adapter(file: Path, kind: VolumeFormat) -> Adapter:
    """Return the function that finds the volumes in a file of a format; imports its library."""
    if kind is table.VTK:
        return registry.reader("")  # type: ignore[no-any-return]
    for name in kind.needs:
        try:
            import_module(name)
        except ImportError as error:
            extra = f'pip install "pyvista-vdi[{kind.extra}]"' if kind.extra else name
            raise MissingDependencyError(
                f"{file} is {kind.name}, read by {name}, which is not installed: install it "
                f"by {extra}"
            ) from error
    return import_module(f"{__package__}.{kind.adapter}").volumes_in  # type: ignore[no-any-return]


def _found(file: Path, kind: VolumeFormat, volumes_in: Adapter) -> list[VolumeInFile]:
    """Return the volumes that an adapter finds in a file: at least one."""
    found = volumes_in(file)
    if not found:
        raise InvalidVolumeError(f"{file} ({kind.name}) holds nothing of three axes")
    return found


def _one(
    file: Path, kind: VolumeFormat, found: list[VolumeInFile], choices: dict[str, int | str | None]
) -> VolumeInFile:
    """Return the volume that is asked for, or the only one."""
    listed = "; ".join(f"{i}: {each}" for i, each in enumerate(found[:20]))
    asked = choices.pop(kind.told_apart)
    for name, other in choices.items():
        if other is not None:
            raise InvalidArgumentError(
                f"{kind.name} holds {kind.told_apart}, and {name}={other!r} was asked for: "
                f"{file} holds {listed}"
            )
    if asked is None:
        meant = [each for each in found if each.meant] or found
        if len(meant) > 1:
            raise UnsupportedError(
                f"{file} holds {len(found)} volumes, {listed}: choose one by {kind.told_apart}=, "
                "its number or its name"
            )
        return meant[0]
    if isinstance(asked, int) and not isinstance(asked, bool) and 0 <= asked < len(found):
        return found[asked]
    for each in found:
        if (each.name or "values") == asked:
            return each
    raise InvalidArgumentError(f"{file} has no {kind.told_apart} {asked!r}: it holds {listed}")


@contextmanager
def _listening(file: Path, kind: VolumeFormat) -> Iterator[None]:
    """Turn what a library raises and logs into errors and warnings of ours."""
    said: list[logging.LogRecord] = []
    mine = threading.get_ident()

    def passes(record: logging.LogRecord) -> bool:
        if record.thread != mine or record.levelno < logging.WARNING:
            return True
        said.append(record)
        return False

    # A filter of this thread's records: handlers are the process's, and its other threads' as well
    # astropy cannot be imported where another made its logger
    names = [name for name in _LOGGERS if name.partition(".")[0] in sys.modules]
    loggers = [logging.root, *map(logging.getLogger, names)]
    for each in loggers:
        each.addFilter(passes)
    try:
        yield
    except VDIError as error:
        text = str(error)
        if str(file) in text or isinstance(error, MissingDependencyError):
            raise
        raise type(error)(f"{file} cannot be read as {kind.name}: {text}") from error
    except (MemoryError, Warning):  # a warning, where those are errors
        raise
    except Exception as error:  # each library has exceptions of its own
        why = " ".join(str(error).split())[:500] or type(error).__name__
        raise InvalidVolumeError(
            f"{file} cannot be read as {kind.name} ({why}): is it whole? Write it anew, or "
            "convert it to NRRD, NIfTI or VTI"
        ) from error
    finally:
        for each in loggers:
            each.removeFilter(passes)
    for record in said:
        if record.levelno >= logging.ERROR:
            raise InvalidVolumeError(
                f"{file} cannot be read as {kind.name} ({record.getMessage()}): is it whole?"
            )
    for record in said:
        warn_external(f"{kind.name} of {file}: {record.getMessage()}")
