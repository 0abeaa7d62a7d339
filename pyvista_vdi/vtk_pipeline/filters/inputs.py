"""What a :class:`VDIMapper` draws: a VDI as it is, or what a pipeline makes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi import registry
from pyvista_vdi.errors import InvalidVDIError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.inputs import as_vdi
from pyvista_vdi.model.vdi import VDI, DeferredVDI
from pyvista_vdi.raycasting.classified_values import classify_on_device
from pyvista_vdi.vtk_pipeline.filters.algorithm import wanted_time
from pyvista_vdi.vtk_pipeline.filters.convert import is_vdi_image, vdi_from_image
from pyvista_vdi.vtk_pipeline.filters.properties import transfer_function_from_property
from pyvista_vdi.vtk_pipeline.filters.source import Request, VDISource
from pyvista_vdi.vtk_pipeline.filters.view import View, camera_of
from pyvista_vdi.vtk_pipeline.vtk import vtkImageData

#: What two equal sizes of pixels differ by at most.
ROUNDING = 1e-6


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
    #: Milliseconds between two looks of the event loop at what goes on; ``None``: as usual.
    period: int | None = None
    #: Whether one step of a series is shown after the other: the event loop has to look at that.
    playing = False

    def __init__(self, vdi: VDI | None = None, port: Any = None) -> None:
        self._vdi = vdi
        if port is not None:  # of canonical images
            self.port, self._producer = port, port.GetProducer()  # which a port does not keep
        self._read_at: int | None = None

    def vdi(self) -> VDI | None:
        """Return the VDI, brought up to date; raises what went wrong."""
        if self.port is not None:
            self._producer.Update(self.port.GetIndex())
            image = self._producer.GetOutputDataObject(self.port.GetIndex())
            if self._vdi is None or self._read_at != image.GetMTime():
                self._vdi, self._read_at = as_vdi(vdi_from_image(image)), image.GetMTime()
        return self._vdi

    def last(self) -> VDI | None:
        """Return the VDI made last."""
        return self._vdi

    def bounds(self) -> tuple[float, ...] | None:
        """Return the bounds in the model frame, without making a VDI of a volume."""
        vdi = self.vdi()
        return None if vdi is None else vdi.bounds

    def stamp(self) -> Any:
        """Return something that changes whenever it is worth trying again."""
        if self.port is None:
            return None if self._vdi is None else id(self._vdi)
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
        return [self._vdi]

    def shared(self) -> Input:
        """Return an input of the same VDI for another mapper."""
        return self

    def watch(self, changed: Callable[..., Any] | None) -> None:
        """Call this when what is before it may be another; ``None`` ends it."""

    def classified_by(self, prop: Any) -> Input:
        """Return an input whose values, where they are kept, another property classifies."""
        return self

    def rest(self) -> None:
        """End what goes on in the background, which may begin anew."""

    def look(self, camera: Camera, device: Any) -> None:
        """Choose what a view shows, before a frame."""

    def advance(self) -> bool | None:
        """Take what is due between two frames; whether there is another VDI to be drawn.

        ``None`` where nothing goes on by itself.
        """
        return None

    def parts(self) -> list[tuple[VDI, float]]:
        """Return the VDIs that a picture is blended of, with weights; none for one."""
        return []


class SourceInput(Input):
    """What a :class:`VDISource` makes."""

    #: Whether it is lit by whatever renderer shows it, and stands where its actor does in the world
    #: of a camera that was given: what ``add_vdi`` adds.
    of_scene = False

    def __init__(self, source: VDISource) -> None:
        super().__init__()
        self.source = source
        self._tag: int | None = None
        self._camera: Camera | None = None  # what frames gave, which nobody has set
        self._size: tuple[int, int] | None = None

    def shared(self) -> SourceInput:
        """Return an input from a source of its own, with the same settings and VDI."""
        other = SourceInput(self.source.Copy())
        other._camera, other._size, other.of_scene = self._camera, self._size, self.of_scene
        return other

    def watch(self, changed: Callable[..., Any] | None) -> None:
        """Call back when the source has been modified."""
        if self._tag is not None:
            self.source.RemoveObserver(self._tag)
            self._tag = None
            self.source.inputs.discard(self)
        if changed is not None:
            self._tag = self.source.AddObserver("ModifiedEvent", changed)
            self.source.inputs.add(self)

    @property
    def alone(self) -> bool:
        """Whether no other mapper draws what the source makes."""
        return len(self.source.inputs) == 1

    def vdi(self) -> VDI | None:
        """Return the VDI of the data at the source's input, brought up to date."""
        return self.source.UpdateFromInput()

    def last(self) -> VDI | None:
        """Return the VDI made last."""
        return self.source.GetCurrentVDI()

    @property
    def port(self) -> Any:  # type: ignore[override]
        """The port that the volume comes from."""
        connected = self.source.GetNumberOfInputConnections(0) > 0
        return self.source.GetInputConnection(0, 0) if connected else None

    def bounds(self) -> tuple[float, ...] | None:
        """Return the bounds of the volume, brought up to date; ``None`` where there is none.

        VTK's mappers do so, too, because many filters announce other bounds than they give.
        """
        data: Any = None if self.port is None else self.source.UpdateInput()
        known = isinstance(data, vtkImageData) and data.GetNumberOfPoints() > 0
        return tuple(data.GetBounds()) if known else None

    def stamp(self) -> Any:
        """Return the time stamps of all that it depends on, and a shaded volume's lights."""
        source, prop = self.source, self.source.GetVolumeProperty()
        data = None if self.port is None else source.UpdateInput()
        stamps = [thing and thing.GetMTime() for thing in (source, data, prop)]
        lights = source.GetLights() if prop is not None and prop.GetShade() else None
        return *stamps, lights, source.placed if lights and lights.of_scene else None

    def note_scene(self, renderers: Sequence[Any], model_transform: NDArray[np.float64]) -> None:
        """Note a renderer that shows it, for its lights, unless none does, and where it stands."""
        source, lit_by = self.source, self.source.lit_by.Get()
        known = any(renderer is lit_by for renderer in renderers)
        if self.of_scene and not known and (self.alone or lit_by is None):
            source.lit_by.Set(renderers[0] if renderers else None)
        if self.alone:
            source.placed = tuple(map(tuple, model_transform.tolist()))

    def keep_lights(self, closed: Sequence[Any]) -> None:
        """Keep the lights of the renderer that lights it, if that is one of those that close."""
        lit_by = self.source.lit_by.Get()
        if self.of_scene and any(renderer is lit_by for renderer in closed):
            self.source.GetLights()
            self.source.lit_by.Set(None)

    @property
    def has_view(self) -> bool:
        """Whether somebody, or a frame, has given a view to make the VDI of."""
        return self.source.GetCamera() is not None and self.source.GetWindowSize() is not None

    def view_is_chosen(self, wanted: Request | None, made: Request | None) -> bool:
        """Whether somebody has chosen the view: since the last VDI, or for the first one."""
        if made is None or wanted is None:
            return made is None and self.source.GetCamera() is not self._camera
        return bool(wanted.key != made.key and wanted.screen != made.screen)

    def set_view_if_missing(
        self, camera: Any, size: tuple[int, int], model_transform: NDArray[np.float64]
    ) -> None:
        """Take a renderer's view, unless nothing can be drawn from it; this raises why not."""
        source = self.source
        if not self.has_view:
            source.MakeRequest(self.view_for(camera, size, model_transform))
        given = source.GetCamera()
        if given is None:
            self.take_camera(camera, model_transform)
        elif self.of_scene and self._camera is None and source.GetCurrentRequest() is None:
            # One that was given with the volume
            source.SetCamera(given.replace(model_transform=model_transform))
        if source.GetWindowSize() is None:
            self.take_size(size)

    def view_for(
        self, camera: Any, size: tuple[int, int], model_transform: NDArray[np.float64]
    ) -> View:
        """Return the view that a VDI is made of where a renderer has this one."""
        given = self.source.GetCamera()
        if given is None:
            given = camera_of(camera, model_transform)
        elif self.of_scene:
            given = given.replace(model_transform=model_transform)
        return View(given, self.source.GetWindowSize() or size)

    def exact_request(self, view: View) -> Request:
        """Return what a VDI of exactly a view's picture is made of.

        What covers all of a volume that is near would have larger lists than that has pixels.
        """
        wanted = self.source.MakeRequest(view)
        camera, size, lists = view.camera, view.size, wanted.window_size
        extents = zip(wanted.camera.half_extent(lists), camera.half_extent(size), strict=True)
        pixels = math.prod(size) * math.prod(high / low for high, low in extents)
        if pixels > math.prod(lists) * (1 + ROUNDING):
            wanted = wanted.seen_from(camera, size)
        return wanted

    def take_camera(self, camera: Any, model_transform: NDArray[np.float64]) -> None:
        """Set a renderer's view as that of the next VDI."""
        self.source.SetCamera(camera, model_transform)
        self._camera = self.source.GetCamera()

    def take_size(self, size: tuple[int, int]) -> None:
        """Set a renderer's window as that of the next VDI."""
        self.source.SetWindowSize(size)
        self._size = self.source.GetWindowSize()

    def follow_if_changed(
        self, camera: Any, size: tuple[int, int], model_transform: NDArray[np.float64]
    ) -> None:
        """Take a renderer's view if what the VDI was made of has changed since, the view apart.

        What somebody has set, the camera or the window's size, stays.
        """
        made, source = self.source.GetCurrentRequest(), self.source
        if made is None or self._camera is None or source.GetCamera() is not self._camera:
            return
        if source.MakeRequest().content != made.content:
            self.take_camera(camera, model_transform)
            if source.GetWindowSize() == self._size:
                self.take_size(size)

    def on_devices(self) -> list[Any]:
        """Return the VDI, and the volume that it was made of."""
        made = self.source.GetCurrentRequest()
        return [self.last(), None if made is None else made.volume]


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
        return [] if self._vdi is None else [self._vdi, self.deferred]

    def vdi(self) -> VDI | None:
        """Return the VDI that the property makes of the values now; ``None`` without a view."""
        values, stamp = self.deferred, self.stamp()
        if values is not None and (self._vdi is None or self._made_at != stamp):
            self._vdi = classify_on_device(values, transfer_function_from_property(self.prop))
            self._made_at = stamp
        return self._vdi

    def classified_by(self, prop: Any) -> Input:
        """Return one of the same values: whoever shares this one keeps the property."""
        other = DeferredInput(self._values, prop, self._bounds, self._camera)
        other._view = self._view
        return other

    def bounds(self) -> tuple[float, ...] | None:
        """Return the bounds in the model frame."""
        return self._values.bounds if isinstance(self._values, DeferredVDI) else self._bounds

    def stamp(self) -> Any:
        """Return the time stamp of the property and its functions."""
        return self.prop.GetMTime()


def input_of(data: Any) -> Input:
    """Return what to draw for a VDI, an image of one, a VDISource, or what extensions show."""
    if isinstance(data, VDI):
        return Input(data)
    if isinstance(data, DeferredInput):
        return data
    if isinstance(data, VDISource):
        return SourceInput(data)
    if isinstance(data, DeferredVDI) or is_vdi_image(data):
        # Of values this raises, and says what to do
        return Input(as_vdi(data if isinstance(data, DeferredVDI) else vdi_from_image(data)))
    show = registry.shown(data)
    if show is not None:
        return show(data)  # type: ignore[no-any-return]
    raise InvalidVDIError(
        f"a VDIMapper draws a VDI, its canonical image, a series, a set or a VDISource's output; "
        f"got {type(data).__name__}: put a VDISource between a volume and the mapper"
    )


def input_of_port(port: Any) -> Input:
    """Return what to draw for an output port."""
    producer = port.GetProducer()
    if isinstance(producer, VDISource):
        return SourceInput(producer)
    shown = Input(port=port)
    shown.vdi()  # refuse what is no VDI now
    return shown
