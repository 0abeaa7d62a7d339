"""VDIs that overlap on the screen: merged by depth, whatever the order of adding."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import (
    LOOKS,
    TOLERANCE,
    add_judge,
    add_ours,
    opaque_sphere,
    shown,
    soft_ball,
    tiled_picture,
)
from skimage.metrics import structural_similarity
from watched_windows import on_screen

from pyvista_vdi.errors import VDIWarning
from pyvista_vdi.vtk_pipeline.drawing import overlap
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkAssembly,
    vtkMultiVolume,
    vtkOpenGLGPUVolumeRayCastMapper,
    vtkVolume,
)

pytestmark = pytest.mark.gl

WINDOW = (100, 80)
CAMERA = ((4.0, 3.0, 2.0), (0.4, 0.2, 0.1), (0.0, 0.0, 1.0))
#: Two that overlap, and a third that overlaps both: colours and places.
BALLS = (("viridis", (0.0, 0.0, 0.0)), ("hot", (0.9, 0.4, 0.2)), ("bone", (0.2, 0.7, -0.4)))


@pytest.fixture
def raycasts(monkeypatch):
    """The number of VDIs in each joint picture that is raycast."""
    counts = []
    owned_image = overlap.owned_image

    def counting(placed, *args, **kwargs):
        counts.append(len(placed))
        return owned_image(placed, *args, **kwargs)

    monkeypatch.setattr(overlap, "owned_image", counting)
    return counts


def add_ball(plotter, which, *, place=None, add=add_ours, **more):
    cmap, at = BALLS[which]
    matrix = pv.Transform().translate(*(at if place is None else place)).matrix
    return add(plotter, soft_ball(), cmap=cmap, user_matrix=matrix, **more)


def new_plotter(**options):
    plotter = pv.Plotter(**{"window_size": WINDOW, **options})
    plotter.set_background("lightsteelblue")
    return plotter


def draw(order, scene=None, shot=shown):
    """The picture of balls that are added in an order; ``scene`` gets them in the fixed one."""
    plotter = new_plotter()
    actors = {which: add_ball(plotter, which) for which in order}
    plotter.camera_position = CAMERA
    if scene is not None:
        scene(plotter, actors)
    image = shot(plotter)
    plotter.close()
    return image


def two_balls():
    """A plotter of two, which has drawn nothing yet, and the actors."""
    plotter = new_plotter()
    actors = [add_ball(plotter, which) for which in (0, 1)]
    plotter.camera_position = CAMERA
    return plotter, actors


def meshes(plotter, actors):
    opaque_sphere(plotter)
    plotter.add_mesh(pv.Plane(direction=(1, 1, 0), i_size=2, j_size=2), color="red", opacity=0.5)


def one_cropped(plotter, actors):
    actors[1].mapper.SetCroppingRegionPlanes(-0.5, 0.1, -0.3, 0.4, -0.2, 0.9)
    actors[1].mapper.SetCroppingRegionFlagsToFence()
    actors[1].mapper.CroppingOn()


def one_inverted(plotter, actors):
    actors[1].mapper.SetFinalColorWindow(-1.0)


def one_in_an_assembly(plotter, actors):
    plotter.remove_actor(actors[1], render=False)
    actors[1].user_matrix, assembly = np.eye(4), vtkAssembly()
    assembly.AddPart(actors[1])
    assembly.SetPosition(BALLS[1][1])
    plotter.add_actor(assembly, reset_camera=False)


def eye_in_both(plotter, actors):
    plotter.camera_position = ((0.8, 0.3, 0.2), (-1.0, 0.0, -0.2), (0, 0, 1))
    plotter.renderer.ResetCameraClippingRange()


def anti_aliased(plotter, actors):
    plotter.enable_anti_aliasing("msaa", multi_samples=4)
    opaque_sphere(plotter)


def right_eye(plotter, actors):
    plotter.render_window.StereoRenderOn()
    plotter.render_window.SetStereoType(5)


def sheared(plotter, actors):
    shear = np.array([[1, 0.3, 0, 0.5], [0, 1, 0, 0.2], [0, 0, 1.4, 0], [0, 0, 0, 1]])
    actors[1].user_matrix = shear


@pytest.mark.every(3)
@pytest.mark.filterwarnings("ignore:coverage='bounds'")
@pytest.mark.parametrize(
    "scene",
    [
        *(meshes, one_cropped, one_in_an_assembly),
        *(eye_in_both, anti_aliased, right_eye, sheared),
    ],
    ids=lambda scene: scene.__name__,
)
def test_the_order_of_adding_changes_nothing(scene, raycasts):
    first, second = draw((0, 1), scene), draw((1, 0), scene)
    assert set(raycasts) == {2}
    assert np.array_equal(first, second)
    alone = draw((1,), lambda plotter, actors: scene(plotter, {0: None, **actors}))
    assert np.abs(first - alone).max() > 40  # the other one is there


def test_other_window_and_level_of_one_are_refused():
    plotter, _ = two_balls()
    shown(plotter)
    plotter.close()
    with pytest.warns(VDIWarning, match="overlap .*SetFinalColorWindow"):
        draw((0, 1), one_inverted)


def test_an_assembly_and_what_is_beside_it_are_merged():
    assert np.abs(draw((0, 1), one_in_an_assembly) - draw((0, 1))).max() <= 1


def test_any_order_of_three(raycasts):
    # Each pair in both orders, and each of them once as the first
    first, *others = (draw(order) for order in ((0, 1, 2), (2, 1, 0), (1, 2, 0)))
    assert set(raycasts) == {3}
    for image in others:
        assert np.array_equal(image, first)


@pytest.mark.every(3)
@pytest.mark.parametrize("tiled", [False, True])
def test_pictures_of_twice_the_size(tiled, raycasts):
    def whole(plotter):
        return plotter.screenshot(return_img=True, scale=2)

    shot = tiled_picture if tiled else whole
    first, second = draw((0, 1), meshes, shot), draw((1, 0), meshes, shot)
    assert set(raycasts) == {2}
    assert first.max() > 0
    assert np.array_equal(first, second)


def multi_volume(sphere):
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
    if sphere:
        opaque_sphere(plotter)
    plotter.camera_position = CAMERA
    image = shown(plotter)
    plotter.close()
    return image


@pytest.mark.every(3)
@pytest.mark.parametrize("sphere", [True, False])
def test_as_vtk_marches_both_volumes_together(sphere):
    """The outside opinion: seen are an SSIM of .998 and 4 of 255."""
    scene = (lambda plotter, _: opaque_sphere(plotter)) if sphere else None
    judge, ours = multi_volume(sphere), draw((0, 1), scene)
    assert np.abs(judge - draw((0,), scene)).max() > 40, "VTK's own picture lacks a volume"
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


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_one_behind_the_other(order, raycasts):
    """Disjoint in depth, one before the other on the screen: as VTK's, added from behind."""
    places = ((0.0, 0.0, 0.0), (-2.4, -1.8, -1.2))  # the second is behind, on the view's axis

    def scene(add, order):
        plotter = new_plotter()
        for which in order:
            add_ball(plotter, which, place=places[which], add=add)
        plotter.camera_position = (CAMERA[0], (0, 0, 0), CAMERA[2])
        image = shown(plotter)
        plotter.close()
        return image

    far_first = scene(add_judge, (1, 0))
    near_first = scene(add_judge, (0, 1))
    assert np.abs(far_first - near_first).max() > 40
    assert np.abs(scene(add_ours, order) - far_first).max() <= TOLERANCE
    assert set(raycasts) == {2}


