"""Depth of what is opaque, which is read again only where that has changed."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, shown, soft_ball

from pyvista_vdi.vtk_pipeline.vtk import vtkPlane

pytestmark = pytest.mark.gl

WINDOW = (120, 90)
VIEW = ((4, 3, 2), (0, 0, 0), (0, 0, 1))


@pytest.fixture
def plotter():
    plotter = pv.Plotter(window_size=WINDOW)
    plotter.add_vdi(soft_ball(), draw="vdi", **LOOKS)
    plotter.camera_position = VIEW
    yield plotter
    plotter.close()


def changes_of_what_is_opaque(plotter, sphere):
    """Named changes of the depth that leave the camera as it is."""
    mesh = pv.Sphere(radius=0.3, center=(0.3, 0.2, 0.6))
    yield "position", lambda: sphere.SetPosition(0.1, 0.3, 0)
    yield "representation", lambda: setattr(sphere.prop, "style", "wireframe")
    yield "line width", lambda: setattr(sphere.prop, "line_width", 9)
    yield "matrix", lambda: setattr(sphere, "user_matrix", np.diag([1.4, 0.6, 1, 1]))
    yield "data", lambda: sphere.mapper.dataset.scale(0.8, inplace=True)
    yield "another", lambda: plotter.add_mesh(mesh, color="r", reset_camera=False)
    plane = vtkPlane()
    plane.SetNormal(0, 0, -1)
    plane.SetOrigin(0, 0, 0.5)
    yield "clipping", lambda: sphere.mapper.AddClippingPlane(plane)
    yield "clipping plane", lambda: plane.SetOrigin(0, 0, 0.4)
    yield "visibility", lambda: sphere.SetVisibility(False)


def test_depth_is_read_again_when_what_is_opaque_changes(plotter):
    sphere = plotter.add_mesh(
        pv.Sphere(radius=0.5, center=(0.4, 0.2, 0.5)), color="w", reset_camera=False
    )
    before = shown(plotter)
    for name, change in changes_of_what_is_opaque(plotter, sphere):
        change()
        after = shown(plotter)
        assert (after != before).any(), f"{name} changes nothing"
        plotter.volume.mapper.driver.release()  # nothing is known any more
        np.testing.assert_array_equal(shown(plotter), after, err_msg=name)
        before = after
