"""Reads .vdis files, step by step, trusting nothing that they say before it is checked."""

from __future__ import annotations

import logging
import math
import os
import weakref
import zlib
from bisect import bisect_left
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from threading import Lock
from typing import Any, BinaryIO, Generic, NamedTuple, NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi._version import __version__
from pyvista_vdi.errors import (
    Cancelled,
    DeviceError,
    DeviceMemoryError,
    InvalidVDIError,
    KernelBuildError,
    VDIError,
    VDIFileError,
    warn_external,
)
from pyvista_vdi.extensions.series import layout
from pyvista_vdi.extensions.series.codes import ENTRIES, Samples, Tables
from pyvista_vdi.extensions.series.differences import Stepped, decoded
from pyvista_vdi.extensions.series.frames import Frames, found_between, indexed
from pyvista_vdi.extensions.series.on_device import decoded_on, runtime_for_decoding
from pyvista_vdi.io.files import opened
from pyvista_vdi.io.vdi_file import reader as vdi_reader
from pyvista_vdi.io.vdi_file.chunks import CODECS, DamagedChunkError
from pyvista_vdi.io.vdi_file.description import from_json, number
from pyvista_vdi.io.vdi_file.layout import MAX_DESCRIPTION_BYTES
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import as_range
from pyvista_vdi.model.deferred import DeferredVDI, importance_points
from pyvista_vdi.model.packing import check_precision
from pyvista_vdi.model.vdi import VDI

_log = logging.getLogger(__name__)

_REMEDY = "copy it from its source again, or generate the series anew"

#: Decoded steps that are kept: those that others are made from.
_KEPT_STEPS = 3

#: What arrays that contradict each other may raise on their way, beside errors of our own.
_CONTRADICTIONS = (
    ArithmeticError,
    DamagedChunkError,
    IndexError,
    InvalidVDIError,
    KeyError,
    RecursionError,
    TypeError,
    ValueError,
)


@dataclass(frozen=True)
class SeriesInfo:
    """What a .vdis file says about itself."""

    path: Path
    format_version: int
    written_by: str  # program and version
    camera: Camera  # the first step's generating view V_O
    window_size: tuple[int, int]  # the first step's lists along each edge of the viewport
    bounds: tuple[float, ...]  # the first step's, in the model frame
    metadata: dict[str, Any]  # what made the first step
    times: tuple[float, ...]  # of the steps
    step_bytes: tuple[int, ...]  # what each step takes
    keys: tuple[int, ...]  # steps that need no other
    precision: str
    codec: str
    tolerance: float
    closed: bool  # whether the writer came to its end: otherwise it is still at work, or was killed
    file_bytes: int
    deferred: dict[str, Any] | None = None  # of steps that keep values, what the first one knows

    @property
    def value_range(self) -> tuple[float, float] | None:
        """Least and largest value of steps that keep values."""
        return None if self.deferred is None else as_range(self.deferred.get("value_range"))

    @property
    def importance(self) -> tuple[tuple[float, float], ...] | None:
        """Points (value, weight) by which steps that keep values were cut; None: 1 everywhere."""
        ends = self.value_range
        return ends and importance_points((self.deferred or {}).get("importance"), ends)


_Value = TypeVar("_Value")


class _Recent(Generic[_Value]):
    """The values that were used last; from any thread."""

    def __init__(self, most: int) -> None:
        self._most, self._values, self._lock = most, OrderedDict[int, _Value](), Lock()

    def get(self, key: int) -> _Value | None:
        """Return a value, which is the last used then, or None."""
        with self._lock:
            if key in self._values:
                self._values.move_to_end(key)
            return self._values.get(key)

    def put(self, key: int, value: _Value) -> _Value:
        """Remember a value and return it."""
        with self._lock:
            self._values[key] = value
            self._values.move_to_end(key)
            while len(self._values) > self._most:
                self._values.popitem(last=False)
        return value


class _Described(NamedTuple):
    """What a step's description says, checked."""

    camera: Camera
    window_size: tuple[int, int]
    bounds: tuple[float, ...]
    metadata: dict[str, Any]
    depth_origin: float
    deferred: dict[str, Any] | None  # of steps that keep values, what is known of these


