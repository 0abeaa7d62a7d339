"""Several VDIs together, on the device: against the float64 oracle, and against one VDI alone.

As in ``test_raycast_oracle``, every pixel lies within a tolerance of the oracle's range over rays
moved by the roundings of list coordinates, each VDI's on its own. The tolerance is twice that of a
single VDI: where two overlap, a ray composites twice as many pieces, and each has four more
roundings (its share of a segment, the sums of two, the mean colour), which mostly cancel.
"""

from __future__ import annotations

import functools
import itertools

import numpy as np
import pytest
import strategies
from drawing import owned_image, render_vdi, render_vdis

import pyvista_vdi as pvdi
from pyvista_vdi import reference
from pyvista_vdi.device.ray_forms import cells_of_points
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.cropping import Cropping
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting import multi_vdi
from pyvista_vdi.raycasting.placed import PlacedVDI
from pyvista_vdi.raycasting.prepared import prepared_vdi

#: Largest difference per channel from the oracle; see above.
TOLERANCE = 4e-5

#: Largest difference of what is the same medium in exact arithmetic: what lies behind a
#: transmittance of 1e-6 may be dropped, and as many roundings as above.
SAME = 2e-5

#: Cases per kind of view.
N_CASES = 5

#: Sets of moved rays tried in turn for a pixel beyond the fixed ones, and for how many pixels.
ESCALATION = (0, 300, 3000)
MAX_PIXELS = (100, 20, 3)


def scene(rng, kind, count):
    """VDIs of different generating views whose bounds overlap, a new view of them, its size."""
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


def failures(vdis, cameras, size, image, name, **ends):
    """Say which pixels no rays within rounding explain; and how many the unmoved ones do not."""
    exact = reference.render_joint(vdis, cameras, size, **ends)
    assert image.shape == exact.shape
    differs = ~(np.abs(image - exact).max(axis=-1) <= TOLERANCE)  # NaN differs
    rows, columns = np.nonzero(differs)
    pixels = [(int(x), size[1] - 1 - int(row)) for row, x in zip(rows, columns, strict=True)]
    drawn = image[differs].astype(np.float64)
    low = high = drawn
    for n_random, most in zip(ESCALATION, MAX_PIXELS, strict=True):
        if not pixels or len(pixels) > most:
            break
        low, high = reference.render_joint_range(
            vdis, cameras, size, pixels, n_random=n_random, **ends
        )
        outside = ~((drawn >= low - TOLERANCE) & (drawn <= high + TOLERANCE)).all(axis=1)
        pixels = [p for p, out in zip(pixels, outside, strict=True) if out]
        drawn, low, high = drawn[outside], low[outside], high[outside]
    said = [
        f"{name}: pixel {p} drawn {d}, oracle between {a} and {b}"
        for p, d, a, b in zip(pixels, drawn, low, high, strict=True)
    ]
    return said, int(differs.sum()), int((exact[..., 3] > TOLERANCE).sum())


#: Ways in which rays are followed that differ where several VDIs are drawn together.
DEALT = ("one by one", "blocks")


@pytest.fixture(params=DEALT)
def _dealt(request, monkeypatch):
    strategies.deal_rays(monkeypatch, request.param)


@functools.cache
def compare(runtime, kind, dealt):
    """All cases of one kind of view: failures, pixels that need moved rays, seen, and all."""
    with pytest.MonkeyPatch.context() as patch:
        strategies.deal_rays(patch, dealt)
        return compare_cases(runtime, kind)


def compare_cases(runtime, kind):
    said, moved, seen, pixels = [], 0, 0, 0
    for case in range(N_CASES):
        seed = [case, strategies.VIEWS.index(kind), 7]
        vdis, cameras, size = scene(np.random.default_rng(seed), kind, 2 + case % 2)
        image = draw(runtime, vdis, cameras, size)
        result = failures(vdis, cameras, size, image, f"seed {seed}, view {kind!r}")
        said += result[0]
        moved += result[1]
        seen += result[2]
        pixels += size[0] * size[1]
        if said:  # one is enough to see why
            break
    return said, moved, seen, pixels


