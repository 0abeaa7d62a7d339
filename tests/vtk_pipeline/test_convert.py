"""VTK's images and properties to and from the engine's objects.

Volumes, VDIs and properties each have their refusals: hence more than 500 lines.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
import pyvista as pv
from hypothesis import example, given
from hypothesis import strategies as st
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkMath
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPiecewiseFunction
from vtkmodules.vtkRenderingCore import (
    vtkColorTransferFunction,
    vtkLight,
    vtkRenderer,
    vtkVolumeProperty,
)

from pyvista_vdi.errors import (
    InvalidArgumentError,
    InvalidVDIError,
    InvalidVolumeError,
    UnknownArrayError,
    UnsupportedError,
)
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.lighting import Light, Lights, Shading
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.vtk_pipeline.filters.convert import (
    as_numpy,
    to_vtk,
    vdi_from_image,
    vdi_to_image,
    volume_from_vtk,
)
from pyvista_vdi.vtk_pipeline.filters.properties import transfer_function_from_property


def some_grid(dimensions=(4, 3, 5)):
    grid = pv.ImageData(dimensions=dimensions, spacing=(0.5, 2.0, 3.0), origin=(5.0, -6.0, 7.0))
    grid["v"] = np.arange(grid.n_points, dtype=np.int16)
    return grid


# -- volumes ---------------------------------------------------------------------------------------


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
    "dtype", ["uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64"]
)
def test_every_voxel_type_as_it_is(dtype):
    grid = some_grid()
    grid["w"] = np.arange(grid.n_points).astype(dtype)
    volume = volume_from_vtk(grid, "w")
    assert volume.array.dtype == dtype
    assert np.shares_memory(volume.array, grid["w"])


def test_cell_data_become_point_data_as_in_add_volume():
    grid = pv.ImageData(dimensions=(4, 3, 5))
    grid.cell_data["c"] = np.linspace(0, 1, grid.n_cells)
    expected = grid.cell_data_to_point_data()["c"]
    np.testing.assert_array_equal(volume_from_vtk(grid).array.ravel(), expected)


def test_preference_decides_between_arrays_of_one_name():
    grid = some_grid()
    grid.cell_data["v"] = np.full(grid.n_cells, -1.0)
    assert volume_from_vtk(grid, "v", "point").array.max() > 0
    assert volume_from_vtk(grid, "v", "cell").array.max() == -1


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (lambda g: g.clear_data(), InvalidVolumeError, "no scalars: there is nothing to render"),
        (
            lambda g: g.point_data.set_array(np.zeros((g.n_points, 3)), "v"),
            UnsupportedError,
            "'v' have 3 components.*pass one component",
        ),
        (
            lambda g: g.point_data.set_array(np.zeros((g.n_points, 4), np.uint16), "v"),
            UnsupportedError,
            "'v' have 4 components, but are not RGBA of type unsigned char",
        ),
    ],
    ids=["none", "vectors", "rgba"],
)
def test_scalars_that_cannot_be_used(change, error, message):
    grid = some_grid()
    change(grid)
    with pytest.raises(error, match=message):
        volume_from_vtk(grid)


def test_unknown_array_names_the_nearest():
    with pytest.raises(InvalidVolumeError, match=r"no array 'V': did you mean 'v'\? .*\['v'\]"):
        volume_from_vtk(some_grid(), "V")


def test_an_array_without_a_name_is_taken_where_it_is_the_only_one():
    image, values = vtkImageData(), np.arange(24.0)
    image.SetDimensions(2, 3, 4)
    image.GetPointData().AddArray(numpy_to_vtk(values))
    volume = volume_from_vtk(image)
    np.testing.assert_array_equal(volume.array.ravel(), values)
    with pytest.raises(UnknownArrayError, match=r"no array 'v': its arrays are \[None\]"):
        volume_from_vtk(image, "v")


@pytest.mark.parametrize("dimensions", [(4, 3, 1), (1, 3, 4)])
@pytest.mark.parametrize("kind", ["point", "cell"])
def test_one_plane_is_refused(dimensions, kind):
    grid = pv.ImageData(dimensions=dimensions)
    n = grid.n_points if kind == "point" else grid.n_cells
    getattr(grid, f"{kind}_data")["v"] = np.zeros(n)
    with pytest.raises(InvalidVolumeError, match="only one plane .* at least two points"):
        volume_from_vtk(grid)


def test_empty_image_is_refused():
    with pytest.raises(InvalidVolumeError, match="the volume is empty: it has no points"):
        volume_from_vtk(vtkImageData())


@pytest.mark.parametrize(
    ("grid", "message"),
    [
        (pv.RectilinearGrid([0.0, 1, 3], [0.0, 1], [0.0, 1]), "resample it"),
        (some_grid().cast_to_structured_grid(), "resample it"),
        (some_grid().cast_to_unstructured_grid(), "resample it"),
        (pv.Sphere(), "voxelise it"),
        (pv.MultiBlock([some_grid()]), "one by one"),
    ],
    ids=["rectilinear", "structured", "unstructured", "surface", "blocks"],
)
def test_other_grids_are_refused_with_the_remedy(grid, message):
    with pytest.raises(UnsupportedError, match=f"not a uniform grid.*{message}"):
        volume_from_vtk(grid)


# -- VDIs ------------------------------------------------------------------------------------------


def random_vdi(seed: int, width: int, height: int, longest: int) -> VDI:
    rng = np.random.default_rng(seed)
    counts = rng.integers(0, longest + 1, width * height)
    n = int(counts.sum())
    faces = np.cumsum(rng.uniform(0.01, 1.0, 2 * n)).astype(np.float32)
    return VDI(
        Camera(
            rng.normal(size=3) * 1e3,
            rng.normal(size=3),
            rng.normal(size=3),
            view_angle=rng.uniform(1, 170),
            parallel_projection=bool(seed % 2),
            model_transform=np.vstack([rng.normal(size=(3, 4)), [0, 0, 0, 1]]),
        ),
        (width, height),
        np.concatenate([[0], np.cumsum(counts)]),
        faces[::2],
        faces[1::2],
        rng.random((n, 3)),
        rng.random(n) * 1e4,
        np.sort(rng.normal(size=(3, 2))).ravel(),
        depth_origin=rng.random(),
        metadata={"seed": seed, "name": "<é&\n\"'", "nested": {"x": [0.1, None, True]}},
    )


@given(st.integers(0, 10_000), st.integers(1, 6), st.integers(1, 6), st.integers(0, 4))
def test_canonical_form_keeps_every_bit(seed, width, height, longest):
    vdi = random_vdi(seed, width, height, longest)
    image = vdi_to_image(vdi)
    assert image.GetDimensions() == (width, height, 1)
    back = vdi_from_image(image)
    assert back.equals(vdi)
    assert back.metadata == vdi.metadata


@pytest.mark.parametrize("longest", [0, 5])
def test_vti_file_keeps_every_bit(tmp_path, longest):
    vdi = random_vdi(11, 7, 5, longest)
    pv.wrap(vdi_to_image(vdi)).save(tmp_path / "vdi.vti")
    back = vdi_from_image(pv.read(tmp_path / "vdi.vti"))
    assert back.equals(vdi)
    assert back.metadata == vdi.metadata


def test_canonical_form_outlives_the_vdi_whose_memory_it_shares():
    image = vdi_to_image(random_vdi(3, 50, 40, 9))
    expected = random_vdi(3, 50, 40, 9)
    junk = [np.full(10_000, 7.0) for _ in range(50)]
    assert vdi_from_image(image).equals(expected)
    assert len(junk) == 50


def test_ordinary_image_is_no_vdi():
    with pytest.raises(InvalidVDIError, match="is not a VDI: it has no field string 'vdi'"):
        vdi_from_image(some_grid())


def text_with(image, **changes):
    return json.dumps({**json.loads(image.field_data["vdi"][0]), **changes})


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda i: i.field_data.remove("back"), "lacks its field array 'back'"),
        (lambda i: i.point_data.remove("count"), "lacks its point array 'count'"),
        (lambda i: i.field_data.set_array(["{"], "vdi"), "description is damaged"),
        (lambda i: i.field_data.set_array(['{"form_version": 1}'], "vdi"), "damaged.*camera"),
        (lambda i: i["count"].fill(1), "offsets\\[-1\\]"),
        # Found by fuzzing: errors of NumPy and Python came out, or gigabytes were taken
        (lambda i: i.field_data.set_array(["[]"], "vdi"), "description is damaged"),
        (lambda i: i.field_data.set_array(["[" * 9000], "vdi"), "description is damaged"),
        (lambda i: i.field_data.set_array([text_with(i, form_version="x")], "vdi"), "damaged"),
        (lambda i: i.field_data.set_array([text_with(i, camera=[])], "vdi"), "damaged.*list"),
        (lambda i: i.field_data.set_array([text_with(i, bounds="x")], "vdi"), "bounds must be"),
        (lambda i: setattr(i, "dimensions", (60000, 60000, 1)), "60000 x 60000 x 1 points"),
        (lambda i: setattr(i, "dimensions", (4, 2, 2)), "4 x 2 x 2 points"),
        (lambda i: i.point_data.set_array(np.full(16, -1), "count"), "whole numbers >= 0"),
        (lambda i: i.point_data.set_array(np.full(16, np.nan), "count"), "whole numbers >= 0"),
    ],
    ids=[
        *("no backs", "no counts", "no json", "no camera", "wrong counts", "a list", "deep"),
        *("version", "camera", "bounds", "window", "planes", "negative", "nan"),
    ],
)
def test_damaged_forms_are_refused(damage, message):
    image = pv.wrap(vdi_to_image(random_vdi(5, 4, 4, 3))).copy()
    damage(image)
    with pytest.raises(InvalidVDIError, match=message):
        vdi_from_image(image)


def test_newer_form_is_refused():
    image = pv.wrap(vdi_to_image(random_vdi(5, 4, 4, 3)))
    text = image.field_data["vdi"][0].replace('"form_version": 1', '"form_version": 9')
    image.field_data.set_array([text], "vdi")
    with pytest.raises(InvalidVDIError, match="version 9.*update pyvista-vdi"):
        vdi_from_image(image)


# -- volume properties -----------------------------------------------------------------------------


def linear_property(nodes=((0.0, 0.0), (10.0, 1.0)), colors=((0.0, 0, 0, 0), (10.0, 1, 1, 1))):
    prop = vtkVolumeProperty()
    opacity, color = vtkPiecewiseFunction(), vtkColorTransferFunction()
    for node in nodes:
        opacity.AddPoint(*node)
    for node in colors:
        color.AddRGBPoint(*node)
    prop.SetScalarOpacity(opacity)
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
    prop = vtkVolumeProperty()
    grey = vtkPiecewiseFunction()
    grey.AddPoint(0, 0.25)
    grey.AddPoint(10, 0.75)
    prop.SetColor(grey)
    prop.SetScalarOpacity(grey)
    prop.SetInterpolationTypeToLinear()
    function = transfer_function_from_property(prop)
    assert function.interpolation == "linear"
    np.testing.assert_allclose(function.colors, [[0.25] * 3, [0.75] * 3])


def gradient(value):
    function = vtkPiecewiseFunction()
    function.AddPoint(0, 1.0)
    function.AddPoint(10, value)
    return function


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


def test_an_rgba_volume_needs_dependent_components():
    prop = linear_property()
    with pytest.raises(UnsupportedError, match="independent components of an RGBA volume"):
        transfer_function_from_property(prop, rgba=True)
    prop.IndependentComponentsOff()
    function = transfer_function_from_property(prop, rgba=True)
    assert function.opacities.max() > 0


def test_rgba_points_share_their_memory():
    grid = some_grid()
    grid.point_data.set_array(np.arange(grid.n_points * 4, dtype=np.uint8).reshape(-1, 4), "v")
    volume = volume_from_vtk(grid)
    assert volume.rgba
    assert np.shares_memory(volume.array, grid["v"])
    np.testing.assert_array_equal(volume.array.reshape(-1, 4), grid["v"])


def test_lights_of_a_renderer():
    renderer = vtkRenderer()
    assert Lights.from_any(renderer) == Lights()  # the headlight that VTK would make
    renderer.TwoSidedLightingOff()
    light = vtkLight()
    light.SetLightTypeToCameraLight()
    light.SetPosition(1, 2, 3)
    light.SetDiffuseColor(1, 0.5, 0)
    light.SetIntensity(0.5)
    dark = vtkLight()
    dark.SwitchOff()
    renderer.AddLight(light)
    renderer.AddLight(dark)
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


def test_a_headlight_is_the_same_wherever_the_eye_is():
    renderer = vtkRenderer()
    light = vtkLight()
    light.SetLightTypeToHeadlight()
    light.SetIntensity(0.25)
    renderer.AddLight(light)
    before = Lights.from_any(renderer)
    renderer.GetActiveCamera().SetPosition(3, -4, 9)
    renderer.UpdateLightsGeometryToFollowCamera()
    assert light.GetPosition() == (3, -4, 9)
    assert Lights.from_any(renderer) == before == Lights((Light(intensity=0.25),))


def test_camera_lights_stand_where_vtk_puts_them():
    renderer = vtkRenderer()
    camera = renderer.GetActiveCamera()
    camera.SetPosition(3, -4, 9)
    camera.SetFocalPoint(1, 1, 2)
    camera.SetViewUp(0.1, 0.2, 1)
    light = vtkLight()
    light.SetLightTypeToCameraLight()
    light.SetPosition(0.3, -1.5, 0.8)
    light.SetFocalPoint(0.1, 0.2, -0.3)
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


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p: p.IndependentComponentsOff(), "dependent components, which are for RGBA"),
        (lambda p: p.SetTransferFunctionModeTo2D(), "2D transfer function"),
        (lambda p: p.SetLabelScalarOpacity(1, gradient(0.5)), "label map"),
        (lambda p: p.SetUseClippedVoxelIntensity(1), "intensity of clipped voxels"),
    ],
    ids=["rgba", "2d", "labels", "clipped voxels"],
)
def test_properties_that_cannot_be_honoured_are_refused_by_name(change, message):
    prop = linear_property()
    change(prop)
    with pytest.raises(UnsupportedError, match=message):
        transfer_function_from_property(prop)


def test_cubic_interpolation_is_refused():
    """VTK 9.7 clamps the type to linear; newer ones may not."""

    class Cubic(vtkVolumeProperty):
        def GetInterpolationType(self):
            return 2

    prop = Cubic()
    prop.SetScalarOpacity(gradient(0.5))
    with pytest.raises(UnsupportedError, match="cubic interpolation"):
        transfer_function_from_property(prop)


def test_gradient_opacity_that_does_nothing_is_accepted():
    constant, disabled = linear_property(), linear_property()
    constant.SetGradientOpacity(gradient(1.0))
    disabled.SetGradientOpacity(gradient(0.5))
    disabled.DisableGradientOpacityOn()
    for prop in (constant, disabled):
        transfer_function_from_property(prop)


def test_what_is_no_property_is_refused():
    with pytest.raises(InvalidArgumentError, match="must be a vtkVolumeProperty; got vtkMath"):
        transfer_function_from_property(vtkMath())
    with pytest.raises(InvalidArgumentError, match="opacity function has no points"):
        transfer_function_from_property(linear_property(nodes=()))


def test_values_do_not_keep_an_array_of_vtk_that_has_attributes():
    """VTK before 9.7 frees memory twice where a gone filter's attributes are the last to."""
    numbers = np.arange(12, dtype=np.float32).reshape(4, 3)
    array = to_vtk("values", numbers)
    values = as_numpy(array)
    values.flags.writeable = False
    assert numbers.flags.writeable
    assert np.shares_memory(values, numbers)
    assert values.shape == numbers.shape
    if vars(array):
        assert not any(held is array for held in bases(values))
    array.SetNumberOfTuples(2)  # of the same memory
    np.testing.assert_array_equal(as_numpy(array), numbers[:2])
    array.SetNumberOfTuples(40)  # of other memory
    assert as_numpy(array).shape == (40, 3)


def bases(values):
    """What an array of NumPy keeps alive."""
    while values is not None:
        yield values
        values = values.obj if isinstance(values, memoryview) else getattr(values, "base", None)
