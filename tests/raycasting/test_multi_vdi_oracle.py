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
from drawing import owned_image, render_vdis
from extreme_scenes import slabs_vdi
from oracle import assert_explained
from ray_scenes import random_ends, reciprocal_vdi

import pyvista_vdi as pvdi
from pyvista_vdi import Camera, Cropping, InvalidArgumentError
from pyvista_vdi.raycasting.multi_vdi import PlacedVDI
from pyvista_vdi.raycasting.prepared import OccupancyGrid

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
    first = reciprocal_vdi(rng, max_window=(14, 11))
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
        vdis.append(reciprocal_vdi(rng, bounds.ravel(), max_window=(14, 11)))
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


@pytest.mark.parametrize(
    ("kind", "dealt", "skip"),
    [
        ("near", "blocks", False),
        ("half", "one by one", True),
        ("beside", "blocks", False),
        ("inside", "one by one", True),
        ("far", "blocks", False),
    ],
    indirect=["dealt"],
)
def test_every_pixel_is_within_the_range_of_the_moved_rays(runtime, kind, dealt, skip, monkeypatch):
    monkeypatch.setattr(OccupancyGrid, "worthwhile", skip)
    moved = drawn = pixels = 0
    for case in range(3):
        seed = [case, strategies.VIEWS.index(kind), 7]
        vdis, cameras, size = scene(seed, kind, 2 + case % 2)
        if case == 2:  # of several cells, in some of which but one is met; and another form
            vdis[1], size = vdis[1].with_precision("8-byte"), (2 * size[0], 40)
        image = draw(runtime, vdis, cameras, size)
        result = check(vdis, cameras, size, image, f"seed {seed}, view {kind!r}")
        moved, drawn, pixels = moved + result.moved, drawn + result.drawn, pixels + result.pixels
    assert drawn > pixels / 20  # a comparison of nothing with nothing proves nothing
    assert moved <= MAX_SHARE.get(kind, 0.01) * pixels


@pytest.mark.parametrize(
    ("kind", "dealt"), [("around", "blocks"), ("near", "one by one")], indirect=["dealt"]
)
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
        "cropping": [fence, cross if kind == "around" else None],
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
def test_the_order_of_the_vdis_changes_no_bit(runtime, dealt):
    count = 3
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
