"""A volume and its classification on a device, shared by generation and direct volume rendering."""

from __future__ import annotations

import contextlib
import math
import threading
import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import rays
from .ambient_occlusion import AmbientOcclusion, OcclusionGrid
from .blocks import GROUP
from .bricks import (
    DeviceBricks,
    Room,
    fitting_layout,
    in_parts,
    least_brick_bytes,
    too_small,
)
from .camera import Camera
from .checks import as_float
from .device_occlusion import ambient_transmittances
from .errors import DeviceMemoryError, InvalidArgumentError
from .lighting import Lights
from .numerics import (
    LARGEST_VOXEL,
    MOST_STEPS,
    compensation,
    entries,
    held_unit_distance,
    scalars_suit_float32,
)
from .opencl_runtime import (
    DeviceBuffer,
    Runtime,
    aligned_empty,
    bytes_text,
    kept_together,
    padded,
)
from .rays import Floats, PixelRays, packed, packed_pairs
from .shading import gradient_table, lighting_table, shading_defines
from .transfer_function import TransferFunction
from .volume import Volume

#: Voxel types that the kernels read as they are; the others are scaled to float32 on the host.
_DEVICE_TYPES = {
    "uint8": "uchar",
    "int8": "char",
    "uint16": "ushort",
    "int16": "short",
    "float32": "float",
}
#: Logarithm to base 2 of the points along each edge of a block that can be skipped.
_BLOCK_SHIFT = 3
#: Blocks: farther than this no march looks for what is not transparent.
_FARTHEST = 16
#: Most bytes of a volume that are looked through at a time for the ranges of its blocks, and how
#: many such parts there must be room for.
_PART_BYTES, _PARTS = 64 * 2**20, 4
#: Bytes on the device of what is known of a block: its scalar range, whether it is visible, and its
#: reach, which is made from another one.
_BLOCK_BYTES = 11
#: Bytes that are kept for tables: transfer functions, lights, rays. They may be a tenth of it.
_TABLE_BYTES = 2**20
#: Share of transparent blocks from which on looking for them pays. Measured (docs/performance.md):
#: where none is, a picture takes 1.2 to 1.35 times as long with the look as without; from .32 on it
#: takes .4 to .85.
_WORTH_SKIPPING = 0.15
#: Scalars of 16 bits that are looked up and not classified at each sample: 64 KiB of media.
_MOST_LOOKED_UP = 4096
#: Where scaled voxels end, in ranges of the transfer function.
_BEYOND = 2.0**60
#: Scaled voxels that are above the only scalar of a range are so by this at least.
_ABOVE = 2.0**-60
_uploads: weakref.WeakKeyDictionary[Volume, _Uploads] = weakref.WeakKeyDictionary()
_uploads_lock = threading.Lock()


