"""Views: the same as V_O and nearly so, along axes and borders, from inside, with any lens."""

from __future__ import annotations

import math

import numpy as np
import pytest
from drawing import generate_vdi
from extreme_scenes import (
    WINDOW,
    check_scene,
    check_views,
    field_volume,
    slabs_vdi,
    transfer,
    turned,
    view,
)

from pyvista_vdi import Camera
from pyvista_vdi.device.constants import STACK
from pyvista_vdi.raycasting.prepared import PreparedVDI

pytestmark = pytest.mark.extremes

VOLUME = field_volume()
BOX = np.reshape(VOLUME.bounds, (3, 2))
CENTRE = BOX.mean(axis=1)
REACH = np.linalg.norm(BOX[:, 1] - CENTRE)


def vdi_from(runtime, camera, size=WINDOW):
    return generate_vdi(VOLUME, camera, size, transfer(), max_supersegments=8, device=runtime)


def along(vdi, first, last):
    """A parallel view of one pixel whose ray runs through two points of V_O's list space.

    ``first`` and ``last`` are (u, v, depth) in V_O: viewport coordinates and world units.
    """
    origin, direction = vdi.camera.ray_coefficients(vdi.window_size)
    to_world = np.linalg.inv(vdi.camera.view_matrix)
    pixels = np.array([[1, u, v] for u, v, _ in (first, last)])
    points = pixels @ origin + [[first[2]], [last[2]]] * (pixels @ direction)
    ends = points @ to_world[:3, :3].T + to_world[:3, 3]
    forward = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    up = (0, 1, 0) if abs(forward[1]) < 0.9 else (1, 0, 0)
    return Camera(*ends, up, parallel_projection=True, parallel_scale=1e-3)


