"""Whole scenes against VTK's own volume: what users see when they put one in place of the other."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import WINDOW, add_ours, assert_as_vtk, opaque_sphere, soft_ball

from pyvista_vdi.quality.view_error import angle_from_generating_view

pytestmark = pytest.mark.gl


def ball_and_sphere(plotter, add):
    add(plotter, soft_ball())
    opaque_sphere(plotter)


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
