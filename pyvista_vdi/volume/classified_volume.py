"""A volume and its classification on a device, shared by generation and direct volume rendering."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import DeviceBuffer, Runtime, bytes_text, padded
from pyvista_vdi.device import ray_forms as rays
from pyvista_vdi.device.ray_forms import Floats, PixelRays, packed, packed_double_float
from pyvista_vdi.device.work_order import GROUP
from pyvista_vdi.errors import DeviceMemoryError, InvalidArgumentError
from pyvista_vdi.model.ambient_occlusion import AmbientOcclusion, OcclusionGrid
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.checks import as_float
from pyvista_vdi.model.float32_limits import MOST_STEPS, compensation, entries, held_unit_distance
from pyvista_vdi.model.grid import Geometry
from pyvista_vdi.model.options import MediumOptions
from pyvista_vdi.model.render_options import Planes
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.volume.bricks import (
    DeviceBricks,
    Room,
    fitting_layout,
    least_brick_bytes,
    too_small,
)
from pyvista_vdi.volume.grid_part import GridPart
from pyvista_vdi.volume.light_tables import gradient_table, lighting_table, shading_defines
from pyvista_vdi.volume.occlusion_grid import ambient_transmittances, opacities_of_part
from pyvista_vdi.volume.upload import (
    ENTRY_BYTES,
    TABLE_BYTES,
    Scale,
    described,
    device_bytes,
    fits_whole,
    integer_ends,
    macrocells_over,
    other_bytes,
    reads_natively,
    scale_of,
    upload_blanked,
    upload_ranges,
    upload_voxels,
    uploads_of,
    voxel_defines,
    voxel_reader,
)

#: Macrocells: farther than this no march looks for what is not transparent.
_FARTHEST = 16
#: Share of transparent macrocells from which on looking for them pays. Measured
#: (docs/decisions/generation.md): where none is, a picture takes 1.2 to 1.35 times as long with the
#: look as without; from .32 on it takes .4 to .85.
_WORTH_SKIPPING = 0.15


@dataclass(frozen=True)
class MarchForms:
    """The rays of a view through a volume, as ``begin_march`` of ``volume/march.cl`` takes them.

    Attributes
    ----------
    forms : list of numpy.ndarray
        Three index positions, three model directions, then the planes to clip to.
    rays : PixelRays
        The rays that they belong to.
    planes : int
        How many of the forms are planes.
    defines : dict
        ``-D`` names of the kernels that read them.
    """

    forms: list[Floats]
    rays: PixelRays
    planes: int
    defines: dict[str, str | int | None]

    def packed(self, *more: Floats) -> NDArray[np.float32]:
        """Return the forms, and more of the same rays, as the kernels read them."""
        pack = packed_double_float if self.defines else packed
        return pack([*self.forms, *more])


class DeviceVolume:
    """A classified volume as kernel arguments.

    Parameters
    ----------
    runtime : Runtime
        The device.
    volume : Volume
        Uploaded once per device and kept as long as the object lives.
    transfer_function : TransferFunction
        Its table is uploaded each time: a few kilobytes.
    options : MediumOptions, optional
        How it is sampled; ambient occlusion is computed once for a classification.
    skip_empty : bool
        Pass by macrocells that the transfer function makes transparent; the samples stay the same.
    by_scalar : bool
        Look up the medium of each scalar where that can be done; otherwise the table stays the
        transfer function.
    part : GridPart, optional
        Where the volume's points lie in a grid of which they are a part: marches then go along the
        whole grid's rays, and take the steps that belong to the part.
    ambient : numpy.ndarray, float32 (nz, ny, nx), optional
        Mean transmittance around the nodes of the whole grid's occlusion, which a part cannot know.
    room : Room, optional
        Memory that there is; a volume for which it is too little is held brick by brick. Without
        it a volume is held in one piece or refused.
    **changes
        Options by name, in place of those in ``options``.

    Attributes
    ----------
    volume : Volume
        The scalars.
    grid : Volume or Grid
        What rays are marched through: the volume, or the grid that it is a part of.
    bricks : DeviceBricks or None
        What is on the device, where that is not the whole volume: steps must be sampled by a
        :class:`~pyvista_vdi.volume.bricks.StepSampler` before kernels march along them.
    zero, unit : float
        Scalar of a voxel that is 0 on the device, and scalars per unit of the device's voxels.

    Raises
    ------
    InvalidArgumentError
        If ``sample_distance`` is not a positive length.
    DeviceMemoryError
        If the volume or the grid of its occlusion does not fit.
    """

    def __init__(
        self,
        runtime: Runtime,
        volume: Volume,
        transfer_function: TransferFunction,
        options: MediumOptions | None = None,
        *,
        skip_empty: bool = True,
        by_scalar: bool = True,
        part: GridPart | None = None,
        ambient: NDArray[np.float32] | None = None,
        room: Room | None = None,
        **changes: Any,
    ) -> None:
        options = MediumOptions.of(options, changes)
        if not isinstance(volume, Volume):
            raise InvalidArgumentError(f"expected a Volume, got {type(volume).__name__}")
        if not isinstance(transfer_function, TransferFunction):
            raise InvalidArgumentError(
                f"expected a TransferFunction, got {type(transfer_function).__name__}"
            )
        self.volume = volume
        self.grid: Geometry = volume if part is None else part.grid
        self.sample_distance = checked_sample_distance(self.grid, options.sample_distance)
        self.unit_distance = held_unit_distance(
            transfer_function.unit_distance or self.grid.default_unit_distance, self.sample_distance
        )
        low, high = transfer_function.scalar_range
        longer = len(transfer_function.opacities) * ENTRY_BYTES - TABLE_BYTES // 10
        if room is not None and longer > 0:
            room = replace(room, working=room.working + longer)
        native = reads_natively(runtime, volume, transfer_function, room)
        scale = None if native else scale_of(volume, low, high)
        self.defines = voxel_defines(volume, native)
        whole = room is None or fits_whole(runtime, volume, scale, room)
        if room is None or whole:
            self._voxels, ranges = upload_voxels(runtime, volume, scale, self.defines)
        else:
            ranges = upload_ranges(runtime, volume, scale, self.defines, room)
        self.zero, self.unit = (0.0, 1.0) if scale is None else (scale.low, scale.unit)
        self._low, span = (low, high - low) if native else (0.0, 1.0 if high > low else 0.0)
        table = np.column_stack([transfer_function.colors, transfer_function.opacities])
        self._entries = len(table)
        self._per_scalar = _per_scalar(self._entries, span)
        self._table = runtime.upload(np.ascontiguousarray(table), "transfer function")
        self._visible = self._distances = self._visibility(runtime, ranges, transfer_function)
        if skip_empty:
            seen = runtime.download(self._visible)
            if 1.0 - float(np.mean(seen)) >= _WORTH_SKIPPING:
                self.defines["SKIP_EMPTY"] = 1
                self._distances = self._distances_of(runtime, seen)
        if transfer_function.interpolation == "nearest":
            self.defines["NEAREST"] = 1
            if by_scalar and native and (ends := integer_ends(runtime, volume, ranges)):
                self._look_up_by_scalar(runtime, *ends)
        self.runtime = runtime
        self._shading = transfer_function.shading
        self._lights = options.lights
        self._lit: tuple[Camera, DeviceBuffer] | None = None
        self._gradient: tuple[DeviceBuffer, ...] = ()
        shading = shading_defines(transfer_function, self._lights)
        if transfer_function.gradient_opacities is not None:
            scalars = volume.finite_range() if part is None else part.scalar_range
            per_difference = scale.unit if scale else 1.0
            gradient = gradient_table(volume.spacing, scalars, transfer_function, per_difference)
            self._gradient = (runtime.upload(gradient, "gradient opacity"),)
        self._blanked: tuple[DeviceBuffer, ...] = ()
        if volume.blanked is not None:
            self._blanked = (upload_blanked(runtime, volume),)
            self.defines["BLANKED"] = 1
        self._part: tuple[Any, ...] = ()
        if part is not None:
            self._part = part.arguments
            self.defines["GRID_PART"] = 1
        self._occlusion: tuple[Any, ...] = ()
        unlit = {k: v for k, v in shading.items() if k == "GRADIENT_OPACITY"}
        self._of_opacities = {**self.defines, **unlit}
        if options.ambient_occlusion is not None:
            if not whole:
                raise DeviceMemoryError(
                    f"ambient occlusion needs the volume {volume.name!r} in one piece, "
                    f"{bytes_text(device_bytes(volume, scale))}: raise memory_limit, leave "
                    "ambient_occlusion out, or use another device"
                )
            self._occlusion = self._occluded(options.ambient_occlusion, transfer_function, ambient)
            shading["OCCLUSION"] = 1
        self.defines.update(shading)
        self.defines.update(compensation(self.grid.length / self.sample_distance))
        # Last: nothing that fails then keeps them for as long as somebody looks at the error
        self.bricks: DeviceBricks | None = None
        if room is not None and not whole:
            self.bricks = self._bricks_within(room, scale, transfer_function)
            self._voxels = self.bricks.pool
            self.defines["SAMPLED"] = 1

    def _look_up_by_scalar(self, runtime: Runtime, first: int, last: int) -> None:
        """Replace the table by one of what each scalar from ``first`` to ``last`` looks like."""
        n = last - first + 1
        media = runtime.buffer((n, 4), name="media of scalars")
        with self._table:
            runtime.launch(
                runtime.kernel("volume/scalar_media.cl", "scalar_media"),
                padded(n, GROUP),
                GROUP,
                self._table,
                np.int32(self._entries),
                np.float32(self._low),
                np.float32(self._per_scalar),
                np.int32(first),
                np.int32(n),
                media,
            )
            runtime.finish()  # the table may be host memory in use
        self._table, self._entries, self._low, self._per_scalar = media, n, float(first), 1.0
        self.defines["BY_SCALAR"] = 1

    def giving_bricks_back(self) -> contextlib.AbstractContextManager[object]:
        """Give back what bricks take at the end of a ``with`` block, also if it fails."""
        return contextlib.nullcontext() if self.bricks is None else self.bricks

    @property
    def most_steps(self) -> int:
        """Steps of the longest ray."""
        return math.ceil(self.grid.length / self.sample_distance) + 1

    def medium_arguments(self, camera: Camera) -> tuple[Any, ...]:
        """Arguments ``voxels`` to ``forms``, without it, of the kernels that march.

        ``camera`` is the view: lights may move with it.
        """
        return (
            *self._classified(self._distances),
            *self._part,
            *self._lighting(camera),
            *self._gradient,
            *self._occlusion,
            *self._blanked,
        )

    def _bricks_within(
        self, room: Room, scale: Scale | None, transfer_function: TransferFunction
    ) -> DeviceBricks:
        """Return room for bricks of the volume, none of which is there yet."""
        runtime = self.runtime
        volume = self.volume
        gradients = (
            transfer_function.shading is not None
            or transfer_function.gradient_opacities is not None
        )
        dtype = volume.array.dtype if scale is None else np.dtype(np.float32)
        point_bytes = dtype.itemsize * math.prod(volume.array.shape[3:])
        others = other_bytes(volume)
        left = room.for_bricks(runtime, others)
        largest = runtime.info.max_allocation
        found = fitting_layout(volume.dimensions, point_bytes, gradients, left, largest)
        if found is None:
            least = least_brick_bytes(volume.dimensions, point_bytes, gradients) + others
            whole = device_bytes(volume, scale) + others
            raise too_small(described(volume), room, runtime, whole, least)
        return DeviceBricks(
            runtime,
            volume.array,
            voxel_reader(scale),
            dtype,
            *found,
            room.limit,
            self._visible,
            volume.name,
        )

    def _classified(self, macrocells: DeviceBuffer) -> tuple[Any, ...]:
        """Arguments ``voxels`` to ``macrocells``; ``macrocells`` says what may be skipped."""
        return (
            self._voxels,
            np.array([*self.volume.dimensions, 0], dtype=np.int32),
            self._table,
            np.int32(self._entries),
            np.float32(self._low),
            np.float32(self._per_scalar),
            macrocells,
            np.array([*macrocells_over(self.volume), 0], dtype=np.int32),
        )

    def _occluded(
        self,
        occlusion: AmbientOcclusion,
        transfer_function: TransferFunction,
        ambient: NDArray[np.float32] | None,
    ) -> tuple[Any, ...]:
        """Return the grid of the occlusion as kernel arguments, made once and kept."""
        grid = OcclusionGrid.of(self.grid, occlusion)
        to_nodes = np.array([*(1 / edge for edge in grid.cell), occlusion.strength], np.float32)
        nodes = np.array([*grid.nodes, 0], dtype=np.int32)
        if ambient is not None:
            return self.runtime.upload(ambient, "ambient occlusion"), nodes, to_nodes
        # Colours and shading have no part in it
        opacity = transfer_function.replace(
            colors=np.zeros_like(transfer_function.colors), shading=None
        )
        radius, directions = occlusion.radius_in(self.volume), occlusion.directions
        key = (opacity, radius, directions, self.sample_distance)
        uploads = uploads_of(self.volume)
        with self.runtime.holding(uploads.lock):
            kept = uploads.occlusions.get(self.runtime)
            if kept is None or kept[0] != key:
                uploads.occlusions.pop(self.runtime, None)  # its memory goes first
                kept = None
                found = ambient_transmittances(
                    self.runtime,
                    grid,
                    (*self._classified(self._visible), *self._gradient, *self._blanked),
                    self._classified(self._visible)[-2:],
                    self._of_opacities,
                    self.sample_distance,
                    self.unit_distance,
                )
                uploads.occlusions[self.runtime] = kept = (key, found)
        return kept[1], nodes, to_nodes

    def part_opacities(
        self,
        grid: OcclusionGrid,
        first: tuple[int, int, int],
        nodes: tuple[int, int, int],
    ) -> NDArray[np.float32]:
        """Return what this part of a volume has of the opacities of its occlusion's nodes.

        ``first``: the first of ``nodes``, both along x, y and z; float32 (nz, ny, nx).
        """
        return opacities_of_part(
            self.runtime,
            grid,
            (*self._classified(self._visible), *self._part, *self._gradient),
            self._of_opacities,
            (self.sample_distance, self.unit_distance),
            self.grid.dimensions,
            first,
            nodes,
        )

    def _lighting(self, camera: Camera) -> tuple[DeviceBuffer, ...]:
        """Return the lights of a view on the device, if the volume is shaded."""
        if self._shading is None:
            return ()
        if self._lit is None or self._lit[0] != camera:
            table = lighting_table(self.grid, camera, self._shading, self._lights)
            self._lit = (camera, self.runtime.upload(table, "lights"))
        return (self._lit[1],)

    def _visibility(
        self, runtime: Runtime, ranges: DeviceBuffer, transfer_function: TransferFunction
    ) -> DeviceBuffer:
        """Return which macrocells hold anything that is not transparent, uint8 on the device."""
        n = int(np.prod(macrocells_over(self.volume)))
        visible = runtime.buffer((n,), np.uint8, "visible macrocells")
        before = np.zeros(self._entries + 1, np.uint32)
        np.cumsum(transfer_function.opacities > 0, out=before[1:])
        kernel = runtime.kernel("volume/macrocells.cl", "macrocell_visibility", self.defines)
        with runtime.upload(before, "visible entries") as visible_before:
            runtime.launch(
                kernel,
                padded(n, GROUP),
                GROUP,
                ranges,
                np.uint32(n),
                visible_before,
                np.int32(self._entries),
                np.float32(self._low),
                np.float32(self._per_scalar),
                visible,
            )
            runtime.finish()  # the table above may be host memory in use
        return visible

    def _distances_of(self, runtime: Runtime, seen: NDArray[np.uint8]) -> DeviceBuffer:
        """Return how far each macrocell is from one that may be visible, uint8 on the device."""
        n = np.uint32(seen.size)
        kernel = runtime.kernel("volume/macrocells.cl", "macrocell_distances", self.defines)
        far = np.where(seen > 0, 0, _FARTHEST).astype(np.uint8)
        distances = runtime.upload(far, "empty macrocells")
        apart = 1
        for along in macrocells_over(self.volume):
            with distances as before:
                distances = runtime.buffer((seen.size,), np.uint8, "distances of macrocells")
                runtime.launch(
                    kernel,
                    padded(seen.size, GROUP),
                    GROUP,
                    before,
                    n,
                    np.uint32(apart),
                    np.int32(along),
                    np.int32(_FARTHEST),
                    distances,
                )
                runtime.finish()  # what was read is released
            apart *= along
        return distances

    def forms(
        self, camera: Camera, window_size: Sequence[int], clipping_planes: Planes = ()
    ) -> MarchForms:
        """Return what the kernels march along in a view."""
        return march_forms(self.grid, camera, window_size, clipping_planes)


@dataclass(frozen=True)
class GridRays:
    """The rays of a classified volume whose values are elsewhere, as of a :class:`DeviceVolume`."""

    grid: Geometry
    sample_distance: float
    unit_distance: float
    defines: dict[str, str | int | None] = field(default_factory=dict)

    def forms(self, camera: Camera, window_size: Sequence[int]) -> MarchForms:
        """Return what the kernels march along in a view."""
        return march_forms(self.grid, camera, window_size)


def march_forms(
    grid: Geometry, camera: Camera, window_size: Sequence[int], clipping_planes: Planes = ()
) -> MarchForms:
    """Return what the kernels march along in a view of a grid."""
    pixel_rays = rays.pixel_rays(camera, window_size, grid.bounds)
    to_index = rays.inverse_affine(grid.index_to_model)
    index = [pixel_rays.form(row[:3], row[3]) for row in to_index[:3]]
    direction = [pixel_rays.form(axis) for axis in np.eye(3)]
    planes = []
    for form, points in zip(index, grid.dimensions, strict=True):
        far = -form
        far[0] += points - 1
        planes += [form, far]
    planes += rays.eye_plane(camera, pixel_rays)
    planes += rays.user_planes(camera, pixel_rays, clipping_planes)
    reach = rays.largest_value(camera, window_size, grid.bounds, index)
    defines = entries(reach, max(grid.dimensions))
    return MarchForms([*index, *direction, *planes], pixel_rays, len(planes), defines)


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


def _per_scalar(entries: int, span: float) -> float:
    """Table positions per unit of scalar; a huge number where the range is a single scalar."""
    if entries == 1:
        return 0.0
    largest = float(np.finfo(np.float32).max)
    return min((entries - 1) / span, largest) if span > 0 else largest
