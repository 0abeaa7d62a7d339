"""``VDISource``: from a volume in a VTK pipeline to a VDI."""

from __future__ import annotations

import warnings
import weakref
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from inspect import Parameter, Signature
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from vtkmodules.vtkCommonCore import vtkWeakReference
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkImageData
from vtkmodules.vtkRenderingCore import vtkVolumeProperty

from pyvista_vdi.errors import (
    Cancelled,
    InvalidArgumentError,
    InvalidVolumeError,
    VDIError,
    VDIWarning,
)
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.coverage import bounds_corners, covering_view
from pyvista_vdi.model.lighting import Lights
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.quality.dial import TARGET_ANGLE, Dial, warn_missed
from pyvista_vdi.quality.probe import generate_by_dial
from pyvista_vdi.vtk_pipeline.filters.algorithm import (
    Algorithm,
    announce,
    ask_for_all,
    whole_extent,
)
from pyvista_vdi.vtk_pipeline.filters.convert import (
    require_image,
    require_image_port,
    scalars_of,
    vdi_to_image,
    volume_from_vtk,
)
from pyvista_vdi.vtk_pipeline.filters.properties import (
    color_function,
    transfer_function_from_property,
)
from pyvista_vdi.vtk_pipeline.filters.view import TrackedCamera, View

#: What a VDI's window covers.
COVERAGES = ("bounds", "view")

Progress = Callable[[float], object]

_NO_INPUT = "VDISource has no input: call SetInputDataObject(volume)"


@dataclass(frozen=True)
class Request:
    """Everything that decides a VDI, read from the pipeline at one moment.

    Attributes
    ----------
    volume : Volume
        The scalars.
    transfer_function : TransferFunction
        Their colours and opacities.
    screen : View
        The view on the screen.
    generating : (Camera, (int, int))
        The generating view V_O and its window, after coverage.
    options : GenerationOptions
        How it is made.
    dial : Dial or None
        What chooses some of the options.
    device
        Where.
    metadata : dict
        What is added to the VDI's.
    content : tuple
        Equal where what is generated from is equal, the view apart.
    """

    volume: Volume
    transfer_function: TransferFunction
    screen: View
    generating: tuple[Camera, tuple[int, int]]
    options: GenerationOptions
    dial: Dial | None
    device: Any
    metadata: dict[str, Any]
    content: Any = field(repr=False)

    @property
    def key(self) -> Any:
        """Equal where the VDIs would be equal."""
        return (self.content, self.generating)

    @property
    def arguments(self) -> tuple[Volume, Camera, tuple[int, int], TransferFunction]:
        """The first arguments of whatever generates."""
        return (self.volume, *self.generating, self.transfer_function)


def _option(name: str, argument: str, meaning: str, more: str = "") -> tuple[Any, Any]:
    """Return the setter and the getter of one of the :class:`GenerationOptions`.

    The setter's ``argument`` is checked by the options.
    """

    def set_option(self: VDISource, value: Any) -> None:
        self.SetOptions(replace(self._options, **{name: value}))

    def get_option(self: VDISource) -> Any:
        return getattr(self._options, name)

    as_vtk = "".join(word.capitalize() for word in name.split("_"))
    kind = Parameter.POSITIONAL_OR_KEYWORD
    for function, verb, names in (
        (set_option, "Set", ["self", argument]),
        (get_option, "Get", ["self"]),
    ):
        function.__name__, function.__qualname__ = verb + as_vtk, f"VDISource.{verb}{as_vtk}"
        function.__signature__ = Signature([Parameter(each, kind) for each in names])  # type: ignore[union-attr]
    set_option.__doc__ = f"Set {meaning}.\n\n{more}As ``{name}`` of :func:`pyvista_vdi.generate`."
    get_option.__doc__ = f"Return {meaning}."
    return set_option, get_option


