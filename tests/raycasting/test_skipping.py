"""Pictures with and without empty-space skipping are the same to the last bit, on every platform.

Skipping is forced here, also where the grid has too little empty space to gain by it. The VDIs are
made so that skipping has much to do, and so that its hard cases are common: blobs of lists, each
with supersegments in a few slabs, many of whose faces lie within a few units in the last place of a
slab's face. That something is skipped is measured, too: a VDI that is full of a thin medium is
drawn with the sparse one's grid, and what is missing in the picture was passed by.

Every case runs by every strategy on the same VDIs, made once: hence more than 500 lines.
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
from real_data import require_data

from pyvista_vdi import examples, generate
from pyvista_vdi.device import ray_forms as rays
from pyvista_vdi.device.constants import SLABS, STACK
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS, filling_camera
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting import occupancy
from pyvista_vdi.raycasting.prepared import prepared_vdi

#: Lists of the sparse VDIs: many tiles, those of the last column cut off. The middle is a corner of
#: lists, and lies on a border between two rows of tiles.
WINDOW = (200, 160)

#: Pixels of their pictures, unless a view needs others.
SIZE = (96, 75)

#: Random VDIs per kind of view of ``strategies.VIEWS``.
N_CASES = 12


@pytest.fixture(autouse=True)
def _skipping_is_forced(monkeypatch):
    monkeypatch.setattr(occupancy, "_WORTHWHILE", math.inf)


@pytest.fixture(params=strategies.DEALT)
def _dealt(request, monkeypatch):
    strategies.deal_rays(monkeypatch, request.param)


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


# -- generating views ------------------------------------------------------------------------------


class Scene(NamedTuple):
    sparse: VDI
    full: VDI  # one thin supersegment in each list, over all of the depth range


def outside(rng, **options):
    bounds = strategies.random_bounds(rng)
    options = {"distance": 3, **options}
    return bounds, closer(strategies.camera_around(rng, bounds, np.eye(4), **options))


def closer(camera):
    """A part of what the camera sees, so that the bounds fill most of the window."""
    return camera.replace(
        view_angle=camera.view_angle * 0.6, parallel_scale=camera.parallel_scale * 0.6
    )


def perspective(rng):
    return outside(rng, parallel=False)


def parallel(rng):
    return outside(rng, parallel=True)


def long_lens(rng):
    """Depth kept relative, since far depth over near depth is below 2."""
    return outside(rng, distance=50, parallel=False)


def very_long_lens(rng):
    return outside(rng, distance=1e4, parallel=False)


def inside(rng):
    """The near depth of the bounds lies behind the eye."""
    bounds = strategies.random_bounds(rng)
    return bounds, strategies.camera_inside(rng, bounds, np.eye(4))


def mirrored(rng):
    bounds = strategies.random_bounds(rng)
    transform = strategies.random_transform(rng, "mirror")
    return bounds, closer(strategies.camera_around(rng, bounds, transform, distance=3))


def far_from_origin(rng):
    """The bounds are 1e5 of their size away from the model's origin."""
    bounds = strategies.random_bounds(rng) + np.repeat(rng.normal(size=3) * 3e5, 2)
    return bounds, closer(strategies.camera_around(rng, bounds, np.eye(4), distance=3))


#: Generating views, and where the VDI counts its depths from, in near depths of the bounds: others
#: than 1 are for VDIs that another program made.
GENERATING_VIEWS = {
    "perspective": (perspective, 1.0),
    "parallel": (parallel, 1.0),
    "long lens": (long_lens, 1.0),
    "very long lens": (very_long_lens, 1.0),
    "inside": (inside, 0.0),
    "mirrored": (mirrored, 1.0),
    "far from origin": (far_from_origin, 1.0),
    "perspective, depths from the eye": (perspective, 0.0),
    "parallel, depths from the eye": (parallel, 0.0),
    "long lens, depths from the eye": (long_lens, 0.0),
    "very long lens, depths from the eye": (very_long_lens, 0.0),
    "long lens, depths from close to the eye": (long_lens, 1e-3),
    "perspective, depths from far behind": (perspective, 30.0),
    "long lens, depths from far behind": (long_lens, 30.0),
}


