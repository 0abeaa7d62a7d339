"""Generating views, ends of rays and changed VDIs that tests of the raycaster share."""

from __future__ import annotations

import numpy as np
import strategies

from pyvista_vdi import VDI, Camera, Cropping

#: Lenses of :func:`generating_view` that differ from a perspective three radii away.
_LENSES = {
    "parallel": {"parallel": True},
    "long lens": {"distance": 50},  # depth is kept relative: far over near depth is below 2
    "very long lens": {"distance": 1e4},  # absolute depths leave float32 no digits for the medium
    "any matrix": {"distance": None, "parallel": None},
}
#: Matrices of the model: world units a million times the model's, the reverse, a stretched actor.
_SCALES = {"tiny world": [1e-6] * 3, "huge world": [1e6] * 3, "flat world": [1, 1, 1e3]}


def generating_view(rng, kind, zoom=1.0):
    """Bounds and a view of them; ``zoom`` below 1 shows a part of what it would see."""
    bounds = strategies.random_bounds(rng)
    if kind == "far from origin":  # 1e5 of its size away
        bounds = bounds + np.repeat(rng.normal(size=3) * 3e5, 2)
    if kind == "inside":
        return bounds, strategies.camera_inside(rng, bounds, np.eye(4))
    if kind == "eye on the bounds":  # depths from 0
        eye = centre = bounds.reshape(3, 2).mean(axis=1)
        eye = np.append(bounds[0], centre[1:])
        return bounds, Camera(eye, centre, (0, 0, 1), view_angle=60)
    transform = np.diag([*_SCALES.get(kind, [1] * 3), 1.0])
    if kind in ("mirrored", "any matrix"):
        transforms = ["mirror"] if kind == "mirrored" else ["scale", "mirror", "shear"]
        transform = strategies.random_transform(rng, rng.choice(transforms))
    if kind == "zoomed in":  # most of a new ray lies outside of the viewport
        zoom = 1 / 20
    lens = {"distance": 3, "parallel": False, **_LENSES.get(kind, {})}
    camera = strategies.camera_around(rng, bounds, transform, **lens)
    return bounds, camera.replace(
        view_angle=camera.view_angle * zoom, parallel_scale=camera.parallel_scale * zoom
    )


def reciprocal_vdi(rng, bounds=None, **options):
    """A random VDI of a perspective view from near by, whose depths are all of one form."""
    bounds = strategies.random_bounds(rng) if bounds is None else bounds
    transform = strategies.random_transform(rng)
    camera = strategies.camera_around(rng, bounds, transform, distance=2, parallel=False)
    return strategies.random_vdi(rng, camera=camera, bounds=bounds, **options)


def random_ends(rng, vdi, camera, size, planes=1):
    """Opaque depths, some infinite and some before everything, and clipping planes."""
    near, far = strategies.view_depths(camera, vdi.bounds)
    depth = rng.uniform(near - 0.1 * (far - near), far, size=size[::-1]).astype(np.float32)
    depth[rng.random(depth.shape) < 0.3] = np.inf
    corners = strategies.world_corners(vdi.bounds, camera.model_transform)
    points = rng.uniform(corners.min(axis=0), corners.max(axis=0), size=(planes, 3))
    normals = rng.normal(size=(planes, 3))
    return {"opaque_depth": depth, "clipping_planes": np.hstack([points, normals])}


def random_planes(rng, bounds):
    """Two cropping planes per axis, some of them outside the bounds."""
    box = np.reshape(bounds, (3, 2))
    shares = np.sort(rng.uniform(-0.1, 1.1, size=(3, 2)), axis=1)
    return (box[:, :1] + shares * (box[:, 1:] - box[:, :1])).ravel()


def random_cropping(rng, bounds, regions):
    """Two planes across each axis, or across each of three directions that are not at right angles.

    Some planes are outside the bounds.
    """
    normals = np.eye(3)
    if rng.random() < 0.5:
        normals = normals + rng.uniform(-0.4, 0.4, (3, 3))
    reach = Cropping((0,) * 6, normals=normals).reach(bounds)
    return Cropping(random_planes(rng, reach.ravel()), regions, normals)


def rebuilt(vdi, **changes):
    """The VDI with other arguments."""
    names = "camera window_size offsets front back color optical_depth bounds depth_origin"
    return VDI(**{**{name: getattr(vdi, name) for name in names.split()}, **changes})


def with_some(vdi, kept, share=1.0):
    """The VDI with some of its supersegments, bool (n,), and a share of their optical depths."""
    before = np.concatenate([[0], np.cumsum(kept)])
    return rebuilt(
        vdi,
        offsets=before[vdi.offsets.astype(np.int64)],
        front=vdi.front[kept],
        back=vdi.back[kept],
        color=vdi.color[kept],
        optical_depth=vdi.optical_depth[kept] * np.float32(share),
    )


def with_lists(vdi, kept):
    """The VDI of which all lists but those ``kept``, bool (H, W) or (H * W,), are empty."""
    return with_some(vdi, np.repeat(np.ravel(kept), vdi.counts.ravel()))
