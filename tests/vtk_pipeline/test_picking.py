"""Picking in real plotters: what is under the cursor, and where it begins."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import add_ours, soft_ball
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkPlane, vtkSelectionNode
from vtkmodules.vtkRenderingCore import (
    vtkHardwarePicker,
    vtkHardwareSelector,
    vtkPropPicker,
    vtkRenderer,
    vtkRenderWindow,
)

import pyvista_vdi as pvdi
from pyvista_vdi.errors import DeviceError, InvalidArgumentError, VDIWarning

pytestmark = pytest.mark.gl

WINDOW = (240, 200)
CENTRE = (120, 100)
#: Beside the ball, before the backdrop, inside the VDI's box.
CORNER = (70, 150)
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


@pytest.fixture(autouse=True)
def closed(vtk_messages):
    """Plotters are closed, whatever becomes of the test."""
    yield
    pv.close_all()


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


def pixel_at(scene, depth):
    """The size of a pixel at a view depth, world units: what VTK's own places may be off by."""
    return 2 * depth * np.tan(np.radians(scene.plotter.camera.view_angle / 2)) / WINDOW[1]


# -- which prop, and where ----------------------------------------------------------------------


def test_what_is_in_front_is_picked():
    scene = Scene().show()
    wanted = {
        CENTRE: "vdi",
        (150, 100): "front",
        CORNER: "backdrop",  # behind a part of the box where nothing is to be seen
        (5, 5): None,
        (81, 61): "inside",  # in the box, before the ball
    }
    found = {place: scene.under(*place)[1] for place in wanted}
    assert found == wanted
    assert {place: scene.vdi.pick(*place) is not None for place in wanted} == {
        place: name == "vdi" for place, name in wanted.items()
    }


@pytest.mark.parametrize("picker", [vtkPropPicker, vtkHardwarePicker])
def test_without_meshes_only_what_is_seen_is_picked(picker):
    scene = Scene()
    for name in ("backdrop", "front", "inside"):
        scene.plotter.remove_actor(getattr(scene, name))
    scene.show()
    assert scene.under(*CENTRE, picker)[1] == "vdi"
    assert scene.under(*CORNER, picker)[1] is None


def test_prop_picker_gives_the_place_of_the_first_hit():
    scene = Scene().show()
    for place in (CENTRE, (100, 80), (75, 65), (110, 130)):
        picker, name = scene.under(*place)
        hit = scene.vdi.pick(*place)
        assert name == "vdi"
        expected = pvdi.pick(scene.vdi.vdi, scene.plotter.camera, place, WINDOW)
        assert hit == expected or hit.position == pytest.approx(expected.position, abs=1e-12)
        assert scene.depth_of(picker.GetPickPosition()) == pytest.approx(hit.depth, abs=Z_BUFFER)
        # VTK puts it on the ray through the pixel's corner, not through its centre
        apart = np.subtract(picker.GetPickPosition(), hit.position)
        assert np.abs(apart).max() <= 0.51 * pixel_at(scene, hit.depth)


def test_the_place_is_on_the_face():
    scene = Scene(slab()).show()
    picker, _ = scene.under(*CENTRE)
    assert picker.GetPickPosition()[2] == pytest.approx(0.5, abs=Z_BUFFER)
    hit = scene.vdi.pick(*CENTRE)
    assert hit.position[2] == pytest.approx(0.5, abs=1e-12)
    assert hit.color == (1, 0.5, 0)


def test_from_another_view():
    scene = Scene(slab())
    scene.look((4, 3, 3))
    scene.show()
    picker, name = scene.under(*CENTRE)
    assert name == "vdi"
    hit = scene.vdi.pick(*CENTRE)
    # Into the cube by one of its three faces that this view sees
    face = np.abs(np.subtract(hit.position, (1, 1, 0.5)))
    assert face.min() < 1e-12
    assert scene.depth_of(picker.GetPickPosition()) == pytest.approx(hit.depth, abs=Z_BUFFER)


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


