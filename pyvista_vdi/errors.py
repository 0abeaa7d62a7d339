"""Every error and warning of the package; each error is also the builtin that describes it."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = [
    "Cancelled",
    "DataNotFoundError",
    "DeviceError",
    "DeviceMemoryError",
    "InvalidArgumentError",
    "InvalidArgumentTypeError",
    "InvalidCameraError",
    "InvalidVDIError",
    "InvalidVolumeError",
    "InvalidVolumeTypeError",
    "KernelBuildError",
    "MissingDependencyError",
    "NoDeviceError",
    "UnknownArrayError",
    "UnsupportedError",
    "VDIError",
    "VDIFileError",
    "VDIWarning",
]


class VDIError(Exception):
    """Base of all errors that this package raises on purpose.

    A message names the thing, the values and a remedy.
    """


class InvalidVDIError(VDIError, ValueError):
    """Arrays do not make a valid VDI; the message says which element breaks which rule."""


class InvalidVolumeError(VDIError, ValueError):
    """A volume cannot be used: no scalars, too few planes, no finite value, an unknown array."""


class InvalidVolumeTypeError(InvalidVolumeError, TypeError):
    """What was given is no volume, or its scalars are no numbers."""


class UnknownArrayError(InvalidVolumeError, KeyError):
    """A volume has no array of that name; the message lists those that it has."""

    __str__ = Exception.__str__  # KeyError's puts the message in quotes


class InvalidCameraError(VDIError, ValueError):
    """A camera defines no view, for instance because eye and focal point coincide."""


class InvalidArgumentError(VDIError, ValueError):
    """Any other argument is out of its range: a window size, a limit, a tolerance, a name."""


class InvalidArgumentTypeError(InvalidArgumentError, TypeError):
    """An argument is of a type that is not taken: a text for a number, say."""


class UnsupportedError(VDIError, NotImplementedError, TypeError, ValueError):
    """A feature was asked for that cannot be honoured; it is refused by name, never ignored.

    It is a TypeError and a ValueError, too: PyVista refuses such data sets and values by these.
    """


class MissingDependencyError(VDIError, ImportError):
    """An optional or broken dependency is needed; the message says how to install it."""


class DataNotFoundError(VDIError, FileNotFoundError):
    """An example volume's file is not there; the message names the file and the variable."""


class NoDeviceError(VDIError, RuntimeError):
    """No usable OpenCL device, or the one asked for is absent, ambiguous or fails its probe."""


class DeviceMemoryError(VDIError, MemoryError):
    """A buffer does not fit the device, or the driver ran out of memory or resources."""


class DeviceError(VDIError, RuntimeError):
    """The driver failed in any other way while it copied data or ran a kernel."""


class KernelBuildError(VDIError, RuntimeError):
    """A kernel source could not be assembled or compiled.

    Parameters
    ----------
    message : str
        What failed, for which device, with the end of the compiler's log.
    log : str, default: ""
        The compiler's whole log.
    options : str, default: ""
        The build options.
    source : str, default: ""
        The source as the compiler saw it: includes expanded, with ``#line`` marks.

    Attributes
    ----------
    log, options, source : str
        As given.
    """

    def __init__(self, message: str, *, log: str = "", options: str = "", source: str = "") -> None:
        super().__init__(message)
        self.log, self.options, self.source = log, options, source


class VDIFileError(VDIError, ValueError):
    """A file is truncated, foreign, of a newer version, or its target cannot be written."""


class Cancelled(VDIError, RuntimeError):  # noqa: N818 - an outcome that a callback asked for
    """Work was cancelled by a progress callback; nothing was written."""


@contextmanager
def naming(what: str) -> Iterator[None]:
    """Name, in the message of what is wrong with a volume, which of several it is."""
    try:
        yield
    except InvalidVolumeError as error:
        if what in str(error):
            raise
        raise type(error)(f"{what}: {error}") from error


@contextmanager
def needing(what: str) -> Iterator[None]:
    """Raise MissingDependencyError if an import fails, by what it is needed for and a remedy."""
    try:
        yield
    except ImportError as error:
        raise MissingDependencyError(f"{what} ({error})") from error


class VDIWarning(UserWarning):
    """Base of the package's warnings: what was asked for was done, but not quite as asked."""


#: What stands between a line of the user's and a warning: this package, PyVista and VTK, which call
#: it while they read and draw, and the standard library's wrappers of functions.
_BETWEEN = ("pyvista_vdi", "pyvista", "vtkmodules", "cvista", "paraview", "contextlib", "functools")


def warn_external(message: str, category: type[Warning] = VDIWarning) -> None:
    """Warn, pointing at the line outside this package that led to the warning."""
    frame = sys._getframe(1)
    while (frame.f_globals.get("__name__") or "").partition(".")[0] in _BETWEEN and frame.f_back:
        frame = frame.f_back
    # Python 3.12 has skip_file_prefixes for this, and counts no frames of the import system
    warnings.warn_explicit(
        message,
        category,
        frame.f_code.co_filename,
        frame.f_lineno,
        module=frame.f_globals.get("__name__"),
        registry=frame.f_globals.setdefault("__warningregistry__", {}),
    )
