"""The occupancy grid against a count by NumPy in float64, on every device."""

from __future__ import annotations

import math

import numpy as np
import pytest
import strategies
from drawing import draw
from extreme_scenes import slabs_vdi
from ray_scenes import generating_view, with_lists

from pyvista_vdi import Camera, read
from pyvista_vdi.device.constants import SLABS, STACK
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.raycasting.prepared import OccupancyGrid, PreparedVDI

VIEWS = ["perspective", "parallel", "long lens", "very long lens", "inside", "any matrix"]


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
    assert grid.stacks == tuple(math.ceil(edge / STACK) for edge in vdi.window_size)
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


@pytest.mark.every(4)
@pytest.mark.parametrize("view", [*VIEWS, "far from origin"])
def test_counts_of_random_vdis(runtime, view):
    """Supersegments that touch, that are thinner than a slab, and that reach beyond the bounds;
    windows that tiles do not divide."""
    shares = []
    for case, window in enumerate([(1, 1), (16, 16), (17, 16), (1, 33), (70, 31), (15, 50)]):
        rng = np.random.default_rng([case, 20])
        bounds, camera = generating_view(rng, view)
        vdi = strategies.random_vdi(rng, window=window, camera=camera, bounds=bounds)
        share = check(runtime, vdi)
        # Depths that are counted from an eye 1e4 radii away are rounded by a good part of a slab
        if view != "very long lens" or vdi.depth_origin:
            shares.append(share)
    assert min(shares) > 0.9


#: Parallel projection along -z; bounds from depth 0 to 64, so that a slab is one unit thick.
CAMERA = Camera((0, 0, 32), (0, 0, 0), (0, 1, 0), parallel_projection=True, parallel_scale=10)
BOUNDS = (-50, 50, -50, 50, -32, 32)


def by_hand(faces, window=(1, 1), camera=CAMERA, bounds=BOUNDS, **options):
    """A VDI whose lists are all alike."""
    return slabs_vdi(camera, faces, 1.0, window=window, bounds=bounds, **options)


def occupied_slabs(runtime, *faces, **options):
    _, counts, _ = grid_of(runtime, by_hand(faces, **options))
    return {int(slab): int(counts[0, 0, slab]) for slab in np.flatnonzero(counts)}


def test_a_face_on_a_slabs_face_counts_on_both_sides(runtime):
    grid, _, _ = grid_of(runtime, by_hand([]))
    assert 1e-5 < grid.margin < 1e-3  # slabs
    inside, outside = grid.margin / 2, grid.margin * 2
    assert occupied_slabs(runtime, (3.0, 3.5)) == {2: 1, 3: 1}
    assert occupied_slabs(runtime, (3.0 + inside, 3.5)) == {2: 1, 3: 1}
    assert occupied_slabs(runtime, (3.0 + outside, 3.5)) == {3: 1}
    assert occupied_slabs(runtime, (3.5, 4.0)) == {3: 1, 4: 1}
    assert occupied_slabs(runtime, (3.5, 4.0 - inside)) == {3: 1, 4: 1}
    assert occupied_slabs(runtime, (3.5, 4.0 - outside)) == {3: 1}


FACES = np.array([(3.25, 3.75), (40.5, 50.5)])


@pytest.mark.parametrize(
    ("faces", "options"),
    [
        (FACES - 16, {"depth_origin": 16}),
        # Slabs follow the bounds and not constants
        *(
            (
                FACES * scale,
                {
                    "camera": CAMERA.replace(
                        position=np.multiply(CAMERA.position, scale), parallel_scale=10 * scale
                    ),
                    "bounds": np.multiply(BOUNDS, scale),
                },
            )
            for scale in (1e-9, 1e9)
        ),
        # Slabs are equal in view depth in perspective, too: depths 4 to 68
        (
            FACES + 4,
            {
                "camera": CAMERA.replace(position=(0, 0, 36), parallel_projection=False),
                "bounds": (-1, 1, -1, 1, -32, 32),
            },
        ),
    ],
    ids=["origin", "tiny", "huge", "perspective"],
)
def test_slabs_divide_the_depths_of_the_bounds(runtime, faces, options):
    expected = {3: 1, **dict.fromkeys(range(40, 51), 1)}
    assert occupied_slabs(runtime, *faces, **options) == expected


@pytest.mark.parametrize("view", [CAMERA, CAMERA.replace(parallel_projection=False)])
def test_bounds_without_depth(runtime, view):
    """All of it is within reach of rays: nothing may be taken for empty where they are."""
    bounds = (-1, 1, -1, 1, 0, 0)  # at depth 32
    grid, counts, _ = grid_of(runtime, by_hand([(31.99, 32.01)], camera=view, bounds=bounds))
    assert counts[0, 0, 0] == 1
    assert np.isfinite(grid.occupied)


def drawn(runtime, prepared, camera, size, **options):
    """Share of a picture's pixels that see something."""
    with runtime.buffer((*size[::-1], 4)) as image:
        draw(prepared, camera, size, image, **options)
        return (runtime.download(image)[..., 3] > 0).mean()


