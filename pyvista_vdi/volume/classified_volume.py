"""A volume and its classification on a device, shared by generation and direct volume rendering."""

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from pyvista_vdi.device import DeviceBuffer, Runtime, bytes_text, padded
from pyvista_vdi.device.constants import GROUP
from pyvista_vdi.errors import DeviceMemoryError
from pyvista_vdi.model.ambient_occlusion import AmbientOcclusion, OcclusionGrid
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.float32_limits import LARGEST_POWER, held_unit_distance, summation
from pyvista_vdi.model.options import MediumOptions
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.volume.bricks import (
    SHIFTS,
    BrickLayout,
    DeviceBricks,
    Room,
    fitting_layout,
)
from pyvista_vdi.volume.occlusion_grid import ambient_transmittances
from pyvista_vdi.volume.rays import GridPart, GridRays, Variant, checked_sample_distance
from pyvista_vdi.volume.upload import (
    ENTRY_BYTES,
    TABLE_BYTES,
    HeldVoxels,
    Scale,
    device_bytes,
    gradient_table,
    held_voxels,
    integer_ends,
    lighting_table,
    macrocells_over,
    other_bytes,
    scaled,
    uploads_of,
)

#: Macrocells: farther than this no march looks for what is not transparent.
_FARTHEST = 16
#: Share of transparent macrocells from which on looking for them pays. Measured
#: (docs/decisions/generation.md): where none is, a picture takes 1.2 to 1.35 times as long with the
#: look as without; from .32 on it takes .4 to .85.
_WORTH_SKIPPING = 0.15


class DeviceVolume:
    """A classified volume as kernel arguments.

    The volume is uploaded once per device and kept as long as the object lives; the transfer
    function's table, a few kilobytes, each time; ambient occlusion is computed once for a
    classification. ``options``, and ``changes`` of them, say how it is sampled; ``skip_empty``
    passes by macrocells that the transfer function makes transparent, with the same samples. With
    ``part``, the volume's points lie in a grid of which they are a part: marches go along the whole
    grid's rays, and take the steps that belong to the part. A volume for which ``room`` is too
    little is held brick by brick; without it in one piece or refused.

    ``rays`` are marched through the volume or the grid that it is a part of, by ``most_steps``,
    those of the longest. ``bricks`` are on the device where the whole volume is not: steps must be
    sampled by a :class:`~pyvista_vdi.volume.bricks.StepSampler` before kernels march along them.
    Kernels are compiled for ``variant``, but for what belongs to a view. InvalidArgumentError if
    the sample distance is no positive length, DeviceMemoryError if something does not fit.
    """

    def __init__(
        self,
        runtime: Runtime,
        volume: Volume,
        transfer_function: TransferFunction,
        options: MediumOptions | None = None,
        *,
        skip_empty: bool = True,
        part: GridPart | None = None,
        room: Room | None = None,
        **changes: Any,
    ) -> None:
        options = replace(options or MediumOptions(), **changes)
        self.runtime, self.volume = runtime, volume
        self._looks, self._lights = transfer_function, options.lights
        grid = volume if part is None else part.grid
        step = checked_sample_distance(grid, options.sample_distance)
        unit_distance = transfer_function.unit_distance or grid.default_unit_distance
        self.rays = GridRays(grid, step, held_unit_distance(unit_distance, step))
        media = grid.length / step
        self.most_steps = math.ceil(media) + 1
        longer = len(transfer_function.opacities) * ENTRY_BYTES - TABLE_BYTES // 10
        if room is not None and longer > 0:
            room = replace(room, working=room.working + longer)

        # The voxels, the transfer function over them, and what it makes transparent
        voxels = held_voxels(runtime, volume, transfer_function, room)
        scale = voxels.scale
        table, self._visible, distances = _classified(runtime, volume, voxels, transfer_function)

        # What samples are shaded by
        gradient = None
        if transfer_function.gradient_opacities is not None:
            scalars = volume.finite_range() if part is None else part.scalar_range
            unit = 1.0 if scale is None else scale.unit
            values = gradient_table(volume.spacing, scalars, transfer_function, unit)
            gradient = runtime.upload(values, "gradient opacity")
        shading = transfer_function.shading
        self.variant: Variant = replace(
            voxels.variant,
            nearest=transfer_function.interpolation == "nearest",
            by_scalar=table.by_scalar,
            compensated=summation(media),
            shaded=0 if shading is None else 2 if self._lights.headlight_only else 1,
            sharp=shading is not None and shading.specular_power > LARGEST_POWER,
        )
        blanked = None
        if volume.blanked is not None:
            octants, name = volume.blanked, f"what is blank of volume {volume.name!r}"
            kept = uploads_of(volume).kept
            blanked = kept(runtime, "blanked", None, lambda: runtime.upload(octants, name))
        infinite, size = (math.inf,) * 4, (*volume.dimensions, 0)
        classified: dict[str, Any] = {
            "size": size,
            "held": size,
            "macrocells": (*macrocells_over(volume.dimensions), 0),
            "part_first": (0,) * 4 if part is None else (*part.first, 1),
            "part_lower": infinite if part is None else (*part.lower, 0),
            "part_upper": infinite if part is None else (*part.upper, 0),
            "nodes": (0,) * 4,
            "to_nodes": (0.0,) * 4,
            "entries": table.entries,
            "low": table.low,
            "per_scalar": table.per_scalar,
        }
        self._arguments: dict[str, Any] = {
            "classified": classified,
            "voxels": voxels.buffer,
            "table": table.buffer,
            "distances": distances if skip_empty else None,
            "blanked": blanked,
            "gradient": gradient,
            "lighting": None,
            "ambient": None,
        }
        self._lit: tuple[Camera, DeviceBuffer] | None = None
        if (asked := options.ambient_occlusion) is not None:
            occlusion = OcclusionGrid(grid, asked)
            if voxels.buffer is None:
                raise DeviceMemoryError(
                    f"ambient occlusion needs the volume {volume.name!r} in one piece, "
                    f"{bytes_text(device_bytes(volume, scale))}: raise memory_limit, leave "
                    "ambient_occlusion out, or use another device"
                )
            classified["nodes"] = (*occlusion.nodes, 0)
            classified["to_nodes"] = (*(1 / edge for edge in occlusion.cell), asked.strength)
            self._arguments["ambient"] = self._occluded(asked, occlusion)
        # Last: nothing that fails then keeps them for as long as somebody looks at the error
        self.bricks: DeviceBricks | None = None
        if voxels.buffer is None:
            assert room is not None
            self.bricks = _bricks_within(
                runtime, volume, room, scale, transfer_function, self._visible
            )
            self._arguments["voxels"] = self.bricks.pool

    def medium_arguments(self, camera: Camera) -> dict[str, Any]:
        """Return the arguments ``MEDIUM_PARAMETERS`` (``volume/medium.cl``) of kernels that march.

        ``camera`` is the view: lights may move with it.
        """
        if self._looks.shading is None:
            return self._arguments
        if self._lit is None or self._lit[0] != camera:
            table = lighting_table(self.rays.grid, camera, self._looks.shading, self._lights)
            self._lit = (camera, self.runtime.upload(table, "lights"))
        return {**self._arguments, "lighting": self._lit[1]}

    def _occluded(self, occlusion: AmbientOcclusion, grid: OcclusionGrid) -> DeviceBuffer:
        """Return the mean transmittances around the occlusion's nodes, made once and kept."""
        # Colours and shading have no part in it
        looks = self._looks
        opacity = looks.replace(colors=np.zeros_like(looks.colors), shading=None)
        radius, directions = occlusion.radius_in(self.volume), occlusion.directions
        key = (opacity, radius, directions, self.rays.sample_distance)
        names = ("classified", "voxels", "table", "blanked", "gradient")
        medium = {**{name: self._arguments[name] for name in names}, "visible": self._visible}
        variant = replace(self.variant, shaded=0, compensated=0, sharp=False)
        lengths = self.rays.sample_distance, self.rays.unit_distance
        make = partial(ambient_transmittances, self.runtime, grid, medium, variant, lengths)
        return uploads_of(self.volume).kept(self.runtime, "occlusion", key, make)


