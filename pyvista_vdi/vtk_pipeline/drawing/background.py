"""What is made in the background of a mapper's frames: one thing at a time, by one thread.

The methods are for the thread that draws; the thread that works knows nothing of VTK
(:mod:`pyvista_vdi.quality.background`).
"""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import Any, Literal

from pyvista_vdi.device import Runtime
from pyvista_vdi.model.render_options import RenderOptions
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.view import View
from pyvista_vdi.quality.background import BackgroundThread, Job, vdi_job
from pyvista_vdi.quality.plan import ViewEstimate
from pyvista_vdi.quality.view_error import ViewError, ViewErrorEstimator
from pyvista_vdi.vtk_pipeline.filters.source import Request


class Estimator:
    """The estimator of the content that was judged last, which keeps the volume on the device."""

    def __init__(self) -> None:
        self._content: Any = None
        self._estimator: ViewErrorEstimator | None = None

    def estimate(
        self, request: Request, runtime: Runtime, vdi: VDI, view: View, shown: Any, **more: Any
    ) -> ViewError:
        """Judge a VDI in a view, drawn with these options, against what it was made of."""
        if self._estimator is None or self._content != request.content:
            self._estimator = None  # its buffers go before others are taken
            self._estimator = ViewErrorEstimator(
                request.volume, request.transfer_function, request.options, device=runtime
            )
            self._content = request.content
        options = RenderOptions(
            shown.clipping_planes or None, shown.cropping, shown.opacity_multiplier
        )
        return self._estimator.estimate(vdi, view.camera, view.size, options, **more)


class Background:
    """The worker of a mapper.

    Attributes
    ----------
    kind : {"vdi", "estimate"} or None
        What is being made, or waits to be taken.
    request : Request or None
        What that is made of.
    """

    def __init__(self) -> None:
        self.kind: Literal["vdi", "estimate"] | None = None
        self.request: Request | None = None
        self._worker = BackgroundThread("pyvista-vdi generation")
        # The thread knows the worker alone, so that this can be collected while it works
        finalizer = weakref.finalize(self, self._worker.clear)
        finalizer.atexit = False  # the worker's own end waits for the thread as well

    @property
    def progress(self) -> float | None:
        """Share done of the VDI that is being made, 0 to 1; ``None`` if none is."""
        return self._worker.progress if self.kind == "vdi" else None

    def finished(self) -> tuple[str, Any, Request] | None:
        """Return what was finished: of what kind, it or its error, and what it was made of."""
        if self.kind is None or self.request is None:
            return None
        try:
            made = self._worker.take()
        except Exception as error:
            made = error
        if made is None:
            return None
        done, self.kind, self.request = (self.kind, made, self.request), None, None
        return done

    def pause(self, seconds: float) -> None:
        """Leave the machine to a hand that moves, for so long from now on; 0: work on."""
        self._worker.pause(seconds)

    def drop(self) -> None:
        """Cancel what is being made."""
        self._worker.clear()
        self.kind = self.request = None

    def close(self) -> None:
        """Cancel it, and leave no thread."""
        self.drop()
        self._worker.join()

    def generate(self, request: Request) -> None:
        """Make a VDI, in place of what is being made."""
        self._put("vdi", request, vdi_job(request.generation, request.target))

    def estimate(
        self, by: Estimator, number: int, vdi: VDI, request: Request, view: View, shown: Any
    ) -> None:
        """ViewEstimate the error of a VDI in a view."""

        def judge(runtime: Runtime, _: Callable[[float], None]) -> ViewEstimate:
            with runtime.aside():  # loads SciPy, the first time: a quarter of a second
                from skimage.metrics import structural_similarity  # noqa: F401
            error = by.estimate(request, runtime, vdi, view, shown)
            return ViewEstimate(number, view, error.ssim, error.contrast)

        self._put("estimate", request, Job(judge, request.device))

    def _put(self, kind: Any, request: Request, job: Job) -> None:
        self.kind, self.request = kind, request
        self._worker.put(job)
