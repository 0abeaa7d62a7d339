"""A file's format follows from its name: ``.vdi``, ``.exr``, ``.html`` or, by VTK, ``.vti``."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError, MissingDependencyError, VDIFileError
from pyvista_vdi.io.progress import Pieces, Progress
from pyvista_vdi.io.vdi_file import layout, reader, writer
from pyvista_vdi.io.vdi_file.chunks import CODECS, check_level
from pyvista_vdi.io.vdi_file.layout import DEFLATE
from pyvista_vdi.io.vdi_file.reader import FileInfo
from pyvista_vdi.io.whole_file import check_writable, with_suffix
from pyvista_vdi.model.packing import check_precision
from pyvista_vdi.model.providers import provider
from pyvista_vdi.model.vdi import VDI

#: What the name of a file may end in; the first is our own format.
EXR_SUFFIX = ".exr"
VTI_SUFFIX = ".vti"
HTML_SUFFIX = ".html"
SUFFIXES = (layout.SUFFIX, EXR_SUFFIX, VTI_SUFFIX, HTML_SUFFIX)

_VTI_COMPRESSIONS = ("lz4", "zlib", "lzma", "none")


def write(
    vdi: VDI,
    path: str | os.PathLike[str],
    *,
    progress: Progress | None = None,
    **options: Any,
) -> Path:
    """Write a VDI to a file: ``.vdi``, an OpenEXR deep image, VTK's image, or a page with a viewer.

    The file appears whole or not at all: it is written under a temporary name in the same folder
    and moved into place, and what was there before stays until then.

    Parameters
    ----------
    vdi : VDI
        What to write.
    path : path-like
        The target; its name ends in ``.vdi``, ``.exr``, ``.vti`` or ``.html``.
    progress : callable, optional
        Called with the finished fraction, 0 to 1; when it returns False, nothing is written. VTK
        does not say how far it is: of ``.vti`` with 1 alone.
    **options
        ``compression`` and ``level`` for all; ``precision`` for ``.vdi`` and ``.html``, there
        ``title`` and ``background`` as well; ``exact`` and ``linear`` for ``.exr``. See
        :func:`pyvista_vdi.io.vdi_file.writer.write`,
        :func:`pyvista_vdi.extensions.deep_exr.files.write`,
        :func:`pyvista_vdi.vtk_pipeline.filters.vti.write` and
        :func:`pyvista_vdi.extensions.web.page.page`.

    Returns
    -------
    pathlib.Path
        The file, links followed.

    Raises
    ------
    VDIFileError
        If the target cannot be written, or the metadata hold what JSON cannot.
    InvalidArgumentError
        If an option is unknown or out of its range.
    Cancelled
        If ``progress`` returned False.
    MissingDependencyError
        If VTK is not installed and the name ends in ``.vti``.

    See Also
    --------
    read : reads it again.
    """
    target = checked_target(path)
    check_write_options(target, options)
    if options.get("level", 0) is None:  # as where it is not given
        del options["level"]
    if _is_exr(target):
        return provider("exr_files").write(vdi, target, progress=progress, **options)  # type: ignore[no-any-return]
    if _is_vti(target):
        written: Path = _vti().write(vdi, target, **options)
        Pieces(progress, 1)()
        return written
    if _is_html(target):
        return provider("html_files").write(vdi, target, progress=progress, **options)  # type: ignore[no-any-return]
    return writer.write(vdi, target, progress=progress, **options)


def read(path: str | os.PathLike[str], *, progress: Progress | None = None, **options: Any) -> VDI:
    """Read a VDI from a ``.vdi`` file, an OpenEXR deep image, VTK's image file or a page.

    Parameters
    ----------
    path : path-like
        The file; a name that ends in ``.exr`` makes it an OpenEXR file, ``.vti`` one of VTK,
        ``.html`` a page.
    progress : callable, optional
        As for :func:`write`.
    **options
        ``camera``, ``thickness`` and ``linear`` for ``.exr``: see
        :func:`pyvista_vdi.extensions.deep_exr.files.read`.

    Returns
    -------
    VDI
        The same to the last bit as was written by :func:`write`.

    Raises
    ------
    VDIFileError
        If the file is absent, foreign, of a newer version, truncated or damaged; the message
        says which and what can be done.
    InvalidArgumentError
        If an option is unknown.
    Cancelled
        If ``progress`` returned False.
    MissingDependencyError
        If VTK is not installed and the name ends in ``.vti``.
    """
    if _is_exr(path):
        _check_names("read", path, options, ("camera", "thickness", "linear"))
        return provider("exr_files").read(path, progress=progress, **options)  # type: ignore[no-any-return]
    _check_names("read", path, options, ())
    if _is_vti(path):
        vdi: VDI = _vti().read(path)
        Pieces(progress, 1)()
        return vdi
    if _is_html(path):
        return provider("html_files").read(path, progress=progress)  # type: ignore[no-any-return]
    return reader.read(path, progress=progress)


def read_info(path: str | os.PathLike[str]) -> FileInfo:
    """Read what a file says about itself; the arrays of a ``.vdi`` file are not touched.

    Parameters
    ----------
    path : path-like
        A ``.vdi``, ``.exr``, ``.vti`` or ``.html`` file.

    Returns
    -------
    FileInfo
        View, size, metadata.

    Raises
    ------
    VDIFileError
        As for :func:`read`, except that damaged arrays of a ``.vdi`` file are not noticed.
    """
    if _is_vti(path):
        return _vti().read_info(path)  # type: ignore[no-any-return]
    if _is_html(path):
        return provider("html_files").read_info(path)  # type: ignore[no-any-return]
    if _is_exr(path):
        return provider("exr_files").read_info(path)  # type: ignore[no-any-return]
    return reader.read_info(path)


def is_vdi_file(path: str | os.PathLike[str]) -> bool:
    """Whether a file is to be read as a VDI: by its name, or else by its content.

    Parameters
    ----------
    path : path-like
        A file, or a folder; it need not exist.

    Returns
    -------
    bool
        For ``.vti``, whether a VDI is in it; for unknown names, whether it begins as ours.

    Raises
    ------
    MissingDependencyError
        If VTK is not installed and the name ends in ``.vti``.
    """
    if _is_vti(path):
        return _vti().holds_vdi(path)  # type: ignore[no-any-return]
    if Path(path).suffix.lower() in SUFFIXES:
        return True
    return os.path.isfile(path) and reader.begins_as_vdi(path)  # noqa: PTH113 - too long a name, too


def checked_target(path: str | os.PathLike[str]) -> Path:
    """Raise now if a VDI could not be written there later; nothing is left behind.

    Parameters
    ----------
    path : path-like
        The target; its name ends in one of :data:`SUFFIXES`.

    Returns
    -------
    pathlib.Path
        The target, links followed.

    Raises
    ------
    VDIFileError
        If the name ends in something else, or the target cannot be written.
    """
    try:
        target = Path(path)
    except TypeError as error:
        raise VDIFileError(f"a file's name is a path; got {type(path).__name__}") from error
    return check_writable(with_suffix(target, SUFFIXES, "a VDI"))


def check_write_options(path: str | os.PathLike[str], options: Mapping[str, Any]) -> None:
    """Raise InvalidArgumentError now if :func:`write` would refuse an option for this file."""
    names: tuple[str, ...] = ("compression", "level")
    compressions: tuple[str, ...] = (*CODECS, "none")
    if _is_exr(path):
        names, compressions = (*names, "exact", "linear"), provider("exr_files").COMPRESSIONS
    elif _is_vti(path):
        compressions = _VTI_COMPRESSIONS
    elif _is_html(path):
        names, compressions = (*names, "precision", "title", "background"), (DEFLATE,)
    else:
        names = (*names, "precision")
    _check_names("written", path, options, names)
    compression, level = options.get("compression", compressions[0]), options.get("level")
    if not isinstance(compression, str) or compression not in compressions:
        known = f"one of {', '.join(compressions[:-1])} and " if compressions[1:] else ""
        raise InvalidArgumentError(
            f"compression of {path} must be {known}{compressions[-1]}; got {compression!r}"
        )
    check_level(level)
    if options.get("precision") is not None:
        check_precision(options["precision"])


def _is_exr(path: Any) -> bool:
    return str(path).lower().endswith(EXR_SUFFIX)


def _is_vti(path: Any) -> bool:
    return str(path).lower().endswith(VTI_SUFFIX)


def _is_html(path: Any) -> bool:
    return str(path).lower().endswith(HTML_SUFFIX)


def _vti() -> Any:
    """Return the module that has VTK write and read."""
    try:
        return provider("vti_files")
    except ImportError as error:
        raise MissingDependencyError(
            f".vti files need VTK, which cannot be loaded ({error}): install it by "
            'pip install "pyvista-vdi[plot]", or use .vdi files'
        ) from error


def _check_names(what: str, path: Any, options: Mapping[str, Any], known: tuple[str, ...]) -> None:
    unknown = sorted(set(options) - set(known))
    if unknown:
        raise InvalidArgumentError(
            f"{path} is {what} with the options {', '.join(known) or 'none'}; "
            f"got {', '.join(unknown)}"
        )
