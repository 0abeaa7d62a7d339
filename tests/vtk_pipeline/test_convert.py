"""VTK's volumes, properties and lights to the engine's objects."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import pyvista as pv
from hypothesis import example, given
from hypothesis import strategies as st

from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError, VDIWarning
from pyvista_vdi.model.lighting import Lights, Shading
from pyvista_vdi.vtk_pipeline.filters.convert import volume_from_vtk
from pyvista_vdi.vtk_pipeline.filters.properties import transfer_function_from_property
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkColorTransferFunction,
    vtkLight,
    vtkMath,
    vtkPiecewiseFunction,
    vtkRenderer,
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


def changed(method, *arguments):
    prop = linear_property()
    getattr(prop, method)(*arguments)
    return prop


@pytest.mark.parametrize(
    ("prop", "error", "message"),
    [
        (changed("IndependentComponentsOff"), UnsupportedError, "dependent components, which are"),
        (changed("SetTransferFunctionModeTo2D"), UnsupportedError, "2D transfer function"),
        (changed("SetLabelScalarOpacity", 1, gradient(0.5)), UnsupportedError, "label map"),
        (changed("SetUseClippedVoxelIntensity", 1), UnsupportedError, "of clipped voxels"),
        (vtkMath(), InvalidArgumentError, "must be a vtkVolumeProperty; got vtkMath"),
        (linear_property(nodes=()), InvalidArgumentError, "opacity function has no points"),
    ],
    ids=["rgba", "2d", "labels", "clipped voxels", "no property", "no points"],
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
