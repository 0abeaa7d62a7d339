"""Depth of what is opaque, which is read again only where that has changed."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, shown, soft_ball

from pyvista_vdi.model.camera import Camera
from pyvista_vdi.vtk_pipeline.drawing.frame import Frame

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


def test_depth_is_read_again_when_what_is_opaque_changes(plotter):
    sphere = plotter.add_mesh(
        pv.Sphere(radius=0.5, center=(0.4, 0.2, 0.5)), color="w", reset_camera=False
    )
    changes = {
        "position": lambda: sphere.SetPosition(0.1, 0.3, 0),
        "representation": lambda: sphere.prop.SetRepresentationToWireframe(),
        "data": lambda: sphere.mapper.dataset.scale(0.8, inplace=True),
        "visibility": lambda: sphere.SetVisibility(False),
    }
    before = shown(plotter)
    for name, change in changes.items():
        change()
        after = shown(plotter)
        assert (after != before).any(), f"{name} changes nothing"
        plotter.volume.mapper.driver.release()  # nothing is known any more
        np.testing.assert_array_equal(shown(plotter), after, err_msg=name)
        before = after


@pytest.mark.parametrize("parallel", [False, True])
@pytest.mark.parametrize("near", [1e-3, 1.0, 9.99])
def test_depths_in_float32_are_as_exact_as_float32(parallel, near):
    """Constants, one sum and the quotient are rounded, to u: of a perspective's depth 4 u Z.

    A parallel projection's numerator is a difference of lengths up to the far plane: 4 u far.
    """
    u, far, camera = 2.0**-24, 10.0, pv.Camera()
    camera.clipping_range, camera.parallel_projection = (near, far), parallel
    rows = pv.array_from_vtkmatrix(camera.GetProjectionTransformMatrix(1.0, -1, 1))[2:]
    frame = Frame(
        (1, 1), (0, 0), Camera((0, 0, 0), (0, 0, -1), (0, 1, 0)), np.eye(4), rows, *[None] * 7
    )
    z = np.r_[0, np.random.default_rng(1).beta(9, 1, 999), 1 - u].astype(np.float32)
    ours, exact = frame.view_depth(z), z.astype(np.float64) * (far - near)
    exact = near + exact if parallel else near * far / (far - exact)
    assert ours.dtype == np.float32
    assert (np.abs(ours - exact) <= 4.001 * u * (far if parallel else exact)).all()
