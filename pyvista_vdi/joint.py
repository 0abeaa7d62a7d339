"""Several VDIs to one image, on a device: merged by depth along each ray.

Each VDI's raycaster writes what a ray crosses into a pool, as segments between two view depths of
the new view; then the rays' streams of segments are merged and composited (docs/conventions.md,
"Several VDIs"). Rays are taken in bands, so that the pool stays small.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import weakref
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .blocks import GROUP, block_items
from .camera import Camera, check_window_size
from .cropping import Cropping, checked_opacity_multiplier
from .errors import InvalidArgumentError
from .opencl_runtime import DeviceBuffer, Runtime, get_runtime
from .raycast import TRANSMITTANCE_CUTOFF, ListView, PreparedVDI, prepared_vdi, render_vdi
from .vdi import VDI

#: Bytes of a segment: those of ``opencl/common/segments.cl``.
_SEGMENT_BYTES = 24
#: Bytes of the pool, unless the segments of 64 rays need more. A GPU needs more rays at a time.
_POOL_BYTES_CPU = 64 * 2**20
_POOL_BYTES = 256 * 2**20
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
        As for :func:`pyvista_vdi.raycast.render_vdi`; for all of them.
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
    order = _canonical_order(placed)
    streams_of = np.argsort(order).astype(np.int32)
    streams = [
        _Stream.of(prepared_vdi(runtime, one.vdi), one, size, opaque_depth, skip_empty)
        for one in (placed[i] for i in order)
    ]
    width, height = size
    with contextlib.ExitStack() as stack:
        walks = [stack.enter_context(stream.on(runtime)) for stream in streams]
        image = stack.enter_context(runtime.buffer((height, width, 4), name="image"))
        owner = stack.enter_context(runtime.buffer((height, width), np.int16, "owners"))
        numbers = stack.enter_context(runtime.upload(streams_of, "order of the VDIs"))
        nearest = min(stream.view.reference_depth for stream in streams)
        shifts = [np.float32(stream.view.reference_depth - nearest) for stream in streams]
        merge = runtime.kernel("vdi/merge.cl", "merge", {"STREAMS": len(streams)})
        slots = max(_slots.get(one.vdi, _FIRST_SLOTS) for one in placed)
        most = 1
        left = [_Band(0, block_items(width, height))]
        while left:
            with _Pool(runtime, len(streams), slots, left) as pool:
                for number, band in enumerate(pool.bands):
                    for stream, (walk, shift) in enumerate(zip(walks, shifts, strict=True)):
                        runtime.launch(
                            walk.kernel,
                            band.rays,
                            GROUP,
                            *walk.arguments,
                            np.uint32(band.first),
                            np.int32(stream),
                            np.int32(band.rays),
                            shift,
                            np.float32(margin),
                            np.int32(slots),
                            pool.segments,
                            pool.ends,
                            pool.contributes,
                        )
                    runtime.launch(
                        merge,
                        band.rays,
                        GROUP,
                        pool.segments,
                        np.int32(slots),
                        pool.ends,
                        pool.contributes,
                        np.int32(band.rays),
                        np.uint32(band.first),
                        np.int32(width),
                        np.int32(height),
                        np.float32(TRANSMITTANCE_CUTOFF),
                        numbers,
                        np.int32(number),
                        pool.needed,
                        image,
                        owner,
                    )
                needed = runtime.download(pool.needed)
            # Bands with rays of more segments are drawn again, with room for them
            left = [band for band, n in zip(pool.bands, needed, strict=True) if n > slots]
            most = max(most, int(needed.max()))
            slots = max(slots, most)
        for one in placed:
            _slots[one.vdi] = math.ceil(_SPARE_SLOTS * most)
        return JointImage(runtime.download(image), runtime.download(owner))


@dataclass(frozen=True)
class _Walk:
    """A kernel that writes a VDI's segments, and the arguments that do not change per band."""

    kernel: Any
    arguments: tuple[Any, ...]


@dataclass(frozen=True)
class _Stream:
    """A VDI on the device, as seen in the frame."""

    prepared: PreparedVDI
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
        return cls(prepared, view, skip_empty and prepared.occupancy.worthwhile)

    @contextlib.contextmanager
    def on(self, runtime: Runtime) -> Iterator[_Walk]:
        """Have the frame's arrays on the device."""
        defines = {**self.prepared.defines, **self.view.defines, "SEGMENTS": 1}
        if self.skip_empty:
            defines["SKIP_EMPTY"] = 1
        with (
            runtime.upload(self.view.forms, "rays") as forms,
            runtime.upload(self.view.ends, "opaque depth") as ends,
        ):
            yield _Walk(
                runtime.kernel("vdi/raycast.cl", "raycast", defines),
                self.prepared.walk_arguments(
                    self.view, forms, ends, -math.log(TRANSMITTANCE_CUTOFF)
                ),
            )
            runtime.finish()  # the buffers above may be host memory in use


class _Band(NamedTuple):
    """Rays that are drawn at a time: work-items of the frame, in multiples of ``GROUP``."""

    first: int
    rays: int


class _Pool:
    """Room for the segments of a band's rays; the bands into which rays are divided for it.

    Parameters
    ----------
    runtime : Runtime
        The device.
    streams : int
        VDIs.
    slots : int
        Segments of a ray that there is room for.
    rays : sequence of _Band
        All that are to be drawn.
    """

    def __init__(self, runtime: Runtime, streams: int, slots: int, rays: Sequence[_Band]) -> None:
        room = _POOL_BYTES_CPU if runtime.is_cpu else _POOL_BYTES
        groups = max(1, room // (GROUP * slots * _SEGMENT_BYTES))
        most = min(groups * GROUP, max(band.rays for band in rays))
        self.bands = [
            _Band(first, min(most, band.first + band.rays - first))
            for band in rays
            for first in range(band.first, band.first + band.rays, most)
        ]
        with contextlib.ExitStack() as stack:

            def make(shape: tuple[int, ...], dtype: Any, name: str) -> DeviceBuffer:
                return stack.enter_context(runtime.buffer(shape, dtype, name))

            self.segments = make((most * slots * _SEGMENT_BYTES // 4,), np.float32, "segments")
            self.ends = make((streams, most), np.int32, "ends of the streams")
            self.contributes = make((streams, most), np.uint8, "VDIs met")
            self.needed = make((len(self.bands),), np.int32, "slots needed")
            runtime.fill(self.needed, np.int32(0))
            self._stack = stack.pop_all()

    def __enter__(self) -> _Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()


def _canonical_order(placed: Sequence[PlacedVDI]) -> list[int]:
    """Return the indices of VDIs in an order that does not depend on the one they are given in.

    Sums of floats depend on it where there are more than two; the order of two does not matter.
    """
    indices = range(len(placed))
    if len(placed) < 3:
        return list(indices)
    return sorted(indices, key=lambda i: _key(placed[i]))


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
