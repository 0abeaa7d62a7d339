"""Writes .vdis files, step by step."""

from __future__ import annotations

import contextlib
import io
import os
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi._version import __version__
from pyvista_vdi.errors import InvalidArgumentError, VDIFileError, naming
from pyvista_vdi.extensions.series import layout
from pyvista_vdi.extensions.series.codes import Codes, Samples, Tables
from pyvista_vdi.extensions.series.continuing import Begun, begun
from pyvista_vdi.extensions.series.differences import SAME, Stepped, lengths_of
from pyvista_vdi.extensions.series.encoder import encoded
from pyvista_vdi.extensions.series.generate import StepMaker
from pyvista_vdi.extensions.series.series import checked_time
from pyvista_vdi.io.progress import Pieces, Progress
from pyvista_vdi.io.vdi_file import writer as vdi_writer
from pyvista_vdi.io.vdi_file.chunks import CODECS, check_level
from pyvista_vdi.io.vdi_file.description import describe
from pyvista_vdi.model.checks import one_of
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


class SeriesWriter:
    """Writes a ``.vdis`` file while what it shows is still being computed.

    Each step is on its way to the disk, with its checksum, when :meth:`append` returns: other
    processes read it then, and it stays readable if this one is killed. :meth:`close` adds an
    index, which only makes opening faster. A file that has steps already is not replaced unless
    that is asked for.

    Parameters
    ----------
    path : path-like
        The target; its name ends in ``.vdis``.
    camera : pyvista.Camera or vtkCamera or Camera, optional
        The generating view V_O of volumes; not needed where VDIs are appended.
    window_size : (int, int), optional
        Width and height in pixels, likewise.
    precision : {"8-byte", "16-byte", "exact"}
        Of the supersegments, see :meth:`VDI.with_precision`. Steps are written by their
        differences for ``"8-byte"`` alone.
    tolerance : float
        With 0 steps are read to the last bit of their precision. Else colours times opacity, and
        opacities, of each supersegment may differ by so much, 0 to 1, where that saves bytes.
        (The option of :func:`pyvista_vdi.generate` of the same name keeps its default.)
    key_every : int
        After so many steps at most one is written that needs no other.
    compression : {"zstd", "lz4", "deflate", "none"}
        As for :meth:`VDI.save`.
    level : int, optional
        Effort of the compressor, 1 to 9.
    device : str, int or device, optional
        Where volumes become VDIs.
    append : bool, default: False
        Go on with the file, if it is there already: times must be above that of its last step,
        camera, window size and classification the same, and so the four arguments above.
    overwrite : bool, default: False
        Replace the file at once, if it is there already.
    **options
        For volumes: what :func:`pyvista_vdi.generate_series` takes, classification and ``client``
        included.

    Raises
    ------
    VDIFileError
        If the target cannot be written, is there already (without ``append`` and ``overwrite``), or
        its name ends in something else.
    InvalidArgumentError
        If an argument is out of its range, or not that of the file which is appended to.
    TypeError
        If a keyword is unknown.

    Examples
    --------
    >>> with pvdi.SeriesWriter("run.vdis", camera, size, cmap="bone") as out:  # doctest: +SKIP
    ...     for time, volume in simulation:
    ...         out.append(volume, time)
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        camera: Any = None,
        window_size: Sequence[int] | None = None,
        *,
        precision: str = "8-byte",
        tolerance: float = 0.0,
        key_every: int = KEY_EVERY,
        compression: str = "zstd",
        level: int | None = None,
        device: Any = None,
        append: bool = False,
        overwrite: bool = False,
        **options: Any,
    ) -> None:
        self._make: StepMaker | None = None
        if (camera is None) != (window_size is None) or (options and camera is None):
            raise InvalidArgumentError(
                "volumes need camera and window_size; VDIs, which have their own, take neither, "
                "nor options of generation"
            )
        if camera is not None and window_size is not None:
            self._make = StepMaker(
                "SeriesWriter", camera, window_size, precision, device=device, **options
            )
        self._steps = StepsWriter(precision, tolerance, key_every, compression, level)
        self.path = check_writable(with_suffix(as_path(path), (layout.SUFFIX,), "a series"))
        self._begun = begun(self.path, append, overwrite)
        if self._begun is None:
            with whole_file(self.path) as stream:
                self._steps.begin(stream)
        else:
            self._steps.go_on(self._begun)
        self._stream: BinaryIO | None = self.path.open("r+b")
        if self._begun is None:
            self._stream.seek(0, os.SEEK_END)
        else:
            self._stream.seek(self._begun.end)  # its index, if there is one, is written anew

    def append(self, step: Any, time: float | None = None) -> VDI:
        """Write the next step.

        Parameters
        ----------
        step : VDI, or what generate_series takes as a step's volume
            A volume becomes a VDI first.
        time : float, optional
            Above that of the step before; by default the number of the step.

        Returns
        -------
        VDI
            What was written, before what ``tolerance`` takes from it.

        Raises
        ------
        InvalidArgumentError
            If the time does not ascend, a volume is given without camera and window, or what is
            appended to has another view or classification.
        VDIFileError
            If the file is closed or cannot be written; what was finished stays readable.
        """
        time = self.checked_time(time)
        assert self._stream is not None
        if not isinstance(step, VDI):
            if self._make is None:
                raise InvalidArgumentError(
                    f"got {type(step).__name__}, which is no VDI: pass camera and window_size to "
                    "SeriesWriter, so that VDIs can be made of volumes"
                )
            with naming(f"step {len(self)}"):
                step = self._make(step)
        if self._begun is not None:
            self._begun.check(step)
            self._begun = None  # by what is written now, as in any file
        begin, before = self._stream.tell(), len(self._steps)
        try:
            self._stream.truncate()  # half a step, or an index, of a run before
            self._steps.write(self._stream, step, time)
        except OSError as error:
            self._undo(begin)
            raise VDIFileError(
                f"{self.path} could not be written: {error.strerror}; "
                f"its {len(self._steps)} steps can be read"
            ) from error
        except BaseException:  # Ctrl-C, as others: half a step would part the index from the steps
            if len(self._steps) == before:
                self._stream.seek(begin)
                self._stream.truncate()
            raise
        return step  # type: ignore[no-any-return]

    def checked_time(self, time: float | None) -> float:
        """Return the next step's time, or raise what :meth:`append` would raise for it."""
        if self._stream is None:
            raise VDIFileError(
                f"{self.path} is closed: no step can be appended; make another SeriesWriter with "
                "append=True to go on"
            )
        return self._steps.checked_time(time)

    def close(self) -> None:
        """Write the index, bring the file to the disk and close it; once is enough."""
        stream, self._stream = self._stream, None
        if stream is None:
            return
        try:
            with stream:
                stream.truncate()
                self._steps.finish(stream)
                stream.flush()
                os.fsync(stream.fileno())
        except OSError as error:
            raise VDIFileError(
                f"{self.path} could not be written: {error.strerror}; its steps can be read"
            ) from error

    def __enter__(self) -> SeriesWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __len__(self) -> int:
        return len(self._steps)

    def _undo(self, begin: int) -> None:
        """Take back a frame that could not be finished."""
        stream, self._stream = self._stream, None
        assert stream is not None
        with contextlib.suppress(OSError):
            stream.close()
        with contextlib.suppress(OSError):
            os.truncate(self.path, begin)


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
) -> int:
    """Write a whole file to a stream; return how many bytes show its first step."""
    done, first = Pieces(progress, len(times)), 0
    writer.begin(stream)
    for i, time in enumerate(times):
        writer.write(stream, steps[i], time)
        first = first or stream.tell()
        done()
    writer.finish(stream)
    return first


