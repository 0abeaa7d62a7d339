"""What VTK's programs do in an order, or a combination, of their own: drawn as by VTK's mapper."""

import numpy as np
import pytest
import pyvista as pv
from vtk_interface.rows import LEAST_SSIM, as_rgba, blanked
from vtk_interface.stage import (
    SIZE,
    N,
    Scene,
    another_property,
    colors,
    function,
    image_of,
    some_property,
    values,
)

import pyvista_vdi as pvdi
from pyvista_vdi import compare_images
from pyvista_vdi.errors import VDIWarning
from pyvista_vdi.vtk_pipeline import volume_from_vtk
from pyvista_vdi.vtk_pipeline.vtk import (
    vtk_to_numpy,
    vtkCommonCore,
    vtkCommonTransforms,
    vtkDataSetAttributes,
    vtkVolumeProperty,
)

pytestmark = pytest.mark.gl


def likeness(one, other):
    """The SSIM of two pictures, neither of which is empty."""
    assert min(np.ptp(one), np.ptp(other)) > 0.3
    return compare_images(one, other).ssim


def transform(scale, angle=0.0):
    made = vtkCommonTransforms.vtkTransform()
    made.Translate(N / 2, N / 2, N / 2)
    made.RotateWXYZ(angle, 1, 0.5, 0)
    made.Scale(*scale)
    made.Translate(-N / 2, -N / 2, -N / 2)
    return made.GetMatrix()


@pytest.mark.parametrize("draw", ["vdi", "volume"])
@pytest.mark.parametrize("parallel", [False, True])
@pytest.mark.parametrize(
    ("scale", "angle"), [((0.5, 0.5, 0.5), 0), ((1, 1, 1), 70), ((0.6, 1, 1.4), 30)]
)
def test_a_camera_s_model_transform_is_as_the_actor_s_matrix(
    off_screen, scale, angle, parallel, draw
):
    """VTK's own mapper marches another way through it in parallel projection."""
    pictures = []
    for ours in (False, True):
        scene = Scene(ours)
        if ours:
            scene.mapper.SetDraw(draw)
            scene.picture()
            scene.camera.SetModelTransformMatrix(transform(scale, angle))
        else:
            scene.actor.SetUserMatrix(transform(scale, angle))
        scene.camera.SetParallelProjection(parallel)
        scene.camera.SetParallelScale(N)
        scene.camera.SetClippingRange(1, 200)
        pictures.append(scene.picture())
        if ours and draw == "vdi":
            # Made for what is seen, too: its own view is the frame's
            assert scene.actor.regenerate().equals(scene.vdi())
            assert scene.actor.status.angle == pytest.approx(0, abs=1e-4)
    assert likeness(*pictures) >= LEAST_SSIM


@pytest.mark.parametrize("rgba", [True, False])
def test_a_property_on_the_actor_changes_nothing(off_screen, rgba):
    scene = Scene(True)
    if rgba:
        as_rgba(scene)
    before = scene.picture()
    scene.actor.SetProperty(scene.prop)  # there is nothing to say
    np.testing.assert_array_equal(scene.picture(), before)
    for dependent in (False, True):
        prop = another_property()
        prop.SetIndependentComponents(not dependent)
        with pytest.warns(VDIWarning, match=r"VDIActor\.SetProperty.*SetVolumeProperty"):
            scene.actor.SetProperty(prop)
        np.testing.assert_array_equal(scene.picture(), before)


@pytest.mark.parametrize("frame_before", [False, True])
@pytest.mark.parametrize("set_before", [False, True])
def test_functions_may_be_filled_after_the_property_was_set(off_screen, set_before, frame_before):
    if frame_before and set_before:
        pytest.skip("a frame of functions without points is reported")
    pictures = []
    for ours in (False, True):
        prop, color, opacity = vtkVolumeProperty(), colors(), function()
        if set_before:
            prop.SetColor(color)
            prop.SetScalarOpacity(opacity)
        scene = Scene(ours, prop=prop)
        if frame_before:
            scene.picture()
        if not set_before:
            prop.SetColor(color)
            prop.SetScalarOpacity(opacity)
        color.AddRGBPoint(0, 0, 0, 1)
        color.AddRGBPoint(255, 1, 0.5, 0)
        opacity.AddPoint(0, 0)
        opacity.AddPoint(255, 0.5)
        pictures.append(scene.picture())
    assert likeness(*pictures) >= LEAST_SSIM


def test_without_its_input_nothing_is_drawn(off_screen):
    scene = Scene(True)
    scene.picture()
    scene.mapper.RemoveAllInputConnections(0)
    assert np.ptp(scene.picture()) == 0
    assert scene.actor.vdi is None


def indexed():
    ids = vtkCommonCore.vtkIdList()
    for i in range(N**3):
        ids.InsertNextId(N**3 - 1 - i)
    array = vtkCommonCore.vtkIndexedTypeFloat32Array()
    array.ConstructBackend(ids, image_of().GetPointData().GetArray("v"))
    return array