@pytest.mark.every(6)
@pytest.mark.parametrize("dealt", DEALT)
@pytest.mark.parametrize("kind", strategies.VIEWS)
def test_every_pixel_is_within_the_range_of_the_moved_rays(runtime, kind, dealt):
    said, _, seen, pixels = compare(runtime, kind, dealt)
    assert not said, "\n".join(said)
    assert seen > pixels / 10  # a comparison of nothing with nothing proves nothing


@pytest.mark.every(3)
@pytest.mark.parametrize("dealt", DEALT)
def test_few_pixels_need_moved_rays(runtime, dealt):
    results = {kind: compare(runtime, kind, dealt) for kind in strategies.VIEWS}
    for kind, (_, moved, _, pixels) in results.items():
        print(f"{kind:9s}: {moved} of {pixels} pixels need moved rays")
    moved, pixels = (sum(r[i] for r in results.values()) for i in (1, 3))
    assert moved / pixels <= 0.04  # twice the bound of a single VDI: two rays may be moved


@pytest.mark.usefixtures("_dealt")
@pytest.mark.parametrize("case", range(4))
def test_opaque_depth_and_each_vdi_s_own_clipping_planes(runtime, case):
    rng = np.random.default_rng([case, 8])
    kind = ("around", "parallel", "near", "inside")[case]
    vdis, cameras, size = scene(rng, kind, 2)
    near, far = strategies.view_depths(cameras[0], vdis[0].bounds)
    depth = rng.uniform(near, far, size=size[::-1]).astype(np.float32)
    depth[rng.random(depth.shape) < 0.3] = np.inf
    corners = strategies.world_corners(vdis[0].bounds, cameras[0].model_transform)
    point = rng.uniform(corners.min(axis=0), corners.max(axis=0))
    cut = [None, np.hstack([point, rng.normal(size=3)])[np.newaxis]]
    if case % 2:
        cut.reverse()
    ends = {"opaque_depth": depth, "clipping_planes": cut}
    image = draw(runtime, vdis, cameras, size, **ends)
    said, _, seen = failures(vdis, cameras, size, image, f"seed {case}", **ends)
    assert not said, "\n".join(said)
    assert seen


@pytest.mark.every(3)
@pytest.mark.usefixtures("_dealt")
@pytest.mark.parametrize("case", range(4))
def test_each_vdi_s_own_cropping_and_density(runtime, case):
    rng = np.random.default_rng([case, 16])
    kind = ("around", "parallel", "near", "inside")[case]
    vdis, cameras, size = scene(rng, kind, 2)
    low, high = np.reshape(vdis[0].bounds, (3, 2)).T
    cuts = low + np.sort(rng.uniform(0.1, 0.9, size=(2, 3)), axis=0) * (high - low)
    croppings = [
        Cropping(cuts.T.ravel(), regions) for regions in ("subvolume", "inverted_fence", "cross")
    ]
    looks = {
        "cropping": [croppings[1 + case % 2], (croppings[0], None)[case % 2]],
        "opacity_multiplier": [1.0, float(rng.uniform(0.2, 3))],
    }
    if case >= 2:
        looks = {name: values[::-1] for name, values in looks.items()}
    image = draw(runtime, vdis, cameras, size, **looks)
    said, _, seen = failures(vdis, cameras, size, image, f"seed {case}", **looks)
    assert not said, "\n".join(said)
    assert seen
    turned = {name: values[::-1] for name, values in looks.items()}
    assert np.array_equal(image, draw(runtime, vdis[::-1], cameras[::-1], size, **turned))
    assert not np.array_equal(image, draw(runtime, vdis, cameras, size))


