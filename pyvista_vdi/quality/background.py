"""A new VDI made in a thread of its own while frames of the old one are drawn."""

from __future__ import annotations

import atexit
import inspect
import threading
import traceback
import weakref
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import Cancelled
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.quality.dial import Dial
from pyvista_vdi.quality.probe import generate_by_dial
from pyvista_vdi.raycasting.raycast import render_vdi

#: Pixels along each edge of the frame that a new VDI is tried with: what the first real frame
#: would have to compile and upload is there then.
_TRIAL_SIZE = 8

_SIGNATURE = inspect.signature(GenerationOptions)


class BackgroundGeneration:
    """Makes one VDI at a time, giving way to frames drawn inside ``Runtime.foreground``.

    The thread is started by :meth:`start` and ends when there is nothing left to make, on
    :meth:`close`, when this object is collected, and at the interpreter's exit, within one piece
    of work (``pyvista_vdi.device.scheduling``; a kernel that is being compiled is finished
    first). Its methods are meant for one thread, the one that draws.

    Parameters
    ----------
    device : optional
        See :func:`pyvista_vdi.list_devices`; the one that frames are drawn on.
    on_finished : callable, optional
        Called without arguments, **from the worker thread**, when :meth:`take` has something to
        give or to raise: it may set a flag or post an event.
    """

    def __init__(
        self, device: Any = None, *, on_finished: Callable[[], object] | None = None
    ) -> None:
        self._on_finished = on_finished
        # The thread knows only the desk, so that this object can be collected while it works
        self._desk = _Desk(device, weakref.WeakMethod(self._notify))
        self._finalizer = weakref.finalize(self, self._desk.clear)
        self._finalizer.atexit = False  # _end_all waits for the threads as well

    # -- what to make --------------------------------------------------------------------------

    def start(
        self,
        volume: Volume,
        camera: Camera,
        window_size: Sequence[int],
        transfer_function: TransferFunction,
        options: GenerationOptions | None = None,
        *,
        key: Hashable = None,
        dial: Dial | None = None,
        metadata: Mapping[str, Any] | None = None,
        **changes: Any,
    ) -> None:
        """Make a VDI, in place of whatever is being made or was not taken yet.

        Parameters
        ----------
        volume, camera, window_size, transfer_function
            As for :func:`~pyvista_vdi.generation.generate.generate_vdi`. The volume's values
            must stay until the VDI is finished or cancelled with ``wait=True``.
        options : GenerationOptions, optional
            How it is made.
        key : hashable
            What the VDI is for; see :attr:`key`.
        dial : Dial, optional
            Chooses the window, max_supersegments and precision.
        metadata : mapping, optional
            Entries to add to ``vdi.metadata``.
        **changes
            Options by name, in place of those in ``options``. :meth:`take` raises what is wrong
            with their values.

        Raises
        ------
        TypeError
            If there is no such option.
        RuntimeError
            After :meth:`close`.
        """
        if "device" in changes or "progress" in changes:
            raise TypeError("device is given to BackgroundGeneration, and progress is an attribute")
        _SIGNATURE.bind(**changes)
        arguments = (volume, Camera.from_any(camera), window_size, transfer_function, dial, options)
        self._desk.put(_Job(key, arguments, {"metadata": metadata, **changes}))

    def cancel(self, *, wait: bool = False) -> None:
        """Give up what is being made, and what was made and not taken.

        Parameters
        ----------
        wait : bool
            Return only when the thread has ended; the volume may change then.
        """
        self._desk.clear()
        if wait:
            self._desk.join()

    def close(self) -> None:
        """Cancel, and wait for the thread; a second call does nothing."""
        self._desk.closed = True
        self.cancel(wait=True)

    def __enter__(self) -> BackgroundGeneration:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # -- what has become of it -----------------------------------------------------------------

    def take(self) -> VDI | None:
        """Return the VDI that was finished, once; None where there is none.

        It is on the device already: the next frame can be its first.

        Raises
        ------
        VDIError, Exception
            What made the generation fail, once.
        """
        return self._desk.take()

    @property
    def running(self) -> bool:
        """Whether a VDI is being made or waits to be."""
        return self._desk.running

    @property
    def key(self) -> Hashable:
        """The key of what is being made, or was made and not taken; None if there is nothing."""
        job = self._desk.job
        return None if job is None else job.key

    @property
    def progress(self) -> float | None:
        """Fraction of the lists made, 0 to 1; 1 also while they go to the device.

        None when nothing is being made.
        """
        job = self._desk.job
        return job.progress if job is not None and self.running else None

    def _notify(self) -> None:
        if self._on_finished is not None:
            self._on_finished()


