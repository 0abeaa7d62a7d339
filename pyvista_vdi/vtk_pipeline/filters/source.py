"""``VDISource``: from a volume in a VTK pipeline to a VDI."""

from __future__ import annotations

import weakref
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pyvista_vdi.errors import (
    InvalidArgumentError,
    InvalidVolumeError,
    UnsupportedError,
    warn_external,
)
from pyvista_vdi.generation.deferred import generate_deferred, unclassified
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import as_range, one_of
from pyvista_vdi.model.lighting import Lights
from pyvista_vdi.model.options import (
    Deferral,
    GenerationOptions,
    GenerationRequest,
    QualityTarget,
)
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.types import CameraLike, LightsLike
from pyvista_vdi.model.vdi import VDI, screen_metadata
from pyvista_vdi.model.view import bounds_corners, covering_view
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.quality.targets import generate_to_target, warn_missed
from pyvista_vdi.vtk_pipeline.filters.algorithm import (
    UPDATE_TIME_STEP,
    Classifying,
    accessors,
    announce,
    ask_for_all,
    wanted_time,
)
from pyvista_vdi.vtk_pipeline.filters.convert import (
    require_image,
    scalars_of,
    vdi_to_image,
    volume_from_vtk,
)
from pyvista_vdi.vtk_pipeline.filters.option_methods import OptionMethods
from pyvista_vdi.vtk_pipeline.filters.properties import (
    INTERPOLATION,
    check_property,
    transfer_function_from_property,
)
from pyvista_vdi.vtk_pipeline.filters.view import View, camera_of
from pyvista_vdi.vtk_pipeline.vtk import (
    require_this_build,
    vtkDataObject,
    vtkImageData,
    vtkWeakReference,
)


@dataclass(frozen=True)
class Request:
    """Everything that decides a VDI, read from the pipeline at one moment."""

    volume: Volume
    transfer_function: TransferFunction
    screen: View
    generating: tuple[Camera, tuple[int, int]]  # V_O and its window, after coverage
    options: GenerationOptions
    deferral: Deferral
    target: QualityTarget | None
    device: Any
    metadata: dict[str, Any]  # what is added to the VDI's
    content: Any = field(repr=False)  # equal where what is generated from is, the view apart

    @property
    def key(self) -> Any:
        """Equal where the VDIs would be equal."""
        return (self.content, self.generating)

    @property
    def generation(self) -> GenerationRequest:
        """What is asked of whatever generates."""
        metadata, screen = self.metadata, self.screen
        if self.generating != (screen.camera, screen.size):
            metadata = {**metadata, "screen": screen_metadata(screen.camera, screen.size)}
        return GenerationRequest(
            self.volume,
            self.transfer_function,
            *self.generating,
            self.options,
            self.device,
            metadata=metadata,
        )


def checked_size(*size: Any) -> tuple[int, int] | None:
    """Return a window's size, given as two numbers or as a pair; ``None`` as it is."""
    return None if size == (None,) else check_window_size(size[0] if len(size) == 1 else size)


def checked_deferral(*given: Any, **named: Any) -> Deferral:
    """Return when scalars are classified; a pair in it tells whether another is the same."""
    found = Deferral(*given, **named)
    if found.value_range is None:
        return found
    return replace(found, value_range=as_range(found.value_range))