def test_planes_for_all_are_each_one_s_planes(runtime):
    vdis, cameras, size = scene(np.random.default_rng(9), "around", 2)
    corners = strategies.world_corners(vdis[0].bounds, cameras[0].model_transform)
    table = [[*corners.mean(axis=0), 1.0, 0.2, -0.4]]
    image = draw(runtime, vdis, cameras, size, clipping_planes=table)
    assert np.array_equal(image, draw(runtime, vdis, cameras, size, clipping_planes=[table, table]))
    assert not np.array_equal(image, draw(runtime, vdis, cameras, size))


@pytest.mark.usefixtures("_dealt")
@pytest.mark.parametrize("count", [2, 3, 4])
def test_the_order_of_the_vdis_changes_no_bit(runtime, count):
    vdis, cameras, size = scene(np.random.default_rng([count, 10]), "near", count)
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


@pytest.mark.every(3)
@pytest.mark.usefixtures("_dealt")
def test_passing_by_what_is_empty_changes_no_bit(runtime, monkeypatch):
    monkeypatch.setattr("pyvista_vdi.raycasting.occupancy._WORTHWHILE", np.inf)
    vdis, cameras, size = scene(np.random.default_rng(11), "beside", 2)
    image = draw(runtime, vdis, cameras, size)
    assert np.array_equal(image, draw(runtime, vdis, cameras, size, skip_empty=False))


@pytest.mark.usefixtures("_dealt")
def test_bands_and_room_for_segments_change_no_bit(runtime, monkeypatch):
    vdis, cameras, _ = scene(np.random.default_rng(12), "near", 3)
    size = (61, 37)
    image = draw(runtime, vdis, cameras, size)
    monkeypatch.setattr(multi_vdi, "_FIRST_SLOTS", 1)
    for room in ("_POOL_BYTES", "_POOL_BYTES_CPU"):
        monkeypatch.setattr(multi_vdi, room, 1)  # a cell in a band
    multi_vdi._slots.clear()
    assert np.array_equal(image, draw(runtime, vdis, cameras, size))
    assert multi_vdi._slots[vdis[0]] > 1
    assert np.array_equal(image, draw(runtime, vdis, cameras, size))


def with_lists(vdi, keep, share=1.0):
    """The VDI with only some of its supersegments, and a share of their optical depths."""
    owner = np.repeat(np.arange(len(vdi.offsets) - 1), np.diff(vdi.offsets.astype(int)))
    counts = np.bincount(owner[keep], minlength=len(vdi.offsets) - 1)
    return VDI(
        vdi.camera,
        vdi.window_size,
        np.concatenate(([0], np.cumsum(counts))).astype(np.uint64),
        vdi.front[keep],
        vdi.back[keep],
        vdi.color[keep],
        vdi.optical_depth[keep] * np.float32(share),
        vdi.bounds,
        depth_origin=vdi.depth_origin,
    )


@pytest.mark.every(5)
@pytest.mark.usefixtures("_dealt")
@pytest.mark.parametrize("kind", strategies.VIEWS)
def test_a_vdi_in_parts_is_the_whole(runtime, kind):
    """Disjoint halves; the same medium twice, half as dense; itself and nothing."""
    rng = np.random.default_rng([strategies.VIEWS.index(kind), 13])
    vdi = strategies.random_vdi(rng)
    camera, size = strategies.random_view(rng, vdi, kind)
    whole = render_vdi(vdi, camera, size, device=runtime)
    assert whole.any()
    first = rng.random(vdi.n_supersegments) < 0.5
    every = np.ones(vdi.n_supersegments, dtype=bool)
    parts = {
        "disjoint": [with_lists(vdi, first), with_lists(vdi, ~first)],
        "half as dense": [with_lists(vdi, every, 0.5), with_lists(vdi, every, 0.5)],
        "a quarter, a quarter and a half": [with_lists(vdi, every, s) for s in (0.25, 0.25, 0.5)],
        "itself and nothing": [vdi, with_lists(vdi, ~every)],
    }
    for name, members in parts.items():
        image = render_vdis(members, camera, size, device=runtime)
        assert np.abs(image - whole).max() <= SAME, name


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


