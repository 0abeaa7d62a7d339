"""The box that VTK draws in place of a VDI: as large as the data at the input are by now."""

from __future__ import annotations

from typing import Any

import numpy as np

from pyvista_vdi.model.view import bounds_corners
from pyvista_vdi.vtk_pipeline.drawing.screen import fill_viewport
from pyvista_vdi.vtk_pipeline.filters.algorithm import WHOLE_EXTENT, Algorithm
from pyvista_vdi.vtk_pipeline.filters.inputs import Input
from pyvista_vdi.vtk_pipeline.filters.view import as_array
from pyvista_vdi.vtk_pipeline.vtk import vtkDataObject

_EXTENT = (0, 1, 0, 1, 0, 1)
_EMPTY = (0, -1, 0, -1, 0, -1)

#: Diagonals from the origin beyond which a box fills the viewport instead: VTK places boxes in
#: float32, which rounds corners by a pixel in ten thousand there, and by more beyond.
_FAR = 1000.0

#: Edge of the box that VTK draws then, about the origin: so small that no eye is inside.
_EDGE = 2e-3


class Box(Algorithm):
    """What is before the mapper in VTK's pipeline: an image of 2 x 2 x 2 voxels.

    VTK's mappers bring their input up to date when they are asked for their bounds, as by
    ``ResetCamera()``, which calls no method in Python. So this is connected to whatever is before
    the source, executes whenever that does, and makes no VDI.

    Attributes
    ----------
    image : vtkImageData
        The output. It has no points where nothing is at the input.
    components : int
        Those of its scalars.
    """

    def __init__(self) -> None:
        super().__init__(nInputPorts=1, nOutputPorts=1, outputType="vtkImageData")
        self._shown: Input | None = None
        self.components = 1
        self._stands = False
        self._far: tuple[Any, Any] | None = None  # origin and spacing, in a frame of what is far
        self.Update()
        self.image = self.GetOutputDataObject(0)

    def FillInputPortInformation(self, port: int, information: Any) -> int:
        """Take whatever the source is to refuse, or nothing."""
        information.Set(self.INPUT_REQUIRED_DATA_TYPE(), "vtkDataObject")
        information.Set(self.INPUT_IS_OPTIONAL(), 1)
        return 1

    def show(self, shown: Input | None) -> None:
        """Take the bounds of another input from now on."""
        self._shown = shown
        self.connect()
        if shown is not None and self.GetNumberOfInputConnections(0) == 0:
            self.place(shown.bounds())
        self.Modified()

    def connect(self) -> None:
        """Follow what the input is made of, which may be something else by now."""
        port = None if self._shown is None else self._shown.port
        connected = self.GetNumberOfInputConnections(0) > 0
        if port is not (self.GetInputConnection(0, 0) if connected else None):
            self.SetInputConnection(port)
            self.place(None)  # what fails from the first has no bounds either

    def place(self, bounds: tuple[float, ...] | None) -> None:
        """Set the bounds, model frame; ``None``: none."""
        extent = _EMPTY if bounds is None else _EXTENT
        if self.image.GetExtent() != extent or self.image.GetPointData().GetScalars() is None:
            self.image.SetExtent(extent)
            self._allocate()
        if bounds is not None:
            low, high = np.asarray(bounds[::2]), np.asarray(bounds[1::2])
            self.image.SetDirectionMatrix(1, 0, 0, 0, 1, 0, 0, 0, 1)  # VTK passes on the input's
            self.image.SetOrigin(*low)
            self.image.SetSpacing(*np.maximum(high - low, np.finfo(np.float32).tiny))

    def begin(self, actor: Any) -> None:
        """Be what VTK can draw in a frame of an actor; between frames the bounds are the VDI's.

        VTK writes an error where there are no points, and float32 cannot place what is far from the
        origin: a box about the origin has the whole viewport drawn then, where the image that is
        looked up is transparent beside the VDI.
        """
        self.end()  # of a frame that VTK has broken off
        self._stands = self.image.GetNumberOfPoints() == 0
        if self._stands:
            self.place((0, 1, 0, 1, 0, 1))
        if actor is None:
            return
        # VTK asks for four where the actor's property says that they are dependent
        components = 1 if actor.GetProperty().GetIndependentComponents() else 4
        if components != self.components:
            self.components = components
            self._allocate()
        model, matrix = bounds_corners(self.image.GetBounds()), as_array(actor.GetMatrix())
        # From the origin of the model frame, or of the world
        far = any(
            np.abs(at).max() > _FAR * np.linalg.norm(np.ptp(at, axis=0))
            for at in (model, model @ matrix[:3, :3].T + matrix[:3, 3])
        )
        fill_viewport(actor, _EDGE if far else None)
        if far:
            self._far = self.image.GetOrigin(), self.image.GetSpacing()
            self.image.SetOrigin([-_EDGE / 2] * 3)
            self.image.SetSpacing([_EDGE] * 3)

    def end(self) -> None:
        """Take the bounds again, or none."""
        if self._far is not None:
            (origin, spacing), self._far = self._far, None
            self.image.SetOrigin(origin)
            self.image.SetSpacing(spacing)
        if self._stands:
            self._stands = False
            self.place(None)

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Announce the voxels."""
        outputs.GetInformationObject(0).Set(WHOLE_EXTENT, _EXTENT, 6)
        return 1

    def _execute(self, inputs: Any, outputs: Any) -> None:
        self.image = vtkDataObject.GetData(outputs, 0)
        self.place(None if self._shown is None else self._shown.bounds())

    def _allocate(self) -> None:
        self.image.AllocateScalars(3, self.components)  # VTK_UNSIGNED_CHAR
        self.image.GetPointData().GetScalars().Fill(0)
