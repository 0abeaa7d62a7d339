"""Command queues of threads, frames before background work, and device times."""

from __future__ import annotations

import atexit
import contextlib
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any

from pyvista_vdi.device import devices
from pyvista_vdi.device.device import Device
from pyvista_vdi.device.devices import Candidate
from pyvista_vdi.device.profiling import KernelTime, Profile, profiling_wanted, table
from pyvista_vdi.device.scheduling import ThisThread, Turns


class _ThisThread(ThisThread):
    """The calling thread: the number of its queue, and the profile that its times go to."""

    number = 1  # the main queue's
    profile: Profile | None = None


class Queues(Device, Turns):
    """A device with a command queue for all threads, and others for those that ask for one.

    Attributes
    ----------
    thread : object
        Beside what :class:`Turns` says of it:
        ``number`` of the calling thread's queue, and ``profile``, where its times go.
    profiled : Profile or None
        Where the times of all others go: with ``PYVISTA_VDI_PROFILE``.
    """

    def __init__(self, candidate: Candidate, context: Any = None) -> None:
        Device.__init__(self, candidate, context)
        Turns.__init__(self)
        self.thread: _ThisThread = _ThisThread()
        self._queues: dict[int, Any] = {}  # those that exist, numbered as they were made
        self._queues_made = 0
        self._queues_lock = threading.RLock()
        self.profiled: Profile | None = None
        if profiling_wanted():
            self.profiled = Profile()
            atexit.register(self._print_profile)
        self._new_queue()

    @property
    def queue(self) -> Any:
        """The calling thread's queue; an error in a fork, where its driver would wait for ever."""
        if devices.forked:
            devices.require_drivers()
        return self._queues[self.thread.number]

    def _new_queue(self, *, profiled: bool = False) -> int:
        cl = self.cl
        wanted = profiled or self.profiled is not None
        properties = cl.command_queue_properties.PROFILING_ENABLE if wanted else 0
        try:
            queue = cl.CommandQueue(self._context, self._device, properties)
        except cl.Error as exc:
            raise self.failure(exc, "making a command queue") from exc
        with self._queues_lock:
            self._queues_made += 1
            self._queues[self._queues_made] = queue
            return self._queues_made

    @contextlib.contextmanager
    def queue_scope(self, profile: Profile | None = None) -> Iterator[None]:
        """Open an in-order command queue of the calling thread's own for the ``with`` block.

        What was enqueued before is finished first, and what is enqueued inside is finished at
        the end, so buffers may cross the borders of the block. ``profile`` collects the device
        times of what the thread enqueues inside.
        """
        self.finish()
        thread, inner = self.thread, self._new_queue(profiled=profile is not None)
        outer, outer_profile = thread.number, thread.profile
        thread.number, thread.profile = inner, profile
        try:
            yield
        finally:
            thread.number, thread.profile = outer, outer_profile
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
    def background(self, cancelled: Callable[[], bool] = lambda: False) -> Iterator[None]:
        """Work inside the ``with`` block only when no frame is in progress, see `foreground`.

        The calling thread gets a queue of its own. Its launches and copies are cut into pieces
        that take no longer than a turn; each is finished when the call returns. ``cancelled`` is
        asked between pieces: True ends the work with :class:`Cancelled`, from any method.
        """
        with self.queue_scope(), super().background(cancelled):
            yield

    def profile(self) -> list[KernelTime]:
        """Device time per kernel so far; empty unless ``PYVISTA_VDI_PROFILE`` was set."""
        return self.profiled.figures() if self.profiled else []

    def record(self, name: str, event: Any) -> None:
        """Note the time of an enqueued command, if anybody wants it."""
        profile = self.thread.profile or self.profiled
        if profile is not None:
            profile.record(name, event)

    def _print_profile(self) -> None:
        rows = self.profile()
        if rows:
            sys.stderr.write(table(self.info.full_name, rows) + "\n")
