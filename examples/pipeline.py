"""A VDI in a pure VTK pipeline: source, mapper, actor, and a clipping plane.

What one should see: half of a soft ball, cut by a vertical plane; orange inside, blue at its rim,
over dark grey. The picture is written to the file that the argument names (pipeline.png without
one); with --show a window opens instead.
"""

from __future__ import annotations

import sys

import numpy as np

import pyvista_vdi as pvdi

# VTK's names, from vtkmodules or, where PyVista takes that, from cvista
from pyvista_vdi.vtk_pipeline.vtk import (
    numpy_to_vtk,
    vtkColorTransferFunction,
    vtkImageData,
    vtkInteractionStyle,  # noqa: F401 - lets the window be turned
    vtkPiecewiseFunction,
    vtkPlane,
    vtkPNGWriter,
    vtkRenderer,
    vtkRenderWindow,
    vtkRenderWindowInteractor,
    vtkVolumeProperty,
    vtkWindowToImageFilter,
)


def soft_ball(n: int = 96) -> vtkImageData:
    """Density that falls from 255 at the centre to 0 at radius 1."""
    x = np.linspace(-1, 1, n)
    radius = np.sqrt(x[:, None, None] ** 2 + x[None, :, None] ** 2 + x[None, None, :] ** 2)
    density = (255 * np.clip(1 - radius, 0, 1)).astype(np.float32)
    image = vtkImageData()
    image.SetDimensions(n, n, n)
    image.SetSpacing((2 / (n - 1),) * 3)
    image.SetOrigin(-1, -1, -1)
    image.GetPointData().SetScalars(numpy_to_vtk(density.ravel(), deep=True))
    return image


def looks() -> vtkVolumeProperty:
    """Blue and thin at the rim, orange and dense in the middle."""
    opacity, color = vtkPiecewiseFunction(), vtkColorTransferFunction()
    opacity.AddPoint(0, 0.0)
    opacity.AddPoint(100, 0.05)
    opacity.AddPoint(255, 0.9)
    color.AddRGBPoint(0, 0.1, 0.2, 0.9)
    color.AddRGBPoint(120, 1.0, 0.5, 0.1)
    color.AddRGBPoint(255, 1.0, 0.6, 0.1)
    prop = vtkVolumeProperty()
    prop.SetScalarOpacity(opacity)
    prop.SetColor(color)
    prop.SetScalarOpacityUnitDistance(0.1)
    prop.SetInterpolationTypeToLinear()
    return prop


def main() -> None:
    """Build the pipeline and show it, or write a picture of it."""
    show = "--show" in sys.argv
    names = [a for a in sys.argv[1:] if not a.startswith("--")]
    target = names[0] if names else "pipeline.png"

    source = pvdi.VDISource()
    source.SetInputDataObject(soft_ball())
    source.SetVolumeProperty(looks())
    source.SetCoverage("bounds")
    mapper = pvdi.VDIMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    plane = vtkPlane()
    plane.SetNormal(1, 0, 0)
    mapper.AddClippingPlane(plane)
    actor = pvdi.VDIActor()
    actor.SetMapper(mapper)

    renderer = vtkRenderer()
    renderer.SetBackground(0.15, 0.15, 0.15)
    renderer.AddVolume(actor)
    window = vtkRenderWindow()
    window.SetOffScreenRendering(0 if show else 1)
    window.SetSize(640, 480)
    window.AddRenderer(renderer)
    renderer.ResetCamera()
    window.Render()
    print(actor.vdi)
    if show:
        interactor = vtkRenderWindowInteractor()
        interactor.SetRenderWindow(window)
        interactor.Start()
        return
    grab = vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    writer = vtkPNGWriter()
    writer.SetInputConnection(grab.GetOutputPort())
    writer.SetFileName(target)
    writer.Write()
    print(f"written: {target}")


if __name__ == "__main__":
    main()
