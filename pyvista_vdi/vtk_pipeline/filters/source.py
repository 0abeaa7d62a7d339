"""``VDISource``: from a volume in a VTK pipeline to a VDI."""

from __future__ import annotations

import math
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi import registry
from pyvista_vdi.errors import (
    Cancelled,
    InvalidArgumentError,
    InvalidArgumentTypeError,
    InvalidVDIError,
    InvalidVolumeError,
)
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.checks import one_of
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.inputs import as_vdi
from pyvista_vdi.model.lighting import Lights
from pyvista_vdi.model.options import (
    GenerationOptions,
    GenerationRequest,
    QualityTarget,
)
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.types import LightsLike
from pyvista_vdi.model.vdi import LENS, VDI, DeferredVDI
from pyvista_vdi.model.view import bounds_corners, covering_view
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.quality.targets import generate_to_target, warn_missed
from pyvista_vdi.vtk_pipeline.filters.algorithm import (
    UPDATE_TIME_STEP,
    SceneAlgorithm,
    accessors,
    announce,
    ask_for_all,
    named_pair,
    wanted_time,
    watch,
)
from pyvista_vdi.vtk_pipeline.filters.convert import (
    is_vdi_image,
    require_image,
    scalars_of,
    vdi_to_image,
    volume_from_vtk,
)
from pyvista_vdi.vtk_pipeline.filters.inputs import DeferredInput, Input
from pyvista_vdi.vtk_pipeline.filters.properties import transfer_function_from_property
from pyvista_vdi.vtk_pipeline.filters.view import View, camera_of
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkAlgorithmOutput,
    vtkDataObject,
    vtkImageData,
    vtkWeakReference,
)

#: What two equal sizes of pixels differ by at most.
ROUNDING = 1e-6


@dataclass(frozen=True)
class Request(GenerationRequest):
    """Everything that decides a VDI, read from the pipeline at one moment."""

    screen: View = None  # type: ignore[assignment]  # what a frame shows it in, before coverage
    target: QualityTarget | None = None
    content: Any = field(default=None, repr=False)  # equal where only the view is another

    @property
    def key(self) -> Any:
        """Equal where the VDIs would be equal."""
        return self.content, self.camera, self.window_size

    def seen_from(self, camera: Camera, window_size: tuple[int, int]) -> Request:
        """Return the same from another V_O; the VDI's metadata say the screen's where that is."""
        metadata = {name: entry for name, entry in self.metadata.items() if name != "screen"}
        if (camera, window_size) != (self.screen.camera, self.screen.size):
            seen = self.screen.camera.to_dict()
            metadata["screen"] = {"window_size": [*self.screen.size]} | {n: seen[n] for n in LENS}
        return replace(self, camera=camera, window_size=window_size, metadata=metadata)


def _checked_options(options: GenerationOptions) -> GenerationOptions:
    if not isinstance(options, GenerationOptions):
        raise InvalidArgumentTypeError(
            f"options must be GenerationOptions; got {options!r}: of one alone there is a Set"
        )
    return options


