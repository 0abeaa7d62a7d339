"""Picking in real plotters: what is under the cursor, and where it begins."""

from __future__ import annotations

import numpy as np
import pipelines
import pytest
import pyvista as pv
from plugin_scenes import add_ours, soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.errors import DeviceError, InvalidArgumentError, VDIWarning
from pyvista_vdi.vtk_pipeline.drawing import images, selection
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkDataObject,
    vtkHardwarePicker,
    vtkHardwareSelector,
    vtkPlane,
    vtkPropPicker,
    vtkRenderer,
    vtkRenderingCore,
    vtkRenderingVolume,
    vtkRenderWindow,
    vtkSelectionNode,
)

pytestmark = pytest.mark.gl

WINDOW = (120, 100)
CENTRE = (60, 50)
#: Beside the ball, before the backdrop, inside the VDI's box.
CORNER = (35, 75)
#: Of float32 depth in a window of 24 bits or more, between near and far planes about as far
#: apart as they are from the eye: 6e-8 times a few units of depth, and a few roundings.
Z_BUFFER = 1e-5


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

    def under(self, x, y, picker=vtkPropPicker):
        """The picker, which has picked, and the name of what it found."""
        chosen = picker()
        chosen.Pick(x, y, 0, self.plotter.renderer)
        prop = chosen.GetViewProp()
        names = [name for name, value in vars(self).items() if value is prop]
        return chosen, names[0] if names else None

    def depth_of(self, point):
        """View depth of a world point."""
        camera = self.plotter.camera
        return np.dot(np.subtract(point, camera.position), camera.direction)

    def selected(self, area, association=None):
        """The properties of what an area's selection has, by prop."""
        selector = vtkHardwareSelector()
        selector.SetRenderer(self.plotter.renderer)
        selector.SetArea(*area)
        if association is not None:
            selector.SetFieldAssociation(association)
        selection = selector.Select()
        nodes = [selection.GetNode(i).GetProperties() for i in range(selection.GetNumberOfNodes())]
        return {node.Get(vtkSelectionNode.PROP()): node for node in nodes}


def test_what_is_in_front_is_picked_and_where_it_begins():
    scene = Scene().show()
    wanted = {
        CENTRE: "vdi",
        (75, 50): "front",
        CORNER: "backdrop",  # behind a part of the box where nothing is to be seen
        (2, 2): None,
        (40, 30): "inside",  # in the box, before the ball
    }
    assert {place: scene.under(*place)[1] for place in wanted} == wanted
    assert {place: scene.vdi.pick(*place) is not None for place in wanted} == {
        place: name == "vdi" for place, name in wanted.items()
    }
    half_angle = np.radians(scene.plotter.camera.view_angle / 2)
    for place in (CENTRE, (50, 40), (38, 33), (55, 65)):
        picker, name = scene.under(*place)
        hit = scene.vdi.pick(*place)
        assert name == "vdi"
        expected = pvdi.pick(scene.vdi.vdi, scene.plotter.camera, place, WINDOW)
        assert hit == expected or hit.position == pytest.approx(expected.position, abs=1e-12)
        assert scene.depth_of(picker.GetPickPosition()) == pytest.approx(hit.depth, abs=Z_BUFFER)
        # VTK puts it on the ray through the pixel's corner, not through its centre
        apart = np.subtract(picker.GetPickPosition(), hit.position)
        assert np.abs(apart).max() <= 0.51 * 2 * hit.depth * np.tan(half_angle) / WINDOW[1]


