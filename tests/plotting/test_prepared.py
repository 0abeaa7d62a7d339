"""Grids that are resampled, and masks: what is drawn of them, and of what is changed afterwards."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest
import pyvista as pv

import pyvista_vdi as pvdi
from pyvista_vdi.errors import (
    InvalidArgumentError,
    InvalidVolumeError,
    UnsupportedError,
    VDIWarning,
)
from pyvista_vdi.vtk_pipeline.vtk import vtkImageData

pytestmark = pytest.mark.usefixtures("default_runtime")


def linear(grid):
    grid["T"] = grid.points @ np.array([1.0, 2.0, 3.0])
    return grid


def grids():
    rectilinear = pv.RectilinearGrid(*[np.array([0, 1, 1.5, 4.0])] * 3)
    image = pv.ImageData(dimensions=(5, 5, 5))
    return {
        "rectilinear": linear(rectilinear),
        "structured": linear(image.cast_to_structured_grid()),
        "unstructured": linear(image.cast_to_unstructured_grid()),
        "uniform": linear(image),
    }


def source_of(volume, **how):
    """Return what makes the VDIs of a volume in a plotter."""
    plotter = pv.Plotter(off_screen=True, window_size=(16, 12))
    try:
        return plotter.add_vdi(volume, show_scalar_bar=False, **how).mapper.GetSource()
    finally:
        plotter.close()


def shown(volume, **how):
    return source_of(volume, **how).GetVolume()


# Resampling


@pytest.mark.parametrize("kind", ["rectilinear", "structured", "unstructured", "uniform"])
def test_grids_are_resampled_where_that_is_asked_for(kind):
    grid = grids()[kind]
    if kind != "uniform":
        with pytest.raises(UnsupportedError, match="not a uniform grid"):
            shown(grid)
    volume = shown(grid, resample=(5, 6, 7))
    assert volume.dimensions == (5, 6, 7)
    x, y, z = volume.spacing
    assert volume.array[3, 2, 1] == pytest.approx(x + 2 * 2 * y + 3 * 3 * z)
    assert volume.blanked is None or not volume.blanked.any()
    auto = {"rectilinear": (4, 4, 4)}.get(kind, (5, 5, 5))
    assert shown(grid, resample="auto").dimensions == auto
    for bad in ((1, 2), (1, 5, 5), "much", 5):
        with pytest.raises(InvalidArgumentError, match="three numbers of points"):
            shown(grid, resample=bad)


def test_a_uniform_grid_is_resampled_along_its_own_axes():
    turn = np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, -1.0]])
    image = pv.ImageData(dimensions=(5, 5, 5), origin=(7, 8, 9), direction_matrix=turn)
    before = linear(image).points.reshape(5, 5, 5, 3)
    volume = shown(image, resample=(9, 3, 5))
    assert np.allclose(volume.direction, turn)
    assert volume.dimensions == (9, 3, 5)
    assert np.allclose(volume.array[1, 1, ::2], before[1, 2] @ [1, 2, 3])


def slab():
    x, y, z = np.meshgrid(*[np.arange(n + 0.0) for n in (31, 31, 7)], indexing="ij")
    return pv.StructuredGrid(x, y, z + 0.31 * x), lambda x, y: 6.0 + 0 * x


def wedge():
    x, y, s = np.meshgrid(
        np.linspace(0, 20, 21), np.linspace(0, 10, 11), np.linspace(0, 1, 6), indexing="ij"
    )
    return pv.StructuredGrid(x, y, s * (1 + 0.37 * x)), lambda x, y: 1 + 0.37 * x


def shell():
    grid = pv.SolidSphere(
        outer_radius=10, inner_radius=8, radius_resolution=4, theta_resolution=97, phi_resolution=49
    )

    def thickness(x, y):
        outer, inner = (2 * np.sqrt(np.maximum(r**2 - x**2 - y**2, 0)) for r in (10, 8))
        return outer - inner

    return grid, thickness


def voxels():
    """Whole cells, whose faces points lie on: three thick."""
    image = pv.ImageData(dimensions=(20, 20, 20))
    height = image.cell_centers().points[:, 2]
    return image.extract_cells((height > 8) & (height < 11)), lambda x, y: 3.0 + 0 * x


@pytest.mark.parametrize("make", [slab, wedge, shell, voxels])
def test_a_resampled_grid_is_as_thick_as_it_is(make):
    """In the mean: an octant is drawn or not, so that a ray is off by half an octant at each end.

    In steps of the octants' own length, so that no ray misses one.
    """
    grid, thickness = make()
    grid.clear_data()
    grid["v"] = np.ones(grid.n_points, np.float32)
    volume = shown(grid, resample="auto")
    camera = pv.Camera()
    camera.position = (*grid.center[:2], grid.bounds[5] + 50)
    camera.focal_point = grid.center
    camera.parallel_projection, camera.parallel_scale = True, 10.0
    at = (np.arange(80) + 0.5) / 4 - 10
    x, y = (at + c for c in grid.center[:2])
    inside = [
        (a > low + 1.5) & (a < high - 1.5)
        for a, low, high in ((x, *grid.bounds[:2]), (y, *grid.bounds[2:4]))
    ]
    seen = inside[1][:, None] & inside[0]
    if make is shell:
        seen = np.hypot(x, y[:, None]) < 8.5
    true = thickness(x, y[:, None]) * np.ones((80, 80))
    for interpolation in ("nearest", "linear"):
        function = pvdi.TransferFunction(
            [[0, 0, 0]] * 2, [0.1, 0.1], (0, 1), unit_distance=4.0, interpolation=interpolation
        )
        picture = pvdi.render_volume(
            volume,
            camera,
            (80, 80),
            transfer_function=function,
            settings=pvdi.Settings(sample_distance=0.05),
        )
        drawn = 4 * np.log1p(-picture[::-1, :, 3].astype(float)) / np.log1p(-0.1)
        assert drawn[seen].mean() == pytest.approx(true[seen].mean(), rel=0.02)


def test_values_beyond_a_grid_are_none_of_its_range_and_opacity_is_the_grid_s():
    grid = grids()["unstructured"]
    part = grid.extract_cells(grid.cell_centers().points.sum(axis=1) < 6)
    part["T"] += 100
    source = source_of(part, resample=(9, 9, 9))
    volume = source.GetVolume()
    assert 0 < np.count_nonzero(volume.blanked) < volume.blanked.size
    low, high = part["T"].min(), part["T"].max()
    assert volume.array.min() >= low
    assert volume.array.max() <= high
    prop = source.GetVolumeProperty()
    assert prop.GetRGBTransferFunction().GetRange() == pytest.approx((low, high))
    assert prop.GetScalarOpacityUnitDistance() == 1  # as add_volume leaves it for such a grid


def test_categories_are_resampled_by_the_nearest():
    grid = grids()["unstructured"]
    grid["label"] = np.where(grid.points[:, 0] < 1.5, 10, 30).astype(np.uint8)
    for image in (grid, pv.ImageData(dimensions=(5, 5, 5))):
        image["label"] = grid["label"]
        volume = shown(image, scalars="label", categories=True, resample=(10, 10, 10))
        assert np.unique(volume.array).tolist() == [10, 30]


def test_values_of_cells_and_of_their_own_are_resampled():
    grid = grids()["unstructured"]
    own = shown(grid, scalars=np.arange(grid.n_cells), resample=(9, 9, 9))
    assert own.array[1, 1, 1::2].tolist() == [0, 1, 2, 3]
    grid.cell_data["T"] = np.full(grid.n_cells, 7.0)
    assert np.unique(shown(grid, scalars="T", preference="cell", resample=(5, 5, 5)).array) == 7


def test_what_has_no_volume_is_refused():
    surface = pv.Sphere().cast_to_unstructured_grid()
    surface["T"] = np.arange(surface.n_points)
    with pytest.raises(InvalidVolumeError, match="none of the .* cells has a volume"):
        shown(surface, resample="auto")
    with pytest.raises(InvalidVolumeError, match="no point .* lies in a cell"):
        shown(surface, resample=(5, 5, 5))


def test_blocks_are_resampled_and_others_refused_before_any_is_added():
    plotter = pv.Plotter(off_screen=True, window_size=(16, 12))
    blocks = pv.MultiBlock([grids()["rectilinear"], pv.MultiBlock([grids()["unstructured"]])])
    first, (second,) = plotter.add_vdi(blocks, resample=(5, 6, 7), show_scalar_bar=False)
    for actor in (first, second):
        assert actor.mapper.GetSource().GetVolume().dimensions == (5, 6, 7)
    count = len(plotter.renderer.actors)
    with pytest.raises(UnsupportedError, match="a surface has no volume"):
        plotter.add_vdi(pv.MultiBlock([*blocks, pv.Sphere()]), resample="auto")
    with pytest.raises(UnsupportedError, match="not a uniform grid"):
        plotter.add_vdi(blocks)
    assert len(plotter.renderer.actors) == count
    plotter.close()


# Masks


def masked():
    """A volume, labels for its points, for its cells, and the octants that are blank then."""
    image = linear(pv.ImageData(dimensions=(4, 5, 6), spacing=(1, 2, 3), origin=(7, 8, 9)))
    points = np.arange(120).reshape(6, 5, 4) % 4 > 1
    cells = np.arange(60).reshape(5, 4, 3) % 3 > 0
    return image, points, cells, np.where(points, 0, 255)


def test_a_voxel_that_a_mask_marks_is_drawn_whole():
    image, points, cells, blank = masked()
    for labels in (points.ravel(), points.T.astype(np.int64) * 7, points.astype(np.uint8).T):
        assert np.array_equal(shown(image, mask=labels).blanked, blank)
    # Of the octants, those in the cells: the cell above x = 0 is blank, the others are drawn
    blanked = shown(image, mask=cells.T).blanked
    assert (blanked == [0xFF, 0x55, 0, 0]).all()
    vdi = pvdi.generate(image, pvdi.Camera((8, 12, 90), (8, 12, 16), (0, 1, 0)), (4, 3))
    with pytest.raises(UnsupportedError, match="mask cannot be given with a VDI"):
        shown(vdi, mask=points.ravel())


@pytest.mark.gl
@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
def test_masks_are_drawn_as_by_vtk(interpolation):
    """Three voxels of black on white; one more or less makes 18 of 255 of a difference."""
    image = linear(pv.ImageData(dimensions=(24, 26, 28)))
    marked = (np.abs(image.points[:, 0] - 12) < 2).astype(np.uint8)
    mask = vtkImageData()
    mask.CopyStructure(image)
    mask.GetPointData().SetScalars(pv.convert_array(255 * marked))
    pictures = []
    for ours in (True, False):
        plotter = pv.Plotter(off_screen=True, window_size=(80, 60), lighting="none")
        plotter.background_color = "white"
        look = {"cmap": ["black"] * 2, "opacity": [0.1, 0.1], "opacity_unit_distance": 1.0}
        if ours:
            plotter.add_vdi(image, mask=marked, interpolation=interpolation, **look)
        else:
            actor = plotter.add_volume(image, mapper="gpu", **look)
            actor.prop.interpolation_type = interpolation
            actor.mapper.SetMaskInput(mask)
            actor.mapper.SetMaskTypeToBinary()
        plotter.remove_scalar_bar()
        plotter.enable_parallel_projection()
        plotter.camera_position = "yz"
        pictures.append(plotter.screenshot(return_img=True)[30, 40, 0])
        plotter.close()
    assert pictures == pytest.approx([255 * 0.9**3] * 2, abs=5)  # VTK's opacities are bytes


def test_scalars_are_those_without_the_mask():
    image = masked()[0]
    ones = np.ones(image.n_points, np.uint8)
    lone = image.copy()
    lone.GetPointData().SetActiveScalars(None)
    array = np.arange(120.0).reshape(4, 5, 6)
    for volume, how in (
        (image.points_to_cells(), {}),
        (image.point_data_to_cell_data(), {}),
        (lone, {}),
        (image, {"scalars": np.arange(120.0)}),
        (array, {"resolution": (1, 1, 3)}),
        (pvdi.Volume(array, (1, 1, 3)), {}),
    ):
        plain, with_mask = source_of(volume, **how), source_of(volume, mask=ones, **how)
        before, after = plain.GetVolume(), with_mask.GetVolume()
        assert (after.name, after.spacing) == (before.name, before.spacing)
        assert np.array_equal(after.array, before.array)
        ranges = [
            s.GetVolumeProperty().GetRGBTransferFunction().GetRange() for s in (plain, with_mask)
        ]
        assert ranges[0] == ranges[1]


def test_a_mask_on_the_same_points_is_aligned_and_another_refused(tmp_path):
    image, points, _, blank = masked()
    # z, then x, then y downwards, from the box's corner at the largest y
    turned = pv.ImageData(
        dimensions=(6, 4, 5),
        spacing=(3, 1, 2),
        origin=(7, 16, 9),
        direction_matrix=[[0, 1, 0], [0, 0, -1], [1, 0, 0]],
    )
    turned["m"] = points[:, ::-1].transpose(1, 2, 0).ravel().astype(np.uint8)
    assert np.array_equal(shown(image, mask=turned).blanked, blank)
    path = tmp_path / "mask.vti"
    turned.save(path)
    assert np.array_equal(shown(image, mask=path).blanked, blank)
    other = pv.ImageData(dimensions=(4, 5, 6), spacing=(1, 2, 3), origin=(7, 8, 9.5))
    other["m"] = points.ravel().astype(np.uint8)
    image["m"] = other["m"]
    image.set_active_scalars("T")
    none = pv.ImageData(dimensions=(4, 5, 6))
    for bad, why in (
        (other, "cover .* 9.5, 24.5.* 9.0, 24.0.*resample it"),
        (none, "must have labels"),
        (np.zeros((4, 5, 7)), r"each of the volume's 120 points \(\(4, 5, 6\).*got .*\(4, 5, 7\)"),
        (np.array(["a"] * 120), "must be of numbers"),
        ("m", "names an array of the volume: .*mask=volume\\['m'\\]"),
        ("lung.nii", "'lung.nii'.*does not exist"),
        (pv.Sphere(), "a surface has no volume"),
    ):
        with pytest.raises(InvalidArgumentError, match=why):
            shown(image, mask=bad)


def test_a_grid_is_masked_and_then_resampled():
    grid = grids()["unstructured"]
    low = grid.points[:, 2] < 1.5
    assert (
        shown(grid, mask=low, resample=(5, 5, 5)).blanked[:, 2, 2] == [0, 0, 255, 255, 255]
    ).all()
    cells = grid.cell_centers().points[:, 2] < 2
    blanked = shown(grid, mask=cells, resample=(9, 9, 9)).blanked
    assert (blanked[:, 2, 2] == [0, 0, 0, 0, 0xF0, 255, 255, 255, 255]).all()


# What is changed afterwards


def in_place(volume, mask):
    volume["T"][:] = 5


def behind_vtk(volume, mask):
    np.asarray(volume["T"])[:] = 5
    volume.Modified()


def of_the_mask(volume, mask):
    mask["m"][:] = 1


def another_array(volume, mask):
    mask["m"] = np.ones_like(mask["m"])


def another_mask(volume, mask):
    mask.DeepCopy(pv.wrap(mask).copy())
    mask["m"] = np.ones_like(mask["m"])


@pytest.mark.parametrize("change", [in_place, behind_vtk, of_the_mask, another_array, another_mask])
@pytest.mark.parametrize("resample", [None, (4, 5, 6)])
def test_what_is_resampled_or_masked_is_watched(change, resample):
    image, points, _, _ = masked()
    mask = image.copy()
    mask.clear_data()
    mask["m"] = points.ravel().astype(np.uint8)
    source = source_of(image, scalars="T", resample=resample, mask=mask)
    before = source.GetVolume()
    assert source.GetVolume() is before
    change(image, mask)
    after = source.GetVolume()
    if change in (in_place, behind_vtk):
        assert (after.array == 5).all()
        assert np.array_equal(after.blanked, before.blanked)
    else:
        assert np.array_equal(after.array, before.array)
        assert before.blanked.any()
        assert not after.blanked.any()


def test_a_mask_that_is_an_array_is_watched_and_the_choice_of_another_array_stays():
    image, points, _, _ = masked()
    image["other"] = np.zeros(image.n_points)
    labels = np.ascontiguousarray(points.T)
    source = source_of(image, scalars="T", mask=labels)
    assert source.GetVolume().blanked.any()
    source.GetInputDataObject(0, 0).set_active_scalars("other")
    labels[:] = True
    assert not source.GetVolume().blanked.any()
    assert source.GetVolume().name == "other"


def test_a_change_that_cannot_be_drawn_is_said_and_the_picture_stays():
    image = masked()[0]
    mask = image.copy()
    source = source_of(image, mask=mask)
    before = source.GetVolume()
    mask.origin = (0, 0, 0)
    with pytest.warns(VDIWarning, match="the picture stays: mask must have a label"):
        after = source.GetVolume()
    assert np.array_equal(after.array, before.array)
    mask.origin = image.origin
    source.GetVolume()


def test_nothing_of_a_masked_volume_stays():
    image, points, _, _ = masked()
    source = source_of(image, mask=points.ravel())
    output = weakref.ref(source.GetInputDataObject(0, 0))
    del source
    gc.collect()
    assert output() is None
