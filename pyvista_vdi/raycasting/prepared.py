"""A VDI on a device, in the form that the raycaster reads: uploaded once, kept while it lives."""

import contextlib
import copy
import functools
import threading
import weakref
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import DeviceBuffer, Runtime, kept_together, padded
from pyvista_vdi.device.constants import BUNDLE, FIRST_BITS, GROUP, LIST_HEADER, SLABS, STACK
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.classify_values import CELLS, ValuesLook
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.float32_limits import lists_are_far
from pyvista_vdi.model.packing import Packed8
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.raycasting.classified_values import integrals, release_values, values_on_device
from pyvista_vdi.raycasting.kernels import (
    COUNT_PACKED,
    COUNT_SUPERSEGMENTS,
    COUNTED,
    OCCUPIED_SLABS,
    PREPARE_LISTS,
    PREPARE_PACKED,
    PREPARE_VALUES,
)
from pyvista_vdi.raycasting.packets import share_lit
from pyvista_vdi.volume.upload import release_voxels

#: Squares of stacks along the grid's longer edge: `OccupancyGrid.corners` has a box for each.
_SQUARES = 12

#: By how much supersegments count beyond their faces: roundings of 2**-23 of the depths that the
#: raycaster looks up. At most 17 add up (docs/conventions.md, "Occupancy grid").
_ROUNDINGS = 32

#: Share of the cells within the volume's bounds above which skipping costs more than it saves.
#: Measured: on a CPU it gains below .6 and loses above 1 (docs/decisions/empty_space.md), on a GPU
#: it gains at .30 and loses from .39 on (docs/decisions/gpu.md).
_WORTHWHILE, _WORTHWHILE_ON_GPU = 0.8, 1 / 3


