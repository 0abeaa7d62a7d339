"""Whole scenes against VTK's own volume: what users see when they put one in place of the other."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import (
    LOOKS,
    TOLERANCE,
    WINDOW,
    add_judge,
    add_nothing,
    add_ours,
    assert_as_vtk,
    draw,
    opaque_sphere,
    soft_ball,
    tiled_picture,
)

from pyvista_vdi.errors import VDIWarning
from pyvista_vdi.quality.view_error import angle_from_generating_view
from pyvista_vdi.vtk_pipeline.vtk import vtkPlane

pytestmark = pytest.mark.gl


def ball_and_sphere(plotter, add):
    add(plotter, soft_ball())
    opaque_sphere(plotter)


def beside(**mesh):
    """A ball, and a mesh before or behind it."""

    def scene(plotter, add):
        add(plotter, soft_ball())
        plotter.add_mesh(pv.Sphere(radius=0.5, **mesh), color="w")

    return scene


def translucent(plotter, add):
    ball_and_sphere(plotter, add)
    plotter.add_mesh(pv.Plane(direction=(1, 1, 0), i_size=2, j_size=2), color="red", opacity=0.5)


def under(method, *arguments, scene=ball_and_sphere, **keywords):
    """A scene of a plotter of which a method was called."""

    def enabled(plotter, add):
        getattr(plotter, method)(*arguments, **keywords)
        scene(plotter, add)

    return enabled


def panned(plotter, add):
    """So that a part is outside the window."""
    ball_and_sphere(plotter, add)
    position, focal, up = plotter.camera_position
    shift = np.array([0.8, -0.8, 0.4])
    plotter.camera_position = (position + shift, focal + shift, up)


def cut_by_near_and_far_plane(plotter, add):
    add(plotter, soft_ball())
    distance = plotter.camera.distance
    plotter.camera.clipping_range = (distance - 0.2, distance + 0.4)


def clipped(plotter, add):
    actor = add(plotter, soft_ball())
    opaque_sphere(plotter)
    for origin, normal in (((0.1, 0, 0), (1, 0.5, 0)), ((0, 0, 0.5), (0, 0.2, -1))):
        plane = vtkPlane()
        plane.SetOrigin(*origin)
        plane.SetNormal(*normal)
        if add is not add_nothing:
            actor.mapper.AddClippingPlane(plane)


def scaled_later(plotter, add):
    ball_and_sphere(plotter, add)
    plotter.show(auto_close=False)
    plotter.set_scale(xscale=0.7)


def two_viewports(plotter, add):
    ball_and_sphere(plotter, add)
    plotter.subplot(*(n - 1 for n in plotter.shape))
    add(plotter, soft_ball(20))
    plotter.add_mesh(pv.Sphere(radius=0.3, center=(0.5, 0.5, 0)), color="k")
    plotter.camera.azimuth = 40


def linked_viewports(plotter, add):
    actor = add(plotter, soft_ball())
    plotter.subplot(0, 1)
    plotter.add_actor(actor)
    plotter.link_views()


def two_vdis_and_an_ordinary_volume(plotter, add):
    add(plotter, soft_ball(), user_matrix=pv.Transform().translate(-2.2, 0, 0).matrix)
    add(plotter, soft_ball(16), user_matrix=pv.Transform().translate(2.2, 0, 0).matrix)
    plotter.add_volume(soft_ball(), mapper="gpu", **LOOKS)


def lamp_later(plotter, add):
    """The lights are read when the VDI is made, not when it is added."""
    add(plotter, soft_ball(), shade=True)
    plotter.remove_all_lights()
    lamp = pv.Light(position=(4, -3, 2), color="orange", positional=True, cone_angle=35)
    plotter.add_light(lamp)


def of_ball(volume=None, **more):
    return lambda plotter, add: add(plotter, soft_ball() if volume is None else volume, **more)


def resized(plotter):
    plotter.show(auto_close=False)
    plotter.window_size = (160, 300)
    plotter.render()
    return plotter.screenshot(return_img=True)


def twice(plotter):
    # New pixels lie between the lists' centres, where V_O's lists step; the ball is smooth
    return plotter.screenshot(return_img=True, scale=2)


_PLACED = pv.Transform().scale(1.0, 0.6, 1.4).rotate_x(30).translate(0.2, 0, 0.1).matrix
_SHEAR = np.array([[1, 0.3, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
_TURNED = pv.Transform().rotate_vector((1, 2, 3), 40).matrix[:3, :3]

#: Scenes, and what they are drawn with.
SCENES = {
    "ball": (of_ball(), {}),
    "sphere half inside": (ball_and_sphere, {}),
    "sphere before": (beside(center=(1.5, 1.5, 1.5)), {}),
    "sphere behind": (beside(center=(-1.5, -1.5, -1.5)), {}),
    "translucent": (translucent, {}),
    "depth peeling": (under("enable_depth_peeling", 4, scene=translucent), {}),
    "msaa 4": (under("enable_anti_aliasing", "msaa", multi_samples=4), {}),
    "msaa 8": (under("enable_anti_aliasing", "msaa", multi_samples=8), {}),
    "parallel": (under("enable_parallel_projection"), {}),
    "panned": (panned, {}),
    "panned, parallel": (under("enable_parallel_projection", scene=panned), {}),
    "near and far plane": (cut_by_near_and_far_plane, {}),
    "clipping planes": (clipped, {}),
    "columns": (two_viewports, {"shape": (1, 2), "col_weights": [2, 1]}),
    "rows": (two_viewports, {"shape": (2, 1)}),
    "linked": (linked_viewports, {"shape": (1, 2), "col_weights": [2, 1]}),
    "twice the size": (ball_and_sphere, {"shot": twice}),
    "tiles": (ball_and_sphere, {"shot": tiled_picture}),
    "resized": (ball_and_sphere, {"shot": resized, "window_size": (240, 200)}),
    "odd size": (ball_and_sphere, {"window_size": (61, 37)}),
    "user matrix": (of_ball(user_matrix=_PLACED @ _SHEAR), {}),
    "mirror": (of_ball(user_matrix=np.diag([-1.0, 1.0, 1.0, 1.0])), {}),
    "scaled before": (under("set_scale", zscale=1.7), {}),
    "scaled after": (scaled_later, {}),
    "direction matrix": (of_ball(soft_ball(direction=_TURNED)), {}),
    "two VDIs and a volume": (two_vdis_and_an_ordinary_volume, {}),
    "lamp": (lamp_later, {"lighting": "none"}),
}


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] * (k % 2)) for k, name in enumerate(SCENES)],
)
def test_it_is_drawn_as_a_volume_is(name):
    scene, options = SCENES[name]
    assert_as_vtk(scene, **options)


def test_camera_inside():
    def scene(plotter, add):
        add(plotter, soft_ball())
        plotter.add_mesh(pv.Sphere(radius=0.2, center=(-0.5, 0.1, -0.2)), color="w")
        plotter.camera_position = ((0.6, 0.3, 0.2), (-1.0, 0.0, -0.2), (0, 0, 1))
        plotter.renderer.ResetCameraClippingRange()

    with pytest.warns(VDIWarning, match="coverage='bounds' needs the eye outside"):
        assert_as_vtk(scene)


@pytest.mark.parametrize("lighting", ["light kit", "none"])
def test_shaded_by_the_plotter_s_lights(lighting):
    def scene(plotter, add):
        add(plotter, soft_ball(), shade=True, ambient=0.2, specular=0.5, specular_power=15)
        opaque_sphere(plotter)

    assert_as_vtk(scene, lighting=lighting)


@pytest.mark.parametrize("shade", [False, True])
def test_rgba_scalars(shade):
    ball = soft_ball()
    x, y, z = (ball.points.T + 1) / 2 * 255
    alpha = ball["v"] / ball["v"].max() * 255  # VTK looks a narrower range up wrongly
    ball["v"] = np.column_stack([x, y, z, alpha]).astype(np.uint8)

    def scene(plotter, add):
        actor = add(plotter, ball, shade=shade)
        if add is add_judge:  # add_volume leaves it at 1
            actor.prop.SetScalarOpacityUnitDistance(3, LOOKS["opacity_unit_distance"])

    assert_as_vtk(scene)


def test_rgba_scalars_have_an_opacity_of_their_own():
    ball = soft_ball()
    colors = np.zeros((ball.n_points, 4), np.uint8)
    plotter = pv.Plotter()
    with pytest.warns(VDIWarning, match="RGBA scalars bring theirs"):
        plotter.add_vdi(ball, scalars=colors, opacity="sigmoid")
    assert not plotter.scalar_bars


@pytest.mark.parametrize("eye", ["left", "right"])
def test_stereo(eye):
    """VTK's volume shoots stereo rays from the middle eye, so the judge has a moved camera.

    ``vtkCamera`` shears view space about the focal plane by tan(EyeAngle / 2): the same as an eye
    that far aside, times the distance, and a window centre that brings the focal point back.
    """
    sign = -1.0 if eye == "left" else 1.0

    def scene(plotter, add):
        ball_and_sphere(plotter, add)
        if add is add_ours:
            plotter.render_window.StereoRenderOn()  # V_O is the view between the eyes
            plotter.render_window.SetStereoType(4 if eye == "left" else 5)
            return
        camera = plotter.camera
        slope = sign * np.tan(np.radians(camera.GetEyeAngle() / 2))
        right = np.cross(camera.direction, camera.up)
        shift = slope * camera.distance * right / np.linalg.norm(right)
        half_width = np.tan(np.radians(camera.view_angle / 2)) * WINDOW[0] / WINDOW[1]
        camera.SetWindowCenter(-slope / half_width, 0)
        camera.position = np.add(camera.position, shift)
        camera.focal_point = np.add(camera.focal_point, shift)

    # The sphere is rasterised from two cameras that are equal only mathematically
    assert_as_vtk(scene, strays=3)


def test_ssaa_and_eye_dome_lighting_draw_what_vtk_leaves_out():
    """VTK's GPU mapper draws nothing under SSAA on Mesa, so the judge is our own picture."""
    scene = under("enable_anti_aliasing", "ssaa")
    smooth = draw(add_ours, scene)
    plain = draw(add_ours, ball_and_sphere)
    assert np.abs(smooth - draw(add_nothing, scene)).max() > 40
    difference = np.abs(smooth - plain).max(axis=-1)
    # The opaque sphere's rim, 75 pixels, is what anti-aliasing changes
    assert np.count_nonzero(difference > TOLERANCE) < 125
    assert np.median(difference) <= 1
    dome = under("enable_eye_dome_lighting")
    assert np.abs(draw(add_ours, dome) - draw(add_nothing, dome)).max() > 40


