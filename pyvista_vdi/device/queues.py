"""A device, the command queues of its threads, frames before background work, and device times."""

import atexit
import contextlib
import os
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from pyvista_vdi.device import devices
from pyvista_vdi.device.devices import Candidate, DeviceInfo, bytes_text, opencl
from pyvista_vdi.device.scheduling import ThisThread, Turns
from pyvista_vdi.errors import DeviceError, DeviceMemoryError

PROFILE_VARIABLE = "PYVISTA_VDI_PROFILE"
PENDING_LIMIT = 512  # events kept before finished ones are turned into sums


def profiling_wanted() -> bool:
    """Whether ``PYVISTA_VDI_PROFILE`` asks for profiling; empty, "0", "false", "no", "off": no."""
    value = os.environ.get(PROFILE_VARIABLE, "").strip().lower()
    return value not in ("", "0", "false", "no", "off")


@dataclass(frozen=True)
class KernelTime:
    """Device time of one kernel.

    Attributes
    ----------
    name : str
        Kernel, or ``[write]``, ``[read]``, ``[fill]`` for transfers; ``[map]`` where what was
        written in place is read.
    calls : int
        How often it ran.
    total_ms, mean_ms : float
        Milliseconds from start to end on the device, waiting in the queue left out.
    share : float
        Part of the total of all rows, 0 to 1.
    """

    name: str
    calls: int
    total_ms: float
    mean_ms: float
    share: float


class Profile:
    """Collects events of any thread and sums their device times."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._pending: list[tuple[str, Any]] = []
        self._sums: dict[str, tuple[int, int]] = {}  # name -> calls, nanoseconds

    def record(self, name: str, event: Any) -> None:
        """Note an enqueued command's event; its times are read once it has finished."""
        with self._lock:
            self._pending.append((name, event))
            if len(self._pending) >= PENDING_LIMIT:
                self._drain()

    def _drain(self) -> None:
        for name, event in self._pending:
            event.wait()
            calls, nanoseconds = self._sums.get(name, (0, 0))
            elapsed = event.profile.end - event.profile.start
            self._sums[name] = (calls + 1, nanoseconds + elapsed)
        self._pending.clear()

    def figures(self) -> list[KernelTime]:
        """Wait for what is pending, and return rows, longest total first."""
        with self._lock:
            self._drain()
            sums = sorted(self._sums.items(), key=lambda item: item[1][1], reverse=True)
        whole = sum(elapsed for _, (_, elapsed) in sums) or 1
        return [
            KernelTime(name, calls, elapsed * 1e-6, elapsed * 1e-6 / calls, elapsed / whole)
            for name, (calls, elapsed) in sums
        ]


def table(title: str, rows: list[KernelTime]) -> str:
    """Return the figures as fixed-width text under a title, without a newline at the end."""
    width = max([len("kernel"), *(len(row.name) for row in rows)])
    lines = [
        f"OpenCL profile: {title}",
        f"{'kernel':<{width}}  {'calls':>7}  {'total ms':>11}  {'mean ms':>10}  {'share':>6}",
    ]
    lines += [
        f"{row.name:<{width}}  {row.calls:>7d}  {row.total_ms:>11.3f}  {row.mean_ms:>10.4f}"
        f"  {row.share:>6.1%}"
        for row in rows
    ]
    return "\n".join(lines)


class _ThisThread(ThisThread):
    """The calling thread, with the number of its queue."""

    number = 1  # the main queue's