class OccupancyGrid:
    """How many supersegments reach into each cell: stacks of 64 slabs over 16 x 16 lists.

    A supersegment that spans several slabs counts in each. The slabs are equal in view depth and
    span the depth range of the VDI's bounds. Built on the device, from the VDI's arrays alone, so
    that a file need not carry it.

    ``count`` enqueues the kernel that counts, which takes the grid and its counts as ``grid`` and
    ``changes``. Offsets take 64 bits if ``long_offsets``. ``nearest`` is the least view depth in
    front of V_O's eye, and ``shifted`` says whether the depth coordinate is that of a long lens.
    """

    #: uint32 (stacks high, stacks wide, slabs); uint64 per stack: bit s is set where slab s is
    #: occupied.
    counts: DeviceBuffer
    masks: DeviceBuffer

    def __init__(
        self,
        runtime: Runtime,
        vdi: VDI,
        count: Callable[..., None],
        *,
        nearest: float,
        shifted: bool,
        long_offsets: bool,
    ) -> None:
        self._on_cpu = runtime.is_cpu
        width, height = vdi.window_size
        wide, high = self.stacks = (-(-width // STACK), -(-height // STACK))
        near, far = rays.depth_range(vdi.camera, vdi.bounds)
        if not vdi.camera.parallel_projection:
            near = max(near, nearest)
        #: Where slab 0 begins, view depth less the VDI's depth origin; slabs per world unit.
        self.first_depth = near - vdi.depth_origin
        # Bounds without depth, or behind the eye: everything is in slab 0
        self.slabs_per_depth = SLABS / (far - near) if far > near else 1.0
        #: By which supersegments count beyond their faces, world units: more than the raycaster's
        #: depths are rounded by.
        self.margin = _ROUNDINGS * 2.0**-23 * _looked_up(vdi, near, far, shifted)
        with kept_together() as keep:
            self.counts = keep(runtime.buffer((high, wide, SLABS), np.uint32, "occupancy counts"))
            self.masks = keep(runtime.buffer((high, wide), np.uint64, "occupancy masks"))
            # Count, and sum up by stacks
            occupied = runtime.bind(
                OCCUPIED_SLABS,
                {"OFFSET_T": "long" if long_offsets else "int"},
                counts=self.counts,
                stacks=wide * high,
                masks=self.masks,
            )
            grid = COUNTED(
                width=width,
                height=height,
                stacks_wide=wide,
                first_depth=self.first_depth,
                slabs_per_depth=self.slabs_per_depth,
                margin=self.margin,
            )
            runtime.fill(self.counts, np.uint32(0))
            count(grid=grid, changes=self.counts)
            occupied(padded(wide * high, GROUP), GROUP)
            masks = runtime.download(self.masks)
        #: Model points, (n, 3), whose convex hull holds all occupied cells that rays meet, and a
        #: list and a slab around them.
        self.corners = _corners(vdi, masks, near, far)
        cells = _share_in_bounds(vdi, near, far) * masks.size * SLABS
        #: Occupied cells over cells within the volume's bounds; above 1 if borders are crossed.
        self.occupied = float(np.unpackbits(masks.view(np.uint8)).sum() / max(cells, 1.0))

    @property
    def worthwhile(self) -> bool:
        """Whether enough is empty for skipping to gain time."""
        return self.occupied < (_WORTHWHILE if self._on_cpu else _WORTHWHILE_ON_GPU)


def _corners(vdi: VDI, masks: NDArray[np.uint64], near: float, far: float) -> NDArray[np.float64]:
    """Return corners of boxes in list space that hold the occupied cells, in the model frame.

    A box for each square of stacks. ``near`` and ``far`` are the view depths that slabs divide;
    what counts in the first or the last of them lies within the bounds, too, where a ray meets it.
    """
    half = np.asarray(vdi.window_size) / 2
    pixel_rays = rays.pixel_rays(vdi.camera, vdi.window_size, vdi.bounds)
    slab = (far - near) / SLABS
    least = -np.inf if vdi.camera.parallel_projection else 0.0
    high, wide = masks.shape
    edge = -(-max(high, wide) // _SQUARES)
    points = [np.empty((0, 3))]
    for row in range(0, high, edge):
        for column in range(0, wide, edge):
            part = masks[row : row + edge, column : column + edge]
            j, i = np.nonzero(part)
            if not i.size:
                continue
            bits = np.unpackbits(part.reshape(-1, 1).view(np.uint8), axis=1, bitorder="little")
            slabs = np.flatnonzero(bits.any(axis=0))
            a = (column + np.array([i.min(), i.max() + 1])) * STACK + [-1, 1] - half[0]
            b = (row + np.array([j.min(), j.max() + 1])) * STACK + [-1, 1] - half[1]
            depth = np.maximum(near + slab * (slabs[[0, -1]] + [-1, 2]), least)
            at = np.stack(np.meshgrid(1.0, a, b, depth, indexing="ij"), axis=-1).reshape(-1, 4)
            t = at[:, 3:] - pixel_rays.reference_depth
            points.append(at[:, :3] @ pixel_rays.origin + t * (at[:, :3] @ pixel_rays.direction))
    return np.concatenate(points)


def _looked_up(vdi: VDI, near: float, far: float, shifted: bool) -> float:
    """Return the size of what the raycaster rounds where it looks up a depth, world units.

    That is the offset from the VDI's depth origin and, in perspective, the depth coordinate times
    the change of view depth Z with it: Z**2 for -1 / Z, Z**2 / depth_origin for the long lens's
    (``opencl/lib/list_space.cl``; docs/conventions.md, "Occupancy grid").
    """
    origin = vdi.depth_origin
    offset = max(abs(near - origin), abs(far - origin))
    if vdi.camera.parallel_projection:
        return offset
    if shifted:
        coordinate = max(abs(near - origin) / near, abs(far - origin) / far)
        return offset + coordinate * far**2 / origin
    return offset + max(far, 0.0)


def _share_in_bounds(vdi: VDI, near: float, far: float) -> float:
    """Return the share of all cells that lies within the bounds, by the stacks' centre rays."""
    width, height = vdi.window_size
    pixel_rays = rays.pixel_rays(vdi.camera, vdi.window_size, vdi.bounds)
    a, b = np.meshgrid(_stack_centres(width), _stack_centres(height))
    pixels = np.stack([np.ones_like(a), a, b], axis=-1)
    first = np.full(a.shape, near - pixel_rays.reference_depth)
    last = np.full(a.shape, far - pixel_rays.reference_depth)
    for form in rays.box_planes(pixel_rays, vdi.bounds):
        value, slope = pixels @ form[:3], pixels @ form[3:]
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = -value / slope
        first = np.where(slope > 0, np.maximum(first, crossing), first)
        last = np.where(slope < 0, np.minimum(last, crossing), last)
        last = np.where((slope == 0) & (value < 0), first, last)  # beside the bounds
    depth = far - near
    return float(np.maximum(last - first, 0).mean() / depth) if depth > 0 else 0.0


def _stack_centres(lists: int) -> NDArray[np.float64]:
    """Return the stacks' centres along an edge of that many lists, pixels from its middle."""
    starts = np.arange(0, lists, STACK)
    return (starts + np.minimum(starts + STACK, lists)) / 2 - lists / 2


#: Far depth over near depth up to which a lens counts as long, and depth is kept relative.
_LONG_LENS = 2.0

_prepared: "weakref.WeakKeyDictionary[VDI, dict[Runtime, _Preparation]]" = (
    weakref.WeakKeyDictionary()
)
_lock = threading.Lock()


class _Preparation:
    """The place of a prepared VDI: whoever comes first makes it, others wait for that one only."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.prepared: PreparedVDI | None = None


def prepared_vdi(runtime: Runtime, vdi: VDI) -> "PreparedVDI":
    """Return the VDI on the device, made once and kept as long as the VDI lives."""
    with _lock:
        places = _prepared.setdefault(vdi, {})
        place = places.get(runtime) or places.setdefault(runtime, _Preparation())
    with runtime.holding(place.lock):
        if place.prepared is None:
            values: Any = vdi.values
            if isinstance(values, ValuesLook) and values.lists.n_supersegments:
                place.prepared = kept_values(runtime, values.deferred).shown(values)
            else:
                place.prepared = PreparedVDI(runtime, vdi)
        return place.prepared


def release_from_devices(things: Iterable[VDI | DeferredVDI | Volume | None]) -> None:
    """Release VDIs, values and volumes from devices; they are uploaded when used again."""
    for thing in things:
        if isinstance(thing, Volume):
            release_voxels(thing)
        elif thing is not None:
            if isinstance(thing, DeferredVDI):
                release_values(thing)
            places: Any = _kept if isinstance(thing, DeferredVDI) else _prepared
            with _lock:
                gone = places.pop(thing, None)
            del gone  # without the lock


class PreparedVDI:
    """A VDI on a device, in the form that the raycaster reads; the VDI itself is not kept."""

    #: Where there is something to see, and where not.
    occupancy: OccupancyGrid
    #: Where lists begin, by their bundles or, of 8-byte supersegments, each; the supersegments,
    #: which are in one array if they are packed.
    headers: DeviceBuffer
    faces: DeviceBuffer
    media: DeviceBuffer
    #: World units of a step of depth of 8-byte supersegments.
    depth_step: float
    #: Whether offsets take 64 bits.
    long_offsets: bool

    def __init__(self, runtime: Runtime, vdi: VDI) -> None:
        self.runtime = runtime
        self.window = vdi.window_size
        self.bounds = vdi.bounds
        self.depth_origin = vdi.depth_origin
        self.camera = vdi.camera
        self.parallel = vdi.camera.parallel_projection
        near, far = depths = rays.depth_range(vdi.camera, vdi.bounds)
        rays.check_list_space(vdi.camera, vdi.bounds)
        #: Least view depth that is in front of V_O's eye, world units.
        self.nearest = rays.nearest_depth(vdi.camera, vdi.bounds)
        self.lit = share_lit(vdi, near, far)
        # An origin much closer than the data costs the coordinate the digits that it is to save
        closest = min(near, self.depth_origin)
        #: Whether the depth coordinate is that of a long lens.
        self.shifted = not self.parallel and 0 < far <= _LONG_LENS * closest
        #: About how many supersegments a ray may meet: it crosses a border from list to list.
        self.most_media = sum(vdi.window_size) + int(vdi.counts.max(initial=0))
        #: Whether float32 has too few digits for rays, whose forms are double-floats then: 1 where
        #: the lists lie at the far end of the bounds' depths, 2 at the near one.
        self.double_float = self._double_float(vdi, depths)
        self.list_rows = self.list_space(vdi.camera)
        #: Whether supersegments have 8 bytes.
        self.packed = vdi.packing is not None
        self.depth_step = 1.0
        self._upload(vdi)

    def _double_float(self, vdi: VDI, depths: tuple[float, float]) -> int:
        """Return ``double_float``: lists may be thin for where they lie in the bounds' depths."""
        offsets, occupied = vdi.offsets.view(np.int64), np.flatnonzero(vdi.counts)
        first, last = offsets[occupied], offsets[occupied + 1] - 1
        near, far = (depth - self.depth_origin for depth in depths)
        front, back = (
            np.clip(faces[rows].astype(np.float64), near, far)
            for faces, rows in ((vdi.front, first), (vdi.back, last))
        )
        rounded = np.maximum(np.abs(front), np.abs(back))
        if not (self.parallel or self.shifted):
            rounded = back + self.depth_origin
        thickness = (back - front).max(initial=0.0)
        if not lists_are_far(rounded.max(initial=0.0), thickness, far - near):
            return 0
        return 2 if back.max() - near < far - front.min() else 1

    @property
    def list_bytes(self) -> int:
        """Bytes of the lists on the device: headers and supersegments."""
        return sum(buffer.nbytes for buffer in {self.headers, self.faces, self.media})

    @property
    def switches(self) -> dict[str, int | str]:
        """``-D`` names of kernels that read the lists, and their values."""
        switches: dict[str, int | str] = {
            "OFFSET_T": "long" if self.long_offsets else "int",
            "DEPTH": "PARALLEL" if self.parallel else "SHIFTED" if self.shifted else "RECIPROCAL",
            "PACKED": int(self.packed),
        }
        if self.double_float:
            switches["DOUBLE_FLOAT_RAYS"] = self.double_float
        return switches

    def list_space(self, camera: Camera) -> NDArray[np.float64]:
        """Model frame to homogeneous list coordinates, float64 (4, 4).

        Rows give u and v in pixels from the window's centre, the depth coordinate, and the
        denominator that all three are divided by (1 in parallel projection).
        """
        viewport = camera.viewport_matrix(self.window) @ camera.model_to_view
        half = np.asarray(self.window, dtype=np.float64) / 2
        u, v, depth, denominator = viewport
        if self.parallel or self.shifted or self.double_float:
            coordinate = depth.copy()
            coordinate[3] -= self.depth_origin
        else:
            coordinate = np.array([0.0, 0.0, 0.0, -1.0])  # -1 / Z
        return np.stack([half[0] * u, half[1] * v, coordinate, denominator])

    def _headers(self, vdi: VDI) -> tuple[NDArray[Any], int]:
        """Return where lists begin, by their bundles or, of 8-byte supersegments, each; the end."""
        if self.packed:
            lengths = vdi.counts + LIST_HEADER * (vdi.counts > 0)
        else:
            lengths = _longest(vdi.counts) * BUNDLE**2
        begins = np.zeros(lengths.size + 1, np.int64)
        np.cumsum(lengths, out=begins[1:])
        entries = int(begins[-1])
        # Kernels count words of 8 bytes, of which an entry takes up to two, by signed numbers
        self.long_offsets = 2 * entries >= 2**31
        offset_type = np.int64 if self.long_offsets else np.int32
        if self.packed:
            headers: NDArray[Any] = begins.astype(offset_type)
        else:
            longest = lengths.reshape(-1) // BUNDLE**2
            headers = (begins[:-1] | longest << FIRST_BITS).view(np.uint64)
        return headers, entries

    def _upload(self, vdi: VDI) -> None:
        """Bring the lists to the device, exact or packed, and build the occupancy grid."""
        runtime, packing = self.runtime, vdi.packing
        headers, entries = self._headers(vdi)
        offset_type = np.int64 if self.long_offsets else np.int32
        with kept_together() as keep, contextlib.ExitStack() as stack:

            def upload(array: NDArray[Any], name: str) -> DeviceBuffer:
                return stack.enter_context(runtime.upload(array, name))

            def made(shape: tuple[int, ...], dtype: type[np.generic], name: str) -> DeviceBuffer:
                # On a CPU device memory of our own, which systems give in large pages: a driver's
                # comes in pages of 4 KiB, each of which the kernel is interrupted for where it
                # first writes
                return keep(runtime.result(shape, dtype, name, lasting=True))

            self.headers = keep(runtime.upload(headers, "list headers"))
            starts = upload(vdi.offsets.astype(offset_type), "list offsets")
            common = {
                "starts": starts,
                "headers": self.headers,
                "width": self.window[0],
                "height": self.window[1],
                "centre_ray": upload(_centre_ray(vdi), "centre rays"),
            }
            if isinstance(packing, Packed8):
                # Lists begin with their scales
                self.depth_step = packing.step
                self.faces = self.media = made((max(1, entries), 2), np.uint32, "supersegments")
                words = packing.words if len(packing.words) else np.zeros((1, 2), np.uint32)
                faces = {
                    "origins": upload(packing.origins, "origins of lists"),
                    "strides": upload(packing.strides, "strides of lists"),
                    "words": upload(words, "stored supersegments"),
                    "step": packing.step,
                }
                stored = {**faces, "stored": faces["words"], "words": self.faces}
                prepare = runtime.bind(PREPARE_PACKED, self.switches, **common, **stored)
            else:
                # Depth coordinates and extinctions by bundles of lists
                faces = {
                    "fronts": upload(vdi.front, "front depths"),
                    "backs": upload(vdi.back, "back depths"),
                }
                self.faces = made((entries, 2), np.float32, "supersegment faces")
                self.media = made((entries, 4), np.float32, "supersegment media")
                prepare = runtime.bind(
                    PREPARE_LISTS,
                    self.switches,
                    **common,
                    **faces,
                    colors=upload(vdi.color, "supersegment colours"),
                    optical_depths=upload(vdi.optical_depth, "optical depths"),
                    depth_origin=self.depth_origin,
                    nearest=self.nearest,
                    faces=self.faces,
                    media=self.media,
                )

            def count(**grid: Any) -> None:
                kernel = COUNT_PACKED if self.packed else COUNT_SUPERSEGMENTS
                lists = {"OFFSET_T": self.switches["OFFSET_T"]}
                counting = runtime.bind(kernel, lists, offsets=starts, **faces, **grid)
                counting(padded(self.window[0] * self.window[1], GROUP), GROUP)

            self.occupancy = self._occupancy(vdi, count)
            keep(self.occupancy.counts), keep(self.occupancy.masks)
            prepare(padded(self.window[0] * self.window[1], GROUP), GROUP)
            runtime.finish()  # the buffers above may be host memory in use

    def _occupancy(self, lists: VDI, count: Callable[..., None]) -> OccupancyGrid:
        """Return the occupancy grid that ``count`` counts in."""
        return OccupancyGrid(
            self.runtime,
            lists,
            count,
            nearest=self.nearest,
            shifted=self.shifted,
            long_offsets=self.long_offsets,
        )


class KeptValues(PreparedVDI):
    """A deferred VDI's lists on a device: what each of its looks is made of, in one pass."""

    def _upload(self, vdi: VDI) -> None:
        """Bring offsets and faces to the device, and where the lists of a look may lie."""
        runtime, self.packed = self.runtime, False
        headers, self._entries = self._headers(vdi)
        offsets = vdi.offsets.astype(np.int64 if self.long_offsets else np.int32)
        self._lists = vdi
        with kept_together() as keep:
            self._kept = {
                "starts": keep(runtime.upload(offsets, "list offsets")),
                "places": keep(runtime.upload(headers, "places of lists")),
                "fronts": keep(runtime.upload(vdi.front, "front depths")),
                "backs": keep(runtime.upload(vdi.back, "back depths")),
                "centre_ray": keep(runtime.upload(_centre_ray(vdi), "centre rays")),
            }
            runtime.finish()  # a thread with another queue may use them next

    def shown(self, values: ValuesLook) -> PreparedVDI:
        """Return what a transfer function shows: what is transparent is left out."""
        runtime, lists = self.runtime, self._lists
        look = copy.copy(self)
        near, far = rays.depth_range(self.camera, self.bounds)
        look.lit = share_lit(lists, near, far, values.optical_depths)
        with kept_together() as keep, contextlib.ExitStack() as stack:

            def made(shape: tuple[int, ...], dtype: type[np.generic], name: str) -> DeviceBuffer:
                return keep(runtime.result(shape, dtype, name, lasting=True))

            look.headers = made((self._kept["places"].shape[0],), np.uint64, "list headers")
            look.faces = made((self._entries, 2), np.float32, "supersegment faces")
            look.media = made((self._entries, 4), np.float32, "supersegment media")
            table = stack.enter_context(runtime.upload(integrals(values.of_cells), "integrals"))
            prepare = runtime.bind(
                PREPARE_VALUES,
                self.switches,
                **self._kept,
                **values_on_device(runtime, values.deferred),
                integrals=table,
                cells=CELLS,
                depth_origin=self.depth_origin,
                nearest=self.nearest,
                headers=look.headers,
                faces=look.faces,
                media=look.media,
            )

            def count(**grid: Any) -> None:
                prepare(padded(look.headers.shape[0], GROUP), GROUP, **grid)

            look.occupancy = self._occupancy(lists, count)
            keep(look.occupancy.counts), keep(look.occupancy.masks)
        return look


_kept: "weakref.WeakKeyDictionary[DeferredVDI, dict[Runtime, KeptValues]]" = (
    weakref.WeakKeyDictionary()
)


def kept_values(runtime: Runtime, deferred: DeferredVDI) -> KeptValues:
    """Return the lists of a deferred VDI on the device, made once and kept as long as it lives."""
    with runtime.holding(_lock):
        kept = _kept.setdefault(deferred, {})
        if runtime not in kept:
            kept[runtime] = KeptValues(runtime, deferred.lists)
        return kept[runtime]


def _centre_ray(vdi: VDI) -> NDArray[np.float32]:
    """Return the direction of a centre ray per unit of view depth, in the model frame."""
    return rays.pixel_rays(vdi.camera, vdi.window_size, vdi.bounds).direction.astype(np.float32)


def _longest(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the length of the longest list of each bundle; ``counts`` are (height, width)."""
    height, width = counts.shape
    longest = np.pad(counts, ((0, -height % BUNDLE), (0, -width % BUNDLE)))
    longest = functools.reduce(np.maximum, (longest[n::BUNDLE] for n in range(BUNDLE)))
    return functools.reduce(np.maximum, (longest[:, n::BUNDLE] for n in range(BUNDLE)))
