"""The standard cases: transfer functions and views that give a measured figure the same meaning.

They are those of the design's section 7. Tests and benchmarks take them from here.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import as_bounds

#: Transfer functions by name, as arguments of ``Plotter.add_volume``; the rest is default.
TRANSFER_FUNCTIONS: dict[str, dict[str, Any]] = {
    "soft": {"cmap": "bone", "opacity": "linear"},
    "steep": {"cmap": "viridis", "opacity": "sigmoid_10"},
    "nearly-opaque": {"cmap": "inferno", "opacity": (0.0, 0.0, 0.02, 0.9, 1.0)},
}

#: Angles from V_O at which a VDI is judged, degrees of ``Azimuth`` about the centre.
ANGLES: tuple[float, ...] = (0.0, 5.0, 30.0)

#: Elevation of V_O above the horizontal plane through the centre, degrees.
ELEVATION = 20.0

#: The window of the paper's smaller cases, pixels.
WINDOW_SIZE: tuple[int, int] = (1280, 720)

#: Distance kept between the outermost corner and the viewport's edge, in half viewports: below a
#: tenth of a pixel at any usual size, far above rounding.
_MARGIN = 1e-4


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
    width, height = check_window_size(window_size)
    box = np.array(as_bounds(bounds))
    if not np.any(box[1::2] > box[::2]):
        raise InvalidArgumentError(f"the bounds {box.tolist()} are a point: nothing fills a view")
    centre = (box[::2] + box[1::2]) / 2
    turn, lift = math.radians(azimuth), math.radians(elevation)
    to_eye = np.array(
        [math.sin(turn) * math.cos(lift), -math.cos(turn) * math.cos(lift), math.sin(lift)]
    )
    towards = Camera(centre + to_eye, centre, (0, 0, 1), view_angle=view_angle)

    # A corner at (x, y, z) from the centre in view axes is inside at distance d of the eye if
    # |x| <= t_x (d + z) and |y| <= t_y (d + z)
    half = (box[1::2] - box[::2]) / 2
    signs = np.array([[i & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)]) * 2 - 1
    x, y, z = towards.axes @ (signs * half).T
    t_x, t_y = (t * (1 - _MARGIN) for t in towards.half_extent((width, height)))
    with np.errstate(all="ignore"):
        distance = float(np.max(np.maximum(np.abs(x) / t_x, np.abs(y) / t_y) - z))
    return towards.replace(position=centre + to_eye * distance)
