"""Functions of volume properties, however wide their nodes lie, beside VTK's GPU mapper."""

from __future__ import annotations

import numpy as np
import pytest
from watched_windows import on_screen

import pyvista_vdi as pvdi
from pyvista_vdi.errors import UnsupportedError
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.vtk_pipeline.filters.convert import volume_to_image
from pyvista_vdi.vtk_pipeline.filters.properties import transfer_function_from_property
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkColorTransferFunction,
    vtkLight,
    vtkOpenGLGPUVolumeRayCastMapper,
    vtkPiecewiseFunction,
    vtkRenderer,
    vtkRenderWindow,
    vtkVolume,
    vtkVolumeProperty,
)

DOUBLE_MAX = np.finfo(np.float64).max
SIZE = (96, 80)
#: Voxels; a peak of some scalars is thinner than one.
STEP = 0.05


def ball(n=21, dtype=np.float32):
    """Scalars from 255 in the middle to 0, 2 units wide."""
    z, y, x = np.mgrid[-1 : 1 : n * 1j, -1 : 1 : n * 1j, -1 : 1 : n * 1j]
    values = (255 * np.clip(1 - np.sqrt(x**2 + y**2 + z**2), 0, 1)).astype(dtype)
    return pvdi.Volume(values, (2 / (n - 1),) * 3, (-1, -1, -1))


def function_of(*nodes, cls=vtkPiecewiseFunction, **settings):
    """A function with nodes; ``settings`` as its methods call them."""
    function = cls()
    for node in nodes:
        (function.AddRGBPoint if cls is not vtkPiecewiseFunction else function.AddPoint)(*node)
    for name, value in settings.items():
        getattr(function, f"Set{name}")(value)
    return function


def colors_of(*nodes, **settings):
    return function_of(*nodes, cls=vtkColorTransferFunction, **settings)


BLUE_TO_ORANGE = ((0, 0.1, 0.2, 0.8), (128, 0.2, 0.9, 0.3), (255, 1, 0.6, 0.2))
#: With midpoints and sharpnesses, and nodes that lie wide
CURVED = (
    *((-1e6, 0, 0, 0), (20, 0.1, 0.2, 0.8, 0.3, 0.2), (131.5, 0.9, 0.4, 0.3, 0.6, 0.7)),
    *((180, 0.2, 0.9, 0.3), (1e6, 1, 1, 1)),
)
BEYOND = {"BelowRangeColor": (1, 0, 0), "AboveRangeColor": (1, 1, 0)}
BEYOND |= {"UseBelowRangeColor": 1, "UseAboveRangeColor": 1}


def property_of(color=None, opacity=None, gradient=None, **settings):
    prop = vtkVolumeProperty()
    prop.SetColor(colors_of(*BLUE_TO_ORANGE) if color is None else color)
    prop.SetScalarOpacity(function_of((0, 0), (255, 0.5)) if opacity is None else opacity)
    if gradient is not None:
        prop.SetGradientOpacity(gradient)
    prop.SetInterpolationTypeToLinear()
    prop.SetScalarOpacityUnitDistance(0.1)
    for name, value in settings.items():
        getattr(prop, f"Set{name}")(value)
    return prop


def wide_opacity(far):
    return function_of((-far, 0), (0, 0), (255, 0.5), (far, 0.5))


PROPERTIES = {
    "opacity at DOUBLE_MAX": lambda: property_of(opacity=wide_opacity(DOUBLE_MAX)),
    "slopes from afar": lambda: property_of(
        opacity=function_of((-1e7, -1e5), (70.3, 0.1), (1e7, 3e4))
    ),
    "peak off the grid": lambda: property_of(
        opacity=function_of((-1e9, 0), (99.3, 0), (100.1, 0.9), (102.7, 0.9), (103.2, 0))
    ),
    "beyond the range": lambda: property_of(
        colors_of((60, 0.2, 0.3, 1), (160, 0.2, 1, 0.2), **BEYOND)
    ),
    "functions end": lambda: property_of(
        colors_of((60, 0.2, 0.3, 1), (160, 0.2, 1, 0.2), Clamping=False),
        function_of((0, 0.02), (60, 0.02), (160, 0.5), Clamping=False),
    ),
    "beyond 0..1": lambda: property_of(
        colors_of((0, -1, 2, 0), (255, 2, -1, 1)), function_of((0, -1), (255, 2))
    ),
    "logarithmic opacity": lambda: property_of(
        opacity=function_of((1, 0), (60, 0.4), (1e6, 1), UseLogScale=True)
    ),
    "steep gradients": lambda: property_of(
        gradient=function_of((-1e6, 0), (0, 0), (20, 0.2), (22, 1), (1e6, 1))
    ),
    "hue without wrap": lambda: property_of(colors_of(*CURVED, ColorSpace=1, HSVWrap=0)),
    "specular power 0, two sides": lambda: property_of(
        Shade=True, Ambient=0.3, Diffuse=0.7, Specular=0.5, SpecularPower=0
    ),
}