@functools.cache
def scene(name):
    make, origin = GENERATING_VIEWS[name]
    rng = np.random.default_rng([list(GENERATING_VIEWS).index(name), 500])
    bounds, camera = make(rng)
    depth_origin = origin * max(rays.depth_range(camera, bounds)[0], 0.0)
    return Scene(
        sparse_vdi(rng, camera, bounds, WINDOW, depth_origin),
        full_vdi(camera, bounds, WINDOW, depth_origin),
    )


def sparse_vdi(rng, camera, bounds, window, depth_origin):
    """Blobs of lists, each with one supersegment in a few slabs, in four layers that may overlap:
    what overlaps is cut into supersegments that touch. Many begin or end at a slab's face, give or
    take a few units in the last place."""
    first, step = slabs_of(camera, bounds)
    layers = [_slabs_of_blobs(rng, window) for _ in range(4)]
    slabs = np.concatenate(layers, axis=1)
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
        window,
        np.concatenate([[0], np.cumsum(kept.sum(axis=1))]),
        front[kept],
        back[kept],
        rng.random((n, 3)),
        10 ** rng.uniform(-3, 0, size=n),
        bounds,
        depth_origin=depth_origin,
    )


def _slabs_of_blobs(rng, window):
    """Slabs at which each list's supersegment begins and ends, (lists, 2); the same where there is
    none."""
    width, height = window
    begin = np.zeros((height, width))
    extent = np.zeros((height, width))
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
    n = window[0] * window[1]
    first, step = slabs_of(camera, bounds)
    front, back = first - depth_origin, first + SLABS * step - depth_origin
    return VDI(
        camera,
        window,
        np.arange(n + 1),
        np.full(n, front),
        np.full(n, back),
        np.ones((n, 3)),
        np.full(n, 0.02),
        bounds,
        depth_origin=depth_origin,
    )


def slabs_of(camera, bounds):
    """View depth at which the first slab begins, and the thickness of a slab; world units."""
    near, far = rays.depth_range(camera, bounds)
    near = near if camera.parallel_projection else max(near, 1e-5)
    return near, (far - near) / SLABS


# -- new views -------------------------------------------------------------------------------------


def turned(angle):
    return lambda rng, vdi: (vdi.camera.azimuth(angle), SIZE)


def same(rng, vdi):
    """Every ray stays in one list."""
    return vdi.camera, vdi.window_size


