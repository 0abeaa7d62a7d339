"""Writes the frames of .vdis and .vdiset files: each step as a key, or by what another one was."""

from __future__ import annotations

import io
import os
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi._version import __version__
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.extensions.series import layout
from pyvista_vdi.extensions.series.codes import Codes, Samples, Tables
from pyvista_vdi.extensions.series.continuing import Begun
from pyvista_vdi.extensions.series.differences import SAME, Stepped, lengths_of
from pyvista_vdi.extensions.series.encoder import encoded
from pyvista_vdi.extensions.series.series import check_range, checked_time, range_of
from pyvista_vdi.io.progress import Pieces, Progress
from pyvista_vdi.io.vdi_file import writer as vdi_writer
from pyvista_vdi.io.vdi_file.chunks import CODECS, check_level
from pyvista_vdi.io.vdi_file.description import describe
from pyvista_vdi.model.checks import one_of
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.packing import check_precision
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.whole_file import as_path, check_writable, whole_file, with_suffix

#: Steps at most between two that need no other one.
KEY_EVERY = 16
#: Steps from one that is written by the key to the next.
_ANCHOR_EVERY = 4
#: Steps that are decoded at most for one.
MOST_DECODED = 3
#: Effort of the compressors; higher ones of Zstandard gain a percent in twice the time.
_LEVELS = {"zstd": 5, "lz4": 9, "deflate": 6, "none": 1}
#: How much larger a difference is than the last that was compared with a key before another is.
_TRY_AGAIN = 1.25


def write(
    steps: Sequence[VDI],
    times: Sequence[float],
    path: str | os.PathLike[str],
    *,
    precision: str | None = None,
    tolerance: float = 0.0,
    key_every: int = KEY_EVERY,
    compression: str = "zstd",
    level: int | None = None,
    progress: Progress | None = None,
) -> Path:
    """Write a series to a file, which appears whole or not at all: see :meth:`VDISeries.save`."""
    target = check_writable(with_suffix(as_path(path), (layout.SUFFIX,), "a series"))
    writer = StepsWriter(
        steps[0].precision if precision is None else precision,
        tolerance,
        key_every,
        compression,
        level,
    )
    with whole_file(target) as stream:
        write_all(stream, writer, steps, times, progress)
    return target


def write_all(
    stream: BinaryIO,
    writer: StepsWriter,
    steps: Sequence[VDI],
    times: Sequence[float],
    progress: Progress | None,
    **head: Any,
) -> int:
    """Write a whole file, with what its head says; return how many bytes show its first step."""
    done, first = Pieces(progress, len(times)), 0
    writer.begin(stream, **head)
    for i, time in enumerate(times):
        writer.write(stream, steps[i], time)
        first = first or stream.tell()
        done()
    writer.finish(stream)
    return first


