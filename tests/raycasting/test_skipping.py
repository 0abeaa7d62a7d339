"""Pictures with and without empty-space skipping are the same to the last bit, on every platform.

Skipping is forced, also where the grid has too little empty space to gain by it. The VDIs are made
so that its hard cases are common: blobs of lists, each with supersegments in a few slabs, many of
whose faces lie within a few units in the last place of a slab's face.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from drawing import render_vdi
from ray_scenes import generating_view

from pyvista_vdi import VDI, Camera
from pyvista_vdi.device.constants import SLABS, STACK
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.raycasting.prepared import OccupancyGrid

#: Lists of the sparse VDIs: many tiles, those of the last column cut off. The middle is a corner of
#: lists, and lies on a border between two rows of tiles.
WINDOW = (200, 160)

#: Pixels of their pictures, unless a view needs others.
SIZE = (96, 75)


@pytest.fixture(autouse=True)
def _skipping_is_forced(monkeypatch):
    monkeypatch.setattr(OccupancyGrid, "worthwhile", True)


#: Generating views, where the VDI counts its depths from, in near depths of the bounds (others than
#: 1 are for VDIs that another program made), a new view and how rays are followed. The view is
#: turned by degrees, or one of :func:`beside`: along a border between two rows of lists; along one
#: of tiles, by pixels two tiles high; and the middle column of rays through corners of lists.
SCENES = [
    ("perspective", 1.0, 30, "blocks"),
    ("inside", 0.0, 180, "blocks"),
    ("parallel", 1.0, ((0, 0, -1), (0, 1, 0), (96, 80)), "one by one"),
    ("parallel", 1.0, ((math.sqrt(0.5), -math.sqrt(0.5), 0), (0, 0, 1), (95, 75)), "one by one"),
    ("parallel", 1.0, ((0, 0, 1), (0, 1, 0), (96, 160 // (2 * STACK))), "one by one"),
    ("very long lens", 1.0, 90, "packets"),
]


def scene(kind, origin):
    rng = np.random.default_rng([len(kind), int(origin), 500])
    # A part of what the camera sees, so that the bounds fill most of the window
    bounds, camera = generating_view(rng, kind, zoom=0.6)
    depth_origin = origin * max(rays.depth_range(camera, bounds)[0], 0.0)
    return sparse_vdi(rng, camera, bounds, depth_origin)


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


@pytest.mark.parametrize(("kind", "origin", "new", "dealt"), SCENES, indirect=["dealt"])
def test_sparse_vdis(runtime, kind, origin, new, dealt):
    vdi = scene(kind, origin)
    turn = np.isscalar(new)
    camera, size = (vdi.camera.azimuth(new), SIZE) if turn else beside(vdi, *new)
    plain, image = (
        render_vdi(vdi, camera, size, skip_empty=skip, device=runtime) for skip in (False, True)
    )
    differs = plain.view(np.uint32) != image.view(np.uint32)  # so that -0 and NaN count as well
    assert not differs.any(), np.argwhere(differs)[0]
    assert (image[..., 3] > 0).mean() > 0.02  # measured: 0.031
