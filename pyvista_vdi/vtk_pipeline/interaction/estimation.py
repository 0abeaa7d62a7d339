"""Estimates of a view's error, made in a thread while frames are drawn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pyvista_vdi.device import Runtime
from pyvista_vdi.model.render_options import RenderOptions
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.view_error import ViewError, ViewErrorEstimator
from pyvista_vdi.quality.worker import Job, Worker
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
        self._worker = Worker("pyvista-vdi estimate")
        self._estimators = Estimators()

    @property
    def running(self) -> bool:
        """Whether an estimate is being made, or is made and has not been taken."""
        return self._worker.job is not None

    def start(
        self, vdi: VDI, request: Request, view: View, options: RenderOptions | None = None
    ) -> None:
        """Begin another, in place of the one before.

        Judged is a VDI in a view, drawn with these options (clipping planes in world coordinates),
        against what it was made of.
        """
        shown, estimators = options or RenderOptions(), self._estimators

        def judge(runtime: Runtime, _: Callable[[float], None]) -> Estimate:
            with runtime.aside():  # loads SciPy, the first time: a quarter of a second
                from skimage.metrics import structural_similarity  # noqa: F401
            error = estimators.of(request, runtime).estimate(
                vdi,
                view.camera,
                view.size,
                clipping_planes=shown.clipping_planes or None,
                cropping=shown.cropping,
                opacity_multiplier=shown.opacity_multiplier,
            )
            return Estimate(vdi, view, error)

        self._worker.put(Job(judge, request.device))

    def take(self) -> Estimate | None:
        """Return the estimate that was finished, or raise what made it fail, once."""
        return self._worker.take()  # type: ignore[no-any-return]

    def cancel(self) -> None:
        """Cancel what is being made."""
        self._worker.clear()

    def close(self) -> None:
        """Cancel, wait for the thread, and let go of the volume."""
        self._worker.clear()
        self._worker.join()
        self._estimators = Estimators()


class Estimators:
    """The estimator of the content that was judged last, which keeps the volume on the device."""

    def __init__(self) -> None:
        self._content: Any = None
        self._estimator: ViewErrorEstimator | None = None

    def of(self, request: Request, runtime: Runtime) -> ViewErrorEstimator:
        """Return the estimator of what a VDI was made of."""
        if self._estimator is None or self._content != request.content:
            self._estimator = None  # its buffers go before others are taken
            self._estimator = ViewErrorEstimator(
                request.volume, request.transfer_function, request.options, device=runtime
            )
            self._content = request.content
        return self._estimator
