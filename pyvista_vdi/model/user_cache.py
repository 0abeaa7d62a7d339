"""The folder in which this package keeps what it would otherwise make anew in each process."""

from __future__ import annotations

import logging
import os
import stat
import tempfile
import threading
from functools import cache
from pathlib import Path

import platformdirs

_logger = logging.getLogger(__name__)
_lock = threading.Lock()


def user_cache() -> Path | None:
    """Return a folder that can be written: the user's cache, else one among temporary files.

    Services and containers often run without a home. That another folder is used, or none, goes
    to the log, once.
    """
    wanted = Path(platformdirs.user_cache_dir("pyvista-vdi", appauthor=False))
    with _lock:  # so that it is said once
        return _found(wanted)


def can_be_written(folder: Path) -> bool:
    """Whether files can be made in a folder, which is made if it is not there."""
    if not folder.is_absolute():  # "~": there is no home
        return False
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)


@cache
def _found(wanted: Path) -> Path | None:
    if can_be_written(wanted):
        return wanted
    found = _temporary()
    _logger.warning(
        "the cache folder %s cannot be written: compiled kernels are kept %s; set HOME or "
        "XDG_CACHE_HOME to a folder that can be",
        wanted,
        f"in {found}" if found else "nowhere, and made anew in each process",
    )
    return found


def _temporary() -> Path | None:
    """Return this user's folder among temporary files, unless somebody else can write there."""
    if not hasattr(os, "getuid"):
        return None
    try:
        folder = Path(tempfile.gettempdir()) / f"pyvista-vdi-{os.getuid()}"
        folder.mkdir(mode=0o700, exist_ok=True)
        state = folder.lstat()
    except OSError:
        return None
    others = state.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    own = stat.S_ISDIR(state.st_mode) and state.st_uid == os.getuid() and not others
    return folder if own and can_be_written(folder) else None
