"""A thread that does one job at a time behind the frames: the last that it was given."""

import atexit
import threading
import traceback
import weakref
from collections.abc import Callable, Hashable
from typing import Any

from pyvista_vdi.device import Runtime, get_runtime
from pyvista_vdi.errors import Cancelled

#: Does a job on a device, and returns what is not None; it is given what takes note of the fraction
#: that is done.
Work = Callable[[Runtime, Callable[[float], None]], Any]


class Job:
    """Work that is done in pieces, between frames that are drawn inside ``Runtime.foreground``."""

    def __init__(self, work: Work, device: Any, key: Hashable = None) -> None:
        self.key = key
        self.progress = 0.0
        self.cancelled = threading.Event()
        self._work = work
        self._device = device

    def done(self) -> Any:
        """Do the work on a queue of this thread's own, and return its result."""
        runtime = get_runtime(self._device)
        with runtime.background(self.cancelled.is_set):
            return self._work(runtime, self._report)

    def _report(self, fraction: float) -> None:
        self.progress = fraction


class Worker:
    """Where one thread, which draws, puts jobs, and another lays what it has made of them.

    The thread begins with a job and ends when there is none.

    ``name``: of the thread. ``notify``: returns what is called, from the worker thread, when there
    is something to take.
    """

    def __init__(
        self, name: str, notify: Callable[[], Callable[[], object] | None] = lambda: None
    ) -> None:
        self.job: Job | None = None  # to be done, being done, or done and not taken
        self._name = name
        self._notify = notify
        self._closed = False
        self._lock = threading.RLock()  # a collection inside may clear another worker, or this one
        self._working = False
        self._thread: threading.Thread | None = None
        self._made: Any = None
        self._error: BaseException | None = None
        with _workers_lock:
            _workers.add(self)

    @property
    def running(self) -> bool:
        """Whether there is a job that is not done."""
        with self._lock:
            return self.job is not None and self._made is None and self._error is None

    def put(self, job: Job) -> None:
        """Replace the job, and see to it that a thread works."""
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
            self._do(job)

    def _do(self, job: Job) -> None:
        made, failed = None, None
        try:
            made = job.done()
        except Cancelled:
            return
        except BaseException as error:  # take() raises it where somebody can act on it
            traceback.clear_frames(error.__traceback__)  # they hold buffers
            failed = error
        # Keep what became of the job, unless it is out of date
        with self._lock:
            if job is not self.job:
                return
            self._made, self._error = made, failed
        notify = self._notify()
        if notify is not None:
            notify()


_workers: weakref.WeakSet[Worker] = weakref.WeakSet()
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
