"""Random sequences of what scripts do off-screen: after every step as with ``add_volume``."""

import collections

import numpy as np
import pytest
import pyvista as pv
from drop_in.stage import CONTRAST, LEAST_CONTRAST, LEAST_SSIM, contrast, half_voxel_steps
from drop_in.volumes import grid, values
from pyvista import vtk_version_info

from pyvista_vdi import compare_images
from pyvista_vdi.vtk_pipeline.vtk import vtkPlane

pytestmark = pytest.mark.gl

WINDOW = (120, 90)
MOST_STEPS = 20
#: Where volumes are added: apart from each other, as VTK blends in the order of adding.
PLACES = ((0, 0, 0), (0, 6, 0), (0, -6, 0))


class Script:
    """What one script does; ``add`` is ``add_volume`` or ``add_vdi`` with a plotter before."""

    def __init__(self, add):
        self._add, self.actors, self.volumes, self.plotters = add, [], [], []
        self.another_plotter()

    def another_plotter(self):
        self.plotter = pv.Plotter(off_screen=True, window_size=WINDOW)
        self.plotters.append(self.plotter)
        self.plotter.render_window.SetMultiSamples(0)  # VTK shows edges of a clipped volume's box
        self.plotter.add_mesh(pv.Sphere(radius=0.3, center=(1.2, 0, 0)), color="white")
        for actor in self.actors:
            self.plotter.add_actor(actor)
        self.plotter.camera_position = ((4, 3, 2), (0, 0, 0), (0, 0, 1))

    def another_plotter_closing_this(self):
        self.plotters.pop().close()
        self.another_plotter()

    def add(self, seed, opacity):
        volume = grid(20, seed=seed)
        volume.origin = np.add(volume.origin, PLACES[len(self.actors) % len(PLACES)])
        how = {"opacity": opacity, "clim": (0, 255), "show_scalar_bar": False}
        self.actors.append(self._add(self.plotter, volume, **how))
        self.volumes.append(volume)

    def remove(self):
        if len(self.actors) > 1:
            self.plotter.remove_actor(self.actors.pop())
            self.volumes.pop()

    def turn(self, azimuth, elevation):
        self.plotter.camera.Azimuth(azimuth)
        self.plotter.camera.Elevation(elevation)
        self.plotter.camera.OrthogonalizeViewUp()

    def zoom(self, factor):
        self.plotter.camera.Zoom(factor)

    def reset(self):
        self.plotter.camera.view_angle = 30
        self.plotter.reset_camera()

    def look_from_inside(self, place):
        for actor in self.actors:  # VTK shows one flat colour where a clipped box is around the eye
            actor.mapper.RemoveAllClippingPlanes()
        self.plotter.camera_position = ((0.2, 0.1, 0.2), place, (0, 0, 1))

    def look_from_afar(self):
        self.plotter.camera_position = ((40, 30, 20), (0, 0, 0), (0, 0, 1))

    def resize(self, width, height):
        self.plotter.window_size = (width, height)

    def change_data(self, seed):
        self.volumes[-1]["values"][:] = 255 * values(20, seed).ravel()

    def change_colours(self, name):
        table = pv.LookupTable(name, scalar_range=(0, 255))
        table.apply_opacity("linear")
        self.actors[-1].prop.apply_lookup_table(table)

    def clip(self, place):
        plane = vtkPlane()
        plane.SetOrigin(place)
        plane.SetNormal(1, 0.2, 0.1)
        self.actors[-1].mapper.RemoveAllClippingPlanes()
        self.actors[-1].mapper.AddClippingPlane(plane)

    def picture(self, scale=1):
        self.plotter.render()  # a screenshot alone is of the frame before
        shot = self.plotter.screenshot(None, return_img=True, scale=scale)
        return np.asarray(shot, dtype=float)[..., :3]

    def close(self):
        for plotter in self.plotters:
            plotter.close()


