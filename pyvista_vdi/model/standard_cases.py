"""The view that a volume fills: that of the standard cases (docs/accuracy.md), and a default."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.checks import as_bounds
from pyvista_vdi.model.view import bounds_corners

#: Elevation of V_O above the horizontal plane through the centre, degrees.
ELEVATION = 20.0


def filling_camera(
    bounds: ArrayLike,
    window_size: Sequence[int],
    azimuth: float = 0.0,
    elevation: float = ELEVATION,
    view_angle: float = 30.0,
) -> Camera:
    """Return the perspective view that a box just fills; z is up, world units and degrees.

    The eye is on the -y side at ``azimuth`` 0, counter-clockwise seen from above (VTK's
    ``Azimuth``), and ``elevation`` above the horizontal plane, less than 90 degrees either way, as
    near to the box's centre as all eight corners are inside the viewport.
    """
    box = np.array(as_bounds(bounds))
    if not np.any(box[1::2] > box[::2]):
        raise InvalidArgumentError(f"the bounds {box.tolist()} are a point: nothing fills a view")
    centre, half = (box[::2] + box[1::2]) / 2, (box[1::2] - box[::2]) / 2
    turn, lift = math.radians(azimuth), math.radians(elevation)
    to_eye = np.array(
        [math.sin(turn) * math.cos(lift), -math.cos(turn) * math.cos(lift), math.sin(lift)]
    )
    towards = Camera(centre + to_eye, centre, (0, 0, 1), view_angle=view_angle)

    # A corner at (x, y, z) from the centre in view axes is inside at distance d of the eye if
    # |x| <= t_x (d + z) and |y| <= t_y (d + z)
    x, y, z = towards.axes @ bounds_corners(np.outer(half, (-1, 1)).ravel()).T
    # Between the outermost corner and the viewport's edge is less than a tenth of a pixel at any
    # usual size, far more than rounding
    t_x, t_y = (t * (1 - 1e-4) for t in towards.half_extent(window_size))
    with np.errstate(all="ignore"):
        distance = float(np.max(np.maximum(np.abs(x) / t_x, np.abs(y) / t_y) - z))
    return towards.replace(position=centre + to_eye * distance)
