"""What a :class:`VDIMapper` draws: a VDI as it is, or what a pipeline makes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi import registry
from pyvista_vdi.errors import InvalidVDIError, warn_external
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.inputs import as_vdi
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.classified_values import classify_on_device
from pyvista_vdi.vtk_pipeline.filters.algorithm import ask_for_all, wanted_time
from pyvista_vdi.vtk_pipeline.filters.convert import is_vdi_image, vdi_from_image
from pyvista_vdi.vtk_pipeline.filters.properties import transfer_function_from_property
from pyvista_vdi.vtk_pipeline.filters.source import VDISource
from pyvista_vdi.vtk_pipeline.filters.view import View
from pyvista_vdi.vtk_pipeline.vtk import require_this_build

#: What of a transfer function no list of values can honour, and how a property has it.
_OF_GRADIENTS = {"shading": "shading (shade = True)", "gradient_opacities": "gradient opacity"}


class Input:
    """A VDI that does not change; and what others do who show several VDIs, or make them."""

    #: The series or the set whose VDIs are shown.
    collection: VDICollection | None = None
    #: What chooses among the steps of a series and plays them: see ``extensions.series.player``.
    player: Any = None
    #: The values that the VDI is classified from; ``None`` where none are kept.
    deferred: DeferredVDI | None = None
    #: The volume property that classifies values, where they are kept.
    prop: Any = None
    #: What remedies a view that the VDI does not serve, where there is no source.
    remedy = "without its volume it cannot be made anew"
    #: Milliseconds between two looks of the event loop at what goes on; ``None``: as usual.
    period: int | None = None

    def __init__(self, vdi: VDI | None = None) -> None:
        self._vdi = vdi

    def vdi(self) -> VDI | None:
        """Return the VDI, brought up to date; raises what went wrong."""
        return self._vdi

    def last(self) -> VDI | None:
        """Return the VDI made last."""
        return self._vdi

    def bounds(self) -> tuple[float, ...] | None:
        """Return the bounds in the model frame, without making a VDI."""
        return None if self._vdi is None else self._vdi.bounds

    def stamp(self) -> Any:
        """Return something that changes whenever it is worth trying again."""
        return None if self._vdi is None else id(self._vdi)

    def set_view_if_missing(self, renderer: Any, model_transform: NDArray[np.float64]) -> None:
        """Take the frame's view as the generating view, if there is none yet."""

    def forget_view(self) -> None:
        """Wait for the view of another frame, where that of a frame was taken."""

    def shared(self) -> Input:
        """Return an input of the same VDI for another mapper."""
        return self

    def before(self) -> Any:
        """Return the port of what the bounds depend on; ``None`` where they depend on nothing."""

    def ask(self, inputs: Any) -> None:
        """Ask what is before for as much as is needed."""
        ask_for_all(inputs)

    def has_what_it_had(self) -> bool:
        """Whether the data of the VDI made last are still there, though an update fails."""
        return False

    def watch(self, changed: Callable[..., Any] | None) -> None:
        """Call this when what is before it may be another; ``None`` ends it."""

    def classified_by(self, prop: Any) -> Input:
        """Return an input whose values, where they are kept, another property classifies."""
        return self

    def rest(self) -> None:
        """End what goes on behind the frames, which may begin anew."""

    def look(self, camera: Camera, device: Any) -> None:
        """Choose what a view shows, before a frame."""

    @property
    def busy(self) -> bool:
        """Whether something goes on that the event loop has to look at."""
        return False

    def advance(self) -> bool | None:
        """Take what is due between two frames; whether there is another VDI to be drawn.

        ``None`` where nothing goes on by itself.
        """
        return None

    def complaint(self, error: BaseException) -> str | None:
        """Return what is said of an error between two frames; ``None``: what is usual."""
        return None

    def parts(self) -> list[tuple[VDI, float]]:
        """Return the VDIs that a picture is blended of, with weights; none for one."""
        return []


