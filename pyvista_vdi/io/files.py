"""The format of a file follows from its name; which formats there are, the registry says."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

from pyvista_vdi import registry
from pyvista_vdi.errors import InvalidArgumentError, InvalidVDIError
from pyvista_vdi.io.progress import Progress
from pyvista_vdi.io.vdi_file.chunks import check_level
from pyvista_vdi.io.vdi_file.reader import FileInfo, opened_file
from pyvista_vdi.model.checks import one_of
from pyvista_vdi.model.packing import PRECISIONS
from pyvista_vdi.model.vdi import VDI, DeferredVDI
from pyvista_vdi.model.whole_file import as_path, check_writable, with_suffix
from pyvista_vdi.registry import FileFormat


def format_named(path: Any) -> FileFormat | None:
    """Return the format that a file's name stands for; ``None`` if it stands for none."""
    name = str(path).lower().rstrip("/\\")  # as shells complete a folder's
    return next((each for each in registry.formats() if name.endswith(each.suffix)), None)


def format_of(path: Any) -> FileFormat:
    """Return the format in which a file is read: by its name, in a page by what it holds.

    Our own, that of a VDI, if its name stands for none.
    """
    found = format_named(path)
    if found is not None and found.page:
        page = found.load()
        for inside in registry.formats():
            if inside.head and page.begins_with(path, inside.head):
                return inside
    return found or registry.core.formats[0]


def holds(path: Any) -> str | None:
    """Return what a file is read as, ``"VDI"``, ``"series"`` or ``"set"``; ``None``: by no name."""
    return None if format_named(path) is None else format_of(path).holds


def opened(path: str | os.PathLike[str]) -> BinaryIO:
    """Open a file, or the one that a page holds."""
    found = format_named(path)
    if found is not None and found.page:
        stream: BinaryIO = found.load().data_in(path)
        return stream
    return opened_file(path)


def write(
    vdi: VDI | DeferredVDI,
    path: str | os.PathLike[str],
    *,
    progress: Progress | None = None,
    **options: Any,
) -> Path:
    """Write a VDI to a file, whole or not at all, and return that: see :meth:`VDI.save`.

    ``progress`` is called with the finished fraction; when it returns False, nothing is written.
    ``options`` are those of the format, and of pages the look that a DeferredVDI begins with.
    """
    target = checked_target(path)
    found = format_named(target) or registry.core.formats[0]
    if isinstance(vdi, DeferredVDI) and not found.values:
        raise InvalidVDIError(
            f"{target.suffix} files hold colours, and a DeferredVDI keeps values: write "
            "vdi.classified(cmap=..., opacity=...), or a .vdi file or a page, which keep them"
        )
    if options.get("level", 0) is None:  # as where it is not given
        del options["level"]
    check_write_options(target, options)
    return found.load().write(vdi, target, progress=progress, **options)  # type: ignore[no-any-return]


def read(path: str | os.PathLike[str], *, progress: Progress | None = None, **options: Any) -> Any:
    """Read a VDI, a series or a set, whatever the format of its name holds.

    See :func:`pyvista_vdi.read`, which has the options and the errors.
    """
    found = format_of(path)
    _check_names("read", path, options, found.read_options)
    return found.load().read(path, progress=progress, **options)


def read_info(path: str | os.PathLike[str]) -> FileInfo:
    """Read what a file says about itself: view, size, metadata; of a ``.vdi`` file no array.

    VDIFileError is raised as by :func:`read`, but for damaged arrays.
    """
    return format_of(path).load().read_info(path)  # type: ignore[no-any-return]


def checked_target(path: str | os.PathLike[str]) -> Path:
    """Return a target, links followed; nothing is left behind.

    Raises VDIFileError now if a VDI could not be written there later: its name is
    that of no such format, or it cannot be written; MissingDependencyError if that has no writer.
    """
    target = as_path(path)
    suffixes = tuple(each.suffix for each in registry.formats() if each.holds == "VDI")
    named = format_named(with_suffix(target, suffixes, "a VDI"))
    if named is not None:
        named.load()  # what it needs is missed now
    return check_writable(target)


def check_write_options(path: str | os.PathLike[str], options: Mapping[str, Any]) -> None:
    """Raise InvalidArgumentError now if :func:`write` would refuse an option for this file."""
    found = format_named(path) or registry.core.formats[0]
    compressions = found.compressions
    of_compressed = ("compression", "level", "precision") if compressions else ()
    _check_names("written", path, options, (*of_compressed, *found.write_options))
    compression = options.get("compression", next(iter(compressions), None))
    if compressions:
        one_of(compression, f"compression of {path}", compressions)
    check_level(options.get("level"))
    one_of(options.get("precision"), "precision", PRECISIONS, none=True)


def _check_names(what: str, path: Any, options: Mapping[str, Any], known: tuple[str, ...]) -> None:
    unknown = sorted(set(options) - set(known))
    if unknown:
        raise InvalidArgumentError(
            f"{path} is {what} with the options {', '.join(known) or 'none'}; "
            f"got {', '.join(unknown)}"
        )
