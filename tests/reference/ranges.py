"""What float32 may make of a ray: the oracle's range (docs/dev/conventions.md#borders)."""

import itertools
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.view import bounds_corners
from reference.raycast import Line, Lists, Rays, composite_lines, near_limit

Array = NDArray[np.float64]

#: Unit roundoff of float32: the largest relative error of one correctly rounded operation.
ROUNDOFF = 2.0**-24

#: Roundings of a ray's list coordinates; derived in :func:`render_range`.
RAY_ROUNDINGS = 12

#: Roundings of a stored face: adding the depth origin, and the reciprocal.
FACE_ROUNDINGS = 2

#: Perspective depths are 1/Z where the farthest is more than this many times the nearest.
DEEP_RATIO = 2.0


def render_range(
    vdi: VDI,
    camera: Camera,
    window_size: Sequence[int],
    pixels: Sequence[tuple[int, int]],
    k: float = RAY_ROUNDINGS,
    *,
    n_random: int = 0,
    seed: int = 0,
    opaque_depth: ArrayLike | None = None,
    clipping_planes: ArrayLike | None = None,
    cropping: Any = None,
    opacity_multiplier: float = 1.0,
) -> tuple[Array, Array]:
    """Return the smallest and largest colour over a ray moved by its arithmetic's roundings.

    A ray that runs within rounding of a border between lists may fall on either side, and across
    a thin or opaque supersegment that makes a large difference; a float32 raycaster is correct if
    it draws one of the rays that its roundings cannot tell from the exact one.

    Parameters
    ----------
    vdi, camera, window_size, opaque_depth, clipping_planes, cropping, opacity_multiplier
        As for :func:`reference.render`.
    pixels : sequence of (int, int)
        ``(x, y)`` of each, y = 0 at the bottom.
    k : float
        Roundings of a list coordinate, in units of :data:`ROUNDOFF`.
    n_random : int
        Moved rays to try in addition to the fixed set, drawn from the same box.
    seed : int
        Of the random ones.

    Returns
    -------
    low, high : numpy.ndarray
        float64 (len(pixels), 4) each, premultiplied RGBA.

    Raises
    ------
    InvalidArgumentError
        If ``k`` is negative.

    Notes
    -----
    The arithmetic assumed is float32 on list coordinates in pixels from the window's centre,
    ``U = u W / 2`` and ``V = v H / 2``, and a depth coordinate z: Z - Z_ref in parallel
    projection; in perspective 1 / Z, or (Z - Z_ref) / Z where the bounds' depths span a factor of
    no more than 2. Z_ref is the VDI's depth origin. The roundings of U, in units of the unit
    roundoff times W / 2:

    ==========================================================================  ==
    coefficients of the viewport's affine map, and two fused multiply-adds       3
    one more along the ray, to the clipped end                                   1
    the same for the homogeneous denominator (relative, and abs(U) <= W / 2)     4
    the division                                                                 1
    crossing a border, (border - U) times 1 / (U1 - U0)                          3
    together                                                                    12
    ==========================================================================  ==

    V and z alike. Both ends of the ray are moved independently in the box of these sizes, hence
    the ray is shifted and turned: the corners of the box in (U0, V0, U1, V1), each with one of
    the four corners in (z0, z1); z alone; and the ray moved as a whole on V_N's window. 1 / Z is
    moved in proportion to itself (its error is relative: s is measured from the end where it is
    small), the others in proportion to the larger end. The faces are moved outwards and inwards by
    their own :data:`FACE_ROUNDINGS`. The result is a subset of what the arithmetic allows, so
    trying more rays (``n_random``) can only come closer to it.
    """
    if not k >= 0:
        raise InvalidArgumentError(f"k must be a number of roundings >= 0; got {k}")
    space = _ListSpace(vdi)
    lists = Lists(vdi, opacity_multiplier)
    shift = FACE_ROUNDINGS * ROUNDOFF * space.face_sensitivity(lists)
    media = {0: lists, 1: lists.displaced(shift), -1: lists.displaced(-shift)}
    view = Rays(vdi, camera, window_size, opaque_depth, clipping_planes, cropping)
    nudges = _window_nudges(window_size, k)
    rng = np.random.default_rng(seed)
    size = k * ROUNDOFF

    low = np.empty((len(pixels), 4))
    high = np.empty((len(pixels), 4))
    for n, pixel in enumerate(pixels):
        lines = view.lines(pixel)
        seen = [composite_lines(lists, lines)]
        seen += [composite_lines(lists, view.lines(pixel, nudge)) for nudge in nudges]
        if lines:
            for move in itertools.chain(_corners(), _inside(rng, n_random, space, lines[0], size)):
                # What cropping cuts out of a ray begins and ends at roundings of its own
                moved = [space.moved(line, move, size) for line in lines]
                seen.append(composite_lines(media[move.faces], moved))
        low[n], high[n] = np.min(seen, axis=0), np.max(seen, axis=0)
    return low, high


class _Move(NamedTuple):
    """Displacements of the two ends, each in -1 to 1 of what rounding allows, and of the faces."""

    ends: Array  # (2, 3): U, V, z of the first and of the last end
    faces: int  # 1 outwards, 0 as stored, -1 inwards


