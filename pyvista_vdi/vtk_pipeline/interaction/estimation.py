"""Estimates of a view's error, made in a thread while frames are drawn."""

from __future__ import annotations

import atexit
import threading
import traceback
import weakref
from dataclasses import dataclass
from typing import Any

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import Cancelled
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
        self, vdi: VDI, request: Request, view: View, shown: dict[str, Any] | None = None
    ) -> None:
        """Begin another, in place of the one before.

        Parameters
        ----------
        vdi, request, view
            What is judged, what it was made of, and where it is seen from.
        shown : dict, optional
            Clipping planes, cropping and opacity multiplier of the picture: keyword arguments of
            :meth:`ViewErrorEstimator.estimate`.
        """
        self.cancel()
        self._job = _Job(vdi, request, view, shown or {}, self._estimator)
        self._job.start()

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
                job.join()

    def close(self) -> None:
        """Cancel, wait for the thread, and let go of the volume."""
        self.cancel(wait=True)
        self._estimator = None


class _Job(threading.Thread):
    def __init__(
        self,
        vdi: VDI,
        request: Request,
        view: View,
        shown: dict[str, Any],
        estimator: tuple[Request, ViewErrorEstimator] | None,
    ) -> None:
        super().__init__(name="pyvista-vdi estimate", daemon=True)
        self._vdi = vdi
        self._request = request
        self._view = view
        self._shown = shown
        self.estimator = estimator
        self.cancelled = threading.Event()
        self.done = threading.Event()
        self.estimate: Estimate | None = None
        self.failure: BaseException | None = None
        _jobs.add(self)

    def run(self) -> None:
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
        request = self._request
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
                self._vdi, self._view.camera, self._view.size, **self._shown
            )
        self.estimate = Estimate(self._vdi, self._view, error)


_jobs: weakref.WeakSet[_Job] = weakref.WeakSet()


@atexit.register
def _end_all() -> None:
    """End every thread before drivers are unloaded."""
    jobs = list(_jobs)
    for job in jobs:
        job.cancelled.set()
    for job in jobs:
        job.join()
