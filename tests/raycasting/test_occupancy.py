"""The occupancy grid against a count by NumPy in float64, on every device."""

from __future__ import annotations

import math

import numpy as np
import pytest
import strategies
from extreme_scenes import slabs_vdi
from ray_scenes import generating_view, with_lists

from pyvista_vdi import Camera
from pyvista_vdi.device.constants import SLABS, STACK
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.raycasting.prepared import PreparedVDI


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


@pytest.mark.parametrize("view", ["perspective", "parallel", "very long lens", "any matrix"])
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


def test_the_occupied_share_is_that_within_the_bounds(runtime):
    """Two of four columns of tiles see the bounds; half of the depth there is empty."""
    kept = np.broadcast_to((np.arange(64) >= 16) & (np.arange(64) < 48), (32, 64))
    bounds = (-10, 10, -50, 50, -32, 32)  # the window is 40 wide
    vdi = with_lists(slabs_vdi(CAMERA, [(0, 31.9)], 1, window=(64, 32), bounds=bounds), kept)
    grid, _, occupied = grid_of(runtime, vdi)
    assert occupied.sum() == 4 * 32
    assert grid.occupied == pytest.approx(1 / 2)
    assert grid.worthwhile == runtime.is_cpu
    runtime.is_cpu, is_cpu = not runtime.is_cpu, runtime.is_cpu
    try:
        assert grid_of(runtime, vdi)[0].worthwhile == runtime.is_cpu
    finally:
        runtime.is_cpu = is_cpu