class StepsWriter:
    """Writes frames to a stream, and remembers the steps that others may be written by.

    Parameters
    ----------
    precision, tolerance, key_every, compression, level
        As for :class:`SeriesWriter`.
    """

    def __init__(
        self,
        precision: str,
        tolerance: float,
        key_every: int,
        compression: str,
        level: int | None,
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
        self._entries, self._last_time = list(begun.entries), begun.last_time

    def checked_time(self, time: float | None) -> float:
        """Return the next step's time, or raise InvalidArgumentError."""
        value = float(len(self)) if time is None else checked_time(time)
        if self._last_time is not None and not value > self._last_time:
            raise InvalidArgumentError(
                f"times must ascend; got {value} after {self._last_time}, that of the last step"
            )
        return value

    def write(self, stream: BinaryIO, vdi: VDI, time: float) -> None:
        """Write the frame of a step at the stream's end."""
        time = self.checked_time(time)
        new = self._written(vdi.with_precision(self._precision))
        number = len(self._entries)
        header = layout.FrameHeader(
            layout.STEP,
            number,
            new.kind,
            new.by,
            time,
            len(new.content),
            zlib.crc32(new.content),
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

    def finish(self, stream: BinaryIO) -> None:
        """Write the index."""
        begin, content = stream.tell(), b"".join(self._entries)
        header = layout.FrameHeader(
            layout.INDEX, len(self), 0, -1, 0.0, len(content), zlib.crc32(content)
        )
        stream.write(header.to_bytes() + content)
        stream.write(layout.TRAILER.pack(begin, layout.TRAILER_MAGIC))

    def _written(self, vdi: VDI) -> _Known:
        number = len(self._entries)
        description = describe(vdi, layout.FORMAT_VERSION)
        for name in ("format", "version", "written_by", "n_supersegments"):
            del description[name]
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
        vdi_writer.write_to(stream, new.vdi, self._codec, self._asked_level, coarse=False)
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
        found = _Known(new.number, new.vdi, new.description)
        found.kind, found.step = kind, step
        found.by = -1 if old is None else old.number
        found.depth = 1 if old is None else old.depth + (kind != layout.AGAIN)
        codec = "none" if kind == layout.VDI_FILE else self._codec  # that is compressed already
        found.content = layout.Content(text, arrays).to_bytes(codec, self._level)
        return found


class _Known:
    """A step that was written, or will be."""

    kind = layout.VDI_FILE
    by = -1
    depth = 1
    content = b""
    step: Stepped | None = None

    def __init__(self, number: int, vdi: VDI, description: dict[str, Any]) -> None:
        self.number, self.vdi, self.description = number, vdi, description

    def goes_with(self, other: _Known) -> bool:
        """Whether both have the same lists and depths."""
        one, two = self.vdi, other.vdi
        return (
            one.camera == two.camera
            and one.window_size == two.window_size
            and one.depth_origin == two.depth_origin
        )