class _Job:
    """One VDI to make."""

    def __init__(self, key: Hashable, arguments: tuple[Any, ...], options: dict[str, Any]) -> None:
        self.key = key
        self.arguments = arguments
        self.options = options
        self.progress = 0.0
        self.cancelled = threading.Event()

    def make(self, device: Any) -> VDI:
        """Make the VDI and put it on the device, in turns between frames."""
        runtime = get_runtime(device)
        with runtime.background(self.cancelled.is_set):
            vdi = generate_by_dial(
                *self.arguments, **self.options, device=runtime, progress=self._report
            )
            render_vdi(vdi, vdi.camera, (_TRIAL_SIZE, _TRIAL_SIZE), device=runtime)
        return vdi

    def _report(self, fraction: float) -> None:
        self.progress = fraction


class _Desk:
    """Where the drawing thread puts what is to be made, and the worker thread what it has made."""

    def __init__(self, device: Any, notify: Callable[[], Callable[[], None] | None]) -> None:
        self.device = device
        self.closed = False
        self.job: _Job | None = None  # to be made, being made, or made and not taken
        self._notify = notify
        self._lock = threading.RLock()  # a collection inside may clear another desk, or this one
        self._working = False
        self._thread: threading.Thread | None = None
        self._made: VDI | None = None
        self._error: BaseException | None = None
        _desks.add(self)

    @property
    def running(self) -> bool:
        """Whether there is a job that is not done."""
        with self._lock:
            return self.job is not None and self._made is None and self._error is None

    # -- the drawing thread --------------------------------------------------------------------

    def put(self, job: _Job) -> None:
        """Replace the job, and see to it that a thread works."""
        if self.closed:
            raise RuntimeError("this BackgroundGeneration was closed")
        with self._lock:
            self.clear()
            self.job = job
            if not self._working:
                self._working = True
                # Ended at exit by _end_all; a thread that is no daemon would keep Python alive
                self._thread = threading.Thread(
                    target=_work, args=(self,), name="pyvista-vdi generation", daemon=True
                )
                self._thread.start()

    def clear(self) -> None:
        """Cancel the job, and drop what was not taken."""
        with self._lock:
            if self.job is not None:
                self.job.cancelled.set()
            self.job = self._made = self._error = None

    def take(self) -> VDI | None:
        """Hand out what was made, or raise what went wrong."""
        with self._lock:
            made, error = self._made, self._error
            if made is not None or error is not None:
                self.clear()
        if error is not None:
            raise error
        return made

    def join(self) -> None:
        """Wait for the thread to end, unless this is it."""
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join()

    # -- the worker thread ---------------------------------------------------------------------

    def next_job(self) -> _Job | None:
        """The job if it is still to be made; otherwise the thread ends."""
        with self._lock:
            self._working = self.running
            return self.job if self._working else None

    def done(self, job: _Job, made: VDI | None, error: BaseException | None) -> None:
        """Lay down what became of a job, unless it is out of date."""
        with self._lock:
            if job is not self.job:
                return
            self._made, self._error = made, error
        notify = self._notify()
        if notify is not None:
            notify()


def _work(desk: _Desk) -> None:
    """Make what is on the desk until there is nothing."""
    while (job := desk.next_job()) is not None:
        _do(desk, job)


def _do(desk: _Desk, job: _Job) -> None:
    try:
        made = job.make(desk.device)
    except Cancelled:
        return
    except BaseException as error:  # take() raises it where somebody can act on it
        traceback.clear_frames(error.__traceback__)  # they hold buffers
        desk.done(job, None, error)
    else:
        desk.done(job, made, None)


_desks: weakref.WeakSet[_Desk] = weakref.WeakSet()


@atexit.register
def _end_all() -> None:
    """End every thread before drivers are unloaded."""
    desks = list(_desks)
    for desk in desks:
        desk.closed = True
        desk.clear()
    for desk in desks:
        desk.join()


__all__ = ["BackgroundGeneration"]
