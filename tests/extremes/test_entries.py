"""Rays that enter the volume many voxels from where they are formed, on both sides of the border
from which on their positions are computed with numbers of two floats."""

from __future__ import annotations

import numpy as np
import pytest
import reference
import strategies
from drawing import generate_vdi, raycast_volume, render_vdi
from extreme_scenes import (
    BOUND,
    WINDOW,
    assert_within,
    check_scene,
    check_views,
    field_volume,
    slabs_vdi,
    transfer,
    turned,
    view,
)
from oracle import assert_explained
from reference.raycast import pixel_ray

from pyvista_vdi import Camera, Cropping, Shading, TransferFunction, Volume
from pyvista_vdi.model.cropping import PRESETS
from pyvista_vdi.raycasting.prepared import PreparedVDI
from pyvista_vdi.volume.classified_volume import DeviceVolume

pytestmark = pytest.mark.extremes

SHINY = Shading(0.2, 0.6, 0.5, 30.0)


def is_far(runtime, volume, camera, window=WINDOW):
    medium = DeviceVolume(runtime, volume, transfer())
    return medium.rays.forms(camera, window).double_float


@pytest.mark.parametrize(
    ("thinness", "far", "lit"), [(123, False, False), (125, True, False), (125, True, True)]
)
def test_the_bound_holds_on_both_sides_of_the_border(runtime, worst, thinness, far, lit):
    """The scenes differ by a hundredth, and their pictures hardly; the arithmetic changes."""
    volume = field_volume((1, 1 / thinness, 1))
    camera = view(volume, 75, 10, zoom=True)
    assert is_far(runtime, volume, camera) is far
    function = transfer(unit_distance=5 / thinness, shading=SHINY if lit else None)
    image = raycast_volume(volume, camera, WINDOW, function, device=runtime)
    exact = reference.volume_image(volume, camera, WINDOW, function)
    assert (exact[..., 3] > 1e-3).sum() > 3
    assert_within(worst, "volume", image, exact)


def test_needles(runtime, worst):
    """Cells of 1:10^6: a chord of a hundredth, six thousand from where rays are formed."""
    spacing = (1e-3, 1, 1e3)
    volume = field_volume(spacing)
    camera = view(volume, zoom=True)
    function = transfer(unit_distance=5 * min(spacing))
    # Half the least spacing would be fourteen million steps, which float64 takes long to do
    step = volume.length / 2000
    views = turned(camera, volume, (0, 0.01), zoom=True)
    vdi = check_scene(
        runtime, worst, volume, function, camera, views, sample_distance=step, bound=BOUND
    )
    # A staircase of lists so thin that rays from aside may pass between them
    check_views(runtime, worst, vdi, turned(camera, volume, (8,), zoom=True), least_drawn=0)


def test_supersegments_of_far_entries_are_ordered_and_have_a_thickness(runtime, worst):
    """Steps of few units in the last place of their depth, which rounding could make nothing."""
    volume = field_volume((1e-3, 1, 1e3))
    camera = view(volume, zoom=True)
    function = transfer(unit_distance=5e-3)
    vdi = generate_vdi(
        volume, camera, WINDOW, function, sample_distance=volume.length / 2**19,
        max_supersegments=40, device=runtime,
    )  # fmt: skip
    assert vdi.counts.max() > 1
    assert (vdi.back > vdi.front).all()
    lists = np.repeat(np.arange(vdi.counts.size), vdi.counts.ravel())
    touching = lists[1:] == lists[:-1]
    assert (vdi.front[1:] >= vdi.back[:-1])[touching].all()
    exact = reference.volume_image(volume, camera, WINDOW, function, volume.length / 2**19)
    assert_within(worst, "VDI as it is stored", reference.render(vdi, camera, WINDOW), exact)


PLATE = (2, 6, 1e-3, 5e-3, 1, 5)


