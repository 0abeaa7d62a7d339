"""Several VDIs together, on the device: against the float64 oracle, and against one VDI alone.

As in ``test_raycast_oracle``, every pixel lies within a tolerance of the oracle's range over rays
moved by the roundings of list coordinates, each VDI's on its own. The tolerance is twice that of a
single VDI: where two overlap, a ray composites twice as many pieces, and each has four more
roundings (its share of a segment, the sums of two, the mean colour), which mostly cancel.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import reference
import strategies
from drawing import owned_image, render_vdi, render_vdis
from extreme_scenes import slabs_vdi
from oracle import assert_explained
from ray_scenes import random_ends, with_some

import pyvista_vdi as pvdi
from pyvista_vdi import Camera, Cropping, InvalidArgumentError
from pyvista_vdi.model.ray_forms import cells_of_points
from pyvista_vdi.raycasting import multi_vdi
from pyvista_vdi.raycasting.multi_vdi import PlacedVDI
from pyvista_vdi.raycasting.prepared import OccupancyGrid, prepared_vdi

#: Largest difference per channel from the oracle; see above.
TOLERANCE = 4e-5

#: Largest difference of what is the same medium in exact arithmetic: what lies behind a
#: transmittance of 1e-6 may be dropped, and as many roundings as above.
SAME = 2e-5

#: Share of pixels that may differ by more from the unmoved rays. At half size they run along
#: borders: measured, 15 % of them there and at most 0.3 % otherwise.
MAX_SHARE = {"half": 0.25}

CAMERA = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0))
BOUNDS = (-1, 1, -1, 1, -1, 1)

#: Rays are followed in no more than two ways where several VDIs are drawn together.
in_two_ways = pytest.mark.parametrize("dealt", ["one by one", "blocks"], indirect=True)


def scene(seed, kind, count=2):
    """VDIs of different generating views whose bounds overlap, a new view of each, its size."""
    rng = np.random.default_rng(seed)
    first = strategies.random_vdi(rng, max_window=(14, 11))
    camera, size = strategies.random_view(rng, first, kind)
    vdis, cameras = [first], [camera]
    bounds = np.reshape(first.bounds, (3, 2))
    centre, extent = bounds.mean(axis=1), np.ptp(bounds, axis=1)
    for _ in range(count - 1):
        # About the first one's centre: turned, scaled, moved by up to a third of its extent
        local = strategies.random_transform(rng)
        local[:3, 3] = 0
        place = centre + rng.uniform(-1, 1, size=3) / 3 * extent
        local[:3, 3] = place - local[:3, :3] @ centre
        vdis.append(strategies.random_vdi(rng, max_window=(14, 11), bounds=bounds.ravel()))
        cameras.append(camera.replace(model_transform=camera.model_transform @ local))
    return vdis, cameras, size


def draw(runtime, vdis, cameras, size, **options):
    transforms = [camera.model_transform for camera in cameras]
    return render_vdis(
        vdis, cameras[0], size, model_transforms=transforms, device=runtime, **options
    )


def check(vdis, cameras, size, image, name, **ends):
    """Compare with the oracle."""
    return assert_explained(
        vdis,
        cameras,
        size,
        image,
        name=name,
        tolerance=TOLERANCE,
        escalation=(0, 300, 3000),
        most_pixels=(100, 20, 3),
        render=reference.render_joint,
        render_range=reference.render_joint_range,
        **ends,
    )


@in_two_ways
@pytest.mark.every(6)
@pytest.mark.parametrize("kind", [*strategies.VIEWS[2:], *strategies.VIEWS[:2]])
def test_every_pixel_is_within_the_range_of_the_moved_rays(runtime, kind, dealt):
    moved = drawn = pixels = 0
    for case in range(5):
        seed = [case, strategies.VIEWS.index(kind), 7]
        vdis, cameras, size = scene(seed, kind, 2 + case % 2)
        image = draw(runtime, vdis, cameras, size)
        result = check(vdis, cameras, size, image, f"seed {seed}, view {kind!r}")
        moved, drawn, pixels = moved + result.moved, drawn + result.drawn, pixels + result.pixels
    assert drawn > pixels / 10  # a comparison of nothing with nothing proves nothing
    assert moved <= MAX_SHARE.get(kind, 0.01) * pixels


@in_two_ways
@pytest.mark.every(2)
@pytest.mark.parametrize("kind", ["around", "parallel", "near", "inside"])
def test_ends_of_rays_and_each_vdi_s_own_looks(runtime, kind, dealt):
    """Opaque depth, and clipping planes, cropping and density of each, in either order."""
    vdis, cameras, size = scene([len(kind), 8], kind)
    rng = np.random.default_rng([len(kind), 16])
    ends = random_ends(rng, vdis[0], cameras[0], size)
    cut = {**ends, "clipping_planes": [None, ends["clipping_planes"]]}
    low, high = np.reshape(vdis[0].bounds, (3, 2)).T
    cuts = low + np.sort(rng.uniform(0.1, 0.9, size=(2, 3)), axis=0) * (high - low)
    fence, cross = (Cropping(cuts.T.ravel(), name) for name in ("inverted_fence", "cross"))
    looks = {
        "cropping": [fence, cross if kind in ("around", "inside") else None],
        "opacity_multiplier": [1.0, float(rng.uniform(0.2, 3))],
    }
    plain = draw(runtime, vdis, cameras, size)
    for shown in (cut, looks):
        image = draw(runtime, vdis, cameras, size, **shown)
        assert check(vdis, cameras, size, image, kind, **shown).drawn
        assert not np.array_equal(image, plain)
        turned = {name: v[::-1] if isinstance(v, list) else v for name, v in shown.items()}
        again = draw(runtime, vdis[::-1], cameras[::-1], size, **turned)
        np.testing.assert_array_equal(again, image)
    # One table of planes for all is each one's
    table = ends["clipping_planes"]
    for_all, of_each = (
        draw(runtime, vdis, cameras, size, clipping_planes=planes)
        for planes in (table, [table] * 2)
    )
    np.testing.assert_array_equal(for_all, of_each)
    assert not np.array_equal(for_all, plain)


@in_two_ways
@pytest.mark.parametrize("count", [2, 4])
def test_the_order_of_the_vdis_changes_no_bit(runtime, count, dealt):
    vdis, cameras, size = scene([count, 10], "near", count)
    cut = [None, *([[[0, 0, 0, 1, 1, 1]]] * (count - 1))]
    images = [
        draw(
            runtime,
            [vdis[i] for i in order],
            [cameras[i] for i in order],
            size,
            clipping_planes=[cut[i] for i in order],
        ).tobytes()
        for order in itertools.permutations(range(count))
    ]
    assert len(set(images)) == 1


@in_two_ways
def test_passing_by_what_is_empty_changes_no_bit(runtime, monkeypatch, dealt):
    monkeypatch.setattr(OccupancyGrid, "worthwhile", True)
    vdis, cameras, size = scene(11, "beside")
    image = draw(runtime, vdis, cameras, size)
    assert np.array_equal(image, draw(runtime, vdis, cameras, size, skip_empty=False))


@in_two_ways
@pytest.mark.every(5)
@pytest.mark.parametrize("kind", strategies.VIEWS)
def test_a_vdi_in_parts_is_the_whole(runtime, kind, dealt):
    """Disjoint halves; the same medium twice, half as dense; itself and nothing.

    Where rays cross more than the first frame has room for, as lists of 200 do, it is drawn again,
    and the next frame has room for it.
    """
    rng = np.random.default_rng([strategies.VIEWS.index(kind), 13])
    vdi = strategies.random_vdi(rng, max_supersegments=200 if kind == "same" else 12)
    camera, size = strategies.random_view(rng, vdi, kind)
    whole = render_vdi(vdi, camera, size, device=runtime)
    assert whole.any()
    first = rng.random(vdi.n_supersegments) < 0.5
    every = np.ones(vdi.n_supersegments, dtype=bool)
    parts = {
        "disjoint": [with_some(vdi, first), with_some(vdi, ~first)],
        "half as dense": [with_some(vdi, every, 0.5), with_some(vdi, every, 0.5)],
        "a quarter, a quarter and a half": [with_some(vdi, every, s) for s in (0.25, 0.25, 0.5)],
        "itself and nothing": [vdi, with_some(vdi, ~every)],
    }
    for name, members in parts.items():
        image = render_vdis(members, camera, size, device=runtime)
        assert np.abs(image - whole).max() <= SAME, name
        np.testing.assert_array_equal(render_vdis(members, camera, size, device=runtime), image)


def test_one_vdi_is_drawn_as_ever(runtime):
    rng = np.random.default_rng(14)
    vdi = strategies.random_vdi(rng)
    camera, size = strategies.random_view(rng, vdi, "near")
    alone = render_vdi(vdi, camera, size, device=runtime)
    assert np.array_equal(pvdi.render([vdi], camera, size, device=runtime), alone)
    matrix = np.diag([2.0, 1.0, 0.5, 1.0])
    moved = camera.replace(model_transform=matrix)
    assert np.array_equal(
        pvdi.render(vdi, camera, size, model_transforms=[matrix], device=runtime),
        pvdi.render(vdi, moved, size, device=runtime),
    )


@in_two_ways
def test_a_far_one_keeps_its_picture_beside_a_near_one(runtime, dealt):
    """Their depths differ by 1e6 of their sizes, where float32 has no digits left for segments."""
    vdi = strategies.random_vdi(np.random.default_rng(15), camera=CAMERA, bounds=BOUNDS)
    # The same angle on the screen, a million times farther, and beside the near one's picture
    far, near = np.diag([1e6, 1e6, 1e6, 1.0]), np.eye(4)
    far[:3, 3] = (1.4e6, 0, -5e6 + 5)
    near[0, 3] = -1.2
    wide, size = CAMERA.replace(view_angle=60), (40, 30)
    both = pvdi.render([vdi, vdi], wide, size, model_transforms=[near, far], device=runtime)
    near, far = (
        pvdi.render(vdi, wide.replace(model_transform=m), size, device=runtime) for m in (near, far)
    )
    assert near.any()
    assert far.any()
    assert np.abs(both - (near + (1 - near[..., 3:]) * far)).max() <= SAME


@in_two_ways
def test_owners_are_the_first_that_surely_cover(runtime, dealt):
    """A pixel whose square a box does not cover wholly is the other's, if that one does."""
    camera = Camera((0, 0, 10), (0, 0, 0), (0, 1, 0), parallel_projection=True, parallel_scale=1.0)
    left, right = (  # the left one ends within a pixel, behind its centre
        PlacedVDI(slabs_vdi(camera, [9, 11], 1.0, bounds=(*ends, -1, 1, -1, 1), color=1), camera)
        for ends in ((-1.0, 0.07), (-0.5, 1.0))
    )
    size = (16, 16)  # an eighth of a unit per pixel
    first = owned_image([left, right], size, margin=9 / 16, device=runtime)
    assert (first.owner[1:-1, 1:8] == 0).all()
    assert (first.owner[1:-1, 8:-1] == 1).all()  # met by both in column 8, surely by the right one
    other = owned_image([right, left], size, margin=9 / 16, device=runtime)
    assert (other.owner[1:-1, 1:4] == 1).all()
    assert (other.owner[1:-1, 5:-1] == 0).all()
    assert np.array_equal(first.image, other.image)
    # Without margin the first that is met; where there is but one, it is that one's
    assert (owned_image([left, right], size, device=runtime).owner[:, 8] == 0).all()
    assert (owned_image([left, left], size, device=runtime).owner[:, 9:] == -1).all()
    assert (first.owner[:, 0] == 0).all()


