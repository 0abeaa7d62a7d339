"""What a frame costs around the raycast: counted, not timed."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, opaque_sphere, shown, soft_ball

from pyvista_vdi.vtk_pipeline.drawing import frame as frame_module
from pyvista_vdi.vtk_pipeline.drawing import images
from pyvista_vdi.vtk_pipeline.drawing import screen as texture_module
from pyvista_vdi.vtk_pipeline.drawing.depth import OpaqueDepths
from pyvista_vdi.vtk_pipeline.vtk import vtkPlane, vtkTextureObject

pytestmark = pytest.mark.gl

WINDOW = (120, 90)
VIEW = ((4, 3, 2), (0, 0, 0), (0, 0, 1))


class Counts(dict):
    """Calls by name."""

    def add(self, name):
        self[name] = self.get(name, 0) + 1

    def watch(self, monkeypatch, owner, name):
        """Count the calls of a function."""
        function = getattr(owner, name)
        monkeypatch.setattr(owner, name, lambda *a, **k: self.add(name) or function(*a, **k))


@pytest.fixture
def counts(monkeypatch):
    """Raycasts, uploads, readings of depth, and allocations of images."""
    found = Counts()
    found.watch(monkeypatch, images, "render_vdi")
    found.watch(monkeypatch, images, "aligned_empty")
    found.watch(monkeypatch, frame_module.Frame, "opaque_z")

    class Texture(vtkTextureObject):
        def Create2DFromRaw(self, *args):
            found.add("upload")
            return super().Create2DFromRaw(*args)

    monkeypatch.setattr(texture_module, "vtkTextureObject", Texture)
    return found


@pytest.fixture
def plotter():
    plotter = pv.Plotter(window_size=WINDOW)
    plotter.add_vdi(soft_ball(), draw="vdi", **LOOKS)
    plotter.camera_position = VIEW
    yield plotter
    plotter.close()


@pytest.mark.parametrize("opaque", [False, True])
def test_a_view_that_has_not_changed_costs_nothing(plotter, counts, opaque):
    if opaque:
        opaque_sphere(plotter)
    plotter.show(auto_close=False)
    once = {"render_vdi": 1, "upload": 1, "aligned_empty": 1}
    assert counts == ({**once, "opaque_z": 1} if opaque else once)
    before = dict(counts)
    plotter.render_window.Render()
    plotter.render_window.Render()
    plotter.render()
    assert counts == before


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


def test_depth_is_read_again_when_what_is_opaque_changes(plotter, counts, monkeypatch):
    read = OpaqueDepths.read
    sphere = plotter.add_mesh(
        pv.Sphere(radius=0.5, center=(0.4, 0.2, 0.5)), color="w", reset_camera=False
    )
    before = shown(plotter)
    for name, change in changes_of_what_is_opaque(plotter, sphere):
        reads = counts["opaque_z"]
        change()
        after = shown(plotter)
        assert counts["opaque_z"] > reads, name
        assert (after != before).any(), f"{name} changes nothing"
        # Nothing is known any more, and all of it is read
        plotter.volume.mapper.driver.release()
        with monkeypatch.context() as patch:
            patch.setattr(OpaqueDepths, "read", lambda _, frames: read(OpaqueDepths(), frames))
            np.testing.assert_array_equal(shown(plotter), after, err_msg=name)
        before = after
