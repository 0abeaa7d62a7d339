"""Picking in real plotters: what is under the cursor, and where it begins."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import add_ours, soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.vtk_pipeline.vtk import vtkPlane, vtkPropPicker, vtkRenderer, vtkRenderWindow

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
    picker = vtkPropPicker()  # which finds what the last frame showed
    assert picker.Pick(*CENTRE, 0, scene.plotter.renderer)
    assert picker.GetViewProp() is scene.vdi
    picker.Pick(*CORNER, 0, scene.plotter.renderer)
    assert picker.GetViewProp() is not scene.vdi


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
    hit = scene.vdi.pick(*CENTRE)
    assert hit.color == (1, 0.5, 0)
    # VTK's stereo camera is a matrix of float32
    tolerance = 1e-6 if scene.plotter.render_window.GetStereoRender() else 1e-12
    assert hit.position[2] == pytest.approx(face, abs=tolerance)
    if change is parallel:
        half_pixel = 1.6 / WINDOW[1]
        assert hit.position == pytest.approx((half_pixel, half_pixel, 0.5), abs=1e-12)
    if change is clipped:
        scene.vdi.mapper.GetClippingPlanes().GetItem(0).SetOrigin(0, 0, -2)
        assert scene.vdi.pick(*CENTRE) is None


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