@dataclass(frozen=True)
class _Table:
    """A transfer function on a device, or the media of scalars that it makes."""

    buffer: DeviceBuffer
    entries: int
    low: float
    per_scalar: float  # entries per scalar; a huge number where the range is a single one
    by_scalar: bool = False  # whether it has the media


def _classified(
    runtime: Runtime, volume: Volume, voxels: HeldVoxels, transfer_function: TransferFunction
) -> tuple[_Table, DeviceBuffer, DeviceBuffer | None]:
    """Return what a transfer function makes of a volume, made once for its last classification.

    Its table, which macrocells are visible, and how far each is from a visible one; None where too
    few are transparent.
    """

    def make() -> tuple[_Table, DeviceBuffer, DeviceBuffer | None]:
        table = _table(runtime, transfer_function, native=voxels.scale is None)
        visible = _visibility(runtime, volume, voxels, table, transfer_function)
        distances = _distances(runtime, volume, voxels, visible)
        ends = None
        if voxels.scale is None and transfer_function.interpolation == "nearest":
            ends = integer_ends(runtime, volume, voxels.ranges)
        if ends is not None:
            table = _media_of_scalars(runtime, table, *ends)
        return table, visible, distances

    if voxels.buffer is None:  # the memory is for bricks
        return make()
    key = (transfer_function, voxels.scale)
    return uploads_of(volume).kept(runtime, "classification", key, make)


def _table(runtime: Runtime, transfer_function: TransferFunction, *, native: bool) -> _Table:
    """Upload a transfer function, over scalars as they are or scaled to its range."""
    low, high = transfer_function.scalar_range
    first, span = (low, high - low) if native else (0.0, 1.0 if high > low else 0.0)
    values = np.column_stack([transfer_function.colors, transfer_function.opacities])
    entries, largest = len(values), float(np.finfo(np.float32).max)
    per_scalar = 0.0 if entries == 1 else largest
    if entries > 1 and span > 0:
        per_scalar = min((entries - 1) / span, largest)
    buffer = runtime.upload(np.ascontiguousarray(values), "transfer function")
    return _Table(buffer, entries, first, per_scalar)


