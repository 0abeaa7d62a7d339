"""Volumes far from the origin: VTK places the box that it draws in their stead in float32."""

from __future__ import annotations

from typing import Any

import numpy as np

from pyvista_vdi.model.coverage import bounds_corners
from pyvista_vdi.vtk_pipeline.drawing.shader import fill_viewport
from pyvista_vdi.vtk_pipeline.filters.view import as_array

#: Diagonals from the origin beyond which a box fills the viewport instead: float32 rounds its
#: corners by a pixel in ten thousand there, and by more beyond.
_FAR = 1000.0

#: Edge of the box that VTK draws then, about the origin: so small that no eye is inside.
_EDGE = 2e-3


class FarBox:
    """Has VTK draw the whole viewport while a frame shows what is far from the origin.

    The image that is looked up is of the viewport, and transparent beside the VDI. Between frames
    the proxy has the VDI's bounds, which VTK's cameras, pickers and widgets ask for.
    """

    def __init__(self) -> None:
        self._place: tuple[Any, Any] | None = None

    def begin(self, actor: Any, proxy: Any) -> None:
        """Put a box that float32 can place in the proxy's stead, if that is far."""
        self.end(proxy)  # of a frame that VTK has broken off
        far = actor is not None and _is_far(as_array(actor.GetMatrix()), proxy.GetBounds())
        if actor is not None:
            fill_viewport(actor, _EDGE if far else None)
        if far:
            self._place = proxy.GetOrigin(), proxy.GetSpacing()
            proxy.SetOrigin([-_EDGE / 2] * 3)
            proxy.SetSpacing([_EDGE] * 3)

    def end(self, proxy: Any) -> None:
        """Put the proxy back."""
        if self._place is not None:
            origin, spacing = self._place
            self._place = None
            proxy.SetOrigin(origin)
            proxy.SetSpacing(spacing)


def _is_far(matrix: Any, bounds: Any) -> bool:
    """Whether a box is far from the origin of the model frame, or of the world."""
    model = bounds_corners(bounds)
    world = model @ matrix[:3, :3].T + matrix[:3, 3]
    return any(
        np.abs(at).max() > _FAR * np.linalg.norm(np.ptp(at, axis=0)) for at in (model, world)
    )
