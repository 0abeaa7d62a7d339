"""What changes the picture and needs no other VDI: cropping as VTK crops, and how dense it is."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import (
    add_judge,
    add_nothing,
    add_ours,
    assert_as_vtk,
    draw,
    opaque_sphere,
    shown,
    soft_ball,
    vdi_of_one_list,
)

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError, VDIWarning
from pyvista_vdi.model.cropping import PRESETS
from pyvista_vdi.vtk_pipeline.vtk import vtkOpenGLGPUVolumeRayCastMapper, vtkPlane

pytestmark = pytest.mark.gl

WINDOW = (120, 100)
PLANES = (-0.45, 0.3, -0.2, 0.5, -0.4, 0.25)
_NAMES = {
    "subvolume": "SubVolume",
    "fence": "Fence",
    "inverted_fence": "InvertedFence",
    "cross": "Cross",
    "inverted_cross": "InvertedCross",
}


def crop(mapper, regions, planes=PLANES):
    mapper.SetCropping(1)
    mapper.SetCroppingRegionPlanes(planes)
    if isinstance(regions, str):
        getattr(mapper, f"SetCroppingRegionFlagsTo{_NAMES[regions]}")()
    else:
        mapper.SetCroppingRegionFlags(regions)


def for_vtk(planes, n=24):
    """Planes from which VTK's GPU mapper crops the soft ball at ``planes``.

    It compares planes from 0 to 1 between the first and the last point with texture coordinates,
    in which these points lie at (1/2) / n and (n - 1/2) / n: what it draws begins up to half a
    voxel further out. (With planes as they are, 50 to 700 pixels differ by up to 23 of 255.)
    """
    between_points = (np.array(planes) + 1) / 2  # the ball's bounds are -1 to 1
    return 2 * (between_points * (n - 1) + 0.5) / n - 1


def cropped(regions, *, planes=PLANES, direction=(1.0, 0.7, 0.5), **more):
    def scene(plotter, add):
        actor = add(plotter, soft_ball(), **more)
        opaque_sphere(plotter)
        plotter.view_vector(direction)
        if add is not add_nothing:
            crop(actor.mapper, regions, for_vtk(planes) if add is add_judge else planes)

    return scene


@pytest.mark.parametrize("regions", [*[*PRESETS][::3], 0x5A3C12F])
def test_regions_are_vtks(regions):
    assert_as_vtk(cropped(regions))


def test_planes_that_are_not_in_order_draw_nothing_as_in_vtk():
    """VTK's GPU mapper, which is below ours, does not render then, and says nothing."""
    scene = cropped(0x5A3C12F, planes=(-0.3, 0.1, 0.4, -0.2, 0.3, 0.5))
    nothing = draw(add_nothing, scene)
    np.testing.assert_array_equal(draw(add_judge, scene), nothing)
    np.testing.assert_array_equal(draw(add_ours, scene), nothing)


def test_planes_are_in_the_data_s_own_coordinates():
    matrix = pv.Transform().rotate_z(35).scale(1.0, 1.3, 0.8).translate(0.5, 0.1, 0.2).matrix
    assert_as_vtk(cropped("cross", user_matrix=matrix))


def turned(*, x=0, y=0, z=0):
    return pv.Transform().rotate_x(x).rotate_y(y).rotate_z(z).matrix[:3, :3]