def test_copies_keep_the_threshold():
    plotter = pv.Plotter(window_size=WINDOW)
    actor = plotter.add_vdi(slab())
    actor.mapper.SetPickingOpacity(0.9)
    actor.mapper.SetPickingAccumulated(False)
    copied = actor.copy(deep=False)
    assert copied.mapper.GetPickingOpacity() == 0.9
    assert copied.mapper.GetPickingAccumulated() is False


def test_a_selection_has_as_many_pixels_as_are_seen():
    scene = Scene()
    scene.front.SetPickable(False)
    scene.inside.SetVisibility(False)
    scene.show()
    selector = vtkHardwareSelector()
    selector.SetRenderer(scene.plotter.renderer)
    selector.SetArea(70, 50, 169, 149)  # all of it before the backdrop
    selection = selector.Select()
    counts = {}
    for i in range(selection.GetNumberOfNodes()):
        properties = selection.GetNode(i).GetProperties()
        counts[properties.Get(vtkSelectionNode.PROP())] = properties.Get(
            vtkSelectionNode.PIXEL_COUNT()
        )
    depth = pvdi.render_depth(scene.vdi.vdi, scene.plotter.camera, WINDOW)
    seen = np.count_nonzero(np.isfinite(depth[::-1][50:150, 70:170]))
    assert counts == {scene.vdi: seen, scene.backdrop: 100 * 100 - seen}
    assert 2000 < seen < 100 * 100


def test_points_of_other_props_can_be_selected():
    scene = Scene().show()
    selector = vtkHardwareSelector()
    selector.SetRenderer(scene.plotter.renderer)
    selector.SetArea(0, 0, WINDOW[0] - 1, WINDOW[1] - 1)
    selector.SetFieldAssociation(vtkDataObject.FIELD_ASSOCIATION_POINTS)
    selection = selector.Select()
    nodes = [selection.GetNode(i).GetProperties() for i in range(selection.GetNumberOfNodes())]
    props = [node.Get(vtkSelectionNode.PROP()) for node in nodes]
    assert scene.vdi not in props
    assert scene.front in props


# -- scenes -------------------------------------------------------------------------------------


def test_flags_of_the_actor_are_honoured():
    scene = Scene().show()
    scene.vdi.SetPickable(False)
    assert scene.under(*CENTRE)[1] == "backdrop"
    assert scene.vdi.pick(*CENTRE) is None
    scene.vdi.SetPickable(True)
    scene.vdi.SetVisibility(False)
    assert scene.under(*CENTRE)[1] == "backdrop"
    assert scene.vdi.pick(*CENTRE) is None
    scene.vdi.SetVisibility(True)
    assert scene.under(*CENTRE)[1] == "vdi"


def test_matrix_of_the_actor():
    scene = Scene(slab())
    scene.vdi.user_matrix = np.array(
        [[0, -1, 0, 0.1], [1, 0, 0, 0], [0, 0, 0.5, -0.25], [0, 0, 0, 1]]
    )
    scene.show()
    assert scene.vdi.pick(*CENTRE).position[2] == pytest.approx(0.0, abs=1e-12)
    place = scene.under(*CENTRE)[0].GetPickPosition()
    assert place[2] == pytest.approx(0.0, abs=Z_BUFFER)


def test_clipping_planes():
    scene = Scene(slab()).show()
    plane = vtkPlane()
    plane.SetOrigin(0, 0, 0.2)
    plane.SetNormal(0, 0, -1)
    scene.vdi.mapper.AddClippingPlane(plane)
    assert scene.vdi.pick(*CENTRE).position[2] == pytest.approx(0.2, abs=1e-12)
    assert scene.under(*CENTRE)[0].GetPickPosition()[2] == pytest.approx(0.2, abs=Z_BUFFER)
    plane.SetOrigin(0, 0, -2)
    assert scene.vdi.pick(*CENTRE) is None
    assert scene.under(*CENTRE)[1] == "backdrop"


def test_parallel_projection():
    scene = Scene(slab())
    scene.plotter.enable_parallel_projection()
    scene.plotter.camera.parallel_scale = 1.6
    scene.show()
    place = scene.under(*CENTRE)[0].GetPickPosition()
    assert place[2] == pytest.approx(0.5, abs=Z_BUFFER)
    hit = scene.vdi.pick(*CENTRE)
    half_pixel = 1.6 / WINDOW[1]
    assert hit.position == pytest.approx((half_pixel, half_pixel, 0.5), abs=1e-12)


