"""Writes .vdis files, step by step."""

from __future__ import annotations

import contextlib
import os
from typing import TYPE_CHECKING, Any, BinaryIO

from pyvista_vdi.errors import InvalidArgumentError, VDIFileError, naming
from pyvista_vdi.extensions.series import layout
from pyvista_vdi.extensions.series.continuing import Begun
from pyvista_vdi.extensions.series.generate import StepMaker
from pyvista_vdi.extensions.series.steps_writer import KEY_EVERY, StepsWriter
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.types import CameraLike, DeviceLike, WindowSize
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.whole_file import as_path, check_writable, whole_file, with_suffix

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from pyvista_vdi.extensions.series.keywords import WriterOptions


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
    precision : {"8-byte", "exact"}
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
        camera: CameraLike | None = None,
        window_size: WindowSize | None = None,
        *,
        precision: str = "8-byte",
        tolerance: float = 0.0,
        key_every: int = KEY_EVERY,
        compression: str = "zstd",
        level: int | None = None,
        device: DeviceLike | None = None,
        append: bool = False,
        overwrite: bool = False,
        **options: Unpack[WriterOptions],
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
        if self._make is not None and self._make.deferral.deferred:
            self._steps.require_no_tolerance()
        self.path = check_writable(with_suffix(as_path(path), (layout.SUFFIX,), "a series"))
        self._begun = Begun.of(self.path, append, overwrite)
        if self._begun is None:
            with whole_file(self.path) as stream:
                self._steps.begin(stream)
        else:
            self._steps.go_on(self._begun)
            if self._make is not None:
                self._begun.check_kept(self._make.deferral)
        self._stream: BinaryIO | None = self.path.open("r+b")
        if self._begun is None:
            self._stream.seek(0, os.SEEK_END)
        else:
            self._stream.seek(self._begun.end)  # its index, if there is one, is written anew

    def append(self, step: Any, time: float | None = None) -> VDI:
        """Write the next step.

        Parameters
        ----------
        step : VDI or DeferredVDI, or what generate_series takes as a step's volume
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
        if not isinstance(step, VDI | DeferredVDI):
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
