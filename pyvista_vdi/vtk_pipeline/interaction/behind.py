"""What is made behind the frames of a mapper: VDIs, estimates, and what comes next is prepared.

Each has a worker; the methods are for the thread that draws. The threads that work know nothing of
VTK (:mod:`pyvista_vdi.quality.worker`).
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from typing import Any

from pyvista_vdi.device import Runtime
from pyvista_vdi.errors import VDIError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.view import View
from pyvista_vdi.quality.background import BackgroundGeneration
from pyvista_vdi.quality.frame_state import (
    Estimate,
    EstimateReady,
    Event,
    Failed,
    FrameTook,
    VDIReady,
)
from pyvista_vdi.quality.view_error import ViewError, ViewErrorEstimator
from pyvista_vdi.quality.worker import Job, Worker
from pyvista_vdi.raycasting.prepared import prepared_vdi
from pyvista_vdi.vtk_pipeline.filters.source import Request
from pyvista_vdi.vtk_pipeline.interaction.fewer_lists import lists_crossed, subsampled_lists

_log = logging.getLogger(__name__)

#: Lists that rays must cross along an edge for fewer of them to be worth it. Near V_O a ray's cost
#: is not that of the lists.
_OBLIQUE = 16.0


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
        return self._estimator.estimate(
            vdi,
            view.camera,
            view.size,
            clipping_planes=shown.clipping_planes or None,
            cropping=shown.cropping,
            opacity_multiplier=shown.opacity_multiplier,
            **more,
        )


class Behind:
    """The workers of a mapper, and what they have made.

    Attributes
    ----------
    vdi, request
        The VDI that was made last, and what of, as long as nobody has taken it.
    """

    def __init__(self) -> None:
        self.vdi: VDI | None = None
        self.request: Request | None = None
        self._generation: BackgroundGeneration | None = None
        self._device: Any = None
        self._estimation = Worker("pyvista-vdi estimate")
        self._estimators = Estimators()
        self._preparation = Worker("pyvista-vdi stand-in")
        self._prepared: Any = None  # content
        self._thinning = Worker("pyvista-vdi few lists")
        self._few: dict[tuple[int, int], VDI | None] = {}  # None: it cannot be made
        self._few_of = 0

    @property
    def progress(self) -> float | None:
        """Share done of the VDI that is being made, 0 to 1; ``None`` if none is."""
        return None if self._generation is None else self._generation.progress

    def finished(self) -> Iterator[Event]:
        """Yield what was finished, or has failed, since the last time."""
        took = None if self._preparation.job is None else self._taken(self._preparation)
        if isinstance(took, FrameTook):
            yield took
        made = None if self._estimation.job is None else self._taken(self._estimation)
        if made is not None:
            yield Failed(made) if isinstance(made, BaseException) else EstimateReady(made)
        vdi = None if self._generation is None else self._taken(self._generation)
        if vdi is not None:
            self.vdi = vdi
            yield Failed(vdi) if isinstance(vdi, BaseException) else VDIReady()
            self.vdi = self.request = None

    @staticmethod
    def _taken(worker: Any) -> Any:
        """Return what was made, or why not; None where nothing is ready."""
        try:
            return worker.take()
        except Exception as error:
            return error

    def generate(self, request: Request) -> None:
        """Make a VDI, in place of the one that is being made."""
        if self._generation is None or request.device != self._device:
            if self._generation is not None:
                self._generation.close()
            self._generation = BackgroundGeneration(request.device)
            self._device = request.device
        self.request = request
        self._generation.start(request.generation, key=request.key, target=request.target)

    def drop_vdi(self) -> None:
        """Cancel the VDI that is being made."""
        if self._generation is not None:
            self._generation.cancel()
        self.request = None

    def estimate(self, number: int, vdi: VDI, request: Request, view: View, shown: Any) -> None:
        """Estimate the error of a VDI in a view, in place of the estimate before."""
        estimators = self._estimators

        def judge(runtime: Runtime, _: Callable[[float], None]) -> Estimate:
            with runtime.aside():  # loads SciPy, the first time: a quarter of a second
                from skimage.metrics import structural_similarity  # noqa: F401
            error = estimators.estimate(request, runtime, vdi, view, shown)
            return Estimate(number, view, error.ssim, error.contrast)

        self._estimation.put(Job(judge, request.device))

    def drop_estimate(self) -> None:
        """Cancel the estimate that is being made."""
        self._estimation.clear()

    def prepare(self, request: Request, draw: Callable[[Runtime], FrameTook | None]) -> None:
        """Draw something in vain, once for each volume and look."""
        if self._prepared is None or self._prepared != request.content:
            self._prepared = request.content
            self._preparation.put(Job(lambda runtime, _: draw(runtime) or True, request.device))

    def fewer_lists(self, number: int, vdi: VDI, camera: Camera, device: Any) -> VDI | None:
        """Return a VDI of every second list, if there is one already; else have it made.

        Along those edges that most lists are crossed along in a view: the other edge's lists cost
        little and show. ``None`` also near V_O.
        """
        if self._few_of != number:
            self._thinning.clear()
            self._few.clear()
            self._few_of = number
        crossed = lists_crossed(vdi, camera)
        if crossed.max() < _OBLIQUE:
            return None
        x, y = (2 if many >= crossed.max() / 2 else 1 for many in crossed)
        if x > vdi.window_size[0] or y > vdi.window_size[1]:
            return None
        if (x, y) not in self._few and not self._thinning.running:
            job = self._thinning.job
            if job is not None:
                made = self._taken(self._thinning)
                if isinstance(made, Exception):
                    _log.debug("fewer lists cannot be had", exc_info=made)
                    if not isinstance(made, VDIError):
                        raise made
                self._few[job.key] = made if isinstance(made, VDI) else None  # type: ignore[index]
            if (x, y) not in self._few:

                def make(runtime: Runtime, _: Callable[[float], None]) -> VDI:
                    with runtime.aside():  # hundreds of milliseconds where lists are many
                        made = subsampled_lists(vdi, x, y)
                    prepared_vdi(runtime, made)  # on the device before a frame waits for it
                    return made

                self._thinning.put(Job(make, device, (x, y)))
        return self._few.get((x, y))

    def forget_volume(self) -> None:
        """Drop volumes on the device."""
        self._estimators = Estimators()
        self._prepared = None

    def close(self) -> None:
        """Cancel everything, and leave no thread."""
        if self._generation is not None:
            self._generation.close()
            self._generation = None
        for worker in (self._estimation, self._preparation, self._thinning):
            worker.clear()
            worker.join()
        self._few.clear()
        self._few_of = 0
        self.request = None
        self.forget_volume()