def test_rays_beside_the_occupied_cells_are_not_cast(runtime, monkeypatch):
    """Both pictures are the same, so that only the choice can be seen: by corners that lie."""
    prepared, size = PreparedVDI(runtime, by_hand([(3.25, 60.75)], (32, 32))), (64, 64)
    everything = drawn(runtime, prepared, CAMERA, size)
    monkeypatch.setattr(prepared.occupancy, "corners", np.zeros((1, 3)))
    # Whole columns of 4 x 16 pixels about the centre
    assert 0 < drawn(runtime, prepared, CAMERA, size) < everything / 4
    assert drawn(runtime, prepared, CAMERA, size, skip_empty=False) == everything
    monkeypatch.setattr(prepared.occupancy, "corners", np.zeros((0, 3)))
    assert drawn(runtime, prepared, CAMERA, size) == 0


def test_skipping_is_left_out_where_it_does_not_pay(runtime, monkeypatch):
    """Both kernels draw the same, so that only the choice can be seen: by a grid that lies."""
    prepared = PreparedVDI(runtime, by_hand([(3.25, 60.75)], (32, 32)))
    runtime.write(prepared.occupancy.masks, np.zeros((2, 2), np.uint64))
    scene = runtime, prepared, CAMERA.azimuth(60), (20, 20)
    monkeypatch.setattr(OccupancyGrid, "worthwhile", True)
    assert not drawn(*scene)
    assert drawn(*scene, skip_empty=False)
    monkeypatch.setattr(OccupancyGrid, "worthwhile", False)
    assert drawn(*scene)


def test_the_occupied_share_is_that_within_the_bounds(runtime):
    """Two of four columns of tiles see the bounds; half of the depth there is empty."""
    kept = np.broadcast_to((np.arange(64) >= 16) & (np.arange(64) < 48), (32, 64))
    bounds = (-10, 10, -50, 50, -32, 32)  # the window is 40 wide
    vdi = with_lists(by_hand([(0, 31.9)], (64, 32), bounds=bounds), kept)
    grid, _, occupied = grid_of(runtime, vdi)
    assert occupied.sum() == 4 * 32
    assert grid.occupied == pytest.approx(1 / 2)
    assert grid.worthwhile == runtime.is_cpu
    runtime.is_cpu, is_cpu = not runtime.is_cpu, runtime.is_cpu
    try:
        assert grid_of(runtime, vdi)[0].worthwhile == runtime.is_cpu
    finally:
        runtime.is_cpu = is_cpu


BEHIND = {"camera": Camera((0, 0, 5), (0, 0, 10), (0, 1, 0)), "bounds": (-1, 1, -1, 1, -1, 1)}


@pytest.mark.parametrize("options", [{}, BEHIND], ids=["empty", "behind the eye"])
def test_what_has_nothing_is_worth_skipping(runtime, options):
    grid, counts, occupied = grid_of(runtime, by_hand([], (30, 20), **options))
    assert counts.shape == (2, 2, SLABS)
    assert not counts.any()
    assert not occupied.any()
    assert grid.occupied == 0
    assert grid.worthwhile


def test_a_full_vdi_is_not(runtime):
    grid, counts, _ = grid_of(runtime, by_hand([(0, 64)], (30, 20)))
    assert counts.tolist() == [[[16 * 16] * 64, [14 * 16] * 64], [[16 * 4] * 64, [14 * 4] * 64]]
    assert grid.occupied == pytest.approx(1)
    assert not grid.worthwhile


def test_a_file_gives_the_same_grid(runtime, tmp_path):
    vdi = strategies.random_vdi(np.random.default_rng(22), max_window=(70, 50))
    vdi.save(tmp_path / "saved.vdi")
    _, counts, _ = grid_of(runtime, vdi)
    _, same, _ = grid_of(runtime, read(tmp_path / "saved.vdi"))
    assert counts.any()
    assert np.array_equal(counts, same)


LENSES = [
    *((distance, origin) for distance in (1.01, 3, 1e4) for origin in (0, 1e-3, 1, 30)),
    (0.5, 0),  # the eye is inside
    (0.5, 3),
]


@pytest.mark.parametrize("parallel", [False, True])
@pytest.mark.parametrize(("distance", "origin"), LENSES)
def test_the_margin_costs_no_digits(runtime, distance, origin, parallel):
    """By which supersegments count beyond their faces: what depths are rounded by, at most what
    absolute depths are, and a thousandth of a slab where they count from the near depth.

    V_O is ``distance`` from the middle of the bounds; depths count from ``origin`` near depths.
    """
    camera = Camera((0, 0, distance), (0, 0, distance - 1), (0, 1, 0), parallel_projection=parallel)
    depth_origin = origin * max(distance - 1, 0.1)
    cube = (-1, 1, -1, 1, -1, 1)
    grid, _, _ = grid_of(runtime, by_hand([], (1, 1), camera, cube, depth_origin=depth_origin))
    assert grid.margin <= 32 * 2.0**-23 * 3 * max(distance + 1, depth_origin)
    assert grid.margin * grid.slabs_per_depth < 1e-3 or origin != 1 or distance < 1.5
