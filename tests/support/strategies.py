"""Random VDIs, cameras, volumes and transfer functions: seeded generators, and for hypothesis.

Everything is drawn from a ``numpy.random.Generator``, so that a case is named by its seed; the
hypothesis strategies at the end draw the seed.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
from hypothesis import strategies as st

from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.chunked import VOXEL_TYPES
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI, DeferredVDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.raycasting import choose

#: Views of a VDI that :func:`random_view` draws; the hard ones by name.
VIEWS = (
    "same",  # V_N = V_O at the VDI's own size: two components of the direction vanish
    "half",  # V_O at half its size: every ray runs along borders
    "near",  # turned by up to 40 degrees
    "around",  # anywhere around the bounds
    "behind",  # from the opposite side: rays run back towards V_O
    "beside",  # at a right angle: rays run across the lists
    "inside",  # the eye in the bounds
    "axis",  # along an axis of V_O's view space, in parallel projection: components vanish
    "parallel",  # parallel projection from anywhere
    "far",  # a long lens from a hundred diagonals
)


# -- cameras ---------------------------------------------------------------------------------------


def random_rotation(rng):
    """A proper rotation, float64 (3, 3), uniform over the sphere of unit quaternions."""
    w, x, y, z = _unit(rng.normal(size=4))
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def random_transform(rng, kind=None):
    """An affine matrix, float64 (4, 4): "identity", "rigid", "scale", "mirror" or "shear"."""
    kind = kind or rng.choice(["identity", "identity", "rigid", "scale", "mirror", "shear"])
    matrix = np.eye(4)
    if kind == "identity":
        return matrix
    matrix[:3, :3] = random_rotation(rng)
    matrix[:3, 3] = rng.normal(size=3) * 3
    if kind in ("scale", "mirror", "shear"):
        matrix[:3, :3] *= 2 ** rng.uniform(-1, 1, size=3)
    if kind == "mirror":
        matrix[:3, 0] *= -1
    if kind == "shear":
        matrix[:3, 1] += rng.uniform(-0.5, 0.5) * matrix[:3, 0]
    return matrix


def random_bounds(rng):
    """Axis-aligned bounds with edges between 1 and 4 model units, around the origin or not."""
    edges = rng.uniform(1, 4, size=3)
    centre = rng.normal(size=3) * rng.choice([0.0, 2.0, 20.0])
    return np.stack([centre - edges / 2, centre + edges / 2], axis=1).ravel()


def world_corners(bounds, transform):
    """The corners of bounds in the model frame, carried to the world; float64 (8, 3)."""
    corners = np.array(list(itertools.product(*np.reshape(bounds, (3, 2)))))
    return corners @ transform[:3, :3].T + transform[:3, 3]


def camera_around(rng, bounds, transform, *, distance=None, direction=None, parallel=None):
    """A view of bounds from outside (or from ``distance`` half diagonals), filling the window or
    cutting some of them off."""
    corners = world_corners(bounds, transform)
    centre = corners.mean(axis=0)
    radius = np.linalg.norm(corners - centre, axis=1).max()
    distance = rng.uniform(1.2, 6) if distance is None else distance
    direction = _unit(rng.normal(size=3)) if direction is None else _unit(direction)
    focal_point = centre + rng.normal(size=3) * radius * 0.1
    position = centre + direction * distance * radius
    up = rng.normal(size=3)
    parallel = bool(rng.random() < 0.3) if parallel is None else parallel
    fill = rng.uniform(0.5, 1.3)  # half height of the window in radii
    angle = 2 * math.degrees(math.atan(fill / max(distance, 0.7)))
    return Camera(
        position,
        focal_point,
        up,
        view_angle=min(angle, 120.0),
        parallel_projection=parallel,
        parallel_scale=fill * radius,
        window_center=rng.uniform(-0.3, 0.3, size=2) if rng.random() < 0.2 else (0.0, 0.0),
        use_horizontal_view_angle=bool(rng.random() < 0.2),
        model_transform=transform,
    )


def camera_inside(rng, bounds, transform):
    """A perspective view from a point inside the bounds."""
    low, high = np.reshape(bounds, (3, 2)).T
    eye, target = low + rng.uniform(0.2, 0.8, size=(2, 3)) * (high - low)
    points = np.stack([eye, target]) @ transform[:3, :3].T + transform[:3, 3]
    return Camera(
        points[0],
        points[1],
        rng.normal(size=3),
        view_angle=rng.uniform(30, 100),
        model_transform=transform,
    )


def random_camera(rng, bounds):
    """A view from outside, or, once in eight, from inside; with a random model transform."""
    transform = random_transform(rng)
    if rng.random() < 1 / 8:
        return camera_inside(rng, bounds, transform)
    return camera_around(rng, bounds, transform)


def random_view(rng, vdi, kind):
    """A new view of a VDI, one of :data:`VIEWS`: a camera and a window size."""
    own = vdi.camera
    if kind == "same":
        return own, vdi.window_size
    if kind == "half":
        return own, tuple(max(1, edge // 2) for edge in vdi.window_size)
    size = (int(rng.integers(1, 20)), int(rng.integers(1, 15)))
    # Half of the new views put the model elsewhere in their world
    transform = own.model_transform if rng.random() < 0.5 else random_transform(rng)
    if kind == "near":
        return own.azimuth(rng.uniform(-40, 40)).elevation(rng.uniform(-20, 20)), size
    if kind == "inside":
        return camera_inside(rng, vdi.bounds, transform), size
    if kind in ("behind", "beside", "axis"):
        transform = own.model_transform
        right, up, forward = own.axes
        if kind == "behind":
            direction = forward + rng.normal(size=3) * 0.2
        elif kind == "beside":
            angle = rng.uniform(0, 2 * math.pi)
            direction = right * math.cos(angle) + up * math.sin(angle) + forward * 0.1
        else:
            direction = [right, -right, up, -up, forward, -forward][rng.integers(6)]
        camera = camera_around(rng, vdi.bounds, transform, direction=direction)
        if kind == "axis":
            camera = camera.replace(
                focal_point=np.subtract(camera.position, direction),
                view_up=up if abs(np.dot(direction, up)) < 0.5 else right,
                parallel_projection=True,
            )
        return camera, size
    distance = 200.0 if kind == "far" else None
    parallel = {"parallel": True, "far": False}.get(kind)
    return (
        camera_around(rng, vdi.bounds, transform, distance=distance, parallel=parallel),
        size,
    )


#: How rays may be followed: see :func:`deal_rays`.
DEALT = ("one by one", "blocks", "packets")


def deal_rays(patch, runtime, dealt):
    """Have rays followed one by one, or in blocks or packets wherever they can be.

    ``patch`` undoes it. One by one is how a GPU follows all of them, and merges what they cross of
    several VDIs; in the other ways rays that stay in lists of their own are drawn from these.
    """
    least = 0.0 if dealt == "packets" else math.inf
    for name in ("LEAST_IN_COMMON", "LEAST_IN_COMMON_OF_SHORT_VECTORS", "LEAST_PIXELS"):
        patch.setattr(choose, name, least)
    if dealt == "one by one":
        patch.setattr(runtime, "is_cpu", False)


# -- VDIs ------------------------------------------------------------------------------------------


def random_vdi(
    rng,
    *,
    window=None,
    max_window=(24, 18),
    max_supersegments=12,
    camera=None,
    bounds=None,
    thinnest=2e-3,
):
    """A valid VDI of random media; by default also its window is random.

    Lists of 0 to ``max_supersegments``, some touching, some apart, some reaching beyond the
    bounds; optical depths log-uniform from 1e-4 to 1e2. No supersegment is thinner than
    ``thinnest`` of the bounds' depth range.
    """
    bounds = random_bounds(rng) if bounds is None else bounds
    camera = random_camera(rng, bounds) if camera is None else camera
    width, height = window or (int(rng.integers(1, edge + 1)) for edge in max_window)
    near, far = view_depths(camera, bounds)
    outside = near > 0 or camera.parallel_projection
    depth_origin = near if outside and rng.random() < 0.8 else 0.0
    # In perspective no medium lies behind the eye
    first = near - 0.1 * (far - near)
    if not camera.parallel_projection:
        first = max(first, 0.0)
    lists = [
        _random_faces(rng, rng.integers(0, max_supersegments + 1), first, far, thinnest)
        for _ in range(width * height)
    ]
    faces = np.concatenate(lists) - depth_origin
    front, back = faces.astype(np.float32).T
    n = len(front)
    return VDI(
        camera,
        (width, height),
        np.concatenate(([0], np.cumsum([len(faces) for faces in lists]))).astype(np.uint64),
        front,
        back,
        rng.random((n, 3)),
        10 ** rng.uniform(-4, 2, size=n),
        bounds,
        depth_origin=depth_origin,
    )


def view_depths(camera, bounds):
    """Smallest and largest view depth of bounds in the model frame."""
    corners = np.array(list(itertools.product(*np.reshape(bounds, (3, 2)))))
    depth = corners @ camera.model_to_view[2, :3] + camera.model_to_view[2, 3]
    return float(depth.min()), float(depth.max())


def _random_faces(rng, count, near, far, thinnest):
    """Fronts and backs, float64 (count, 2), sorted and disjoint; neighbours touch half the time."""
    if count == 0:
        return np.empty((0, 2))
    # Alternating thicknesses of gaps and media, scaled to the depth range
    gaps = rng.exponential(size=count + 1) * (rng.random(count + 1) < 0.5)
    media = rng.exponential(size=count) + thinnest * 4 * count
    total = gaps.sum() + media.sum()
    ends = np.cumsum(np.ravel(np.column_stack([gaps[:-1], media]))) / total
    return near + (far - near) * ends.reshape(count, 2)


# -- volumes ---------------------------------------------------------------------------------------


def random_array(rng, dtype, shape):
    """Smooth noise that uses the type's range, float64 for the reference and cast to ``dtype``."""
    coarse = rng.random(tuple(max(2, edge // 2) for edge in shape))
    index = [np.linspace(0, edge - 1, n) for edge, n in zip(coarse.shape, shape, strict=True)]
    floor = [
        np.minimum(i.astype(int), edge - 2) for i, edge in zip(index, coarse.shape, strict=True)
    ]
    field = coarse
    for axis, (position, low) in enumerate(zip(index, floor, strict=True)):
        share = (position - low).reshape([-1 if a == axis else 1 for a in range(3)])
        field = np.take(field, low, axis) * (1 - share) + np.take(field, low + 1, axis) * share
    dtype = np.dtype(dtype)
    if dtype.kind == "f":
        return ((field - 0.3) * 50).astype(dtype)
    info = np.iinfo(dtype)
    return np.round(info.min + field * (float(info.max) - info.min)).astype(dtype)


def random_volume(rng, dtype=None, *, direction=None, edge=9):
    """A small volume with anisotropic spacing, an origin and, by chance, a direction matrix."""
    dtype = dtype or rng.choice(VOXEL_TYPES)
    shape = tuple(int(n) for n in rng.integers(3, edge + 1, size=3))
    if direction is None:
        direction = random_rotation(rng) if rng.random() < 0.3 else np.eye(3)
    return Volume(
        random_array(rng, dtype, shape),
        rng.uniform(0.3, 1.5, size=3),
        rng.normal(size=3) * 5,
        direction,
    )


def random_transfer_function(rng, volume, *, interpolation=None, max_opacity=0.9):
    """A table over the volume's range, transparent in about a third of it."""
    n = int(rng.integers(2, 40))
    opacities = np.clip(rng.uniform(-0.5, max_opacity, size=n), 0, max_opacity)
    return TransferFunction(
        rng.random((n, 3)),
        opacities,
        volume.finite_range(),
        unit_distance=float(rng.uniform(0.5, 3)) if rng.random() < 0.7 else None,
        interpolation=interpolation or str(rng.choice(["nearest", "linear"])),
    )


# -- hypothesis ------------------------------------------------------------------------------------

#: Seeds, so that a failing example is one number; no shrinking towards anything.
SEEDS = st.integers(0, 2**32 - 1)

#: Generators of random numbers.
GENERATORS = SEEDS.map(np.random.default_rng)


def optical_depths(max_value=1e3):
    """Optical depths from 0, over tiny, to opaque."""
    return st.floats(0, max_value, allow_subnormal=False)


def colors():
    """Straight RGB, float64 (3,)."""
    return st.tuples(*[st.floats(0, 1, allow_subnormal=False)] * 3).map(np.array)


def _unit(vector):
    return np.asarray(vector) / np.linalg.norm(vector)


def kept_values(
    lists,
    mean,
    spread,
    share,
    *,
    value_range=(100, 300),
    unit_distance=2.0,
    sample_distance=0.5,
    metadata=None,
):
    """Return a DeferredVDI of some lists, with these values in place of their colours."""
    about = {
        "version": 1,
        "value_range": value_range,
        "unit_distance": unit_distance,
        "sample_distance": sample_distance,
    }
    faces = lists.camera, lists.window_size, lists.offsets, lists.front, lists.back
    color = np.stack([mean, np.zeros_like(mean), share], axis=1)
    told = {"depth_origin": lists.depth_origin, "metadata": metadata or lists.metadata}
    return DeferredVDI(VDI(*faces, color, spread, lists.bounds, **told), about)
