"""The folder in which this package keeps what it would otherwise make anew in each process."""

import atexit
import contextlib
import logging
import os
import shutil
import tempfile
from functools import cache
from pathlib import Path

import platformdirs

_logger = logging.getLogger(__name__)


@cache
def user_cache() -> Path | None:
    """Return the user's cache folder; where it cannot be written a temporary one, if it can be.

    Services and containers often run without a home. That goes to the log, once.
    """
    try:
        return writable_cache("pyvista-vdi")
    except OSError as error:
        _logger.warning(
            "the user's cache folder cannot be written (%s): kernels are compiled anew in each "
            "process; set XDG_CACHE_HOME to a folder that can be",
            error,
        )
    with contextlib.suppress(OSError):
        folder = Path(tempfile.mkdtemp(prefix="pyvista-vdi-"))
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        return folder
    return None


def writable_cache(name: str, author: str | None = None) -> Path:
    """Return the user's cache folder of a program, made if need be; OSError if it cannot be."""
    try:
        folder = Path(platformdirs.user_cache_dir(name, author or False))
    except RuntimeError as error:  # there is no home, and the system does not know the user
        raise OSError(str(error)) from error
    folder.mkdir(parents=True, exist_ok=True)
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(f"{folder} is write-protected")
    return folder
