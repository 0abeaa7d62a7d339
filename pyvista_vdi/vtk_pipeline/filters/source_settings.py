"""The settings of :class:`VDISource`, with VTK's names: what it makes a VDI of, and how."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.arguments import takes
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import as_float, as_range, not_taken
from pyvista_vdi.model.lighting import Lights
from pyvista_vdi.model.options import Deferral, GenerationOptions, QualityTarget
from pyvista_vdi.model.types import (
    CameraLike,
    DeviceLike,
    LightsLike,
    Progress,
)
from pyvista_vdi.vtk_pipeline.filters.algorithm import Algorithm
from pyvista_vdi.vtk_pipeline.filters.classifying import Classifying
from pyvista_vdi.vtk_pipeline.filters.convert import require_image, require_image_port
from pyvista_vdi.vtk_pipeline.filters.option_methods import OptionMethods
from pyvista_vdi.vtk_pipeline.filters.view import TrackedCamera, camera_of
from pyvista_vdi.vtk_pipeline.vtk import (
    require_this_build,
    vtkImageData,
    vtkWeakReference,
)

#: What a VDI's window covers.
COVERAGES = ("bounds", "view")

#: Attributes of a source that are settings as they are.
_PLAIN = (
    "_window_size",
    "_coverage",
    "_scalars",
    "_preference",
    "_options",
    "_deferral",
    "_target",
    "_device",
    "_lights",
    "_placed",
    "_progress",
    "_metadata",
)


class SourceSettings(OptionMethods, Classifying):
    """What can be set of a source; each setting is checked when it is set."""

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
        self._deferral = Deferral()
        self._target: QualityTarget | None = None
        self._device: Any = None
        self._lights = Lights()  # of the renderer, as they were read last
        self._lit_by = vtkWeakReference()
        self._placed: Any = None  # rows of the actor's matrix
        self._progress: Progress | None = None
        self._metadata: dict[str, Any] = {}

    def TakeSettings(self, other: SourceSettings) -> None:
        """Set everything as it is set of another source, its input apart."""
        if other._given is not None:
            self.SetCamera(other._given.camera, other._given.model_transform)
        self.SetTrackCamera(other.GetTrackCamera())
        self._lit_by.Set(other._lit_by.Get())
        for name in _PLAIN:
            setattr(self, name, getattr(other, name))
        self._camera = other.GetCamera()
        self.SetVolumeProperty(other.GetVolumeProperty())
        self.Modified()

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

    def GetPreference(self) -> str:
        """Return which array is taken where points and cells have one of that name."""
        return self._preference

    def SetCamera(
        self, camera: CameraLike | None, model_transform: ArrayLike | None = None
    ) -> None:
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
        require_this_build(type(camera))
        view = None if camera is None else camera_of(camera, model_transform)
        if self._given is not None:
            self._given.watch(None)
        follows = hasattr(camera, "GetMTime")  # a VTK object
        self._given = TrackedCamera(camera, model_transform, self) if follows else None
        self._change("_camera", view)
        self._watch_camera()

    def PlaceCamera(self, model_transform: ArrayLike) -> None:
        """Set where the volume stands in the world of the camera that was given, (4, 4)."""
        if self._given is not None:
            self._given.model_transform = model_transform
        if self._camera is not None:
            self._change("_camera", self._camera.replace(model_transform=model_transform))

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
        self._change("_coverage", str(coverage))

    def GetCoverage(self) -> str:
        """Return what the VDI's window covers."""
        return self._coverage

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
        self._lit_by.Set(renderer)
        self._change("_lights", Lights.from_any(lights))

    def GetLights(self) -> Lights:
        """Return what a shaded volume is lit by; of a renderer, as its lights are now."""
        renderer = self._lit_by.Get()
        lights = self._lights if renderer is None else Lights.from_any(renderer)
        if lights != self._lights:
            self._lights = lights
            if self._is_shaded():
                self.Modified()
        return self._lights

    def CheckLights(self) -> None:
        """Be out of date if a shaded volume's renderer has other lights by now."""
        if self._is_shaded():
            self.GetLights()

    def GetLitBy(self) -> Any:
        """Return the renderer whose lights are looked at; ``None`` where there is none."""
        return self._lit_by.Get()

    def SetLitBy(self, renderer: Any) -> None:
        """Look at the lights of another renderer; ``None`` leaves them as they were read last."""
        self._lit_by.Set(renderer)

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

    def SetOptions(self, options: GenerationOptions) -> None:
        """Set how the VDI is made, all of it at once; lights are set by :meth:`SetLights`."""
        distance = options.sample_distance
        if distance is not None and not 0 < as_float(distance) < np.inf:
            raise not_taken(distance)(
                f"sample_distance must be a positive length in model units; got {distance!r}"
            )
        self._change("_options", options)

    def GetOptions(self) -> GenerationOptions:
        """Return how the VDI is made."""
        return self._options

    @takes(target=QualityTarget, order=("quality",), flat=True)
    def SetDial(self, target: QualityTarget) -> None:
        """Choose settings by what the VDI is to reach; without arguments, no longer.

        It chooses the lists of the window, ``MaxSupersegments`` and ``Precision``, which have to
        have their defaults, as ``Tolerance`` has to; ``GetVDI().metadata["dial"]`` says what it
        chose.

        Raises
        ------
        InvalidArgumentError
            If one is out of range, or they contradict each other.
        """
        self.SetTarget(target)

    def SetTarget(self, target: QualityTarget) -> None:
        """Choose settings by what the VDI is to reach, as by :meth:`SetDial`."""
        self._change("_target", target or None)

    def GetDial(self) -> QualityTarget | None:
        """Return what the VDI is to reach; ``None`` where nothing is to be chosen."""
        return self._target

    @takes(deferral=Deferral, order=Deferral.declared, flat=True)
    def SetDeferral(self, deferral: Deferral) -> None:
        """Choose when scalars are classified; without arguments, as the VDI is made.

        ``"deferred"`` makes a :class:`~pyvista_vdi.DeferredVDI`: of the volume property, which may
        be left out, only the interpolation counts then.

        Raises
        ------
        InvalidArgumentError
            If one is out of range, or they contradict each other.
        """
        if deferral.value_range is not None:  # a pair tells whether another is the same
            deferral = replace(deferral, value_range=as_range(deferral.value_range))
        self._change("_deferral", deferral)

    def GetDeferral(self) -> Deferral:
        """Return when scalars are classified."""
        return self._deferral

    def SetDevice(self, device: DeviceLike | None) -> None:
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

    def _watch_camera(self) -> None:
        if self._given is not None:
            self._given.watch(Algorithm.Modified if self._track else None)
