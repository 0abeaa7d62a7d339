"""A file appears whole or not at all: written under a temporary name, then moved into place."""

import contextlib
import os
import secrets
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

from pyvista_vdi.errors import InvalidArgumentTypeError, VDIFileError


@contextlib.contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Open a file for writing that replaces ``path`` only when the block ends well.

    Until then the data are under a temporary name in the same folder; on any failure, an
    interrupt included, they are removed and what was at ``path`` stays as it was.

    ``path``: the target. A symbolic link is followed. Yields: Seekable binary file. Raises
    VDIFileError if the target cannot be written; when the block is entered, or when the disk is
    full.
    """
    target = _resolved_target(path)
    temporary, stream = _open_beside(target)
    try:
        with stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        if target.exists():
            shutil.copymode(target, temporary)
        temporary.replace(target)
    except BaseException as error:
        temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise VDIFileError(f"{target} could not be written: {_reason(error)}") from error
        raise


def check_writable(path: str | os.PathLike[str]) -> Path:
    """Raise now if ``path`` could not be written later; nothing is left behind.

    ``path``: a target to be written after long work. Returns: The target, links followed. Raises
    VDIFileError if its folder is absent or cannot be written, or a folder or device has its name.
    """
    target = _resolved_target(path)
    temporary, stream = _open_beside(target)
    stream.close()
    temporary.unlink()
    return target


def as_path(path: Any) -> Path:
    """Return a path, or raise InvalidArgumentTypeError if it is none."""
    if not isinstance(path, str | os.PathLike):
        raise InvalidArgumentTypeError(
            f"a path is a text or a pathlib.Path; got {type(path).__name__}"
        )
    return Path(path)


def with_suffix(target: Path, suffixes: tuple[str, ...], kind: str) -> Path:
    """Return the target if its name ends in a suffix, and raise VDIFileError otherwise."""
    if target.suffix.lower() not in suffixes:
        raise VDIFileError(
            f"{str(target)!r} cannot be written as {kind}: the name must end in "
            f"{' or '.join(suffixes)}, for instance {(target.stem or 'name') + suffixes[0]!r}"
        )
    return target


def _resolved_target(path: str | os.PathLike[str]) -> Path:
    try:
        target = Path(os.path.realpath(path))
        exists, regular, has_folder = target.exists(), target.is_file(), target.parent.is_dir()
    except (OSError, ValueError) as error:  # a name that is too long, or holds a null character
        raise VDIFileError(f"{os.fspath(path)!r} cannot be written: {_reason(error)}") from error
    if exists and not regular:
        kind = "a folder" if target.is_dir() else "not a regular file"
        raise VDIFileError(f"{target} cannot be written: it is {kind}; choose another name")
    if not has_folder:
        raise VDIFileError(
            f"{target} cannot be written: the folder {target.parent} does not exist; create it"
        )
    return target


def _open_beside(target: Path) -> tuple[Path, BinaryIO]:
    """Create a new file in the target's folder, so that moving it later is one step."""
    # Shortened: the temporary name may not be longer than the folder's file system allows
    temporary = target.with_name(f".{target.name[:100]}.{secrets.token_hex(6)}.tmp")
    try:
        return temporary, temporary.open("x+b")
    except OSError as error:
        raise VDIFileError(
            f"{target} cannot be written: {_reason(error)}; choose another folder"
        ) from error


def _reason(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)
