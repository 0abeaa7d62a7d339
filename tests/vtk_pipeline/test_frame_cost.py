"""What a frame costs around the raycast: counted, not timed."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, opaque_sphere, shown, soft_ball

from pyvista_vdi.device import get_runtime
from pyvista_vdi.vtk_pipeline.drawing import depth, images
from pyvista_vdi.vtk_pipeline.drawing import screen as texture_module
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
    found.watch(monkeypatch, depth, "_window_depth")

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


def fresh_picture(plotter):
    """The picture of the same scene by a plotter that has kept nothing."""
    other = pv.Plotter(window_size=WINDOW)
    other.add_vdi(plotter.volume.vdi, show_scalar_bar=False)
    other.camera = plotter.camera.copy()
    image = shown(other)
    other.close()
    return image


@pytest.mark.parametrize("opaque", [False, True])
def test_a_view_that_has_not_changed_costs_nothing(plotter, counts, opaque):
    if opaque:
        opaque_sphere(plotter)
    plotter.show(auto_close=False)
    once = {"render_vdi": 1, "upload": 1, "aligned_empty": 1}
    plotter.render_window.Render()
    plotter.render()
    assert counts == ({**once, "_window_depth": 3} if opaque else once)


def test_what_moves_allocates_nothing(plotter, counts):
    plotter.show(auto_close=False)
    for _ in range(6):
        plotter.camera.Azimuth(3)
        plotter.render()
    assert counts["render_vdi"] == 7
    assert counts["aligned_empty"] == 2  # what is shown, and what is drawn
    np.testing.assert_array_equal(shown(plotter), fresh_picture(plotter))


def test_a_mesh_that_moves_allocates_nothing(plotter, counts):
    sphere = plotter.add_mesh(pv.Sphere(radius=0.5), reset_camera=False)
    plotter.show(auto_close=False)
    for at in np.linspace(0, 0.6, 8):
        sphere.position = (at, 0, 0)
        plotter.render()
    assert counts["render_vdi"] == 8  # the first is where it was
    assert counts["aligned_empty"] == 2


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


def test_only_where_something_opaque_can_hide_the_vdi_depth_is_read(plotter, counts):
    plotter.camera_position = ((8, 0, 0), (0, 0, 0), (0, 0, 1))
    plotter.add_mesh(pv.Sphere(center=(-4, 0, 0)), reset_camera=False)  # behind
    plotter.add_mesh(pv.Sphere(), opacity=0.5, reset_camera=False)
    plotter.add_axes()
    plotter.add_text("words")
    plotter.show(auto_close=False)
    assert "_window_depth" not in counts
    plotter.add_mesh(pv.Sphere(radius=0.1), reset_camera=False)
    plotter.render()
    assert counts["_window_depth"] >= 1


def test_vtk_copies_no_depth(plotter, monkeypatch):
    made = []

    class Texture(vtkTextureObject):
        def CreateDepthFromRaw(self, *args):
            made.append(self)
            return super().CreateDepthFromRaw(*args)

    monkeypatch.setattr(texture_module, "vtkTextureObject", Texture)
    plotter.show(auto_close=False)
    drawing, (texture,) = plotter.volume.mapper.driver, made
    assert (texture.GetWidth(), texture.GetHeight()) == (1, 1)
    assert texture.GetReferenceCount() == 2  # ours, and the mapper's
    drawing.release()
    assert texture.GetHandle() == 0
    plotter.render()
    assert texture.GetHandle() != 0


def test_cpu_devices_draw_where_vtk_uploads_from(plotter, monkeypatch):
    if not get_runtime().is_cpu:
        pytest.skip("a GPU draws into memory of its own")
    targets, uploads = [], []
    kind = type(get_runtime())
    target, show = kind.target, texture_module.ImageTexture.show
    monkeypatch.setattr(kind, "target", lambda *args: targets.append(target(*args)) or targets[-1])
    monkeypatch.setattr(
        texture_module.ImageTexture,
        "show",
        lambda self, window, image, *a, **k: (
            uploads.append(image) or show(self, window, image, *a, **k)
        ),
    )
    plotter.show(auto_close=False)
    uploaded = [buffer for buffer in targets if buffer.name == "image"]  # others are of the new VDI
    assert [buffer.host is not None for buffer in uploaded] == [True]
    assert uploaded[0].host.base is not None
    assert np.shares_memory(uploaded[0].host, uploads[-1])