class VDISource(SceneAlgorithm, Input):
    """Generate a VDI from the volume at its input.

    One ``vtkImageData`` in; out comes the VDI in its canonical VTK form (see
    :func:`~pyvista_vdi.vtk_pipeline.filters.convert.vdi_to_image`), or as an object from
    :meth:`GetVDI`.
    It executes again only if the volume, the volume property or a setting has changed since; its
    ``GetMTime()`` tells of the last two. Behind a source with time steps it makes a VDI of each
    step that it is asked for (``UpdateTimeStep``), and keeps the last one.

    Notes
    -----
    :meth:`SetCamera` keeps a copy of the view: turning the renderer's camera afterwards does not
    regenerate. Without a camera, a :class:`VDIMapper` behind it sets the view of its first frame
    that has something to draw. Settings are checked when they are set. Python's ``Update`` and
    :meth:`GetVDI` raise what went wrong; an update that VTK asks for writes it to VTK's output
    window and gives an empty image.

    ``ProgressEvent`` is invoked while it works, and ``SetAbortExecute(1)`` in it stops the work:
    Python's ``Update`` raises ``Cancelled`` then, an update that VTK asks for gives an empty image.
    What had been made before stays, and the next update begins anew.
    """

    bad_input = InvalidVolumeError
    #: Whether it is lit by whatever renderer shows it, and stands where its actor does in the world
    #: of a camera that was given: what ``add_vdi`` adds.
    of_scene = False

    SetScalars, GetScalars = accessors(
        "scalars",
        "the array by its name, ``None`` for the active scalars, and which is preferred where "
        "points and cells have one of that name: ``'point'``, as by default, or ``'cell'``",
        (None, "point"),
        lambda name, preference="point": (
            name,
            one_of(preference, "preference", ("point", "cell")),
        ),
    )
    SetCoverage, GetCoverage = accessors(
        "coverage",
        "what the VDI covers: its window, ``'view'``, or ``'bounds'``, the smallest rectangle of "
        "the screen's pixel grid that contains the whole volume (where the eye is inside its "
        "bounds, or they reach behind it, the window)",
        "view",
        partial(one_of, name="coverage", names=("bounds", "view")),
    )
    SetOptions, GetOptions = accessors(
        "options",
        "how the VDI is made, all of it at once; lights are set by ``SetLights``",
        GenerationOptions(),
        _checked_options,
    )
    SetDial, GetDial = accessors(
        "target",
        "what the VDI is to reach, by the arguments of ``QualityTarget``; without any, nothing. It "
        "chooses the lists of the window, ``MaxSupersegments`` and ``Precision``, which have to "
        "have their defaults, as ``Tolerance`` has to; ``GetVDI().metadata['dial']`` says what",
        check=lambda *given, **named: QualityTarget(*given, **named) or None,
    )
    SetMetadata, GetMetadata = accessors(
        "metadata", "entries to add to the VDI's metadata", {}, dict
    )
    SetProgressCallback, GetProgressCallback = accessors(
        "progress", "a callable that gets the fraction done; if it returns ``False`` the work stops"
    )

    def __init__(self) -> None:
        super().__init__(
            # Any data object, so that what is no image is refused by name: for a required image
            # VTK would go through a composite data set block by block
            nInputPorts=1,
            inputType="vtkDataObject",
            nOutputPorts=1,
            outputType="vtkImageData",
        )
        self.lit_by = vtkWeakReference()  # the renderer whose lights are looked at
        #: Rows of the matrix of the actor that shows it: lights of the scene shine on it there.
        self.placed: Any = None
        self._volume: Volume | None = None
        self._volume_key: Any = None
        self._table: TransferFunction | None = None
        self._table_key: Any = None
        self.last: VDI | None = None  # made last
        self.made_of: Request | None = None  # what the VDI made last is of
        self._frame_camera: Camera | None = None  # what frames gave, which nobody has set
        self._frame_size: tuple[int, int] | None = None
        self.drivers: weakref.WeakSet[Any] = weakref.WeakSet()
        watch(self, self, VDISource.tell)

    # What is set

    def SetLights(self, lights: LightsLike | None) -> None:
        """Set what a shaded volume is lit by.

        Parameters
        ----------
        lights : None, vtkRenderer, Lights or iterable of vtkLight, pyvista.Light or Light
            ``None``, the default, is one headlight. A renderer's lights are looked at whenever
            the VDI is asked for, and other lights make another VDI; lights that merely follow the
            camera do not. What is given as a list is copied now.
        """
        made = Lights.from_any(lights)
        self.lit_by.Set(lights if hasattr(lights, "GetTwoSidedLighting") else None)
        self._change("lights", made, Lights())

    def GetLights(self) -> Lights:
        """Return what a shaded volume is lit by; of a renderer, as its lights are now."""
        if self.lit_by.Get() is not None:
            self._set["lights"] = Lights.from_any(self.lit_by.Get())
        return self._set.get("lights", Lights())

    # What is made

    def GetVDI(self) -> VDI:
        """Return the VDI, brought up to date.

        Raises
        ------
        InvalidArgumentError
            If camera, window size or volume property are missing.
        VDIError
            What generating raises.
        """
        self.Update()
        # VTK looks at the input's data, and nobody at lights, only where there is reason to execute
        return self._made(self.MakeRequest())

    def MakeRequest(self, view: View | None = None, image: Any = None) -> Request:
        """Return what the next VDI would be made of, from another view if one is given.

        This brings the pipeline before the source up to date, unless the ``image`` at the input is
        given, and generates nothing; it raises what :meth:`GetVDI` would raise before it generates.
        """
        image = self.UpdateInput() if image is None else image
        prop, target = self.GetVolumeProperty(), self.GetDial()
        camera = self.GetCamera() if view is None else view.camera
        window_size = self.GetWindowSize() if view is None else view.size
        needed = {
            "camera (SetCamera)": camera,
            "window size (SetWindowSize)": window_size,
            "volume property (SetVolumeProperty)": prop,
        }
        missing = [what for what, value in needed.items() if value is None]
        if camera is None or window_size is None or missing:
            raise InvalidArgumentError(f"VDISource has no {', no '.join(missing)}")
        volume = self._read(image)
        # Take the property's functions over the volume's scalars, the same until they change
        key = (self._volume_key, prop.GetMTime())
        if self._table is None or key != self._table_key:
            self._table = transfer_function_from_property(prop, volume, rgba=volume.rgba)
            self._table_key = key
        table = self._table
        lights = self.GetLights() if table.shading else Lights()
        options = replace(self.GetOptions(), lights=lights)
        # Where lights of the scene shine on it, the volume is lit where it stands now
        placed = self.placed if lights.of_scene else None
        generating = (camera, window_size)
        if placed is not None:
            generating = (camera.replace(model_transform=placed), window_size)
        if self.GetCoverage() == "bounds":
            # The corners of the box of points, model frame: tighter than bounds if rotated
            box = bounds_corners([end for n in volume.dimensions for end in (0, n - 1)])
            corners = np.column_stack([box, np.ones(8)]) @ volume.index_to_model.T[:, :3]
            generating = covering_view(*generating, corners) or generating
        device, metadata = self.GetDevice(), {"scalars": volume.name, **self.GetMetadata()}
        content = (self._volume_key, table, options, placed, target, device, metadata)
        settings = (options, device, None, metadata, View(camera, window_size), target)
        request = Request(volume, table, camera, window_size, *settings, content)
        return request.seen_from(*generating)

    def TakeVDI(self, vdi: VDI, request: Request) -> None:
        """Take a VDI that was made of a request elsewhere; its view is that of those to come."""
        self._set |= {"window_size": request.screen.size, "camera": request.screen.camera}
        self.last, self.made_of = vdi, request
        self.Modified()  # the output is another

    def MakeVDI(self, request: Request) -> VDI:
        """Return the VDI of a request, made now; what the source has made stays."""
        self.SetAbortExecute(0)  # of this VDI nobody has said it yet
        asked = request.replace(progress=self._advance)
        if request.target is None:
            return generate_vdi(asked)
        vdi = generate_to_target(asked, request.target)
        warn_missed(vdi)
        return vdi

    def GetVolume(self) -> Volume:
        """Return the volume at the input, read again only if it has changed; raises if none is."""
        return self._read(self.UpdateInput())

    def UpdateInput(self) -> Any:
        """Return the data at the input, up to date and as of the time that is asked of the source.

        Raises
        ------
        InvalidVolumeError
            If there is no input.
        """
        if self.GetNumberOfInputConnections(0) == 0:
            raise InvalidVolumeError("VDISource has no input: call SetInputDataObject")
        time = wanted_time(self.GetOutputInformation(0))
        if time is not None:  # else what others asked for is as good
            self.GetInputInformation(0, 0).Set(UPDATE_TIME_STEP, time)
        self.GetInputAlgorithm(0, 0).Update()
        return self.GetInputDataObject(0, 0)

    # What a mapper draws: see Input

    @property
    def port(self) -> Any:
        """The port that the volume comes from."""
        connected = self.GetNumberOfInputConnections(0) > 0
        return self.GetInputConnection(0, 0) if connected else None

    def vdi(self, view: View | None = None) -> VDI:
        """Return the VDI of the data that are at the input by now, or one of another view.

        They are those of before where an algorithm further up has failed, which :meth:`GetVDI`
        raises. The view of the VDIs to come stays.
        """
        vdi = self._made(self.MakeRequest(view))
        if view is not None:
            self.Modified()  # the output is another
        return vdi

    def exact_vdi(self, view: View, size: tuple[int, int]) -> VDI:
        """Make and return a VDI of exactly a view's picture.

        What covers a volume that is near, or a tile's, would have more lists than pixels.
        """
        wanted = self.MakeRequest(view)
        camera, lists = view.camera, wanted.window_size
        extents = zip(wanted.camera.half_extent(lists), camera.half_extent(size), strict=True)
        pixels = math.prod(size) * math.prod(high / low for high, low in extents)
        if size != view.size or pixels > math.prod(lists) * (1 + ROUNDING):
            wanted = wanted.seen_from(camera, size)
        vdi = self.MakeVDI(wanted)
        self.TakeVDI(vdi, wanted)
        return vdi

    def bounds(self) -> tuple[float, ...] | None:
        """Return the bounds of the volume, brought up to date; ``None`` where there is none.

        VTK's mappers do so, too, because many filters announce other bounds than they give.
        """
        data: Any = None if self.port is None else self.UpdateInput()
        known = isinstance(data, vtkImageData) and data.GetNumberOfPoints() > 0
        return tuple(data.GetBounds()) if known else None

    def stamp(self) -> Any:
        """Return the time stamps of all that it depends on, and a shaded volume's lights."""
        prop, data = self.GetVolumeProperty(), None if self.port is None else self.UpdateInput()
        stamps = [thing and thing.GetMTime() for thing in (self, data, prop)]
        lights = self.GetLights() if prop is not None and prop.GetShade() else None
        return *stamps, lights, self.placed if lights and lights.of_scene else None

    def note_scene(self, renderers: Sequence[Any], model_transform: NDArray[np.float64]) -> None:
        """Note a renderer that shows it, for its lights, unless none does, and where it stands."""
        lit_by, alone = self.lit_by.Get(), len(self.drivers) == 1
        if self.of_scene and lit_by not in renderers and (alone or lit_by is None):
            self.lit_by.Set(renderers[0] if renderers else None)
        if alone:
            self.placed = tuple(map(tuple, model_transform.tolist()))

    def keep_lights(self, closed: Sequence[Any]) -> None:
        """Keep the lights of the renderer that lights it, if that is one of those that close."""
        if self.of_scene and self.lit_by.Get() in closed:
            self.GetLights()
            self.lit_by.Set(None)

    def view_is_chosen(self, wanted: Request | None) -> bool:
        """Whether somebody has chosen the view: since the last VDI, or for the first one."""
        made = self.made_of
        if made is None or wanted is None:
            return made is None and self.GetCamera() is not self._frame_camera
        return bool(wanted.key != made.key and wanted.screen != made.screen)

    def set_view_if_missing(
        self, camera: Any, size: tuple[int, int], model_transform: NDArray[np.float64]
    ) -> None:
        """Take a renderer's view, unless nothing can be drawn from it; this raises why not."""
        given, given_size, view = self.GetCamera(), self.GetWindowSize(), None
        if given is None or given_size is None:
            view = self.view_for(camera, size, model_transform)
            self.MakeRequest(view)
        if given is None and view is not None:
            self.take_camera(view.camera)
        elif self.of_scene and self._frame_camera is None and self.made_of is None:
            # One that was given with the volume
            self.SetCamera(given.replace(model_transform=model_transform))
        if given_size is None:
            self.take_size(size)

    def view_for(
        self, camera: Any, size: tuple[int, int], model_transform: NDArray[np.float64]
    ) -> View:
        """Return the view that a VDI is made of where a renderer has this one."""
        given = self.GetCamera()
        if given is None:
            given = camera_of(camera, model_transform)
        elif self.of_scene:
            given = given.replace(model_transform=model_transform)
        return View(given, self.GetWindowSize() or size)

    def take_camera(self, camera: Any, model_transform: ArrayLike | None = None) -> None:
        """Set a renderer's view as that of the next VDI."""
        self.SetCamera(camera, model_transform)
        self._frame_camera = self.GetCamera()

    def take_size(self, size: tuple[int, int]) -> None:
        """Set a renderer's window as that of the next VDI."""
        self.SetWindowSize(size)
        self._frame_size = self.GetWindowSize()

    def follow_if_changed(
        self, camera: Any, size: tuple[int, int], model_transform: NDArray[np.float64]
    ) -> None:
        """Take a renderer's view if what the VDI was made of has changed since, the view apart.

        What somebody has set, the camera or the window's size, stays.
        """
        made, given = self.made_of, self._frame_camera
        if made is None or given is None or self.GetCamera() is not given:
            return
        if self.MakeRequest().content != made.content:
            self.take_camera(camera, model_transform)
            if self.GetWindowSize() == self._frame_size:
                self.take_size(size)

    def on_devices(self) -> list[Any]:
        """Return the VDI, and the volume that it was made of."""
        return [self.last, None if self.made_of is None else self.made_of.volume]

    # VTK's requests

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Announce the output's extent: one point per list, as far as it is known before."""
        self.picture_size = self.GetWindowSize() or (1, 1)
        made = self.made_of
        announce(outputs, self.picture_size if made is None else made.window_size)
        return 1

    def _execute(self, inputs: Any, outputs: Any) -> None:
        vdi = self._made(self.MakeRequest(image=vtkDataObject.GetData(inputs[0], 0)))
        vtkImageData.GetData(outputs, 0).ShallowCopy(vdi_to_image(vdi))
        # Coverage and a dial have chosen it only now
        announce(outputs, vdi.window_size)
        ask_for_all([outputs])

    def _made(self, request: Request) -> VDI:
        """Return a request's VDI, made now unless it is the one that was made last."""
        if self.last is None or self.made_of is None or request.key != self.made_of.key:
            self.last, self.made_of = self.MakeVDI(request), request
        return self.last

    def _read(self, image: Any) -> Volume:
        """Return the volume; the same object as long as it is the same (it is on the device)."""
        if image is None:
            raise InvalidVolumeError("what is before VDISource gives no data: check its input")
        image, chosen = require_image(image), self.GetScalars()
        array = scalars_of(image, *chosen)
        # The image's time is newer than its arrays', whose values may have been written in place
        key = (array.GetAddressAsString(""), image.GetMTime())
        if self._volume is None or key != self._volume_key:
            if self.GetInputAlgorithm(0, 0).CheckAbort():
                raise Cancelled("what is before VDISource was aborted: its data are not whole")
            self._volume, self._volume_key = volume_from_vtk(image, *chosen), key
        return self._volume

    def _advance(self, fraction: float) -> bool:
        self.UpdateProgress(fraction)
        progress = self.GetProgressCallback()
        goes_on = progress is None or progress(fraction) is not False
        return goes_on and not self.GetAbortExecute()