@pytest.mark.parametrize("end", ["plane", "opaque", "fence"])
def test_far_entries_are_clipped_cropped_and_ended(runtime, worst, end):
    """A constant medium absorbs by the length that is left of each ray."""
    volume = Volume(np.ones((7, 8, 9), np.uint8), (1, 1e-3, 1))
    camera = view(volume, 75, 10, zoom=True)
    assert is_far(runtime, volume, camera)
    function = TransferFunction([[1, 1, 1]] * 2, [0.3, 0.3], (0, 1), unit_distance=5e-3)
    box = np.reshape(volume.bounds, (3, 2))
    point, normal = box.mean(axis=1), np.array([0.1, 1, 0.2])
    depth = camera.model_to_view[2, :3] @ point + camera.model_to_view[2, 3]
    cropping = Cropping(PLATE, end) if end in PRESETS else None
    exact = np.zeros(WINDOW[::-1])
    for y, x in np.ndindex(exact.shape):
        origin, direction = pixel_ray(camera, WINDOW, x, y)
        cuts = np.sort((box - origin[:, np.newaxis]) / direction[:, np.newaxis], axis=1)
        first, last = cuts[:, 0].max(), cuts[:, 1].min()
        if end == "opaque":
            last = min(last, depth)
        if end == "plane":
            at = normal @ (point - origin) / (normal @ direction)
            first, last = (
                (max(first, at), last) if normal @ direction > 0 else (first, min(last, at))
            )
        parts = np.array([[first, last]]) if last > first else np.zeros((0, 2))
        if cropping is not None and len(parts):
            parts = cropping.parts_of_ray(origin, direction, first, last)
        length = np.diff(parts, axis=1).sum() * np.linalg.norm(direction)
        exact[WINDOW[1] - 1 - y, x] = -np.expm1(np.log1p(-0.3) * length / 5e-3)
    image = raycast_volume(
        volume, camera, WINDOW, function, device=runtime, cropping=cropping,
        clipping_planes=[[*point, *normal]] if end == "plane" else None,
        opaque_depth=np.full(exact.shape, depth) if end == "opaque" else None,
    )  # fmt: skip
    assert (exact > 1e-3).sum() > 3
    assert_within(worst, "volume", image[..., 3], exact)


EYE = Camera((0, 0, 10), (0, 0, 0), (0, 1, 0), view_angle=16)


@pytest.mark.parametrize(
    ("thinness", "far", "parallel"), [(127, False, False), (130, True, False), (1e5, True, True)]
)
def test_v_o_sees_all_of_a_far_supersegment(runtime, worst, thinness, far, parallel):
    """Both forms of depth, on either side of the border: 128 thicknesses from the near plane."""
    camera = EYE.replace(parallel_projection=parallel, parallel_scale=0.7)
    where = {"window": (4, 3), "bounds": (-1, 1, -1, 1, -1, 1), "depth_origin": 9.0}
    vdi = slabs_vdi(camera, [2 - 2 / thinness, 2], 1.0, **where)
    assert ("DOUBLE_FLOAT_RAYS" in PreparedVDI(runtime, vdi).switches) is far
    image = render_vdi(vdi, vdi.camera, (4, 3), device=runtime)
    assert_within(worst, "VDI at V_O", image, reference.render(vdi, vdi.camera, (4, 3)))
    check_views(runtime, worst, vdi, [EYE.azimuth(a) for a in (25, 90, 180)], least_drawn=0)


@pytest.mark.parametrize(("kind", "precision"), [("near", "8-byte"), ("parallel", "exact")])
def test_any_vdi_may_be_drawn_by_depths_relative_to_the_ray(
    runtime, worst, monkeypatch, kind, precision
):
    """Nothing but rounding tells the two forms apart."""
    rng = np.random.default_rng([4, 901])
    vdi = strategies.random_vdi(rng, max_window=(9, 7)).with_precision(precision)
    camera, size = strategies.random_view(rng, vdi, kind)
    monkeypatch.setattr("pyvista_vdi.raycasting.prepared.lists_are_far", lambda *_: True)
    assert "DOUBLE_FLOAT_RAYS" in PreparedVDI(runtime, vdi).switches
    image = render_vdi(vdi, camera, size, device=runtime)
    worst("random VDI", assert_explained(vdi, camera, size, image, name=kind).worst)