class StepsWriter:
    """Writes frames to a stream, and remembers the steps that others may be written by."""

    def __init__(
        self, precision: str, tolerance: float, key_every: int, compression: str, level: int | None
    ) -> None:
        self._precision = check_precision(precision)
        if isinstance(tolerance, bool) or not isinstance(tolerance, int | float):
            raise InvalidArgumentError(f"tolerance must be a number; got {tolerance!r}")
        if not 0 <= tolerance < 1:
            raise InvalidArgumentError(f"tolerance must be 0 or more, below 1; got {tolerance}")
        if tolerance and precision != "8-byte":
            raise InvalidArgumentError(
                f"a tolerance goes with the precision '8-byte'; got {precision!r}"
            )
        if isinstance(key_every, bool) or not isinstance(key_every, int) or key_every < 1:
            raise InvalidArgumentError(
                f"key_every must be a whole number from 1; got {key_every!r}"
            )
        one_of(compression, "compression", (*CODECS, "none"))
        check_level(level)
        self._tolerance, self._key_every = float(tolerance), key_every
        self._codec, self._asked_level = compression, level
        self._level = _LEVELS[compression] if level is None else level
        self._entries: list[bytes] = []
        self._last_time: float | None = None
        self._known: list[_Known] = []
        self._tried = 0.0
        self._range: tuple[float, float] | None = None  # of the values that steps keep

    def __len__(self) -> int:
        return len(self._entries)

    def begin(
        self,
        stream: BinaryIO,
        magic: bytes = layout.MAGIC,
        name: str = layout.FORMAT_NAME,
        **more: Any,
    ) -> None:
        """Write the file's head, of this format or of one that is like it, with what is more."""
        head = {
            "format": name,
            "written_by": f"pyvista-vdi {__version__}",
            "precision": self._precision,
            "tolerance": self._tolerance,
            "key_every": self._key_every,
            "codec": self._codec,
            **more,
        }
        stream.write(layout.head_bytes(head, magic))

    def go_on(self, begun: Begun) -> None:
        """Go on behind the steps of a file, the first one by one that needs no other."""
        begun.check_head(
            precision=self._precision,
            tolerance=self._tolerance,
            key_every=self._key_every,
            codec=self._codec,
        )
        self._entries, self._last_time = begun.entries, begun.times[-1]
        self._range = begun.info().value_range

    def checked_time(self, time: float | None) -> float:
        """Return the next step's time, or raise InvalidArgumentError."""
        value = float(len(self)) if time is None else checked_time(time)
        if self._last_time is not None and not value > self._last_time:
            raise InvalidArgumentError(
                f"times must ascend; got {value} after {self._last_time}, that of the last step"
            )
        return value

    def write(self, stream: BinaryIO, vdi: VDI | DeferredVDI, time: float) -> None:
        """Write the frame of a step at the stream's end."""
        time = self.checked_time(time)
        if not self._entries:
            self._range = range_of(vdi)
        check_range(vdi, self._range, f"number {len(self)}")
        packed = vdi.with_precision(self._precision)
        if isinstance(packed, DeferredVDI):
            self.require_no_tolerance()
            new = self._written(packed.lists, packed.about)
        else:
            new = self._written(packed)
        number = len(self._entries)
        header = layout.FrameHeader(
            layout.STEP, number, new.kind, new.by, time, len(new.content), zlib.crc32(new.content)
        ).to_bytes()
        begin = stream.tell()
        stream.write(header + new.content)
        stream.flush()  # what cannot be written is no step
        self._entries.append(layout.ENTRY.pack(begin) + header)
        self._last_time = time
        new.content = b""
        if new.kind != layout.AGAIN:
            if new.depth == 1:
                self._known = [new]
            elif new.depth < MOST_DECODED:
                self._known = [self._known[0], new]

    def require_no_tolerance(self) -> None:
        """Raise InvalidArgumentError where steps keep values, which a tolerance is not for."""
        if self._tolerance:
            raise InvalidArgumentError(
                "a tolerance is of colours and opacities, which a DeferredVDI does not have; "
                f"got {self._tolerance}: leave it out"
            )

    def finish(self, stream: BinaryIO) -> None:
        """Write the index."""
        begin, content = stream.tell(), b"".join(self._entries)
        header = layout.FrameHeader(
            layout.INDEX, len(self), 0, -1, 0.0, len(content), zlib.crc32(content)
        )
        stream.write(header.to_bytes() + content)
        stream.write(layout.TRAILER.pack(begin, layout.TRAILER_MAGIC))

    def _written(self, vdi: VDI, deferred: dict[str, Any] | None = None) -> _Known:
        number = len(self._entries)
        description = describe(vdi, layout.FORMAT_VERSION)
        for name in ("format", "version", "written_by", "n_supersegments"):
            del description[name]
        if deferred is not None:  # nested: nobody takes values for colours
            description = {"deferred": deferred, "lists": description}
        key = self._known[0] if self._known else None
        new = _Known(number, vdi, description)
        if key is None or not new.goes_with(key):
            return self._key(new)
        near = self._known[-1] if (number - key.number) % _ANCHOR_EVERY else key
        found = self._by(new, near)
        if found.kind == layout.AGAIN:
            return found
        # What is as it was needs no key of its own; all else does
        if number - key.number >= self._key_every or found.by < 0:
            return found if found.by < 0 else self._key(new)
        if len(found.content) > self._tried:
            own = self._key(new)
            self._tried = max(len(own.content), len(found.content)) * _TRY_AGAIN
            if len(own.content) <= len(found.content):
                return own
        return found

    def _key(self, new: _Known) -> _Known:
        """Return a step that needs no other: in the shorter of two forms."""
        if self._precision != "8-byte":
            return self._file(new)
        codes, samples = Codes.of(new.vdi), Samples.of(new.vdi)
        size = new.vdi.window_size
        tables = Tables.of(codes, lengths_of(codes, samples, size), new.vdi.metadata)
        step, arrays = encoded(Stepped(codes, tables, samples, size), None, self._tolerance)
        arrays["colors"] = tables.colors.reshape(-1)
        arrays["extinctions"] = tables.extinctions.astype("<f4")
        found = self._framed(new, None, arrays, layout.LISTS, step)
        if self._tolerance:
            return found
        whole = self._file(new)
        return found if len(found.content) < len(whole.content) else whole

    def _file(self, new: _Known) -> _Known:
        """Return a step as a .vdi file within the file."""
        stream = io.BytesIO()
        vdi_writer.write_to(
            stream,
            new.vdi,
            self._codec,
            self._asked_level,
            coarse=False,
            deferred=new.description.get("deferred"),
        )
        array: NDArray[Any] = np.frombuffer(stream.getbuffer(), np.uint8)
        return self._framed(new, None, {"vdi": array}, layout.VDI_FILE)

    def _by(self, new: _Known, old: _Known) -> _Known:
        """Return a step written by another one."""
        if old.step is None or self._precision != "8-byte":
            if new.vdi.equals(old.vdi):
                return self._framed(new, old, {}, layout.AGAIN)
            return self._key(new)
        codes = Codes.of(new.vdi)
        if codes.step != old.step.codes.step:
            return self._key(new)
        given = Stepped(codes, old.step.tables, old.step.samples, old.step.window_size)
        step, arrays = encoded(given, old.step, self._tolerance)
        if (arrays["how"] == SAME).all():
            return self._framed(new, old, {}, layout.AGAIN)
        return self._framed(new, old, arrays, layout.LISTS, step)

    def _framed(
        self,
        new: _Known,
        old: _Known | None,
        arrays: dict[str, NDArray[Any]],
        kind: int,
        step: Stepped | None = None,
    ) -> _Known:
        """Return a step with its frame's content, as it will be remembered."""
        text: dict[str, Any] = {}
        if kind != layout.VDI_FILE and (old is None or new.description != old.description):
            text["description"] = new.description
        if step is not None:
            text["step"] = step.codes.step
            if old is None:
                text["samples"] = step.samples and step.samples.coefficients
        codec = "none" if kind == layout.VDI_FILE else self._codec  # that is compressed already
        return replace(
            new,
            kind=kind,
            by=-1 if old is None else old.number,
            depth=1 if old is None else old.depth + (kind != layout.AGAIN),
            step=step,
            content=layout.content_bytes(text, arrays, codec, self._level),
        )


@dataclass(eq=False)
class _Known:
    """A step that was written, or will be."""

    number: int
    vdi: VDI
    description: dict[str, Any]
    kind: int = layout.VDI_FILE
    by: int = -1
    depth: int = 1
    step: Stepped | None = None
    content: bytes = b""

    def goes_with(self, other: _Known) -> bool:
        """Whether both have the same lists and depths."""
        one, two = self.vdi, other.vdi
        return (
            one.camera == two.camera
            and one.window_size == two.window_size
            and one.depth_origin == two.depth_origin
        )
