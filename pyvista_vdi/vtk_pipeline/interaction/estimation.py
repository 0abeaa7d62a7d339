"""Estimates of a view's error, made in a thread while frames are drawn."""

from __future__ import annotations

import atexit
import threading
import traceback
import weakref
from dataclasses import dataclass, field

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import Cancelled
from pyvista_vdi.model.render_options import RenderOptions
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.view_error import ViewError, ViewErrorEstimator
from pyvista_vdi.vtk_pipeline.filters.source import Request
from pyvista_vdi.vtk_pipeline.filters.view import View


@dataclass(frozen=True)
class Estimate:
    """What was found of a VDI in a view."""

    vdi: VDI
    view: View
    error: ViewError


class Estimation:
    """Makes one estimate at a time, giving way to frames as a background generation does.

    Its methods are for the thread that draws. The thread that works knows nothing of VTK.
    """

    def __init__(self) -> None:
        self._job: _Job | None = None
        self._estimator: tuple[Request, ViewErrorEstimator] | None = None

    @property
    def running(self) -> bool:
        """Whether an estimate is being made, or is made and has not been taken."""
        return self._job is not None

    def start(
        self, vdi: VDI, request: Request, view: View, options: RenderOptions | None = None
    ) -> None:
        """Begin another, in place of the one before.

        Judged is a VDI in a view, drawn with these options (clipping planes in world coordinates),
        against what it was made of.
        """
        self.cancel()
        self._job = _Job(vdi, request, view, options or RenderOptions(), self._estimator)
        _jobs.add(self._job)
        self._job.thread.start()

    def take(self) -> Estimate | None:
        """Return the estimate that was finished, once.

        Raises
        ------
        VDIError, Exception
            What made it fail, once.
        """
        job = self._job
        if job is None or not job.done.is_set():
            return None
        self._job = None
        self._estimator = job.estimator
        if job.failure is not None:
            raise job.failure
        return job.estimate

    def cancel(self, *, wait: bool = False) -> None:
        """Give up what is being made."""
        job, self._job = self._job, None
        if job is not None:
            job.cancelled.set()
            if wait:
                job.thread.join()

    def close(self) -> None:
        """Cancel, wait for the thread, and let go of the volume."""
        self.cancel(wait=True)
        self._estimator = None


@dataclass(eq=False)
class _Job:
    """One estimate, and the thread that makes it."""

    vdi: VDI
    request: Request
    view: View
    options: RenderOptions
    estimator: tuple[Request, ViewErrorEstimator] | None
    cancelled: threading.Event = field(default_factory=threading.Event)
    done: threading.Event = field(default_factory=threading.Event)
    estimate: Estimate | None = None
    failure: BaseException | None = None

    def __post_init__(self) -> None:
        self.thread = threading.Thread(target=self._run, name="pyvista-vdi estimate", daemon=True)

    def _run(self) -> None:
        try:
            self._work()
        except Cancelled:
            pass
        except BaseException as error:  # take() raises it where somebody can act on it
            traceback.clear_frames(error.__traceback__)  # they hold buffers
            self.failure = error
        finally:
            self.done.set()

    def _work(self) -> None:
        request, options = self.request, self.options
        runtime = get_runtime(request.settings["device"])
        with runtime.background(self.cancelled.is_set):
            if self.estimator is None or self.estimator[0].content != request.content:
                self.estimator = None  # its buffers go before others are taken
                estimator = ViewErrorEstimator(
                    request.volume,
                    request.transfer_function,
                    sample_distance=request.settings["sample_distance"],
                    lights=request.settings["lights"],
                    ambient_occlusion=request.settings["ambient_occlusion"],
                    memory_limit=request.settings["memory_limit"],
                    device=runtime,
                )
                self.estimator = (request, estimator)
            error = self.estimator[1].estimate(
                self.vdi,
                self.view.camera,
                self.view.size,
                clipping_planes=options.clipping_planes or None,
                cropping=options.cropping,
                opacity_multiplier=options.opacity_multiplier,
            )
        self.estimate = Estimate(self.vdi, self.view, error)


_jobs: weakref.WeakSet[_Job] = weakref.WeakSet()


@atexit.register
def _end_all() -> None:
    """End every thread before drivers are unloaded."""
    jobs = list(_jobs)
    for job in jobs:
        job.cancelled.set()
    for job in jobs:
        job.thread.join()
