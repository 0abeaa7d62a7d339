"""opencl/raycasting/stacks.cl, and the depths at which the raycaster looks the grid up."""

from __future__ import annotations

import numpy as np
import pytest

from pyvista_vdi.device.constants import SLABS
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.prepared import PreparedVDI

FILE = "occupancy_functions.cl"

BOUNDS = (-1, 1, -1, 1, -1, 1)

#: V_O's distance from the middle of the bounds, and the VDI's depth origin in near depths.
LENSES = [
    *[(distance, origin) for distance in (1.01, 3, 20, 1e4) for origin in (0, 1e-3, 0.7, 1, 30)],
    (0.5, 0),  # the eye is inside
    (0.5, 3),
]


def prepared_for(runtime, distance, origin, *, parallel):
    """An empty VDI, whose grid and whose kernels' ``-D`` names are those of any with its view."""
    camera = Camera((0, 0, distance), (0, 0, distance - 1), (0, 1, 0), parallel_projection=parallel)
    near = max(distance - 1, 0.1)
    vdi = VDI(camera, (1, 1), [0, 0], [], [], [], [], BOUNDS, depth_origin=origin * near)
    return PreparedVDI(runtime, vdi), vdi.depth_origin


def form_of(prepared):
    return {name: 1 for name in prepared.defines if name != "OFFSET_T"}


def test_slab_of_a_depth(call):
    first, per_depth = 10.0, 4.0
    slabs = np.arange(SLABS)
    inside = np.float32(first + (slabs + 0.5) / per_depth)
    beyond = np.float32([-1e30, 0, 9.999, 26.001, 1e30, -np.inf, np.inf])
    offsets = np.concatenate([inside, beyond])
    found = call(
        FILE,
        "slabs",
        len(offsets),
        offsets,
        np.float32(first),
        np.float32(per_depth),
        call.empty(len(offsets), dtype=np.int32),
    )
    assert found.tolist() == [*slabs, 0, 0, 0, 63, 63, 0, 63]


def test_sets_of_slabs(call):
    slabs = np.arange(SLABS, dtype=np.int32)
    empty = [call.empty(SLABS, dtype=np.uint64) for _ in range(2)]
    begin, end = call(FILE, "sets_of_slabs", SLABS, slabs, *empty)
    for slab in slabs.tolist():
        assert int(begin[slab]) == sum(1 << s for s in range(slab, SLABS))
        assert int(end[slab]) == sum(1 << s for s in range(slab + 1))


@pytest.mark.parametrize("parallel", [False, True])
@pytest.mark.parametrize(("distance", "origin"), LENSES)
def test_depth_coordinates_grow_with_depth_and_lead_back(call, runtime, distance, origin, parallel):
    prepared, depth_origin = prepared_for(runtime, distance, origin, parallel=parallel)
    near, far = max(distance - 1, 1e-3), distance + 1
    offsets = np.linspace(near, far, 2000) - depth_origin
    offsets = offsets.astype(np.float32)
    coordinates, found, reciprocals = call(
        FILE,
        "depths",
        len(offsets),
        offsets,
        np.float32(depth_origin),
        *[call.empty(len(offsets)) for _ in range(3)],
        **form_of(prepared),
    )
    assert (np.diff(coordinates) >= 0).all()
    assert coordinates[-1] > coordinates[0]
    margin = prepared.occupancy.margin
    assert np.abs(found - offsets.astype(np.float64)).max() < margin / 2
    if not parallel:
        depth = offsets.astype(np.float64) + depth_origin
        # Sums and a division of 2.5 units in the last place each way
        rounding = 8 * 2.0**-23 * (1 + np.abs(offsets) / depth)
        assert (np.abs(reciprocals * depth - 1) <= rounding).all()


@pytest.mark.parametrize("parallel", [False, True])
@pytest.mark.parametrize(("distance", "origin"), LENSES)
def test_the_form_of_the_depth_coordinate_costs_no_digits(runtime, distance, origin, parallel):
    """The margin is what depths are rounded by: in any form at most what absolute depths are, and
    a thousandth of a slab where depths are counted from the near depth of the bounds."""
    prepared, depth_origin = prepared_for(runtime, distance, origin, parallel=parallel)
    grid = prepared.occupancy
    assert grid.margin <= 32 * 2.0**-23 * 3 * max(distance + 1, depth_origin)
    if origin == 1 and distance > 1.5:
        assert grid.margin * grid.slabs_per_depth < 1e-3


@pytest.mark.every(5)
@pytest.mark.parametrize("away", [True, False])
@pytest.mark.parametrize("parallel", [False, True])
@pytest.mark.parametrize(("distance", "origin"), LENSES)
def test_what_is_skipped_ends_before_the_next_supersegment(
    call, runtime, distance, origin, parallel, away
):
    """Rays skip up to the face of a slab. No supersegment that counts only from there on may begin
    before the depth coordinate that they then have; its faces lie as close as they can."""
    prepared, depth_origin = prepared_for(runtime, distance, origin, parallel=parallel)
    grid = prepared.occupancy
    rng = np.random.default_rng(31)
    n = 20_000
    slabs = rng.integers(1, SLABS, n).astype(np.int32)
    # Bounds at depths from near to far, with the slab's face between the ends of each ray
    first, per_depth = (np.float64(np.float32(v)) for v in (grid.first_depth, grid.slabs_per_depth))
    slab_faces = first + slabs / per_depth
    thickness = SLABS / per_depth
    ends = np.column_stack(
        [
            slab_faces - rng.random(n) ** 3 * (slab_faces - first),
            slab_faces + rng.random(n) ** 3 * (first + thickness - slab_faces),
        ]
    )
    ends = ends.astype(np.float32)
    sign = 1 if away else -1
    faces = (slab_faces + sign * grid.margin).astype(np.float32)
    faces += rng.integers(-3, 4, n) * np.spacing(faces)
    until, coordinates, counted = call(
        FILE,
        "skipped_to_faces",
        n,
        ends,
        slabs,
        faces,
        np.int32(away),
        *np.float32([depth_origin, grid.first_depth, grid.slabs_per_depth, grid.margin]),
        call.empty(n),
        call.empty(n),
        call.empty(n, dtype=np.int32),
        **form_of(prepared),
    )
    # In the slab behind the face that the ray reaches, and in none before it
    behind = counted >= slabs if away else counted < slabs
    moves = (ends[:, 0] < slab_faces) & (slab_faces < ends[:, 1])
    tried = behind & moves
    assert tried.mean() > 0.2
    assert (sign * until[tried] < sign * coordinates[tried]).all()
