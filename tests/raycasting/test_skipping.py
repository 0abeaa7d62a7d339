"""Pictures with and without empty-space skipping are the same to the last bit, on every platform.

Skipping is forced, also where the grid has too little empty space to gain by it. The VDIs are made
so that its hard cases are common: blobs of lists, each with supersegments in a few slabs, many of
whose faces lie within a few units in the last place of a slab's face. That something is skipped is
measured, too: a VDI that is full of a thin medium is drawn with the sparse one's grid, and what is
missing in the picture was passed by.
"""

from __future__ import annotations

import functools
import itertools
import math
from typing import NamedTuple

import numpy as np
import pytest
import strategies
from drawing import render_vdi
from extreme_scenes import slabs_vdi
from ray_scenes import generating_view, random_ends, rebuilt, with_lists

from pyvista_vdi import VDI, Camera
from pyvista_vdi.device.constants import SLABS, STACK
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.raycasting.prepared import OccupancyGrid, prepared_vdi

#: Lists of the sparse VDIs: many tiles, those of the last column cut off. The middle is a corner of
#: lists, and lies on a border between two rows of tiles.
WINDOW = (200, 160)

#: Pixels of their pictures, unless a view needs others.
SIZE = (96, 75)


@pytest.fixture(autouse=True)
def _skipping_is_forced(monkeypatch):
    monkeypatch.setattr(OccupancyGrid, "worthwhile", True)


def assert_same_bits(runtime, vdi, camera, size, name="", **ends):
    """Draw without and with skipping, and compare bits, so that -0 and NaN count as well."""
    plain, skipping = (
        render_vdi(vdi, camera, size, skip_empty=skip, device=runtime, **ends)
        for skip in (False, True)
    )
    differs = (plain.view(np.uint32) != skipping.view(np.uint32)).any(axis=-1)
    places = np.argwhere(differs)
    assert not len(places), (
        f"{name}: {len(places)} of {differs.size} pixels differ, the first at {places[0]}: "
        f"{plain[tuple(places[0])]} without skipping, {skipping[tuple(places[0])]} with it"
    )
    return plain


class Scene(NamedTuple):
    sparse: VDI
    full: VDI  # one thin supersegment in each list, over all of the depth range


#: Generating views, and where the VDI counts its depths from, in near depths of the bounds: others
#: than 1 are for VDIs that another program made.
GENERATING_VIEWS = [
    ("perspective", 1.0),
    ("parallel", 1.0),
    ("long lens", 1.0),
    ("very long lens", 1.0),
    ("inside", 0.0),
    ("mirrored", 1.0),
    ("far from origin", 1.0),
    ("perspective", 0.0),
    ("parallel", 0.0),
    ("long lens", 0.0),
    ("very long lens", 0.0),
    ("long lens", 1e-3),
    ("perspective", 30.0),
    ("long lens", 30.0),
]


@functools.cache
def scene(kind, origin):
    rng = np.random.default_rng([GENERATING_VIEWS.index((kind, origin)), 500])
    # A part of what the camera sees, so that the bounds fill most of the window
    bounds, camera = generating_view(rng, kind, zoom=0.6)
    depth_origin = origin * max(rays.depth_range(camera, bounds)[0], 0.0)
    return Scene(
        sparse_vdi(rng, camera, bounds, depth_origin),
        full_vdi(camera, bounds, WINDOW, depth_origin),
    )


def sparse_vdi(rng, camera, bounds, depth_origin):
    """Blobs of lists, each with one supersegment in a few slabs, in four layers that may overlap:
    what overlaps is cut into supersegments that touch. Many begin or end at a slab's face, give or
    take a few units in the last place."""
    first, step = slabs_of(camera, bounds)
    slabs = np.concatenate([slabs_of_blobs(rng, WINDOW) for _ in range(4)], axis=1)
    depth = first + slabs * step
    if not camera.parallel_projection:
        depth = np.maximum(depth, 0)  # nothing lies behind the eye
    faces = (depth - depth_origin).astype(np.float32)
    faces += rng.integers(-3, 4, size=faces.shape) * np.spacing(faces)
    if not camera.parallel_projection:
        lowest = np.float32(-depth_origin)
        faces = np.maximum(faces, lowest if lowest >= -depth_origin else np.nextafter(lowest, 0))
    faces.sort(axis=1)
    front, back = faces[:, ::2], faces[:, 1::2]
    kept = front < back
    n = int(kept.sum())
    return VDI(
        camera,
        WINDOW,
        np.concatenate([[0], np.cumsum(kept.sum(axis=1))]),
        front[kept],
        back[kept],
        rng.random((n, 3)),
        10 ** rng.uniform(-3, 0, size=n),
        bounds,
        depth_origin=depth_origin,
    )