@pytest.mark.usefixtures("_dealt")
def test_a_far_one_keeps_its_picture_beside_a_near_one(runtime):
    """Their depths differ by 1e6 of their sizes, where float32 has no digits left for segments."""
    rng = np.random.default_rng(15)
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0))
    bounds = (-1, 1, -1, 1, -1, 1)
    vdi = strategies.random_vdi(rng, camera=camera, bounds=bounds)
    # The same angle on the screen, a million times farther, and beside the near one's picture
    matrix = np.diag([1e6, 1e6, 1e6, 1.0])
    matrix[:3, 3] = (1.4e6, 0, -5e6 + 5)
    near_only = np.diag([1.0, 1.0, 1.0, 1.0])
    near_only[0, 3] = -1.2
    wide = camera.replace(view_angle=60)
    size = (40, 30)
    both = pvdi.render([vdi, vdi], wide, size, model_transforms=[near_only, matrix], device=runtime)
    near, far = (
        pvdi.render(vdi, wide.replace(model_transform=m), size, device=runtime)
        for m in (near_only, matrix)
    )
    assert near.any()
    assert far.any()
    over = near + (1 - near[..., 3:]) * far
    assert np.abs(both - over).max() <= SAME


@pytest.mark.usefixtures("_dealt")
def test_owners_are_the_first_that_surely_cover(runtime):
    """A pixel whose square a box does not cover wholly is the other's, if that one does."""
    camera = Camera((0, 0, 10), (0, 0, 0), (0, 1, 0), parallel_projection=True, parallel_scale=1.0)

    def slab(x0, x1):
        bounds = (x0, x1, -1, 1, -1, 1)
        return VDI(camera, (1, 1), [0, 1], [9.0], [11.0], [[1, 1, 1]], [1.0], bounds)

    size = (16, 16)  # an eighth of a unit per pixel
    left = PlacedVDI(slab(-1.0, 0.07), camera)  # ends within a pixel, behind its centre
    right = PlacedVDI(slab(-0.5, 1.0), camera)
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


def side_by_side(rng, count, precisions=("exact",)):
    """VDIs that overlap one after the other, in a window of many cells."""
    camera = Camera((0, 0, 9), (0, 0, 0), (0, 1, 0), view_angle=40)
    bounds = (-1, 1, -1, 1, -1, 1)
    placed = []
    for k in range(count):
        matrix = np.eye(4)
        matrix[:3, 3] = (1.9 * k - 0.95 * (count - 1), 0.9 * k - 0.9, -0.2 * k)
        own = Camera((rng.uniform(-2, 2), rng.uniform(-2, 2), 6), (0, 0, 0), (0, 1, 0))
        vdi = strategies.random_vdi(rng, window=(96, 72), camera=own, bounds=bounds)
        vdi = vdi.with_precision(precisions[k % len(precisions)])
        placed.append(PlacedVDI(vdi, camera.replace(model_transform=matrix)))
    return placed, (323, 187)