def test_camera_inside_the_box():
    scene = Scene(slab((-0.5, -0.25)))
    scene.look((0, 0, 0.5), (0, 0, -1))
    scene.show()
    assert scene.under(*CENTRE)[1] == "vdi"
    assert scene.vdi.pick(*CENTRE).position[2] == pytest.approx(-0.25, abs=1e-12)


def test_stereo():
    scene = Scene(slab())
    scene.plotter.enable_stereo_render()
    scene.show()
    place = scene.under(*CENTRE)[0].GetPickPosition()
    assert place[2] == pytest.approx(0.5, abs=Z_BUFFER)
    assert scene.vdi.pick(*CENTRE).position[2] == pytest.approx(0.5, abs=1e-6)


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
    before = scene.plotter.screenshot(return_img=True)
    assert scene.vdi.pick(*CENTRE).position[2] == pytest.approx(0.5, abs=1e-12)
    assert scene.vdi.pick(150, 100) is None  # the sphere in front
    assert np.array_equal(scene.plotter.screenshot(return_img=True), before)


def test_the_nearer_of_two_is_picked_in_either_order():
    near, far = slab((0.25, 0.5), (1, 0, 0)), slab((-0.5, -0.25), (0, 0, 1))
    for first, second in ((near, far), (far, near)):
        plotter = pv.Plotter(window_size=WINDOW)
        actors = {id(vdi): plotter.add_vdi(vdi) for vdi in (first, second)}
        plotter.camera_position = ((0, 0, 6), (0, 0, 0), (0, 1, 0))
        plotter.show(auto_close=False)
        picker = vtkPropPicker()
        picker.Pick(*CENTRE, 0, plotter.renderer)
        assert picker.GetViewProp() is actors[id(near)]
        assert picker.GetPickPosition()[2] == pytest.approx(0.5, abs=Z_BUFFER)
        assert actors[id(near)].pick(*CENTRE).position[2] == pytest.approx(0.5, abs=1e-12)
        assert actors[id(far)].pick(*CENTRE) is None


def test_subplots():
    plotter = pv.Plotter(shape=(1, 2), window_size=WINDOW)
    actors = []
    for column, face in enumerate((0.5, 0.25)):
        plotter.subplot(0, column)
        actors.append(plotter.add_vdi(slab((-0.5, face))))
        plotter.camera_position = ((0, 0, 8), (0, 0, 0), (0, 1, 0))
    plotter.show(auto_close=False)
    for actor, x, face in zip(actors, (60, 180), (0.5, 0.25), strict=True):
        assert actor.pick(x, 100).position[2] == pytest.approx(face, abs=1e-12)
        assert actor.pick(240 - x, 100) is None


def test_one_actor_in_two_renderers():
    plotter = pv.Plotter(shape=(1, 2), window_size=WINDOW)
    actor = plotter.add_vdi(slab())
    plotter.camera_position = ((0, 0, 8), (0, 0, 0), (0, 1, 0))
    plotter.subplot(0, 1)
    plotter.add_actor(actor)
    plotter.camera_position = ((0, 0, -8), (0, 0, 0), (0, 1, 0))
    plotter.show(auto_close=False)
    before = plotter.screenshot(return_img=True)
    assert actor.pick(60, 100).position[2] == pytest.approx(0.5, abs=1e-12)
    assert actor.pick(180, 100).position[2] == pytest.approx(-0.5, abs=1e-12)
    other = plotter.renderers[0]
    assert actor.pick(180, 100, renderer=other) is None
    assert np.array_equal(plotter.screenshot(return_img=True), before)


def test_the_picture_stays(no_leaks):
    scene = Scene().show()
    before = scene.plotter.screenshot(return_img=True)
    raycasts = scene.vdi.mapper.painter._raycasts
    for picker in (vtkPropPicker, vtkHardwarePicker):
        scene.under(*CENTRE, picker)
        assert np.array_equal(scene.plotter.screenshot(return_img=True), before)
    assert scene.vdi.pick(*CENTRE) is not None
    assert np.array_equal(scene.plotter.screenshot(return_img=True), before)
    assert scene.vdi.mapper.painter._raycasts == raycasts  # the image is kept