def _corners() -> Iterator[_Move]:
    """Yield the fixed set: 16 corners in U and V, 4 in z alone, and the faces alone."""
    signs = (-1.0, 1.0)
    depth_corners = list(itertools.product(signs, signs))
    for n, (u0, v0, u1, v1) in enumerate(itertools.product(signs, repeat=4)):
        z0, z1 = depth_corners[n % 4]
        yield _Move(np.array([[u0, v0, z0], [u1, v1, z1]]), (1, -1)[n // 4 % 2])
    for z0, z1 in depth_corners:
        yield _Move(np.array([[0, 0, z0], [0, 0, z1]]), 0)
    for faces in (1, -1):
        yield _Move(np.zeros((2, 3)), faces)


def _inside(
    rng: np.random.Generator, count: int, space: "_ListSpace", line: Line, size: float
) -> Iterator[_Move]:
    """Yield random displacements from the same box, three in four crossing a border on purpose.

    A ray along a border may cross it anywhere, and where it does decides what it meets. Depths are
    drawn evenly along the ray: even in 1 / Z they would all lie near the eye.
    """
    for _ in range(count):
        ends = rng.uniform(-1, 1, size=(2, 3))
        for axis in (0, 1):
            if rng.random() < 0.75:
                ends[:, axis] = space.crossing(line, axis, size, rng.uniform(size=2))
        yield _Move(ends, int(rng.integers(-1, 2)))


def _window_nudges(window_size: Sequence[int], k: float) -> list[tuple[float, float]]:
    """Return the corners of what k roundings of a pixel coordinate are on V_N's window."""
    dx, dy = (k * ROUNDOFF * edge / 2 for edge in window_size)
    return [(sx * dx, sy * dy) for sx in (-1.0, 1.0) for sy in (-1.0, 1.0)]


class _ListSpace:
    """View space of V_O to (U, V, z) and back; see the notes of :func:`render_range`."""

    def __init__(self, vdi: VDI) -> None:
        self.to_viewport = vdi.camera.viewport_matrix(vdi.window_size)
        self.ray_origin, self.ray_direction = vdi.camera.ray_coefficients(vdi.window_size)
        self.to_model = np.linalg.inv(vdi.camera.model_to_view[:3, :3])
        self.half_window = np.array(vdi.window_size) / 2
        self.depth_origin = vdi.depth_origin
        self.parallel = vdi.camera.parallel_projection
        # Find the smallest and largest view depth of the bounds' corners in V_O; world units
        matrix = vdi.camera.model_to_view
        depth = bounds_corners(vdi.bounds) @ matrix[2, :3] + matrix[2, 3]
        near, far = max(float(depth.min()), near_limit(vdi)), float(depth.max())
        self.deep = not self.parallel and (far > DEEP_RATIO * near or self.depth_origin == 0)

    def moved(self, line: Line, move: _Move, size: float) -> Line:
        """Return the straight line between the two displaced ends of ``line``."""
        ends = np.stack([self._to_list(line.origin + t * line.direction) for t in line[2:4]])
        box = np.empty((2, 3))
        box[:, :2] = self.half_window
        box[:, 2] = np.abs(ends[:, 2]) if self.deep else np.abs(ends[:, 2]).max()
        first, last = (self._from_list(q) for q in ends + size * move.ends * box)
        direction = last - first
        return Line(first, direction, 0.0, 1.0, float(np.linalg.norm(self.to_model @ direction)))

    def crossing(self, line: Line, axis: int, size: float, draw: Array) -> Array:
        """Return displacements of both ends in U or V that cross the nearest border at a depth.

        ``line``: the ray. ``axis``: 0 for U, 1 for V. ``size``: half the box, in half windows.
        ``draw``: two numbers in [0, 1]: which share of the ray's length, and how steeply. Returns:
        float64 (2,), each in -1 to 1; random where no border is near enough.
        """
        at = line.t0 + draw[0] * (line.t1 - line.t0)
        first, here, last = (
            self._to_list(line.origin + t * line.direction) for t in (line.t0, at, line.t1)
        )
        half = self.half_window[axis]
        # s by depth where depth changes, and by length elsewhere
        rise = last[2] - first[2]
        s = (here[2] - first[2]) / rise if abs(rise) > 1e-9 * abs(last[2]) else draw[0]
        s = min(max(float(s), 0.0), 1.0)
        needed = (np.round(here[axis] + half) - half - here[axis]) / (half * size)
        slope = 2 * draw[1] - 1  # displacement of the end that is farther from the crossing
        if s < 0.5:
            ends = [(needed - slope * s) / (1 - s), slope]
        else:
            ends = [slope, (needed - slope * (1 - s)) / s]
        return np.clip(ends, -1, 1)

    def face_sensitivity(self, lists: Lists) -> Array:
        """Return by how much a face moves, world units, per relative rounding of its z."""
        front, back = np.abs(lists.front), np.abs(lists.back)
        if self.deep:
            return np.maximum(front, back)  # 1 / Z, so Z in proportion to itself
        # z is 0 at the depth origin, and Z grows by no more than DEEP_RATIO^2 per unit of z Z_ref
        stored = np.maximum(
            np.abs(lists.front - self.depth_origin), np.abs(lists.back - self.depth_origin)
        )
        return stored if self.parallel else np.minimum(DEEP_RATIO * stored, np.maximum(front, back))

    def _to_list(self, point: Array) -> Array:
        ud, vd, z, d = self.to_viewport @ np.append(point, 1.0)
        if self.parallel:
            depth = z - self.depth_origin
        elif self.deep:
            depth = 1 / z
        else:
            depth = (z - self.depth_origin) / z
        return np.array([ud / d * self.half_window[0], vd / d * self.half_window[1], depth])

    def _from_list(self, q: Array) -> Array:
        if self.parallel:
            z = q[2] + self.depth_origin
        elif self.deep:
            z = 1 / q[2]
        else:
            z = self.depth_origin / (1 - q[2])
        at = np.append(1.0, q[:2] / self.half_window)
        return np.asarray(at @ self.ray_origin + z * (at @ self.ray_direction))