def joined():
    parts = vtkCommonCore.vtkDataArrayCollection()
    for half in (values().ravel()[: N**3 // 2], values().ravel()[N**3 // 2 :]):
        parts.AddItem(pv.convert_array(half, deep=True))
    array = vtkCommonCore.vtkCompositeTypeFloat32Array()
    array.ConstructBackend(parts)
    return array


def constant():
    array = vtkCommonCore.vtkConstantTypeUInt16Array()
    array.ConstructBackend(7)
    return array


@pytest.mark.skipif(
    not hasattr(vtkCommonCore, "vtkIndexedTypeFloat32Array"),
    reason="this VTK wraps none for Python",
)
@pytest.mark.parametrize(
    ("make", "expected"),
    [(indexed, values().ravel()[::-1]), (joined, values().ravel()), (constant, 7)],
)
def test_implicit_arrays_are_copied(make, expected):
    array = make()
    array.SetNumberOfTuples(N**3)
    found = volume_from_vtk(image_of(array)).array
    np.testing.assert_array_equal(found.ravel(), np.broadcast_to(expected, N**3))
    assert found.dtype == np.dtype("uint16" if make is constant else "float32")


#: What is marked of a grid of points or of cells.
MARKED = {
    "points": ("points", lambda grid: mark(grid, "Point", vtkDataSetAttributes.HIDDENPOINT)),
    "cells": ("points", lambda grid: mark(grid, "Cell", vtkDataSetAttributes.HIDDENCELL)),
    "cells, of values of cells": (
        "cells",
        lambda grid: mark(grid, "Cell", vtkDataSetAttributes.HIDDENCELL),
    ),
    "points, of values of cells": (
        "cells",
        lambda grid: mark(grid, "Point", vtkDataSetAttributes.HIDDENPOINT),
    ),
}


def mark(grid, kind, value):
    getattr(grid, f"Allocate{kind}GhostArray")()
    n = np.array(grid.GetDimensions()) - (kind == "Cell")
    marks = vtk_to_numpy(getattr(grid, f"Get{kind}GhostArray")()).reshape(n)
    marks[3:9, 3:9, 6:] = value


@pytest.mark.parametrize("given", [False, True], ids=["active", "array"])
@pytest.mark.parametrize("name", MARKED)
def test_add_vdi_leaves_out_what_add_volume_does(closed, name, given):
    of, change = MARKED[name]
    pictures = []
    for how in ("add_volume", "add_vdi"):
        n = N + (of == "cells")
        grid = pv.ImageData(dimensions=(n, n, n))
        (grid.cell_data if of == "cells" else grid.point_data)["v"] = values().ravel()
        change(grid)
        plotter = pv.Plotter(off_screen=True, window_size=SIZE)
        scalars = {"scalars": values().ravel()} if given else {}
        more = {"mapper": "gpu"} if how == "add_volume" else {}
        looks = {"opacity": [0, 0.5], "show_scalar_bar": False, **scalars, **more}
        actor = getattr(plotter, how)(grid, **looks)
        actor.mapper.SetSampleDistance(0.5)
        if how == "add_volume":
            actor.mapper.SetAutoAdjustSampleDistances(0)
        pictures.append(plotter.screenshot(return_img=True) / 255.0)
        plotter.close()
    assert likeness(*pictures) >= LEAST_SSIM


def test_marks_that_change_make_another_vdi_and_picks_go_through(off_screen):
    grid = blanked(image_of())
    scene = Scene(True, grid)
    scene.prop.SetScalarOpacity(function((0, 0), (60, 0), (61, 1), (255, 1)))
    x, y = (n // 2 for n in SIZE)
    scene.picture()
    hit = scene.actor.pick(x, y)
    front = scene.source.GetVDI()
    marks = vtk_to_numpy(grid.GetPointGhostArray()).reshape(N, N, N)
    marks[: N // 2] = vtkDataSetAttributes.HIDDENPOINT
    marks[:, :, N // 2 :] = vtkDataSetAttributes.HIDDENPOINT
    grid.Modified()
    scene.picture()
    assert not scene.source.GetVDI().equals(front)
    behind = scene.actor.pick(x, y)
    assert behind is None or np.linalg.norm(np.subtract(behind.position, hit.position)) > 1


def test_generate_and_the_source_make_the_same_of_a_blanked_grid():
    grid = blanked(image_of())
    camera = pvdi.Camera((40, 30, 50), (N / 2,) * 3, (0, 1, 0))
    made = pvdi.generate(grid, camera, (12, 9), volume_property=some_property())
    source = pvdi.VDISource()
    source.SetInputDataObject(grid)
    source.SetVolumeProperty(some_property())
    source.SetCamera(camera)
    source.SetWindowSize(12, 9)
    assert source.GetVDI().equals(made)
    other = pvdi.generate(image_of(), camera, (12, 9), volume_property=some_property())
    assert not made.equals(other)
