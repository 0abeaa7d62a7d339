"""What a :class:`VDIMapper` draws: a VDI as it is, or what a pipeline makes."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.inputs import as_vdi
from pyvista_vdi.model.vdi import VDI, DeferredVDI
from pyvista_vdi.raycasting.classified_values import classify_on_device
from pyvista_vdi.vtk_pipeline.filters.algorithm import wanted_time
from pyvista_vdi.vtk_pipeline.filters.convert import vdi_from_image
from pyvista_vdi.vtk_pipeline.filters.properties import transfer_function_from_property
from pyvista_vdi.vtk_pipeline.filters.view import View, camera_of


class Input:
    """A VDI, or what an algorithm's port has; and what others do who show several, or make them."""

    #: The series or the set whose VDIs are shown.
    collection: VDICollection | None = None
    #: What chooses among the steps of a series and plays them: see ``extensions.series.shown``.
    player: Any = None
    #: The values that the VDI is classified from; ``None`` where none are kept.
    deferred: DeferredVDI | None = None
    #: The volume property that classifies values, where they are kept.
    prop: Any = None
    #: The port of what the bounds depend on; ``None`` where they depend on nothing.
    port: Any = None
    #: Whether the player shows one step of a series after the other: the event loop has to look at
    #: that.
    playing = False

    def __init__(self, vdi: VDI | None = None, port: Any = None) -> None:
        #: The VDI made last.
        self.last = vdi
        #: What draws it.
        self.drivers: weakref.WeakSet[Any] = weakref.WeakSet()
        if port is not None:  # of canonical images
            self.port, self._producer = port, port.GetProducer()  # which a port does not keep
        self._read_at: int | None = None

    def vdi(self) -> VDI | None:
        """Return the VDI, brought up to date; raises what went wrong."""
        if self.port is not None:
            self._producer.Update(self.port.GetIndex())
            image = self._producer.GetOutputDataObject(self.port.GetIndex())
            if self.last is None or self._read_at != image.GetMTime():
                self.last, self._read_at = as_vdi(vdi_from_image(image)), image.GetMTime()
        return self.last

    def bounds(self) -> tuple[float, ...] | None:
        """Return the bounds in the model frame, without making a VDI of a volume."""
        vdi = self.vdi()
        return None if vdi is None else vdi.bounds

    def stamp(self) -> Any:
        """Return something that changes whenever it is worth trying again."""
        if self.port is None:
            return None if self.last is None else id(self.last)
        self._producer.UpdateInformation()
        time = wanted_time(self._producer.GetOutputInformation(self.port.GetIndex()))
        return self._producer.GetMTime(), time

    def note_scene(self, renderers: Sequence[Any], model_transform: NDArray[np.float64]) -> None:
        """Note the renderers that show it, for their lights, and the actor's matrix, (4, 4)."""

    def set_view_if_missing(
        self, camera: Any, size: tuple[int, int], model_transform: NDArray[np.float64]
    ) -> None:
        """Take the view of a frame as the generating view, if there is none yet."""

    def on_devices(self) -> list[Any]:
        """Return the VDIs, values and volumes that devices may hold because of this."""
        return [self.last]

    def tell(self) -> None:
        """Tell what draws it that what is before it may be another, or that it plays."""
        for driver in self.drivers:
            driver.changed()

    def rest(self) -> None:
        """End what goes on in the background, which may begin anew."""

    def look(self, camera: Camera, device: Any) -> None:
        """Choose what a view shows, before a frame."""

    def parts(self) -> list[tuple[VDI, float]]:
        """Return the VDIs that a picture is blended of, with weights; none for one."""
        return []


class DeferredInput(Input):
    """Values that a volume property classifies, anew when it has changed; no volume is needed.

    Values that are not made yet are what ``values`` returns for the first view that there is, or
    that of the ``camera``; their ``bounds`` are known before.
    """

    def __init__(
        self,
        values: DeferredVDI | Callable[[View], DeferredVDI],
        prop: Any,
        bounds: tuple[float, ...] | None = None,
        camera: Camera | None = None,
    ) -> None:
        super().__init__()
        self.prop, self._values, self._bounds, self._camera = prop, values, bounds, camera
        self._view: View | None = None
        self._made_at: Any = None

    @property
    def deferred(self) -> DeferredVDI | None:  # type: ignore[override]
        """The values, made now if they are not yet; ``None`` without a view to make them of."""
        if not isinstance(self._values, DeferredVDI):
            if self._view is None:
                return None
            self._values = self._values(self._view)
        return self._values

    def set_view_if_missing(
        self, camera: Any, size: tuple[int, int], model_transform: NDArray[np.float64]
    ) -> None:
        """Take the view of a frame, or a camera that was given, as that of the values."""
        if self._view is None:
            given = self._camera or camera_of(camera, model_transform)
            self._view = View(given.replace(model_transform=model_transform), size)

    def on_devices(self) -> list[Any]:
        """Return the VDI and its values."""
        return [] if self.last is None else [self.last, self.deferred]

    def vdi(self) -> VDI | None:
        """Return the VDI that the property makes of the values now; ``None`` without a view."""
        values, stamp = self.deferred, self.stamp()
        if values is not None and (self.last is None or self._made_at != stamp):
            self.last = classify_on_device(values, transfer_function_from_property(self.prop))
            self._made_at = stamp
        return self.last

    def bounds(self) -> tuple[float, ...] | None:
        """Return the bounds in the model frame."""
        return self._values.bounds if isinstance(self._values, DeferredVDI) else self._bounds

    def stamp(self) -> Any:
        """Return the time stamp of the property and its functions."""
        return self.prop.GetMTime()
