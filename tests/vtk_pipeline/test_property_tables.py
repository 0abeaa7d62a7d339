"""Functions of volume properties, however wide their nodes lie, beside VTK's GPU mapper."""

from __future__ import annotations

import numpy as np
import pytest
from extension_marks import cases
from matplotlib.colors import ListedColormap
from vtk_sources import camera_at
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

FLOAT_MAX, DOUBLE_MAX = np.finfo(np.float32).max, np.finfo(np.float64).max
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


PEAK = ((0, 0), (99, 0), (100, 0.9), (102, 0.9), (103, 0), (65535, 0))
PROPERTIES = {
    "opacity at 1e6": lambda: property_of(opacity=wide_opacity(1e6)),
    "opacity at FLOAT_MAX": lambda: property_of(opacity=wide_opacity(FLOAT_MAX)),
    "opacity at DOUBLE_MAX": lambda: property_of(opacity=wide_opacity(DOUBLE_MAX)),
    "slopes from afar": lambda: property_of(
        opacity=function_of((-1e7, -1e5), (70.3, 0.1), (1e7, 3e4))
    ),
    "colours at 1e6": lambda: property_of(
        colors_of((-1e6, 0, 0, 0), *BLUE_TO_ORANGE, (1e6, 1, 1, 1))
    ),
    "peak of nodes to 65535": lambda: property_of(
        colors_of((0, 1, 0, 0), (1000, 0, 1, 1), (65535, 1, 1, 1)), function_of(*PEAK)
    ),
    "peak off the grid": lambda: property_of(
        opacity=function_of((-1e9, 0), (99.3, 0), (100.1, 0.9), (102.7, 0.9), (103.2, 0))
    ),
    "beyond the range": lambda: property_of(
        colors_of((60, 0.2, 0.3, 1), (160, 0.2, 1, 0.2), **BEYOND)
    ),
    "beyond one node": lambda: property_of(colors_of((99.5, 0.2, 0.3, 1), **BEYOND)),
    "above all data": lambda: property_of(colors_of((400, 0.2, 0.3, 1), (500, 0, 0, 1), **BEYOND)),
    "colours end": lambda: property_of(
        colors_of((60, 0.2, 0.3, 1), (160, 0.2, 1, 0.2), Clamping=False)
    ),
    "opacity ends": lambda: property_of(
        opacity=function_of((0, 0.02), (60, 0.02), (160, 0.5), Clamping=False)
    ),
    "opacity beyond 0..1": lambda: property_of(
        colors_of((0, 1, 0, 0), (255, 0, 0, 1)), function_of((0, -1), (255, 2))
    ),
    "colours beyond 0..1": lambda: property_of(
        colors_of((0, -1, 2, 0), (255, 2, -1, 1)), function_of((0, 0), (255, 0.5))
    ),
    "logarithmic opacity": lambda: property_of(
        opacity=function_of((1, 0), (60, 0.4), (1e6, 1), UseLogScale=True)
    ),
    "steep gradients": lambda: property_of(
        gradient=function_of((-1e6, 0), (0, 0), (20, 0.2), (22, 1), (1e6, 1))
    ),
    "gradients in a peak": lambda: property_of(
        gradient=function_of((0, 0), (21, 0), (24, 1), (27, 1), (30, 0), (65535, 0))
    ),
    "grey": lambda: property_of(wide_opacity(1e6)),
    **{
        f"space {space}": lambda space=space, wrap=wrap: property_of(
            colors_of(*CURVED, ColorSpace=space, HSVWrap=wrap)
        )
        for space, wrap in ((0, 1), (1, 1), (1, 0), (2, 1), (3, 1), (4, 1), (5, 1))
    },
    **{
        f"specular power 0, {'two sides' if ambient else 'one'}": lambda ambient=ambient: (
            property_of(Shade=True, Ambient=ambient, Diffuse=0.7, Specular=0.5, SpecularPower=0)
        )
        for ambient in (0.0, 0.3)
    },
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
@pytest.mark.every(2)
@pytest.mark.parametrize("name", PROPERTIES)
def test_pictures_are_vtks(name):
    volume, prop = ball(), PROPERTIES[name]()
    lights = [(5, 5, 5), (-5, 0, 1)] if "two" in name else ()
    theirs, ours = (drawn(make(volume, prop), lights=lights) for make in (as_vtk_draws, as_we_draw))
    assert np.ptp(theirs.reshape(-1, 3), axis=0).max() > 30
    assert compare_images(theirs / 255, ours / 255).ssim >= 0.98
    assert np.abs(theirs - ours).mean() < 1


@pytest.mark.parametrize("space", range(6))
@pytest.mark.parametrize("beyond", [{}, BEYOND, {"Clamping": 0}], ids=["", "beyond", "ends"])
@pytest.mark.parametrize("lone", [False, True], ids=["nodes", "one node"])
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


class OfOneCall(vtkColorTransferFunction):
    def GetColor(self, *_):
        raise AssertionError("thousands of these take minutes")


def test_a_table_takes_one_call_and_is_kept_until_something_changes():
    color = OfOneCall()
    color.DeepCopy(colors_of(*CURVED, ColorSpace=5))
    calls = []
    color.GetTable = lambda *given: (
        calls.append(given) or vtkColorTransferFunction.GetTable(color, *given)
    )
    volume = ball(dtype=np.uint16)
    source = source_of(volume, property_of(color))
    source.SetCamera(camera_at(3, 2, 2.5))
    source.SetWindowSize(*SIZE)
    first, same = source.MakeRequest(), source.MakeRequest()
    assert len(calls) == 1
    assert first.transfer_function is same.transfer_function
    color.RemovePoint(180)
    assert source.MakeRequest().transfer_function != first.transfer_function
    brighter = pvdi.Volume(volume.array * 100, volume.spacing, volume.origin)
    source.SetInputDataObject(volume_to_image(brighter))
    assert source.MakeRequest().transfer_function.scalar_range[1] > 20_000


def labels_of(n, dtype):
    """Balls of labels, the least and the largest among them."""
    rng, values = np.random.default_rng(3), np.zeros((24, 24, 24), dtype)
    z, y, x = np.mgrid[:24, :24, :24]
    for k in range(40):
        (a, b, c), r = rng.uniform(4, 20, 3), rng.uniform(2, 5)
        inside = (x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2 < r * r
        values[inside] = {0: 1, 1: n - 1}.get(k, rng.integers(1, n))
    return pvdi.Volume(values)


@pytest.mark.every(4)
@pytest.mark.parametrize("dtype", [np.uint16, np.float32, np.int32])
@pytest.mark.parametrize("steps", [False, True], ids=["nodes", "steps"])
@pytest.mark.parametrize("n", [4097, 5023])
def test_each_of_thousands_of_labels_has_its_colour(dtype, steps, n):
    colors = np.random.default_rng(5).integers(0, 256, (n, 3)) / 255
    beside = (-0.4, 0.4) if steps else (0,)
    nodes = [(label + d, *colors[label]) for label in range(n) for d in beside]
    prop = property_of(
        colors_of((-1e6, 0, 0, 0), *nodes, (1e6, 1, 1, 1)), function_of((0, 0), (1, 1), (1e9, 1))
    )
    prop.SetInterpolationTypeToNearest()
    volume = labels_of(n, dtype)
    used = np.unique(volume.array)[1:].astype(int)
    vdi = pvdi.generate(volume, camera_at(60, 50, 70), SIZE, volume_property=prop)
    drawn = vdi.color[np.isin(vdi.optical_depth, vdi.optical_depth.max())]
    nearest = np.abs(drawn[:, None] - colors[used]).max(axis=2).min(axis=1)
    assert nearest.max() <= 1 / 255


def test_a_logarithmic_scale_of_colours_is_refused():
    prop = property_of(colors_of(*CURVED[1:-1], Scale=1))
    with pytest.raises(UnsupportedError, match="logarithmic scale.*SetScaleToLinear"):
        transfer_function_from_property(prop, ball())


def test_gradients_beyond_the_nodes_are_as_vtk_has_them():
    prop = property_of(gradient=function_of((10, 0.5), (26, 1), Clamping=False))
    found = transfer_function_from_property(prop, ball())
    assert found.gradient_opacities[[0, -1]].tolist() == [0, 0]
    assert found.gradient_opacities[-2] > 0.99


@pytest.mark.parametrize("kind", cases("series", "chunks"))
def test_every_volume_has_the_table_of_its_own_scalars(kind):
    """A peak that only some thousand entries over a volume's own scalars show."""
    prop = property_of(opacity=function_of((-1e9, 0), (9.3, 0), (9.7, 1), (10.4, 0), (1e9, 0)))
    view = {"camera": camera_at(3, 2, 2.5), "window_size": SIZE}
    one = ball()
    volumes = [one, pvdi.Volume(one.array * 1e5, one.spacing, one.origin)]
    if kind == "series":
        series = pvdi.generate_series(volumes, **view, volume_property=prop)
        made = list(series)
    else:
        da = pytest.importorskip("dask.array")
        chunked = [
            pvdi.Volume(da.from_array(v.array, chunks=11), v.spacing, v.origin) for v in volumes
        ]
        made = [pvdi.generate(v, **view, volume_property=prop) for v in chunked]
    for volume, vdi in zip(volumes, made, strict=True):
        alone = pvdi.generate(volume, **view, volume_property=prop)
        assert vdi.metadata["transfer_function"] == alone.metadata["transfer_function"]
    assert made[0].counts.max() > 0


def test_thousands_of_colours_by_name():
    colors = np.random.default_rng(5).integers(0, 256, (5023, 3)) / 255
    view = {"camera": camera_at(60, 50, 70), "window_size": (8, 6)}
    looks = {"cmap": ListedColormap(colors), "clim": (0, 5022), "n_colors": 5023, "opacity": 0.5}
    vdi = pvdi.generate(labels_of(5023, np.uint16), **view, **looks)
    np.testing.assert_allclose(vdi.metadata["transfer_function"]["colors"], colors, atol=1e-6)
