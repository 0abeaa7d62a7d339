"""``VDIToImage``: from a VDI in a VTK pipeline to a picture of it."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError, InvalidVDIError
from pyvista_vdi.io import to_bytes
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import as_number, not_taken
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.model.vdi import VDI, picture_size, picture_view
from pyvista_vdi.raycasting.classified_values import classify_on_device
from pyvista_vdi.raycasting.raycast import render_vdi
from pyvista_vdi.vtk_pipeline.filters.algorithm import (
    announce,
    ask_for_all,
    whole_extent,
)
from pyvista_vdi.vtk_pipeline.filters.classifying import Classifying
from pyvista_vdi.vtk_pipeline.filters.convert import (
    is_vdi_image,
    to_vtk,
    vdi_from_image,
    view_of_image,
)
from pyvista_vdi.vtk_pipeline.filters.properties import transfer_function_from_property
from pyvista_vdi.vtk_pipeline.filters.view import camera_of
from pyvista_vdi.vtk_pipeline.vtk import VTK_UNSIGNED_CHAR, vtkImageData

#: Point scalars of the picture: straight RGBA, uint8.
STRAIGHT = "RGBA"
#: Their type and components.
SCALARS = (VTK_UNSIGNED_CHAR, 4)
#: Its other point array: what was rendered, premultiplied RGBA, float32.
PREMULTIPLIED = "premultiplied"


def _checked_degrees(value: Any) -> float:
    """Return an angle as a float, or raise InvalidArgumentError."""
    degrees = as_number(value)
    if not np.isfinite(degrees):
        raise not_taken(value)(f"a view is turned by a finite angle, degrees; got {value!r}")
    return degrees


class VDIToImage(Classifying):
    """Raycast the VDI at its input, and put out the picture.

    In goes a VDI in its canonical VTK form (see
    :func:`~pyvista_vdi.vtk_pipeline.filters.convert.vdi_to_image`); out comes a ``vtkImageData`` of
    W x H x 1 points, bottom row first, one per pixel, with the point scalars ``RGBA`` (uint8,
    straight, for display) and the point array ``premultiplied`` (float32, what
    :func:`pyvista_vdi.render` returns). It executes again only if the VDI or a setting has changed.
    A VDI that keeps values is classified by the volume property (:meth:`SetVolumeProperty`), whose
    changes are followed; nothing is generated. One with colours has no use for it.

    Notes
    -----
    Settings are checked when they are set. Python's ``Update`` and :meth:`GetImage` raise what
    went wrong; an update that VTK asks for writes it to VTK's output window and gives an empty
    image.
    """

    def __init__(self) -> None:
        super().__init__(
            nInputPorts=1, inputType="vtkImageData", nOutputPorts=1, outputType="vtkImageData"
        )
        self._camera: Camera | None = None
        self._azimuth = 0.0
        self._elevation = 0.0
        self._window_size: tuple[int, int] | None = None
        self._device: Any = None
        self._vdi: VDI | DeferredVDI | None = None
        self._vdi_of: tuple[str, int] | None = None
        self._look: VDI | None = None
        self._look_of: Any = None

    def SetCamera(self, camera: Any, model_transform: ArrayLike | None = None) -> None:
        """Set the new view V_N.

        Parameters
        ----------
        camera : vtkCamera or pyvista.Camera or Camera or None
            A copy is kept. ``None``, the default, means the generating view.
        model_transform : array_like, shape (4, 4), optional
            Where the VDI's model frame is in that view's world.

        Raises
        ------
        InvalidCameraError, UnsupportedError
            If it is no camera, or has what the optical model has no place for.
        """
        view = None if camera is None else camera_of(camera, model_transform)
        self._change("_camera", view)

    def GetCamera(self) -> Camera | None:
        """Return the view before it is turned, or ``None`` for the generating view."""
        return self._camera

    def SetAzimuth(self, degrees: float) -> None:
        """Turn the view about its up direction through the focal point, as VTK's ``Azimuth``."""
        self._change("_azimuth", _checked_degrees(degrees))

    def GetAzimuth(self) -> float:
        """Return by how much the view is turned, degrees."""
        return self._azimuth

    def SetElevation(self, degrees: float) -> None:
        """Lift the view through the focal point, after turning it, as VTK's ``Elevation``."""
        self._change("_elevation", _checked_degrees(degrees))

    def GetElevation(self) -> float:
        """Return by how much the view is lifted, degrees."""
        return self._elevation

    def SetDevice(self, device: Any) -> None:
        """Choose the OpenCL device; ``None`` is the default one."""
        self._change("_device", device)

    def GetDevice(self) -> Any:
        """Return the device as it was set."""
        return self._device

    def SetWindowSize(self, *size: Any) -> None:
        """Set the picture's width and height in pixels.

        ``None``, the default, is :attr:`VDI.picture_size`.
        """
        pair = size[0] if len(size) == 1 else size
        self._change("_window_size", None if pair is None else check_window_size(pair))

    def GetWindowSize(self) -> tuple[int, int] | None:
        """Return the picture's width and height in pixels, or ``None`` for the VDI's."""
        return self._window_size

    def GetImage(self) -> vtkImageData:
        """Return the picture, brought up to date.

        Raises
        ------
        VDIError
            What :func:`pyvista_vdi.render` raises.
        """
        self.Update()
        return self.GetOutputDataObject(0)

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Announce the output's extent: one point per pixel."""
        announce(outputs, self._window_size or self._announced_size(inputs) or (1, 1), SCALARS)
        return 1

    def _announced_size(self, inputs: Any) -> tuple[int, int] | None:
        """Return the size of the pictures that the VDI was made for, as far as it is known."""
        size = getattr(self.GetInputAlgorithm(0, 0), "picture_size", None)
        if size is not None:
            return size  # type: ignore[no-any-return]
        image = vtkImageData.GetData(inputs[0], 0)
        if is_vdi_image(image):
            with contextlib.suppress(InvalidVDIError):  # _execute says it
                metadata = view_of_image(image)["metadata"]
                return picture_size(image.GetDimensions()[:2], metadata)
        whole = whole_extent(inputs[0].GetInformationObject(0))
        return (whole[1] - whole[0] + 1, whole[3] - whole[2] + 1) if whole else None

    def _execute(self, inputs: Any, outputs: Any) -> None:
        vdi = self._classified(self._read(vtkImageData.GetData(inputs[0], 0)))
        own, own_size = picture_view(vdi)
        view = own if self._camera is None else self._camera
        view = view.azimuth(self._azimuth) if self._azimuth else view
        view = view.elevation(self._elevation) if self._elevation else view
        size = self._window_size or own_size
        # Known only now, where another program's reader gives the VDI
        announce(outputs, size, SCALARS)
        ask_for_all([outputs])
        pixels = render_vdi(vdi, FrameRequest(view, size, device=self._device))
        vtkImageData.GetData(outputs, 0).ShallowCopy(rgba_to_image(pixels))

    def _classified(self, vdi: VDI | DeferredVDI) -> VDI:
        """Return a VDI, or what the volume property shows of one that keeps values."""
        if isinstance(vdi, VDI):
            return vdi
        prop = self.GetVolumeProperty()
        if prop is None:
            raise InvalidArgumentError(
                "the VDI keeps values, and VDIToImage has no volume property that classifies them: "
                "call SetVolumeProperty"
            )
        key = (self._vdi_of, prop.GetAddressAsString(""), prop.GetMTime())
        if self._look is None or key != self._look_of:
            table = transfer_function_from_property(prop)
            self._look = classify_on_device(vdi, table, self._device)
            self._look_of = key
        return self._look

    def _read(self, image: vtkImageData) -> VDI | DeferredVDI:
        """Return the VDI; the same object as long as it is the same (it is on the device)."""
        # Not the image itself: before 9.7 VTK frees a node of its table of wrappers twice where an
        # algorithm's last attribute goes that is data (vtkPythonUtil::FindObject)
        key = (image.GetAddressAsString(""), image.GetMTime()) if is_vdi_image(image) else None
        if self._vdi is None or key is None or key != self._vdi_of:
            self._vdi = vdi_from_image(image)
            self._vdi_of = key
        return self._vdi


def rgba_to_image(pixels: NDArray[np.float32]) -> vtkImageData:
    """Return a rendered picture, (H, W, 4), as :class:`VDIToImage` puts it out."""
    height, width = pixels.shape[:2]
    image = vtkImageData()
    image.SetDimensions(width, height, 1)
    bottom_first = np.ascontiguousarray(pixels[::-1])
    for name, values in ((STRAIGHT, to_bytes(bottom_first)), (PREMULTIPLIED, bottom_first)):
        image.GetPointData().AddArray(to_vtk(name, values.reshape(-1, 4)))
    image.GetPointData().SetActiveScalars(STRAIGHT)
    return image