def _media_of_scalars(runtime: Runtime, table: _Table, first: int, last: int) -> _Table:
    """Return what each scalar from ``first`` to ``last`` looks like, in place of a table."""
    n = last - first + 1
    media = runtime.buffer((n, 4), name="media of scalars")
    with table.buffer as classified:
        launch = runtime.bind(
            "volume/scalar_media.cl", "scalar_media", table=classified, media=media
        )
        numbers = {"entries": table.entries, "low": table.low, "per_scalar": table.per_scalar}
        launch(padded(n, GROUP), GROUP, **numbers, first=first, count=n)
    return _Table(media, n, float(first), 1.0, by_scalar=True)


def _visibility(
    runtime: Runtime,
    volume: Volume,
    voxels: HeldVoxels,
    table: _Table,
    transfer_function: TransferFunction,
) -> DeviceBuffer:
    """Return which macrocells hold anything that is not transparent, uint8 on the device."""
    n = math.prod(macrocells_over(volume.dimensions))
    visible = runtime.buffer((n,), np.uint8, "visible macrocells")
    before = np.zeros(table.entries + 1, np.uint32)
    np.cumsum(transfer_function.opacities > 0, out=before[1:])
    with runtime.upload(before, "visible entries") as visible_before:
        launch = runtime.bind(
            "volume/macrocells.cl",
            "macrocell_visibility",
            voxels.variant.defines,
            ranges=voxels.ranges,
            macrocells=n,
            visible_before=visible_before,
            entries=table.entries,
            low=table.low,
            per_scalar=table.per_scalar,
            visible=visible,
        )
        launch(padded(n, GROUP), GROUP)
    return visible


def _distances(
    runtime: Runtime, volume: Volume, voxels: HeldVoxels, visible: DeviceBuffer
) -> DeviceBuffer | None:
    """Return how far each macrocell is from one that may be visible, uint8 on the device.

    ``None`` where too few are transparent for looking for them to pay.
    """
    seen = runtime.download(visible)
    if 1.0 - float(np.mean(seen)) < _WORTH_SKIPPING:
        return None
    far = np.where(seen > 0, 0, _FARTHEST).astype(np.uint8)
    distances = runtime.upload(far, "empty macrocells")
    defines = voxels.variant.defines
    launch = runtime.bind(
        "volume/macrocells.cl", "macrocell_distances", defines, macrocells=seen.size, most=_FARTHEST
    )
    apart = 1
    for along in macrocells_over(volume.dimensions):
        with distances as before:
            distances = runtime.buffer((seen.size,), np.uint8, "distances of macrocells")
            group = padded(seen.size, GROUP), GROUP
            launch(*group, before=before, apart=apart, along=along, distances=distances)
        apart *= along
    return distances


def _bricks_within(
    runtime: Runtime,
    volume: Volume,
    room: Room,
    scale: Scale | None,
    transfer_function: TransferFunction,
    visible: DeviceBuffer,
) -> DeviceBricks:
    """Return room for bricks of a volume, none of which is there yet.

    DeviceMemoryError if not even one brick has room.
    """
    gradients = (
        transfer_function.shading is not None or transfer_function.gradient_opacities is not None
    )
    dtype = volume.array.dtype if scale is None else np.dtype(np.float32)
    point_bytes = dtype.itemsize * math.prod(volume.array.shape[3:])
    beside, info = other_bytes(volume) + room.working, runtime.info
    left = room.in_all(runtime) - room.samples - beside
    found = fitting_layout(volume.dimensions, point_bytes, gradients, left, info.max_allocation)
    if found is None:
        least = BrickLayout.of(volume.dimensions, SHIFTS[-1], gradients, point_bytes)
        brick = least.brick_bytes + least.table_bytes + room.samples
        nx, ny, nz = volume.dimensions
        given = (
            f"{info.full_name!r} has {bytes_text(info.global_memory)}, of which this process holds "
            f"{bytes_text(runtime.allocated)}, and allows {bytes_text(info.max_allocation)} per "
            "buffer"
            if room.limit is None
            else f"memory_limit is {bytes_text(room.limit)}"
        )
        raise DeviceMemoryError(
            f"the volume {volume.name!r}, {nx} x {ny} x {nz} of {volume.array.dtype} takes "
            f"{bytes_text(device_bytes(volume, scale) + beside)} in one piece and at least "
            f"{bytes_text(brick + beside)} brick by brick, {room.rays} included; {given}: raise "
            "memory_limit, or use a smaller window size or max_supersegments, or another device"
        )
    read = partial(scaled, scale=scale)
    return DeviceBricks(
        runtime, volume.array, read, dtype, *found, room.limit, visible, volume.name
    )
