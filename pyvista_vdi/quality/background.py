"""Threads that work in the background of frames: each does the last job that it was given."""

from __future__ import annotations

import atexit
import threading
import time
import traceback
import weakref
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import Any

from pyvista_vdi.device import Runtime, get_runtime
from pyvista_vdi.errors import Cancelled
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.options import FrameRequest, GenerationRequest, QualityTarget
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.targets import generate_to_target
from pyvista_vdi.raycasting.raycast import render_vdi

#: Does a job on a device, and returns what is not None; it is given what takes note of the fraction
#: that is done.
Work = Callable[[Runtime, Callable[[float], None]], Any]

#: Pixels along each edge of the frame that a new VDI is tried with: what the first real frame
#: would have to compile and upload is there then.
TRIAL_SIZE = 8


@dataclass(eq=False)
class Job:
    """Work that is done in pieces, between frames that are drawn inside ``Runtime.foreground``."""

    work: Work
    device: Any
    key: Hashable = None
    progress: float = 0.0
    cancelled: threading.Event = field(default_factory=threading.Event)

    def done(self, paused: Callable[[], bool] = lambda: False) -> Any:
        """Do the work on a queue of this thread's own, and return its result."""
        runtime = get_runtime(self.device)
        with runtime.background(self.cancelled.is_set, paused):
            return self.work(runtime, lambda fraction: setattr(self, "progress", fraction))


class BackgroundThread:
    """Where one thread, which draws, puts jobs, and another lays what it has made of them.

    The thread begins with a job and ends when there is none, on :meth:`close`, and at the
    interpreter's exit, within one piece of work (``pyvista_vdi.device.scheduling``; a kernel that
    is being compiled is finished first).

    ``name``: of the thread.
    """

    def __init__(self, name: str) -> None:
        self.job: Job | None = None  # to be done, being done, or done and not taken
        self._name = name
        self._closed = False
        self._lock = threading.RLock()  # a collection inside may clear another worker, or this one
        self._working = False
        self._thread: threading.Thread | None = None
        self._made: Any = None
        self._error: BaseException | None = None
        self._paused_until = 0.0  # by the clock of time.monotonic
        with _workers_lock:
            _workers.add(self)

    @property
    def running(self) -> bool:
        """Whether there is a job that is not done."""
        with self._lock:
            return self.job is not None and self._made is None and self._error is None

    @property
    def progress(self) -> float | None:
        """Fraction of the job that is done, 0 to 1; None where there is none to be done."""
        job = self.job
        return job.progress if job is not None and self.running else None

    def put(self, job: Job) -> None:
        """Replace the job, and see to it that a thread works; RuntimeError after ``close``."""
        if self._closed:
            raise RuntimeError(f"this {self._name} was closed")
        with self._lock:
            self.clear()
            self.job = job
            if not self._working:
                self._working = True
                # Ended at exit by _end_all; a thread that is no daemon would keep Python alive
                self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
                self._thread.start()

    def pause(self, seconds: float) -> None:
        """Pause the thread for so long from now on; 0: it continues."""
        self._paused_until = time.monotonic() + seconds if seconds else 0.0

    def clear(self) -> None:
        """Cancel the job, and drop what was not taken."""
        with self._lock:
            if self.job is not None:
                self.job.cancelled.set()
            self.job = self._made = self._error = None

    def take(self) -> Any:
        """Hand out what was made, or raise what went wrong, once; None where there is nothing."""
        with self._lock:
            made, error = self._made, self._error
            if made is not None or error is not None:
                self.clear()
        if error is not None:
            raise error
        return made

    def close(self) -> None:
        """Cancel, and take no more jobs."""
        self._closed = True
        self.clear()

    def join(self) -> None:
        """Wait for the thread to end, unless this is it."""
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join()

    def _run(self) -> None:
        """Do jobs as long as there is one that is still to be done."""
        while True:
            with self._lock:
                self._working = self.running
                job = self.job
                if job is None or not self._working:
                    return
            made, failed = None, None
            try:
                made = job.done(lambda: time.monotonic() < self._paused_until)
            except Cancelled:
                continue
            except BaseException as error:  # take() raises it where somebody can act on it
                traceback.clear_frames(error.__traceback__)  # they hold buffers
                failed = error
            # Keep what became of the job, unless it is out of date
            with self._lock:
                if job is self.job:
                    self._made, self._error = made, failed


def vdi_job(
    request: GenerationRequest, target: QualityTarget | None = None, key: Hashable = None
) -> Job:
    """Return the job that makes a VDI: with it, the next frame can be its first.

    The volume's values must stay until it is done, or cancelled and its thread has ended.
    """

    def make(runtime: Runtime, report: Callable[[float], None]) -> VDI:
        here = request.replace(device=runtime, progress=report)
        vdi = generate_to_target(here, target) if target else generate_vdi(here)
        render_vdi(vdi, FrameRequest(vdi.camera, (TRIAL_SIZE, TRIAL_SIZE), device=runtime))
        return vdi

    return Job(make, request.device, key)


_workers: weakref.WeakSet[BackgroundThread] = weakref.WeakSet()
_workers_lock = threading.Lock()  # a set that grows cannot be walked


@atexit.register
def _end_all() -> None:
    """End every thread before drivers are unloaded."""
    with _workers_lock:
        workers = list(_workers)
    for worker in workers:
        worker.close()
    for worker in workers:
        worker.join()
