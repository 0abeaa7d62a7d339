"""A new VDI made in a thread of its own while frames of the old one are drawn."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Hashable
from typing import Any

from pyvista_vdi.device import Runtime
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.options import GenerationRequest, QualityTarget
from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.worker import Job, Worker
from pyvista_vdi.raycasting.raycast import render_vdi

#: Pixels along each edge of the frame that a new VDI is tried with: what the first real frame
#: would have to compile and upload is there then.
TRIAL_SIZE = 8


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
        self._device = device
        # The thread knows only the worker, so that this object can be collected while it works
        self._worker = Worker("pyvista-vdi generation", weakref.WeakMethod(self._notify))
        self._finalizer = weakref.finalize(self, self._worker.clear)
        self._finalizer.atexit = False  # the workers' own end waits for the threads as well

    def start(
        self,
        request: GenerationRequest,
        *,
        key: Hashable = None,
        target: QualityTarget | None = None,
    ) -> None:
        """Make a VDI, in place of whatever is being made or was not taken yet.

        Parameters
        ----------
        request : GenerationRequest
            What is asked for; device and progress are this object's. The volume's values must stay
            until the VDI is finished or cancelled with ``wait=True``.
        key : hashable
            What the VDI is for; see :attr:`key`.
        target : QualityTarget, optional
            Chooses the window, max_supersegments and precision.

        Raises
        ------
        RuntimeError
            After :meth:`close`.
        """

        def make(runtime: Runtime, report: Callable[[float], None]) -> VDI:
            here = request.replace(device=runtime, progress=report)
            if target:
                from pyvista_vdi.quality.probe import generate_to_target

                vdi = generate_to_target(here, target)
            else:
                vdi = generate_vdi(here)
            trial = FrameRequest(vdi.camera, (TRIAL_SIZE, TRIAL_SIZE), device=runtime)
            render_vdi(vdi, trial)
            return vdi

        self._worker.put(Job(make, self._device, key))

    def cancel(self, *, wait: bool = False) -> None:
        """Cancel what is being made, and drop what was made and not taken.

        Parameters
        ----------
        wait : bool
            Return only when the thread has ended; the volume may change then.
        """
        self._worker.clear()
        if wait:
            self._worker.join()

    def close(self) -> None:
        """Cancel, and wait for the thread; a second call does nothing."""
        self._worker.close()
        self._worker.join()

    def __enter__(self) -> BackgroundGeneration:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def take(self) -> VDI | None:
        """Return the VDI that was finished, once; None where there is none.

        It is on the device already: the next frame can be its first.

        Raises
        ------
        VDIError, Exception
            What made the generation fail, once.
        """
        return self._worker.take()  # type: ignore[no-any-return]

    @property
    def running(self) -> bool:
        """Whether a VDI is being made or waits to be."""
        return self._worker.running

    @property
    def key(self) -> Hashable:
        """The key of what is being made, or was made and not taken; None if there is nothing."""
        job = self._worker.job
        return None if job is None else job.key

    @property
    def progress(self) -> float | None:
        """Fraction of the lists made, 0 to 1; 1 also while they go to the device.

        None when nothing is being made.
        """
        job = self._worker.job
        return job.progress if job is not None and self.running else None

    def _notify(self) -> None:
        if self._on_finished is not None:
            self._on_finished()


__all__ = ["BackgroundGeneration"]
