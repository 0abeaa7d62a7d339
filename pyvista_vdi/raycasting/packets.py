"""When rays are followed in packets, and how those lie in the window (docs/decisions/packets.md).

Rays of one plane through the eyes of V_O and V_N cross the same lists, if not at the same depth. On
a CPU a packet of such rays loads each list once. That pays where rays cross many lists. Where they
do not, a CPU follows them one by one, in blocks.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device.constants import BLOCK_RAYS, STEEPEST
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.ray_forms import Rectangle, inverse_affine
from pyvista_vdi.model.vdi import VDI, Media

#: Rays of a packet, side by side.
LANES = BLOCK_RAYS
#: Packets of a strip that begin before the window, or behind it: the steepest line that a packet
#: follows rises by less over its length.
MARGIN = math.ceil(STEEPEST * LANES)
#: Lists that a ray crosses before its light ends, over those that lie between a packet's first and
#: last ray, from which packets are faster: what they have in common (docs/decisions/packets.md).
#: Where a device has vectors of 16 floats, and where shorter ones, of which packets use more.
LEAST_IN_COMMON, LEAST_IN_COMMON_OF_SHORT_VECTORS = 4.5, 10.0
#: Pixels along the shorter edge of what is drawn from which packets are faster.
LEAST_PIXELS = 200
#: Lists of a VDI that are asked how far light gets in them; of values, which are classified for it.
_SAMPLED_LISTS, _SAMPLED_LISTS_OF_VALUES = 4096, 1024
#: Optical depth behind which nothing is left of light: -log(1e-6), where rays end by default.
_DARK = 13.8
#: Rays along each edge of the window that are asked how many lists they cross.
_PROBES = 7


class Packets(NamedTuple):
    """How a frame's rays are dealt to packets."""

    upright: bool  # whether they stand on end in the window
    sweep_v: bool  # whether they sweep along v, not along u
    epipole: NDArray[np.float32]  # as the kernel takes it, (4,)
    part: NDArray[np.int32]  # first strip, strips, number of each one's first packet, unused
    items: int  # packets


def packets_of(
    generating: Camera,
    view: Camera,
    size: tuple[int, int],
    part: Rectangle,
    coordinates: NDArray[np.float64],
    planes: NDArray[np.float64],
    lit: float,
    *,
    long_vectors: bool,
) -> Packets | None:
    """Return the packets of a part of a frame; None if another kernel is faster.

    ``coordinates`` are the forms of (u, v, depth, denominator), float64 (4, 6), ``planes`` those
    that rays are clipped to, float64 (n, 6). ``lit`` is :func:`share_lit`'s. ``long_vectors``:
    whether the device's hold 16 floats.
    """
    if min(part.x1 - part.x0, part.y1 - part.y0) < LEAST_PIXELS:
        return None
    epipole = epipole_of(generating, view, size)
    # The line through the window's centre leads along the rows, or along the columns
    upright = abs(epipole[1]) > abs(epipole[0])
    crossed, across_packet = _lists_crossed(size, coordinates, planes, upright)
    least = LEAST_IN_COMMON if long_vectors else LEAST_IN_COMMON_OF_SHORT_VECTORS
    if lit * crossed.sum() < least * across_packet.sum():
        return None
    along, across = (part.x0, part.x1), (part.y0, part.y1)
    if upright:
        along, across = across, along
        epipole = epipole[[1, 0, 2]]
    first = along[0] // LANES
    strips = -(-along[1] // LANES) - first
    numbers = -(-(across[1] - across[0] + 2 * MARGIN) // LANES) * LANES
    scaled = epipole / max(np.abs(epipole).max(), np.finfo(np.float64).tiny)
    return Packets(
        bool(upright),
        bool(crossed[1] > crossed[0]),
        np.append(scaled, 0.0).astype(np.float32),
        np.array([first, strips, across[0] - MARGIN, 0], np.int32),
        strips * numbers,
    )


def epipole_of(generating: Camera, view: Camera, size: tuple[int, int]) -> NDArray[np.float64]:
    """Return where a view sees the eye of V_O: homogeneous pixel offsets from its window's centre.

    The eye of a parallel projection is at infinity, against its direction. float64 (3,).
    """
    to_model = inverse_affine(generating.model_to_view)
    eye = to_model[:, 2] if generating.parallel_projection else to_model[:, 3]
    u, v, _, denominator = view.viewport_matrix(size) @ view.model_to_view @ eye
    return np.array([u * size[0] / 2, v * size[1] / 2, denominator])


def share_lit(
    vdi: VDI,
    near: float,
    far: float,
    media_of: Callable[[NDArray[np.int64]], Media] | None = None,
) -> float:
    """Return how much of the depths from ``near`` to ``far`` light gets through, the lists' mean.

    Of some of the lists that are not empty; 1 in a list through which it gets. View depths of V_O.
    ``media_of``: those of some supersegments, where others are shown than the VDI's.
    """
    offsets = vdi.offsets.view(np.int64)
    lists = np.flatnonzero(np.diff(offsets))
    sampled = _SAMPLED_LISTS if media_of is None else _SAMPLED_LISTS_OF_VALUES
    lists = lists[:: -(-len(lists) // sampled) or 1]
    if not len(lists):
        return 1.0
    counts = offsets[lists + 1] - offsets[lists]
    begins = np.cumsum(counts) - counts
    places = np.arange(counts.sum()) + np.repeat(offsets[lists] - begins, counts)
    optical_depth = vdi.optical_depth[places] if media_of is None else media_of(places)[1]
    optical_depth = optical_depth.astype(np.float64)
    before = np.cumsum(optical_depth) - optical_depth
    before -= np.repeat(before[begins], counts)
    last = begins + np.add.reduceat(before < _DARK, begins) - 1  # that light gets to
    left = (_DARK - before[last]) / np.maximum(optical_depth[last], np.finfo(np.float32).tiny)
    front, back = (faces[places[last]].astype(np.float64) for faces in (vdi.front, vdi.back))
    depth = front + np.minimum(left, 1.0) * (back - front) + vdi.depth_origin
    through = np.add.reduceat(optical_depth, begins) < _DARK
    shares = np.where(through, 1.0, (depth - near) / max(far - near, np.finfo(np.float64).tiny))
    if media_of is not None:  # lists of which nothing is shown are empty
        shares = shares[np.add.reduceat(optical_depth, begins) > 0]
    return float(np.clip(shares, 0.0, 1.0).mean()) if len(shares) else 1.0


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