class SourceInput(Input):
    """What a :class:`VDISource` makes."""

    def __init__(self, source: VDISource) -> None:
        super().__init__()
        self.source = source
        self._tag: int | None = None
        self._camera: Camera | None = None  # what frames gave, which nobody has set
        self._size: tuple[int, int] | None = None

    def shared(self) -> Input:
        """Return an input from the same source."""
        return self._from(self.source)

    def separate(self) -> SourceInput:
        """Return an input from a source of its own, with the same settings and VDI."""
        return self._from(self.source.Copy())

    def _from(self, source: VDISource) -> SourceInput:
        other = SourceInput(source)
        other._camera, other._size = self._camera, self._size
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
        """Return the VDI, brought up to date."""
        return as_vdi(self.source.GetVDI())

    def last(self) -> VDI | None:
        """Return the VDI made last."""
        return self.source.GetCurrentVDI()

    def bounds(self) -> tuple[float, ...] | None:
        """Return the bounds of the volume, brought up to date."""
        return self.source.GetInputBounds()

    def before(self) -> Any:
        """Return the port that the volume comes from."""
        source = self.source
        connected = source.GetNumberOfInputConnections(0) > 0
        return source.GetInputConnection(0, 0) if connected else None

    def has_what_it_had(self) -> bool:
        """Whether the data at the source's input are still those of the VDI made last."""
        made = self.source.GetCurrentRequest()
        return made is not None and self.source.GetVolume() is made.volume

    def ask(self, inputs: Any) -> None:
        """Ask for what the source asks for."""
        self.source.RequestUpdateExtent(None, inputs, None)

    def stamp(self) -> Any:
        """Return the newest time stamp of all that it depends on."""
        if self.source.GetNumberOfInputConnections(0) > 0:
            self.source.UpdateInput()
        self.source.CheckLights()
        stamps = [self.source.GetMTime()]
        data = self.source.GetInputDataObject(0, 0)
        prop = self.source.GetVolumeProperty()
        stamps += [thing.GetMTime() for thing in (data, prop) if thing is not None]
        return max(stamps)

    def set_view_if_missing(self, renderer: Any, model_transform: NDArray[np.float64]) -> None:
        """Take the renderer's view, unless nothing can be drawn from it; this raises why not."""
        source = self.source
        if source.GetCamera() is not None and source.GetWindowSize() is not None:
            return
        seen = Camera.from_any(renderer.GetActiveCamera(), model_transform=model_transform)
        view = View(source.GetCamera() or seen, source.GetWindowSize() or _size(renderer))
        source.MakeRequest(view)
        if source.GetCamera() is None:
            self.take_camera(renderer, model_transform)
        if source.GetWindowSize() is None:
            self.take_size(renderer)

    def forget_view(self) -> None:
        """Wait for the view of another frame, where that of a frame was taken."""
        if self._camera is not None and self.source.GetCamera() is self._camera:
            self.source.SetCamera(None)
        if self._size is not None and self.source.GetWindowSize() == self._size:
            self.source.SetWindowSize(None)
        self._camera = self._size = None

    def take_camera(self, renderer: Any, model_transform: NDArray[np.float64]) -> None:
        """Set the renderer's view as that of the next VDI."""
        self.source.SetCamera(renderer.GetActiveCamera(), model_transform)
        self._camera = self.source.GetCamera()

    def take_size(self, renderer: Any) -> None:
        """Set the renderer's window as that of the next VDI."""
        self.source.SetWindowSize(_size(renderer))
        self._size = self.source.GetWindowSize()

    def follow_if_changed(self, renderer: Any, model_transform: NDArray[np.float64]) -> None:
        """Take the renderer's view if what the VDI was made of has changed since, the view apart.

        What somebody has set, the camera or the window's size, stays.
        """
        made, source = self.source.GetCurrentRequest(), self.source
        if made is None or self._camera is None or source.GetCamera() is not self._camera:
            return
        if source.MakeRequest().content != made.content:
            self.take_camera(renderer, model_transform)
            if source.GetWindowSize() == self._size:
                self.take_size(renderer)