@pytest.mark.parametrize("picker", [vtkPropPicker, vtkHardwarePicker])
def test_without_meshes_only_what_is_seen_is_picked(picker):
    scene = Scene()
    for name in ("backdrop", "front", "inside"):
        scene.plotter.remove_actor(getattr(scene, name))
    scene.show()
    assert scene.under(*CENTRE, picker)[1] == "vdi"
    assert scene.under(*CORNER, picker)[1] is None


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
    picker, name = scene.under(*CENTRE)
    place, hit = picker.GetPickPosition(), scene.vdi.pick(*CENTRE)
    assert name == "vdi"
    assert hit.color == (1, 0.5, 0)
    if face is None:  # into the cube by one of its three faces that this view sees
        assert np.abs(np.subtract(hit.position, (1, 1, 0.5))).min() < 1e-12
        assert scene.depth_of(place) == pytest.approx(hit.depth, abs=Z_BUFFER)
        return
    assert place[2] == pytest.approx(face, abs=Z_BUFFER)
    # VTK's stereo camera is a matrix of float32
    tolerance = 1e-6 if scene.plotter.render_window.GetStereoRender() else 1e-12
    assert hit.position[2] == pytest.approx(face, abs=tolerance)
    if change is parallel:
        half_pixel = 1.6 / WINDOW[1]
        assert hit.position == pytest.approx((half_pixel, half_pixel, 0.5), abs=1e-12)
    if change is clipped:
        scene.vdi.mapper.GetClippingPlanes().GetItem(0).SetOrigin(0, 0, -2)
        assert scene.vdi.pick(*CENTRE) is None
        assert scene.under(*CENTRE)[1] == "backdrop"


@pytest.mark.parametrize("kind", ["msaa", "ssaa", "eye dome lighting", "depth peeling"])
def test_pick_works_however_the_scene_is_drawn(kind):
    """VTK's own pickers find nothing, not even meshes, under SSAA and eye-dome lighting."""
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
    assert mapper.GetPickingAccumulated() is True
    first = scene.vdi.pick(*CENTRE)
    mapper.SetPickingOpacity(0.6)
    deeper = scene.vdi.pick(*CENTRE)
    assert first.accumulated_opacity < 0.6 <= deeper.accumulated_opacity
    assert deeper.position[2] < first.position[2] - 0.1
    place = scene.under(*CENTRE)[0].GetPickPosition()
    assert place[2] == pytest.approx(deeper.position[2], abs=Z_BUFFER)
    mapper.SetPickingOpacity(0.9)  # more than any of 64 supersegments has by itself
    mapper.SetPickingAccumulated(False)
    assert scene.vdi.pick(*CENTRE) is None
    assert scene.under(*CENTRE)[1] == "backdrop"
    copied = scene.vdi.copy(deep=False).mapper
    assert (copied.GetPickingOpacity(), copied.GetPickingAccumulated()) == (0.9, False)
    with pytest.raises(InvalidArgumentError, match="opacity_threshold must be at least 0"):
        mapper.SetPickingOpacity(1)
    assert mapper.GetPickingOpacity() == 0.9


def test_selections_have_as_many_pixels_as_are_seen():
    scene = Scene()
    scene.front.SetPickable(False)
    scene.inside.SetVisibility(False)
    scene.show()
    found = scene.selected((35, 25, 84, 74))  # all of it before the backdrop
    counts = {prop: node.Get(vtkSelectionNode.PIXEL_COUNT()) for prop, node in found.items()}
    depth = pvdi.render_depth(scene.vdi.vdi, scene.plotter.camera, WINDOW)
    seen = np.count_nonzero(np.isfinite(depth[::-1][25:75, 35:85]))
    assert counts == {scene.vdi: seen, scene.backdrop: 50 * 50 - seen}
    assert 500 < seen < 50 * 50
    # Points, of which a VDI has none, can be selected of other props
    scene.front.SetPickable(True)
    whole = (0, 0, WINDOW[0] - 1, WINDOW[1] - 1)
    points = scene.selected(whole, vtkDataObject.FIELD_ASSOCIATION_POINTS)
    assert scene.vdi not in points
    assert scene.front in points


def test_flags_of_the_actor_are_honoured():
    scene = Scene().show()
    for hide in (scene.vdi.SetPickable, scene.vdi.SetVisibility):
        hide(False)
        assert scene.under(*CENTRE)[1] == "backdrop"
        assert scene.vdi.pick(*CENTRE) is None
        hide(True)
        assert scene.under(*CENTRE)[1] == "vdi"


