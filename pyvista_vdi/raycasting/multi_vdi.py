"""Several VDIs to one image, on a device: merged by depth along each ray.

Each VDI's raycaster writes what a ray crosses into a pool, as segments between two view depths of
the new view; then the rays' streams of segments are merged and composited (docs/conventions.md,
"Several VDIs"). Rays are taken in bands, so that the pool stays small. Where no two of the VDIs can
be met, each is drawn as it would be by itself.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import weakref
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.device import DeviceBuffer, Runtime, get_runtime
from pyvista_vdi.device.constants import CELL, CELL_ITEMS
from pyvista_vdi.device.ray_forms import cells_of_points
from pyvista_vdi.device.work_order import GROUP, Rectangle
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.cropping import Cropping, checked_opacity_multiplier
from pyvista_vdi.model.float32_limits import compensation
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.packets import LANES
from pyvista_vdi.raycasting.raycast import (
    TRANSMITTANCE_CUTOFF,
    ListView,
    PreparedVDI,
    SegmentsKernel,
    prepared_vdi,
    render_vdi,
)

#: Bytes of a segment: those of ``opencl/raycasting/segments.cl``.
_SEGMENT_BYTES = 24
#: Slots that a ray has to spare where segments lie in rows: those of
#: ``opencl/raycasting/segments.cl``.
_SPARE_ROWS = 2
#: Bytes of the pool, unless the segments of a cell need more. A GPU needs more rays at a time; on a
#: CPU what is below 32 MiB is memory that the process has freed, without page faults (glibc).
_POOL_BYTES_CPU = 24 * 2**20
_POOL_BYTES = 256 * 2**20
#: Cells of a work-group, of which each work-item has a row.
_CELLS_OF_GROUP = 16
#: Segments of a ray that the first frame has room for; later ones go by the frame before.
_FIRST_SLOTS = 64
#: Room for so many times what the frame before needed.
_SPARE_SLOTS = 1.1

_slots: weakref.WeakKeyDictionary[VDI, int] = weakref.WeakKeyDictionary()
_digests: weakref.WeakKeyDictionary[VDI, bytes] = weakref.WeakKeyDictionary()


@dataclass(frozen=True)
class PlacedVDI:
    """A VDI and where it is in a scene.

    Attributes
    ----------
    vdi : VDI
        The medium.
    camera : Camera
        The new view; its ``model_transform`` says where this VDI's model frame is.
    clipping_planes : array_like of float, shape (k, 6), optional
        That cut this VDI: origin and normal of each, world coordinates.
    cropping : Cropping, optional
        Regions of its model frame that are drawn.
    opacity_multiplier : float
        Factor of its extinction.
    """

    vdi: VDI
    camera: Camera
    clipping_planes: ArrayLike | None = None
    cropping: Cropping | None = None
    opacity_multiplier: float = 1.0


@dataclass(frozen=True)
class JointImage:
    """The picture of several VDIs.

    Attributes
    ----------
    image : numpy.ndarray
        Premultiplied RGBA, float32 (H, W, 4), top row first.
    owner : numpy.ndarray
        int16 (H, W), top row first: the index of the VDI to which each pixel belongs, -1 where
        there is none.
    """

    image: NDArray[np.float32]
    owner: NDArray[np.int16]


def render_vdis(
    vdis: Sequence[VDI],
    camera: Camera,
    window_size: Sequence[int] | None = None,
    *,
    model_transforms: Sequence[ArrayLike] | None = None,
    opaque_depth: ArrayLike | None = None,
    clipping_planes: Any = None,
    cropping: Sequence[Any] | None = None,
    opacity_multiplier: float | Sequence[float] = 1.0,
    skip_empty: bool = True,
    device: Any = None,
) -> NDArray[np.float32]:
    """Raycast several VDIs together.

    Parameters
    ----------
    vdis : sequence of VDI
        In any order: the picture is the same to the last bit.
    camera : Camera
        The new view V_N.
    window_size : (int, int), optional
        Width and height in pixels; by default that of the VDIs, if all have the same.
    model_transforms : sequence of array_like of float, shape (4, 4), optional
        Where each VDI's model frame is; by default the camera's ``model_transform`` for all.
    opaque_depth
        As for :func:`pyvista_vdi.raycasting.raycast.render_vdi`; for all of them.
    clipping_planes : optional
        Shape (k, 6), for all of them; or one such array, or ``None``, for each.
    cropping : sequence, optional
        What :meth:`pyvista_vdi.Cropping.from_any` takes, or ``None``, for each.
    opacity_multiplier : float or sequence of float
        Factor of the extinction, 0 or above: for all of them, or one for each.
    skip_empty : bool
        Pass by what is empty. The picture is the same to the last bit.
    device : optional
        See :func:`pyvista_vdi.list_devices`.

    Returns
    -------
    numpy.ndarray
        Premultiplied RGBA, float32 (height, width, 4), top row first.
    """
    vdis = list(vdis)
    for vdi in vdis:
        if not isinstance(vdi, VDI):
            raise InvalidArgumentError(f"expected VDIs, got {type(vdi).__name__} among them")
    if not vdis:
        raise InvalidArgumentError("there is no VDI to render: the sequence is empty")
    camera = Camera.from_any(camera)
    size = _window_size(vdis, window_size)
    cameras = _cameras(camera, model_transforms, len(vdis))
    planes = _planes_of_each(clipping_planes, len(vdis))
    croppings = _croppings(cropping, len(vdis))
    multipliers = _multipliers(opacity_multiplier, len(vdis))
    if len(vdis) == 1:
        return render_vdi(
            vdis[0],
            cameras[0],
            size,
            opaque_depth=opaque_depth,
            clipping_planes=planes[0],
            cropping=croppings[0],
            opacity_multiplier=multipliers[0],
            skip_empty=skip_empty,
            device=device,
        )
    each = zip(vdis, cameras, planes, croppings, multipliers, strict=True)
    placed = [PlacedVDI(*one) for one in each]
    return joint_image(
        placed, size, opaque_depth=opaque_depth, skip_empty=skip_empty, device=device
    ).image


def joint_image(
    placed: Sequence[PlacedVDI],
    size: tuple[int, int],
    *,
    opaque_depth: ArrayLike | None = None,
    margin: float = 0.0,
    skip_empty: bool = True,
    device: Any = None,
) -> JointImage:
    """Raycast VDIs together, and say to which each pixel belongs.

    Parameters
    ----------
    placed : sequence of PlacedVDI
        All seen by the same eye: their cameras differ in ``model_transform`` only.
    size : (int, int)
        Width and height of the image in pixels.
    opaque_depth : array_like of float, shape (H, W), optional
        View depth at which each ray ends, world units, top row first.
    margin : float
        A pixel belongs to the first VDI that it meets and whose bounds it meets this many pixels
        farther to all four corners, too; or else to the first that it meets.
    skip_empty : bool
        Pass by what is empty.
    device : optional
        See :func:`pyvista_vdi.list_devices`.

    Returns
    -------
    JointImage
        The same picture, to the last bit, in whatever order the VDIs are given.
    """
    runtime = get_runtime(device)
    streams = [
        _Stream.of(prepared_vdi(runtime, one.vdi), one, size, opaque_depth, skip_empty)
        for one in placed
    ]
    order = _canonical_order(placed, [stream.view.reference_depth for stream in streams])
    width, height = size
    cells = _Cells.of(streams, size)
    with contextlib.ExitStack() as stack:
        on_device = [stack.enter_context(stream.on(runtime)) for stream in streams]
        image = stack.enter_context(runtime.result((height, width, 4), name="image"))
        owner = stack.enter_context(runtime.result((height, width), np.int16, "owners"))
        _draw_alone(runtime, streams, on_device, cells, image, owner)
        if len(cells.shared):
            frame = _JointFrame(runtime, streams, on_device, order, margin)
            needed = frame.draw(cells.shared, _slots_for(placed), image, owner)
            for one in placed:
                _slots[one.vdi] = math.ceil(_SPARE_SLOTS * max(needed, 1))
        result = JointImage(runtime.download(image), runtime.download(owner))
        runtime.finish()  # arrays on the device may be host memory in use
        return result


class _OnDevice(NamedTuple):
    """A frame's arrays of a VDI."""

    forms: DeviceBuffer
    ends: DeviceBuffer


