"""What is made in the background of a mapper's frames: VDIs, estimates, and the first volume.

The methods are for the thread that draws; the threads that work know nothing of VTK
(:mod:`pyvista_vdi.quality.background`).
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterator
from typing import Any

from pyvista_vdi.device import Runtime
from pyvista_vdi.model.render_options import FrameRequest, RenderOptions
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.view import View
from pyvista_vdi.quality.background import TRIAL_SIZE, BackgroundThread, Job, vdi_job
from pyvista_vdi.quality.plan import ViewEstimate
from pyvista_vdi.quality.rate import FLOOR, reduced
from pyvista_vdi.quality.view_error import ViewError, ViewErrorEstimator
from pyvista_vdi.vtk_pipeline.drawing.frame import Frame
from pyvista_vdi.vtk_pipeline.drawing.images import VolumePicture
from pyvista_vdi.vtk_pipeline.filters.source import Request

#: Pictures that tell what a volume's rays cost, of which the fastest counts: what disturbs one by
#: milliseconds has the volume seem too slow to be drawn, which no frame would ever correct.
_TRIALS = 5


class Estimators:
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
    """The workers of a mapper.

    Attributes
    ----------
    request : Request or None
        What the VDI that is being made is made of.
    estimating, preparing : bool
        Whether an estimate, or the first volume, is being made.
    """

    def __init__(self) -> None:
        self.request: Request | None = None
        self._generation = BackgroundThread("pyvista-vdi generation")
        self._estimation = BackgroundThread("pyvista-vdi estimate")
        self._preparation = BackgroundThread("pyvista-vdi stand-in")
        self._workers = (self._generation, self._estimation, self._preparation)
        self._estimators = Estimators()
        self._prepared = False
        # The threads know the workers alone, so that this can be collected while they work
        finalizer = weakref.finalize(self, _clear, self._workers)
        finalizer.atexit = False  # the workers' own end waits for the threads as well

    @property
    def progress(self) -> float | None:
        """Share done of the VDI that is being made, 0 to 1; ``None`` if none is."""
        return None if self.request is None else self._generation.progress

    @property
    def estimating(self) -> bool:
        """Whether an estimate is being made, or waits to be taken."""
        return self._estimation.job is not None

    @property
    def preparing(self) -> bool:
        """Whether the first volume is being drawn, or what it took waits to be taken."""
        return self._preparation.job is not None

    def finished(self) -> Iterator[tuple[str, Any]]:
        """Yield what was finished since the last time: of what kind, and it or its error."""
        for kind, worker in zip(("vdi", "estimate", "took"), self._workers, strict=True):
            if worker.job is None:
                continue
            try:
                made = worker.take()
            except Exception as error:
                made = error
            if made is not None:
                yield kind, made

    def pause(self, seconds: float) -> None:
        """Leave the machine to a hand that moves, for so long from now on; 0: work on."""
        for worker in self._workers:
            worker.pause(seconds)

    def generate(self, request: Request) -> None:
        """Make a VDI, in place of the one that is being made."""
        self.request = request
        self._generation.put(vdi_job(request.generation, request.target))

    def drop_vdi(self) -> None:
        """Cancel the VDI that is being made."""
        self._generation.clear()
        self.request = None

    def estimate(self, number: int, vdi: VDI, request: Request, view: View, shown: Any) -> None:
        """Estimate the error of a VDI in a view, in place of the estimate before."""
        estimators = self._estimators

        def judge(runtime: Runtime, _: Callable[[float], None]) -> ViewEstimate:
            with runtime.aside():  # loads SciPy, the first time: a quarter of a second
                from skimage.metrics import structural_similarity  # noqa: F401
            error = estimators.estimate(request, runtime, vdi, view, shown)
            return ViewEstimate(number, view, error.ssim, error.contrast)

        self._estimation.put(Job(judge, request.device))

    def drop_estimate(self) -> None:
        """Cancel the estimate that is being made."""
        self._estimation.clear()

    def prepare(self, request: Request) -> None:
        """Draw the volume in vain, once: all is compiled then, and it is known what a ray takes."""
        if self._prepared:
            return
        self._prepared = True

        def draw(runtime: Runtime, _: Callable[[float], None]) -> tuple[float, float]:
            camera, volume = request.screen.camera, VolumePicture(request)
            volume.picture(FrameRequest(camera, (TRIAL_SIZE, TRIAL_SIZE)))
            # By pictures of as many pixels as a preview has at least
            trial = Frame.of(camera, reduced(request.screen.size, FLOOR), volume.bounds)
            taken = []
            for _trial in range(_TRIALS):
                began = runtime.clock()
                volume.picture(FrameRequest(camera, trial.size))
                taken.append(runtime.clock() - began)
            return trial.covered, min(taken)

        self._preparation.put(Job(draw, request.device))

    def forget_volume(self) -> None:
        """Drop volumes on the device."""
        self._estimators = Estimators()
        self._prepared = False

    def close(self) -> None:
        """Cancel everything, and leave no thread."""
        for worker in self._workers:
            worker.clear()
        for worker in self._workers:
            worker.join()
        self.request = None
        self.forget_volume()


def _clear(workers: tuple[BackgroundThread, ...]) -> None:
    for worker in workers:
        worker.clear()