def test_turned_view_stays_close():
    """30 degrees from V_O the picture is approximate: the mean says that it is in its place."""

    def turned(plotter):
        plotter.show(auto_close=False)
        plotter.camera.Azimuth(30)
        plotter.camera.Elevation(15)
        plotter.renderer.ResetCameraClippingRange()
        plotter.render()
        return plotter.screenshot(return_img=True)

    ours, judge, empty = (
        draw(add, ball_and_sphere, turned) for add in (add_ours, add_judge, add_nothing)
    )
    seen = np.abs(judge - empty).max(axis=-1) > 4
    assert seen.mean() > 0.1
    assert np.abs(ours - judge)[seen].mean() < 3
    assert WINDOW[0] == ours.shape[1]


@pytest.mark.parametrize("lighting", ["light kit", "none"])
def test_lights_that_move_with_the_camera_make_no_vdi(lighting):
    """VTK writes the eye of each frame into its headlights: they are the same lights."""
    plotter = pv.Plotter(window_size=WINDOW, lighting=lighting)
    actor = add_ours(plotter, soft_ball(), shade=True)
    plotter.show(auto_close=False)
    first = actor.vdi
    for move, amount in (
        ("Azimuth", 35),
        ("Elevation", -20),
        ("Zoom", 1.5),
        ("SetPosition", (5, 1, 2)),
    ):
        getattr(plotter.camera, move)(amount)
        plotter.render()
        assert actor.vdi is first
    plotter.add_light(pv.Light(position=(4, -3, 2), light_type="scene light"))
    plotter.camera.Azimuth(15)
    plotter.render()
    assert actor.vdi is not first
    assert angle_from_generating_view(actor.vdi, plotter.camera) < 1e-4  # float32 inverses


def test_other_lights_make_another_vdi():
    plotter = pv.Plotter(window_size=WINDOW, lighting="none")
    plotter.add_light(pv.Light(position=(1, 2, 9), light_type="scene light"))
    actor = add_ours(plotter, soft_ball(), shade=True)
    plotter.show(auto_close=False)
    before = actor.vdi
    plotter.renderer.lights[0].intensity = 0.3
    plotter.render()
    dimmed = actor.vdi
    assert dimmed.color.max() < 0.7 * before.color.max()
    plotter.camera.Azimuth(20)
    plotter.render()
    assert actor.vdi is dimmed