class ImageInput(Input):
    """A canonical image, from a data object or from any algorithm that makes one."""

    def __init__(self, image: Any = None, port: Any = None) -> None:
        super().__init__()
        self._image = image
        self._port = port
        # A port does not keep its algorithm; what is connected in VTK does
        self._producer: Any = None if port is None else port.GetProducer()
        self._read_at: int | None = None

    def vdi(self) -> VDI | None:
        """Return the VDI, brought up to date."""
        if self._port is not None:
            self._producer.Update(self._port.GetIndex())
            self._image = self._producer.GetOutputDataObject(self._port.GetIndex())
        image = self._image
        if self._vdi is None or self._read_at != image.GetMTime():
            self._vdi = as_vdi(vdi_from_image(image))
            self._read_at = image.GetMTime()
        return self._vdi

    def before(self) -> Any:
        """Return the port that the image comes from."""
        return self._port

    def bounds(self) -> tuple[float, ...] | None:
        """Return the bounds: the volume's, or those of the updated image."""
        vdi = self.vdi()
        return None if vdi is None else vdi.bounds

    def stamp(self) -> Any:
        """Return the newest time stamp of all that it depends on."""
        if self._port is not None:
            self._producer.UpdateInformation()
            time = wanted_time(self._producer.GetOutputInformation(self._port.GetIndex()))
            return self._producer.GetMTime(), time
        return self._image.GetMTime()


class DeferredInput(Input):
    """Values that a volume property classifies, anew when it has changed; no volume is needed."""

    deferred: DeferredVDI

    def __init__(self, deferred: DeferredVDI, prop: Any) -> None:
        super().__init__()
        self.deferred, self.prop = deferred, prop
        self._made_at: Any = None
        self._look: TransferFunction | None = None  # of the VDI that was made last
        self._left_out: list[str] = []

    def vdi(self) -> VDI:
        """Return the VDI that the property makes of the values now; warn of what it leaves out."""
        stamp = self.stamp()
        if self._vdi is None or self._made_at != stamp:
            look = transfer_function_from_property(self.prop)
            asked = [name for name in _OF_GRADIENTS if getattr(look, name) is not None]
            look = look.replace(**dict.fromkeys(asked))
            if asked and asked != self._left_out:
                warn_external(
                    f"{' and '.join(_OF_GRADIENTS[name] for name in asked)} of the volume property "
                    "needs gradients, which a deferred VDI does not keep: it is drawn without; "
                    "switch it off, or add the volume without classification='deferred'"
                )
            self._left_out = asked
            if self._vdi is None or self._look != look:  # the time stamp alone says little
                self._vdi, self._look = classify_on_device(self.deferred, look), look
            self._made_at = stamp
        return self._vdi

    def classified_by(self, prop: Any) -> Input:
        """Return one of the same values: whoever shares this one keeps the property."""
        return DeferredInput(self.deferred, prop)

    def bounds(self) -> tuple[float, ...]:
        """Return the bounds in the model frame."""
        return self.deferred.bounds

    def stamp(self) -> Any:
        """Return the time stamp of the property and its functions."""
        return self.prop.GetMTime()


def _size(renderer: Any) -> tuple[int, int]:
    width, height = renderer.GetSize()
    return max(1, width), max(1, height)


def input_of(data: Any) -> Input:
    """Return what to draw for a VDI, an image of one, a VDISource, or what extensions show."""
    if isinstance(data, VDI):
        return Input(data)
    if isinstance(data, DeferredInput):
        return data
    if isinstance(data, DeferredVDI):
        as_vdi(data)  # raises, and says what to do
    if isinstance(data, VDISource):
        return SourceInput(data)
    if is_vdi_image(data):
        image = ImageInput(data)
        image.vdi()  # refuse a damaged one now
        return image
    show = registry.made_of("shown", data)
    if show is not None:
        return show(data)  # type: ignore[no-any-return]
    require_this_build(type(data))
    raise InvalidVDIError(
        f"a VDIMapper draws a VDI, its canonical image, a series, a set or a VDISource's output; "
        f"got {type(data).__name__}: put a VDISource between a volume and the mapper"
    )


def input_of_port(port: Any) -> Input:
    """Return what to draw for an output port."""
    require_this_build(type(port))
    producer = port.GetProducer()
    if isinstance(producer, VDISource):
        return SourceInput(producer)
    image = ImageInput(port=port)
    image.vdi()  # refuse what is no VDI now
    return image
