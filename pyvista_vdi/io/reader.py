"""Reads .vdi files, trusting nothing that they say before it is checked."""

from __future__ import annotations

import os
import struct
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from .._version import __version__
from ..camera import Camera, check_window_size
from ..errors import VDIError, VDIFileError
from ..vdi import VDI
from .chunks import CHUNK_ROWS, CODECS, DamagedChunkError, check_chunks, read_chunks
from .description import from_json, number
from .layout import (
    DESCRIPTION,
    FORMAT_NAME,
    FORMAT_VERSION,
    MAX_DESCRIPTION_BYTES,
    Layout,
    layouts,
)

#: The first bytes: a ZIP member's local header, whose name stands at byte 30.
_SIGNATURE = b"PK\x03\x04"
_NAME_AT = 30

#: What zipfile raises, beside its own error, for archives that are not well formed.
_ARCHIVE_ERRORS = (
    zipfile.BadZipFile,
    EOFError,
    NotImplementedError,
    OSError,
    OverflowError,
    RuntimeError,
    ValueError,
    struct.error,
)

_REMEDY = "copy it from its source again, or generate the VDI anew"


@dataclass(frozen=True)
class FileInfo:
    """What a .vdi file says about itself, without its arrays.

    Parameters
    ----------
    path : pathlib.Path
        The file.
    format_version : int
        Version of the format.
    written_by : str
        Program and version.
    camera : Camera
        The generating view V_O.
    window_size : (int, int)
        Lists along each edge of the viewport.
    n_supersegments : int
        Supersegments in all lists.
    bounds : tuple of float
        Axis-aligned bounds in the model frame.
    depth_origin : float
        World units, added to every front and back.
    metadata : dict
        What made the VDI.
    codec : str
        How the arrays are compressed: ``"zstd"``, ``"lz4"`` or ``"none"``.
    file_bytes : int
        Size of the file.
    memory_bytes : int
        Size of the VDI's arrays in memory.
    """

    path: Path
    format_version: int
    written_by: str
    camera: Camera
    window_size: tuple[int, int]
    n_supersegments: int
    bounds: tuple[float, ...]
    depth_origin: float
    metadata: dict[str, Any]
    codec: str
    file_bytes: int
    memory_bytes: int


def read(path: str | os.PathLike[str]) -> VDI:
    """Read a VDI from a file.

    Parameters
    ----------
    path : path-like
        A .vdi file.

    Returns
    -------
    VDI
        The same to the last bit as was written.

    Raises
    ------
    VDIFileError
        If the file is absent, foreign, of a newer version, truncated or damaged; the message
        says which and what can be done.
    """
    with _OpenFile(path) as file:
        return file.vdi()


def read_info(path: str | os.PathLike[str]) -> FileInfo:
    """Read what a file says about itself; the arrays are not touched.

    Parameters
    ----------
    path : path-like
        A .vdi file.

    Returns
    -------
    FileInfo
        View, size, metadata.

    Raises
    ------
    VDIFileError
        As for :func:`read`, except that damaged arrays are not noticed.
    """
    with _OpenFile(path) as file:
        return file.info