@dataclass(frozen=True)
class MarchForms:
    """The rays of a view through a volume, as ``begin_march`` of ``common/march.cl`` takes them.

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
        pack = packed_pairs if self.defines else packed
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
    sample_distance : float, optional
        Length of a step, model units; half the smallest spacing by default.
    skip_empty : bool
        Pass by blocks that the transfer function makes transparent; the samples stay the same.
    lights : Lights, optional
        What a shaded volume is lit by; one headlight by default.
    ambient_occlusion : AmbientOcclusion, optional
        Darkens samples by what stands around them; computed once for a classification.
    room : Room, optional
        Memory that there is; a volume for which it is too little is held brick by brick. Without
        it a volume is held in one piece or refused.

    Attributes
    ----------
    bricks : DeviceBricks or None
        What is on the device, where that is not the whole volume: steps must be sampled by a
        :class:`~pyvista_vdi.bricks.StepSampler` before kernels march along them.

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
        sample_distance: float | None = None,
        *,
        skip_empty: bool = True,
        lights: Lights | None = None,
        ambient_occlusion: AmbientOcclusion | None = None,
        room: Room | None = None,
    ) -> None:
        if not isinstance(volume, Volume):
            raise InvalidArgumentError(f"expected a Volume, got {type(volume).__name__}")
        if not isinstance(transfer_function, TransferFunction):
            raise InvalidArgumentError(
                f"expected a TransferFunction, got {type(transfer_function).__name__}"
            )
        self.volume = volume
        self.sample_distance = checked_sample_distance(volume, sample_distance)
        self.unit_distance = held_unit_distance(
            transfer_function.unit_distance or volume.default_unit_distance, self.sample_distance
        )
        low, high = transfer_function.scalar_range
        native = _reads_natively(runtime, volume, transfer_function, room)
        scale = None if native else _scale_of(volume, low, high)
        self.defines = _voxel_defines(volume, native)
        whole = room is None or _fits(runtime, volume, scale, room)
        if room is None or whole:
            self._voxels, ranges = _upload(runtime, volume, scale, self.defines)
        else:
            ranges = _upload_ranges(runtime, volume, scale, self.defines, room)
        self._low, span = (low, high - low) if native else (0.0, 1.0 if high > low else 0.0)
        table = np.column_stack([transfer_function.colors, transfer_function.opacities])
        self._entries = len(table)
        self._per_scalar = _per_scalar(self._entries, span)
        self._table = runtime.upload(np.ascontiguousarray(table), "transfer function")
        self._visible = self._reaches = self._visibility(runtime, ranges, transfer_function)
        if skip_empty:
            seen = runtime.download(self._visible)
            if 1.0 - float(np.mean(seen)) >= _WORTH_SKIPPING:
                self.defines["SKIP_EMPTY"] = 1
                self._reaches = self._reaches_of(runtime, seen)
        if transfer_function.interpolation == "nearest":
            self.defines["NEAREST"] = 1
            if native and (ends := _integer_ends(runtime, volume, ranges)):
                self._look_up_by_scalar(runtime, *ends)
        self._runtime = runtime
        self._shading = transfer_function.shading
        self._lights = Lights() if lights is None else lights
        self._lit: tuple[Camera, DeviceBuffer] | None = None
        self._gradient: tuple[DeviceBuffer, ...] = ()
        shading = shading_defines(transfer_function, self._lights)
        if transfer_function.gradient_opacities is not None:
            gradient = gradient_table(volume, transfer_function, scale.unit if scale else 1.0)
            self._gradient = (runtime.upload(gradient, "gradient opacity"),)
        self.ambient_occlusion = ambient_occlusion
        self._occlusion: tuple[Any, ...] = ()
        if ambient_occlusion is not None:
            if not whole:
                raise DeviceMemoryError(
                    f"ambient occlusion needs the volume {volume.name!r} in one piece, "
                    f"{bytes_text(_device_bytes(volume, scale))}: raise memory_limit, leave "
                    "ambient_occlusion out, or use another device"
                )
            unlit = {k: v for k, v in shading.items() if k == "GRADIENT_OPACITY"}
            self._occlusion = self._occluded(
                ambient_occlusion, transfer_function, {**self.defines, **unlit}
            )
            shading["OCCLUSION"] = 1
        self.defines.update(shading)
        self.defines.update(compensation(volume.length / self.sample_distance))
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
                runtime.kernel("grid/scalar_media.cl", "scalar_media"),
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
        return math.ceil(self.volume.length / self.sample_distance) + 1

    def medium_arguments(self, camera: Camera) -> tuple[Any, ...]:
        """Arguments ``voxels`` to ``forms``, without it, of the kernels that march.

        ``camera`` is the view: lights may move with it.
        """
        return (
            *self._classified(self._reaches),
            *self._lighting(camera),
            *self._gradient,
            *self._occlusion,
        )

    def _bricks_within(
        self, room: Room, scale: _Scale | None, transfer_function: TransferFunction
    ) -> DeviceBricks:
        """Return room for bricks of the volume, none of which is there yet."""
        runtime = self._runtime
        volume = self.volume
        gradients = (
            transfer_function.shading is not None
            or transfer_function.gradient_opacities is not None
        )
        dtype = volume.array.dtype if scale is None else np.dtype(np.float32)
        point_bytes = dtype.itemsize * math.prod(volume.array.shape[3:])
        others = math.prod(_blocks(volume)) * _BLOCK_BYTES + _TABLE_BYTES
        left = room.for_bricks(runtime, others)
        largest = runtime.info.max_allocation
        found = fitting_layout(volume.dimensions, point_bytes, gradients, left, largest)
        if found is None:
            least = least_brick_bytes(volume.dimensions, point_bytes, gradients) + others
            whole = _device_bytes(volume, scale) + others
            raise too_small(_described(volume), room, runtime, whole, least)
        return DeviceBricks(
            runtime,
            volume.array,
            _reader(scale),
            dtype,
            *found,
            room.limit,
            self._visible,
            volume.name,
        )

    def _classified(self, blocks: DeviceBuffer) -> tuple[Any, ...]:
        """Arguments ``voxels`` to ``blocks``, of which ``blocks`` says what may be skipped."""
        return (
            self._voxels,
            np.array([*self.volume.dimensions, 0], dtype=np.int32),
            self._table,
            np.int32(self._entries),
            np.float32(self._low),
            np.float32(self._per_scalar),
            blocks,
            np.array([*_blocks(self.volume), 0], dtype=np.int32),
        )

    def _occluded(
        self,
        occlusion: AmbientOcclusion,
        transfer_function: TransferFunction,
        defines: dict[str, str | int | None],
    ) -> tuple[Any, ...]:
        """Return the grid of the occlusion as kernel arguments, made once and kept."""
        grid = OcclusionGrid.of(self.volume, occlusion)
        # Colours and shading have no part in it
        opacity = transfer_function.replace(
            colors=np.zeros_like(transfer_function.colors), shading=None
        )
        radius, directions = occlusion.radius_in(self.volume), occlusion.directions
        key = (opacity, radius, directions, self.sample_distance)
        uploads = _uploads_of(self.volume)
        with self._runtime.holding(uploads.lock):
            kept = uploads.occlusions.get(self._runtime)
            if kept is None or kept[0] != key:
                uploads.occlusions.pop(self._runtime, None)  # its memory goes first
                kept = None
                ambient = ambient_transmittances(
                    self._runtime,
                    grid,
                    (*self._classified(self._visible), *self._gradient),
                    self._classified(self._visible)[-2:],
                    defines,
                    self.sample_distance,
                    self.unit_distance,
                )
                uploads.occlusions[self._runtime] = kept = (key, ambient)
        to_nodes = [*(1 / edge for edge in grid.cell), occlusion.strength]
        return (
            kept[1],
            np.array([*grid.nodes, 0], dtype=np.int32),
            np.array(to_nodes, dtype=np.float32),
        )

    def _lighting(self, camera: Camera) -> tuple[DeviceBuffer, ...]:
        """Return the lights of a view on the device, if the volume is shaded."""
        if self._shading is None:
            return ()
        if self._lit is None or self._lit[0] != camera:
            table = lighting_table(self.volume, camera, self._shading, self._lights)
            self._lit = (camera, self._runtime.upload(table, "lights"))
        return (self._lit[1],)

    def _visibility(
        self, runtime: Runtime, ranges: DeviceBuffer, transfer_function: TransferFunction
    ) -> DeviceBuffer:
        """Return which blocks hold anything that is not transparent, uint8 on the device."""
        n = int(np.prod(_blocks(self.volume)))
        visible = runtime.buffer((n,), np.uint8, "visible blocks")
        before = np.zeros(self._entries + 1, np.uint32)
        np.cumsum(transfer_function.opacities > 0, out=before[1:])
        kernel = runtime.kernel("grid/volume_blocks.cl", "block_visibility", self.defines)
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

    def _reaches_of(self, runtime: Runtime, seen: NDArray[np.uint8]) -> DeviceBuffer:
        """Return how far each block is from one that may be visible, uint8 on the device."""
        n = np.uint32(seen.size)
        kernel = runtime.kernel("grid/volume_blocks.cl", "block_reaches", self.defines)
        far = np.where(seen > 0, 0, _FARTHEST).astype(np.uint8)
        reaches = runtime.upload(far, "empty blocks")
        apart = 1
        for along in _blocks(self.volume):
            with reaches as before:
                reaches = runtime.buffer((seen.size,), np.uint8, "reaches of empty blocks")
                runtime.launch(
                    kernel,
                    padded(seen.size, GROUP),
                    GROUP,
                    before,
                    n,
                    np.uint32(apart),
                    np.int32(along),
                    np.int32(_FARTHEST),
                    reaches,
                )
                runtime.finish()  # what was read is released
            apart *= along
        return reaches

    def forms(
        self, camera: Camera, window_size: Sequence[int], clipping_planes: ArrayLike | None
    ) -> MarchForms:
        """Return what the kernels march along in a view."""
        pixel_rays = rays.pixel_rays(camera, window_size, self.volume.bounds)
        to_index = rays.inverse_affine(self.volume.index_to_model)
        index = [pixel_rays.form(row[:3], row[3]) for row in to_index[:3]]
        direction = [pixel_rays.form(axis) for axis in np.eye(3)]
        planes = []
        for form, points in zip(index, self.volume.dimensions, strict=True):
            far = -form
            far[0] += points - 1
            planes += [form, far]
        planes += rays.eye_plane(camera, pixel_rays)
        planes += rays.user_planes(camera, pixel_rays, clipping_planes)
        reach = rays.largest_value(camera, window_size, self.volume.bounds, index)
        defines = entries(reach, max(self.volume.dimensions))
        return MarchForms([*index, *direction, *planes], pixel_rays, len(planes), defines)


def _voxel_defines(volume: Volume, native: bool) -> dict[str, str | int | None]:
    """Return the ``-D`` names by which kernels find and read a voxel."""
    defines: dict[str, str | int | None] = {
        "VOXEL_T": _DEVICE_TYPES[volume.array.dtype.name] if native else "float",
        "INDEX_T": "ulong" if volume.array.size >= 2**32 else "uint",
        "BLOCK_SHIFT": _BLOCK_SHIFT,
    }
    if volume.rgba:
        defines["RGBA"] = 1
    return defines


def voxel_bytes(volume: Volume, transfer_function: TransferFunction | None = None) -> int:
    """Return the bytes of a scalar, or of a colour's component, on the device.

    Scalars are taken to be read as they are where it is not known what for.
    """
    native = volume.array.dtype.name in _DEVICE_TYPES
    if transfer_function is not None:
        native = _suits_natively(volume, transfer_function)
    return volume.array.dtype.itemsize if native else np.dtype(np.float32).itemsize


def _reads_natively(
    runtime: Runtime, volume: Volume, transfer_function: TransferFunction, room: Room | None
) -> bool:
    """Whether kernels read the voxels as they are, or scaled to the transfer function's range."""
    if not _suits_natively(volume, transfer_function):
        return False
    return volume.array.dtype.kind != "f" or not _too_large(runtime, volume, room)