@pytest.mark.parametrize("parallel", [False, True])
def test_rays_along_axes_borders_and_corners(runtime, worst, parallel):
    """Parallel to u, v, both (depth) and neither; along edges of lists and of tiles; corners."""
    camera = view(VOLUME, 0, 0, parallel=parallel)
    vdi = vdi_from(runtime, camera, (2 * STACK + 8, 2 * STACK))
    wide, high = vdi.window_size
    near, far = 3 * REACH, 5 * REACH  # the view's distance is 4
    middle = (near + far) / 2
    edge_u, edge_v = 2 * (wide // 2 + 3) / wide - 1, 2 * (high // 2 - 2) / high - 1
    tile_u, tile_v = 2 * STACK / wide - 1, 2 * STACK / high - 1
    inner_u, inner_v = edge_u + 1 / wide, edge_v + 1 / high
    rays = {
        "along u": ((-1, inner_v, middle), (1, inner_v, middle)),
        "along v": ((inner_u, -1, middle), (inner_u, 1, middle)),
        "along depth": ((inner_u, inner_v, near), (inner_u, inner_v, far)),
        "back along depth": ((inner_u, inner_v, far), (inner_u, inner_v, near)),
        "along u on an edge": ((-1, edge_v, middle), (1, edge_v, middle)),
        "along v on an edge": ((edge_u, -1, middle), (edge_u, 1, middle)),
        "along depth on an edge": ((edge_u, inner_v, near), (edge_u, inner_v, far)),
        "along depth on a corner": ((edge_u, edge_v, near), (edge_u, edge_v, far)),
        "along a tile's edge": ((-1, tile_v, middle), (1, tile_v, middle)),
        "along a tile's corner": ((tile_u, tile_v, near), (tile_u, tile_v, far)),
        # The window's diagonal of square lists goes through a corner of each
        "through corners": (
            (tile_u - 2 * STACK / wide, tile_v - 2 * STACK / high, middle),
            (tile_u + 2 * STACK / wide, tile_v + 2 * STACK / high, middle),
        ),
        "across u in a plane": ((-1, inner_v, near), (1, inner_v, far)),
        "across v in a plane": ((inner_u, -1, far), (inner_u, 1, near)),
    }
    for first, last in rays.values():
        check_views(runtime, worst, vdi, [along(vdi, first, last)], size=(1, 1), least_drawn=1)


EYES = {
    "centre": (CENTRE, CENTRE + np.array([0, 0, 1])),
    "face": ([CENTRE[0], CENTRE[1], BOX[2, 1]], CENTRE),
    "corner": (BOX[:, 1], CENTRE),
    "in a face's plane": (
        [CENTRE[0], CENTRE[1], BOX[2, 1]],
        [BOX[0, 1], CENTRE[1], BOX[2, 1]],
    ),
}


@pytest.mark.parametrize("place", EYES)
def test_eyes_in_the_volume(runtime, worst, place):
    """As V_O and as V_N: inside, on a face, on a corner, looking along a face."""
    position, focal_point = EYES[place]
    camera = Camera(position, focal_point, (0, 1, 0.01), view_angle=60)
    outside = view(VOLUME)
    views = [camera, *turned(outside, VOLUME, (0, 90))]
    check_scene(runtime, worst, VOLUME, transfer(), camera, views)
    inward = [camera, camera.azimuth(20), camera.azimuth(-20)]
    check_views(runtime, worst, vdi_from(runtime, outside), inward)


def lens(angle):
    """A view whose half angle holds half a diagonal; from inside where it is wide."""
    distance = 1 / math.tan(math.radians(angle) / 2)
    return view(VOLUME, distance=max(distance, 1.02)).replace(view_angle=angle)


@pytest.mark.parametrize(
    ("own", "new"), [(0.01, 170), (170, 0.01), pytest.param(30, 170, marks=pytest.mark.slow)]
)
def test_fields_of_view(runtime, worst, own, new):
    size = (19, 15)  # what is near covers a few pixels of the widest lens
    camera = lens(own)
    views = [camera, lens(new), lens(new).azimuth(90), lens(new).azimuth(180)]
    check_scene(runtime, worst, VOLUME, transfer(), camera, views, size=size, least_drawn=1)


@pytest.mark.parametrize("size", [(1, 101), (301, 3), (1, 1)], ids=str)
def test_windows_of_extreme_aspect(runtime, worst, size):
    """The volume fills the shorter edge, or it would be a fraction of a pixel high."""
    camera = view(VOLUME).replace(use_horizontal_view_angle=size[0] < size[1])
    views = [camera, camera.azimuth(25), camera.azimuth(180)]
    check_scene(runtime, worst, VOLUME, transfer(), camera, views, size=size, least_drawn=1)


@pytest.mark.parametrize(
    ("distance", "origin"),
    [
        *((distance, 1.0) for distance in (1.01, 2.99, 3.01, 1e6)),
        (3.01, 0.0),
    ],
)
def test_both_depth_coordinates_at_the_border_of_their_choice(runtime, worst, distance, origin):
    """Far depth over near depth from long lenses to over 2: 3 half depths away it is 2.

    From there on that of a long lens is used where depths count from the near one, and the other
    one where they count from the eye.
    """
    camera = Camera((0, 0, distance), (0, 0, 0), (0, 1, 0))
    camera = camera.replace(view_angle=2 * math.degrees(math.atan(1 / (distance - 1))))
    faces = np.array([[0.0, 0.2], [0.2, 0.21], [0.7, 1.5], [1.99, 2.0]])
    depth_origin = origin * (distance - 1)
    vdi = slabs_vdi(
        camera, faces + (distance - 1 - depth_origin), [0.3, 1.0, 0.5, 2.0], window=(5, 4),
        bounds=(-1, 1, -1, 1, -1, 1), depth_origin=depth_origin,
    )  # fmt: skip
    is_long_lens = PreparedVDI(runtime, vdi).shifted
    assert is_long_lens == (distance >= 3 and origin == 1)
    around = Camera((1.5, 1, 5), (0, 0, 0), (0, 1, 0))
    check_views(runtime, worst, vdi, [camera, around, around.azimuth(90), around.azimuth(180)])