def test_apart_on_the_screen_each_draws_itself(raycasts):
    plotter = new_plotter()
    for which, shift in ((0, -2.0), (1, 2.0)):
        add_ball(plotter, which, place=(shift, -shift, 0))
    plotter.camera_position = ((6, 6, 2), (0, 0, 0), (0, 0, 1))
    plotter.show(auto_close=False)
    assert raycasts == []


def test_changes_are_seen_at_once(raycasts):
    plotter, actors = two_balls()
    both = shown(plotter)
    actors[0].SetVisibility(False)
    hidden = shown(plotter)
    actors[0].SetVisibility(True)
    assert np.array_equal(shown(plotter), both)
    # VDIs of their own views, so only nearly what is drawn anew
    assert np.abs(hidden - draw((1,))).max() <= 2
    plotter.remove_actor(actors[0])
    assert np.array_equal(shown(plotter), hidden)
    actors[0] = add_ball(plotter, 0)
    assert np.abs(shown(plotter) - both).max() <= 2
    actors[1].user_matrix = np.eye(4)
    moved = shown(plotter)
    assert np.abs(moved - both).max() > 40
    actors[0].mapper.lookup_table.cmap = "bone"
    assert np.abs(shown(plotter) - moved).max() > 20


def test_several_renderers_and_one_actor_in_two(raycasts):
    plotter = new_plotter(shape=(1, 2), window_size=(240, 120))
    plotter.subplot(0, 0)
    actors = [add_ball(plotter, which) for which in (0, 1)]
    plotter.camera_position = CAMERA
    plotter.subplot(0, 1)
    for actor in reversed(actors):
        plotter.add_actor(actor)
    plotter.link_views()
    images = shown(plotter), tiled_picture(plotter)[::2, ::2].astype(int)
    plotter.close()
    for image in images:  # half of the tiles show nothing of a renderer
        left, right = image[2:-2, 2:118], image[2:-2, 122:238]
        assert np.abs(left - image[2, 2]).max() > 40
        assert np.abs(left - right).max() <= 1