def steps(rng):
    """Return the steps of a script, names and arguments; it begins with a volume."""
    draw = {
        "add": lambda: (int(rng.integers(4)), str(rng.choice(["linear", "sigmoid", "geom"]))),
        "remove": tuple,
        "turn": lambda: (rng.uniform(-60, 60), rng.uniform(-20, 20)),
        "turn a little": lambda: (rng.uniform(-2, 2), 0.0),
        "zoom": lambda: (rng.uniform(0.5, 3),),
        "reset": tuple,
        "look from inside": lambda: (rng.uniform(-1, 1, 3),),
        "look from afar": tuple,
        "resize": lambda: tuple(int(n) for n in rng.integers(60, 200, 2)),
        "change data": lambda: (int(rng.integers(4)),),
        "change colours": lambda: (str(rng.choice(["bone", "viridis", "hot"])),),
        "clip": lambda: (rng.uniform(-0.4, 0.4, 3),),
        "another plotter": tuple,
        "another plotter closing this": tuple,
        "picture": lambda: (int(rng.integers(2, 4)),),
    }
    if vtk_version_info < (9, 5):  # the second window has volumes, of VTK's, too, on a black box
        del draw["another plotter"]
    names = ["add", *rng.choice(list(draw), int(rng.integers(3, MOST_STEPS)))]
    return [(str(name), draw[name]()) for name in names]


def overlap(script):
    """Whether volumes overlap in the picture: VTK blends them in the order of adding."""
    boxes, renderer = [], script.plotter.renderer
    for actor in script.actors:
        corners = pv.Box(actor.bounds).points
        ends = []
        for corner in corners:
            renderer.SetWorldPoint(*corner, 1.0)
            renderer.WorldToDisplay()
            ends.append(renderer.GetDisplayPoint())
        depth = (corners - script.plotter.camera.position) @ script.plotter.camera.direction
        if depth.min() <= 0 and len(script.actors) > 1:
            return True
        boxes.append((np.min(ends, axis=0)[:2], np.max(ends, axis=0)[:2]))
    return any(
        (a[0] <= b[1] + 1).all() and (b[0] <= a[1] + 1).all()
        for i, a in enumerate(boxes)
        for b in boxes[:i]
    )


def with_add_volume(plotter, volume, **how):
    actor = plotter.add_volume(volume, mapper="gpu", **how)
    half_voxel_steps(actor)
    # At steps of half a voxel VTK draws grain where a clipping plane cuts on
    actor.mapper.SetSampleDistance(volume.spacing[0] / 8)
    # Between voxels linearly: at their edges two samplings differ by more than is compared here
    actor.prop.interpolation_type = "linear"
    return actor


def same(script, judge, way, drawn, what):
    """Compare pictures after a step, and note what drew ours."""
    scale = what[1][0] if what[0] == "picture" else 1
    if way == "vdi":  # a VDI serves its own view
        for actor in script.actors:
            actor.regenerate(script.plotter.camera, script.plotter.window_size)
    ours, theirs = script.picture(scale), judge.picture(scale)
    drawn.update(actor.status.drawn for actor in script.actors)
    fine = way != "vdi" or all(
        (actor.status.magnification or 1) * scale < 1.1 for actor in script.actors
    )
    if overlap(judge) or not fine:
        return
    ssim = compare_images(ours / 255, theirs / 255).ssim
    means = [f"{picture.mean():.3f}" for picture in (ours, theirs)]
    seen = [str(actor.status) for actor in script.actors]
    assert ssim >= LEAST_SSIM, f"SSIM {ssim:.4f} after {what}; means {means}; {seen}"
    own, wanted = contrast(ours), contrast(theirs)
    if wanted > 2 * LEAST_CONTRAST:  # from inside, VTK's steps are seen as grain of less
        assert abs(own / wanted - 1) <= CONTRAST, f"contrast {own:.2f} for {wanted:.2f} at {what}"


@pytest.mark.filterwarnings("ignore::pyvista_vdi.errors.VDIWarning")  # VDIs made inside a volume
@pytest.mark.parametrize(
    ("seed", "way"),
    [
        pytest.param(
            seed, ("auto", "volume", "vdi")[seed % 3], marks=[pytest.mark.slow] * (seed > 8)
        )
        for seed in range(100)
    ],
)
def test_every_picture_is_as_with_add_volume(seed, way, record_property, default_runtime):
    def with_add_vdi(plotter, volume, **how):
        return plotter.add_vdi(volume, draw=way, interpolation="linear", **how)

    script, judge, drawn = Script(with_add_vdi), Script(with_add_volume), collections.Counter()
    try:
        for name, arguments in steps(np.random.default_rng(seed)):
            for each in (script, judge):
                if name != "picture":
                    getattr(each, name.replace(" a little", "").replace(" ", "_"))(*arguments)
            same(script, judge, way, drawn, (name, arguments))
    finally:
        script.close()
        judge.close()
    record_property("drawn", dict(drawn))
    print(f"pictures by {dict(drawn)}")
