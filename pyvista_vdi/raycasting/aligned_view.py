"""Frames in which each ray stays in one list: V_O's view, of the VDI's own pixels or some of them.

Each pixel is then drawn from its list alone, and a packet's lists lie side by side.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device.constants import BUNDLE
from pyvista_vdi.raycasting.packets import LANES

#: Width and height, in pixels, of a packet, if lists lie in bundles and if they do not.
_PACKET = {True: (LANES // BUNDLE, BUNDLE), False: (LANES, 1)}
#: Lists that a ray may be away from the centre of its own, of the half that it has.
_FARTHEST_FROM_CENTRE = 0.125
#: Pixels that list (0, 0) may be away from the window's first one.
_FARTHEST_ORIGIN = 2**24


class AlignedView(NamedTuple):
    """How a frame is drawn in which each ray stays in a list of its own."""

    origin: NDArray[np.int32]  # the pixel of list (0, 0), which may lie beside V_N's window
    items: int  # packets, in whole groups


def aligned_view(
    size: tuple[int, int],
    window: tuple[int, int],
    coordinates: NDArray[np.float64],
    depths: tuple[float, float],
    *,
    parallel: bool,
    in_bundles: bool,
) -> AlignedView | None:
    """Return how each pixel is drawn from a list of its own; None if a ray is in another one, too.

    ``window`` is V_O's in pixels, ``coordinates`` are the forms of (u, v, depth, denominator),
    float64 (4, 6), and ``depths`` the least and the largest t at which a ray may meet something.
    """
    first: list[int] = []
    # The corners, edges and middle speak for all: places depend on the pixel by a homography
    for x, y in itertools.product(*((0, pixels // 2, pixels - 1) for pixels in size)):
        # Value and slope of (u, v, depth, denominator) along the pixel's ray
        pixel = np.array([1.0, x + 0.5 - size[0] / 2, y + 0.5 - size[1] / 2])
        values, slopes = (coordinates.reshape(4, 2, 3) @ pixel).T
        for t in depths:
            u, v, _, w = (values + t * slopes).tolist()
            # V_O's depth grows along the ray
            if not (w > 0 and slopes[2 if parallel else 3] > 0):
                return None
            # Where list (0, 0) would be, if the ray met its own list in the middle
            origin_x = x + 0.5 - (u / w + window[0] / 2)
            origin_y = y + 0.5 - (v / w + window[1] / 2)
            if not first:
                if not max(abs(origin_x), abs(origin_y)) < _FARTHEST_ORIGIN:
                    return None
                first = [round(origin_x), round(origin_y)]
            away = max(abs(origin_x - first[0]), abs(origin_y - first[1]))
            if not away <= _FARTHEST_FROM_CENTRE:
                return None
    # Packets begin at multiples of their size, in lists
    wide, high = _PACKET[in_bundles]
    first_i, first_j = -first[0] // wide * wide, -first[1] // high * high
    packets_wide = -(-(size[0] - first[0] - first_i) // wide)
    packets_high = -(-(size[1] - first[1] - first_j) // high)
    packets = packets_wide * packets_high
    return AlignedView(np.array(first, np.int32), -(-packets // LANES) * LANES)