def test_previews_are_of_one_size():
    previews = []
    for order in ((0, 1), (1, 0)):
        plotter = new_plotter()
        actors = {which: add_ball(plotter, which) for which in order}
        plotter.camera_position = CAMERA
        full = shown(plotter)
        for actor in actors.values():
            actor.mapper.SetInteractiveOffScreen(True)
            actor.mapper.SetRegenerate("never")
            actor.mapper.SetTargetFrameRate(1e6)  # as coarse as allowed
        actors[0].mapper.SetMaximumImageSampleDistance(2)
        plotter.render_window.SetDesiredUpdateRate(60.0)
        for degrees in (1, -1):
            plotter.camera.Azimuth(degrees)
            plotter.render_window.Render()
        previews.append(on_screen(plotter.render_window))
        # The finer of what the two allow: every second pixel
        wanted = ("preview", (WINDOW[0] // 2) * (WINDOW[1] // 2))
        assert {(a.status.mode, a.status.samples) for a in actors.values()} == {wanted}
        plotter.render_window.SetDesiredUpdateRate(0.001)
        plotter.close()
    assert np.array_equal(*previews)
    assert np.abs(previews[0] - full).mean() < 3


def test_what_cannot_be_drawn_leaves_the_other(raycasts, monkeypatch):
    plotter, actors = two_balls()

    def fail():
        raise RuntimeError("no such luck")

    monkeypatch.setattr(actors[0].mapper.GetSource(), "GetVDI", fail)
    with pytest.warns(VDIWarning, match="no such luck"):
        plotter.show(auto_close=False)
    assert raycasts == []
    assert np.abs(shown(plotter) - draw((1,))).max() <= 2
    plotter.close()


@pytest.mark.usefixtures("no_leaks")
def test_nothing_is_left_and_what_is_out_of_the_picture_is_not_generated(raycasts):
    draw((0, 1), meshes)
    assert set(raycasts) == {2}
    raycasts.clear()
    plotter = new_plotter()
    add_ball(plotter, 0)
    away = add_ball(plotter, 1, place=(60.0, 60.0, 0.0))
    plotter.camera_position = CAMERA
    plotter.show(auto_close=False)
    assert raycasts == []
    assert away.mapper.GetSource().GetCurrentVDI() is None
    plotter.close()