def drawn(volume, lights=()):
    """What a renderer shows of VTK's actor or ours, int (H, W, 3)."""
    renderer, window = vtkRenderer(), vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.SetSize(*SIZE)
    window.AddRenderer(renderer)
    for position in lights:
        light = vtkLight()
        light.SetPosition(*position)
        renderer.AddLight(light)
    if hasattr(volume, "vdi"):
        volume.GetMapper().GetSource().SetLights(renderer)
    renderer.AddVolume(volume)
    camera = renderer.GetActiveCamera()
    camera.SetPosition(3, 2, 2.5)
    renderer.ResetCamera()
    for _ in range(2):
        window.Render()
    return on_screen(window)


def as_vtk_draws(volume, prop):
    mapper, actor = vtkOpenGLGPUVolumeRayCastMapper(), vtkVolume()
    mapper.SetInputData(volume_to_image(volume))
    mapper.SetAutoAdjustSampleDistances(0)
    mapper.SetSampleDistance(STEP * min(volume.spacing))
    actor.SetMapper(mapper)
    actor.SetProperty(prop)
    return actor


def source_of(volume, prop):
    source = pvdi.VDISource()
    source.SetInputDataObject(volume_to_image(volume))
    source.SetVolumeProperty(prop)
    source.SetMaxSupersegments(400)
    source.SetSampleDistance(STEP * min(volume.spacing))
    return source


def as_we_draw(volume, prop):
    source, mapper, actor = source_of(volume, prop), pvdi.VDIMapper(), pvdi.VDIActor()
    mapper.SetInputConnection(source.GetOutputPort())
    actor.SetMapper(mapper)
    return actor


@pytest.mark.gl
@pytest.mark.parametrize("name", PROPERTIES)
def test_pictures_are_vtks(name):
    volume, prop = ball(), PROPERTIES[name]()
    lights = [(5, 5, 5), (-5, 0, 1)] if "two" in name else ()
    theirs, ours = (drawn(make(volume, prop), lights=lights) for make in (as_vtk_draws, as_we_draw))
    assert np.ptp(theirs.reshape(-1, 3), axis=0).max() > 30
    assert compare_images(theirs / 255, ours / 255).ssim >= 0.98
    assert np.abs(theirs - ours).mean() < 1


@pytest.mark.parametrize(
    ("space", "beyond", "lone"),
    [
        *((space, {}, False) for space in range(6)),
        *((1, beyond, lone) for beyond in (BEYOND, {"Clamping": 0}) for lone in (False, True)),
    ],
)
def test_tables_are_getcolor_s(space, beyond, lone):
    nodes = CURVED[2:3] if lone else CURVED[1:-1]
    color = colors_of(*nodes, **beyond, ColorSpace=space)
    volume = pvdi.Volume(np.arange(240, dtype=np.uint8).reshape(4, 6, 10))
    prop = property_of(color, function_of((0, 0.5), (0.7, 0.6), (255, 1)), InterpolationType=0)
    table = transfer_function_from_property(prop, volume)
    low, high = table.scalar_range
    assert len(table.colors) == high - low + 1
    some = range(max(int(low), 1), int(high), 11 if space != 4 else 60)
    for scalar in {*some, *(int(x) for x, *_ in nodes)}:
        expected = color.GetColor(scalar)
        # LabCIEDE2000 goes from byte to byte, and GetColor has a node itself
        away = 0.03 if space == 4 else 2e-3
        np.testing.assert_allclose(table.colors[int(scalar - low)], expected, atol=away)


def test_a_logarithmic_scale_of_colours_is_refused():
    prop = property_of(colors_of(*CURVED[1:-1], Scale=1))
    with pytest.raises(UnsupportedError, match="logarithmic scale.*SetScaleToLinear"):
        transfer_function_from_property(prop, ball())