def side_by_side(rng, precisions):
    """VDIs that overlap one after the other, in a window of many cells."""
    camera = Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), view_angle=40)
    placed = []
    for k in range(3):
        matrix = np.eye(4)
        matrix[:3, 3] = (1.9 * k - 1.9, 0.9 * k - 0.9, -0.2 * k)
        own = Camera((rng.uniform(-2, 2), rng.uniform(-2, 2), 6), (0, 0, 0), (0, 1, 0))
        vdi = strategies.random_vdi(rng, window=(96, 72), camera=own, bounds=BOUNDS)
        vdi = vdi.with_precision(precisions[k % len(precisions)])
        placed.append(PlacedVDI(vdi, camera.replace(model_transform=matrix)))
    return placed, (323, 187)


def of_cells(values, size):
    """A value for each cell, bottom row first, for each of its pixels, top row first."""
    return np.repeat(np.repeat(values, 16, axis=0), 16, axis=1)[: size[1], : size[0]][::-1]


@pytest.mark.every(6)
@pytest.mark.parametrize("precisions", [("exact",), ("exact", "8-byte")])
def test_where_no_two_are_met_each_is_drawn_as_by_itself(runtime, dealt, precisions, monkeypatch):
    placed, size = side_by_side(np.random.default_rng(17), precisions)
    depth = np.full(size[::-1], np.inf, np.float32)
    depth[60:110] = 8.5
    shown = {"opaque_depth": depth, "device": runtime}
    met = np.array(
        [
            cells_of_points(one.camera, size, prepared_vdi(runtime, one.vdi).occupancy.corners, 16)
            for one in placed
        ]
    )
    count = of_cells(met.sum(axis=0), size)
    assert set(np.unique(count)) >= {0, 1, 2}
    drawn = owned_image(placed, size, margin=0.5, **shown)
    seen, alone = drawn.image.any(axis=-1), 0
    for number, one in enumerate(placed):
        here = (count == 1) & of_cells(met[number], size)
        if dealt != "packets":  # whose rays two packets may share: those of another part differ
            own = render_vdi(one.vdi, one.camera, size, **shown)
            np.testing.assert_array_equal(drawn.image[here], own[here])
        np.testing.assert_array_equal(drawn.owner[here], np.where(seen, number, -1)[here])
        alone += (here & seen).any()
    assert alone >= 2
    assert not seen[count == 0].any()
    assert (drawn.owner[count == 0] == -1).all()
    # What several are met in is drawn as if several were met everywhere, and so is the rest; that
    # is drawn in bands of cells
    monkeypatch.setattr(multi_vdi, "cells_of_points", lambda *_: np.ones_like(met[0]))
    whole = owned_image(placed, size, margin=0.5, **shown)
    np.testing.assert_array_equal(whole.image[count > 1], drawn.image[count > 1])
    assert np.abs(whole.image - drawn.image).max() <= SAME
    np.testing.assert_array_equal(whole.owner, drawn.owner)
    turned = owned_image(placed[::-1], size, margin=0.5, **shown)
    np.testing.assert_array_equal(turned.image, whole.image)