def slabs_of_blobs(rng, window):
    """Slabs at which each list's supersegment begins and ends, (lists, 2); the same where there is
    none."""
    width, height = window
    begin, extent = np.zeros((2, height, width))
    sharp = np.zeros((height, width), bool)
    for _ in range(40):
        wide, high = rng.integers(1, [width // 8 + 2, height // 6 + 2])
        x, y = rng.integers(0, [width - wide + 1, height - high + 1])
        blob = np.s_[y : y + high, x : x + wide]
        begin[blob] = rng.uniform(-1, SLABS)
        extent[blob] = rng.uniform(0.2, 4)
        sharp[blob] = rng.random() < 0.5
    extent[rng.random(extent.shape) < 0.2] = 0
    begin, extent, sharp = (values.reshape(-1, 1) for values in (begin, extent, sharp))
    ends = begin + extent * rng.random((begin.size, 2))
    # At any depth, on slabs' faces, or beside them by up to some of the grid's margins
    beside = rng.uniform(0, 2e-3, ends.shape) * rng.integers(-1, 2, size=ends.shape)
    ends = np.where(rng.random(ends.shape) < 0.5, np.round(ends) + beside, ends)
    # A sharp blob fills slabs as far as it can without counting in their neighbours
    whole = np.floor(begin) + [0, 1] * np.ceil(extent)
    ends = np.where(sharp, whole + [1, -1] * rng.uniform(0, 2e-3, ends.shape), ends)
    return np.where(extent > 0, ends, 0)


def full_vdi(camera, bounds, window, depth_origin):
    """So thin a medium that opacities add up."""
    first, step = slabs_of(camera, bounds)
    faces = [first - depth_origin, first + SLABS * step - depth_origin]
    return slabs_vdi(
        camera, faces, 0.02, window=window, bounds=bounds, depth_origin=depth_origin, color=1
    )


def slabs_of(camera, bounds):
    """View depth at which the first slab begins, and the thickness of a slab; world units."""
    near, far = rays.depth_range(camera, bounds)
    near = near if camera.parallel_projection else max(near, 1e-5)
    return near, (far - near) / SLABS


def beside(vdi, right, up, size=SIZE):
    """V_N in parallel projection, its axes combinations of V_O's (right, up, forward), about the
    middle of V_O's window at the middle of the bounds; a pixel is as high as V_O's window."""
    own = vdi.camera
    axes = own.axes
    near, far = rays.depth_range(own, vdi.bounds)
    depth = max((near + far) / 2, (far - near) / 4)
    half_height = own.half_extent(vdi.window_size)[1] * (1 if own.parallel_projection else depth)
    middle = own.position + axes[2] * depth
    right, up = (np.asarray(v) @ axes for v in (right, up))
    camera = Camera(
        middle - np.cross(up, right) * (far - near) * 2,
        middle,
        up,
        parallel_projection=True,
        parallel_scale=half_height,
        model_transform=own.model_transform,
    )
    return camera, size


def around(rng, vdi, transform=None, **lens):
    transform = vdi.camera.model_transform if transform is None else transform
    return strategies.camera_around(rng, vdi.bounds, transform, **lens), SIZE


C = math.sqrt(0.5)
NEW_VIEWS = {
    "same": lambda rng, vdi: (vdi.camera, vdi.window_size),  # every ray stays in one list
    "half": lambda rng, vdi: (vdi.camera, (WINDOW[0] // 2, WINDOW[1] // 2)),  # along two borders
    "0.01 degrees": lambda rng, vdi: (vdi.camera.azimuth(0.01), SIZE),
    "5 degrees": lambda rng, vdi: (vdi.camera.azimuth(5), SIZE),
    "30 degrees": lambda rng, vdi: (vdi.camera.azimuth(30), SIZE),
    "90 degrees": lambda rng, vdi: (vdi.camera.azimuth(90), SIZE),
    "180 degrees": lambda rng, vdi: (vdi.camera.azimuth(180), SIZE),
    "inside": lambda rng, vdi: (
        strategies.camera_inside(rng, vdi.bounds, vdi.camera.model_transform),
        SIZE,
    ),
    "parallel": lambda rng, vdi: around(rng, vdi, parallel=True),
    # The model is mirrored, and elsewhere in its world than when the VDI was made
    "other matrix": lambda rng, vdi: around(
        rng, vdi, strategies.random_transform(rng, "mirror"), parallel=False
    ),
    "a long way off": lambda rng, vdi: around(rng, vdi, distance=200),
    "along u": lambda rng, vdi: beside(vdi, (0, 0, 1), (0, 1, 0)),
    "along v": lambda rng, vdi: beside(vdi, (0, 0, 1), (1, 0, 0)),
    # From a parallel V_O: along a border between two rows of lists; of tiles, by pixels two tiles
    # high; and the middle column of rays through corners of lists
    "along list borders": lambda rng, vdi: beside(
        vdi, (0, 0, -1), (0, 1, 0), (SIZE[0], WINDOW[1] // 2)
    ),
    "along tile borders": lambda rng, vdi: beside(
        vdi, (0, 0, 1), (0, 1, 0), (SIZE[0], WINDOW[1] // (2 * STACK))
    ),
    "across corners": lambda rng, vdi: beside(vdi, (C, -C, 0), (0, 0, 1), (95, 75)),
}

#: Views whose rays cross too few lists for a look at the grid.
IN_ONE_LIST = ("same", "half", "0.01 degrees")

#: Least share of the way of all rays through a full VDI that is passed by, and least share of the
#: rays that meet a supersegment of the sparse one. Measured: .13 and .031.
MIN_PASSED, MIN_DRAWN = 0.1, 0.02


def passed_by(runtime, both, camera, size, image):
    """What share of rays' ways through the full VDI the sparse one's grid skips, and what share of
    the rays that meet the full one meet the sparse one, too."""
    grid = prepared_vdi(runtime, both.full).occupancy
    own = runtime.download(grid.masks)
    whole = render_vdi(both.full, camera, size, device=runtime)
    try:
        sparse = prepared_vdi(runtime, both.sparse).occupancy.masks
        runtime.write(grid.masks, runtime.download(sparse))
        rest = render_vdi(both.full, camera, size, device=runtime)
    finally:
        runtime.write(grid.masks, own)
    whole, rest = (-np.log1p(-alpha[..., 3].astype(np.float64)) for alpha in (whole, rest))
    meets = whole > 0
    assert meets.any()
    return 1 - rest.sum() / whole.sum(), (image[meets][:, 3] > 0).mean()


#: Each generating view with a third of the new ones; a parallel one, from which rays run exactly
#: along borders and through corners, with all.
PAIRS = [
    (*own, new)
    for (i, own), (k, new) in itertools.product(enumerate(GENERATING_VIEWS), enumerate(NEW_VIEWS))
    if (i + k) % 3 == 0 or own == ("parallel", 1.0)
]


@pytest.mark.every(24)
@pytest.mark.usefixtures("dealt")
@pytest.mark.parametrize(("kind", "origin", "name"), PAIRS)
def test_sparse_vdis(runtime, kind, origin, name):
    both = scene(kind, origin)
    rng = np.random.default_rng([PAIRS.index((kind, origin, name)), 600])
    camera, size = NEW_VIEWS[name](rng, both.sparse)
    image = assert_same_bits(runtime, both.sparse, camera, size)
    if name not in IN_ONE_LIST:
        passed, drawn = passed_by(runtime, both, camera, size, image)
        assert passed > MIN_PASSED
        assert drawn > MIN_DRAWN


@pytest.mark.every(6)
@pytest.mark.parametrize(("kind", "origin"), GENERATING_VIEWS)
def test_rays_that_end_early(runtime, kind, origin):
    """At opaque geometry, at clipping planes, and where nothing more can be seen."""
    vdi = scene(kind, origin).sparse
    rng = np.random.default_rng([GENERATING_VIEWS.index((kind, origin)), 700])
    camera = vdi.camera.azimuth(30)
    ends = random_ends(rng, vdi, camera, SIZE, planes=2)
    whole = assert_same_bits(runtime, vdi, camera, SIZE)
    box = np.reshape(vdi.bounds, (3, 2))
    crops = (box[:, :1] + np.array([0.3, 0.6]) * (box[:, 1:] - box[:, :1])).ravel()
    for shown in (
        {"opaque_depth": ends["opaque_depth"]},
        {"clipping_planes": ends["clipping_planes"][:1]},
        ends,
        *(
            {"cropping": (crops, regions), "opacity_multiplier": 2.5}
            for regions in ("subvolume", "fence", "inverted_cross", int(rng.integers(2**27)))
        ),
    ):
        image = assert_same_bits(runtime, vdi, camera, SIZE, **shown)
        assert (image != whole).any()
    opaque = rebuilt(vdi, optical_depth=vdi.optical_depth * np.float32(1e3))
    assert_same_bits(runtime, opaque, camera, SIZE)
    assert_same_bits(runtime, opaque, camera, SIZE, transmittance_cutoff=0.1)


@pytest.mark.every(3)
@pytest.mark.usefixtures("dealt")
@pytest.mark.parametrize("kind", strategies.VIEWS)
def test_random_vdis(runtime, kind):
    """Windows from one list on, supersegments beyond the bounds, any matrix."""
    drawn = 0
    for case in range(8):
        seed = [case, strategies.VIEWS.index(kind), 800]
        rng = np.random.default_rng(seed)
        vdi = strategies.random_vdi(rng, max_window=(60, 45), max_supersegments=5)
        # Most lists are emptied, some tiles of them wholly
        vdi = with_lists(vdi, rng.random(vdi.counts.shape) < rng.choice([0.02, 0.3]))
        camera, size = strategies.random_view(rng, vdi, kind)
        size = size if kind in ("same", "half") else (3 * size[0], 3 * size[1])
        image = assert_same_bits(runtime, vdi, camera, size, name=f"seed {seed}")
        drawn += (image[..., 3] > 0).sum()
    assert drawn > 20  # pixels; of windows of a few lists, see `half`, there are 40


def test_rays_through_corners_of_tiles(runtime):
    """Tiles are filled as a chess board is black, and rays run through the corners of its white
    squares. Where rounding has a ray cut the corner of a black one, it does so by a few units in
    the last place; the medium is so dense that this can be seen, and so can a list that skipping
    should have visited."""
    cut = 0
    for case in range(60):
        rng = np.random.default_rng([case, 900])
        bounds, camera = generating_view(rng, "parallel")
        # The window is a square well within the bounds, of 6 x 6 tiles
        shortest = np.diff(np.reshape(bounds, (3, 2))).min()
        camera = camera.replace(
            focal_point=np.reshape(bounds, (3, 2)).mean(axis=1),
            parallel_scale=shortest / 8,
            window_center=(0, 0),
            use_horizontal_view_angle=False,
        )
        dense = full_vdi(camera, bounds, (6 * STACK, 6 * STACK), 0.0)
        dense = rebuilt(dense, optical_depth=np.full_like(dense.optical_depth, 1e7))
        tile = np.arange(6 * STACK) // STACK
        board = with_lists(dense, (tile[:, None] + tile) % 2 == 1)
        for sign in (1, -1):
            # An exact diagonal reaches both borders at once, which is too easy
            right = sign * (np.array([1, -1, 0]) + rng.normal(size=3) * 3e-7) / math.sqrt(2)
            new, size = beside(board, right, (0, 0, 1), (1, 4))
            image = assert_same_bits(runtime, board, new, size, name=f"case {case}, sign {sign}")
            cut += ((image[..., 3] > 0) & (image[..., 3] < 1)).sum()
    assert cut > 60


def test_vdis_of_one_list_and_of_none(runtime):
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0))
    bounds = (-1, 1, -1, 1, -1, 1)
    one = slabs_vdi(camera, [4.5, 5.5], 0.7, bounds=bounds)
    none = slabs_vdi(camera, [], [], window=(33, 40), bounds=bounds)
    for new in (camera, camera.azimuth(70), camera.azimuth(180)):
        assert assert_same_bits(runtime, one, new, (50, 40)).any()
        assert not assert_same_bits(runtime, none, new, (50, 40)).any()