class VDISource(OptionMethods, Classifying):
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

    SetWindowSize, GetWindowSize = accessors(
        "window_size",
        "the screen's width and height in pixels, as two numbers or one pair",
        check=checked_size,
    )
    SetCoverage, GetCoverage = accessors(
        "coverage",
        "what the VDI covers: its window, ``'view'``, or ``'bounds'``, the smallest rectangle of "
        "the screen's pixel grid that contains the whole volume (where the eye is inside its "
        "bounds, or they reach behind it, a ``VDIWarning`` is given and the window is used)",
        "view",
        partial(one_of, name="coverage", names=("bounds", "view")),
    )
    SetOptions, GetOptions = accessors(
        "options",
        "how the VDI is made, all of it at once; lights are set by ``SetLights``",
        GenerationOptions(),
    )
    SetDial, GetDial = accessors(
        "target",
        "what the VDI is to reach, by the arguments of ``QualityTarget``; without any, nothing. It "
        "chooses the lists of the window, ``MaxSupersegments`` and ``Precision``, which have to "
        "have their defaults, as ``Tolerance`` has to; ``GetVDI().metadata['dial']`` says what",
        check=lambda *given, **named: QualityTarget(*given, **named) or None,
    )
    SetDeferral, GetDeferral = accessors(
        "deferral",
        "when scalars are classified, by the arguments of ``Deferral``; without any, as the VDI is "
        "made. ``'deferred'`` makes a ``DeferredVDI``: of the volume property, which may be left "
        "out, only the interpolation counts then",
        Deferral(),
        checked_deferral,
    )
    SetDevice, GetDevice = accessors("device", "the OpenCL device; ``None`` is the default one")
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
        self._camera: Camera | None = None
        self._lights = Lights()  # of the renderer, as they were read last
        self.lit_by = vtkWeakReference()  # the renderer whose lights are looked at
        self._placed: Any = None  # rows of the actor's matrix
        self._volume: Volume | None = None
        self._volume_key: Any = None
        self._table: TransferFunction | None = None
        self._table_key: Any = None
        self._vdi: VDI | None = None
        self._request: Request | None = None
        self.inputs: weakref.WeakSet[Any] = weakref.WeakSet()  # mappers' inputs that draw this

    # What is set

    def SetScalars(self, name: str | None, preference: str = "point") -> None:
        """Choose the array by name; ``None`` means the active scalars.

        ``preference``: which is taken where points and cells have one of that name.
        """
        one_of(preference, name="preference", names=("point", "cell"))
        self._change("scalars", name)
        self._change("preference", preference, "point")

    _, GetScalars = accessors("scalars", "the array's name, or ``None`` for the active scalars")
    _, GetPreference = accessors("preference", "whether points or cells come first", "point")

    def SetCamera(
        self, camera: CameraLike | None, model_transform: ArrayLike | None = None
    ) -> None:
        """Set the generating view V_O.

        Parameters
        ----------
        camera : vtkCamera or pyvista.Camera or Camera or None
            A copy counts. ``None`` waits for the first frame of a mapper.
        model_transform : array_like, shape (4, 4), optional
            Where the volume stands in that view's world: the actor's matrix.

        Raises
        ------
        InvalidCameraError, UnsupportedError
            If it is no camera, or has what the optical model has no place for.
        """
        require_this_build(type(camera))
        view = None if camera is None else camera_of(camera, model_transform)
        if view != self._camera:
            self._camera = view
            self.Modified()

    def GetCamera(self) -> Camera | None:
        """Return the generating view on the screen, before coverage widens it."""
        return self._camera

    def SetLights(self, lights: LightsLike | None) -> None:
        """Set what a shaded volume is lit by.

        Parameters
        ----------
        lights : None, vtkRenderer, Lights or iterable of vtkLight, pyvista.Light or Light
            ``None``, the default, is one headlight. A renderer's lights are looked at whenever
            the VDI is asked for, and other lights make another VDI; lights that merely follow the
            camera do not. What is given as a list is copied now.
        """
        renderer = lights if hasattr(lights, "GetTwoSidedLighting") else None
        require_this_build(type(renderer))
        self.lit_by.Set(renderer)
        self._take_lights(Lights.from_any(lights))

    def GetLights(self) -> Lights:
        """Return what a shaded volume is lit by; of a renderer, as its lights are now."""
        renderer = self.lit_by.Get()
        if renderer is not None:
            self._take_lights(Lights.from_any(renderer))
        return self._lights

    def CheckLights(self) -> None:
        """Be out of date if a shaded volume's renderer has other lights by now."""
        if self._is_shaded():
            self.GetLights()

    def _take_lights(self, lights: Lights) -> None:
        if lights != self._lights:
            self._lights = lights
            if self._is_shaded():
                self.Modified()

    def SetPlace(self, model_transform: ArrayLike) -> None:
        """Note the matrix, (4, 4), of the actor that the volume is shown by.

        Where lights of the scene shine on a shaded volume, another place makes another VDI, which
        is lit there.
        """
        placed = tuple(map(tuple, np.asarray(model_transform).tolist()))
        if placed != self._placed:
            self._placed = placed
            if self._is_shaded() and self._lights.of_scene:
                self.Modified()

    def _is_shaded(self) -> bool:
        prop = self.GetVolumeProperty()
        return prop is not None and bool(prop.GetShade())

    # What is made

    def Update(self, *args: Any) -> None:
        """Bring the output up to date, and raise what went wrong."""
        self.CheckLights()
        connected = self.GetNumberOfInputConnections(0) > 0
        data = self.GetInputDataObject(0, 0) if connected else None
        # Somebody may have brought the input to another time, and this asks for none: VTK's filters
        # look at the data of their input only when they have reason to execute
        known = isinstance(data, vtkImageData) and data.GetNumberOfPoints() > 0
        if known and self._request and wanted_time(self.GetOutputInformation(0)) is None:
            before = self._request.volume
            if self._read(data) is not before:
                self.Modified()
        super().Update(*args)

    def GetVDI(self) -> VDI:
        """Return the VDI, brought up to date; a ``DeferredVDI`` if :meth:`SetDeferral` says so.

        Raises
        ------
        InvalidArgumentError
            If camera, window size or volume property are missing.
        VDIError
            What generating raises.
        """
        self.Update()
        assert self._vdi is not None
        return self._vdi

    def GetCurrentVDI(self) -> VDI | None:
        """Return the VDI made last, whether up to date or not."""
        return self._vdi

    def GetCurrentRequest(self) -> Request | None:
        """Return what the VDI made last was made of."""
        return self._request

    def MakeRequest(self, view: View | None = None) -> Request:
        """Return what the next VDI would be made of, from another view if one is given.

        This brings the pipeline before the source up to date, and generates nothing; it raises what
        :meth:`GetVDI` would raise before it generates.
        """
        if self.GetDeferral().deferred:
            raise UnsupportedError(
                "this VDISource keeps values, and a mapper draws colours: give add_vdi or "
                "VDIToImage what it makes, or VDIMapper GetVDI().classified(cmap=..., opacity=...)"
            )
        return self._make_request(self.UpdateInput(), view, warn=False)

    def TakeVDI(self, vdi: VDI, request: Request, *, view: bool = True) -> None:
        """Take a VDI that was made of a request elsewhere, as if it had been made here.

        ``view``: its view becomes that of the VDIs to come.
        """
        if view:
            self._set["window_size"], self._camera = request.screen.size, request.screen.camera
        self._vdi, self._request = vdi, request
        self.Modified()  # the output is another

    def MakeVDI(self, request: Request) -> VDI:
        """Return the VDI of a request, made now; what the source has made stays."""
        self.SetAbortExecute(0)  # of this VDI nobody has said it yet
        asked = request.generation.replace(progress=self._advance)
        if request.deferral.deferred:
            return generate_deferred(asked, request.deferral)  # type: ignore[return-value]
        if request.target is None:
            return generate_vdi(asked)
        return generate_to_target(asked, request.target)

    def GetVolume(self) -> Volume:
        """Return the volume at the input, read again only if it has changed; raises if none is."""
        return self._read(self.UpdateInput())

    def Copy(self) -> VDISource:
        """Return another source with this one's input, settings and VDI.

        The volume and its property are shared; what is set of one is not set of the other.
        """
        other = VDISource()
        other.SetInputConnection(self.GetInputConnection(0, 0))
        other.SetVolumeProperty(self.GetVolumeProperty())
        other.lit_by.Set(self.lit_by.Get())
        for name in ("camera", "lights", "placed", "volume", "volume_key", "vdi", "request"):
            setattr(other, f"_{name}", getattr(self, f"_{name}"))
        other._set = dict(self._set)
        return other

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

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Announce the output's extent: one point per list, as far as it is known before."""
        self.picture_size = self.GetWindowSize() or (1, 1)
        made = self._request
        announce(outputs, self.picture_size if made is None else made.generating[1])
        return 1

    def _execute(self, inputs: Any, outputs: Any) -> None:
        request = self._make_request(vtkDataObject.GetData(inputs[0], 0), None, warn=True)
        if self._vdi is None or self._request is None or request.key != self._request.key:
            self._vdi = self.MakeVDI(request)
            self._request = request
            if request.target is not None:
                warn_missed(self._vdi)
        vtkImageData.GetData(outputs, 0).ShallowCopy(vdi_to_image(self._vdi))
        # Coverage and a dial have chosen it only now
        announce(outputs, self._vdi.window_size)
        ask_for_all([outputs])

    def _make_request(self, image: Any, view: View | None, *, warn: bool) -> Request:
        prop, deferral, target = self.GetVolumeProperty(), self.GetDeferral(), self.GetDial()
        camera = self._camera if view is None else view.camera
        window_size = self.GetWindowSize() if view is None else view.size
        needed = {
            "camera (SetCamera)": camera,
            "window size (SetWindowSize)": window_size,
            "volume property (SetVolumeProperty)": prop or deferral.deferred or None,
        }
        missing = [what for what, value in needed.items() if value is None]
        if camera is None or window_size is None or missing:
            raise InvalidArgumentError(f"VDISource has no {', no '.join(missing)}")
        volume = self._read(image)
        if prop is None or deferral.deferred:
            deferral.refuse_target(target or QualityTarget())
            table = _unclassified(prop)
        else:
            # Take the property's functions over the volume's scalars, the same until they change
            key = (self._volume_key, prop.GetMTime())
            if self._table is None or key != self._table_key:
                self._table = transfer_function_from_property(prop, volume, rgba=volume.rgba)
                self._table_key = key
            table = self._table
        lights = self.GetLights() if table.shading else Lights()
        options = replace(self.GetOptions(), lights=lights)
        # Where lights of the scene shine on it, the volume is lit where it stands now
        placed = self._placed if lights.of_scene else None
        screen = View(camera, window_size)
        generating = (camera, window_size)
        if placed is not None:
            generating = (camera.replace(model_transform=placed), window_size)
        if self.GetCoverage() == "bounds":
            # The corners of the box of points, model frame: tighter than bounds if rotated
            corners = np.zeros((8, 3))
            for at, corner in zip(bounds_corners(image.GetExtent()).tolist(), corners, strict=True):
                image.TransformIndexToPhysicalPoint(*map(int, at), corner)
            wide = covering_view(*generating, corners)
            generating = wide or generating
            if warn and wide is None:
                warn_external(
                    "coverage='bounds' needs the eye outside the volume, with all of it in "
                    "front: the VDI covers the current view only (coverage='view'); move the "
                    "camera back and regenerate for the whole volume"
                )
        metadata, device = self.GetMetadata(), self.GetDevice()
        content = (self._volume_key, table, options, placed, deferral, target, device, metadata)
        metadata = {"scalars": volume.name, **metadata}
        settings = (options, deferral, target, device, metadata, content)
        return Request(volume, table, screen, generating, *settings)

    def _read(self, image: Any) -> Volume:
        """Return the volume; the same object as long as it is the same (it is on the device)."""
        if image is None:
            raise InvalidVolumeError("what is before VDISource gives no data: check its input")
        image, chosen = require_image(image), (self.GetScalars(), self.GetPreference())
        array = scalars_of(image, *chosen)
        # The image's time is newer than its arrays', whose values may have been written in place
        key = (array.GetAddressAsString(""), image.GetMTime())
        if self._volume is None or key != self._volume_key:
            self._volume, self._volume_key = volume_from_vtk(image, *chosen), key
        return self._volume

    def _advance(self, fraction: float) -> bool:
        self.UpdateProgress(fraction)
        progress = self.GetProgressCallback()
        goes_on = progress is None or progress(fraction) is not False
        return goes_on and not self.GetAbortExecute()


def _unclassified(prop: Any) -> TransferFunction:
    """Return what stands for the transfer function where values are kept, of a property or None."""
    if prop is None:
        return unclassified("nearest")
    check_property(prop)
    if prop.GetShade():
        raise UnsupportedError(
            "the volume property is shaded, which needs gradients, and a deferred VDI keeps values "
            "alone: call ShadeOff(), or leave classification='deferred' out"
        )
    return unclassified(INTERPOLATION[prop.GetInterpolationType()])