def test_nothing_is_met_beside_a_vdi_s_cells(default_runtime):
    for seed in range(30):
        rng = np.random.default_rng([seed, 18])
        vdi = strategies.random_vdi(rng)
        camera, _ = strategies.random_view(rng, vdi, strategies.VIEWS[seed % len(strategies.VIEWS)])
        size = (int(rng.integers(1, 150)), int(rng.integers(1, 120)))
        corners = prepared_vdi(default_runtime, vdi).occupancy.corners
        met = cells_of_points(camera, size, corners, 16)
        assert met.shape == (-(-size[1] // 16), -(-size[0] // 16))
        image = render_vdi(vdi, camera, size, skip_empty=False, device=default_runtime)
        assert not image[~of_cells(met, size)].any(), seed


ONE = slabs_vdi(CAMERA, [4.5, 5.5], 0.7, bounds=BOUNDS)
WIDE = slabs_vdi(CAMERA, [4.5, 5.5], 0.7, window=(2, 1), bounds=BOUNDS)


CUTOFF = pvdi.Settings(transmittance_cutoff=0.1)


@pytest.mark.parametrize(
    ("vdis", "options", "message"),
    [
        ([], {}, "the sequence is empty"),
        ([ONE, WIDE], {}, "different window sizes"),
        ([ONE, ONE], {"model_transforms": [np.eye(4)]}, "one matrix for each of the 2 VDIs; got 1"),
        ([ONE, ONE], {"clipping_planes": [None]}, "for each of the 2 VDIs"),
        ([ONE, ONE], {"clipping_planes": 5}, "for each of the 2 VDIs"),
        ([ONE, ONE], {"cropping": BOUNDS}, "a list with an entry for each of the 2 VDIs"),
        ([ONE, ONE], {"opacity_multiplier": [1.0]}, "or one for each of the 2 VDIs"),
        ([ONE, ONE], {"preview_samples": 9}, "preview_samples is for a single VDI"),
        ([ONE, ONE], {"settings": CUTOFF}, "transmittance_cutoff is for a single VDI"),
    ],
)
def test_what_cannot_be_drawn_is_refused(vdis, options, message):
    with pytest.raises(InvalidArgumentError, match=message):
        pvdi.render(vdis, CAMERA, **options)


def test_what_is_no_vdi_is_refused():
    with pytest.raises(InvalidArgumentError, match="expected VDIs, got str"):
        render_vdis([ONE, "x"], CAMERA, (1, 1))