class _OpenFile:
    """A .vdi file whose description has been read and checked."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        try:
            self._path = Path(path)
            self._stream = self._path.open("rb")
        except (OSError, ValueError, TypeError) as error:
            raise VDIFileError(
                f"{path!s} cannot be read: {getattr(error, 'strerror', None) or error}"
            ) from error
        try:
            self._archive = self._opened_archive()
            self._description = self._read_description()
            self.info = self._checked_info()
            self._layouts = self._checked_layouts()
        except OSError as error:
            self._stream.close()
            raise VDIFileError(f"{path!s} cannot be read: {error.strerror}") from error
        except BaseException:
            self._stream.close()
            raise

    def __enter__(self) -> _OpenFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._archive.close()
        self._stream.close()

    def vdi(self) -> VDI:
        """Return the VDI with its arrays, all checked."""
        info, offsets = self.info, self._read_offsets()
        front, back = self._read_depth()
        color, optical_depth = self._read_array("color"), self._read_array("optical_depth")
        try:
            return VDI(
                info.camera,
                info.window_size,
                offsets,
                front,
                back,
                color,
                optical_depth,
                info.bounds,
                depth_origin=info.depth_origin,
                metadata=info.metadata,
            )
        except VDIError as error:
            self._refuse(f"it holds no valid VDI: {error}")

    # -- archive and description -----------------------------------------------------------------

    def _opened_archive(self) -> zipfile.ZipFile:
        head = self._stream.read(_NAME_AT + len(DESCRIPTION))
        if not head:
            self._refuse("it is empty")
        # A file cut off within these bytes may still be one of ours
        ours = _SIGNATURE.startswith(head[: len(_SIGNATURE)])
        if not (ours and DESCRIPTION.encode().startswith(head[_NAME_AT:])):
            raise VDIFileError(
                f"{self._path} is not a VDI file: it begins with {head[:8]!r}; "
                "a VDI file is written by VDI.save() or 'pyvista-vdi generate'"
            )
        try:
            archive = zipfile.ZipFile(self._stream)
        except _ARCHIVE_ERRORS as error:
            raise VDIFileError(
                f"{self._path} is truncated: the directory at its end is missing or damaged "
                f"({error}); {_REMEDY}"
            ) from error
        names = archive.namelist()
        if len(set(names)) < len(names):
            self._refuse("two of its members have the same name")
        return archive

    def _read_description(self) -> dict[str, Any]:
        text = self._read_member(DESCRIPTION, MAX_DESCRIPTION_BYTES)
        try:
            description = from_json(text)
        except (ValueError, RecursionError) as error:
            self._refuse(f"its description {DESCRIPTION} is no JSON ({error})")
        if not isinstance(description, dict) or description.get("format") != FORMAT_NAME:
            raise VDIFileError(
                f"{self._path} is not a VDI file: {DESCRIPTION} does not name the format "
                f"{FORMAT_NAME!r}"
            )
        version = description.get("version")
        if isinstance(version, bool) or not isinstance(version, int) or version < 1:
            self._refuse(f"its format version is {version!r}")
        if version > FORMAT_VERSION:
            raise VDIFileError(
                f"{self._path} is of format version {version}, written by "
                f"{description.get('written_by', 'a newer program')!r}; this is pyvista-vdi "
                f"{__version__}, which reads up to version {FORMAT_VERSION}: "
                "upgrade by pip install -U pyvista-vdi"
            )
        return description

    def _checked_info(self) -> FileInfo:
        d = self._description
        try:
            window_size = check_window_size(d["window_size"])
            n = d["n_supersegments"]
            if isinstance(n, bool) or not isinstance(n, int) or not 0 <= n < 1 << 48:
                self._refuse(f"n_supersegments is {n!r}")
            if not isinstance(d["metadata"], dict) or not isinstance(d["codec"], str):
                self._refuse("its metadata or codec are of the wrong kind")
            if d["codec"] not in (*CODECS, "none"):
                self._refuse(f"its codec {d['codec']!r} is unknown")
            if d["chunk_rows"] != CHUNK_ROWS:
                self._refuse(f"chunk_rows is {d['chunk_rows']!r}, not {CHUNK_ROWS}")
            n_lists = window_size[0] * window_size[1]
            return FileInfo(
                path=self._path,
                format_version=d["version"],
                written_by=str(d.get("written_by", "")),
                camera=Camera.from_dict(d["camera"]),
                window_size=window_size,
                n_supersegments=n,
                bounds=tuple(number(b) for b in d["bounds"]),
                depth_origin=number(d["depth_origin"]),
                metadata=d["metadata"],
                codec=d["codec"],
                file_bytes=os.fstat(self._stream.fileno()).st_size,
                memory_bytes=(n_lists + 1) * 8 + n * 24,
            )
        except VDIFileError:
            raise
        except (VDIError, KeyError, TypeError, ValueError, OverflowError) as error:
            self._refuse(f"its description is incomplete or wrong: {error!r}")

    def _checked_layouts(self) -> dict[str, Layout]:
        """Return the arrays' layouts, which must be what window and length imply."""
        info, arrays = self.info, self._description.get("arrays")
        if not isinstance(arrays, dict):
            self._refuse("it does not describe its arrays")
        try:
            counts = np.dtype(arrays["counts"]["dtype"])
        except (TypeError, KeyError, ValueError):
            self._refuse("it does not describe its arrays")
        if counts.str not in ("|u1", "<u2", "<u4", "<u8"):
            self._refuse(f"counts of type {counts} are unknown")
        wanted = layouts(
            info.window_size, info.n_supersegments, counts, filtered=info.codec != "none"
        )
        for name, layout in wanted.items():
            if arrays.get(name) != layout.to_dict():
                self._refuse(
                    f"array {name!r} is described as {arrays.get(name)}, but "
                    f"{info.window_size[0]} x {info.window_size[1]} lists of "
                    f"{info.n_supersegments} supersegments need {layout.to_dict()}"
                )
        return wanted

    # -- arrays ----------------------------------------------------------------------------------

    def _read_offsets(self) -> NDArray[np.uint64]:
        n, stored = self.info.n_supersegments, self._read_array("counts")
        # No count above n, and no sum beyond float64's whole numbers: the sum below cannot wrap
        if int(stored.max(initial=0)) > n or float(stored.sum(dtype=np.float64)) != n:
            self._refuse(f"its lists do not hold {n} supersegments")
        offsets = np.zeros(len(stored) + 1, np.uint64)
        np.cumsum(stored, out=offsets[1:])
        return offsets

    def _read_depth(self) -> tuple[NDArray[Any], NDArray[Any]]:
        layout = self._layouts["depth"]
        front, back = (np.empty(layout.n_rows, np.float32) for _ in range(2))

        def split(stored: NDArray[Any], first: int, last: int) -> None:
            rows = stored[first:last]
            if layout.filter == "difference":
                bits = np.cumsum(rows.reshape(-1), dtype=np.uint32)
                rows = bits.view(np.float32).reshape(-1, 2)
            front[first:last] = rows[:, 0]
            back[first:last] = rows[:, 1]

        self._read_array("depth", split)
        return front, back

    def _read_array(
        self, name: str, finish: Callable[[NDArray[Any], int, int], None] | None = None
    ) -> NDArray[Any]:
        """Return an array as it is stored, its chunks checked before it is allocated."""
        layout, codec = self._layouts[name], self.info.codec
        data = self._read_member(name, self.info.file_bytes)
        try:
            check_chunks(data, layout.n_rows, layout.row_bytes, codec)
            stored = np.empty((layout.n_rows, *layout.row_shape), layout.dtype)
            read_chunks(data, codec, stored, None if finish is None else partial(finish, stored))
        except DamagedChunkError as error:
            self._refuse(f"array {name!r}: {error}")
        return stored

    def _read_member(self, name: str, limit: int) -> bytes:
        """Return a stored member whole; ZIP's checksum is compared on the way."""
        try:
            member = self._archive.getinfo(name)
        except KeyError:
            self._refuse(f"its member {name!r} is missing")
        if member.compress_type != zipfile.ZIP_STORED or member.flag_bits & 0x1:
            self._refuse(f"its member {name!r} is not stored plainly")
        if member.file_size != member.compress_size or member.file_size > limit:
            self._refuse(f"its member {name!r} declares {member.file_size} bytes")
        try:
            data = self._archive.read(member)
        except _ARCHIVE_ERRORS as error:
            self._refuse(f"its member {name!r}: {error}")
        if len(data) != member.file_size:
            self._refuse(f"its member {name!r} ends after {len(data)} bytes")
        return data

    def _refuse(self, why: str) -> NoReturn:
        raise VDIFileError(f"{self._path} is damaged: {why}; {_REMEDY}")
