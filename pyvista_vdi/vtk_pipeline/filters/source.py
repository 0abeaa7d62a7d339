"""``VDISource``: from a volume in a VTK pipeline to a VDI."""

from __future__ import annotations

import weakref
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pyvista_vdi.errors import (
    Cancelled,
    InvalidArgumentError,
    InvalidVolumeError,
    UnsupportedError,
    VDIError,
    warn_external,
)
from pyvista_vdi.generation.deferred import generate_deferred, unclassified
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.coverage import bounds_corners, covering_view
from pyvista_vdi.model.lighting import Lights
from pyvista_vdi.model.options import (
    Deferral,
    GenerationOptions,
    GenerationRequest,
    QualityTarget,
)
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI, screen_metadata
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.quality.targets import generate_to_target, warn_missed
from pyvista_vdi.vtk_pipeline.filters.algorithm import (
    UPDATE_TIME_STEP,
    announce,
    ask_for_all,
    is_aborted,
    wanted_time,
    whole_extent,
)
from pyvista_vdi.vtk_pipeline.filters.convert import (
    require_image,
    scalars_of,
    vdi_to_image,
    volume_from_vtk,
)
from pyvista_vdi.vtk_pipeline.filters.properties import (
    INTERPOLATION,
    check_property,
    transfer_function_from_property,
)
from pyvista_vdi.vtk_pipeline.filters.source_settings import SourceSettings
from pyvista_vdi.vtk_pipeline.filters.view import View
from pyvista_vdi.vtk_pipeline.vtk import vtkDataObject, vtkImageData


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


