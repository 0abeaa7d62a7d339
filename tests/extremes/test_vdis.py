"""VDIs: budgets, windows, and lists that only another program would make."""

from __future__ import annotations

import numpy as np
import pytest
import reference
from drawing import render_vdi
from extreme_scenes import assert_within, check_views, slabs_vdi

from pyvista_vdi import VDI, Camera

pytestmark = pytest.mark.extremes

EYE = Camera((0, 0, 10), (0, 0, 0), (0, 1, 0), view_angle=16)
BOUNDS = (-1, 1, -1, 1, -1, 1)
AROUND = [EYE, EYE.azimuth(30), EYE.azimuth(90), EYE.azimuth(180), EYE.elevation(90 - 1e-3)]


def test_4096_supersegments_in_every_list(runtime, worst):
    """From views of all sides; a list is full, and nothing of it is dropped.

    None is thinner than 80 units in the last place of its depth: how much of a thinner one a ray
    crosses is a matter of the rounding of each single face.
    """
    rng = np.random.default_rng(1)
    grid = np.linspace(0, 2, 4097)
    ends = np.stack([grid[:-1], grid[1:]], axis=1) + rng.uniform(0, 1, (4096, 2)) * [2e-4, -2e-4]
    color = rng.random((len(ends), 3))
    vdi = slabs_vdi(
        EYE, ends, rng.uniform(0, 2e-3, len(ends)), window=(3, 2), bounds=BOUNDS,
        depth_origin=9.0, color=color,
    )  # fmt: skip
    check_views(runtime, worst, vdi, AROUND, size=(5, 3))


#: Faces less a depth origin of 9, optical depths, windows; least pixels that must be drawn.
LISTS = {
    "one list": ([(0.2, 0.9), (0.9, 1.6)], [0.5, 1.0], (1, 1), 1),
    "one column": ([(0.2, 0.9), (0.9, 1.6)], [0.5, 1.0], (1, 7), 1),
    "one row": ([(0.2, 0.9), (0.9, 1.6)], [0.5, 1.0], (7, 1), 1),
    "as deep as float32 holds": ([(0.0, 0.5), (0.5, 3e38)], [1.0, 3e38], (3, 3), 3),
    **{f"optical depth {tau:g}": ([(0.3, 1.4)], tau, (3, 3), 3) for tau in (1e-7, 30.0, 3e38)},
    "nothing": ([], [], (4, 3), 0),
}


@pytest.mark.parametrize("name", LISTS)
def test_extreme_lists(runtime, worst, name):
    faces, optical_depth, window, drawn = LISTS[name]
    vdi = slabs_vdi(EYE, faces, optical_depth, window=window, bounds=BOUNDS, depth_origin=9.0)
    check_views(runtime, worst, vdi, AROUND, size=(5, 4), least_drawn=drawn)


@pytest.mark.parametrize(
    ("optical_depth", "origin", "parallel"), [(1.0, 9.0, False), (3e38, 0.0, True)]
)
def test_supersegments_one_ulp_thick(runtime, worst, optical_depth, origin, parallel):
    """From a denormal number thick: within what rounding of its faces makes of it, and finite."""
    camera = EYE.replace(parallel_projection=parallel)
    for depth in (0.0, 1e-40, 0.5, 1.5):
        front = np.float32(9.0 - origin + depth)
        faces = [front, np.nextafter(front, np.float32(99))]
        where = {"window": (3, 3), "bounds": BOUNDS, "depth_origin": origin}
        vdi = slabs_vdi(camera, faces, optical_depth, **where)
        check_views(runtime, worst, vdi, AROUND, size=(3, 3), least_drawn=0)


@pytest.mark.slow
def test_8192_by_4320_lists(runtime, worst):
    """From V_O all of them against the list itself; turned, through a small window."""
    width, height = window = 8192, 4320
    # One supersegment in every 16th list, its depth and colour those of its place
    y, x = np.divmod(np.arange(0, width * height, 16), width)
    front = (0.3 + x / width + 0.3 * y / height).astype(np.float32)
    color = np.stack([x / width, y / height, np.full(len(x), 0.5)], axis=1)
    vdi = VDI(
        EYE.replace(view_angle=11.4),
        window,
        (np.arange(width * height + 1, dtype=np.uint64) + 15) // 16,
        front,
        front + np.float32(0.2),
        color,
        np.full(len(x), 2.0),
        (-2.5, 2.5, -1.5, 1.5, -1, 1),
        depth_origin=9.0,
    )
    image = render_vdi(vdi, vdi.camera, device=runtime)[::-1]
    drawn = image.reshape(-1, 4)[::16]
    expected = -np.expm1(-2.0) * color
    assert_within(worst, "8192 x 4320 from V_O", drawn[:, :3], expected, 2e-5)
    assert not image.reshape(-1, 4)[8::16].any()
    # The oracle looks at every list of a row: a few pixels
    for camera in (vdi.camera.azimuth(0.3), vdi.camera.azimuth(60)):
        size = (3, 2)
        image = render_vdi(vdi, camera, size, device=runtime)
        pixels = [(x, size[1] - 1 - row) for row in range(size[1]) for x in range(size[0])]
        low, high = reference.render_range(vdi, camera, size, pixels)
        drawn = image.reshape(-1, 4)
        assert drawn[:, 3].max() > 0
        worst("8192 x 4320 turned", np.maximum(low - drawn, drawn - high).max())
        assert ((drawn >= low - 2e-5) & (drawn <= high + 2e-5)).all()
