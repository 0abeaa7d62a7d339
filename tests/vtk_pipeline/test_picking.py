"""Picking in real plotters: what is under the cursor, and where it begins."""

from __future__ import annotations

import numpy as np
import pipelines
import pytest
import pyvista as pv
from plugin_scenes import add_ours, soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.vtk_pipeline.drawing import images
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkHardwarePicker,
    vtkPlane,
    vtkPropPicker,
    vtkRenderer,
    vtkRenderingCore,
    vtkRenderingVolume,
    vtkRenderWindow,
)

pytestmark = pytest.mark.gl

WINDOW = (120, 100)
CENTRE = (60, 50)
#: Beside the ball, before the backdrop, inside the VDI's box.
CORNER = (35, 75)


def slab(z=(-0.5, 0.5), color=(1, 0.5, 0), edge=16):
    """A VDI of something solid that fills -1 to 1 in x and y; its face is at ``z[1]``."""
    camera = pvdi.Camera(
        (0, 0, 5), (0, 0, 0), (0, 1, 0), parallel_projection=True, parallel_scale=1.0
    )
    n = edge * edge
    return pvdi.VDI(
        camera,
        (edge, edge),
        np.arange(n + 1),
        np.full(n, 5 - z[1]),
        np.full(n, 5 - z[0]),
        np.tile(color, (n, 1)),
        np.full(n, 30.0),
        (-1, 1, -1, 1, -1, 1),
    )


def screenshot(plotter):
    return plotter.screenshot(return_img=True)


class Scene:
    """The soft ball before a backdrop, a sphere in front of it and one inside, seen along -z."""

    def __init__(self, what=None, **options):
        self.plotter = pv.Plotter(window_size=WINDOW, **options)
        if what is None:
            self.vdi = add_ours(self.plotter, soft_ball())
        else:
            self.vdi = self.plotter.add_vdi(what, reset_camera=False)
        self.backdrop = self.add(
            pv.Plane(center=(0, 0, -1.5), direction=(0, 0, 1), i_size=2.4, j_size=2.4)
        )
        self.front = self.add(pv.Sphere(radius=0.2, center=(0.5, 0, 1.5)))
        self.inside = self.add(pv.Sphere(radius=0.1, center=(-0.6, -0.6, 0.7)))
        self.look((0, 0, 6))

    def add(self, mesh, **options):
        return self.plotter.add_mesh(mesh, reset_camera=False, **options)

    def look(self, position, focal=(0, 0, 0)):
        self.plotter.camera_position = (position, focal, (0, 1, 0))
        self.plotter.renderer.ResetCameraClippingRange()

    def show(self):
        self.plotter.show(auto_close=False)
        return self


def test_what_is_in_front_is_picked_and_where_it_begins():
    scene = Scene().show()
    wanted = {
        CENTRE: True,
        (75, 50): False,  # the sphere in front
        CORNER: False,  # behind a part of the box where nothing is to be seen
        (2, 2): False,
        (40, 30): False,  # a sphere in the box, before the ball
    }
    assert {place: scene.vdi.pick(*place) is not None for place in wanted} == wanted
    for place in (CENTRE, (50, 40), (38, 33), (55, 65)):
        hit = scene.vdi.pick(*place)
        expected = pvdi.pick(scene.vdi.vdi, scene.plotter.camera, place, WINDOW)
        assert hit == expected or hit.position == pytest.approx(expected.position, abs=1e-12)


def from_inside(scene):
    scene.look((0, 0, 0.5), (0, 0, -1))


def moved(scene):
    scene.vdi.user_matrix = np.array(
        [[0, -1, 0, 0.1], [1, 0, 0, 0], [0, 0, 0.5, -0.25], [0, 0, 0, 1]]
    )


def clipped(scene):
    plane = vtkPlane()
    plane.SetOrigin(0, 0, 0.2)
    plane.SetNormal(0, 0, -1)
    scene.vdi.mapper.AddClippingPlane(plane)


def parallel(scene):
    scene.plotter.enable_parallel_projection()
    scene.plotter.camera.parallel_scale = 1.6


#: What is done to the slab's scene, and where its face is then.
FACES = {
    "plain": (lambda scene: None, 0.5),
    "another view": (lambda scene: scene.look((4, 3, 3)), None),
    "matrix": (moved, 0.0),
    "clipping": (clipped, 0.2),
    "parallel": (parallel, 0.5),
    "from inside the box": (from_inside, -0.25),
    "stereo": (lambda scene: scene.plotter.enable_stereo_render(), 0.5),
}