def _option(name: str, what: str) -> Any:
    """Return Set and Get of one of a source's options."""

    def setter(self: VDISource, value: Any) -> None:
        self.SetOptions(replace(self.GetOptions(), **{name: value}))

    def getter(self: VDISource) -> Any:
        return getattr(self.GetOptions(), name)

    return named_pair(name, f"`{name}` of :func:`pyvista_vdi.generate`: {what}", setter, getter)


for _told in GenerationOptions.declared.values():
    for _method in _option(_told.name, _told.what) if _told.name != "lights" else ():
        setattr(VDISource, _method.__name__, _method)


def input_of(data: Any) -> Input:
    """Return what to draw for a VDI, an image of one, a port, a series or a set."""
    if isinstance(data, vtkAlgorithmOutput):
        producer = data.GetProducer()
        if isinstance(producer, VDISource):
            return producer
        shown = Input(port=data)
        shown.vdi()  # refuse what is no VDI now
        return shown
    if isinstance(data, DeferredInput | VDISource):
        return data
    if isinstance(data, VDI | DeferredVDI) or is_vdi_image(data):
        return Input(as_vdi(data))  # of values this raises, and says what to do
    if isinstance(data, VDICollection):
        return registry.load(data.drawn_by)(data)  # type: ignore[no-any-return]
    raise InvalidVDIError(
        f"a VDIMapper draws a VDI, its canonical image, a series, a set or a VDISource's output; "
        f"got {type(data).__name__}: put a VDISource between a volume and the mapper"
    )
