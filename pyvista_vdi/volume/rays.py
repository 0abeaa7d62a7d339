"""The rays of a view through a volume, as the kernels that march take them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from pyvista_vdi.device import Runtime
from pyvista_vdi.device.constants import BLOCK_RAYS, GROUP
from pyvista_vdi.device.programs import Define
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.checks import as_float
from pyvista_vdi.model.float32_limits import ENTRY_PER_POINT, FAR_ENTRY, MOST_STEPS, NEAR_ENTRY
from pyvista_vdi.model.options import Planes
from pyvista_vdi.model.ray_forms import Floats, PixelRays, Rectangle
from pyvista_vdi.model.volume import Grid

Ends = tuple[float, float, float]


@dataclass(frozen=True)
class GridPart:
    """Where points that are at hand lie in their grid, and which of its cells belong to them.

    ``first``: index x, y, z of the first point at hand; ``lower``, ``upper``: index positions
    between which the part's own cells lie, the upper ones excluded, infinite at the ends of the
    grid, where rounding may put a midpoint outside; ``scalar_range``: of the whole grid's values.
    """

    grid: Grid
    first: tuple[int, int, int]
    lower: Ends
    upper: Ends
    scalar_range: tuple[float, float]


#: As many steps as there are.
ALL_STEPS = 2**31 - 1


@dataclass(frozen=True)
class MarchForms:
    """The rays of a view through a volume, as ``begin_march`` of ``volume/march.cl`` takes them.

    ``forms``: three index positions, three model directions, then the planes to clip to, of which
    there are ``planes``; ``rays``: those that they belong to; ``double_float``: whether they are
    read with what float32 rounds off them.
    """

    forms: list[Floats]
    rays: PixelRays
    planes: int
    double_float: bool


@dataclass(frozen=True)
class GridRays:
    """A grid that rays are marched through, and the lengths of their steps; model units."""

    grid: Grid
    sample_distance: float
    unit_distance: float

    def forms(
        self, camera: Camera, window_size: Sequence[int], clipping_planes: Planes = ()
    ) -> MarchForms:
        """Return what the kernels march along in a view."""
        pixel_rays = rays.pixel_rays(camera, window_size, self.grid.bounds)
        to_index, points = rays.inverse_affine(self.grid.index_to_model), self.grid.dimensions
        index, direction = pixel_rays.forms(to_index[:3]), pixel_rays.forms(np.eye(3, 4))
        far = -index
        far[:, 0] += np.subtract(points, 1)
        planes = [*index, *far, *rays.view_planes(camera, pixel_rays, clipping_planes)]
        reach = rays.largest_value(pixel_rays, camera, window_size, self.grid.bounds, index)
        two_floats = reach > min(max(NEAR_ENTRY, ENTRY_PER_POINT * max(points)), FAR_ENTRY)
        return MarchForms([*index, *direction, *planes], pixel_rays, len(planes), two_floats)

    def view(
        self, size: Sequence[int], planes: int, window: Rectangle | None = None
    ) -> dict[str, Any]:
        """Return the numbers of rays (``RaysOfView``) through part of a window, or all of it."""
        width, height = size
        x0, x1, y0, y1 = window or (0, width, 0, height)
        part = {"first_column": x0, "columns": x1 - x0, "first_row": y0, "rows": y1 - y0}
        return {
            "width": width,
            "height": height,
            "planes": planes,
            "first_step": 0,
            "steps": ALL_STEPS,
            **part,
            "sample_distance": self.sample_distance,
            "unit_distance": self.unit_distance,
        }


def checked_sample_distance(volume: Grid, sample_distance: float | None) -> float:
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


@dataclass(frozen=True)
class Variant:
    """What changes the code of kernels that march through a volume.

    OpenCL's types of a voxel's component (``voxel``) and of a voxel's address (``index``); a
    scalar, or colours and a scalar (1 or 4 ``components``); whether the ``nearest`` point is
    sampled, and the medium of its scalar looked up (``by_scalar``). Samples are not lit, lit, or
    lit by one headlight and nothing else (``shaded`` 0, 1, 2). With ``double_float``, rays enter
    the volume so far from where they are formed that float32 does not hold it. ``compensated``: how
    sums along a ray are kept (``lib/compositing.cl``). ``sharp``, no ``-D`` option: a specular
    power is so large that cosines round it off.
    """

    voxel: str = "uchar"
    index: str = "uint"
    components: int = 1
    nearest: bool = False
    by_scalar: bool = False
    shaded: int = 0
    double_float: bool = False
    compensated: int = 0
    sharp: bool = False

    @cached_property
    def defines(self) -> dict[str, Define]:
        """The ``-D`` options, all of them in every program."""
        return {
            "VOXEL_T": self.voxel,
            "INDEX_T": self.index,
            "COMPONENTS": self.components,
            "NEAREST": self.nearest,
            "BY_SCALAR": self.by_scalar,
            "SHADED": self.shaded,
            "DOUBLE_FLOAT_RAYS": self.double_float,
            "COMPENSATED": self.compensated,
        }

    @property
    def one_by_one(self) -> bool:
        """Whether rays are followed one by one whatever the device."""
        return (
            self.index != "uint"
            or self.components > 1
            or self.double_float
            or self.compensated > 1
            or self.sharp
        )


class RayLaunch:
    """A launch of a kernel for rays: one for each work-item, or sixteen (``LANES``).

    CPUs follow sixteen, unless there is no way but ``one_by_one``; the bits are the same. Other
    arguments are those of :meth:`Runtime.bind`.
    """

    def __init__(
        self,
        runtime: Runtime,
        path: str,
        name: str,
        defines: Mapping[str, Define],
        *,
        one_by_one: bool = False,
        **arguments: Any,
    ) -> None:
        self._rays = BLOCK_RAYS if runtime.is_cpu and not one_by_one else 1
        if self._rays > 1:
            # PoCL rounds functions of a vector otherwise than of a number, in one of 10^5 values
            vector_functions = runtime.info.platform.startswith("Intel")
            defines = {**defines, "LANES": self._rays, "VECTOR_FUNCTIONS": vector_functions}
        self._launch = runtime.bind(path, name, defines, **arguments)

    def __call__(self, rays: int, **arguments: Any) -> None:
        """Launch it for so many rays, a multiple of a group's."""
        self._launch(rays // self._rays, GROUP // self._rays, **arguments)
