"""Reads .vdi files, trusting nothing that they say before it is checked."""

from __future__ import annotations

import math
import os
import struct
import zipfile
import zlib
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from threading import Lock
from typing import Any, BinaryIO, NoReturn

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi._version import __version__
from pyvista_vdi.errors import InvalidVDIError, VDIError, VDIFileError
from pyvista_vdi.io.progress import Pieces, Progress
from pyvista_vdi.io.vdi_file.chunks import CODECS, THREADS, DamagedChunkError, PackedArray
from pyvista_vdi.io.vdi_file.layout import (
    CHUNK_ROWS,
    DEFERRED_NAME,
    DEFLATE,
    DESCRIPTION,
    FORMAT_NAME,
    FORMAT_VERSION,
    INDEX,
    INDEX_DTYPE,
    LEAST_VERSION,
    MAX_DESCRIPTION_BYTES,
    Layout,
    from_json,
    layouts,
    number,
)
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import one_of
from pyvista_vdi.model.host_memory import aligned_empty
from pyvista_vdi.model.packing import (
    DEPTH_CODES,
    GRID,
    LEAST_STEP_EXPONENT,
    PRECISIONS,
    TAU_CODES,
    Arrays,
    Packed8,
    words_of,
)
from pyvista_vdi.model.vdi import VDI, DeferredVDI, made_vdi

#: The first bytes: a ZIP member's local header, whose name stands at byte 30.
_SIGNATURE = b"PK\x03\x04"
_NAME_AT = 30

#: A local header: signature, and at its end the bytes of the name and of extra fields behind it.
_LOCAL_HEADER = struct.Struct("<4s22xHH")

