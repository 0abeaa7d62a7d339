"""The rays of a view through a volume, as the kernels that march take them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.checks import as_float
from pyvista_vdi.model.float32_limits import MOST_STEPS, entries
from pyvista_vdi.model.grid import Geometry
from pyvista_vdi.model.ray_forms import Floats, PixelRays, Rectangle, packed, packed_double_float
from pyvista_vdi.model.render_options import Planes
from pyvista_vdi.volume.kernels import RAYS

#: As many steps as there are.
ALL_STEPS = 2**31 - 1


@dataclass(frozen=True)
class MarchForms:
    """The rays of a view through a volume, as ``begin_march`` of ``volume/march.cl`` takes them.

    ``forms``: three index positions, three model directions, then the planes to clip to, of which
    there are ``planes``; ``rays``: those that they belong to; ``double_float``: of two floats each.
    """

    forms: list[Floats]
    rays: PixelRays
    planes: int
    double_float: bool

    def packed(self, *more: Floats) -> NDArray[np.float32]:
        """Return the forms, and more of the same rays, as the kernels read them."""
        pack = packed_double_float if self.double_float else packed
        return pack([*self.forms, *more])


@dataclass(frozen=True)
class GridRays:
    """A grid that rays are marched through, and the lengths of their steps; model units."""

    grid: Geometry
    sample_distance: float
    unit_distance: float

    def forms(
        self, camera: Camera, window_size: Sequence[int], clipping_planes: Planes = ()
    ) -> MarchForms:
        """Return what the kernels march along in a view."""
        pixel_rays = rays.pixel_rays(camera, window_size, self.grid.bounds)
        to_index = rays.inverse_affine(self.grid.index_to_model)
        index = [pixel_rays.form(row[:3], row[3]) for row in to_index[:3]]
        direction = [pixel_rays.form(axis) for axis in np.eye(3)]
        planes = []
        for form, points in zip(index, self.grid.dimensions, strict=True):
            far = -form
            far[0] += points - 1
            planes += [form, far]
        planes += rays.eye_plane(camera, pixel_rays)
        planes += rays.user_planes(camera, pixel_rays, clipping_planes)
        reach = rays.largest_value(camera, window_size, self.grid.bounds, index)
        two_floats = bool(entries(reach, max(self.grid.dimensions)))
        return MarchForms([*index, *direction, *planes], pixel_rays, len(planes), two_floats)

    def view(
        self, size: Sequence[int], planes: int, window: Rectangle | None = None, **changes: int
    ) -> NDArray[Any]:
        """Return the numbers of rays (``kernels.RAYS``) through part of a window, or all of it."""
        width, height = size
        x0, x1, y0, y1 = window or (0, width, 0, height)
        part = {"first_column": x0, "columns": x1 - x0, "first_row": y0, "rows": y1 - y0}
        return RAYS(
            width=width,
            height=height,
            planes=planes,
            sample_distance=self.sample_distance,
            unit_distance=self.unit_distance,
            **{"first_step": 0, "steps": ALL_STEPS, **part, **changes},
        )


def checked_sample_distance(volume: Geometry, sample_distance: float | None) -> float:
    """Return the length of a step in model units; half the smallest spacing by default."""
    least = volume.length / MOST_STEPS
    if sample_distance is None:
        step = min(volume.spacing) / 2
        if step < least:
            raise InvalidArgumentError(
                f"half the smallest spacing, {step:.3g}, is less than 2^-19 of the volume's "
                f"diagonal, {least:.3g}: float32 cannot sum up so many steps; give a longer "
                "sample_distance, or resample the volume"
            )
        return step
    step = as_float(sample_distance)
    if not (np.isfinite(step) and step >= least):
        raise InvalidArgumentError(
            f"sample_distance must be a length of at least {least:.3g} model units "
            f"(2^-19 of the volume's diagonal); got {sample_distance!r}"
        )
    # No ray is longer than the diagonal; float32 may not hold how much longer the step is
    return min(step, 2 * volume.length)