def _suits_natively(volume: Volume, transfer_function: TransferFunction) -> bool:
    """Whether type and range let kernels read the voxels as they are."""
    dtype = volume.array.dtype
    if dtype.name not in _DEVICE_TYPES:
        return False
    if volume.rgba:  # a byte is exact, and colours have no such range
        return True
    low, high = transfer_function.scalar_range
    return scalars_suit_float32(low, high, dtype, transfer_function.interpolation)


def _too_large(runtime: Runtime, volume: Volume, room: Room | None = None) -> bool:
    """Whether differences of a float32 volume's finite voxels may overflow; found once."""
    uploads = _uploads_of(volume)
    if uploads.too_large is None:
        defines = _voxel_defines(volume, True)
        if room is None or _fits(runtime, volume, None, room):
            ends = runtime.download(_upload(runtime, volume, None, defines)[1])
        else:
            ends = _ranges_in_parts(runtime, volume, None, defines, room)
        largest = np.abs(ends).max(initial=0.0, where=np.isfinite(ends))
        uploads.too_large = bool(largest > LARGEST_VOXEL)
    return uploads.too_large


def _uploads_of(volume: Volume) -> _Uploads:
    with _uploads_lock:
        return _uploads.setdefault(volume, _Uploads())


class _Uploads:
    """What is on devices of one volume; its lock lets the thread that uploads it be the only one.

    Voxels and the scalar range of each block, by device and scaling; the last classification's
    ambient occlusion, by device, with what it was computed from.
    """

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.made: dict[Any, tuple[DeviceBuffer, DeviceBuffer]] = {}
        #: Scalar range of each block of a volume that no device holds in one piece, by scaling.
        self.ranges: dict[Any, NDArray[np.float32]] = {}
        #: Whether float32 cannot hold the voxels' differences; None before anyone has asked.
        self.too_large: bool | None = None
        #: The least and the largest voxel of 16 bits; None before anyone has asked.
        self.ends: tuple[int, int] | None = None
        self.occlusions: dict[Runtime, tuple[Any, DeviceBuffer]] = {}


