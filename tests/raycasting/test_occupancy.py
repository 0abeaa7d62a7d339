"""The occupancy grid against a count by NumPy in float64, on every device."""

from __future__ import annotations

import math

import numpy as np
import pytest
import strategies
from drawing import draw

from pyvista_vdi import read
from pyvista_vdi.device import ray_forms as rays
from pyvista_vdi.device.constants import SLABS, STACK
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting import occupancy
from pyvista_vdi.raycasting.prepared import PreparedVDI

#: Seeds of random VDIs per kind.
N_CASES = 6


def grid_of(runtime, vdi):
    """The grid, its counts and its masks: int64 and bool (tiles high, tiles wide, slabs)."""
    grid = PreparedVDI(runtime, vdi).occupancy
    counts = runtime.download(grid.counts).astype(np.int64)
    masks = runtime.download(grid.masks)
    bits = (masks[..., None] >> np.arange(SLABS, dtype=np.uint64)) & np.uint64(1)
    return grid, counts, bits.astype(bool)


def counted(vdi, first_depth, slabs_per_depth, reach):
    """Supersegments in each cell if they reach ``reach`` (n,) further than their faces, int64.

    ``first_depth`` in world units less the VDI's depth origin.
    """
    width, height = vdi.window_size
    tiles = (-(-height // STACK), -(-width // STACK))
    lists = np.repeat(np.arange(width * height), np.diff(vdi.offsets).astype(np.int64))
    tile = lists // width // STACK * tiles[1] + lists % width // STACK
    front, back = vdi.front.astype(np.float64) - reach, vdi.back.astype(np.float64) + reach
    first, last = (
        np.clip(np.floor((face - first_depth) * slabs_per_depth), 0, SLABS - 1).astype(np.int64)
        for face in (front, back)
    )
    # One more where a supersegment begins, one less behind where it ends; sums are the counts
    changes = np.zeros((tiles[0] * tiles[1], SLABS + 1), np.int64)
    np.add.at(changes, (tile, first), 1)
    np.add.at(changes, (tile, last + 1), -1)
    return changes[:, :-1].cumsum(axis=1).reshape(*tiles, SLABS)


def check(runtime, vdi):
    """Compare with NumPy's count; return the share of cells on which rounding has no say."""
    grid, counts, occupied = grid_of(runtime, vdi)
    assert counts.shape == (*grid.stacks[::-1], SLABS)
    assert np.array_equal(occupied, counts > 0)
    # The kernel's numbers; its roundings: of a face less the margin, less the first depth (half a
    # unit in the last place of each difference), and of a slab number up to 64. A face is twice as
    # precise as what adds up here
    first, per_depth, margin = (
        float(np.float32(n)) for n in (grid.first_depth, grid.slabs_per_depth, grid.margin)
    )
    size = np.maximum(np.abs(vdi.front), np.abs(vdi.back)) + abs(first) + margin
    rounding = 2.0**-23 * (size + SLABS / per_depth)
    least = counted(vdi, first, per_depth, margin - rounding)
    most = counted(vdi, first, per_depth, margin + rounding)
    assert (least <= counts).all()
    assert (counts <= most).all()
    # Nothing that a supersegment reaches is left out, wherever slabs begin by float64
    near, far = rays.depth_range(vdi.camera, vdi.bounds)
    near = near if vdi.camera.parallel_projection else max(near, 0)
    if far > near:
        slabs = SLABS / (far - near)
        reached = counted(vdi, near - vdi.depth_origin, slabs, np.full(len(size), -margin / 4))
        assert (counts >= reached).all()
    return (least == most).mean()


def outside(rng, bounds, **options):
    options = {"distance": 3, "parallel": False, **options}
    return strategies.camera_around(rng, bounds, np.eye(4), **options)


def perspective(rng, bounds):
    return outside(rng, bounds)


def parallel(rng, bounds):
    return outside(rng, bounds, parallel=True)


def long_lens(rng, bounds):
    return outside(rng, bounds, distance=60)


def very_long_lens(rng, bounds):
    return outside(rng, bounds, distance=1e4)


def inside(rng, bounds):
    """The near depth is that of the eye."""
    return strategies.camera_inside(rng, bounds, np.eye(4))


def any_matrix(rng, bounds):
    transform = strategies.random_transform(rng, rng.choice(["scale", "mirror", "shear"]))
    return strategies.camera_around(rng, bounds, transform)


@pytest.mark.every(4)
@pytest.mark.parametrize(
    "view", [perspective, parallel, long_lens, very_long_lens, inside, any_matrix]
)
@pytest.mark.parametrize("away", [0.0, 1e5])
def test_counts_of_random_vdis(runtime, view, away):
    """Supersegments that touch, that are thinner than a slab, and that reach beyond the bounds;
    bounds at the origin and 1e5 of their size away from it; windows that tiles do not divide."""
    shares = []
    for case in range(N_CASES):
        rng = np.random.default_rng([case, 20])
        bounds = strategies.random_bounds(rng) + np.repeat(rng.normal(size=3) * away, 2)
        vdi = strategies.random_vdi(
            rng, max_window=(70, 50), camera=view(rng, bounds), bounds=bounds
        )
        share = check(runtime, vdi)
        # Depths that are counted from an eye 1e4 radii away are rounded by a good part of a slab
        if view is not very_long_lens or vdi.depth_origin:
            shares.append(share)
    assert min(shares) > 0.9


@pytest.mark.parametrize("window", [(1, 1), (15, 1), (16, 16), (17, 16), (1, 33), (100, 31)])
def test_windows_that_tiles_do_not_divide(runtime, window):
    rng = np.random.default_rng([*window, 21])
    bounds = strategies.random_bounds(rng)
    vdi = strategies.random_vdi(rng, camera=perspective(rng, bounds), bounds=bounds)
    lengths = rng.integers(0, 3, size=window[0] * window[1])
    n = lengths.sum()
    near, far = rays.depth_range(vdi.camera, bounds)
    step = (far - near) / 8
    starts = near + step * (2 * np.concatenate([np.arange(k) for k in lengths]) + rng.random(n))
    vdi = VDI(
        vdi.camera,
        window,
        np.concatenate([[0], np.cumsum(lengths)]),
        starts - near,
        starts - near + step * rng.uniform(0.01, 1, size=n),
        np.zeros((n, 3)),
        np.ones(n),
        bounds,
        depth_origin=near,
    )
    grid, counts, _ = grid_of(runtime, vdi)
    assert grid.stacks == (math.ceil(window[0] / STACK), math.ceil(window[1] / STACK))
    assert counts.sum() >= n
    check(runtime, vdi)


# -- by hand ---------------------------------------------------------------------------------------

#: Parallel projection along -z; bounds from depth 0 to 64, so that a slab is one unit thick.
CAMERA = Camera((0, 0, 32), (0, 0, 0), (0, 1, 0), parallel_projection=True, parallel_scale=10)
BOUNDS = (-50, 50, -50, 50, -32, 32)


def by_hand(lists, window, camera=CAMERA, bounds=BOUNDS, **options):
    """A VDI of lists of (front, back)."""
    faces = np.array([face for faces in lists for face in faces], np.float64).reshape(-1, 2)
    n = len(faces)
    lengths = [len(faces) for faces in lists]
    offsets = np.concatenate([[0], np.cumsum(lengths, dtype=np.int64)]).astype(np.uint64)
    colors = np.zeros((n, 3))
    return VDI(camera, window, offsets, *faces.T, colors, np.ones(n), bounds, **options)


def occupied_slabs(runtime, *faces):
    _, counts, _ = grid_of(runtime, by_hand([faces], (1, 1)))
    return {int(slab): int(counts[0, 0, slab]) for slab in np.flatnonzero(counts)}


def test_a_supersegment_counts_in_every_slab_that_it_reaches(runtime):
    assert occupied_slabs(runtime, (3.25, 3.75)) == {3: 1}
    assert occupied_slabs(runtime, (3.25, 6.75)) == {3: 1, 4: 1, 5: 1, 6: 1}
    assert occupied_slabs(runtime, (3.25, 3.5), (3.5, 4.5), (5.5, 5.75)) == {3: 2, 4: 1, 5: 1}


def test_a_face_on_a_slabs_face_counts_on_both_sides(runtime):
    grid, _, _ = grid_of(runtime, by_hand([[]], (1, 1)))
    assert 1e-5 < grid.margin < 1e-3  # slabs
    inside, outside = grid.margin / 2, grid.margin * 2
    assert occupied_slabs(runtime, (3.0, 3.5)) == {2: 1, 3: 1}
    assert occupied_slabs(runtime, (3.0 + inside, 3.5)) == {2: 1, 3: 1}
    assert occupied_slabs(runtime, (3.0 + outside, 3.5)) == {3: 1}
    assert occupied_slabs(runtime, (3.5, 4.0)) == {3: 1, 4: 1}
    assert occupied_slabs(runtime, (3.5, 4.0 - inside)) == {3: 1, 4: 1}
    assert occupied_slabs(runtime, (3.5, 4.0 - outside)) == {3: 1}


def test_what_is_beyond_the_bounds_counts_at_their_ends(runtime):
    assert occupied_slabs(runtime, (-9, -8), (0.25, 0.5)) == {0: 2}
    assert occupied_slabs(runtime, (63.5, 63.75), (70, 1e9)) == {63: 2}
    assert list(occupied_slabs(runtime, (-1e9, 1e9))) == list(range(SLABS))


def test_a_list_counts_in_its_own_tile(runtime):
    """Tiles begin at list (0, 0), bottom left; the last column and the last row are cut off."""
    width, height = window = (40, 20)
    for x, y, tile in [(0, 0, (0, 0)), (15, 15, (0, 0)), (16, 15, (0, 1)), (39, 19, (1, 2))]:
        lists = [[] for _ in range(width * height)]
        lists[y * width + x] = [(3.25, 3.75)]
        _, counts, _ = grid_of(runtime, by_hand(lists, window))
        assert counts.shape == (2, 3, SLABS)
        assert counts.sum() == 1
        assert counts[(*tile, 3)] == 1


def test_slabs_are_equal_in_view_depth_in_perspective(runtime):
    camera = CAMERA.replace(position=(0, 0, 36), parallel_projection=False)
    bounds = (-1, 1, -1, 1, -32, 32)  # depths 4 to 68
    vdi = by_hand([[(4.25, 4.5), (40.25, 40.5), (67.25, 67.5)]], (1, 1), camera, bounds)
    _, counts, _ = grid_of(runtime, vdi)
    assert np.flatnonzero(counts[0, 0]).tolist() == [0, 36, 63]


def test_the_depth_origin_changes_nothing(runtime):
    lists = [[(3.25, 3.75), (40.5, 50.5)]]
    _, counts, _ = grid_of(runtime, by_hand(lists, (1, 1)))
    moved = [[(front - 16, back - 16) for front, back in lists[0]]]
    _, same, _ = grid_of(runtime, by_hand(moved, (1, 1), depth_origin=16))
    assert np.array_equal(counts, same)


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_slabs_follow_the_bounds_and_not_constants(runtime, scale):
    lists = [[(3.25, 3.75), (40.5, 50.5)]]
    _, counts, _ = grid_of(runtime, by_hand(lists, (1, 1)))
    camera = CAMERA.replace(
        position=np.multiply(CAMERA.position, scale), parallel_scale=CAMERA.parallel_scale * scale
    )
    scaled = by_hand(np.multiply(lists, scale), (1, 1), camera, np.multiply(BOUNDS, scale))
    _, same, _ = grid_of(runtime, scaled)
    assert np.array_equal(counts, same)


@pytest.mark.parametrize("view", [CAMERA, CAMERA.replace(parallel_projection=False)])
def test_bounds_without_depth(runtime, view):
    """All of it is within reach of rays: nothing may be taken for empty where they are."""
    bounds = (-1, 1, -1, 1, 0, 0)  # at depth 32
    vdi = by_hand([[(31.99, 32.01)]], (1, 1), view, bounds)
    grid, counts, _ = grid_of(runtime, vdi)
    assert counts[0, 0, 0] == 1
    assert np.isfinite(grid.occupied)


def test_bounds_behind_the_eye(runtime):
    camera = Camera((0, 0, 5), (0, 0, 10), (0, 1, 0))
    vdi = by_hand([[]] * 4, (2, 2), camera, (-1, 1, -1, 1, -1, 1))
    grid, counts, occupied = grid_of(runtime, vdi)
    assert not counts.any()
    assert not occupied.any()
    assert np.isfinite(grid.occupied)


# -- where in a window it is -----------------------------------------------------------------------


def only_within(rng, vdi):
    """The VDI with the lists of a random rectangle of its window alone."""
    width, height = vdi.window_size
    kept = np.zeros((height, width), bool)
    (x0, x1), (y0, y1) = (np.sort(rng.integers(0, edge + 1, 2)) for edge in (width, height))
    kept[y0:y1, x0:x1] = True
    lengths = np.diff(vdi.offsets).astype(np.int64)
    own = np.repeat(kept.ravel(), lengths)
    return VDI(
        vdi.camera,
        vdi.window_size,
        np.concatenate(([0], np.cumsum(np.where(kept.ravel(), lengths, 0)))).astype(np.uint64),
        vdi.front[own],
        vdi.back[own],
        vdi.color[own],
        vdi.optical_depth[own],
        vdi.bounds,
        depth_origin=vdi.depth_origin,
    )


@pytest.mark.every(6)
@pytest.mark.parametrize("kind", strategies.VIEWS)
def test_nothing_is_seen_beside_the_occupied_cells(runtime, kind):
    """Pictures by all rays, and where the cells' corners are: V_O in all the ways of above."""
    size = (90, 70)
    smaller = 0
    for case, view in enumerate(
        [perspective, parallel, long_lens, very_long_lens, inside, any_matrix] * 2
    ):
        rng = np.random.default_rng([case, 23])
        bounds = strategies.random_bounds(rng)
        vdi = only_within(
            rng,
            strategies.random_vdi(
                rng,
                max_window=(120, 90),
                max_supersegments=2,
                camera=view(rng, bounds),
                bounds=bounds,
            ),
        )
        camera, _ = strategies.random_view(rng, vdi, kind)
        prepared = PreparedVDI(runtime, vdi)
        images = []
        for skip_empty in (False, True):
            with runtime.buffer((size[1], size[0], 4)) as image:
                draw(prepared, camera, size, image, skip_empty=skip_empty)
                images.append(runtime.download(image))
        assert np.array_equal(*images)
        part = rays.pixels_of_points(camera, size, prepared.occupancy.corners)
        rows, x = np.nonzero(images[0][..., 3])
        y = size[1] - 1 - rows
        assert ((x >= part.x0) & (x < part.x1) & (y >= part.y0) & (y < part.y1)).all()
        smaller += part.pixels < size[0] * size[1]
    # An eye inside of V_O's frustum may have a corner behind it: then it is all of the window
    assert smaller


def test_rays_beside_the_occupied_cells_are_not_cast(runtime, monkeypatch):
    """Both pictures are the same, so that only the choice can be seen: by corners that lie."""
    prepared = PreparedVDI(runtime, by_hand([[(3.25, 60.75)]] * 1024, (32, 32)))
    wide = (64, 64)

    def drawn(**options):
        with runtime.buffer((*wide, 4)) as image:
            draw(prepared, CAMERA, wide, image, **options)
            return (runtime.download(image)[..., 3] > 0).mean()

    everything = drawn()
    monkeypatch.setattr(prepared.occupancy, "corners", np.zeros((1, 3)))
    assert 0 < drawn() < everything / 4  # whole columns of 4 x 16 pixels about the centre
    assert drawn(skip_empty=False) == everything
    monkeypatch.setattr(prepared.occupancy, "corners", np.zeros((0, 3)))
    assert drawn() == 0


# -- what is made of it ----------------------------------------------------------------------------


def test_an_empty_vdi_is_worth_skipping(runtime):
    grid, counts, occupied = grid_of(runtime, by_hand([[]] * 600, (30, 20)))
    assert counts.shape == (2, 2, SLABS)
    assert not counts.any()
    assert not occupied.any()
    assert grid.occupied == 0
    assert grid.worthwhile


def test_a_full_vdi_is_not(runtime):
    grid, counts, _ = grid_of(runtime, by_hand([[(0, 64)]] * 600, (30, 20)))
    assert counts.tolist() == [[[16 * 16] * 64, [14 * 16] * 64], [[16 * 4] * 64, [14 * 4] * 64]]
    assert grid.occupied == pytest.approx(1)
    assert not grid.worthwhile


def test_the_occupied_share_is_that_within_the_bounds(runtime):
    """Two of four columns of tiles see the bounds; half of the depth there is empty."""
    lists = [[(0, 31.9)] if 16 <= x < 48 else [] for _ in range(32) for x in range(64)]
    bounds = (-10, 10, -50, 50, -32, 32)  # the window is 40 wide
    grid, _, occupied = grid_of(runtime, by_hand(lists, (64, 32), bounds=bounds))
    assert occupied.sum() == 4 * 32
    assert grid.occupied == pytest.approx(1 / 2)


def test_skipping_is_left_out_where_it_does_not_pay(runtime, monkeypatch):
    """Both kernels draw the same, so that only the choice can be seen: by a grid that lies."""
    vdi = by_hand([[(3.25, 60.75)]] * 1024, (32, 32))
    prepared = PreparedVDI(runtime, vdi)
    nothing = np.zeros((2, 2), np.uint64)
    runtime.write(prepared.occupancy.masks, nothing)
    camera = CAMERA.azimuth(60)

    def drawn(skip_empty):
        with runtime.buffer((20, 20, 4)) as image:
            draw(prepared, camera, (20, 20), image, skip_empty=skip_empty)
            return bool(runtime.download(image).any())

    monkeypatch.setattr(occupancy, "_WORTHWHILE", 2.0)
    assert not drawn(skip_empty=True)
    assert drawn(skip_empty=False)
    monkeypatch.setattr(occupancy, "_WORTHWHILE", 0.5)
    assert drawn(skip_empty=True)


def test_a_file_gives_the_same_grid(runtime, tmp_path):
    rng = np.random.default_rng(22)
    vdi = strategies.random_vdi(rng, max_window=(70, 50))
    vdi.save(tmp_path / "saved.vdi")
    _, counts, _ = grid_of(runtime, vdi)
    _, same, _ = grid_of(runtime, read(tmp_path / "saved.vdi"))
    assert counts.any()
    assert np.array_equal(counts, same)
