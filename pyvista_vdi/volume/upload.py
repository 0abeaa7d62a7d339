"""A volume's voxels on a device, as they are or scaled, and the scalar ranges of its macrocells."""

from __future__ import annotations

import math
import threading
import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import DeviceBuffer, Runtime, kept_together, padded
from pyvista_vdi.device.constants import GROUP, MACROCELL_SHIFT
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.float32_limits import LARGEST_POWER, LARGEST_VOXEL, scalars_suit_float32
from pyvista_vdi.model.host_memory import aligned_empty
from pyvista_vdi.model.lighting import Light, Lights, Shading
from pyvista_vdi.model.transfer_function import GRADIENT_SHARE, TransferFunction
from pyvista_vdi.model.volume import Grid, Volume
from pyvista_vdi.volume.bricks import Room, in_parts
from pyvista_vdi.volume.rays import Variant

T = TypeVar("T")

#: Voxel types that the kernels read as they are; the others are scaled to float32 on the host.
_DEVICE_TYPES = {
    "uint8": "uchar",
    "int8": "char",
    "uint16": "ushort",
    "int16": "short",
    "float32": "float",
}
#: Most bytes of a volume that are looked through at a time for the ranges of its macrocells, and
#: how many such parts there must be room for.
_PART_BYTES, _PARTS = 64 * 2**20, 4
#: Bytes on the device of what is known of a macrocell: its scalar range, whether it is visible,
#: and its distance from such a macrocell, which is made from another one.
MACROCELL_BYTES = 11
#: Bytes that are kept for tables: transfer functions, lights, rays. They may be a tenth of it.
TABLE_BYTES = 2**20
#: Bytes of a transfer function's entry, and of how many before it are not transparent.
ENTRY_BYTES = 20
#: Scalars of 16 bits that are looked up and not classified at each sample: 64 KiB of media.
_MOST_LOOKED_UP = 4096
#: Where scaled voxels end, in ranges of the transfer function.
_BEYOND = 2.0**60
#: Scaled voxels that are above the only scalar of a range are so by this at least.
_ABOVE = 2.0**-60
_uploads: weakref.WeakKeyDictionary[Volume, _Uploads] = weakref.WeakKeyDictionary()
_uploads_lock = threading.Lock()


@dataclass(frozen=True)
class HeldVoxels:
    """A volume's voxels on a device, where there is room for all, and how kernels read them.

    ``ranges``: least and largest scalar of each macrocell; ``scale``: how voxels are taken; None:
    as they are.
    """

    buffer: DeviceBuffer | None
    ranges: DeviceBuffer
    scale: Scale | None
    variant: Variant


def held_voxels(
    runtime: Runtime, volume: Volume, transfer_function: TransferFunction, room: Room | None
) -> HeldVoxels:
    """Upload a volume for a transfer function, or what is known of it where it does not fit."""
    dtype, uploads = volume.array.dtype, uploads_of(volume)
    native = dtype.name in _DEVICE_TYPES
    if native and not volume.rgba:  # a byte is exact, and colours have no such range
        low, high = transfer_function.scalar_range
        native = scalars_suit_float32(low, high, dtype, transfer_function.interpolation)
    variant = Variant(
        voxel=_DEVICE_TYPES[dtype.name] if native else "float",
        index="ulong" if volume.array.size >= 2**32 else "uint",
        components=4 if volume.rgba else 1,
    )
    scale = None
    if not native or uploads.too_large:
        scale = scale_of(volume, *transfer_function.scalar_range)
    if room is None or fits_whole(runtime, volume, scale, room):
        held = HeldVoxels(*upload_voxels(runtime, volume, scale, variant), scale, variant)
    else:
        ranges = upload_ranges(runtime, volume, scale, variant, room)
        held = HeldVoxels(None, ranges, scale, variant)
    # Look once whether differences of finite float32 voxels may overflow: such are scaled as well
    if scale is None and dtype.kind == "f" and uploads.too_large is None:
        ends = runtime.download(held.ranges)
        largest = np.abs(ends).max(initial=0.0, where=np.isfinite(ends))
        uploads.too_large = bool(largest > LARGEST_VOXEL)
        if uploads.too_large:
            del held  # its memory goes first
            return held_voxels(runtime, volume, transfer_function, room)
    return held