@pytest.mark.parametrize("regions", ["subvolume", "inverted_cross"])
@pytest.mark.parametrize(
    "direction",
    [
        turned(x=50),
        turned(y=-20),
        turned(x=20, y=35, z=30),
        [[1, 0.3, 0], [0, 1, 0.2], [0, 0, 1]],  # a shear
        turned(z=180),  # the low planes are beyond the high ones
        [[0, 1, 0], [0, 0, 1], [1, 0, 0]],  # no plane's place depends on the number it was given
    ],
)
def test_an_oblique_image_is_cropped_as_by_vtk(direction, regions):
    """With planes within and beyond the bounds; VTK's are up to half a voxel off: see for_vtk."""
    direction = np.asarray(direction, dtype=float)
    image = pv.ImageData(dimensions=(54, 60, 50), spacing=(0.03, 0.04, 0.05))
    image.direction_matrix, image.origin = direction, (0.3, -0.2, 0.4)
    image["v"] = np.ones(image.n_points)
    low, high = np.reshape(image.bounds, (3, 2)).T
    planes = low[:, None] + [[0.3, 0.7], [0.25, 0.8], [0.4, 1.3]] * (high - low)[:, None]
    matrix = pv.Transform().rotate_y(40).translate(0.2, 0.1, 0).matrix

    def kept(add, cropped=True):
        plotter = pv.Plotter(off_screen=True, window_size=WINDOW)
        looks = {"opacity": 0.8, "clim": (0, 1), "show_scalar_bar": False}
        actor = add(plotter, image, **looks)
        actor.user_matrix = matrix
        crop(actor.mapper, regions, planes.ravel())
        actor.mapper.SetCropping(cropped)
        plotter.view_isometric()
        picture = plotter.screenshot(return_img=True)
        plotter.close()
        return picture[..., :3].min(axis=2) < 250

    ours, theirs = kept(add_ours), kept(add_judge)
    whole = np.count_nonzero(kept(add_ours, cropped=False))
    # Seen: up to .058, half a voxel at many edges; with planes across the model frame's axes, .21
    # to .43
    assert np.count_nonzero(ours ^ theirs) < 0.08 * whole


def test_cropping_and_a_clipping_plane_together():
    plane = vtkPlane()
    plane.SetNormal(0.3, -1.0, 0.2)

    def scene(plotter, add):
        cropped("fence")(plotter, add)
        for actor in plotter.renderer.actors.values():
            if isinstance(actor, pv.Volume):
                actor.mapper.AddClippingPlane(plane)

    assert_as_vtk(scene, window_size=(240, 200))


def test_parallel_projection_and_from_inside():
    def parallel(plotter, add):
        cropped("inverted_cross")(plotter, add)
        plotter.enable_parallel_projection()

    def inside(plotter, add):
        cropped("fence")(plotter, add)
        plotter.camera.position = (-0.5, -0.1, 0.05)
        plotter.camera.focal_point = (1, 0.4, 0.3)
        plotter.renderer.reset_camera_clipping_range()

    assert_as_vtk(parallel)
    with pytest.warns(VDIWarning, match="coverage='bounds' needs the eye outside"):
        assert_as_vtk(inside)


def clip(actor):
    plane = vtkPlane()
    plane.SetNormal(1, 0.2, 0)
    actor.mapper.AddClippingPlane(plane)


#: Changes of the picture, one after the other.
LOOKS = {
    "visibility": lambda a: a.SetVisibility(False),
    "matrix": lambda a: setattr(a, "user_matrix", np.diag([1.2, 0.8, 1, 1])),
    "position": lambda a: a.SetPosition(0.2, 0.1, 0),
    "clipping": clip,
    "cropping": lambda a: crop(a.mapper, "subvolume"),
    "regions": lambda a: crop(a.mapper, "inverted_fence"),
    "multiplier": lambda a: setattr(a, "opacity_multiplier", 4.0),
    "mapper's multiplier": lambda a: a.mapper.SetOpacityMultiplier(0.1),
}


def test_changes_act_on_the_next_frame_without_another_vdi(plotter):
    made = []
    actor = plotter.add_vdi(soft_ball(), show_scalar_bar=False, progress_bar=made.append)
    before = shown(plotter)
    vdi, count = actor.vdi, len(made)
    assert count
    for name, change in LOOKS.items():
        change(actor)
        after = shown(plotter)
        assert np.abs(after - before).max() > 10, f"{name} changes nothing"
        assert actor.vdi is vdi, name
        before = after
        actor.SetVisibility(True)
    assert len(made) == count, "something was generated"
    actor.mapper.SetCropping(0)
    actor.mapper.RemoveAllClippingPlanes()
    actor.user_matrix = np.eye(4)
    actor.SetPosition(0, 0, 0)
    actor.opacity_multiplier = 1.0
    again = shown(plotter)
    plain = pv.Plotter(window_size=WINDOW, off_screen=True)
    plain.add_vdi(vdi, show_scalar_bar=False)
    plain.camera = plotter.camera.copy()
    np.testing.assert_array_equal(again, shown(plain))


