"""Several VDIs of one scene, shown as one: what extensions derive series and sets from."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI

#: Steps per second at which those of several times are played.
RATE = 24.0


class VDICollection(Sequence[VDI]):
    """Several VDIs of one scene: of several ``times``, ascending, or of several views.

    One of several views has ``parts(camera)``, which returns the VDIs that a view's picture is
    blended of, with weights, the nearest first.
    """

    times: tuple[float, ...] | None = None

    @property
    @abstractmethod
    def camera(self) -> Camera:
        """The view to begin with."""

    @abstractmethod
    def nearest(self, at: Any) -> int:
        """Return the index of the VDI that is nearest to a time, or to a view."""
