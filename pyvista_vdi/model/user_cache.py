"""The folder in which this package keeps what it would otherwise make anew in each process."""

import logging
import os
from functools import cache
from pathlib import Path

import platformdirs

_logger = logging.getLogger(__name__)


@cache
def user_cache() -> Path | None:
    """Return the user's cache folder of this package; None where it cannot be written.

    Services and containers often run without a home. The log says so, once.
    """
    try:
        return writable_cache("pyvista-vdi")
    except OSError as error:
        _logger.warning(
            "the user's cache folder cannot be written (%s): kernels are compiled in each process; "
            "set XDG_CACHE_HOME to a folder that can be",
            error,
        )
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
