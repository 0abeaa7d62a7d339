"""Small scenes at the extremes, and the two comparisons that each goes through.

A scene's volume is drawn directly, and turned into a VDI that is drawn from some views. The direct
image is held against the float64 reference of the volume, the VDI's against the oracle of that VDI.
Every view must see something: a comparison of nothing with nothing proves nothing.
"""

from __future__ import annotations

import math

import numpy as np
import reference
import strategies
from drawing import generate_vdi, raycast_volume, render_vdi
from oracle import explain

from pyvista_vdi import VDI, Camera, TransferFunction, Volume

#: Odd, so that what is thinner than a pixel and lies in the middle is seen.
WINDOW = (9, 7)

#: What the project promises at the extremes: largest error of a channel.
BOUND = 5e-5

#: New views, degrees about the view up direction.
TURNS = (0, 25, 90, 180)

#: Smooth noise that uses all of 0..1, float64 (7, 8, 9).
FIELD = strategies.random_array(np.random.default_rng(3), np.float64, (7, 8, 9))
FIELD = (FIELD - FIELD.min()) / np.ptp(FIELD)

_SHARES = np.linspace(0, 1, 16)


def transfer(low=0.0, high=1.0, *, opacity=0.6, unit_distance=None, **options):
    """A colourful ramp over low..high."""
    options = {"interpolation": "linear", **options}
    colors = np.stack([_SHARES, 1 - _SHARES, 0.5 + 0 * _SHARES], axis=1)
    return TransferFunction(
        colors, opacity * _SHARES, (low, high), unit_distance=unit_distance, **options
    )


def field_volume(spacing=1.0, offset=0.0, **options):
    """:data:`FIELD` as float32, its origin ``offset`` extents away."""
    spacing = np.broadcast_to(np.asarray(spacing, dtype=np.float64), 3)
    origin = offset * np.linalg.norm(spacing * (8, 7, 6)) * np.array([1, -0.7, 0.3])
    return Volume(FIELD.astype(np.float32), spacing, origin, **options)


def view(volume, azimuth=30.0, elevation=20.0, *, distance=4.0, transform=None, **options):
    """A view that the bounds fill, whatever their shape; ``distance`` in half diagonals."""
    matrix = np.eye(4) if transform is None else np.asarray(transform, dtype=np.float64)
    corners = strategies.world_corners(volume.bounds, matrix)
    centre = corners.mean(axis=0)
    reach = np.linalg.norm(corners - centre, axis=1).max()
    a, e = math.radians(azimuth), math.radians(elevation)
    towards = np.array([math.cos(e) * math.sin(a), math.sin(e), math.cos(e) * math.cos(a)])
    camera = Camera(centre + towards * distance * reach, centre, (0, 1, 0), model_transform=matrix)
    return fitted(camera, corners, **options)


def fitted(camera, corners, *, size=WINDOW, parallel=False, zoom=False):
    """The view with a lens that just holds world points, all before the eye.

    With ``zoom`` it holds the short way across them only, so that every pixel of a view of a
    needle sees some of it.
    """
    x, y, z = np.transpose((corners - camera.position) @ camera.axes.T)
    aspect = size[0] / size[1]
    if parallel:
        scale = _across(x, y) if zoom else max(np.abs(y).max(), np.abs(x).max() / aspect)
        return camera.replace(parallel_projection=True, parallel_scale=float(scale))
    x, y = x / z, y / z
    tangent = _across(x, y) if zoom else max(np.abs(y).max(), np.abs(x).max() / aspect)
    return camera.replace(view_angle=2 * math.degrees(math.atan(tangent)))


def _across(x, y):
    """Half of the shorter extent of points about the window's centre, whichever way it lies."""
    short = np.linalg.svd(np.stack([x, y], axis=1), full_matrices=False)[2][1]
    return float(np.abs(short @ [x, y]).max())


def turned(camera, volume, turns=TURNS, **options):
    """The same view from all sides of the volume."""
    corners = strategies.world_corners(volume.bounds, camera.model_transform)
    options = {"parallel": camera.parallel_projection, **options}
    return [fitted(camera.azimuth(turn), corners, **options) if turn else camera for turn in turns]


def check_scene(
    runtime,
    worst,
    volume,
    function,
    camera,
    views=None,
    *,
    size=WINDOW,
    bound=BOUND,
    least_drawn=3,
    lights=None,
    sample_distance=None,
    **options,
):
    """Hold all images of a scene against float64; return the VDI.

    ``worst`` is the fixture that keeps the largest error. ``least_drawn``: pixels that every view
    must see something in.
    """
    views = turned(camera, volume) if views is None else views
    scene = (volume, camera, size, function)
    options = {**options, "sample_distance": sample_distance, "lights": lights, "device": runtime}
    direct = raycast_volume(*scene, **options)
    exact = reference.volume_image(*scene, sample_distance, lights)
    assert (exact[..., 3] > 1e-9).sum() >= least_drawn
    assert_within(worst, "volume", direct, exact, bound)
    vdi = generate_vdi(*scene, max_supersegments=8, **options)
    assert_within(worst, "VDI at V_O", render_vdi(vdi, camera, device=runtime), exact, bound)
    check_views(runtime, worst, vdi, views, size=size, least_drawn=least_drawn)
    return vdi


def assert_within(worst, what, image, exact, bound=BOUND):
    """Keep the largest difference, and hold it within the bound."""
    off = np.abs(image - exact).max()
    worst(what, off)
    assert off <= bound


def check_views(runtime, worst, vdi, views, *, size=WINDOW, least_drawn=3, **ends):
    """Hold a VDI's images against the oracle's range."""
    for number, camera in enumerate(views):
        image = render_vdi(vdi, camera, size, device=runtime, **ends)
        result = explain(
            vdi, camera, size, image, name=f"view {number}, {camera}", escalation=(0, 100), **ends
        )
        worst("view", result.worst)
        assert not result.failures, "\n".join(result.failures[:3])
        assert (image[..., 3] > 1e-9).sum() >= least_drawn, f"view {number} sees nothing: {camera}"


def slabs_vdi(camera, faces, optical_depth, *, window=(1, 1), bounds, depth_origin=0.0, color=None):
    """A VDI whose lists are alike: ``faces`` (n, 2) less the depth origin."""
    faces = np.asarray(faces, dtype=np.float64).reshape(-1, 2)
    lists, n = window[0] * window[1], len(faces)
    color = (0.2, 0.5, 0.8) if color is None else color
    return VDI(
        camera,
        window,
        np.arange(lists + 1, dtype=np.uint64) * np.uint64(n),
        np.tile(faces[:, 0], lists).astype(np.float32),
        np.tile(faces[:, 1], lists).astype(np.float32),
        np.tile(np.broadcast_to(np.float32(color), (n, 3)), (lists, 1)),
        np.tile(np.broadcast_to(np.float32(optical_depth), n), lists),
        bounds,
        depth_origin=depth_origin,
    )
