"""What VTK's programs do in an order, or a combination, of their own: drawn as by VTK's mapper."""

import numpy as np
import pytest
from vtk_interface.stage import (
    LEAST_SSIM,
    SIZE,
    N,
    Scene,
    another_property,
    blanked,
    function,
    image_of,
)

from pyvista_vdi import compare_images
from pyvista_vdi.vtk_pipeline.vtk import (
    vtk_to_numpy,
    vtkCommonTransforms,
    vtkDataSetAttributes,
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


@pytest.mark.parametrize(
    ("scale", "angle", "parallel", "draw"),
    [((0.6, 1, 1.4), 30, False, "vdi"), ((0.6, 1, 1.4), 30, True, "volume")],
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


def test_a_property_on_the_actor_is_that_of_its_source(off_screen):
    pictures = []
    for ours in (False, True):
        scene = Scene(ours)
        before = scene.picture()
        scene.actor.SetProperty(another_property())
        pictures.append(scene.picture())
    assert likeness(*pictures) >= LEAST_SSIM
    assert likeness(before, pictures[1]) < LEAST_SSIM
    assert scene.source.GetVolumeProperty() is scene.actor.GetProperty()


def test_without_its_input_nothing_is_drawn(off_screen):
    scene = Scene(True)
    scene.picture()
    scene.mapper.RemoveAllInputConnections(0)
    assert np.ptp(scene.picture()) == 0
    assert scene.actor.vdi is None


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