class VDISource(Algorithm):
    """Generate a VDI from the volume at its input.

    One ``vtkImageData`` in; out comes the VDI in its canonical VTK form (see
    :func:`~pyvista_vdi.vtk_pipeline.filters.convert.vdi_to_image`), or as an object from
    :meth:`GetVDI`.
    It executes again only if the volume, the volume property or a setting has changed since; its
    ``GetMTime()`` tells of the last two.

    Notes
    -----
    :meth:`SetCamera` keeps a copy of the view: turning the renderer's camera afterwards does not
    regenerate, unless :meth:`SetTrackCamera` asks for it. Without a camera, a :class:`VDIMapper`
    behind it sets the view of its first frame. Settings are checked when they are set. Python's
    ``Update`` and :meth:`GetVDI` raise what went wrong; an update that VTK asks for writes it to
    VTK's output window and gives an empty image.

    ``ProgressEvent`` is invoked while it works, and ``SetAbortExecute(1)`` or
    ``SetAbortExecuteAndUpdateTime()`` stops the work, also from before the update or in an
    algorithm upstream: Python's ``Update`` raises ``Cancelled`` then, an update that VTK asks for
    gives an empty image. What had been made before stays, and the next update begins anew: an
    abort is of one execution.
    """

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
        self._given: TrackedCamera | None = None
        self._track = False
        self._window_size: tuple[int, int] | None = None
        self._coverage = "view"
        self._scalars: str | None = None
        self._preference = "point"
        self._options = GenerationOptions()
        self._dial: Dial | None = None
        self._device: Any = None
        self._lights: Lights | None = None
        self._lit_by = vtkWeakReference()
        self._property: vtkVolumeProperty | None = None
        self._observed: list[tuple[Any, int]] = []
        self._progress: Progress | None = None
        self._metadata: dict[str, Any] = {}
        self._volume: Volume | None = None
        self._volume_key: Any = None
        self._vdi: VDI | None = None
        self._request: Request | None = None
        self.AddObserver("EndEvent", _end_abort)
        self.inputs: weakref.WeakSet[Any] = weakref.WeakSet()  # mappers' inputs that draw this

    # -- settings --------------------------------------------------------------------------------

    def SetInputDataObject(self, *args: Any) -> None:
        """Set the volume: a ``vtkImageData`` (optionally after a port number, 0)."""
        if args and args[-1] is not None:
            require_image(args[-1])
        super().SetInputDataObject(*args)

    def SetInputConnection(self, *args: Any) -> None:
        """Set what makes the volume, a port of another algorithm.

        Raises
        ------
        UnsupportedError
            If that port is known to give something other than a ``vtkImageData``. Where only an
            update can tell, the update raises it.
        """
        if args and args[-1] is not None:
            require_image_port(args[-1])
        super().SetInputConnection(*args)

    def SetInputData(self, image: vtkImageData) -> None:
        """Set the volume."""
        self.SetInputDataObject(image)

    def SetScalars(self, name: str | None, preference: str = "point") -> None:
        """Choose the array by name; ``None`` means the active scalars."""
        if preference not in ("point", "cell"):
            raise InvalidArgumentError(f"preference must be 'point' or 'cell'; got {preference!r}")
        self._change("_scalars", name)
        self._change("_preference", preference)

    def GetScalars(self) -> str | None:
        """Return the array's name, or ``None`` for the active scalars."""
        return self._scalars

    def SetCamera(self, camera: Any, model_transform: ArrayLike | None = None) -> None:
        """Set the generating view V_O.

        Parameters
        ----------
        camera : vtkCamera or pyvista.Camera or Camera or None
            A copy counts, unless ``SetTrackCamera(True)``. ``None`` waits for the first frame of
            a mapper.
        model_transform : array_like, shape (4, 4), optional
            Where the volume stands in that view's world: the actor's matrix.

        Raises
        ------
        InvalidCameraError, UnsupportedError
            If it is no camera, or has what the optical model has no place for.
        """
        view = None if camera is None else Camera.from_any(camera, model_transform=model_transform)
        if self._given is not None:
            self._given.watch(None)
        follows = hasattr(camera, "GetMTime")  # a VTK object
        self._given = TrackedCamera(camera, model_transform, self) if follows else None
        self._change("_camera", view)
        self._watch_camera()

    def GetCamera(self) -> Camera | None:
        """Return the generating view on the screen, before coverage widens it."""
        if self._track and self._given is not None and self._given.has_moved:
            self._camera = self._given.read()
        return self._camera

    def SetTrackCamera(self, track: bool) -> None:
        """Choose whether the ``vtkCamera`` that :meth:`SetCamera` was given is followed.

        Off by default. While it is on, the VDI is out of date as soon as that camera has moved,
        and the next update makes it anew; turned off, the view stays as it is then.
        """
        track = bool(track)
        if track == self._track:
            return
        if not track:
            self.GetCamera()
        self._track = track
        self._watch_camera()
        if self._given is not None and self._given.has_moved:
            self.Modified()

    def GetTrackCamera(self) -> bool:
        """Whether the camera is followed."""
        return self._track

    def TrackCameraOn(self) -> None:
        """Follow the camera."""
        self.SetTrackCamera(True)

    def TrackCameraOff(self) -> None:
        """Keep the view as it is."""
        self.SetTrackCamera(False)

    def SetWindowSize(self, *size: Any) -> None:
        """Set the screen's width and height in pixels, as two numbers or one pair."""
        pair = size[0] if len(size) == 1 else size
        self._change("_window_size", None if pair is None else check_window_size(pair))

    def GetWindowSize(self) -> tuple[int, int] | None:
        """Return the screen's width and height in pixels."""
        return self._window_size

    def SetCoverage(self, coverage: str) -> None:
        """Choose what the VDI's window covers.

        Parameters
        ----------
        coverage : {"view", "bounds"}
            ``"view"``: the window as it is. ``"bounds"``: the smallest rectangle of the screen's
            pixel grid that contains the whole volume; where the eye is inside the volume's
            bounds, or they reach behind it, a ``VDIWarning`` is given and the window is used.
        """
        if coverage not in COVERAGES:
            raise InvalidArgumentError(f"coverage must be 'bounds' or 'view'; got {coverage!r}")
        self._change("_coverage", coverage)

    def GetCoverage(self) -> str:
        """Return what the VDI's window covers."""
        return self._coverage

    def SetVolumeProperty(self, prop: vtkVolumeProperty | None) -> None:
        """Set the volume property; later changes to it make the VDI out of date.

        Raises
        ------
        UnsupportedError, InvalidArgumentError
            If it cannot be honoured: see ``transfer_function_from_property``.
        """
        if prop is not None:
            transfer_function_from_property(prop, rgba=not prop.GetIndependentComponents())
        if prop is not self._property:
            self._property = prop
            self._observe_property()
            self.Modified()

    def GetVolumeProperty(self) -> vtkVolumeProperty | None:
        """Return the volume property."""
        return self._property

    def SetLights(self, lights: Any) -> None:
        """Set what a shaded volume is lit by.

        Parameters
        ----------
        lights : None, vtkRenderer, Lights or iterable of vtkLight, pyvista.Light or Light
            ``None``, the default, is one headlight. A renderer's lights are looked at whenever
            the VDI is asked for, and other lights make another VDI; lights that merely follow the
            camera do not. What is given as a list is copied now.
        """
        renderer = lights if hasattr(lights, "GetTwoSidedLighting") else None
        fixed = None if lights is None or renderer is not None else Lights.from_any(lights)
        if renderer is not self._lit_by.Get():
            self._lit_by.Set(renderer)
            self.Modified()
        self._change("_lights", fixed)

    def GetLights(self) -> Lights:
        """Return what a shaded volume is lit by, as it is now."""
        renderer = self._lit_by.Get()
        return Lights.from_any(self._lights if renderer is None else renderer)

    def CheckLights(self) -> None:
        """Be out of date if the renderer that lights the volume has other lights by now."""
        made = self._request
        lit = made is not None and made.transfer_function.shading is not None
        if made is not None and lit and made.options.lights != self.GetLights():
            self.Modified()

    def SetOptions(self, options: GenerationOptions) -> None:
        """Set how the VDI is made, all of it at once; lights are set by :meth:`SetLights`."""
        distance = options.sample_distance
        if distance is not None and not (np.isfinite(distance) and distance > 0):
            raise InvalidArgumentError(
                f"sample_distance must be a positive length in model units; got {distance!r}"
            )
        self._change("_options", options)

    def GetOptions(self) -> GenerationOptions:
        """Return how the VDI is made."""
        return self._options

    SetMaxSupersegments, GetMaxSupersegments = _option(
        "max_supersegments", "limit", "the longest list, 1 to 4096"
    )
    SetCriterion, GetCriterion = _option(
        "criterion", "criterion", "what decides where a list that must be shortened is cut"
    )
    SetSampleDistance, GetSampleDistance = _option(
        "sample_distance",
        "distance",
        "the length of a step, model units; ``None`` is half the smallest spacing",
    )
    SetTolerance, GetTolerance = _option(
        "tolerance",
        "tolerance",
        "the error that may be traded for shorter lists; 0 merges only what is homogeneous",
    )
    SetViewCone, GetViewCone = _option(
        "view_cone",
        "degrees",
        "the half angle of the cone of views that must be served, 0 to 90 degrees",
    )
    SetPrecision, GetPrecision = _option(
        "precision",
        "precision",
        'what a supersegment takes, where no dial chooses it: "exact", "16-byte" or "8-byte"',
    )
    SetAmbientOcclusion, GetAmbientOcclusion = _option(
        "ambient_occlusion",
        "occlusion",
        "whether what is hidden from the light around it is darkened; ``None`` where it is not",
        "``None`` or ``False``: no, which is the default; ``True``: with the default radius; a\n"
        "number: with this radius, model units; or an ``AmbientOcclusion``.\n\n",
    )
    SetMemoryLimit, GetMemoryLimit = _option(
        "memory_limit",
        "limit",
        "the most bytes that generating may take on the device, if they are limited",
        'Bytes, or a text such as ``"2 GiB"``; ``None``, the default, is what the device has. The\n'
        "estimate whether a view needs a VDI of its own keeps to the limit by itself.\n\n",
    )

    def SetDial(
        self,
        quality: str | None = None,
        *,
        target_ssim: float | None = None,
        target_fps: float | None = None,
        max_bytes: int | None = None,
        target_angle: float = TARGET_ANGLE,
    ) -> None:
        """Have settings chosen by what the VDI is to reach; without arguments, no longer.

        It chooses the lists of the window, ``MaxSupersegments`` and ``Precision``, which have to
        have their defaults, as ``Tolerance`` has to; ``GetVDI().metadata["dial"]`` says what it
        chose.

        Parameters
        ----------
        quality, target_ssim, target_fps, max_bytes, target_angle
            As for :func:`pyvista_vdi.generate`.

        Raises
        ------
        InvalidArgumentError
            If one is out of range, or they contradict each other.
        """
        dial = Dial.of(quality, target_ssim, target_fps, max_bytes, target_angle)
        self._change("_dial", dial)

    def GetDial(self) -> Dial | None:
        """Return what the VDI is to reach; ``None`` where nothing is to be chosen."""
        return self._dial

    def SetDevice(self, device: Any) -> None:
        """Choose the OpenCL device; ``None`` is the default one."""
        self._change("_device", device)

    def GetDevice(self) -> Any:
        """Return the device as it was set."""
        return self._device

    def SetProgressCallback(self, progress: Progress | None) -> None:
        """Set a callable that gets the fraction done; if it returns ``False`` the work stops.

        ``ProgressEvent`` is invoked as well, and ``SetAbortExecute(1)`` in it stops the work.
        """
        self._progress = progress

    def SetMetadata(self, metadata: dict[str, Any]) -> None:
        """Set entries to add to the VDI's metadata."""
        self._change("_metadata", dict(metadata))

    # -- results ---------------------------------------------------------------------------------

    def Update(self, *args: Any) -> Any:
        """Bring the output up to date, and raise what went wrong."""
        self.CheckLights()
        if not self._update(*args):
            raise InvalidVolumeError(
                "what is before VDISource failed: VTK's output window says why"
                if self.GetNumberOfInputConnections(0) > 0
                else _NO_INPUT
            )

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

        This brings the pipeline before the source up to date, and generates nothing.

        Raises
        ------
        VDIError
            What :meth:`GetVDI` would raise before it generates.
        """
        data = self._input()
        return self._make_request(
            data,
            self.GetCamera() if view is None else view.camera,
            self._window_size if view is None else view.size,
            warn=False,
        )

    def TakeVDI(self, vdi: VDI, request: Request) -> None:
        """Take a VDI that was made of a request elsewhere, as if it had been made here."""
        self._window_size = request.screen.size
        if not (self._track and self._given is not None):  # which goes on to be followed
            self._camera = request.screen.camera
        self._vdi, self._request = vdi, request
        self.Modified()  # the output is another

    def GetVolume(self) -> Volume:
        """Return the volume at the input, read again only if it has changed; raises if none is."""
        return self._read(self._input())

    def _input(self) -> Any:
        """Return the data at the input, brought up to date."""
        if self.GetNumberOfInputConnections(0) == 0:
            raise InvalidVolumeError(_NO_INPUT)
        self.GetInputAlgorithm(0, 0).Update()
        return self.GetInputDataObject(0, 0)

    def GetInputBounds(self) -> tuple[float, ...] | None:
        """Return the volume's bounds, model frame, without making a VDI; ``None`` without input."""
        image = self._input_grid()
        return None if image is None else tuple(image.GetBounds())

    # -- the pipeline's requests -----------------------------------------------------------------

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Announce the output's extent: one point per list."""
        width, height = 1, 1
        grid = self._input_grid()
        try:
            camera = self.GetCamera()
        except VDIError:
            camera = None  # RequestData says what is wrong with it
        if grid is not None and camera is not None and self._window_size is not None:
            _, (width, height) = self._view(grid, camera, self._window_size, warn=False)
        announce(outputs, (width, height))
        return 1

    def RequestData(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Generate, unless nothing that matters has changed."""
        super().RequestData(request, inputs, outputs)
        if self._error is not None:  # aborted, the next update tries again
            self.SetAbortOutput(isinstance(self._error, Cancelled))
        return 1

    # -- how -------------------------------------------------------------------------------------

    def _execute(self, inputs: Any, outputs: Any) -> None:
        if self._aborted():
            raise Cancelled("generating a VDI was aborted before it began")
        image = vtkDataObject.GetData(inputs[0], 0)
        request = self._make_request(image, self.GetCamera(), self._window_size, warn=True)
        if self._vdi is None or self._request is None or request.key != self._request.key:
            self._vdi = generate_by_dial(
                *request.arguments,
                request.dial,
                request.options,
                device=request.device,
                progress=self._advance,
                metadata=request.metadata,
            )
            self._request = request
            warn_missed(self._vdi, stacklevel=2)
        vtkImageData.GetData(outputs, 0).ShallowCopy(vdi_to_image(self._vdi))
        if self._dial is not None:
            announce(outputs, self._vdi.window_size)  # which it has chosen only now
            ask_for_all([outputs])

    def _make_request(
        self,
        image: Any,
        camera: Camera | None,
        window_size: tuple[int, int] | None,
        *,
        warn: bool,
    ) -> Request:
        missing = [
            f"{what} ({setter})"
            for what, setter, value in (
                ("camera", "SetCamera", camera),
                ("window size", "SetWindowSize", window_size),
                ("volume property", "SetVolumeProperty", self._property),
            )
            if value is None
        ]
        if missing:
            raise InvalidArgumentError(f"VDISource has no {', no '.join(missing)}")
        assert camera is not None
        assert window_size is not None
        volume = self._read(image)
        table = transfer_function_from_property(self._property, rgba=volume.rgba)
        lights = self.GetLights() if table.shading else Lights()
        options = replace(self._options, lights=lights)
        return Request(
            volume,
            table,
            View(camera, window_size),
            self._view(image, camera, window_size, warn=warn),
            options,
            self._dial,
            self._device,
            {"scalars": volume.name, **self._metadata},
            (self._volume_key, table, options, self._dial, self._device, self._metadata),
        )

    def _read(self, image: Any) -> Volume:
        """Return the volume; the same object as long as it is the same (it is on the device)."""
        if image is None:
            raise InvalidVolumeError("what is before VDISource gives no data: check its input")
        image = require_image(image)
        array = scalars_of(image, self._scalars, self._preference)
        direction = image.GetDirectionMatrix()
        key = (
            array.GetAddressAsString(""),
            array.GetMTime(),
            image.GetExtent(),
            image.GetSpacing(),
            image.GetOrigin(),
            tuple(direction.GetElement(i, j) for i in range(3) for j in range(3)),
        )
        if self._volume is None or key != self._volume_key:
            self._volume = volume_from_vtk(image, self._scalars, self._preference)
            self._volume_key = key
        return self._volume

    def _view(
        self, grid: vtkImageData, camera: Camera, window_size: tuple[int, int], *, warn: bool
    ) -> tuple[Camera, tuple[int, int]]:
        """Return the generating view and its window, after coverage."""
        if self._coverage == "bounds":
            wide = covering_view(camera, window_size, _corners(grid))
            if wide is not None:
                return wide
            if warn:
                warnings.warn(
                    "coverage='bounds' needs the eye outside the volume, with all of it in "
                    "front: the VDI covers the current view only (coverage='view'); move the "
                    "camera back and regenerate for the whole volume",
                    VDIWarning,
                    stacklevel=2,
                )
        return camera, window_size

    def _input_grid(self) -> vtkImageData | None:
        """Return the input's geometry, without reading its data."""
        if self.GetNumberOfInputConnections(0) == 0:
            return None
        producer = self.GetInputAlgorithm(0, 0)
        producer.UpdateInformation()
        information = self.GetInputInformation(0, 0)
        extent = whole_extent(information)
        grid = vtkImageData()
        data = self.GetInputDataObject(0, 0)
        if data is not None and not isinstance(data, vtkImageData):
            return None
        if data is not None and data.GetNumberOfPoints() > 0:
            grid.CopyStructure(data)
            return grid
        if extent is None:
            return None
        grid.SetExtent(extent)
        for key, put in (
            (vtkImageData.SPACING(), grid.SetSpacing),
            (vtkImageData.ORIGIN(), grid.SetOrigin),
            (vtkImageData.DIRECTION(), grid.SetDirectionMatrix),
        ):
            if information.Has(key):
                put(information.Get(key))
        return grid

    def _advance(self, fraction: float) -> bool:
        self.UpdateProgress(fraction)
        going_on = self._progress is None or self._progress(fraction) is not False
        return going_on and not self._aborted()

    def _aborted(self) -> bool:
        """Whether this algorithm, or one before it, is to stop."""
        return bool(self.GetAbortExecute() or self.CheckAbort())

    def _watch_camera(self) -> None:
        if self._given is not None:
            self._given.watch(VDISource.Modified if self._track else None)

    def _observe_property(self) -> None:
        """Let changes to the property or its functions reach this algorithm's time stamp."""
        for watched, tag in self._observed:
            watched.RemoveObserver(tag)
        self._observed = []
        prop = self._property
        if prop is None:
            return
        weak = vtkWeakReference()  # the property must not keep this algorithm alive
        weak.Set(self)

        def changed(caller: Any, event: str) -> None:
            source = weak.Get()
            if source is None:
                return
            if caller is source._property:
                source._observe_property()  # its functions may be others now
            source.Modified()

        functions = [color_function(prop), prop.GetScalarOpacity()]
        if prop.HasGradientOpacity():
            functions.append(prop.GetStoredGradientOpacity())
        for watched in (prop, *functions):
            self._observed.append((watched, watched.AddObserver("ModifiedEvent", changed)))


def _end_abort(source: Any, event: str) -> None:
    """Take back an abort that has been obeyed: it is of one execution.

    Not before the end, or VTK would report the work as finished, and whoever aborts in each
    ``ProgressEvent`` would do it again.
    """
    if source.GetAbortOutput():
        source.SetAbortExecute(0)


def _corners(grid: vtkImageData) -> NDArray[np.float64]:
    """Return the corners of the box of points, model frame: tighter than bounds if rotated."""
    out: list[list[float]] = []
    for i, j, k in bounds_corners(grid.GetExtent()).astype(int):
        point = [0.0, 0.0, 0.0]
        grid.TransformIndexToPhysicalPoint(int(i), int(j), int(k), point)
        out.append(point)
    return np.array(out)
