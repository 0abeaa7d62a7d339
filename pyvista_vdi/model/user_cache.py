"""The folder in which this package keeps what it would otherwise make anew in each process."""

import contextlib
import logging
import os
import stat
import tempfile
from functools import cache
from pathlib import Path

import platformdirs

_logger = logging.getLogger(__name__)


def user_cache() -> Path | None:
    """Return a folder that can be written: the user's cache, else one among temporary files.

    Services and containers often run without a home. That another folder is used, or none, goes
    to the log, once.
    """
    try:
        return writable_cache("pyvista-vdi")
    except OSError as error:
        return _instead(str(error))


def writable_cache(name: str, author: str | None = None) -> Path:
    """Return the user's cache folder of a program, which is made if it is not there.

    Raises OSError if files cannot be made in it.
    """
    try:
        folder = Path(platformdirs.user_cache_dir(name, author or False))
    except RuntimeError as error:  # there is no home, and the system does not know the user
        raise OSError(str(error)) from error
    if not folder.is_absolute():  # likewise, of older versions
        raise OSError(f"there is no home for {folder}")
    folder.mkdir(parents=True, exist_ok=True)
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(f"{folder} is write-protected")
    return folder


@cache
def _instead(why: str) -> Path | None:
    """Return this user's folder among temporary files, unless somebody else can write there."""
    found = None
    with contextlib.suppress(OSError, AttributeError):  # other systems have no os.getuid
        folder = Path(tempfile.gettempdir()) / f"pyvista-vdi-{os.getuid()}"
        folder.mkdir(mode=0o700, exist_ok=True)
        state = folder.lstat()
        own = stat.S_ISDIR(state.st_mode) and state.st_uid == os.getuid()
        found = folder if own and not state.st_mode & (stat.S_IWGRP | stat.S_IWOTH) else None
    _logger.warning(
        "the user's cache folder cannot be written (%s): compiled kernels are kept %s; set "
        "XDG_CACHE_HOME to a folder that can be",
        why,
        f"in {found}" if found else "nowhere, and made anew in each process",
    )
    return found
