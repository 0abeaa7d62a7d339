"""When rays are followed in packets, and how those lie in the window (docs/decisions/packets.md).

Rays of one plane through the eyes of V_O and V_N cross the same lists, if not at the same depth. On
a CPU a packet of such rays loads each list once. That pays where rays cross many lists. Where they
do not, a CPU follows them one by one, in blocks. At V_O each ray goes through a list of its own,
and a packet's lists lie side by side.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device.ray_forms import inverse_affine
from pyvista_vdi.device.work_order import Rectangle
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI

#: Rays of a packet, side by side: that of ``raycasting/packet.cl``.
LANES = 16
#: Width and height, in pixels, of a packet that is drawn from the pixels' own lists, if these lie
#: in tiles and if they do not: those of ``raycasting/aligned_view.cl``.
OWN_LISTS = {True: (8, 2), False: (16, 1)}
#: Lists that a ray may be away from the centre of its own, of the half that it has.
_FARTHEST_FROM_CENTRE = 0.125
#: Pixels that list (0, 0) may be away from the window's first one.
_FARTHEST_ORIGIN = 2**24
#: Packets of a strip that begin before the window, or behind it: the steepest line that a packet
#: follows (``STEEPEST`` of ``raycasting/packet.cl``, 1.5) rises by less over its length.
MARGIN = 24
#: Of a frame's forms: (u, v, depth, denominator), and how many come before the planes to clip to;
#: those of ``lib/list_space.cl``.
COORDINATE_FORMS, PLANE_FORMS = 4, 7
#: Lists that a ray crosses before its light ends, over those that lie between a packet's first and
#: last ray, from which packets are faster: what they have in common (docs/decisions/packets.md).
LEAST_IN_COMMON = 4.5
#: The same where rays that are not in packets cannot be in blocks, either.
LEAST_IN_COMMON_WITHOUT_BLOCKS = 1.8
#: Pixels along the shorter edge of what is drawn from which packets are faster.
LEAST_PIXELS = 200
#: Lists of a VDI that are asked how far light gets in them.
_SAMPLED_LISTS = 4096
#: Optical depth behind which nothing is left of light: -log(1e-6), where rays end by default.
_DARK = 13.8
#: Rays along each edge of the window that are asked how many lists they cross.
_PROBES = 7


class Packets(NamedTuple):
    """How a frame's rays are dealt to packets.

    Attributes
    ----------
    defines : dict
        ``-D`` names of the kernel, for the directions.
    epipole : numpy.ndarray
        As the kernel takes it, float32 (4,).
    part : numpy.ndarray
        First strip, how many there are, number of each strip's first packet; int32 (4,), the
        last one unused.
    items : int
        Work-items: packets.
    """

    defines: dict[str, str | int | None]
    epipole: NDArray[np.float32]
    part: NDArray[np.int32]
    items: int


def packets_of(
    size: tuple[int, int],
    part: Rectangle,
    coordinates: NDArray[np.float64],
    planes: NDArray[np.float64],
    epipole: NDArray[np.float64],
    lit: float,
    *,
    or_blocks: bool,
) -> Packets | None:
    """Return the packets of a frame, or None if its rays had better be followed one by one.

    Parameters
    ----------
    size : (int, int)
        Width and height of V_N's window in pixels.
    part : Rectangle
        Where rays are cast.
    coordinates, planes : numpy.ndarray
        Forms of the homogeneous list coordinates (u, v, depth, denominator), float64 (4, 6), and of
        the planes that rays are clipped to, float64 (n, 6).
    epipole : numpy.ndarray
        Where V_N sees V_O's eye, see :func:`epipole_of`.
    lit : float
        How far light gets, see :func:`share_lit`.
    or_blocks : bool
        Whether rays that are followed one by one are so in blocks.
    """
    if min(part.x1 - part.x0, part.y1 - part.y0) < LEAST_PIXELS:
        return None
    # The line through the window's centre leads along the rows, or along the columns
    upright = abs(epipole[1]) > abs(epipole[0])
    crossed, across_packet = _lists_crossed(size, coordinates, planes, upright)
    least = LEAST_IN_COMMON if or_blocks else LEAST_IN_COMMON_WITHOUT_BLOCKS
    if lit * crossed.sum() < least * across_packet.sum():
        return None
    along, across = (part.x0, part.x1), (part.y0, part.y1)
    defines: dict[str, str | int | None] = {}
    if upright:
        defines["UPRIGHT"] = 1
        along, across = across, along
        epipole = epipole[[1, 0, 2]]
    if crossed[1] > crossed[0]:
        defines["SWEEP_V"] = 1
    first = along[0] // LANES
    strips = -(-along[1] // LANES) - first
    numbers = -(-(across[1] - across[0] + 2 * MARGIN) // LANES) * LANES
    scaled = epipole / max(np.abs(epipole).max(), np.finfo(np.float64).tiny)
    return Packets(
        defines,
        np.append(scaled, 0.0).astype(np.float32),
        np.array([first, strips, across[0] - MARGIN, 0], np.int32),
        strips * numbers,
    )


class OwnLists(NamedTuple):
    """How a frame is drawn in which each ray stays in a list of its own.

    Attributes
    ----------
    origin : numpy.ndarray
        The pixel of list (0, 0), which may lie beside V_N's window, int32 (2,).
    items : int
        Work-items, in whole groups: packets.
    """

    origin: NDArray[np.int32]
    items: int


def own_lists_of(
    size: tuple[int, int],
    window: tuple[int, int],
    coordinates: NDArray[np.float64],
    depths: tuple[float, float],
    *,
    parallel: bool,
    in_tiles: bool,
) -> OwnLists | None:
    """Return how each pixel is drawn from a list of its own; None if a ray is in another one, too.

    Parameters
    ----------
    size, window : (int, int)
        Width and height of V_N's window, and of V_O's, in pixels.
    coordinates : numpy.ndarray
        Forms of the homogeneous list coordinates (u, v, depth, denominator), float64 (4, 6).
    depths : (float, float)
        The least and the largest t at which a ray may meet something.
    parallel : bool
        Whether V_O is a parallel projection.
    in_tiles : bool
        Whether lists lie in tiles (raycasting/supersegments.cl).
    """
    u_form, v_form, z_form, w_form = coordinates.tolist()
    first: list[int] = []
    # The corners, edges and middle speak for all: places depend on the pixel by a homography
    for x, y in itertools.product(*((0, pixels // 2, pixels - 1) for pixels in size)):
        a, b = x + 0.5 - size[0] / 2, y + 0.5 - size[1] / 2
        for t in depths:
            w = _value(w_form, a, b, t)
            if not (w > 0 and _slope(z_form if parallel else w_form, a, b) > 0):
                return None
            origin = (
                x + 0.5 - (_value(u_form, a, b, t) / w + window[0] / 2),
                y + 0.5 - (_value(v_form, a, b, t) / w + window[1] / 2),
            )
            if not first:
                if not max(map(abs, origin)) < _FARTHEST_ORIGIN:
                    return None
                first = [round(at) for at in origin]
            away = (abs(at - whole) for at, whole in zip(origin, first, strict=True))
            if not max(away) <= _FARTHEST_FROM_CENTRE:
                return None
    ways = zip(size, first, OWN_LISTS[in_tiles], strict=True)
    wide, high = (-(-(edge - at - -at // step * step) // step) for edge, at, step in ways)
    return OwnLists(np.array(first, np.int32), -(-wide * high // LANES) * LANES)


def _slope(form: list[float], a: float, b: float) -> float:
    """Return the slope of a form along the ray at pixel offsets (a, b)."""
    return form[3] + a * form[4] + b * form[5]


def _value(form: list[float], a: float, b: float, t: float) -> float:
    """Return the value of a form on that ray at t."""
    return form[0] + a * form[1] + b * form[2] + t * _slope(form, a, b)


def epipole_of(generating: Camera, view: Camera, size: tuple[int, int]) -> NDArray[np.float64]:
    """Return where a view sees the eye of V_O: homogeneous pixel offsets from its window's centre.

    The eye of a parallel projection is at infinity, against its direction. float64 (3,).
    """
    to_model = inverse_affine(generating.model_to_view)
    eye = to_model[:, 2] if generating.parallel_projection else to_model[:, 3]
    u, v, _, denominator = view.viewport_matrix(size) @ view.model_to_view @ eye
    return np.array([u * size[0] / 2, v * size[1] / 2, denominator])


def share_lit(vdi: VDI, near: float, far: float) -> float:
    """Return how much of the depths from ``near`` to ``far`` light gets through, the lists' mean.

    Of some of the lists that are not empty; 1 in a list through which it gets. View depths of V_O.
    """
    offsets = vdi.offsets.view(np.int64)
    lists = np.flatnonzero(np.diff(offsets))
    lists = lists[:: -(-len(lists) // _SAMPLED_LISTS) or 1]
    if not len(lists):
        return 1.0
    counts = offsets[lists + 1] - offsets[lists]
    begins = np.cumsum(counts) - counts
    places = np.arange(counts.sum()) + np.repeat(offsets[lists] - begins, counts)
    optical_depth = vdi.optical_depth[places].astype(np.float64)
    before = np.cumsum(optical_depth) - optical_depth
    before -= np.repeat(before[begins], counts)
    last = begins + np.add.reduceat(before < _DARK, begins) - 1  # that light gets to
    left = (_DARK - before[last]) / np.maximum(optical_depth[last], np.finfo(np.float32).tiny)
    front, back = (face[places[last]].astype(np.float64) for face in (vdi.front, vdi.back))
    depth = front + np.minimum(left, 1.0) * (back - front) + vdi.depth_origin
    through = np.add.reduceat(optical_depth, begins) < _DARK
    shares = np.where(through, 1.0, (depth - near) / max(far - near, np.finfo(np.float64).tiny))
    return float(np.clip(shares, 0.0, 1.0).mean())


def _lists_crossed(
    size: tuple[int, int],
    coordinates: NDArray[np.float64],
    planes: NDArray[np.float64],
    upright: bool,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how many lists a ray crosses along u and v, and how wide a packet is, float64 (2,).

    Means of the rays that meet what they are clipped to; nothing is crossed if none does. A packet
    is as wide as where its rays are halfway.
    """
    edges = [(np.arange(_PROBES) + 0.5) / _PROBES * pixels - pixels / 2 for pixels in size]
    a, b = (offsets.reshape(-1) for offsets in np.meshgrid(*edges))
    pixels = np.stack([np.ones_like(a), a, b])
    last = pixels + np.array([[0], [0 if upright else LANES], [LANES if upright else 0]])
    with np.errstate(all="ignore"):  # rays that miss, and planes that are parallel to a ray
        clipped = planes.reshape(-1, 2, 3) @ pixels
        values, slopes = clipped[:, 0], clipped[:, 1]
        crossings = -values / slopes
        begins = np.where(slopes > 0, crossings, -np.inf).max(axis=0)
        ends = np.where(slopes < 0, crossings, np.inf).min(axis=0)
        outside = ((slopes == 0) & (values < 0)).any(axis=0)
        halfway = 0.5 * (begins + ends)
        crossed = np.abs(_places(coordinates, pixels, ends) - _places(coordinates, pixels, begins))
        wide = np.abs(_places(coordinates, last, halfway) - _places(coordinates, pixels, halfway))
        meets = (begins < ends) & ~outside & np.isfinite(crossed + wide).all(axis=0)
    if not meets.any():
        return np.zeros(2), np.ones(2)
    return crossed[:, meets].mean(axis=1), wide[:, meets].mean(axis=1)


def _places(
    coordinates: NDArray[np.float64], pixels: NDArray[np.float64], t: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (u, v) of the pixels' rays at t, float64 (2, n)."""
    values, slopes = np.moveaxis(coordinates.reshape(-1, 2, 3) @ pixels, 1, 0)
    u, v, _, denominator = values + t * slopes
    return np.stack([u / denominator, v / denominator])
