"""``VDIToImage``: from a VDI in a VTK pipeline to a picture of it."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any

import numpy as np

from pyvista_vdi.errors import InvalidArgumentError, InvalidVDIError
from pyvista_vdi.io import to_bytes
from pyvista_vdi.model.checks import Number
from pyvista_vdi.model.options import FrameRequest
from pyvista_vdi.model.vdi import VDI, DeferredVDI, picture_view
from pyvista_vdi.raycasting.classified_values import classify_on_device
from pyvista_vdi.raycasting.raycast import render_vdi
from pyvista_vdi.vtk_pipeline.filters.algorithm import (
    WHOLE_EXTENT,
    SceneAlgorithm,
    accessors,
    announce,
    ask_for_all,
)
from pyvista_vdi.vtk_pipeline.filters.convert import is_vdi_image, to_vtk, vdi_from_image
from pyvista_vdi.vtk_pipeline.filters.properties import transfer_function_from_property
from pyvista_vdi.vtk_pipeline.vtk import VTK_UNSIGNED_CHAR, vtkImageData

#: Type and components of the picture's point scalars.
SCALARS = (VTK_UNSIGNED_CHAR, 4)

_DEGREES = Number("finite degrees", -math.inf, open_ended=True, name="the angle of a view")


class VDIToImage(SceneAlgorithm):
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

    SetAzimuth, GetAzimuth = accessors(
        "azimuth",
        "by how much the view is turned about its up direction through the focal point, degrees",
        0.0,
        _DEGREES,
    )
    SetElevation, GetElevation = accessors(
        "elevation", "by how much the view is lifted after turning it, degrees", 0.0, _DEGREES
    )

    def __init__(self) -> None:
        super().__init__(
            nInputPorts=1, inputType="vtkImageData", nOutputPorts=1, outputType="vtkImageData"
        )
        self._vdi: VDI | DeferredVDI | None = None
        self._vdi_of: tuple[str, int] | None = None

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
        """Announce the output's extent, one point per pixel, as far as it is known before."""
        image = vtkImageData.GetData(inputs[0], 0)
        size = self.GetWindowSize() or getattr(self.GetInputAlgorithm(0, 0), "picture_size", None)
        if size is None and is_vdi_image(image):
            with suppress(InvalidVDIError):  # _execute says it
                size = picture_view(self._read(image))[1]
        # Before there are data, what stands for a reader in ParaView knows the lists alone
        whole = inputs[0].GetInformationObject(0).Get(WHOLE_EXTENT) or (0,) * 4
        announce(outputs, size or (whole[1] + 1, whole[3] + 1), SCALARS)
        return 1

    def _execute(self, inputs: Any, outputs: Any) -> None:
        vdi = self._read(vtkImageData.GetData(inputs[0], 0))
        if isinstance(vdi, DeferredVDI):
            prop = self.GetVolumeProperty()
            if prop is None:
                raise InvalidArgumentError(
                    "the VDI keeps values, and VDIToImage has no volume property that classifies "
                    "them: call SetVolumeProperty"
                )
            vdi = classify_on_device(vdi, transfer_function_from_property(prop), self.GetDevice())
        view, size = picture_view(vdi)
        view = self.GetCamera() or view
        view = view.azimuth(self.GetAzimuth()) if self.GetAzimuth() else view
        view = view.elevation(self.GetElevation()) if self.GetElevation() else view
        size = self.GetWindowSize() or size
        # Known only now, where another program's reader gives the VDI
        announce(outputs, size, SCALARS)
        ask_for_all([outputs])
        pixels = render_vdi(vdi, FrameRequest(view, size, device=self.GetDevice()))
        bottom_first = np.ascontiguousarray(pixels[::-1])
        image = vtkImageData()
        image.SetDimensions(*size, 1)
        image.GetPointData().SetScalars(to_vtk("RGBA", to_bytes(bottom_first).reshape(-1, 4)))
        image.GetPointData().AddArray(to_vtk("premultiplied", bottom_first.reshape(-1, 4)))
        vtkImageData.GetData(outputs, 0).ShallowCopy(image)

    def _read(self, image: vtkImageData) -> VDI | DeferredVDI:
        """Return the VDI; the same object as long as it is the same (it is on the device)."""
        # Not the image itself: before 9.7 VTK frees a node of its table of wrappers twice where an
        # algorithm's last attribute goes that is data (vtkPythonUtil::FindObject)
        key = (image.GetAddressAsString(""), image.GetMTime()) if is_vdi_image(image) else None
        if self._vdi is None or key is None or key != self._vdi_of:
            self._vdi, self._vdi_of = vdi_from_image(image), key
        return self._vdi