def test_multiplier_is_another_unit_distance():
    """VTK with half the unit distance, and our VDI of the whole one, twice as dense."""

    def half(plotter, add):
        actor = add(plotter, soft_ball())
        if add is add_judge:
            actor.prop.SetScalarOpacityUnitDistance(0.1)
        elif add is add_ours:
            actor.opacity_multiplier = 2.0

    assert_as_vtk(half)
    assert np.abs(draw(add_ours, half) - draw(add_ours, lambda p, a: a(p, soft_ball()))).max() > 10


def test_rays_end_earlier_on_request(plotter):
    """On the next frame, by no more than was allowed; without another VDI."""
    actor = plotter.add_vdi(soft_ball(), show_scalar_bar=False)
    actor.opacity_multiplier = 20.0  # so that rays do end
    shown(plotter)  # makes the VDI; from another view rays cross many lists
    plotter.camera.azimuth += 40
    exact, vdi = shown(plotter), actor.vdi
    actor.mapper.SetTransmittanceCutoff(0.5)
    rough = shown(plotter)
    assert 1 < np.abs(exact - rough).max() <= 0.5 * 255 + 1
    assert actor.vdi is vdi
    other = actor.copy()
    assert other.mapper.GetTransmittanceCutoff() == 0.5
    actor.mapper.SetTransmittanceCutoff(1 / 255)
    assert np.abs(shown(plotter) - exact).max() <= 2  # and rounding to bytes


@pytest.mark.parametrize(
    ("name", "default", "wrong", "message", "bare"),
    [
        (
            *("opacity_multiplier", 1.0, (-1.0, np.nan, "thick")),
            *("opacity_multiplier is a finite factor", "no mapper whose opacity"),
        ),
    ],
)
def test_numbers_that_are_none(plotter, name, default, wrong, message, bare):
    actor, alone = plotter.add_vdi(vdi_of_one_list()), pvdi.VDIActor()
    setattr(actor, name, 0.25)
    for nonsense in wrong:
        with pytest.raises(InvalidArgumentError, match=message):
            setattr(actor, name, nonsense)
    assert getattr(actor, name) == 0.25
    assert getattr(alone, name) == default
    with pytest.raises(InvalidArgumentError, match=bare):
        setattr(alone, name, 0.5)


def test_vtk_s_mapper_agrees_on_the_presets():
    mapper = vtkOpenGLGPUVolumeRayCastMapper()
    for name, flags in PRESETS.items():
        assert pvdi.Cropping.from_any(mapper) is None
        crop(mapper, name)
        assert pvdi.Cropping.from_any(mapper) == pvdi.Cropping(PLANES, flags)
        mapper.CroppingOff()


def test_picks_are_of_what_is_shown(plotter):
    """Through what is cropped away, and through what the multiplier has made thin."""
    actor = plotter.add_vdi(soft_ball(), show_scalar_bar=False)
    plotter.view_vector((1, 0, 0), viewup=(0, 0, 1))
    shown(plotter)
    place = (60, 50)
    whole = actor.pick(*place)
    assert whole.position[0] > 0.3
    crop(actor.mapper, "subvolume", (-0.8, 0.1, -1, 1, -1, 1))
    plotter.render()
    # cut within a supersegment: the ray enters it at the plane
    assert actor.pick(*place).position[0] == pytest.approx(0.1, abs=1e-6)
    crop(actor.mapper, 0x7FFFFFF & ~0x2000 & ~0x4804812, (-0.5, 0.1, -1, 1, -1, 1))
    plotter.render()
    assert actor.pick(*place) is None or actor.pick(*place).position[0] <= -0.5 + 1e-6
    actor.mapper.CroppingOff()
    actor.opacity_multiplier = 0.01
    plotter.render()
    thin = actor.pick(*place)
    assert thin is None or thin.position[0] < whole.position[0] - 0.1
