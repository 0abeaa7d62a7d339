"""VDIs that overlap on the screen: merged by depth, whatever the order of adding."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import (
    LOOKS,
    TOLERANCE,
    add_ours,
    opaque_sphere,
    shown,
    soft_ball,
)
from skimage.metrics import structural_similarity

from pyvista_vdi.vtk_pipeline.vtk import (
    vtkMultiVolume,
    vtkOpenGLGPUVolumeRayCastMapper,
    vtkVolume,
)

pytestmark = pytest.mark.gl

WINDOW = (100, 80)
CAMERA = ((4.0, 3.0, 2.0), (0.4, 0.2, 0.1), (0.0, 0.0, 1.0))
#: Two that overlap, and a third that overlaps both: colours and places.
BALLS = (("viridis", (0.0, 0.0, 0.0)), ("hot", (0.9, 0.4, 0.2)), ("bone", (0.2, 0.7, -0.4)))


def add_ball(plotter, which, *, place=None, add=add_ours, **more):
    cmap, at = BALLS[which]
    matrix = pv.Transform().translate(*(at if place is None else place)).matrix
    return add(plotter, soft_ball(), cmap=cmap, user_matrix=matrix, **more)


def new_plotter(**options):
    plotter = pv.Plotter(**{"window_size": WINDOW, **options})
    plotter.set_background("lightsteelblue")
    return plotter


def draw(order, scene=None):
    """The picture of balls that are added in an order; ``scene`` gets them in the fixed one."""
    plotter = new_plotter()
    actors = {which: add_ball(plotter, which) for which in order}
    plotter.camera_position = CAMERA
    if scene is not None:
        scene(plotter, actors)
    image = shown(plotter)
    plotter.close()
    return image


def with_sphere(plotter, actors):
    opaque_sphere(plotter)


def meshes(plotter, actors):
    opaque_sphere(plotter)
    plotter.add_mesh(pv.Plane(direction=(1, 1, 0), i_size=2, j_size=2), color="red", opacity=0.5)


def one_cropped(plotter, actors):
    actors[1].mapper.SetCroppingRegionPlanes(-0.5, 0.1, -0.3, 0.4, -0.2, 0.9)
    actors[1].mapper.SetCroppingRegionFlagsToFence()
    actors[1].mapper.CroppingOn()


def eye_in_both(plotter, actors):
    plotter.camera_position = ((0.8, 0.3, 0.2), (-1.0, 0.0, -0.2), (0, 0, 1))
    plotter.renderer.ResetCameraClippingRange()


@pytest.mark.filterwarnings("ignore:coverage='bounds'")
@pytest.mark.parametrize(
    "scene",
    [meshes, one_cropped, eye_in_both],
    ids=lambda scene: scene.__name__,
)
def test_the_order_of_adding_changes_nothing(scene):
    first, second = draw((0, 1), scene), draw((1, 0), scene)
    assert np.array_equal(first, second)
    alone = draw((1,), lambda plotter, actors: scene(plotter, {0: None, **actors}))
    assert np.abs(first - alone).max() > 40  # the other one is there


def multi_volume():
    """VTK's own joint picture of two volumes: one mapper that samples both at each step."""
    plotter = new_plotter()
    mapper, volumes = vtkOpenGLGPUVolumeRayCastMapper(), vtkMultiVolume()
    volumes.SetMapper(mapper)
    kept = []  # VTK's multi volume holds its parts weakly
    for port, (cmap, place) in enumerate(BALLS[:2]):
        donor = new_plotter()
        actor = donor.add_volume(soft_ball(), mapper="gpu", **{**LOOKS, "cmap": cmap})
        actor.prop.interpolation_type = "linear"
        ball, volume = soft_ball(), vtkVolume()
        mapper.SetInputDataObject(port, ball)
        volume.SetProperty(actor.prop)
        volume.SetPosition(*place)
        volumes.SetVolume(volume, port)
        kept += [actor, ball, volume]
        donor.close()
    mapper.SetAutoAdjustSampleDistances(0)
    mapper.SetSampleDistance(0.02)
    plotter.renderer.AddVolume(volumes)
    opaque_sphere(plotter)
    plotter.camera_position = CAMERA
    image = shown(plotter)
    plotter.close()
    return image


def test_as_vtk_marches_both_volumes_together():
    """The outside opinion: seen are an SSIM of .998 and 4 of 255."""
    judge, ours = multi_volume(), draw((0, 1), with_sphere)
    assert np.abs(judge - draw((0,), with_sphere)).max() > 40, "VTK's own picture lacks a volume"
    ssim = structural_similarity(
        judge / 255,
        ours / 255,
        data_range=1,
        channel_axis=-1,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
    )
    assert ssim >= 0.99
    assert np.abs(judge - ours).max() <= TOLERANCE


@pytest.mark.usefixtures("no_leaks")
def test_nothing_is_left_and_what_is_out_of_the_picture_is_not_generated():
    draw((0, 1), meshes)
    plotter = new_plotter()
    add_ball(plotter, 0)
    away = add_ball(plotter, 1, place=(60.0, 60.0, 0.0))
    plotter.camera_position = CAMERA
    plotter.show(auto_close=False)
    assert away.mapper.GetSource().last is None
    plotter.close()
