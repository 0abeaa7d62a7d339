"""Writes a series step by step, into a folder that others read meanwhile."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import re
import sys
from pathlib import Path
from typing import IO, Any

from pyvista_vdi.errors import InvalidArgumentError, VDIFileError, naming, warn_external
from pyvista_vdi.extensions.series.archive import SERIES, VDI_NAME, Archive, head_bytes
from pyvista_vdi.extensions.series.generate import StepMaker
from pyvista_vdi.extensions.series.series import check_range, checked_time, times_of
from pyvista_vdi.io import check_write_options
from pyvista_vdi.io.vdi_file.layout import to_json
from pyvista_vdi.model.types import CameraLike, DeviceLike, WindowSize
from pyvista_vdi.model.vdi import VDI, DeferredVDI
from pyvista_vdi.model.whole_file import as_path, whole_file, with_suffix


class SeriesWriter(contextlib.AbstractContextManager["SeriesWriter"]):
    """Writes a series while what it shows is still being computed.

    It is a folder of numbered ``.vdi`` files, and ``series.json``, which has their times. Each step
    is whole and on the disk when :meth:`append` returns: other processes read it then, and it stays
    if this one is killed. A series that is there already is not replaced unless that is asked for,
    and while one writer is at work another one is refused.

    Parameters
    ----------
    path : path-like
        The folder; its name ends in ``.vdis``.
    camera : pyvista.Camera or vtkCamera or Camera, optional
        The generating view V_O of volumes; not needed where VDIs are appended.
    window_size : (int, int), optional
        Width and height in pixels, likewise.
    precision : {"8-byte", "exact"}
        Of the supersegments, see :meth:`VDI.with_precision`.
    compression : {"zstd", "lz4", "deflate", "none"}
        As for :meth:`VDI.save`.
    level : int, optional
        Effort of the compressor, 1 to 9.
    device : str, DeviceInfo or Runtime, optional
        Where volumes become VDIs.
    append : bool, default: False
        Continue the series, if it is there already: times must be above that of its last step,
        camera, window size and classification the same.
    overwrite : bool, default: False
        Remove the series at once, if it is there already.
    **options
        For volumes: what :func:`pyvista_vdi.generate_series` takes, classification and ``client``
        included.

    Raises
    ------
    VDIFileError
        If the target cannot be written, is there already (without ``append`` and ``overwrite``), is
        being written by another writer, or its name ends in something else.
    InvalidArgumentError
        If an argument is out of its range, or not that of the series which is continued.
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
        compression: str = "zstd",
        level: int | None = None,
        device: DeviceLike | None = None,
        append: bool = False,
        overwrite: bool = False,
        **options: Any,
    ) -> None:
        if (camera is None) != (window_size is None) or (options and camera is None):
            raise InvalidArgumentError(
                "volumes need camera and window_size; VDIs, which have their own, take neither, "
                "nor options of generation"
            )
        self._make: StepMaker | None = None
        if camera is not None and window_size is not None:
            given = {"precision": precision, "device": device, **options}
            self._make = StepMaker("SeriesWriter", camera, window_size, **given)
        self._how = {"precision": precision, "compression": compression, "level": level}
        check_write_options(VDI_NAME.format(0), self._how)
        self.path = Path(os.path.realpath(with_suffix(as_path(path), (SERIES.suffix,), "a series")))
        self._times: list[float] = []
        self._range: tuple[float, float] | None = None  # of the values that steps keep
        self._before: Any = None  # the last step of an earlier run, to compare the next one with
        self._lock: IO[bytes] | None = _locked(self.path)
        try:
            # Find what an earlier run has written, and refuse, remove or continue it
            head = self.path / SERIES.head
            numbered = [f for f in self.path.iterdir() if re.fullmatch(r"\d{6,}\.vdi", f.name)]
            if overwrite:
                for file in (head, *numbered):
                    file.unlink(missing_ok=True)
            elif append and (numbered or head.exists()):
                steps = Archive(self.path, SERIES)
                self._times = list(times_of(steps))
                self._before = steps[-1] if self._times else None
                self._range = getattr(self._before, "value_range", None)
            elif numbered:
                raise VDIFileError(
                    f"{self.path} is there already with {len(numbered)} .vdi files: pass "
                    "append=True to continue it, overwrite=True to replace it, or another name"
                )
            self._write_times(self._times)
        except BaseException:
            self.close()
            raise

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
            What was written.

        Raises
        ------
        InvalidArgumentError
            If the time does not ascend, a volume is given without camera and window, or what is
            appended to has another view or classification.
        VDIFileError
            If the writer is closed or the step cannot be written; the steps before stay.
        """
        if self._lock is None:
            raise VDIFileError(
                f"{self.path} is closed: no step can be appended; make another SeriesWriter with "
                "append=True to continue"
            )
        time = float(len(self)) if time is None else checked_time(time)
        if self._times and not time > self._times[-1]:
            raise InvalidArgumentError(
                f"times must ascend; got {time} after {self._times[-1]}, that of the last step"
            )
        if not isinstance(step, VDI | DeferredVDI):
            if self._make is None:
                raise InvalidArgumentError(
                    f"got {type(step).__name__}, which is no VDI: pass camera and window_size to "
                    "SeriesWriter, so that VDIs can be made of volumes"
                )
            with naming(f"step {len(self)}"):
                step = self._make(step)
        had, has = (_view_and_look(vdi) for vdi in (self._before or step, step))
        if differ := [name for name in had if had[name] != has[name]]:
            raise InvalidArgumentError(
                f"{self.path} cannot be continued: its {differ[0]} is {had[differ[0]]!s:.99}, and "
                f"that of this step {has[differ[0]]!s:.99}; give the same view and classification "
                "(clim, too), or begin another series"
            )
        if not self._times:
            self._range = getattr(step, "value_range", None)
        check_range(step, self._range, f"number {len(self)}")
        # The step first: one whose time is not known is none, and is replaced by the next
        step.save(self.path / VDI_NAME.format(len(self)), **self._how)
        self._write_times([*self._times, time])
        self._before = None
        return step  # type: ignore[no-any-return]

    def _write_times(self, times: list[float]) -> None:
        with whole_file(self.path / SERIES.head) as stream:
            stream.write(head_bytes(SERIES, {"times": times}))
        self._times = times

    def close(self) -> None:
        """End: no step comes after, and others may write."""
        lock, self._lock = self._lock, None
        if lock is not None:
            lock.close()

    def __exit__(self, *_: object) -> None:
        self.close()

    def __len__(self) -> int:
        return len(self._times)


def _locked(folder: Path) -> IO[bytes]:
    """Return a file that is locked as long as it is open, and no longer than this process lives."""
    try:
        folder.mkdir(exist_ok=True)
        stream = (folder / "writer.lock").open("ab")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise VDIFileError(f"{folder} cannot be written: {reason}; choose another") from error
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(stream.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in (errno.EAGAIN, errno.EACCES, errno.EDEADLK):
            stream.close()
            raise VDIFileError(
                f"{folder} is being written by another SeriesWriter: close that, or end its "
                "process, and try again; or choose another name"
            ) from None
        warn_external(
            f"{folder} is on a file system without locks ({error.strerror}): nothing keeps a "
            "second writer from it, whose steps would replace these"
        )
    return stream


def _view_and_look(vdi: Any) -> dict[str, Any]:
    """Return what is the same in all steps of a series that is continued."""
    said = {n: vdi.metadata.get(n) for n in ("transfer_function", "lights", "ambient_occlusion")}
    names = ("camera", "window_size", "value_range")
    return {n: getattr(vdi, n, None) for n in names} | json.loads(to_json(said))  # type: ignore[no-any-return]