def half(rng, vdi):
    """Every ray runs along two borders."""
    return vdi.camera, (WINDOW[0] // 2, WINDOW[1] // 2)


def eye_inside(rng, vdi):
    return strategies.camera_inside(rng, vdi.bounds, vdi.camera.model_transform), SIZE


def anywhere_parallel(rng, vdi):
    transform = vdi.camera.model_transform
    return strategies.camera_around(rng, vdi.bounds, transform, parallel=True), SIZE


def other_matrix(rng, vdi):
    """The model is mirrored, and elsewhere in its world than when the VDI was made."""
    transform = strategies.random_transform(rng, "mirror")
    return strategies.camera_around(rng, vdi.bounds, transform, parallel=False), SIZE


def a_long_way_off(rng, vdi):
    transform = vdi.camera.model_transform
    return strategies.camera_around(rng, vdi.bounds, transform, distance=200), SIZE


def beside(rng, vdi, right, up, size):
    """V_N in parallel projection, its axes combinations of V_O's (right, up, forward), about the
    middle of V_O's window at the middle of the bounds; a pixel is as high as V_O's window."""
    own = vdi.camera
    axes = own.axes
    near, far = rays.depth_range(own, vdi.bounds)
    depth = max((near + far) / 2, (far - near) / 4)
    half_height = own.half_extent(vdi.window_size)[1] * (1 if own.parallel_projection else depth)
    middle = own.position + axes[2] * depth
    right, up = (np.asarray(v) @ axes for v in (right, up))
    forward = np.cross(up, right)
    return (
        Camera(
            middle - forward * (far - near) * 2,
            middle,
            up,
            parallel_projection=True,
            parallel_scale=half_height,
            model_transform=own.model_transform,
        ),
        size,
    )


def along_u(rng, vdi):
    return beside(rng, vdi, (0, 0, 1), (0, 1, 0), SIZE)


def along_v(rng, vdi):
    return beside(rng, vdi, (0, 0, 1), (1, 0, 0), SIZE)


def along_list_borders(rng, vdi):
    """From a parallel V_O every ray runs along a border between two rows of lists."""
    return beside(rng, vdi, (0, 0, -1), (0, 1, 0), (SIZE[0], WINDOW[1] // 2))


def along_tile_borders(rng, vdi):
    """From a parallel V_O every ray runs along a border between two rows of tiles: pixels are two
    tiles high."""
    return beside(rng, vdi, (0, 0, 1), (0, 1, 0), (SIZE[0], WINDOW[1] // (2 * STACK)))


def across_corners(rng, vdi):
    """From a parallel V_O the middle column of rays runs through corners of lists."""
    c = math.sqrt(0.5)
    return beside(rng, vdi, (c, -c, 0), (0, 0, 1), (95, 75))


NEW_VIEWS = {
    "same": same,
    "half": half,
    "0.01 degrees": turned(0.01),
    "5 degrees": turned(5),
    "30 degrees": turned(30),
    "90 degrees": turned(90),
    "180 degrees": turned(180),
    "inside": eye_inside,
    "parallel": anywhere_parallel,
    "other matrix": other_matrix,
    "a long way off": a_long_way_off,
    "along u": along_u,
    "along v": along_v,
    "along list borders": along_list_borders,
    "along tile borders": along_tile_borders,
    "across corners": across_corners,
}

#: Views whose rays cross too few lists for a look at the grid.
IN_ONE_LIST = ("same", "half", "0.01 degrees")

#: Least share of the way of all rays through a full VDI that is passed by, and least share of the
#: rays that meet a supersegment of the sparse one. Measured: .13 and .031.
MIN_PASSED, MIN_DRAWN = 0.1, 0.02


def new_view(name, vdi, generating_view):
    seed = [list(NEW_VIEWS).index(name), list(GENERATING_VIEWS).index(generating_view), 600]
    return NEW_VIEWS[name](np.random.default_rng(seed), vdi)


class Passed(NamedTuple):
    share: float  # of the way of all rays through the full VDI
    drawn: float  # of the rays that meet the full VDI: those that meet the sparse one


def passed_by(runtime, scene, camera, size, image):
    """What of the full VDI the sparse one's grid skips, and what of the sparse VDI there is."""
    full = prepared_vdi(runtime, scene.full)
    own = runtime.download(full.occupancy.masks)
    whole = render_vdi(scene.full, camera, size, device=runtime)
    try:
        sparse = prepared_vdi(runtime, scene.sparse).occupancy.masks
        runtime.write(full.occupancy.masks, runtime.download(sparse))
        rest = render_vdi(scene.full, camera, size, device=runtime)
    finally:
        runtime.write(full.occupancy.masks, own)
    whole, rest = (-np.log1p(-alpha[..., 3].astype(np.float64)) for alpha in (whole, rest))
    meets = whole > 0
    assert meets.any()
    return Passed(1 - rest.sum() / whole.sum(), (image[meets][:, 3] > 0).mean())


def pairs_of_views():
    """Every generating view with every new one.

    The quick ones: each with a third of the others, and all new views of a parallel generating
    view, from which rays run exactly along borders and through corners.
    """
    for (i, own), (k, new) in itertools.product(enumerate(GENERATING_VIEWS), enumerate(NEW_VIEWS)):
        quick = (i + k) % 3 == 0 or own == "parallel"
        yield pytest.param(own, new, marks=() if quick else pytest.mark.slow)


@pytest.mark.every(12)
@pytest.mark.usefixtures("_dealt")
@pytest.mark.parametrize(("generating_view", "name"), list(pairs_of_views()))
def test_sparse_vdis(runtime, generating_view, name):
    both = scene(generating_view)
    camera, size = new_view(name, both.sparse, generating_view)
    image = assert_same_bits(runtime, both.sparse, camera, size)
    if name not in IN_ONE_LIST:
        passed = passed_by(runtime, both, camera, size, image)
        assert passed.share > MIN_PASSED
        assert passed.drawn > MIN_DRAWN


@pytest.mark.every(6)
@pytest.mark.parametrize("generating_view", GENERATING_VIEWS)
def test_rays_that_end_early(runtime, generating_view):
    """At opaque geometry, at clipping planes, and where nothing more can be seen."""
    both = scene(generating_view)
    vdi = both.sparse
    rng = np.random.default_rng([list(GENERATING_VIEWS).index(generating_view), 700])
    camera, size = NEW_VIEWS["30 degrees"](rng, vdi)
    near, far = strategies.view_depths(camera, vdi.bounds)
    depth = rng.uniform(near, far, size=size[::-1]).astype(np.float32)
    depth[rng.random(depth.shape) < 0.3] = np.inf
    corners = strategies.world_corners(vdi.bounds, camera.model_transform)
    points = rng.uniform(corners.min(axis=0), corners.max(axis=0), size=(2, 3))
    planes = np.hstack([points, rng.normal(size=(2, 3))])
    whole = assert_same_bits(runtime, vdi, camera, size)
    for ends in (
        {"opaque_depth": depth},
        {"clipping_planes": planes[:1]},
        {"opaque_depth": depth, "clipping_planes": planes},
    ):
        image = assert_same_bits(runtime, vdi, camera, size, **ends)
        assert (image != whole).any()
    box = np.reshape(vdi.bounds, (3, 2))
    crops = box[:, :1] + np.array([0.3, 0.6]) * (box[:, 1:] - box[:, :1])
    for regions in ("subvolume", "fence", "inverted_cross", int(rng.integers(2**27))):
        shown = {"cropping": (crops.ravel(), regions), "opacity_multiplier": 2.5}
        image = assert_same_bits(runtime, vdi, camera, size, **shown)
        assert (image != whole).any()
    tau = vdi.optical_depth * np.float32(1e3)
    assert_same_bits(runtime, changed(vdi, optical_depth=tau), camera, size)


@pytest.mark.every(3)
@pytest.mark.usefixtures("_dealt")
@pytest.mark.parametrize("kind", strategies.VIEWS)
def test_random_vdis(runtime, kind):
    """Windows from one list on, supersegments beyond the bounds, any matrix."""
    drawn = 0
    for case in range(N_CASES):
        seed = [case, strategies.VIEWS.index(kind), 800]
        rng = np.random.default_rng(seed)
        vdi = strategies.random_vdi(rng, max_window=(60, 45), max_supersegments=5)
        # Most lists are emptied, some tiles of them wholly
        kept = rng.random(vdi.counts.shape) < rng.choice([0.02, 0.3])
        vdi = with_lists(vdi, kept.ravel())
        camera, size = strategies.random_view(rng, vdi, kind)
        size = size if kind in ("same", "half") else (3 * size[0], 3 * size[1])
        image = assert_same_bits(runtime, vdi, camera, size, name=f"seed {seed}")
        drawn += (image[..., 3] > 0).sum()
    assert drawn > 100


def changed(vdi, **arrays):
    """A VDI with other arrays."""
    names = ("offsets", "front", "back", "color", "optical_depth")
    arrays = {name: arrays.get(name, getattr(vdi, name)) for name in names}
    window, origin = vdi.window_size, vdi.depth_origin
    return VDI(vdi.camera, window, **arrays, bounds=vdi.bounds, depth_origin=origin)


def with_lists(vdi, kept):
    """A VDI of which all lists but those ``kept``, bool (W * H,), are empty."""
    counts = np.diff(vdi.offsets)
    of_kept = np.repeat(kept, counts.astype(np.int64))
    return changed(
        vdi,
        offsets=np.concatenate([[0], np.cumsum(counts * kept)]).astype(np.uint64),
        front=vdi.front[of_kept],
        back=vdi.back[of_kept],
        color=vdi.color[of_kept],
        optical_depth=vdi.optical_depth[of_kept],
    )


def test_rays_through_corners_of_tiles(runtime):
    """Tiles are filled as a chess board is black, and rays run through the corners of its white
    squares. Where rounding has a ray cut the corner of a black one, it does so by a few units in
    the last place; the medium is so dense that this can be seen, and so can a list that skipping
    should have visited."""
    size = (1, 4)
    cut = 0
    for case in range(100):
        rng = np.random.default_rng([case, 900])
        bounds, camera = outside(rng, parallel=True)
        # The window is a square well within the bounds, of 6 x 6 tiles
        shortest = np.diff(np.reshape(bounds, (3, 2))).min()
        camera = camera.replace(
            focal_point=np.reshape(bounds, (3, 2)).mean(axis=1),
            parallel_scale=shortest / 8,
            window_center=(0, 0),
            use_horizontal_view_angle=False,
        )
        dense = full_vdi(camera, bounds, (6 * STACK, 6 * STACK), 0.0)
        tile = np.arange(6 * STACK) // STACK
        black = ((tile[:, None] + tile) % 2 == 1).ravel()
        dense = changed(dense, optical_depth=np.full_like(dense.optical_depth, 1e7))
        board = with_lists(dense, black)
        for sign in (1, -1):
            # An exact diagonal reaches both borders at once, which is too easy
            right = sign * (np.array([1, -1, 0]) + rng.normal(size=3) * 3e-7) / math.sqrt(2)
            new, _ = beside(rng, board, right, (0, 0, 1), size)
            image = assert_same_bits(runtime, board, new, size, name=f"case {case}, sign {sign}")
            cut += ((image[..., 3] > 0) & (image[..., 3] < 1)).sum()
    assert cut > 100


def test_vdis_of_one_list_and_of_none(runtime):
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0))
    bounds = (-1, 1, -1, 1, -1, 1)
    one = VDI(camera, (1, 1), [0, 1], [4.5], [5.5], [[0.2, 0.5, 0.9]], [0.7], bounds)
    none = VDI(camera, (33, 40), [0] * (33 * 40 + 1), [], [], [], [], bounds)
    for new in (camera, camera.azimuth(70), camera.azimuth(180)):
        assert assert_same_bits(runtime, one, new, (50, 40)).any()
        assert not assert_same_bits(runtime, none, new, (50, 40)).any()


# -- real volumes ----------------------------------------------------------------------------------


def volumes_and_looks():
    """The shipped volumes with every standard transfer function, the others with the soft one."""
    shipped = ("brain", "rayleigh_taylor")
    for name in shipped:
        for look in TRANSFER_FUNCTIONS:
            yield pytest.param(name, look, (320, 180))
    for name in examples.WHOLE:
        if name not in shipped:
            marks = (pytest.mark.slow, pytest.mark.real_data)
            yield pytest.param(name, "soft", (1280, 720), marks=marks)


@pytest.mark.every(3)
@pytest.mark.parametrize(("name", "look", "size"), [*volumes_and_looks()])
def test_real_volumes(runtime, name, look, size):
    pytest.importorskip("pyvista")
    volume = require_data(name)
    camera = filling_camera(volume.bounds, size)
    vdi = generate(volume, camera, size, device=runtime, **TRANSFER_FUNCTIONS[look])
    for angle in (0, 5, 30, 60, 90, 180):
        image = assert_same_bits(runtime, vdi, camera.azimuth(angle), size, name=f"{angle} degrees")
        assert image.any()
