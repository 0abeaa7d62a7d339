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
    ways = zip(size, first, _PACKET[in_bundles], strict=True)
    wide, high = (-(-(edge - at - -at // step * step) // step) for edge, at, step in ways)
    return AlignedView(np.array(first, np.int32), -(-wide * high // LANES) * LANES)


def _slope(form: list[float], a: float, b: float) -> float:
    """Return the slope of a form along the ray at pixel offsets (a, b)."""
    return form[3] + a * form[4] + b * form[5]


def _value(form: list[float], a: float, b: float, t: float) -> float:
    """Return the value of a form on that ray at t."""
    return form[0] + a * form[1] + b * form[2] + t * _slope(form, a, b)