class StepsReader(Sequence[VDI]):
    """The steps of a .vdis file: read and decoded when they are asked for, from any thread."""

    _MAGIC, _PART = layout.MAGIC, "step"
    _FOREIGN = (
        "a series of VDIs: it begins with {!r}; such a file is written by VDISeries.save(), "
        "SeriesWriter or 'pyvista-vdi series'"
    )
    _KEPT_VDIS = 4  # that were asked for last
    _LEAST = 1  # parts of a file

    def __init__(self, path: str | os.PathLike[str]) -> None:
        try:
            self._path = Path(path)
            self._stream: BinaryIO = opened(self._path)
            self._pickled_as = self._path.absolute()
            weakref.finalize(self, self._stream.close)
            self._file_bytes = self._stream.seek(0, os.SEEK_END)
        except (OSError, ValueError, TypeError) as error:
            raise VDIFileError(
                f"{path!s} cannot be read: {getattr(error, 'strerror', None) or error}"
            ) from error
        self._lock = Lock()
        self._steps = _Recent[Stepped](_KEPT_STEPS)
        self._vdis = _Recent[VDI](self._KEPT_VDIS)
        self._contents = _Recent[memoryview](1)  # of a frame, while it is looked at
        self._descriptions: dict[int, _Described] = {}
        #: How many steps have been decoded so far.
        self.n_decoded = 0
        try:
            self._head, begin = self._read_head()
            self._codec = str(self._head["codec"])
            frames = indexed(self._bytes_at, begin, self._file_bytes)
            self.closed = frames is not None
            if frames is None:
                frames = found_between(self._bytes_at, begin, self._file_bytes)
                self._say_what_is_lost(frames)
            self._frames = frames
            #: Steps that others are written by; no other one is worth keeping
            self._needed = {header.by for _, header in self._frames}
            if len(self._frames) < self._LEAST:
                raise VDIFileError(
                    f"{self._path} has no finished {self._PART}: it was cut off, or none is "
                    "written yet"
                )
        except BaseException:
            self._stream.close()
            raise

    def __reduce__(self) -> Any:
        return type(self), (self._pickled_as,)

    @property
    def times(self) -> tuple[float, ...]:
        """The steps' times."""
        return tuple(header.time for _, header in self._frames)

    @property
    def camera(self) -> Camera:
        """The first step's."""
        return self._described(0).camera

    @property
    def window_size(self) -> tuple[int, int]:
        """The first step's."""
        return self._described(0).window_size

    @property
    def bounds(self) -> tuple[float, ...]:
        """The first step's."""
        return self._described(0).bounds

    def __len__(self) -> int:
        return len(self._frames)

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [self[i] for i in range(len(self))[index]]
        i = range(len(self))[index]
        known = self._vdis.get(i)
        return self._vdis.put(i, self._decoded(i)) if known is None else known

    def info(self) -> SeriesInfo:
        """Return what the file says about itself, without the steps' arrays."""
        first = self._described(0)
        return SeriesInfo(
            path=self._path,
            format_version=self._version,
            written_by=str(self._head.get("written_by", "")),
            camera=first.camera,
            window_size=first.window_size,
            bounds=first.bounds,
            metadata=first.metadata,
            times=self.times,
            step_bytes=tuple(layout.HEADER_BYTES + h.n_bytes for _, h in self._frames),
            keys=tuple(i for i, (_, h) in enumerate(self._frames) if h.by < 0),
            precision=str(self._head["precision"]),
            codec=self._codec,
            tolerance=float(self._head["tolerance"]),
            closed=self.closed,
            file_bytes=self._file_bytes,
            deferred=first.deferred,
        )

    def _read_head(self) -> tuple[dict[str, Any], int]:
        magic = self._MAGIC
        head = self._bytes_at(0, len(magic) + layout.HEAD.size)
        if not head or not magic.startswith(head[: len(magic)]):
            raise VDIFileError(f"{self._path} is not {self._FOREIGN.format(head[:8])}")
        if len(head) < len(magic) + layout.HEAD.size:
            self._refuse("it ends within its head")
        version, n_text, checksum = layout.HEAD.unpack(head[len(magic) :])
        if version > layout.FORMAT_VERSION:
            raise VDIFileError(
                f"{self._path} is of format version {version}; this is pyvista-vdi {__version__}, "
                f"which reads up to version {layout.FORMAT_VERSION}: "
                "upgrade by pip install -U pyvista-vdi"
            )
        text = self._bytes_at(len(head), n_text if n_text <= MAX_DESCRIPTION_BYTES else 0)
        begun = zlib.crc32(head[len(magic) : -4])
        if version < 1 or len(text) != n_text or zlib.crc32(text, begun) != checksum:
            self._refuse("its head is not what was written")
        self._version = int(version)
        try:
            found = from_json(text)
            check_precision(found["precision"])
            if not 0 <= number(found["tolerance"]) < 1 or found["codec"] not in (*CODECS, "none"):
                self._refuse("its head names what no such file has")
            self._check_head(found)
        except VDIFileError:
            raise
        except (VDIError, KeyError, TypeError, ValueError, RecursionError) as error:
            self._refuse(f"its head is incomplete or wrong: {error!r}")
        return found, len(head) + n_text

    def _check_head(self, found: dict[str, Any]) -> None:
        """Take what else the head says; VDIError, KeyError, TypeError or ValueError if wrong."""

    def _say_what_is_lost(self, frames: Frames) -> None:
        numbers = [header.number for _, header in frames]
        lost = sorted(set(range(numbers[-1] + 1)) - set(numbers)) if numbers else []
        if lost:
            warn_external(
                f"{self._path} is damaged: {self._PART}s {', '.join(map(str, lost))} cannot be "
                f"found, {len(frames)} others are read; {_REMEDY}"
            )

    def _bytes_at(self, place: int, n: int) -> bytes:
        try:
            with self._lock:
                self._stream.seek(place)
                return self._stream.read(n)
        except OSError as error:
            raise VDIFileError(f"{self._path} cannot be read: {error.strerror}") from error

    def _content(self, i: int) -> memoryview:
        known = self._contents.get(i)
        if known is not None:
            return known
        place, header = self._frames[i]
        data = self._bytes_at(place + layout.HEADER_BYTES, header.n_bytes)
        if len(data) != header.n_bytes or zlib.crc32(data) != header.checksum:
            self._refuse(
                f"{self._PART} {header.number} is not what was written: its checksum differs"
            )
        return self._contents.put(i, memoryview(data))

    def _refuse(self, why: str) -> NoReturn:
        raise VDIFileError(f"{self._path} is damaged: {why}; {_REMEDY}")

    def _decoded(self, i: int) -> VDI:
        """Return a step, the steps that it is written by decoded where they are not at hand."""
        header = self._frames[i][1]
        try:
            source = i
            while self._frames[source][1].kind == layout.AGAIN:
                source = self._place_of(self._frames[source][1].by, header.number)
            of = self._described(i)
            if self._frames[source][1].kind == layout.VDI_FILE:
                self.n_decoded += 1
                found: Any = vdi_reader.read(self._path, stream=self._file_in(source))
                if source == i:
                    return found  # type: ignore[no-any-return]
                vdi: VDI = found if of.deferred is None else found.lists
                arrays = (vdi.offsets, vdi.front, vdi.back, vdi.color, vdi.optical_depth)
                again = VDI(
                    *(of.camera, of.window_size, *arrays, of.bounds),
                    depth_origin=of.depth_origin,
                    metadata=of.metadata,
                )
                again.packing = vdi.packing
            else:
                again = VDI._of_packing(
                    of.camera,
                    of.window_size,
                    *self._step(source).packed(),
                    of.bounds,
                    depth_origin=of.depth_origin,
                    metadata=of.metadata,
                )
            if of.deferred is None:
                return again
            return DeferredVDI.of_lists(again, of.deferred)  # type: ignore[return-value]
        except (VDIFileError, Cancelled):
            raise
        except (*_CONTRADICTIONS, VDIError) as error:
            self._refuse(f"{self._PART} {header.number} holds no valid VDI: {error}")

    def _file_in(self, i: int) -> BytesIO:
        """Return the whole .vdi file that a frame holds."""
        return BytesIO(layout.read_arrays(self._content(i), "none")["vdi"].tobytes())

    def _step(self, i: int) -> Stepped:
        """Return a decoded step of lists: the ones that it needs first."""
        needed = [i]
        while (known := self._steps.get(needed[-1])) is None:
            by = self._frames[needed[-1]][1].by
            if by < 0:
                break
            needed.append(self._place_of(by, self._frames[i][1].number))
        if known is not None:
            needed.pop()
        for k in reversed(needed):
            known = self._step_by(k, known)
            if self._frames[k][1].number in self._needed:
                self._steps.put(k, known)
        assert known is not None
        return known

    def _step_by(self, i: int, before: Stepped | None) -> Stepped:
        header, data = self._frames[i][1], self._content(i)
        if header.kind != layout.LISTS:
            raise InvalidVDIError(
                f"{self._PART} {header.number} is none that others are written by"
            )
        text, arrays = layout.read_text(data)[0], layout.read_arrays(data, self._codec)
        window_size = self._described(i).window_size
        if before is None:
            samples, tables = _samples(text["samples"]), _tables(arrays)
        else:
            samples, tables = before.samples, before.tables
            if before.window_size != window_size:
                raise InvalidVDIError("it is written by a step of another window")
        self.n_decoded += 1
        numbers = (arrays, number(text["step"]), samples, tables, window_size, before)
        runtime = runtime_for_decoding()
        try:
            found = None if runtime is None else decoded_on(runtime, *numbers)
        except (DeviceError, DeviceMemoryError, KernelBuildError) as error:
            _log.debug("a step is decoded without the device", exc_info=error)
            found = None
        if found is not None:
            return found
        with np.errstate(all="ignore"):  # what overflows is found out when the codes are checked
            return decoded(*numbers)

    def _place_of(self, step: int, needed_by: int) -> int:
        """Return where a step's frame stands among those that were found."""
        k = bisect_left(self._frames, step, key=lambda frame: frame[1].number)
        if k == len(self) or self._frames[k][1].number != step:
            self._refuse(
                f"{self._PART} {needed_by} is written by {self._PART} {step}, which cannot be found"
            )
        return k

    def _described(self, i: int) -> _Described:
        """Return a step's description: its own, or that of the step that it is written by."""
        passed: list[int] = []
        while i not in self._descriptions:
            passed.append(i)
            header = self._frames[i][1]
            part = f"{self._PART} {header.number}"
            try:
                if header.kind == layout.VDI_FILE:
                    info = vdi_reader.read_info(self._path, stream=self._file_in(i))
                    self._descriptions[i] = _Described(
                        *(info.camera, info.window_size, info.bounds, info.metadata),
                        info.depth_origin,
                        info.deferred,
                    )
                    break
                found = layout.read_text(self._content(i))[0].get("description")
            except VDIFileError:
                raise
            except _CONTRADICTIONS as error:
                self._refuse(f"{part}: {error}")
            if found is None and header.by >= 0:
                i = self._place_of(header.by, header.number)
            elif not isinstance(found, dict):
                self._refuse(f"{part} is not described")
            else:
                self._descriptions[i] = self._checked(found, part)
        for k in passed:
            self._descriptions[k] = self._descriptions[i]
        return self._descriptions[i]

    def _checked(self, found: dict[str, Any], part: str) -> _Described:
        """Return a frame's description."""
        try:
            deferred = found.get("deferred")
            if deferred is not None:
                found = found["lists"]
            if not isinstance(found["metadata"], dict) or not isinstance(deferred, dict | None):
                raise TypeError("metadata, and what is known of values, are dictionaries")
            return _Described(
                Camera.from_dict(found["camera"]),
                check_window_size(found["window_size"]),
                tuple(number(bound) for bound in found["bounds"]),
                found["metadata"],
                number(found["depth_origin"]),
                deferred,
            )
        except (VDIError, KeyError, TypeError, ValueError, OverflowError) as error:
            self._refuse(f"{part} is described wrongly: {error!r}")


def _samples(found: Any) -> Samples | None:
    """Return the samples that a step names."""
    if found is None:
        return None
    coefficients = tuple(number(value) for value in found)
    if len(coefficients) != 9 or not all(map(math.isfinite, coefficients)):
        raise InvalidVDIError("its samples are not nine finite numbers")
    return Samples(coefficients)


def _tables(arrays: dict[str, NDArray[Any]]) -> Tables:
    """Return the tables in a step's arrays."""
    colors, extinctions = arrays["colors"], arrays["extinctions"]
    if colors.dtype != np.uint8 or colors.size != 3 * ENTRIES or len(extinctions) != ENTRIES:
        raise InvalidVDIError("its tables have another size")
    extinctions = extinctions.astype(np.float32)
    if not (np.isfinite(extinctions).all() and (extinctions >= 0).all()):
        raise InvalidVDIError("its extinctions are not finite")
    # Copies: the arrays of a frame lie in one memory
    return Tables(colors.reshape(-1, 3).copy(), extinctions.copy())