#: What zipfile raises, beside its own error, for archives that are not well formed.
ARCHIVE_ERRORS = (
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

    ``path``: the file. ``format_version``: version of the format. ``written_by``: program and
    version. ``camera``: the generating view V_O. ``window_size``: lists along each edge of the
    viewport. ``n_supersegments``: supersegments in all lists. ``bounds``: axis-aligned bounds in
    the model frame. ``depth_origin``: world units, added to every front and back. ``metadata``:
    what made the VDI. ``codec``: how the arrays are compressed: ``"zstd"``, ``"lz4"``,
    ``"deflate"`` or ``"none"``. ``file_bytes``: size of the file. ``memory_bytes``: size of the
    VDI's arrays in memory. ``precision``: one of :data:`pyvista_vdi.model.packing.PRECISIONS`.
    ``depth_step``: of the 8-byte form: step of its depths, world units. ``deferred``: of a
    :class:`~pyvista_vdi.DeferredVDI`, what is known of its values, else None.
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
    precision: str = "exact"
    depth_step: float = 1.0
    deferred: dict[str, Any] | None = None


def read(
    path: str | os.PathLike[str],
    *,
    progress: Progress | None = None,
    stream: BinaryIO | None = None,
) -> VDI | DeferredVDI:
    """Read a VDI from a .vdi file: see :func:`pyvista_vdi.io.read`.

    ``stream`` holds the file where it lies within another, at ``path``.
    """
    with _OpenFile(path, stream) as file:
        return file.vdi(progress)


def read_info(path: str | os.PathLike[str], *, stream: BinaryIO | None = None) -> FileInfo:
    """Read what a .vdi file says about itself: see :func:`pyvista_vdi.io.read_info`.

    ``stream`` as for :func:`read`.
    """
    with _OpenFile(path, stream) as file:
        return file.info


def opened_file(path: str | os.PathLike[str]) -> BinaryIO:
    """Open a file to be read; VDIFileError says why it cannot be."""
    try:
        return Path(path).open("rb")
    except (OSError, ValueError, TypeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise VDIFileError(f"{path!s} cannot be read: {reason}") from error


class _OpenFile(AbstractContextManager["_OpenFile"]):
    """A .vdi file whose description has been read and checked."""

    def __init__(self, path: str | os.PathLike[str], stream: BinaryIO | None = None) -> None:
        self._stream = opened_file(path) if stream is None else stream
        self._path = Path(path)
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

    def __exit__(self, *_: object) -> None:
        self._archive.close()
        self._stream.close()

    def vdi(self, progress: Progress | None) -> VDI | DeferredVDI:
        """Return the VDI with its arrays, all checked."""
        info = self.info
        try:
            stored = self._decoded(progress)
            # Add up the lists' lengths. Where none is above n, a sum that wraps falls, which no
            # VDI's offsets may
            counts, n, packing = stored.pop("counts"), info.n_supersegments, None
            offsets = np.zeros(len(counts) + 1, np.uint64)
            np.cumsum(counts, out=offsets[1:])
            if int(counts.max(initial=0)) > n or offsets[-1] != n:
                self._refuse(f"its lists do not hold {n} supersegments")
            if info.precision == "8-byte":
                packing = packed_of_stored(info.depth_step, offsets, stored, CHUNK_ROWS)
                arrays = packing.arrays()
            else:
                arrays = Arrays(offsets, *(array.view("<f4") for array in stored.values()))
            about: dict[str, Any] = {"depth_origin": info.depth_origin, "metadata": info.metadata}
            vdi = VDI(info.camera, info.window_size, *arrays, info.bounds, **about)
            if packing is not None:
                vdi = made_vdi(replace(packing, offsets=vdi.offsets), vdi)
            return vdi if info.deferred is None else DeferredVDI(vdi, info.deferred)
        except DamagedChunkError as error:
            self._refuse(str(error))
        except OSError as error:
            raise VDIFileError(f"{self._path} cannot be read: {error.strerror}") from error
        except InvalidVDIError as error:
            self._refuse(f"it holds no valid VDI: {error}")

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
        except ARCHIVE_ERRORS as error:
            raise VDIFileError(
                f"{self._path} is truncated: the directory at its end is missing or damaged "
                f"({error}); {_REMEDY}"
            ) from error
        # Of a file that ends within or behind its coarse level the directory found is that one's
        if archive.infolist() and archive.infolist()[0].header_offset != 0:
            raise VDIFileError(
                f"{self._path} is truncated: the directory at its end is missing; {_REMEDY}"
            )
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
        names = (FORMAT_NAME, DEFERRED_NAME)
        if not isinstance(description, dict) or description.get("format") not in names:
            raise VDIFileError(
                f"{self._path} is not a VDI file: {DESCRIPTION} does not name the format "
                f"{FORMAT_NAME!r}"
            )
        version = description.get("version")
        if isinstance(version, bool) or not isinstance(version, int) or version < 1:
            self._refuse(f"its format version is {version!r}")
        if not LEAST_VERSION <= version <= FORMAT_VERSION:
            raise VDIFileError(
                f"{self._path} is of format version {version}, written by "
                f"{description.get('written_by', 'another program')!r}; this is pyvista-vdi "
                f"{__version__}, which reads versions {LEAST_VERSION} to {FORMAT_VERSION}: upgrade "
                "by pip install -U pyvista-vdi, or generate the VDI anew"
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
            if (d["codec"] == DEFLATE) != (d["version"] >= 4):
                self._refuse(f"version {d['version']} has no codec {d['codec']!r}")
            if d["chunk_rows"] != CHUNK_ROWS:
                self._refuse(f"chunk_rows is {d['chunk_rows']!r}, not {CHUNK_ROWS}")
            n_lists = window_size[0] * window_size[1]
            precision = d["precision"] if d["version"] >= 3 else "exact"
            one_of(precision, "precision", PRECISIONS)
            packed_bytes = {"exact": 0, "8-byte": 8 * n + 6 * n_lists}
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
                file_bytes=self._stream.seek(0, os.SEEK_END),
                memory_bytes=(n_lists + 1) * 8 + n * 24 + packed_bytes[precision],
                precision=precision,
                depth_step=number(d["depth_step"]) if precision == "8-byte" else 1.0,
                deferred=d["deferred"] if d["format"] == DEFERRED_NAME else None,
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
        filtered, version = info.codec != "none", info.format_version
        wanted = layouts(info, counts, filtered=filtered, version=version)
        for name, layout in wanted.items():
            if arrays.get(name) != layout.to_dict():
                self._refuse(
                    f"array {name!r} is described as {arrays.get(name)}, but "
                    f"{info.window_size[0]} x {info.window_size[1]} lists of "
                    f"{info.n_supersegments} supersegments need {layout.to_dict()}"
                )
        return wanted

    def _decoded(self, progress: Progress | None) -> dict[str, NDArray[Any]]:
        """Return the arrays as they were before they were filtered, each where it will stay."""
        packed = self._packed()
        # Where a CPU device uses them in place
        stored = {
            name: aligned_empty((layout.n_rows, *layout.row_shape), layout.dtype)
            for name, layout in self._layouts.items()
        }

        def decode(names: tuple[str, ...], first: int, last: int) -> None:
            for name in names:
                rows = stored[name][first:last]
                packed[name].read(first, rows)
                if packed[name].layout.filter == "channel-difference":
                    blue, green, red = rows.T
                    rows[:] = np.stack([red + blue, green + blue, blue], axis=1)
            if names == faces and packed["back"].layout.filter == "difference":
                # Fronts less the back before them, and backs less their own fronts
                gap, back = (stored[name][first:last] for name in names)
                thickness = back.copy()
                gap += thickness
                np.cumsum(gap, dtype=np.uint32, out=back)
                np.subtract(back, thickness, out=gap)

        # Fronts and backs of an exact VDI follow from each other
        faces = ("front", "back")
        names: list[tuple[str, ...]] = [(name,) for name in stored]
        if self.info.precision == "exact":
            names = [faces, *((name,) for name in stored if name not in faces)]
        tasks = [(each, *rows) for each in names for rows in self._layouts[each[0]].ranges()]
        done = Pieces(progress, len(tasks))
        with ThreadPoolExecutor(THREADS) as pool:
            for _ in pool.map(lambda task: decode(*task), tasks):  # raises what went wrong
                done()
        return stored

    def _packed(self) -> dict[str, PackedArray]:
        """Return the arrays as the file holds them, their chunks known and possible."""
        info, packed = self.info, {}
        # Read the index; every chunk is read from the file when it is decoded
        n_chunks = sum(layout.n_chunks for layout in self._layouts.values())
        content = self._read_member(INDEX, info.file_bytes)
        if len(content) != n_chunks * INDEX_DTYPE.itemsize:
            self._refuse(f"its member {INDEX!r} has {len(content)} bytes for {n_chunks} chunks")
        index, lock = np.frombuffer(content, INDEX_DTYPE), Lock()
        for name, layout in self._layouts.items():
            rows, index = index[: layout.n_chunks], index[layout.n_chunks :]
            member = self._member(name, info.file_bytes)
            # Find where its data begin: behind its local header, which must name it
            self._stream.seek(member.header_offset)
            header = self._stream.read(_LOCAL_HEADER.size).ljust(_LOCAL_HEADER.size, b"\0")
            signature, name_bytes, extra_bytes = _LOCAL_HEADER.unpack(header)
            named = self._stream.read(name_bytes)
            if signature != _SIGNATURE or named != member.filename.encode():
                self._refuse(f"its member {member.filename!r} is not where its directory says")
            start = self._stream.tell() + int(extra_bytes)
            fetch = partial(self._fetch, lock, start, rows["crc32"].tolist())
            packed[name] = PackedArray(
                name, layout, info.codec, rows["bytes"], member.file_size, fetch
            )
        return packed

    def _fetch(
        self, lock: Lock, start: int, checksums: list[int], k: int, begin: int, end: int
    ) -> bytes:
        """Return the bytes of a chunk; from any thread."""
        with lock:
            self._stream.seek(start + begin)
            chunk = self._stream.read(end - begin)
        if zlib.crc32(chunk) != checksums[k]:
            raise DamagedChunkError(f"chunk {k} is not what was written: its checksum differs")
        return chunk

    def _member(self, name: str, limit: int) -> zipfile.ZipInfo:
        """Return where a member is, which must be stored plainly and no longer than ``limit``."""
        try:
            member = self._archive.getinfo(name)
        except KeyError:
            self._refuse(f"its member {name!r} is missing")
        if member.compress_type != zipfile.ZIP_STORED or member.flag_bits & 0x1:
            self._refuse(f"its member {name!r} is not stored plainly")
        if member.file_size != member.compress_size or member.file_size > limit:
            self._refuse(f"its member {name!r} declares {member.file_size} bytes")
        return member

    def _read_member(self, name: str, limit: int) -> bytes:
        """Return a member whole; ZIP's checksum is compared on the way."""
        member = self._member(name, limit)
        try:
            data = self._archive.read(member)
        except ARCHIVE_ERRORS as error:
            self._refuse(f"its member {name!r}: {error}")
        if len(data) != member.file_size:
            self._refuse(f"its member {name!r} ends after {len(data)} bytes")
        return data

    def _refuse(self, why: str) -> NoReturn:
        raise VDIFileError(f"{self._path} is damaged: {why}; {_REMEDY}")


def packed_of_stored(
    step: float,
    offsets: NDArray[np.uint64],
    stored: Mapping[str, NDArray[Any]],
    chunk_rows: int,
) -> Packed8:
    """Return the 8-byte form of what a file stores, checked.

    ``step``: of the depth grid. ``stored``: what :func:`stored_rows` gives of every ``chunk_rows``
    rows, by its name. Raises InvalidVDIError if packing gives no such codes.
    """
    if (offsets[1:] < offsets[:-1]).any():
        raise InvalidVDIError("offsets must not decrease")
    counts = np.diff(offsets).astype(np.int64)
    mantissa, exponent = math.frexp(step)
    if not (mantissa == 0.5 and LEAST_STEP_EXPONENT < exponent <= 105):
        raise InvalidVDIError(f"the step of depths must be a power of two; got {step}")
    origins, strides = stored["origin"].astype(np.int64), stored["stride"].astype(np.int64)
    last = origins + strides * DEPTH_CODES
    if (np.abs(origins) > GRID).any() or (last > GRID + DEPTH_CODES + 1).any():
        raise InvalidVDIError("a list's depths lie beyond the VDI's grid")
    occupied = counts > 0
    if ((strides > 0) != occupied).any() or origins[~occupied].any():
        raise InvalidVDIError("the lists with a stride are not those with supersegments")
    # Add up the codes, which begin anew with every list and every chunk
    gaps, thicknesses = stored["front"].astype(np.int64), stored["back"].astype(np.int64)
    n, tau = len(gaps), stored["optical_depth"].astype(np.uint32)
    begins = np.zeros(n, bool)
    begins[offsets[:-1][occupied].astype(np.int64)] = True
    begins[::chunk_rows] = True
    runs, starts = np.cumsum(gaps + thicknesses), np.flatnonzero(begins)
    before = runs[starts] - gaps[starts] - thicknesses[starts]
    back = runs - np.repeat(before, np.diff(np.append(starts, n)))
    if n and not (thicknesses.min() > 0 and back.max() <= DEPTH_CODES and tau.max() <= TAU_CODES):
        raise InvalidVDIError("a supersegment has no thickness, or a code beyond its largest")
    color = np.pad(stored["color"], ((0, 0), (1, 0))).view("<u4").reshape(-1)
    codes = (back - thicknesses, back, tau, color)
    return Packed8(
        step,
        offsets,
        origins.astype(np.int32),
        strides.astype(np.uint16),
        words_of(*(code.astype(np.uint32, copy=False) for code in codes)),
    )