def uploads_of(volume: Volume) -> _Uploads:
    """Return what devices have of a volume, the same as long as the object lives."""
    with _uploads_lock:
        return _uploads.setdefault(volume, _Uploads())


def release_voxels(volume: Volume) -> None:
    """Release a volume from devices; it is uploaded when it is used again."""
    with _uploads_lock:
        gone = _uploads.pop(volume, None)
    del gone  # without the lock


@dataclass(eq=False)
class _Uploads:
    """What is on devices of one volume; the thread that uploads it holds its lock."""

    lock: Any = field(default_factory=threading.Lock)
    #: What :meth:`kept` keeps, by device and what it is: the key that it was made for, and it.
    made: dict[tuple[Runtime, str], tuple[Any, Any]] = field(default_factory=dict)
    #: Scalar range of each macrocell of a volume that no device holds in one piece, by scaling.
    ranges: dict[Any, NDArray[np.float32]] = field(default_factory=dict)
    #: Whether float32 cannot hold float32 voxels' differences; None before anyone has looked.
    too_large: bool | None = None
    #: Least and largest 16-bit scalar; None before anyone has looked.
    ends: tuple[int, int] | None = None

    def kept(self, runtime: Runtime, what: str, key: Any, make: Callable[[], T]) -> T:
        """Return what was made last, or make it if that was of another ``key``."""
        with runtime.holding(self.lock):
            made = self.made.get((runtime, what))
            if made is None or made[0] != key:
                self.made.pop((runtime, what), None)  # its memory goes first
                made = None
                self.made[runtime, what] = made = key, make()
            return made[1]  # type: ignore[no-any-return]


