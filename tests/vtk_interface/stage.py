"""A volume in a bare renderer, drawn by VTK's GPU mapper or by a VDI."""

from __future__ import annotations

from typing import Any

import numpy as np
from watched_windows import on_screen

import pyvista_vdi as pvdi
from pyvista_vdi.vtk_pipeline.vtk import (
    numpy_to_vtk,
    vtkColorTransferFunction,
    vtkImageData,
    vtkOpenGLGPUVolumeRayCastMapper,
    vtkPiecewiseFunction,
    vtkRenderer,
    vtkRenderWindow,
    vtkUniformGrid,
    vtkVolume,
    vtkVolumeProperty,
)

#: Points along each edge, and the picture's size, pixels.
N, SIZE = 14, (96, 72)
#: Of pictures by VTK's mapper and by ours.
LEAST_SSIM = 0.98


def values() -> np.ndarray:
    """Return scalars from 0 to 255 without any symmetry, [z, y, x]."""
    x = np.linspace(-1, 1, N)
    r = np.sqrt(x[:, None, None] ** 2 + x[None, :, None] ** 2 + x[None, None, :] ** 2)
    return (255 * np.clip(1.1 - r, 0, 1) * (0.8 + 0.2 * x)).astype(np.float32)


def image_of(scalars: Any = None, name: str | None = "v") -> vtkImageData:
    """Return an image of these scalars, (n, ...) in VTK's order, or of :func:`values`."""
    scalars = values().ravel() if scalars is None else scalars
    image = vtkImageData()
    image.SetDimensions(N, N, N)
    array = scalars
    if isinstance(scalars, np.ndarray):
        array = numpy_to_vtk(np.ascontiguousarray(scalars), deep=True)
        array.SetName(name)
    image.GetPointData().SetScalars(array)
    other = numpy_to_vtk(255 - values().ravel(), deep=True)
    other.SetName("w")
    image.GetPointData().AddArray(other)
    return image


def function(*nodes: tuple[float, float]) -> vtkPiecewiseFunction:
    """Return a function of these nodes."""
    made = vtkPiecewiseFunction()
    for node in nodes:
        made.AddPoint(*node)
    return made


def colors(*nodes: tuple[float, ...]) -> vtkColorTransferFunction:
    """Return colours of these nodes."""
    made = vtkColorTransferFunction()
    for node in nodes:
        made.AddRGBPoint(*node)
    return made


def some_property() -> vtkVolumeProperty:
    """Return a property of three colours that lets one look in."""
    prop = vtkVolumeProperty()
    prop.SetColor(colors((0, 0.1, 0.2, 0.8), (128, 0.2, 0.9, 0.3), (255, 1, 0.6, 0.2)))
    prop.SetScalarOpacity(function((0, 0), (255, 0.4)))
    prop.SetInterpolationTypeToLinear()
    return prop


def another_property():
    """Return one of other colours and opacities."""
    made = vtkVolumeProperty()
    made.SetColor(colors((0, 1, 0, 0), (200, 0, 0, 1)))
    made.SetScalarOpacity(function((0, 0.3), (255, 0)))
    return made


def image_with(change):
    """Return what gives a scene an image that was changed."""

    def changed(s):
        image = image_of()
        another = change(image)
        if s.ours:
            s.source.SetInputDataObject(image if another is None else another)
        else:
            s.mapper.SetInputDataObject(image if another is None else another)
        s.renderer.ResetCamera()

    return changed


def with_scalars(make):
    """Return a change to an image of other scalars, made of 0 to 255."""
    return image_with(lambda image: image_of(make(values().ravel())))


def blanked(image):
    grid = vtkUniformGrid()
    grid.DeepCopy(image)
    for number in range(0, N**3, 7):
        grid.BlankPoint(number)
    for number in range(0, (N - 1) ** 3, 31):
        grid.BlankCell(number)
    return grid


def rgba(numbers):
    """Return four components of these."""
    return np.stack([numbers, 255 - numbers, numbers / 2, numbers], -1).astype(np.uint8)


def as_rgba(s):
    s.prop.IndependentComponentsOff()
    with_scalars(rgba)(s)


class Scene:
    """The volume in a renderer, by VTK's mapper or by ours."""

    def __init__(self, ours: bool, image: Any = None, prop: Any = None) -> None:
        self.image = image_of() if image is None else image
        self.prop = some_property() if prop is None else prop
        self.ours, self.source = ours, pvdi.VDISource()
        if ours:
            self.mapper, self.actor = pvdi.VDIMapper(), pvdi.VDIActor()
            self.source.SetVolumeProperty(self.prop)
            self.source.SetMaxSupersegments(100)
            self.source.SetInputDataObject(self.image)
            self.mapper.SetInputConnection(self.source.GetOutputPort())
        else:
            self.mapper, self.actor = vtkOpenGLGPUVolumeRayCastMapper(), vtkVolume()
            self.mapper.SetAutoAdjustSampleDistances(0)
            self.mapper.SetSampleDistance(0.5)
            self.mapper.SetInputData(self.image)
            self.actor.SetProperty(self.prop)
        self.actor.SetMapper(self.mapper)
        self.renderer, self.window = vtkRenderer(), vtkRenderWindow()
        self.window.SetOffScreenRendering(1)
        self.window.SetMultiSamples(0)
        self.window.SetSize(*SIZE)
        self.window.AddRenderer(self.renderer)
        self.renderer.AddVolume(self.actor)
        self.renderer.SetBackground(0.1, 0.1, 0.1)
        self.renderer.ResetCamera()
        self.camera = self.renderer.GetActiveCamera()
        self.camera.Azimuth(30)
        self.camera.Elevation(20)
        self.camera.Zoom(1.3)
        self.renderer.ResetCameraClippingRange()

    def picture(self) -> np.ndarray:
        """Draw it, and return RGB from 0 to 1, float64 (H, W, 3)."""
        self.window.Render()
        return on_screen(self.window)[..., :3] / 255.0

    def vdi(self) -> Any:
        """Return the VDI, which raises what stands against making it."""
        return self.actor.vdi