@dataclass(frozen=True)
class _Stream:
    """A VDI on the device, as seen in the frame."""

    prepared: PreparedVDI
    placed: PlacedVDI
    view: ListView
    skip_empty: bool

    @classmethod
    def of(
        cls,
        prepared: PreparedVDI,
        placed: PlacedVDI,
        size: tuple[int, int],
        opaque_depth: ArrayLike | None,
        skip_empty: bool,
    ) -> _Stream:
        view = prepared.view(
            placed.camera,
            size,
            opaque_depth,
            placed.clipping_planes,
            placed.cropping,
            placed.opacity_multiplier,
        )
        return cls(prepared, placed, view, skip_empty)

    @contextlib.contextmanager
    def on(self, runtime: Runtime) -> Iterator[_OnDevice]:
        """Have the frame's arrays on the device."""
        with (
            runtime.upload(self.view.forms, "rays") as forms,
            runtime.upload(self.view.ends, "opaque depth") as ends,
        ):
            yield _OnDevice(forms, ends)


@dataclass(frozen=True)
class _Cells:
    """The cells of a window, by which VDIs may be met in them.

    Attributes
    ----------
    alone : numpy.ndarray
        int16 (high, wide), bottom row first: the VDI that is the only one, or ``SHARED`` or
        ``NOBODY``.
    shared : numpy.ndarray
        Column and row of each in which several may be met, int32 (n, 2), row by row.
    """

    SHARED: ClassVar[int] = -1
    #: That of ``opencl/multi_vdi/cells.cl``.
    NOBODY: ClassVar[int] = -2

    alone: NDArray[np.int16]
    shared: NDArray[np.int32]

    @classmethod
    def of(cls, streams: Sequence[_Stream], size: tuple[int, int]) -> _Cells:
        # Whether or not rays pass by what is empty: the picture is the same
        met = np.array(
            [
                cells_of_points(stream.placed.camera, size, stream.prepared.occupancy.corners)
                for stream in streams
            ]
        )
        count = met.sum(axis=0)
        alone = np.choose(
            np.minimum(count, 2), [np.full_like(count, cls.NOBODY), met.argmax(axis=0), cls.SHARED]
        )
        shared = np.argwhere(count > 1)[:, ::-1]
        return cls(alone.astype(np.int16), np.ascontiguousarray(shared, dtype=np.int32))

    def part(self, vdi: int, size: tuple[int, int]) -> Rectangle:
        """Return the part of the window in which a VDI's cells are."""
        rows, columns = np.nonzero(self.alone == vdi)
        if not len(rows):
            return Rectangle(0, 0, 0, 0)
        return Rectangle(
            int(columns.min()) * CELL,
            min((int(columns.max()) + 1) * CELL, size[0]),
            int(rows.min()) * CELL,
            min((int(rows.max()) + 1) * CELL, size[1]),
        )