class VDISource(SourceSettings):
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
    regenerate, unless :meth:`SetTrackCamera` asks for it. Without a camera, a :class:`VDIMapper`
    behind it sets the view of its first frame that has something to draw. Settings are checked when
    they are set. Python's ``Update`` and :meth:`GetVDI` raise what went wrong; an update that VTK
    asks for writes it to VTK's output window and gives an empty image.

    ``ProgressEvent`` is invoked while it works, and ``SetAbortExecute(1)`` or
    ``SetAbortExecuteAndUpdateTime()`` stops the work, also from before the update or in an
    algorithm upstream: Python's ``Update`` raises ``Cancelled`` then, an update that VTK asks for
    gives an empty image. What had been made before stays, and the next update begins anew: an
    abort is of one execution.
    """

    bad_input = InvalidVolumeError

    def __init__(self) -> None:
        super().__init__()
        self._volume: Volume | None = None
        self._volume_key: Any = None
        self._table: TransferFunction | None = None
        self._table_key: Any = None
        self._vdi: VDI | None = None
        self._request: Request | None = None
        self.AddObserver("EndEvent", _end_abort)
        self.inputs: weakref.WeakSet[Any] = weakref.WeakSet()  # mappers' inputs that draw this

    def Update(self, *args: Any) -> None:
        """Bring the output up to date, and raise what went wrong."""
        self.CheckLights()
        self._check_input()
        super().Update(*args)

    def _check_input(self) -> None:
        """Be out of date if somebody has brought the input to another time, and this asks for none.

        VTK's filters look at the data of their input only when they have reason to execute.
        """
        if self._request is None or self.GetNumberOfInputConnections(0) == 0:
            return
        data = self.GetInputDataObject(0, 0)
        if (
            wanted_time(self.GetOutputInformation(0)) is None
            and isinstance(data, vtkImageData)
            and data.GetNumberOfPoints() > 0
            and self._read(data) is not self._request.volume
        ):
            self.Modified()

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

    def GetCurrentVolume(self) -> Volume | None:
        """Return the volume read last, whether up to date or not."""
        return self._volume

    def GetCurrentRequest(self) -> Request | None:
        """Return what the VDI made last was made of."""
        return self._request

    def MakeRequest(self, view: View | None = None) -> Request:
        """Return what the next VDI would be made of, from another view if one is given.

        This brings the pipeline before the source up to date, and generates nothing; it raises what
        :meth:`GetVDI` would raise before it generates.
        """
        if self._deferral.deferred:
            raise UnsupportedError(
                "this VDISource keeps values, and a mapper draws colours: give add_vdi or "
                "VDIToImage what it makes, or VDIMapper GetVDI().classified(cmap=..., opacity=...)"
            )
        data = self.UpdateInput()
        return self._make_request(
            data,
            self.GetCamera() if view is None else view.camera,
            self._window_size if view is None else view.size,
            warn=False,
        )

    def TakeVDI(self, vdi: VDI, request: Request, *, view: bool = True) -> None:
        """Take a VDI that was made of a request elsewhere, as if it had been made here.

        ``view``: its view becomes that of the VDIs to come.
        """
        if view:
            self._window_size = request.screen.size
        if view and not (self._track and self._given is not None):  # which goes on to be followed
            self._camera = request.screen.camera
        self._vdi, self._request = vdi, request
        self.Modified()  # the output is another

    def MakeVDI(self, request: Request) -> VDI:
        """Return the VDI of a request, made now; what the source has made stays."""
        return self._generate(request)

    def GetVolume(self) -> Volume:
        """Return the volume at the input, read again only if it has changed; raises if none is."""
        return self._read(self.UpdateInput())

    def Copy(self) -> VDISource:
        """Return another source with this one's input, settings and VDI.

        The volume and its property are shared; what is set of one is not set of the other.
        """
        other = VDISource()
        other.TakeSettings(self)
        other.SetInputConnection(self.GetInputConnection(0, 0))
        other._volume, other._volume_key = self._volume, self._volume_key
        other._vdi, other._request = self._vdi, self._request
        return other

    def NewInstance(self) -> VDISource:
        """Return another source of this class, with no input and no settings."""
        return type(self)()

    def UpdateInput(self) -> Any:
        """Return the data at the input, up to date and as of the time that is asked of the source.

        Raises
        ------
        InvalidVolumeError
            If there is no input.
        """
        if self.GetNumberOfInputConnections(0) == 0:
            raise InvalidVolumeError(self._no_input())
        time = wanted_time(self.GetOutputInformation(0))
        if time is not None:  # else what others asked for is as good
            self.GetInputInformation(0, 0).Set(UPDATE_TIME_STEP, time)
        self.GetInputAlgorithm(0, 0).Update()
        return self.GetInputDataObject(0, 0)

    def GetInputBounds(self) -> tuple[float, ...] | None:
        """Return the volume's bounds, model frame; ``None`` where there is no volume.

        The input is brought up to date, as by VTK's mappers, because many filters announce other
        bounds than they give; no VDI is made.
        """
        if self.GetNumberOfInputConnections(0) == 0:
            return None
        data = self.UpdateInput()
        if isinstance(data, vtkImageData):
            return tuple(data.GetBounds()) if data.GetNumberOfPoints() else None
        return self._known_bounds()

    def _known_bounds(self) -> tuple[float, ...] | None:
        """Return the volume's bounds, as far as they are known without reading it."""
        image = self._input_grid()
        return None if image is None else tuple(image.GetBounds())

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
        self.picture_size = self._window_size or (width, height)
        announce(outputs, (width, height))
        return 1

    def RequestData(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Generate, unless nothing that matters has changed."""
        super().RequestData(request, inputs, outputs)
        if self._error is not None:  # aborted, the next update tries again
            self.SetAbortOutput(isinstance(self._error, Cancelled))
        return 1

    def _execute(self, inputs: Any, outputs: Any) -> None:
        if self._aborted():
            raise Cancelled("generating a VDI was aborted before it began")
        image = vtkDataObject.GetData(inputs[0], 0)
        request = self._make_request(image, self.GetCamera(), self._window_size, warn=True)
        if self._vdi is None or self._request is None or request.key != self._request.key:
            self._vdi = self._generate(request)
            self._request = request
            if request.target is not None:
                warn_missed(self._vdi)
        vtkImageData.GetData(outputs, 0).ShallowCopy(vdi_to_image(self._vdi))
        # A dial has chosen it only now, and a volume's bounds may change with time
        announce(outputs, self._vdi.window_size)
        ask_for_all([outputs])

    def _generate(self, request: Request) -> VDI:
        asked = request.generation.replace(progress=self._advance)
        if request.deferral.deferred:
            return generate_deferred(asked, request.deferral)  # type: ignore[return-value]
        if request.target is None:
            return generate_vdi(asked)
        return generate_to_target(asked, request.target)

    def _make_request(
        self,
        image: Any,
        camera: Camera | None,
        window_size: tuple[int, int] | None,
        *,
        warn: bool,
    ) -> Request:
        prop = self.GetVolumeProperty()
        needed = {
            "camera (SetCamera)": camera,
            "window size (SetWindowSize)": window_size,
            "volume property (SetVolumeProperty)": prop or self._deferral.deferred or None,
        }
        missing = [what for what, value in needed.items() if value is None]
        if camera is None or window_size is None or missing:
            raise InvalidArgumentError(f"VDISource has no {', no '.join(missing)}")
        volume = self._read(image)
        if prop is None or self._deferral.deferred:
            self._deferral.refuse_target(self._target or QualityTarget())
            table = _unclassified(prop)
        else:
            # Take the property's functions over the volume's scalars, the same until they change
            key = (self._volume_key, prop.GetMTime())
            if self._table is None or key != self._table_key:
                self._table = transfer_function_from_property(prop, volume, rgba=volume.rgba)
                self._table_key = key
            table = self._table
        lights = self.GetLights() if table.shading else Lights()
        options = replace(self._options, lights=lights)
        # Where lights of the scene shine on it, the volume is lit where it stands now
        placed = self._placed if lights.of_scene else None
        screen = View(camera, window_size)
        if placed is not None:
            camera = camera.replace(model_transform=placed)
        return Request(
            volume,
            table,
            screen,
            self._view(image, camera, window_size, warn=warn),
            options,
            self._deferral,
            self._target,
            self._device,
            {"scalars": volume.name, **self._metadata},
            (
                *(self._volume_key, table, options, placed, self._deferral),
                *(self._target, self._device, self._metadata),
            ),
        )

    def _read(self, image: Any) -> Volume:
        """Return the volume; the same object as long as it is the same (it is on the device)."""
        if image is None:
            raise InvalidVolumeError("what is before VDISource gives no data: check its input")
        image = require_image(image)
        array = scalars_of(image, self._scalars, self._preference)
        # The image's time is newer than its arrays', whose values may have been written in place
        key = (array.GetAddressAsString(""), image.GetMTime())
        if self._volume is None or key != self._volume_key:
            if is_aborted(self.GetInputAlgorithm(0, 0)):
                raise Cancelled("what is before VDISource was aborted: its data are not whole")
            self._volume = volume_from_vtk(image, self._scalars, self._preference)
            self._volume_key = key
        return self._volume

    def _view(
        self, grid: vtkImageData, camera: Camera, window_size: tuple[int, int], *, warn: bool
    ) -> tuple[Camera, tuple[int, int]]:
        """Return the generating view and its window, after coverage."""
        if self._coverage == "bounds":
            # The corners of the box of points, model frame: tighter than bounds if rotated
            corners = np.zeros((8, 3))
            for at, corner in zip(bounds_corners(grid.GetExtent()).tolist(), corners, strict=True):
                grid.TransformIndexToPhysicalPoint(*map(int, at), corner)
            wide = covering_view(camera, window_size, corners)
            if wide is not None:
                return wide
            if warn:
                warn_external(
                    "coverage='bounds' needs the eye outside the volume, with all of it in "
                    "front: the VDI covers the current view only (coverage='view'); move the "
                    "camera back and regenerate for the whole volume"
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


def _end_abort(source: Any, event: str) -> None:
    """Take back an abort that has been obeyed: it is of one execution.

    Not before the end, or VTK would report the work as finished, and whoever aborts in each
    ``ProgressEvent`` would do it again.
    """
    if source.GetAbortOutput():
        source.SetAbortExecute(0)
