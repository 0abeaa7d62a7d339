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
    """
    target, temporary, stream = _begun(path)
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
            why = error.strerror or error
            raise VDIFileError(f"{target} could not be written: {why}") from error
        raise


def check_writable(path: str | os.PathLike[str]) -> Path:
    """Return a target, links followed; VDIFileError now if it could not be written later."""
    target, temporary, stream = _begun(path)
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


def _begun(path: str | os.PathLike[str]) -> tuple[Path, Path, BinaryIO]:
    """Return a target, links followed, and a new file in its folder: moving it is one step."""
    try:
        target = Path(os.path.realpath(path))
        if target.exists() and not target.is_file():
            raise OSError(0, "it is a folder, or not a regular file")
        if not target.parent.is_dir():
            raise OSError(0, f"the folder {target.parent} does not exist (create it)")
        # Shortened: the temporary name may not be longer than the folder's file system allows
        temporary = target.with_name(f".{target.name[:100]}.{secrets.token_hex(6)}.tmp")
        return target, temporary, temporary.open("x+b")
    except (OSError, ValueError) as error:  # a name that holds a null character, say
        why = f"{getattr(error, 'strerror', None) or error}; choose another path"
        raise VDIFileError(f"{os.fspath(path)} cannot be written: {why}") from error