def checked_sample_distance(volume: Volume, sample_distance: float | None) -> float:
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


def _blocks(volume: Volume) -> tuple[int, int, int]:
    """Blocks along x, y and z that cover the cells of a volume."""
    return _blocks_of(volume.dimensions)


def _blocks_of(dimensions: Sequence[int]) -> tuple[int, int, int]:
    """Blocks along x, y and z that cover the cells of a grid of so many points."""
    x, y, z = (-(-(points - 1) // 2**_BLOCK_SHIFT) for points in dimensions)
    return x, y, z


def _device_bytes(volume: Volume, scale: _Scale | None) -> int:
    """Bytes of the volume on a device."""
    return volume.array.nbytes if scale is None else 4 * volume.array.size


def _described(volume: Volume) -> str:
    nx, ny, nz = volume.dimensions
    return f"the volume {volume.name!r}, {nx} x {ny} x {nz} of {volume.array.dtype}"


def _fits(runtime: Runtime, volume: Volume, scale: _Scale | None, room: Room) -> bool:
    """Whether there is room for a volume in one piece."""
    uploaded = (runtime, scale) in _uploads_of(volume).made
    nbytes, blocks = _device_bytes(volume, scale), math.prod(_blocks(volume))
    return room.holds(runtime, nbytes, blocks * _BLOCK_BYTES + _TABLE_BYTES, uploaded=uploaded)


def volume_bytes(volume: Volume, nbytes: int, room: Room) -> tuple[int, int]:
    """Return what a volume of ``nbytes`` on the device takes there, and its rays' samples, bytes.

    What its blocks and tables take is in it where there is a limit.
    """
    if room.limit is None:
        return nbytes, 0
    others = math.prod(_blocks(volume)) * _BLOCK_BYTES + _TABLE_BYTES
    if nbytes + others + room.working <= room.limit:
        return nbytes + others, 0
    return room.limit - room.working - room.sample_bytes, room.sample_bytes


def _reader(scale: _Scale | None) -> Callable[[NDArray[Any]], NDArray[Any]]:
    """Return what makes of voxels what the kernels read."""
    return (lambda part: part) if scale is None else (lambda part: _scaled(part, scale))


def _upload(
    runtime: Runtime,
    volume: Volume,
    scale: _Scale | None,
    defines: dict[str, str | int | None],
) -> tuple[DeviceBuffer, DeviceBuffer]:
    """Return voxels and the scalar range of each block, made once per device and scaling."""
    uploads = _uploads_of(volume)
    with runtime.holding(uploads.lock):
        made = uploads.made
        for other in [key for key in made if key[0] is runtime and key[1] != scale]:
            del made[other]  # one copy per device: the last classification's
        key = (runtime, scale)
        if key not in made:
            _require_a_number(runtime, volume)
            array = volume.array if scale is None else _all_scaled(runtime, volume.array, scale)
            with kept_together() as keep:
                voxels = keep(runtime.upload(array, f"volume {volume.name!r}"))
                ranges = keep(_block_ranges(runtime, volume.dimensions, voxels, defines))
                runtime.finish()  # a thread with another queue may use them next
            made[key] = (voxels, ranges)
        return made[key]


def _upload_ranges(
    runtime: Runtime,
    volume: Volume,
    scale: _Scale | None,
    defines: dict[str, str | int | None],
    room: Room,
) -> DeviceBuffer:
    """Return the scalar range of each block of a volume that the device holds brick by brick."""
    uploads = _uploads_of(volume)
    with runtime.holding(uploads.lock):
        for other in [key for key in uploads.made if key[0] is runtime]:
            del uploads.made[other]  # its memory goes to the bricks
        if scale not in uploads.ranges:
            _require_a_number(runtime, volume)
            uploads.ranges = {scale: _ranges_in_parts(runtime, volume, scale, defines, room)}
        return runtime.upload(uploads.ranges[scale], "ranges of blocks")


def _ranges_in_parts(
    runtime: Runtime,
    volume: Volume,
    scale: _Scale | None,
    defines: dict[str, str | int | None],
    room: Room,
) -> NDArray[np.float32]:
    """Return the scalar range of each block, float32 (n, 2), from parts of the volume."""
    blocks, read = _blocks(volume), _reader(scale)
    ranges = aligned_empty((*reversed(blocks), 2), np.float32)
    point_bytes = _device_bytes(volume, scale) // math.prod(volume.dimensions)
    nbytes = min(_PART_BYTES, room.in_all(runtime) // _PARTS, runtime.info.max_allocation)
    for place, points in in_parts(blocks, 2**_BLOCK_SHIFT, point_bytes, nbytes):
        runtime.give_way()
        part = np.ascontiguousarray(read(volume.array[points]))
        nz, ny, nx = part.shape[:3]
        with (
            runtime.upload(part, f"part of volume {volume.name!r}") as voxels,
            _block_ranges(runtime, (nx, ny, nz), voxels, defines) as found,
        ):
            ranges[place] = runtime.download(found).reshape(ranges[place].shape)
    return ranges.reshape(-1, 2)


def _block_ranges(
    runtime: Runtime,
    dimensions: Sequence[int],
    voxels: DeviceBuffer,
    defines: dict[str, str | int | None],
) -> DeviceBuffer:
    """Return the scalar range of each block of a grid of so many points along x, y and z."""
    blocks = _blocks_of(dimensions)
    n = int(np.prod(blocks))
    ranges = runtime.buffer((n, 2), name="ranges of blocks")
    runtime.launch(
        runtime.kernel("grid/volume_blocks.cl", "block_ranges", defines),
        padded(n, GROUP),
        GROUP,
        voxels,
        np.array([*dimensions, 0], dtype=np.int32),
        np.array([*blocks, 0], dtype=np.int32),
        ranges,
    )
    return ranges


def _integer_ends(runtime: Runtime, volume: Volume, ranges: DeviceBuffer) -> tuple[int, int] | None:
    """Return the least and the largest scalar that voxels may have, if they are few enough."""
    dtype = volume.array.dtype
    if dtype.kind not in "iu":
        return None
    if dtype.itemsize == 1:
        return (0, 255) if dtype.kind == "u" else (-128, 127)
    uploads = _uploads_of(volume)
    if uploads.ends is None:
        blocks = runtime.download(ranges)
        uploads.ends = int(blocks[:, 0].min()), int(blocks[:, 1].max())
    least, largest = uploads.ends
    return uploads.ends if largest - least < _MOST_LOOKED_UP else None


def _require_a_number(runtime: Runtime, volume: Volume) -> None:
    """Refuse a volume that is NaN throughout; nearly every other is known by its first plane."""
    if volume.array.dtype.kind != "f":
        return
    for plane in volume.array:
        runtime.give_way()
        if not np.isnan(plane).all():
            return
    volume.finite_range()  # says what is wrong


class _Scale(NamedTuple):
    """How voxels are taken relative to a transfer function's range.

    Attributes
    ----------
    low : float
        The scalar that becomes 0.
    unit : float
        Scalars per unit of the device's voxels.
    step : bool
        Whether ``low`` is the whole range, so that being above it is what counts.
    """

    low: float
    unit: float
    step: bool


def _scale_of(volume: Volume, low: float, high: float) -> _Scale:
    if high > low:
        return _Scale(low, high - low, False)
    farthest = 0.0
    for plane in volume.scalars:
        finite = plane[np.isfinite(plane)].astype(np.float64)
        farthest = max(farthest, float(np.abs(finite / 2 - low / 2).max(initial=0.0)))
    return _Scale(low, 2 * farthest or 1.0, True)


def _all_scaled(runtime: Runtime, array: NDArray[Any], scale: _Scale) -> NDArray[np.float32]:
    """Scale a volume plane by plane, see :func:`_scaled`."""
    scaled = aligned_empty(array.shape, np.float32)
    for plane, target in zip(array, scaled, strict=True):
        runtime.give_way()
        target[...] = _scaled(plane, scale)
    return scaled


def _scaled(array: NDArray[Any], scale: _Scale) -> NDArray[np.float32]:
    """32-bit integers and float64 to float32, taken relative to the transfer function's range.

    float32 holds 24 bits: of a value far from zero compared with the range little would be left,
    of its place in the range everything that the table can tell apart is.
    """
    scaled = (array.astype(np.float64) - scale.low) / scale.unit
    if scale.step:  # what is above stays above, however little
        scaled = np.where(scaled > 0, np.maximum(scaled, _ABOVE), scaled)
    # Beyond any table anyway: their differences and the squares of these stay finite. An infinite
    # voxel stays one
    finite = np.clip(scaled, -_BEYOND, _BEYOND)
    return np.where(np.isinf(array), scaled, finite).astype(np.float32)