@pytest.mark.parametrize(("change", "face"), FACES.values(), ids=FACES)
def test_the_place_is_on_the_face(change, face):
    scene = Scene(slab((-0.5, -0.25)) if change is from_inside else slab())
    change(scene)
    scene.show()
    hit = scene.vdi.pick(*CENTRE)
    assert hit.color == (1, 0.5, 0)
    if face is None:  # into the cube by one of its three faces that this view sees
        assert np.abs(np.subtract(hit.position, (1, 1, 0.5))).min() < 1e-12
        return
    # VTK's stereo camera is a matrix of float32
    tolerance = 1e-6 if scene.plotter.render_window.GetStereoRender() else 1e-12
    assert hit.position[2] == pytest.approx(face, abs=tolerance)
    if change is parallel:
        half_pixel = 1.6 / WINDOW[1]
        assert hit.position == pytest.approx((half_pixel, half_pixel, 0.5), abs=1e-12)
    if change is clipped:
        scene.vdi.mapper.GetClippingPlanes().GetItem(0).SetOrigin(0, 0, -2)
        assert scene.vdi.pick(*CENTRE) is None


@pytest.mark.parametrize("kind", ["msaa", "ssaa", "eye dome lighting", "depth peeling"])
def test_pick_works_however_the_scene_is_drawn(kind):
    scene = Scene(slab())
    if kind == "eye dome lighting":
        scene.plotter.enable_eye_dome_lighting()
    elif kind == "depth peeling":
        scene.plotter.enable_depth_peeling()
    else:
        scene.plotter.enable_anti_aliasing(kind)
    scene.show()
    before = screenshot(scene.plotter)
    assert scene.vdi.pick(*CENTRE).position[2] == pytest.approx(0.5, abs=1e-12)
    assert scene.vdi.pick(75, 50) is None  # the sphere in front
    assert np.array_equal(screenshot(scene.plotter), before)


def test_threshold():
    scene = Scene().show()
    mapper = scene.vdi.mapper
    assert mapper.GetPickingOpacity() == 0.05
    first = scene.vdi.pick(*CENTRE)
    mapper.SetPickingOpacity(0.6)
    deeper = scene.vdi.pick(*CENTRE)
    assert first.accumulated_opacity < 0.6 <= deeper.accumulated_opacity
    assert deeper.position[2] < first.position[2] - 0.1
    mapper.SetPickingOpacity(0.9)
    assert scene.vdi.copy(deep=False).mapper.GetPickingOpacity() == 0.9
    with pytest.raises(InvalidArgumentError, match="opacity_threshold must be at least 0"):
        mapper.SetPickingOpacity(1)
    assert mapper.GetPickingOpacity() == 0.9


def test_flags_of_the_actor_are_honoured():
    scene = Scene().show()
    for hide in (scene.vdi.SetPickable, scene.vdi.SetVisibility):
        hide(False)
        assert scene.vdi.pick(*CENTRE) is None
        hide(True)
        assert scene.vdi.pick(*CENTRE) is not None


@pytest.mark.parametrize("how", ["two", "one twice", "copies"])
def test_two_renderers(how):
    """What is picked in one is drawn in the other."""
    plotter = pv.Plotter(shape=(1, 2), window_size=WINDOW)
    left = plotter.add_vdi(slab())
    plotter.camera_position = ((0, 0, 8), (0, 0, 0), (0, 1, 0))
    plotter.subplot(0, 1)
    if how == "two":
        right = plotter.add_vdi(slab((-0.5, 0.25)))
    else:
        right = left if how == "one twice" else left.copy(deep=False)
        plotter.add_actor(right)
    face, eye = (0.25, 8) if how == "two" else (-0.5, -8)
    plotter.camera_position = ((0, 0, eye), (0, 0, 0), (0, 1, 0))
    plotter.show(auto_close=False)
    before = screenshot(plotter)
    for _ in range(2):
        assert left.pick(30, 50).position[2] == pytest.approx(0.5, abs=1e-12)
        assert right.pick(90, 50).position[2] == pytest.approx(face, abs=1e-12)
        assert np.array_equal(screenshot(plotter), before)
    if how == "one twice":
        assert right.pick(90, 50, renderer=plotter.renderers[0]) is None
    else:
        assert left.pick(90, 50) is None
        assert right.pick(30, 50) is None