def macrocells_over(dimensions: Sequence[int]) -> tuple[int, int, int]:
    """Return the macrocells along x, y and z that cover the cells of a grid of so many points."""
    (x, y, z), edge = dimensions, 2**MACROCELL_SHIFT
    return -(-(x - 1) // edge), -(-(y - 1) // edge), -(-(z - 1) // edge)


def device_bytes(volume: Volume, scale: Scale | None) -> int:
    """Bytes of the volume on a device."""
    return volume.array.nbytes if scale is None else 4 * volume.array.size


def other_bytes(volume: Volume) -> int:
    """Bytes on a device beside the voxels: macrocells, tables and what is blank."""
    blanked = 0 if volume.blanked is None else volume.blanked.nbytes
    return math.prod(macrocells_over(volume.dimensions)) * MACROCELL_BYTES + TABLE_BYTES + blanked


def fits_whole(runtime: Runtime, volume: Volume, scale: Scale | None, room: Room) -> bool:
    """Return whether there is room for a volume in one piece."""
    made = uploads_of(volume).made.get((runtime, "voxels"))
    if room.limit is None and made is not None and made[0] == scale:
        return True
    info, nbytes = runtime.info, device_bytes(volume, scale)
    if nbytes > info.max_allocation:
        return False
    nbytes += other_bytes(volume) + room.working
    if room.limit is not None:
        return nbytes <= room.limit
    return runtime.allocated + nbytes <= info.global_memory


def upload_voxels(
    runtime: Runtime, volume: Volume, scale: Scale | None, variant: Variant
) -> tuple[DeviceBuffer, DeviceBuffer]:
    """Return voxels and the scalar range of each macrocell, made for a device's last scaling."""

    def make() -> tuple[DeviceBuffer, DeviceBuffer]:
        _require_a_number(runtime, volume)
        array = volume.array
        if scale is not None:
            array = aligned_empty(volume.array.shape, np.float32)
            for plane, target in zip(volume.array, array, strict=True):
                runtime.give_way()
                target[...] = scaled(plane, scale)
        with kept_together() as keep:
            voxels = keep(runtime.upload(array, f"volume {volume.name!r}"))
            ranges = keep(_macrocell_ranges(runtime, volume.dimensions, voxels, variant))
        return voxels, ranges

    return uploads_of(volume).kept(runtime, "voxels", scale, make)


def upload_ranges(
    runtime: Runtime,
    volume: Volume,
    scale: Scale | None,
    variant: Variant,
    room: Room,
) -> DeviceBuffer:
    """Return the scalar range of each macrocell of a volume that a device holds in bricks."""
    uploads = uploads_of(volume)
    with runtime.holding(uploads.lock):
        uploads.made.pop((runtime, "voxels"), None)  # its memory goes to the bricks
        if scale not in uploads.ranges:
            _require_a_number(runtime, volume)
            uploads.ranges = {scale: _ranges_in_parts(runtime, volume, scale, variant, room)}
        return runtime.upload(uploads.ranges[scale], "ranges of macrocells")


def _ranges_in_parts(
    runtime: Runtime,
    volume: Volume,
    scale: Scale | None,
    variant: Variant,
    room: Room,
) -> NDArray[np.float32]:
    """Return the scalar range of each macrocell, float32 (n, 2), from parts of the volume."""
    macrocells = macrocells_over(volume.dimensions)
    ranges = aligned_empty((*reversed(macrocells), 2), np.float32)
    point_bytes = device_bytes(volume, scale) // math.prod(volume.dimensions)
    nbytes = min(_PART_BYTES, room.in_all(runtime) // _PARTS, runtime.info.max_allocation)
    for place, points in in_parts(macrocells, 2**MACROCELL_SHIFT, point_bytes, nbytes):
        runtime.give_way()
        part = np.ascontiguousarray(scaled(volume.array[points], scale))
        nz, ny, nx = part.shape[:3]
        with (
            runtime.upload(part, f"part of volume {volume.name!r}") as voxels,
            _macrocell_ranges(runtime, (nx, ny, nz), voxels, variant) as found,
        ):
            ranges[place] = runtime.download(found).reshape(ranges[place].shape)
    return ranges.reshape(-1, 2)


def _macrocell_ranges(
    runtime: Runtime, dimensions: Sequence[int], voxels: DeviceBuffer, variant: Variant
) -> DeviceBuffer:
    """Return the scalar range of each macrocell of a grid of so many points along x, y and z."""
    macrocells = macrocells_over(dimensions)
    n = int(np.prod(macrocells))
    ranges = runtime.buffer((n, 2), name="ranges of macrocells")
    launch = runtime.bind(
        "volume/macrocells.cl", "macrocell_ranges", variant.defines, voxels=voxels, ranges=ranges
    )
    launch(padded(n, GROUP), (GROUP,), size=(*dimensions, 0), macrocells=(*macrocells, 0))
    return ranges


def integer_ends(runtime: Runtime, volume: Volume, ranges: DeviceBuffer) -> tuple[int, int] | None:
    """Return the least and the largest scalar that voxels may have, if they are few enough."""
    dtype = volume.array.dtype
    if dtype.kind not in "iu":
        return None
    if dtype.itemsize == 1:
        return (0, 255) if dtype.kind == "u" else (-128, 127)
    uploads = uploads_of(volume)
    if uploads.ends is None:
        macrocells = runtime.download(ranges)
        uploads.ends = int(macrocells[:, 0].min()), int(macrocells[:, 1].max())
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


class Scale(NamedTuple):
    """How voxels are taken relative to a transfer function's range.

    ``low``: the scalar that becomes 0; ``unit``: scalars per unit of the device's voxels; ``step``:
    whether ``low`` is the whole range, so that being above it is what counts.
    """

    low: float
    unit: float
    step: bool


def scale_of(volume: Volume, low: float, high: float) -> Scale:
    """Return how to take voxels relative to a transfer function's range of scalars."""
    if high > low:
        return Scale(low, high - low, False)
    farthest = 0.0
    for plane in volume.scalars:
        finite = plane[np.isfinite(plane)].astype(np.float64)
        farthest = max(farthest, float(np.abs(finite / 2 - low / 2).max(initial=0.0)))
    return Scale(low, 2 * farthest or 1.0, True)


def scaled(array: NDArray[Any], scale: Scale | None) -> NDArray[Any]:
    """Return voxels as the kernels read them: as they are, or scaled.

    That is 32-bit integers and float64 to float32, relative to the transfer function's range.
    float32 holds 24 bits: of a value far from zero compared with the range little would be left,
    of its place in the range everything that the table can tell apart is.
    """
    if scale is None:
        return array
    place = (array.astype(np.float64) - scale.low) / scale.unit
    if scale.step:  # what is above stays above, however little
        place = np.where(place > 0, np.maximum(place, _ABOVE), place)
    # Beyond any table anyway: their differences and the squares of these stay finite. An infinite
    # voxel stays one
    finite = np.clip(place, -_BEYOND, _BEYOND)
    return np.where(np.isinf(array), place, finite).astype(np.float32)


#: In place of a specular power of 0, as of which a highlight is where the ray is mirrored to the
#: eye's side: what small powers tend to, while 0 to the power of 0 is 1.
_LEAST_POWER = 1e-30
#: In place of a cone's cosine: the light shines everywhere.
_NO_CONE = -2.0


def lighting_table(
    grid: Grid, camera: Camera, shading: Shading, lights: Lights
) -> NDArray[np.float32]:
    """Return the material and the lights of a view.

    The lights' frame has its origin at the eye, where float32 resolves the directions. A headlight
    alone is in the model frame's axes, in which VTK shades it; other lights are in the view's.
    """
    to_frame = np.eye(4)
    if lights.headlight_only:
        to_frame[:3, 3] = -rays.inverse_affine(camera.model_to_view)[:3, 3]
    else:
        to_frame = camera.model_to_view
    index_to_frame = to_frame @ grid.index_to_model
    # Of normals only the direction matters: scaled to what float32 holds, whatever the spacing
    normal = rays.inverse_affine(index_to_frame)[:3, :3].T
    normal = normal / np.abs(normal).max()
    head = [
        *normal.ravel(),
        *index_to_frame[:3].ravel(),
        shading.ambient,
        shading.diffuse,
        shading.specular,
        max(shading.specular_power, _LEAST_POWER),
        float(lights.two_sided),
        float(shading.specular_power > LARGEST_POWER),
        len(lights.lights),
    ]
    return np.array(
        [*head, *(v for light in lights.lights for v in _light(light, camera))], dtype=np.float32
    )


def _light(light: Light, camera: Camera) -> list[float]:
    position, direction = light.in_view(camera)
    cone = math.cos(math.radians(light.cone_angle)) if light.cone_angle <= 90 else _NO_CONE
    return [
        *(light.intensity * c for c in (*light.ambient, *light.diffuse, *light.specular)),
        *direction,
        float(light.positional),
        *position,
        *light.attenuation,
        cone,
        light.exponent,
    ]


def gradient_table(
    spacing: Sequence[float],
    scalar_range: tuple[float, float],
    transfer_function: TransferFunction,
    per_difference: float,
) -> NDArray[np.float32]:
    """Return the gradient opacities, and how differences on the device lead to their places.

    ``per_difference``: scalars per unit of the device's voxels.
    """
    assert transfer_function.gradient_opacities is not None
    assert transfer_function.gradient_range is not None
    table = transfer_function.gradient_opacities
    low, high = transfer_function.gradient_range
    per_magnitude = (len(table) - 1) / (high - low)
    smallest, largest = scalar_range
    to_table = np.mean(spacing) / (2 * np.asarray(spacing)) * per_difference * per_magnitude
    last = GRADIENT_SHARE * (largest - smallest) * per_magnitude
    with np.errstate(over="ignore"):
        return np.array(
            [*to_table, last, len(table), -low * per_magnitude, *table], dtype=np.float32
        )