@pytest.mark.parametrize("first", [0, 1])
def test_the_nearer_of_two_is_picked_in_either_order(first):
    vdis = slab((0.25, 0.5), (1, 0, 0)), slab((-0.5, -0.25), (0, 0, 1))
    plotter = pv.Plotter(window_size=WINDOW)
    near, far = (plotter.add_vdi(vdis[(first + k) % 2]) for k in range(2))
    near, far = (near, far) if first == 0 else (far, near)
    plotter.camera_position = ((0, 0, 6), (0, 0, 0), (0, 1, 0))
    plotter.show(auto_close=False)
    picker = vtkPropPicker()
    picker.Pick(*CENTRE, 0, plotter.renderer)
    assert picker.GetViewProp() is near
    assert picker.GetPickPosition()[2] == pytest.approx(0.5, abs=Z_BUFFER)
    assert near.pick(*CENTRE).position[2] == pytest.approx(0.5, abs=1e-12)
    assert far.pick(*CENTRE) is None


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
    for picker in (vtkPropPicker, vtkHardwarePicker):
        scene.under(*CENTRE, picker)
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


def test_pyvistas_point_picking():
    scene = Scene(slab())
    points = []
    scene.plotter.enable_point_picking(
        points.append, picker="prop", left_clicking=True, show_message=False
    )
    scene.show()
    scene.plotter.iren._mouse_left_button_press(*CENTRE)
    scene.plotter.iren._mouse_left_button_release(*CENTRE)
    assert len(points) == 1
    assert points[0][2] == pytest.approx(0.5, abs=Z_BUFFER)
    assert scene.plotter.picked_point == pytest.approx(points[0])
    scene.plotter.mouse_position = CENTRE
    assert scene.plotter.pick_mouse_position()[2] == pytest.approx(0.5, abs=Z_BUFFER)


def test_the_callback_can_ask_for_the_actor():
    scene = Scene(slab())
    found = []

    def callback(point, picker):
        found.append((picker.GetViewProp(), scene.vdi.pick(*picker.GetSelectionPoint()[:2])))

    scene.plotter.enable_point_picking(
        callback, picker="prop", use_picker=True, left_clicking=True, show_point=False
    )
    scene.show()
    for place in (CENTRE, (2, 2)):
        scene.plotter.iren._mouse_left_button_press(*place)
        scene.plotter.iren._mouse_left_button_release(*place)
    (on_it, hit), beside = found
    assert on_it is scene.vdi
    assert hit.position[2] == pytest.approx(0.5, abs=1e-12)
    assert beside == (None, None)


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
    picker = vtkPropPicker()
    assert picker.Pick(*CENTRE, 0, renderer)
    assert picker.GetVolume() is actor
    assert picker.GetPickPosition()[2] == pytest.approx(0.5, abs=Z_BUFFER)
    assert actor.pick(*CENTRE).position[2] == pytest.approx(0.5, abs=1e-12)
    window.Finalize()


@pytest.mark.parametrize(
    ("picker", "seen", "beside"),  # as the table in guide_plotting.md has it
    [
        ("vtkPropPicker", "data", None),
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
    where = scene.actor.pick(60, 45).position
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
        if wanted == "data":  # the ray through the pixel's corner
            np.testing.assert_allclose(at, where, atol=0.2)
        if wanted == "box":
            assert np.isclose(at, 12).any()


def test_what_fails_is_said_once_and_picks_nothing(monkeypatch):
    def fail(*args, **options):
        raise DeviceError("the device is gone")

    scene = Scene().show()
    monkeypatch.setattr(selection, "render_first_hits", fail)
    with pytest.warns(VDIWarning, match="cannot be picked: DeviceError: the device is gone"):
        assert scene.vdi.pick(*CENTRE) is None
    assert scene.under(*CENTRE)[1] == "backdrop"
