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


@cache
def user_cache() -> Path | None:
    """Return a folder that can be written: the user's cache, else one among temporary files.

    Services and containers often run without a home. That another folder is used, or none, goes
    to the log, once. One that others can write into is not used.
    """
    try:
        return writable_cache("pyvista-vdi")
    except OSError as error:
        why, kept = error, None
    with contextlib.suppress(OSError, AttributeError):  # other systems have no os.getuid
        folder = Path(tempfile.gettempdir()) / f"pyvista-vdi-{os.getuid()}"
        folder.mkdir(mode=0o700, exist_ok=True)
        state = folder.lstat()
        own = stat.S_ISDIR(state.st_mode) and state.st_uid == os.getuid()
        kept = folder if own and not state.st_mode & 0o022 else None
    _logger.warning(
        "the user's cache folder cannot be written (%s): compiled kernels are kept %s; set "
        "XDG_CACHE_HOME to a folder that can be",
        why,
        f"in {kept}" if kept else "nowhere, and made anew in each process",
    )
    return kept


def writable_cache(name: str, author: str | None = None) -> Path:
    """Return the user's cache folder of a program, which is made if it is not there.

    Raises OSError if files cannot be made in it.
    """
    try:
        folder = Path(platformdirs.user_cache_dir(name, author or False))
    except RuntimeError as error:  # there is no home, and the system does not know the user
        raise OSError(str(error)) from error
    folder.mkdir(parents=True, exist_ok=True)
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(f"{folder} is write-protected")
    return folder