def test_the_picture_stays(no_leaks, monkeypatch):
    scene = Scene().show()
    before, raycasts, render_vdi = screenshot(scene.plotter), [], images.render_vdi
    monkeypatch.setattr(images, "render_vdi", lambda *a: raycasts.append(1) or render_vdi(*a))
    for picker in (vtkPropPicker(), vtkHardwarePicker()):
        picker.Pick(*CENTRE, 0, scene.plotter.renderer)
        assert np.array_equal(screenshot(scene.plotter), before)
    assert scene.vdi.pick(*CENTRE) is not None
    assert np.array_equal(screenshot(scene.plotter), before)
    assert raycasts == []  # the image is kept


def test_another_mapper_after_a_pick():
    scene = Scene(slab()).show()
    before = screenshot(scene.plotter)
    assert scene.vdi.pick(*CENTRE) is not None
    mapper = pvdi.VDIMapper()
    mapper.SetVDI(slab())
    scene.vdi.SetMapper(mapper)
    assert np.array_equal(screenshot(scene.plotter), before)


def test_the_callback_can_ask_for_the_actor():
    scene = Scene(slab())
    found = []

    def callback(point, picker):
        found.append(scene.vdi.pick(*picker.GetSelectionPoint()[:2]))

    scene.plotter.enable_point_picking(
        callback, picker="prop", use_picker=True, left_clicking=True, show_point=False
    )
    scene.show()
    for place in (CENTRE, (2, 2)):
        scene.plotter.iren._mouse_left_button_press(*place)
        scene.plotter.iren._mouse_left_button_release(*place)
    hit, beside = found
    assert hit.position[2] == pytest.approx(0.5, abs=1e-12)
    assert beside is None


def test_in_plain_vtk_and_before_the_first_frame():
    mapper, actor = pvdi.VDIMapper(), pvdi.VDIActor()
    mapper.SetVDI(slab())
    actor.SetMapper(mapper)
    renderer, window = vtkRenderer(), vtkRenderWindow()
    for show in (lambda: None, lambda: renderer.AddVolume(actor)):
        show()
        with pytest.raises(InvalidArgumentError, match="nothing shows this actor yet"):
            actor.pick(1, 1)
    window.SetOffScreenRendering(True)
    window.SetSize(*WINDOW)
    window.AddRenderer(renderer)
    renderer.GetActiveCamera().SetPosition(0, 0, 6)
    renderer.GetActiveCamera().SetFocalPoint(0, 0, 0)
    renderer.ResetCameraClippingRange()
    assert actor.pick(*CENTRE).position[2] == pytest.approx(0.5, abs=1e-12)
    window.Finalize()


@pytest.mark.parametrize(
    ("picker", "seen", "beside"),  # as the table in guide_plotting.md has it
    [
        ("vtkPropPicker", "actor", None),
        ("vtkRenderedAreaPicker", "actor", None),
        ("vtkCellPicker", "box", "box"),
        ("vtkVolumePicker", "box", "box"),
        ("vtkPicker", "actor", "actor"),
        ("vtkPointPicker", None, None),
        ("vtkWorldPointPicker", None, None),
    ],
)
def test_what_vtks_other_pickers_answer_with(picker, seen, beside):
    scene = pipelines.Scene("auto")
    scene.set_input(pipelines.image_of(pipelines.values()))
    scene.reset()
    scene.picture()
    assert scene.actor.pick(60, 45) is not None
    assert scene.actor.pick(30, 70) is None  # of the box, but of nothing in it
    home = vtkRenderingVolume if picker == "vtkVolumePicker" else vtkRenderingCore
    for place, wanted in (((60, 45), seen), ((30, 70), beside)):
        made = getattr(home, picker)()
        if picker == "vtkRenderedAreaPicker":
            x, y = place
            hit = made.AreaPick(x - 1, y - 1, x + 1, y + 1, scene.renderer)
        else:
            hit = made.Pick(*place, 0, scene.renderer)
        assert bool(hit) == (wanted is not None)
        at = np.asarray(made.GetPickPosition())
        if wanted == "box":
            assert np.isclose(at, 12).any()