def test_copies_in_two_renderers_share_a_shader():
    """One is picked while the other is drawn: each must find its own text in place."""
    plotter = pv.Plotter(shape=(1, 2), window_size=WINDOW)
    actor = plotter.add_vdi(slab())
    plotter.camera_position = ((0, 0, 8), (0, 0, 0), (0, 1, 0))
    plotter.subplot(0, 1)
    twin = actor.copy(deep=False)
    assert twin.GetShaderProperty() is actor.GetShaderProperty()
    plotter.add_actor(twin)
    plotter.camera_position = ((0, 0, -8), (0, 0, 0), (0, 1, 0))
    plotter.show(auto_close=False)
    before = plotter.screenshot(return_img=True)
    for _ in range(2):
        assert actor.pick(60, 100).position[2] == pytest.approx(0.5, abs=1e-12)
        assert twin.pick(180, 100).position[2] == pytest.approx(-0.5, abs=1e-12)
        assert np.array_equal(plotter.screenshot(return_img=True), before)


def test_another_mapper_after_a_pick():
    scene = Scene(slab()).show()
    before = scene.plotter.screenshot(return_img=True)
    assert scene.vdi.pick(*CENTRE) is not None
    mapper = pvdi.VDIMapper()
    mapper.SetVDI(slab())
    scene.vdi.SetMapper(mapper)
    assert np.array_equal(scene.plotter.screenshot(return_img=True), before)


# -- PyVista and VTK ----------------------------------------------------------------------------


def test_point_picking_in_a_plotter():
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


def test_the_callback_can_ask_for_the_actor():
    scene = Scene(slab())
    found = []

    def callback(point, picker):
        found.append((picker.GetViewProp(), scene.vdi.pick(*picker.GetSelectionPoint()[:2])))

    scene.plotter.enable_point_picking(
        callback, picker="prop", use_picker=True, left_clicking=True, show_point=False
    )
    scene.show()
    for place in (CENTRE, (5, 5)):
        scene.plotter.iren._mouse_left_button_press(*place)
        scene.plotter.iren._mouse_left_button_release(*place)
    (on_it, hit), (beside_it, nothing) = found
    assert on_it is scene.vdi
    assert hit.position[2] == pytest.approx(0.5, abs=1e-12)
    assert beside_it is None
    assert nothing is None


def test_pick_mouse_position():
    scene = Scene(slab()).show()
    scene.plotter.iren.picker = "prop"
    scene.plotter.mouse_position = CENTRE
    assert scene.plotter.pick_mouse_position()[2] == pytest.approx(0.5, abs=Z_BUFFER)


def test_in_plain_vtk_and_before_the_first_frame():
    mapper, actor = pvdi.VDIMapper(), pvdi.VDIActor()
    mapper.SetVDI(slab())
    actor.SetMapper(mapper)
    with pytest.raises(InvalidArgumentError, match="nothing shows this actor yet"):
        actor.pick(1, 1)
    renderer, window = vtkRenderer(), vtkRenderWindow()
    renderer.AddVolume(actor)
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


def test_an_impossible_threshold_is_refused():
    mapper = pvdi.VDIMapper()
    with pytest.raises(InvalidArgumentError, match="opacity_threshold must be at least 0"):
        mapper.SetPickingOpacity(1)
    assert mapper.GetPickingOpacity() == 0.05


def test_what_fails_is_said_once_and_picks_nothing(monkeypatch):
    from pyvista_vdi.vtk_pipeline.drawing import selection

    def fail(*args, **options):
        raise DeviceError("the device is gone")

    scene = Scene().show()
    monkeypatch.setattr(selection, "render_first_hits", fail)
    with pytest.warns(VDIWarning, match="cannot be picked: DeviceError: the device is gone"):
        assert scene.vdi.pick(*CENTRE) is None
    assert scene.under(*CENTRE)[1] == "backdrop"
