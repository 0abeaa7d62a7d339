"""Picking in real plotters: what is under the cursor, and where it begins."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import add_ours, soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.errors import DeviceError, InvalidArgumentError, VDIWarning
from pyvista_vdi.vtk_pipeline.drawing import selection
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkPlane,
    vtkPropPicker,
    vtkRenderer,
    vtkRenderWindow,
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


def test_what_fails_is_said_once_and_picks_nothing(monkeypatch):
    def fail(*args, **options):
        raise DeviceError("the device is gone")

    scene = Scene().show()
    monkeypatch.setattr(selection, "render_first_hits", fail)
    with pytest.warns(VDIWarning, match="cannot be picked: DeviceError: the device is gone"):
        assert scene.vdi.pick(*CENTRE) is None
    assert scene.under(*CENTRE)[1] == "backdrop"
