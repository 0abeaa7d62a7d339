"""VTK's volumes, properties and lights to the engine's objects."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import pyvista as pv
from hypothesis import example, given
from hypothesis import strategies as st

from pyvista_vdi.errors import (
    InvalidArgumentError,
    InvalidVolumeError,
    UnknownArrayError,
    UnsupportedError,
    VDIWarning,
)
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.lighting import Light, Lights, Shading
from pyvista_vdi.vtk_pipeline.filters.convert import as_numpy, to_vtk, volume_from_vtk
from pyvista_vdi.vtk_pipeline.filters.properties import transfer_function_from_property
from pyvista_vdi.vtk_pipeline.vtk import (
    numpy_to_vtk,
    vtkColorTransferFunction,
    vtkImageData,
    vtkLight,
    vtkMath,
    vtkPiecewiseFunction,
    vtkRenderer,
    vtkVersion,
    vtkVolumeProperty,
)


def some_grid(**arrays):
    """4 x 3 x 5 points; arrays are of points, or of cells where so many values are given."""
    grid = pv.ImageData(dimensions=(4, 3, 5), spacing=(0.5, 2.0, 3.0), origin=(5.0, -6.0, 7.0))
    for name, values in (arrays or {"v": np.arange(grid.n_points, dtype=np.int16)}).items():
        data = grid.point_data if len(values) == grid.n_points else grid.cell_data
        data.set_array(values, name)
    return grid


def test_points_are_where_vtk_has_them_and_memory_is_shared():
    grid = some_grid()
    grid.direction_matrix = pv.Transform().rotate_vector((1, 2, 3), 50).matrix[:3, :3]
    volume = volume_from_vtk(grid)
    assert np.shares_memory(volume.array, grid["v"])
    assert volume.name == "v"
    z, y, x = np.meshgrid(*map(np.arange, volume.array.shape), indexing="ij")
    index = np.stack([x, y, z, np.ones_like(x)], axis=-1).reshape(-1, 4)
    # the matrix product of float64 coordinates up to 20
    np.testing.assert_allclose((index @ volume.index_to_model.T)[:, :3], grid.points, atol=1e-5)
    np.testing.assert_array_equal(volume.array.ravel(), grid["v"])
    np.testing.assert_allclose(volume.bounds, grid.bounds, atol=1e-12)
    assert volume.default_unit_distance == pytest.approx(
        grid.length / (np.mean(grid.dimensions) - 1), rel=1e-12
    )


def test_extent_that_begins_elsewhere():
    image = vtkImageData()
    image.SetExtent(10, 12, -4, -1, 3, 5)
    image.SetSpacing(0.5, 2.0, 1.0)
    image.SetOrigin(1.0, 1.0, 1.0)
    image.AllocateScalars(10, 1)
    volume = volume_from_vtk(image)
    assert volume.dimensions == (3, 4, 3)
    assert volume.origin == (6.0, -7.0, 4.0)
    assert volume.bounds == pytest.approx(image.GetBounds())


@pytest.mark.parametrize(
    "dtype", ["uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64", "rgba"]
)
def test_every_voxel_type_as_it_is(dtype):
    values = np.arange(60).astype(dtype if dtype != "rgba" else "uint8")
    if dtype == "rgba":
        values = np.arange(240, dtype=np.uint8).reshape(60, 4)
    grid = some_grid(v=np.zeros(60), w=values)
    volume = volume_from_vtk(grid, "w")
    assert volume.array.dtype == values.dtype
    assert volume.rgba == (dtype == "rgba")
    assert np.shares_memory(volume.array, grid["w"])
    np.testing.assert_array_equal(volume.array.reshape(values.shape), values)


def test_cell_data_become_point_data_as_in_add_volume():
    grid = some_grid(c=np.linspace(0, 1, 24))
    expected = grid.cell_data_to_point_data()["c"]
    np.testing.assert_array_equal(volume_from_vtk(grid).array.ravel(), expected)
    grid.point_data["c"] = np.full(60, 2.0)  # between two of one name the preference decides
    assert volume_from_vtk(grid, "c", "point").array.min() == 2
    np.testing.assert_array_equal(volume_from_vtk(grid, "c", "cell").array.ravel(), expected)


def test_an_array_without_a_name_is_taken_where_it_is_the_only_one():
    image, values = vtkImageData(), np.arange(24.0)
    image.SetDimensions(2, 3, 4)
    image.GetPointData().AddArray(numpy_to_vtk(values))
    np.testing.assert_array_equal(volume_from_vtk(image).array.ravel(), values)
    with pytest.raises(UnknownArrayError, match=r"no array 'v': its arrays are \[None\]"):
        volume_from_vtk(image, "v")


def plane(kind, *dimensions):
    grid = pv.ImageData(dimensions=dimensions)
    n = grid.n_points if kind == "point" else grid.n_cells
    getattr(grid, f"{kind}_data")["v"] = np.zeros(n)
    return grid


_NO_GRID, _PLANE = "not a uniform grid.*", "only one plane .* at least two points"
REFUSED = {
    "no scalars": (pv.ImageData(dimensions=(4, 3, 5)), "no scalars: there is nothing to render"),
    "empty": (vtkImageData(), "the volume is empty: it has no points"),
    "plane": (plane("point", 4, 3, 1), _PLANE),
    "plane of cells": (plane("cell", 4, 3, 1), _PLANE),
    "plane along x": (plane("point", 1, 3, 4), _PLANE),
    "cells along x": (plane("cell", 1, 3, 4), _PLANE),
    "vectors": (some_grid(v=np.zeros((60, 3))), "'v' have 3 components.*one scalar per point"),
    "rgba": (
        some_grid(v=np.zeros((60, 4), np.uint16)),
        "'v' have 4 components.*or from RGBA of type unsigned char",
    ),
    "rectilinear": (
        pv.RectilinearGrid([0.0, 1, 3], [0.0, 1], [0.0, 1]),
        _NO_GRID + "resample a",
    ),
    "structured": (some_grid().cast_to_structured_grid(), _NO_GRID + "resample a"),
    "unstructured": (some_grid().cast_to_unstructured_grid(), _NO_GRID + "resample a"),
    "surface": (pv.Sphere(), _NO_GRID + "voxelise a surface"),
    "blocks": (pv.MultiBlock([some_grid()]), _NO_GRID + "one by one"),
}


@pytest.mark.parametrize(("grid", "message"), REFUSED.values(), ids=REFUSED)
def test_what_is_no_volume_is_refused_with_the_remedy(grid, message):
    unusable = "components" in message or message.startswith(_NO_GRID)
    with pytest.raises(UnsupportedError if unusable else InvalidVolumeError, match=message):
        volume_from_vtk(grid)


def test_unknown_array_names_the_nearest():
    with pytest.raises(InvalidVolumeError, match=r"no array 'vv': did you mean 'v'\? .*\['v'\]"):
        volume_from_vtk(some_grid(), "vv")


def function_of(*nodes):
    function = vtkPiecewiseFunction()
    for node in nodes:
        function.AddPoint(*node)
    return function


def linear_property(nodes=((0.0, 0.0), (10.0, 1.0)), colors=((0.0, 0, 0, 0), (10.0, 1, 1, 1))):
    prop, color = vtkVolumeProperty(), vtkColorTransferFunction()
    for node in colors:
        color.AddRGBPoint(*node)
    prop.SetScalarOpacity(function_of(*nodes))
    prop.SetColor(color)
    return prop


def at(function, x):
    """Evaluate a table by hand."""
    position = np.linspace(*function.scalar_range, len(function.opacities))
    rgb = [np.interp(x, position, function.colors[:, k]) for k in range(3)]
    return (*rgb, np.interp(x, position, function.opacities))


def test_pyvistas_nodes_are_taken_exactly():
    table = pv.LookupTable()
    table.apply_cmap("bone", 256)
    table.apply_opacity("sigmoid_6")
    table.scalar_range = (-3.3, 2000.0)
    prop = pv.VolumeProperty(lookup_table=table, opacity_unit_distance=2.5)
    function = transfer_function_from_property(prop)
    assert function.scalar_range == (-3.3, 2000.0)
    assert function.unit_distance == 2.5
    assert function.interpolation == "nearest"
    np.testing.assert_array_equal(function.colors, (table.values[:, :3] / 255.0).astype(np.float32))
    np.testing.assert_array_equal(
        function.opacities, np.minimum(table.values[:, 3] / 255.0, 0.998).astype(np.float32)
    )


def test_few_nodes_on_one_grid_give_that_grid():
    prop = linear_property(
        nodes=((0.0, 0.0), (100.0, 0.5), (250.0, 1.0)), colors=((50.0, 1, 0, 0), (250.0, 0, 0, 1))
    )
    function = transfer_function_from_property(prop)
    assert len(function.opacities) == 6  # 0, 50 ... 250
    np.testing.assert_allclose(function.opacities, [0, 0.25, 0.5, 2 / 3, 5 / 6, 1], atol=1e-7)
    np.testing.assert_allclose(function.colors[:3, 0], [1, 1, 0.75], atol=1e-7)


@given(
    st.lists(st.tuples(st.floats(-50, 50), st.floats(0, 1)), min_size=2, max_size=6),
    st.lists(
        st.tuples(st.floats(-50, 50), st.floats(0, 1), st.floats(0, 1), st.floats(0, 1)),
        min_size=2,
        max_size=6,
    ),
    st.floats(-80, 80),
)
@example(
    nodes=[(0.9907559388100751, 0.0), (-49.09375, 0.0)],
    colors=[(0.0, 0.0, 0.75, 0.0), (0.25, 0.0, 0.0, 0.0), (2.2e-153, 0.0, 1.0, 0.0)],
    x=0.0,
)
def test_any_nodes_are_sampled_closely(nodes, colors, x):
    prop = linear_property(nodes, colors)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", VDIWarning)  # of nodes that nearly coincide
        function = transfer_function_from_property(prop)
    low, high = function.scalar_range
    color = prop.GetRGBTransferFunction()
    expected = (*color.GetColor(x), prop.GetScalarOpacity().GetValue(x))
    # Between two samples a function moves by at most what it moves between the samples around:
    # a kink, or a step, lies between entries
    step = (high - low) / max(1, len(function.opacities) - 1)
    around = [x + s * step for s in np.linspace(-1.001, 1.001, 41)]
    # Its extremes are at nodes: two that nearly coincide make a step that other places miss
    around += [n for n, *_ in (*nodes, *colors) if abs(n - x) <= 1.001 * step]
    values = np.array([(*color.GetColor(a), prop.GetScalarOpacity().GetValue(a)) for a in around])
    slack = np.ptp(values, axis=0) + 1e-5
    assert (np.abs(np.array(at(function, x)) - expected) <= slack).all()


def test_without_clamping_the_outside_is_transparent():
    prop = linear_property(nodes=((0.0, 0.7), (10.0, 0.7)))
    prop.GetScalarOpacity().ClampingOff()
    function = transfer_function_from_property(prop)
    assert function.opacities[0] == function.opacities[-1] == 0
    assert at(function, 5.0)[3] == pytest.approx(0.7)


def test_grey_functions_and_linear_interpolation():
    prop, grey = vtkVolumeProperty(), function_of((0, 0.25), (10, 0.75))
    prop.SetColor(grey)
    prop.SetScalarOpacity(grey)
    prop.SetInterpolationTypeToLinear()
    function = transfer_function_from_property(prop)
    assert function.interpolation == "linear"
    np.testing.assert_allclose(function.colors, [[0.25] * 3, [0.75] * 3])


def gradient(value):
    return function_of((0, 1.0), (10, value))


def test_shading_and_gradient_opacity_are_taken():
    prop = linear_property()
    prop.SetAmbient(0.3)
    prop.SetSpecularPower(4)
    assert transfer_function_from_property(prop).shading is None
    prop.ShadeOn()
    prop.SetGradientOpacity(gradient(0.5))
    function = transfer_function_from_property(prop)
    assert function.shading == Shading(0.3, prop.GetDiffuse(), prop.GetSpecular(), 4)
    assert function.gradient_range == (0, 10)
    factors = function.gradient_opacities
    np.testing.assert_allclose(factors, np.linspace(1, 0.5, len(factors)), rtol=1e-6)
    prop.DisableGradientOpacityOn()
    assert transfer_function_from_property(prop).gradient_opacities is None
    prop.DisableGradientOpacityOff()
    prop.SetGradientOpacity(gradient(1.0))  # which does nothing
    transfer_function_from_property(prop)


def test_an_rgba_volume_needs_dependent_components():
    prop = linear_property()
    with pytest.raises(UnsupportedError, match="independent components of an RGBA volume"):
        transfer_function_from_property(prop, rgba=True)
    prop.IndependentComponentsOff()
    assert transfer_function_from_property(prop, rgba=True).opacities.max() > 0


class Cubic(vtkVolumeProperty):
    """VTK 9.7 clamps the type to linear; newer ones may not."""

    def GetInterpolationType(self):
        return 2


def changed(method, *arguments, prop=None):
    prop = linear_property() if prop is None else prop
    getattr(prop, method)(*arguments)
    return prop


@pytest.mark.parametrize(
    ("prop", "error", "message"),
    [
        (changed("IndependentComponentsOff"), UnsupportedError, "dependent components, which are"),
        (changed("SetTransferFunctionModeTo2D"), UnsupportedError, "2D transfer function"),
        (changed("SetLabelScalarOpacity", 1, gradient(0.5)), UnsupportedError, "label map"),
        (changed("SetUseClippedVoxelIntensity", 1), UnsupportedError, "of clipped voxels"),
        (
            changed("SetScalarOpacity", gradient(0.5), prop=Cubic()),
            UnsupportedError,
            "cubic interpolation",
        ),
        (vtkMath(), InvalidArgumentError, "must be a vtkVolumeProperty; got vtkMath"),
        (linear_property(nodes=()), InvalidArgumentError, "opacity function has no points"),
    ],
    ids=["rgba", "2d", "labels", "clipped voxels", "cubic", "no property", "no points"],
)
def test_properties_that_cannot_be_honoured_are_refused_by_name(prop, error, message):
    with pytest.raises(error, match=message):
        transfer_function_from_property(prop)


def light_of(kind, **settings):
    light = vtkLight()
    getattr(light, f"SetLightTypeTo{kind}")()
    for name, value in settings.items():
        getattr(light, f"Set{name}")(value)
    return light


def test_lights_of_a_renderer():
    renderer = vtkRenderer()
    assert Lights.from_any(renderer) == Lights()  # the headlight that VTK would make
    renderer.TwoSidedLightingOff()
    light = light_of("CameraLight", Position=(1, 2, 3), DiffuseColor=(1, 0.5, 0), Intensity=0.5)
    renderer.AddLight(light)
    renderer.AddLight(light_of("Headlight", Switch=False))
    lights = Lights.from_any(renderer)
    assert not lights.two_sided
    (found,) = lights.lights
    assert (found.kind, found.position, found.diffuse) == ("camera", (1, 2, 3), (1, 0.5, 0))
    assert found.intensity == 0.5
    light.SwitchOff()
    renderer.TwoSidedLightingOn()
    assert Lights.from_any(renderer) == Lights()  # as VTK makes one where none is on
    renderer.AutomaticLightCreationOff()
    assert Lights.from_any(renderer) == Lights(())


def test_lights_that_go_with_the_camera():
    """A headlight is the same wherever the eye is, others stand where VTK puts them."""
    renderer = vtkRenderer()
    headlight = light_of("Headlight", Intensity=0.25)
    renderer.AddLight(headlight)
    before = Lights.from_any(renderer)
    camera = renderer.GetActiveCamera()
    camera.SetPosition(3, -4, 9)
    camera.SetFocalPoint(1, 1, 2)
    camera.SetViewUp(0.1, 0.2, 1)
    renderer.UpdateLightsGeometryToFollowCamera()
    assert headlight.GetPosition() == (3, -4, 9)
    assert Lights.from_any(renderer) == before == Lights((Light(intensity=0.25),))
    light = light_of("CameraLight", Position=(0.3, -1.5, 0.8), FocalPoint=(0.1, 0.2, -0.3))
    renderer.AddLight(light)
    renderer.UpdateLightsGeometryToFollowCamera()
    position, direction = Light.from_any(light).in_world(Camera.from_any(camera))
    travel = np.subtract(light.GetTransformedFocalPoint(), light.GetTransformedPosition())
    np.testing.assert_allclose(position, light.GetTransformedPosition(), rtol=1e-12)
    np.testing.assert_allclose(direction, travel / np.linalg.norm(travel), rtol=1e-12)


@pytest.mark.parametrize(
    ("lights", "message"),
    [
        (3, "renderer whose lights are meant; got int"),
        ([3], "a light must be a Light, a vtkLight or a pyvista.Light; got int"),
    ],
)
def test_what_is_no_light_is_refused_by_name(lights, message):
    with pytest.raises(InvalidArgumentError, match=message):
        Lights.from_any(lights)


def test_values_do_not_keep_an_array_of_vtk_that_has_attributes():
    """VTK before 9.7 frees memory twice where a gone filter's attributes are the last to."""
    numbers = np.arange(12, dtype=np.float32).reshape(4, 3)
    array = to_vtk("values", numbers)
    values = as_numpy(array)
    values.flags.writeable = False
    assert numbers.flags.writeable
    assert np.shares_memory(values, numbers)
    assert values.shape == numbers.shape
    kept = [values]
    while kept[-1] is not None:
        last = kept[-1]
        kept.append(last.obj if isinstance(last, memoryview) else getattr(last, "base", None))
    frees_once = (vtkVersion.GetVTKMajorVersion(), vtkVersion.GetVTKMinorVersion()) >= (9, 7)
    assert frees_once or not vars(array) or not any(each is array for each in kept)
    array.SetNumberOfTuples(2)  # of the same memory
    np.testing.assert_array_equal(as_numpy(array), numbers[:2])
    array.SetNumberOfTuples(40)  # of other memory
    assert as_numpy(array).shape == (40, 3)
