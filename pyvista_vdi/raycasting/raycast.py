"""VDI to image, on a device."""

from __future__ import annotations

import functools
import math
import threading
import weakref
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.device import (
    DeviceBuffer,
    Kernel,
    Runtime,
    aligned_empty,
    get_runtime,
    kept_together,
)
from pyvista_vdi.device import ray_forms as rays
from pyvista_vdi.device.constants import COLUMN_ITEMS
from pyvista_vdi.device.work_order import GROUP, Rectangle, block_items, part_columns
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.cropping import Cropping, checked_opacity_multiplier
from pyvista_vdi.model.float32_limits import compensation, lists_are_far
from pyvista_vdi.model.packing import Packed8, Packed16
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.occupancy import OccupancyGrid
from pyvista_vdi.raycasting.packets import (
    COORDINATE_FORMS,
    LANES,
    PLANE_FORMS,
    OwnLists,
    Packets,
    epipole_of,
    own_lists_of,
    packets_of,
    share_lit,
)
from pyvista_vdi.raycasting.picking import DEFAULT_OPACITY, FirstHit

#: A ray ends where less transmittance than this is left, unless told otherwise: no channel loses
#: more than that.
TRANSMITTANCE_CUTOFF = 1e-6
#: Most samples of a ray in a preview: each has a half, and float32 counts halves up to 2^24.
MAX_PREVIEW_SAMPLES = 2**23
#: Far depth over near depth up to which a lens counts as long, and depth is kept relative.
_LONG_LENS = 2.0
#: Lists along each edge of a tile, in which supersegments lie together; those of 8 bytes lie list
#: by list: that of ``raycasting/supersegments.cl``.
_LIST_TILE = 2
#: Bits of a tile's header that say where it begins: that of ``raycasting/supersegments.cl``.
_FIRST_BITS = 36
#: Pairs of words before the supersegments of an 8-byte list: that of
#: ``raycasting/supersegments.cl``.
_LIST_HEADER = 2

#: ``-D`` names of what is drawn ray by ray everywhere; V_O's rays then have a loop of their own.
_RAY_BY_RAY = {"FAR_ENTRIES", "FIRST_HIT", "ONE_LIST"}
#: The same of what is drawn in blocks at most, not in packets or from own lists.
_AT_MOST_IN_BLOCKS = {"CROPPED"}
#: Share of a window above which rays are cast through all of it: clearing it first costs as much.
_MOST_DRAWN = 0.9
#: Work-items per group that clear an image.
_CLEARING_GROUP = 256

_Keep: TypeAlias = Callable[[DeviceBuffer], DeviceBuffer]

_prepared: weakref.WeakKeyDictionary[VDI, dict[Runtime, _Preparation]] = weakref.WeakKeyDictionary()
_lock = threading.Lock()