def _draw_alone(
    runtime: Runtime,
    streams: Sequence[_Stream],
    on_device: Sequence[_OnDevice],
    cells: _Cells,
    image: DeviceBuffer,
    owner: DeviceBuffer,
) -> None:
    """Draw the cells in which no two VDIs are met, as each would be by itself."""
    width, height = size = streams[0].view.size
    wide = cells.alone.shape[1]
    group = (_CELLS_OF_GROUP, 1)
    items = (-(-wide // _CELLS_OF_GROUP) * _CELLS_OF_GROUP, height)
    ends_kernel = runtime.kernel("multi_vdi/cells.cl", "alone_ends")
    take = runtime.kernel("multi_vdi/cells.cl", "take_cells")
    with contextlib.ExitStack() as stack:
        alone = stack.enter_context(runtime.upload(cells.alone, "cells"))
        window = (np.int32(wide), np.int32(width), np.int32(height))
        picture, ends = image, None  # others are drawn over the first one's picture
        for number, (stream, arrays) in enumerate(zip(streams, on_device, strict=True)):
            part = cells.part(number, size)
            if not part.pixels:
                continue
            vdi = np.int32(number)
            if ends is None:
                ends = stack.enter_context(runtime.result((height, width), name="ends of rays"))
            elif picture is image:
                picture = stack.enter_context(runtime.result(image.shape, name="one's picture"))
            has_ends = np.int32(stream.view.has_ends)
            runtime.launch(
                ends_kernel, items, group, alone, vdi, *window, arrays.ends, has_ends, ends
            )
            stream.prepared.render_part(
                stream.placed.camera,
                stream.view,
                arrays.forms,
                ends,
                picture,
                part,
                skip_empty=stream.skip_empty,
            )
            runtime.launch(take, items, group, alone, vdi, *window, picture, image, owner)
        if (cells.alone == cells.NOBODY).any():
            nobody = np.int32(cells.NOBODY)
            runtime.launch(take, items, group, alone, nobody, *window, image, image, owner)
        runtime.finish()  # the buffers above may be host memory in use


class _JointFrame:
    """What a frame's cells are drawn with in which several VDIs are met.

    Parameters
    ----------
    runtime : Runtime
        The device.
    streams : sequence of _Stream
        The VDIs, in the order in which owners are numbered.
    on_device : sequence of _OnDevice
        Their arrays.
    order : sequence of int
        In which their streams of segments are written, and sums are formed.
    margin : float
        See :func:`joint_image`.
    """

    def __init__(
        self,
        runtime: Runtime,
        streams: Sequence[_Stream],
        on_device: Sequence[_OnDevice],
        order: Sequence[int],
        margin: float,
    ) -> None:
        self._runtime = runtime
        self._size = streams[0].view.size
        self._streams_of = np.argsort(order).astype(np.int32)
        self._margin = np.float32(margin)
        nearest = min(stream.view.reference_depth for stream in streams)
        self._in_rows = _in_rows(runtime)
        self._walks = [
            _Walk(
                streams[i].prepared.segments_kernel(
                    streams[i].view, skip_empty=streams[i].skip_empty, in_rows=self._in_rows
                ),
                streams[i].prepared.walk_arguments(
                    streams[i].view, *on_device[i], -math.log(TRANSMITTANCE_CUTOFF)
                ),
                np.float32(streams[i].view.reference_depth - nearest),
            )
            for i in order
        ]
        media = sum(stream.prepared.media for stream in streams)
        defines: dict[str, str | int | None] = {
            "STREAMS": len(streams),
            "SEGMENTS": 2 if self._in_rows else 1,
            **compensation(media),
        }
        if self._in_rows and defines.get("COMPENSATED") != 2:
            merge = runtime.kernel("multi_vdi/merge_blocks.cl", "merge_blocks", defines)
            self._merge = SegmentsKernel(merge, LANES)
        else:
            self._merge = SegmentsKernel(runtime.kernel("multi_vdi/merge.cl", "merge", defines), 1)

    def draw(
        self, cells: NDArray[np.int32], slots: int, image: DeviceBuffer, owner: DeviceBuffer
    ) -> int:
        """Draw cells, and return how many slots their rays have needed at most.

        Those with rays that have more segments than there are ``slots`` are drawn again.
        """
        needed = self._pass(cells, slots, image, owner)
        most = int(needed.max())
        if most > slots:
            self._pass(cells[needed > slots], most, image, owner)
        return most

    def _pass(
        self, cells: NDArray[np.int32], slots: int, image: DeviceBuffer, owner: DeviceBuffer
    ) -> NDArray[np.int32]:
        """Draw cells whose rays have room, and return how many slots those of each have needed."""
        runtime = self._runtime
        width, height = self._size
        streams = len(self._walks)
        room = _POOL_BYTES_CPU if runtime.is_cpu else _POOL_BYTES
        ray_bytes = _SEGMENT_BYTES * (slots + (_SPARE_ROWS if self._in_rows else 0))
        most = min(max(1, room // (CELL_ITEMS * ray_bytes)), len(cells))  # cells of a band
        rays = np.int32(most * CELL_ITEMS)
        with (
            runtime.result((int(rays) * ray_bytes // 4,), name="segments") as segments,
            runtime.result((streams, int(rays)), np.int32, "ends of the streams") as ends,
            runtime.result((streams, int(rays)), np.uint8, "VDIs met") as contributes,
            runtime.result((int(rays),), name="ends of light") as dark,
            runtime.buffer((len(cells),), np.int32, "slots needed") as needed,
            runtime.upload(cells, "cells") as of_cells,
            runtime.upload(self._streams_of, "order of the VDIs") as streams_of,
        ):
            runtime.fill(needed, np.int32(0))
            for first in range(0, len(cells), most):
                items = min(most, len(cells) - first) * CELL_ITEMS
                for number, walk in enumerate(self._walks):
                    runtime.launch(
                        walk.kernel.kernel,
                        items // walk.kernel.rays,
                        GROUP // walk.kernel.rays,
                        *walk.arguments,
                        of_cells,
                        np.int32(first),
                        np.int32(number),
                        rays,
                        walk.depth_shift,
                        self._margin,
                        np.int32(slots),
                        segments,
                        ends,
                        contributes,
                        dark,
                    )
                runtime.launch(
                    self._merge.kernel,
                    items // self._merge.rays,
                    GROUP // self._merge.rays,
                    segments,
                    np.int32(slots),
                    ends,
                    contributes,
                    rays,
                    of_cells,
                    np.int32(first),
                    np.int32(width),
                    np.int32(height),
                    np.float32(TRANSMITTANCE_CUTOFF),
                    streams_of,
                    needed,
                    image,
                    owner,
                )
            return runtime.download(needed)


@dataclass(frozen=True)
class _Walk:
    """A kernel that writes a VDI's segments, and the arguments that do not change per band."""

    kernel: SegmentsKernel
    arguments: tuple[Any, ...]
    depth_shift: np.float32


def _in_rows(runtime: Runtime) -> bool:
    """Return whether segments lie ray by ray, for kernels in vectors (raycasting/segments.cl)."""
    return runtime.is_cpu


def _slots_for(placed: Sequence[PlacedVDI]) -> int:
    return max(_slots.get(one.vdi, _FIRST_SLOTS) for one in placed)


def _canonical_order(placed: Sequence[PlacedVDI], depths: Sequence[float]) -> list[int]:
    """Return the indices of VDIs in an order that does not depend on the one they are given in.

    Sums of floats depend on it where there are more than two, and so does where light is known to
    have ended: that of ``depths``, so that those behind end where those before are opaque.
    """
    tied = len(set(depths)) < len(depths)
    keys = [_key(one) if tied else () for one in placed]
    return sorted(range(len(placed)), key=lambda i: (depths[i], keys[i]))


def _key(placed: PlacedVDI) -> tuple[bytes, ...]:
    planes = placed.clipping_planes
    table = b"" if planes is None else np.asarray(planes, dtype=np.float64).tobytes()
    looks = repr((placed.cropping, placed.opacity_multiplier)).encode()
    return _digest(placed.vdi), placed.camera.model_transform.tobytes(), table, looks


def _digest(vdi: VDI) -> bytes:
    """Return a digest of all that a VDI's picture depends on; computed once."""
    known = _digests.get(vdi)
    if known is None:
        digest = hashlib.blake2b(digest_size=16)
        scalars = (vdi.camera, vdi.window_size, vdi.bounds, vdi.depth_origin)
        digest.update(repr(scalars).encode())
        digest.update(vdi.camera.model_transform.tobytes())
        for array in (vdi.offsets, vdi.front, vdi.back, vdi.color, vdi.optical_depth):
            digest.update(array.data)
        known = _digests[vdi] = digest.digest()
    return known


def _window_size(vdis: list[VDI], window_size: Sequence[int] | None) -> tuple[int, int]:
    if window_size is not None:
        return check_window_size(window_size)
    sizes = {vdi.window_size for vdi in vdis}
    if len(sizes) > 1:
        raise InvalidArgumentError(
            f"the VDIs have different window sizes, {sorted(sizes)}: say which the image is to "
            "have (window_size=)"
        )
    return vdis[0].window_size


def _cameras(camera: Camera, transforms: Sequence[ArrayLike] | None, count: int) -> list[Camera]:
    if transforms is None:
        return [camera] * count
    transforms = list(transforms)
    if len(transforms) != count:
        raise InvalidArgumentError(
            f"model_transforms must have one matrix for each of the {count} VDIs; "
            f"got {len(transforms)}"
        )
    return [camera.replace(model_transform=matrix) for matrix in transforms]


def _croppings(croppings: Sequence[Any] | None, count: int) -> list[Cropping | None]:
    if croppings is None:
        return [None] * count
    if not isinstance(croppings, list | tuple) or len(croppings) != count:
        raise InvalidArgumentError(
            f"cropping must be a list with an entry for each of the {count} VDIs, None where "
            f"nothing is cropped; got {croppings!r}"
        )
    return [Cropping.from_any(one) for one in croppings]


def _multipliers(multiplier: float | Sequence[float], count: int) -> list[float]:
    if not isinstance(multiplier, list | tuple):
        return [checked_opacity_multiplier(multiplier)] * count
    if len(multiplier) != count:
        raise InvalidArgumentError(
            f"opacity_multiplier must be a number, or one for each of the {count} VDIs; "
            f"got {multiplier!r}"
        )
    return [checked_opacity_multiplier(one) for one in multiplier]


def _planes_of_each(planes: Any, count: int) -> list[ArrayLike | None]:
    """Return each VDI's clipping planes: the same for all, or one entry for each."""
    if planes is None:
        return [None] * count
    try:
        shape = np.shape(np.asarray(planes, dtype=np.float64))
    except (TypeError, ValueError):  # None among them, or different numbers of planes
        shape = ()
    if len(shape) == 2:
        return [planes] * count
    try:
        each = list(planes)
    except TypeError:
        each = []
    if len(each) != count:
        raise InvalidArgumentError(
            "clipping_planes must be (k, 6), or have such an array or None for each of the "
            f"{count} VDIs; got {planes!r}"
        )
    return each