@pytest.mark.every(6)
@pytest.mark.parametrize("dealt", strategies.DEALT)
@pytest.mark.parametrize("precisions", [("exact",), ("exact", "16-byte", "8-byte")])
def test_where_no_two_are_met_each_is_drawn_as_by_itself(runtime, dealt, precisions, monkeypatch):
    strategies.deal_rays(monkeypatch, dealt)
    placed, size = side_by_side(np.random.default_rng(17), 3, precisions)
    depth = np.full(size[::-1], np.inf, np.float32)
    depth[60:110] = 8.5
    found = []
    of_cells = multi_vdi._Cells.of.__func__
    monkeypatch.setattr(
        multi_vdi._Cells,
        "of",
        classmethod(lambda cls, *args: found.append(of_cells(cls, *args)) or found[-1]),
    )
    drawn = owned_image(placed, size, opaque_depth=depth, margin=0.5, device=runtime)
    alone = np.repeat(np.repeat(found[0].alone, 16, axis=0), 16, axis=1)[: size[1], : size[0]][::-1]
    assert set(np.unique(alone)) == {-2, -1, 0, 1, 2}
    met = 0
    for number, one in enumerate(placed):
        here = alone == number
        if dealt != "packets":  # whose rays two packets may share: those of another part differ
            own = render_vdi(one.vdi, one.camera, size, opaque_depth=depth, device=runtime)
            np.testing.assert_array_equal(drawn.image[here], own[here])
        seen = drawn.image.any(axis=-1)
        np.testing.assert_array_equal(drawn.owner[here], np.where(seen, number, -1)[here])
        met += (here & seen).any()
    assert met >= 2
    assert not drawn.image[alone == -2].any()
    assert (drawn.owner[alone == -2] == -1).all()
    # What several are met in is drawn as if several were met everywhere, and so is the rest
    monkeypatch.setattr(multi_vdi, "cells_of_points", lambda *_: np.ones_like(found[0].alone, bool))
    whole = owned_image(placed, size, opaque_depth=depth, margin=0.5, device=runtime)
    np.testing.assert_array_equal(whole.image[alone == -1], drawn.image[alone == -1])
    assert np.abs(whole.image - drawn.image).max() <= SAME
    np.testing.assert_array_equal(whole.owner, drawn.owner)
    turned = owned_image(placed[::-1], size, opaque_depth=depth, margin=0.5, device=runtime)
    np.testing.assert_array_equal(turned.image, whole.image)


def test_nothing_is_met_beside_a_vdi_s_cells(default_runtime):
    for seed in range(40):
        rng = np.random.default_rng([seed, 18])
        vdi = strategies.random_vdi(rng)
        camera, _ = strategies.random_view(rng, vdi, strategies.VIEWS[seed % len(strategies.VIEWS)])
        size = (int(rng.integers(1, 150)), int(rng.integers(1, 120)))
        corners = prepared_vdi(default_runtime, vdi).occupancy.corners
        met = cells_of_points(camera, size, corners)
        assert met.shape == (-(-size[1] // 16), -(-size[0] // 16))
        image = render_vdi(vdi, camera, size, skip_empty=False, device=default_runtime)[::-1]
        cells = np.repeat(np.repeat(met, 16, axis=0), 16, axis=1)[: size[1], : size[0]]
        assert not image[~cells].any(), seed


def test_what_cannot_be_drawn_is_refused(default_runtime):
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0))
    bounds = (-1, 1, -1, 1, -1, 1)
    one = VDI(camera, (1, 1), [0, 1], [4.5], [5.5], [[0.2, 0.5, 0.9]], [0.7], bounds)
    wide = VDI(camera, (2, 1), [0, 1, 1], [4.5], [5.5], [[0.2, 0.5, 0.9]], [0.7], bounds)
    with pytest.raises(InvalidArgumentError, match="the sequence is empty"):
        pvdi.render([], camera)
    with pytest.raises(InvalidArgumentError, match="different window sizes"):
        pvdi.render([one, wide], camera)
    with pytest.raises(InvalidArgumentError, match="one matrix for each of the 2 VDIs; got 1"):
        pvdi.render([one, one], camera, model_transforms=[np.eye(4)])
    with pytest.raises(InvalidArgumentError, match="for each of the 2 VDIs"):
        pvdi.render([one, one], camera, clipping_planes=[None])
    with pytest.raises(InvalidArgumentError, match="for each of the 2 VDIs"):
        pvdi.render([one, one], camera, clipping_planes=5)
    with pytest.raises(InvalidArgumentError, match="a list with an entry for each of the 2 VDIs"):
        pvdi.render([one, one], camera, cropping=(0, 1, 0, 1, 0, 1))
    with pytest.raises(InvalidArgumentError, match="or one for each of the 2 VDIs"):
        pvdi.render([one, one], camera, opacity_multiplier=[1.0])
    with pytest.raises(InvalidArgumentError, match="preview_samples is for a single VDI"):
        pvdi.render([one, one], camera, preview_samples=9)
    with pytest.raises(InvalidArgumentError, match="expected VDIs, got str"):
        render_vdis([one, "x"], camera, (1, 1))