def render_vdi(
    vdi: VDI,
    camera: Camera,
    window_size: Sequence[int] | None = None,
    *,
    opaque_depth: ArrayLike | None = None,
    clipping_planes: ArrayLike | None = None,
    cropping: Any = None,
    opacity_multiplier: float = 1.0,
    skip_empty: bool = True,
    preview_samples: int | None = None,
    transmittance_cutoff: float = TRANSMITTANCE_CUTOFF,
    device: Any = None,
    out: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:
    """Raycast a VDI from any view (paper section 3).

    Parameters
    ----------
    vdi : VDI
        Uploaded once per device and kept as long as the object lives.
    camera : Camera
        The new view V_N. Its ``model_transform`` says where the VDI's model frame is now.
    window_size : (int, int), optional
        Width and height in pixels; by default the VDI's own.
    opaque_depth : array_like of float, shape (height, width), optional
        View depth at which each ray ends, world units, top row first; inf where nothing is opaque.
    clipping_planes : array_like of float, shape (k, 6), optional
        Origin and normal of each plane, world coordinates; the normal's side is kept.
    cropping : Cropping or what makes one, optional
        Which regions of the model frame are drawn: see :meth:`pyvista_vdi.Cropping.from_any`.
    opacity_multiplier : float
        Factor of every supersegment's extinction, 0 or above.
    skip_empty : bool
        Pass by what the occupancy grid says is empty, where the VDI has enough of it to gain by
        that. The picture is the same to the last bit.
    preview_samples : int, optional
        Look the VDI up at so many points of each ray instead of intersecting its supersegments
        (paper section 5): an approximation. Fewer pixels are the better one
        (docs/decisions/previews.md).
    transmittance_cutoff : float
        A ray ends where less than this is left, 0 to below 1. It bounds what any channel of the
        image can lose.
    device : optional
        See :func:`pyvista_vdi.list_devices`.
    out : numpy.ndarray, optional
        Array for the image, float32 (height, width, 4), C-contiguous. A CPU device draws into it
        without a copy if it begins at a multiple of 4096 bytes
        (:func:`pyvista_vdi.device.aligned_empty`).

    Returns
    -------
    numpy.ndarray
        Premultiplied RGBA, float32 (height, width, 4), top row first; ``out`` if it was given.
    """
    if not isinstance(vdi, VDI):
        raise InvalidArgumentError(f"expected a VDI, got {type(vdi).__name__}")
    camera = Camera.from_any(camera)
    size = check_window_size(vdi.window_size if window_size is None else window_size)
    samples = None if preview_samples is None else check_preview_samples(preview_samples)
    cropping = Cropping.from_any(cropping)
    multiplier = checked_opacity_multiplier(opacity_multiplier)
    cutoff = check_transmittance_cutoff(transmittance_cutoff)
    runtime = get_runtime(device)
    prepared = prepared_vdi(runtime, vdi)
    shape = (size[1], size[0], 4)
    if out is not None and (out.shape != shape or out.dtype != np.float32):
        raise InvalidArgumentError(
            f"out must be float32 of the image's shape {shape}; got {out.dtype}, {out.shape}"
        )
    with (
        runtime.result(shape, name="image") if out is None else runtime.target(out, "image")
    ) as image:
        prepared.render(
            camera,
            size,
            image,
            opaque_depth,
            clipping_planes,
            cropping=cropping,
            opacity_multiplier=multiplier,
            skip_empty=skip_empty,
            preview_samples=samples,
            transmittance_cutoff=cutoff,
        )
        return runtime.download(image, out)


def render_first_hits(
    vdi: VDI,
    camera: Camera,
    window_size: Sequence[int] | None = None,
    *,
    opacity_threshold: float = DEFAULT_OPACITY,
    accumulated: bool = True,
    opaque_depth: ArrayLike | None = None,
    clipping_planes: ArrayLike | None = None,
    cropping: Any = None,
    opacity_multiplier: float = 1.0,
    skip_empty: bool = True,
    device: Any = None,
) -> NDArray[np.float32]:
    """Return the view depth at which each pixel's ray first hits something that can be seen.

    Parameters
    ----------
    vdi, camera, window_size, opaque_depth, clipping_planes, cropping, opacity_multiplier
        As for :func:`render_vdi`.
    skip_empty, device
        As for :func:`render_vdi`.
    opacity_threshold, accumulated
        What counts as a hit: see :func:`pyvista_vdi.pick`.

    Returns
    -------
    numpy.ndarray
        float32 (height, width), world units, top row first; infinite where nothing is hit.
    """
    if not isinstance(vdi, VDI):
        raise InvalidArgumentError(f"expected a VDI, got {type(vdi).__name__}")
    camera = Camera.from_any(camera)
    size = check_window_size(vdi.window_size if window_size is None else window_size)
    wanted = FirstHit.of(opacity_threshold, accumulated)
    cropping = Cropping.from_any(cropping)
    multiplier = checked_opacity_multiplier(opacity_multiplier)
    runtime = get_runtime(device)
    prepared = prepared_vdi(runtime, vdi)
    with runtime.buffer((size[1], size[0]), name="depth of first hits") as image:
        prepared.render(
            camera,
            size,
            image,
            opaque_depth,
            clipping_planes,
            cropping=cropping,
            opacity_multiplier=multiplier,
            skip_empty=skip_empty,
            first_hit=wanted,
        )
        t = runtime.download(image)
    return (t + rays.reference_depth(camera, vdi.bounds)).astype(np.float32)


def check_preview_samples(samples: int) -> int:
    """Return a number of samples per ray as an int between 1 and :data:`MAX_PREVIEW_SAMPLES`."""
    try:
        number = int(samples)
    except (TypeError, ValueError, OverflowError):
        number = 0
    if number != samples or not 1 <= number <= MAX_PREVIEW_SAMPLES:
        raise InvalidArgumentError(
            f"preview_samples must be a whole number from 1 to {MAX_PREVIEW_SAMPLES}; "
            f"got {samples!r}"
        )
    return number


def check_transmittance_cutoff(cutoff: float) -> float:
    """Return a transmittance at which rays end, as a float from 0 to below 1."""
    try:
        number = float(cutoff)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not 0 <= number < 1:
        raise InvalidArgumentError(
            "transmittance_cutoff must be a number from 0 to below 1, such as 0.004 for a "
            f"difference of 1/255 at most; got {cutoff!r}"
        )
    return number


class _Preparation:
    """The place of a prepared VDI: whoever comes first makes it, others wait for that one only."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.prepared: PreparedVDI | None = None


def prepared_vdi(runtime: Runtime, vdi: VDI) -> PreparedVDI:
    """Return the VDI on the device, made once and kept as long as the VDI lives."""
    with _lock:
        place = _prepared.setdefault(vdi, {}).setdefault(runtime, _Preparation())
    with runtime.holding(place.lock):
        if place.prepared is None:
            place.prepared = PreparedVDI(runtime, vdi)
        return place.prepared


class ListView(NamedTuple):
    """The rays of a frame in a VDI's list space.

    Attributes
    ----------
    size : (int, int)
        Width and height of the image in pixels.
    forms : numpy.ndarray
        List coordinates, model direction and the planes to clip to, float32 (n, 6).
    planes : int
        How many of the forms are planes; the first six are the bounds.
    ends : numpy.ndarray
        t at which each ray ends, float32 (H, W), top row first, if ``has_ends``.
    has_ends : bool
        Whether something opaque may end rays.
    reference_depth : float
        View depth of t = 0, world units.
    defines, arguments
        ``-D`` names and arguments of the kernel, for what is cropped.
    """

    size: tuple[int, int]
    forms: NDArray[np.float32]
    planes: int
    ends: NDArray[np.float32]
    has_ends: bool
    reference_depth: float
    defines: dict[str, str | int | None]
    arguments: tuple[Any, ...]


class SegmentsKernel(NamedTuple):
    """A kernel that writes segments, and how many rays each work-item follows."""

    kernel: Kernel
    rays: int


class _Launch(NamedTuple):
    """A kernel, its work-items and those of a group, and its arguments after the walk's."""

    kernel: Kernel
    items: int
    group: int
    mode: tuple[Any, ...]


class PreparedVDI:
    """A VDI on a device, in the form that the raycaster reads.

    Parameters
    ----------
    runtime : Runtime
        The device.
    vdi : VDI
        Not kept: the buffers are enough.

    Attributes
    ----------
    occupancy : OccupancyGrid
        Where there is nothing to see.
    media : int
        About how many supersegments a ray may meet.
    """

    def __init__(self, runtime: Runtime, vdi: VDI) -> None:
        self._runtime = runtime
        self._window = vdi.window_size
        self._bounds = vdi.bounds
        self._depth_origin = vdi.depth_origin
        camera = vdi.camera
        self._camera = camera
        self._parallel = camera.parallel_projection
        near, far = rays.depth_range(camera, vdi.bounds)
        rays.check_list_space(camera, vdi.bounds)
        self._nearest = rays.nearest_depth(camera, vdi.bounds)
        self._lit = share_lit(vdi, near, far)
        # An origin much closer than the data costs the coordinate the digits that it is to save
        closest = min(near, self._depth_origin)
        self._shifted = not self._parallel and 0 < far <= _LONG_LENS * closest
        # A ray that steps from list to list meets about as many as it crosses borders
        self.media = sum(vdi.window_size) + int(vdi.counts.max(initial=0))
        self._far = self._far_entries(vdi, (near, far))
        self._list_rows = self._list_space(camera)
        self._packed = {Packed16: 16, Packed8: 8}.get(type(vdi.packing), 0)
        self._upload(vdi)

    def _far_entries(self, vdi: VDI, depths: tuple[float, float]) -> int:
        """Return ``FAR_ENTRIES``: not 0 if lists are thin for where they lie in the bounds' depths.

        2 if they lie nearer to the least of these depths than to the largest.
        """
        offsets, occupied = vdi.offsets.view(np.int64), np.flatnonzero(vdi.counts)
        first, last = offsets[occupied], offsets[occupied + 1] - 1
        near, far = (depth - self._depth_origin for depth in depths)
        front, back = (
            np.clip(face.astype(np.float64), near, far)
            for face in (vdi.front[first], vdi.back[last])
        )
        rounded = np.maximum(np.abs(front), np.abs(back))
        if not (self._parallel or self._shifted):
            rounded = back + self._depth_origin
        thickness = (back - front).max(initial=0.0)
        if not lists_are_far(rounded.max(initial=0.0), thickness, far - near):
            return 0
        return 2 if back.max() - near < far - front.min() else 1

    @property
    def list_bytes(self) -> int:
        """Bytes of the lists on the device: headers and supersegments."""
        return sum(buffer.nbytes for buffer in (self._headers, *self._lists))

    @property
    def defines(self) -> dict[str, str | int | None]:
        """``-D`` names that fix the kernels' shape for this VDI."""
        defines: dict[str, str | int | None] = {"OFFSET_T": "long" if self._long_offsets else "int"}
        if self._parallel:
            defines["PARALLEL"] = 1
        if self._shifted:
            defines["SHIFTED"] = 1
        if self._packed:
            defines["PACKED"] = self._packed
        if self._far:
            defines["FAR_ENTRIES"] = self._far
        return defines

    def render(
        self,
        camera: Camera,
        size: tuple[int, int],
        image: DeviceBuffer,
        opaque_depth: ArrayLike | None = None,
        clipping_planes: ArrayLike | None = None,
        *,
        cropping: Cropping | None = None,
        opacity_multiplier: float = 1.0,
        skip_empty: bool = True,
        preview_samples: int | None = None,
        first_hit: FirstHit | None = None,
        transmittance_cutoff: float = TRANSMITTANCE_CUTOFF,
    ) -> None:
        """Draw a frame into ``image``, float32 (H, W, 4) on the device.

        With ``first_hit``, t of each ray's first hit in its place, float32 (H, W).
        """
        view = self.view(camera, size, opaque_depth, clipping_planes, cropping, opacity_multiplier)
        runtime = self._runtime
        if preview_samples is not None:
            launch = self._preview(view, preview_samples)
        else:
            launch = self._raycast(camera, view, image, first_hit=first_hit, skip_empty=skip_empty)
        with (
            runtime.upload(view.forms, "rays") as form_buffer,
            runtime.upload(view.ends, "opaque depth") as depth,
        ):
            runtime.launch(
                launch.kernel,
                launch.items,
                launch.group,
                *self.walk_arguments(view, form_buffer, depth, transmittance_cutoff),
                *launch.mode,
                image,
            )
            runtime.finish()  # the buffers above may be host memory in use

    def render_part(
        self,
        camera: Camera,
        view: ListView,
        forms: DeviceBuffer,
        ends: DeviceBuffer,
        image: DeviceBuffer,
        part: Rectangle,
        *,
        skip_empty: bool,
    ) -> None:
        """Enqueue the drawing of a part of the window into ``image``, which keeps the rest or not.

        ``forms`` and ``ends`` are on the device, and every ray ends at the latter.
        """
        launch = self._raycast(
            camera, view, image, first_hit=None, skip_empty=skip_empty, part=part
        )
        arguments = self.walk_arguments(
            view._replace(has_ends=True), forms, ends, TRANSMITTANCE_CUTOFF
        )
        self._runtime.launch(
            launch.kernel, launch.items, launch.group, *arguments, *launch.mode, image
        )

    def segments_kernel(self, view: ListView, *, skip_empty: bool, in_rows: bool) -> SegmentsKernel:
        """Return what writes the segments that rays cross; see ``raycasting/segments.cl``."""
        defines = {**self.defines, **view.defines, "SEGMENTS": 2 if in_rows else 1}
        if skip_empty and self.occupancy.worthwhile:
            defines["SKIP_EMPTY"] = 1
        if in_rows and self._in_blocks(defines):
            kernel = self._runtime.kernel("raycasting/blocks.cl", "raycast_blocks", defines)
            return SegmentsKernel(kernel, LANES)
        return SegmentsKernel(self._runtime.kernel("raycasting/raycast.cl", "raycast", defines), 1)

    def _preview(self, view: ListView, samples: int) -> _Launch:
        """Return how a frame of so many samples a ray is drawn."""
        defines = {**self.defines, **view.defines, **compensation(samples)}
        kernel = self._runtime.kernel("raycasting/preview.cl", "preview", defines)
        mode = (self.occupancy.counts, np.int32(samples))
        return _Launch(kernel, block_items(*view.size), GROUP, mode)

    def _raycast(
        self,
        camera: Camera,
        view: ListView,
        image: DeviceBuffer,
        *,
        first_hit: FirstHit | None,
        skip_empty: bool,
        part: Rectangle | None = None,
    ) -> _Launch:
        """Return how a frame is raycast, or what of it is in a part of the window.

        Without ``part``, ``image`` is cleared where no ray is cast for a pixel.
        """
        defines = {**self.defines, **view.defines}
        hit: tuple[Any, ...] = ()
        if first_hit is None:
            defines.update(compensation(self.media))
        else:
            defines["FIRST_HIT"] = 1
            hit = (np.float32(first_hit.optical_depth), np.int32(first_hit.accumulated))
        own_lists = self._own_lists(camera, view, defines)
        if own_lists is not None:
            kernel = self._runtime.kernel(
                "raycasting/aligned_view.cl", "raycast_own_lists", defines
            )
            return _Launch(kernel, own_lists.items, LANES, (own_lists.origin,))
        if part is None:
            part = self._part_to_draw(camera, view.size, skip_empty)
            if part.pixels < view.size[0] * view.size[1]:
                self._clear(image, first_hit is not None)
        if skip_empty and self.occupancy.worthwhile:
            defines["SKIP_EMPTY"] = 1
        in_blocks = _AT_MOST_IN_BLOCKS & defines.keys() and self._in_blocks(defines)
        if not in_blocks and np.array_equal(self._list_space(camera), self._list_rows):
            defines["ONE_LIST"] = 1
        packets = self._packets(camera, view, part, defines)
        if packets is not None:
            defines.update(packets.defines)
            kernel = self._runtime.kernel("raycasting/packets.cl", "raycast_packets", defines)
            return _Launch(kernel, packets.items, LANES, (packets.epipole, packets.part))
        columns = part_columns(part)
        items = COLUMN_ITEMS * int(columns[2]) * int(columns[3])
        if self._in_blocks(defines):
            kernel = self._runtime.kernel("raycasting/blocks.cl", "raycast_blocks", defines)
            return _Launch(kernel, items // LANES, COLUMN_ITEMS // LANES, (columns,))
        kernel = self._runtime.kernel("raycasting/raycast.cl", "raycast", defines)
        return _Launch(kernel, items, COLUMN_ITEMS, (columns, *hit))

    def _in_vectors(self, defines: dict[str, str | int | None]) -> bool:
        """Return whether there are kernels for a frame that follow rays in vectors."""
        return (
            self._runtime.is_cpu
            and not _RAY_BY_RAY & defines.keys()
            and defines.get("COMPENSATED") != 2
        )

    def _in_blocks(self, defines: dict[str, str | int | None]) -> bool:
        """Return whether rays that are not in packets are followed in blocks."""
        return self._in_vectors(defines) and not self._packed and not self._long_offsets

    def _own_lists(
        self, camera: Camera, view: ListView, defines: dict[str, str | int | None]
    ) -> OwnLists | None:
        """Return how each pixel is drawn from a list of its own; None if it cannot be."""
        if _AT_MOST_IN_BLOCKS & defines.keys() or not self._in_vectors(defines):
            return None
        near, far = rays.depth_range(camera, self._bounds)
        if not camera.parallel_projection:
            near = max(near, rays.nearest_depth(camera, self._bounds))
        return own_lists_of(
            view.size,
            self._window,
            view.forms[:COORDINATE_FORMS].astype(np.float64),
            (near - view.reference_depth, far - view.reference_depth),
            parallel=self._parallel,
            in_tiles=self._packed != 8,
        )

    def _packets(
        self,
        camera: Camera,
        view: ListView,
        part: Rectangle,
        defines: dict[str, str | int | None],
    ) -> Packets | None:
        """Return how a frame's rays are dealt to packets; None if the kernel is to follow each."""
        if _AT_MOST_IN_BLOCKS & defines.keys() or not self._in_vectors(defines):
            return None
        forms = view.forms.astype(np.float64)
        planes = forms[PLANE_FORMS : PLANE_FORMS + view.planes]
        epipole = epipole_of(self._camera, camera, view.size)
        coordinates = forms[:COORDINATE_FORMS]
        return packets_of(
            view.size,
            part,
            coordinates,
            planes,
            epipole,
            self._lit,
            or_blocks=self._in_blocks(defines),
        )

    def _clear(self, image: DeviceBuffer, of_hits: bool) -> None:
        """Write into all pixels that nothing is met."""
        pixels = image.shape[0] * image.shape[1]
        padded = -(-pixels // _CLEARING_GROUP) * _CLEARING_GROUP
        kernel = self._runtime.kernel(
            "raycasting/clear.cl", "clear_image", {"FIRST_HIT": 1} if of_hits else {}
        )
        self._runtime.launch(kernel, padded, _CLEARING_GROUP, np.uint64(pixels), image)

    def _part_to_draw(self, camera: Camera, size: tuple[int, int], skip_empty: bool) -> Rectangle:
        """Return the part of a window in which rays are cast: nothing is met beside it."""
        width, height = size
        whole = Rectangle(0, width, 0, height)
        if not skip_empty:
            return whole
        part = rays.pixels_of_points(camera, size, self.occupancy.corners)
        return whole if part.pixels > _MOST_DRAWN * whole.pixels else part

    def view(
        self,
        camera: Camera,
        size: tuple[int, int],
        opaque_depth: ArrayLike | None,
        clipping_planes: ArrayLike | None,
        cropping: Cropping | None = None,
        opacity_multiplier: float = 1.0,
    ) -> ListView:
        """Return a frame's rays as the kernels take them."""
        pixel_rays = rays.pixel_rays(camera, size, self._bounds)
        coordinates = [pixel_rays.form(row[:3], row[3]) for row in self._list_rows]
        # Lengths are all that this is for, and a length times m absorbs as m times the extinction
        direction = rays.direction_forms(pixel_rays, size, opacity_multiplier)
        planes = rays.box_planes(pixel_rays, self._bounds)
        planes += self._viewport_planes(coordinates)
        planes += rays.eye_plane(camera, pixel_rays)
        planes += rays.user_planes(camera, pixel_rays, clipping_planes)
        cropped = rays.cropped(pixel_rays, cropping, self._bounds)
        planes += cropped.planes
        pack = rays.packed_pairs if self._far else rays.packed
        forms = pack([*coordinates, *direction, *planes, *cropped.forms])
        ends = rays.checked_opaque_depth(opaque_depth, size, pixel_rays)
        return ListView(
            size,
            forms,
            len(planes),
            np.zeros(1, np.float32) if ends is None else ends,
            ends is not None,
            pixel_rays.reference_depth,
            cropped.defines,
            cropped.arguments,
        )

    def walk_arguments(
        self, view: ListView, forms: DeviceBuffer, ends: DeviceBuffer, cutoff: float
    ) -> tuple[Any, ...]:
        """Return the arguments that every kernel which walks through the lists begins with.

        ``forms`` and ``ends`` are the view's arrays on the device; ``cutoff`` says where a ray
        ends for want of light.
        """
        return (
            self._headers,
            *self._lists,
            np.int32(self._window[0]),
            np.int32(self._window[1]),
            np.float32(self._depth_origin),
            forms,
            np.int32(view.planes),
            np.int32(view.size[0]),
            np.int32(view.size[1]),
            ends,
            np.int32(view.has_ends),
            np.float32(cutoff),
            self.occupancy.masks,
            np.float32(self.occupancy.first_depth),
            np.float32(self.occupancy.slabs_per_depth),
            *view.arguments,
        )

    def _list_space(self, camera: Camera) -> NDArray[np.float64]:
        """Model frame to homogeneous list coordinates, float64 (4, 4).

        Rows give u and v in pixels from the window's centre, the depth coordinate, and the
        denominator that all three are divided by (1 in parallel projection).
        """
        viewport = camera.viewport_matrix(self._window) @ camera.model_to_view
        half = np.asarray(self._window, dtype=np.float64) / 2
        u, v, depth, denominator = viewport
        if self._parallel or self._shifted or self._far:
            coordinate = depth.copy()
            coordinate[3] -= self._depth_origin
        else:
            coordinate = np.array([0.0, 0.0, 0.0, -1.0])  # -1 / Z
        return np.stack([half[0] * u, half[1] * v, coordinate, denominator])

    def _viewport_planes(self, coordinates: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
        """Forms that keep what is in V_O's viewport and in front of its eye."""
        u, v, _, denominator = coordinates
        wide, high = self._window[0] / 2, self._window[1] / 2
        sides = [u, -u, v, -v]
        forms = [s + e * denominator for s, e in zip(sides, (wide, wide, high, high), strict=True)]
        if not self._parallel:
            front = denominator.copy()
            front[0] -= self._nearest
            forms.append(front)
        return forms

    def _upload(self, vdi: VDI) -> None:
        """Bring the lists to the device, exact or packed, and build the occupancy grid."""
        runtime = self._runtime
        if self._packed == 8:
            lengths = vdi.counts + _LIST_HEADER * (vdi.counts > 0)
        else:
            lengths = _longest(vdi.counts) * _LIST_TILE**2
        begins = np.zeros(lengths.size + 1, np.int64)
        np.cumsum(lengths, out=begins[1:])
        # Kernels count words of 8 bytes, of which an entry takes up to two, by signed numbers
        self._long_offsets = 2 * int(begins[-1]) >= 2**31
        offset_type = np.int64 if self._long_offsets else np.int32
        if self._packed == 8:
            headers: NDArray[Any] = begins.astype(offset_type)
        else:
            longest = lengths.reshape(-1) // _LIST_TILE**2
            headers = (begins[:-1] | longest << _FIRST_BITS).view(np.uint64)
        with (
            kept_together() as keep,
            runtime.upload(vdi.front, "front depths") as front,
            runtime.upload(vdi.back, "back depths") as back,
            runtime.upload(vdi.offsets.astype(offset_type), "list offsets") as starts,
        ):
            self.occupancy = OccupancyGrid(
                runtime,
                vdi,
                starts,
                front,
                back,
                nearest=self._nearest,
                shifted=self._shifted,
                long_offsets=self._long_offsets,
            )
            keep(self.occupancy.counts), keep(self.occupancy.masks)
            self._headers = keep(runtime.upload(headers, "list headers"))
            if isinstance(vdi.packing, Packed8):
                self._lists = self._packed_lists(vdi, vdi.packing, keep)
            else:
                self._lists = self._prepared_lists(vdi, int(begins[-1]), starts, front, back, keep)
            runtime.finish()  # the buffers above may be host memory in use

    def _prepared_lists(
        self,
        vdi: VDI,
        entries: int,
        starts: DeviceBuffer,
        front: DeviceBuffer,
        back: DeviceBuffer,
        keep: _Keep,
    ) -> tuple[DeviceBuffer, ...]:
        """Return the supersegments with depth coordinates and extinctions, 24 or 16 bytes each.

        They lie by tiles of lists, in so many ``entries``; ``starts`` are the lists' in the VDI's
        arrays.
        """
        runtime = self._runtime
        wide, high = vdi.window_size
        packed = isinstance(vdi.packing, Packed16)
        colors = vdi.packing.color if isinstance(vdi.packing, Packed16) else vdi.color
        lists: tuple[DeviceBuffer, ...]
        # On a CPU device memory of our own, which systems give in large pages: a driver's comes in
        # pages of 4 KiB, each of which the kernel is interrupted for where it first writes
        if packed:
            lists = (keep(runtime.result((entries, 4), np.uint32, "supersegments", lasting=True)),)
        else:
            lists = (
                keep(runtime.result((entries, 2), name="supersegment faces", lasting=True)),
                keep(runtime.result((entries, 4), name="supersegment media", lasting=True)),
            )
        # Direction of a centre ray per unit of view depth, in the model frame
        centre = rays.pixel_rays(vdi.camera, vdi.window_size, vdi.bounds).direction
        with (
            runtime.upload(colors, "supersegment colours") as color,
            runtime.upload(vdi.optical_depth, "optical depths") as optical_depth,
            runtime.upload(centre.astype(np.float32), "centre rays") as directions,
        ):
            runtime.launch(
                runtime.kernel("raycasting/prepare.cl", "prepare_lists", self.defines),
                -(-wide * high // GROUP) * GROUP,
                GROUP,
                starts,
                self._headers,
                front,
                back,
                color,
                optical_depth,
                np.float32(self._depth_origin),
                np.float32(self._nearest),
                np.int32(wide),
                np.int32(high),
                directions,
                *lists,
            )
            runtime.finish()  # the buffers above may be host memory in use
        return (*lists, keep(self._constants(1.0))) if packed else lists

    def _packed_lists(
        self,
        vdi: VDI,
        packing: Packed8,
        keep: _Keep,
    ) -> tuple[DeviceBuffer, ...]:
        """Return lists of 8-byte supersegments that begin with their scales."""
        runtime = self._runtime
        counts = vdi.counts.reshape(-1)
        occupied = np.flatnonzero(counts)
        headers = np.zeros(len(counts) + 1, np.uint64)
        headers[1:] = np.cumsum(counts > 0) * _LIST_HEADER
        first = (vdi.offsets + headers)[:-1][occupied].astype(np.int64)
        words = aligned_empty((vdi.n_supersegments + len(occupied) * _LIST_HEADER, 2), np.uint32)
        words[first, 0] = packing.origins[occupied].view(np.uint32)
        words[first, 1] = packing.strides[occupied]
        words[first + 1, 0] = self._per_code(vdi, packing, occupied).view(np.uint32)
        words[first + 1, 1] = 0
        behind = np.ones(len(words), bool)
        behind[first] = behind[first + 1] = False
        words[behind] = packing.words
        return (keep(runtime.upload(words, "supersegments")), keep(self._constants(packing.step)))

    def _per_code(
        self, vdi: VDI, packing: Packed8, lists: NDArray[np.int64]
    ) -> NDArray[np.float32]:
        """Return 1 over the model length of a code of depth along each list's centre ray."""
        wide, high = vdi.window_size
        centre = rays.pixel_rays(vdi.camera, vdi.window_size, vdi.bounds).direction
        a, b = lists % wide + 0.5 - wide / 2, lists // wide + 0.5 - high / 2
        direction = centre[0] + a[:, np.newaxis] * centre[1] + b[:, np.newaxis] * centre[2]
        lengths = np.linalg.norm(direction, axis=1) * packing.strides[lists] * packing.step
        return (1 / lengths).astype(np.float32)

    def _constants(self, step: float) -> DeviceBuffer:
        constants = np.array([step, self._nearest - self._depth_origin], np.float32)
        return self._runtime.upload(constants, "constants of depths")


def _longest(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the length of the longest list of each tile; ``counts`` are (height, width)."""
    height, width = counts.shape
    longest = np.pad(counts, ((0, -height % _LIST_TILE), (0, -width % _LIST_TILE)))
    longest = functools.reduce(np.maximum, (longest[n::_LIST_TILE] for n in range(_LIST_TILE)))
    return functools.reduce(np.maximum, (longest[:, n::_LIST_TILE] for n in range(_LIST_TILE)))