class Device(Turns):
    """A device and a context on it, a command queue for all threads, and others for those that ask.

    ``cl`` is pyopencl. ``thread`` has, beside what :class:`Turns` says, the ``number`` of the
    calling thread's queue. With ``PYVISTA_VDI_PROFILE`` times go to ``profiled``.
    """

    _allocated = 0  # bytes that its buffers hold

    def __init__(self, candidate: Candidate, context: Any = None) -> None:
        super().__init__()
        self.info: DeviceInfo = candidate.info
        self.is_cpu = candidate.info.kind == "CPU"
        self._device = candidate.device
        #: Floats of its longest vectors.
        self.vector_floats = int(candidate.device.native_vector_width_float)
        self.cl: Any = opencl()
        try:
            self._context = context or self.cl.Context([self._device])
        except self.cl.Error as exc:
            raise self.failure(exc, "making a context") from exc
        self.thread: _ThisThread = _ThisThread()
        self._queues: dict[int, Any] = {}  # those that exist, numbered as they were made
        self._queues_made = 0
        self._queues_lock = threading.RLock()
        self.profiled: Profile | None = None
        if profiling_wanted():
            self.profiled = Profile()
            atexit.register(self._print_profile)
        self._new_queue()

    def __repr__(self) -> str:
        return f"<{type(self).__name__} on {self.info.full_name}>"

    def failure(self, error: Any, doing: str) -> DeviceError | DeviceMemoryError:
        """Return the package's error for one of the driver's, naming what was being done."""
        codes = self.cl.status_code
        code = getattr(error, "code", None)  # what pyopencl raises by itself has none
        if code in (
            codes.MEM_OBJECT_ALLOCATION_FAILURE,
            codes.OUT_OF_RESOURCES,
            codes.OUT_OF_HOST_MEMORY,
            codes.INVALID_BUFFER_SIZE,
        ):
            return DeviceMemoryError(
                f"{self.info.full_name!r} ran out of memory or resources while {doing} "
                f"({error}); it has {bytes_text(self.info.global_memory)}, of which this "
                f"process holds {bytes_text(self._allocated)}: use a smaller volume, window "
                "size or max_supersegments, or another device"
            )
        remedy = "try again, or use another device"
        if code in (
            codes.DEVICE_NOT_AVAILABLE,
            codes.INVALID_COMMAND_QUEUE,
            codes.INVALID_CONTEXT,
            codes.INVALID_DEVICE,
        ):
            remedy = (
                "it may be lost (unplugged, or reset by its driver): start the program again, or "
                "use another device"
            )
        return DeviceError(
            f"{self.info.full_name!r} failed while {doing}: {error}; {remedy} (device=, or the "
            "environment variable PYVISTA_VDI_DEVICE; pyvista-vdi devices lists them)"
        )

    @property
    def queue(self) -> Any:
        """The calling thread's queue; an error in a fork, where its driver would wait for ever."""
        if devices.forked:
            devices.require_drivers()
        return self._queues[self.thread.number]

    def _new_queue(self) -> int:
        cl = self.cl
        properties = cl.command_queue_properties.PROFILING_ENABLE if self.profiled else 0
        try:
            queue = cl.CommandQueue(self._context, self._device, properties)
        except cl.Error as exc:
            raise self.failure(exc, "making a command queue") from exc
        with self._queues_lock:
            self._queues_made += 1
            self._queues[self._queues_made] = queue
            return self._queues_made

    @contextlib.contextmanager
    def queue_scope(self) -> Iterator[None]:
        """Open an in-order command queue of the calling thread's own for the ``with`` block.

        What was enqueued before is finished first, and what is enqueued inside is finished at
        the end, so buffers may cross the borders of the block.
        """
        self.finish()
        thread, inner = self.thread, self._new_queue()
        outer, thread.number = thread.number, inner
        try:
            yield
        finally:
            thread.number = outer
            self.finish_queues({inner})
            with self._queues_lock:
                del self._queues[inner]

    def finish(self) -> None:
        """Wait until all is done that was enqueued on the calling thread's queue.

        Threads outside :meth:`queue_scope` share one. A buffer that a thread with a queue of its
        own has written may be handed to another thread after this. DeviceError if a kernel failed.
        """
        try:
            self.queue.finish()
        except self.cl.Error as exc:
            raise self.failure(exc, "waiting for enqueued work") from exc

    def finish_queues(self, numbers: set[int]) -> None:
        """Finish those of some queues that still exist, where their driver does."""
        if devices.forked:
            return
        try:
            for number in tuple(numbers):
                if (queue := self._queues.get(number)) is not None:
                    queue.finish()
        except self.cl.Error as exc:
            raise self.failure(exc, "waiting for enqueued work") from exc

    def note_reader(self, readers: set[int]) -> None:
        """Remember that this thread's queue reads a buffer whose memory is a host's array."""
        with self._queues_lock:
            readers.intersection_update(self._queues)
            readers.add(self.thread.number)

    @contextlib.contextmanager
    def background(
        self,
        cancelled: Callable[[], bool] = lambda: False,
        paused: Callable[[], bool] = lambda: False,
    ) -> Iterator[None]:
        """Work inside the ``with`` block only when no frame is in progress, see `foreground`.

        The calling thread gets a queue of its own. Its launches and copies are cut into pieces
        that take no longer than a turn; each is finished when the call returns. ``cancelled`` is
        asked between pieces: True ends the work with :class:`Cancelled`, from any method.
        """
        with self.queue_scope(), super().background(cancelled, paused):
            yield

    def profile(self) -> list[KernelTime]:
        """Device time per kernel so far; empty unless ``PYVISTA_VDI_PROFILE`` was set."""
        return self.profiled.figures() if self.profiled else []

    def record(self, name: str, event: Any) -> None:
        """Note the time of an enqueued command, if anybody wants it."""
        if self.profiled is not None:
            self.profiled.record(name, event)

    def _print_profile(self) -> None:
        rows = self.profile()
        if rows:
            sys.stderr.write(table(self.info.full_name, rows) + "\n")
