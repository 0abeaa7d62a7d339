"""A VDI on a device, in the form that the raycaster reads: made once, kept while it lives."""

import contextlib
import copy
import threading
import weakref
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import DeviceBuffer, Keep, Runtime, constants, kept_together, padded
from pyvista_vdi.device.constants import BUNDLE, GROUP, LIST_HEADER, LISTS_PER_ITEM, SLABS, STACK
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.float32_limits import lists_are_far
from pyvista_vdi.model.packing import Packed8
from pyvista_vdi.model.vdi import CELLS, VDI, DeferredVDI, made_vdi
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.raycasting.classified_values import ValuesLook
from pyvista_vdi.volume.upload import release_voxels

#: Squares of stacks along the grid's longer edge: `OccupancyGrid.corners` has a box for each.
_SQUARES = 12

#: By how much supersegments count beyond their faces: roundings of 2**-23 of the depths that the
#: raycaster looks up. At most 17 add up (docs/dev/conventions.md, "Occupancy grid").
_ROUNDINGS = 32

#: Share of the cells within the volume's bounds above which skipping costs more than it saves.
#: Measured: on a CPU it gains below .6 and loses above 1 (docs/decisions/empty_space.md), on a GPU
#: it gains at .30 and loses from .39 on (docs/decisions/gpu.md).
_WORTHWHILE, _WORTHWHILE_ON_GPU = 0.8, 1 / 3

#: Far depth over near depth up to which a lens counts as long, and depth is kept relative.
_LONG_LENS = 2.0

#: Lists of a VDI that are asked how far light gets in them; of values, which are classified for it.
_SAMPLED_LISTS, _SAMPLED_LISTS_OF_VALUES = 4096, 1024
#: Optical depth behind which nothing is left of light: -log(1e-6), where rays end by default.
_DARK = 13.8

#: A VDI's arrays, as kernels and as messages call them; kernels that count take the first three.
_ARRAYS = {
    "starts": "list offsets",
    "fronts": "front depths",
    "backs": "back depths",
    "colors": "supersegment colours",
    "optical_depths": "optical depths",
}
_COUNTED = ("starts", "fronts", "backs")
#: What media are made of: colours and optical depths, or a deferred VDI's values.
_NO_MEDIA = dict.fromkeys(("colors", "optical_depths", "means", "spreads", "steps", "integrals"))


class OccupancyGrid:
    """How many supersegments reach into each cell: stacks of 64 slabs over 16 x 16 lists.

    A supersegment that spans several slabs counts in each. The slabs are equal in view depth and
    span the depth range of the VDI's bounds. Built on the device, from the VDI's arrays alone, so
    that a file need not carry it.

    ``count`` enqueues the kernel that counts, which takes the grid and its counts as ``grid`` and
    ``changes``.
    """

    #: uint32 (stacks high, stacks wide, slabs); uint64 per stack: bit s is set where slab s is
    #: occupied.
    counts: DeviceBuffer
    masks: DeviceBuffer

    def __init__(self, prepared: "PreparedVDI", count: Callable[..., None], keep: Keep) -> None:
        runtime, origin = prepared.runtime, prepared.depth_origin
        width, height = prepared.window
        wide, high = self.stacks = (-(-width // STACK), -(-height // STACK))
        near, far = prepared.depths
        near = max(near, prepared.nearest)
        #: Where slab 0 begins, view depth less the VDI's depth origin; slabs per world unit.
        self.first_depth = near - origin
        # Bounds without depth, or behind the eye: everything is in slab 0
        self.slabs_per_depth = SLABS / (far - near) if far > near else 1.0
        # Find the size of what the raycaster rounds where it looks up a depth: its offset and, in
        # perspective, the depth coordinate times the change of view depth Z with it, Z**2 for
        # -1 / Z, Z**2 / depth_origin for a long lens (docs/dev/conventions.md, "Occupancy grid")
        looked_up = max(abs(near - origin), abs(far - origin))
        if prepared.shifted:
            coordinate = max(abs(near - origin) / near, abs(far - origin) / far)
            looked_up += coordinate * far**2 / origin
        elif not prepared.parallel:
            looked_up += max(far, 0.0)
        #: By which supersegments count beyond their faces, world units: more than the raycaster's
        #: depths are rounded by.
        self.margin = _ROUNDINGS * 2.0**-23 * looked_up
        self.counts = keep(runtime.buffer((high, wide, SLABS), np.uint32, "occupancy counts"))
        self.masks = keep(runtime.buffer((high, wide), np.uint64, "occupancy masks"))
        # Count, and sum up by stacks
        grid = {
            "width": width,
            "height": height,
            "stacks_wide": wide,
            "first_depth": self.first_depth,
            "slabs_per_depth": self.slabs_per_depth,
            "margin": self.margin,
        }
        runtime.fill(self.counts, np.uint32(0))
        count(grid=grid, changes=self.counts)
        occupied = runtime.bind(
            "raycasting/occupancy.cl",
            "occupied_slabs",
            counts=self.counts,
            stacks=wide * high,
            masks=self.masks,
        )
        occupied(padded(wide * high, GROUP), GROUP)
        masks = runtime.download(self.masks)
        pixel_rays = rays.pixel_rays(prepared.camera, prepared.window, prepared.bounds)
        #: Model points, (n, 3), whose convex hull holds all occupied cells that rays meet, and a
        #: list and a slab around them.
        self.corners = _corners(prepared, pixel_rays, masks, near, far)
        cells = _share_in_bounds(prepared, pixel_rays, near, far) * masks.size * SLABS
        #: Occupied cells over cells within the volume's bounds; above 1 if borders are crossed.
        self.occupied = float(np.unpackbits(masks.view(np.uint8)).sum() / max(cells, 1.0))
        self._fewest = _WORTHWHILE if runtime.is_cpu else _WORTHWHILE_ON_GPU

    @property
    def worthwhile(self) -> bool:
        """Whether enough is empty for skipping to gain time."""
        return self.occupied < self._fewest


def _corners(
    prepared: "PreparedVDI",
    pixel_rays: rays.PixelRays,
    masks: NDArray[np.uint64],
    near: float,
    far: float,
) -> NDArray[np.float64]:
    """Return corners of boxes in list space that hold the occupied cells, in the model frame.

    A box for each square of stacks. ``near`` and ``far`` are the view depths that slabs divide;
    what counts in the first or the last of them lies within the bounds, too, where a ray meets it.
    """
    half = np.asarray(prepared.window) / 2
    slab = (far - near) / SLABS
    least = -np.inf if prepared.parallel else 0.0
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


def _share_in_bounds(
    prepared: "PreparedVDI", pixel_rays: rays.PixelRays, near: float, far: float
) -> float:
    """Return the share of all cells that lies within the bounds, by the stacks' centre rays."""
    centres = []
    for lists in prepared.window:
        starts = np.arange(0, lists, STACK)
        centres.append((starts + np.minimum(starts + STACK, lists)) / 2 - lists / 2)
    a, b = np.meshgrid(*centres)
    pixels = np.stack([np.ones_like(a), a, b], axis=-1)
    first = np.full(a.shape, near - pixel_rays.reference_depth)
    last = np.full(a.shape, far - pixel_rays.reference_depth)
    for form in rays.box_planes(pixel_rays, prepared.bounds):
        value, slope = pixels @ form[:3], pixels @ form[3:]
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = -value / slope
        first = np.where(slope > 0, np.maximum(first, crossing), first)
        last = np.where(slope < 0, np.minimum(last, crossing), last)
        last = np.where((slope == 0) & (value < 0), first, last)  # beside the bounds
    depth = far - near
    return float(np.maximum(last - first, 0).mean() / depth) if depth > 0 else 0.0


def _share_lit(vdi: VDI, near: float, far: float, look: ValuesLook | None = None) -> float:
    """Return how much of the depths from ``near`` to ``far`` light gets through, the lists' mean.

    Of some of the lists that are not empty; 1 in a list through which it gets. View depths of V_O.
    ``look``: has the media that are shown, where they are others than the VDI's.
    """
    offsets = vdi.offsets.view(np.int64)
    lists = np.flatnonzero(np.diff(offsets))
    sampled = _SAMPLED_LISTS if look is None else _SAMPLED_LISTS_OF_VALUES
    lists = lists[:: -(-len(lists) // sampled) or 1]
    if not len(lists):
        return 1.0
    counts = offsets[lists + 1] - offsets[lists]
    begins = np.cumsum(counts) - counts
    places = np.arange(counts.sum()) + np.repeat(offsets[lists] - begins, counts)
    optical_depth = vdi.optical_depth[places] if look is None else look.media_of(places)[1]
    optical_depth = optical_depth.astype(np.float64)
    before = np.cumsum(optical_depth) - optical_depth
    before -= np.repeat(before[begins], counts)
    last = begins + np.add.reduceat(before < _DARK, begins) - 1  # that light gets to
    left = (_DARK - before[last]) / np.maximum(optical_depth[last], np.finfo(np.float32).tiny)
    front, back = (faces[places[last]].astype(np.float64) for faces in (vdi.front, vdi.back))
    depth = front + np.minimum(left, 1.0) * (back - front) + vdi.depth_origin
    through = np.add.reduceat(optical_depth, begins) < _DARK
    shares = np.where(through, 1.0, (depth - near) / max(far - near, np.finfo(np.float64).tiny))
    if look is not None:  # lists of which nothing is shown are empty
        shares = shares[np.add.reduceat(optical_depth, begins) > 0]
    return float(np.clip(shares, 0.0, 1.0).mean()) if len(shares) else 1.0


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
    depth_step: float = 1.0
    #: How much of the depth range light gets through; known on CPUs, whose packets follow from it.
    lit: float = 1.0

    def __init__(self, runtime: Runtime, vdi: VDI) -> None:
        self.runtime, self.window, self.bounds = runtime, vdi.window_size, vdi.bounds
        self.camera, self.depth_origin = vdi.camera, vdi.depth_origin
        self.parallel = vdi.camera.parallel_projection
        rays.check_list_space(vdi.camera, vdi.bounds)
        #: View depths of the bounds, and the least that is in front of V_O's eye, world units.
        self.depths = near, far = rays.depth_range(vdi.camera, vdi.bounds)
        self.nearest = rays.nearest_depth(vdi.camera, vdi.bounds)
        # An origin much closer than the data costs the coordinate the digits that it is to save
        closest = min(near, self.depth_origin)
        #: Whether the depth coordinate is that of a long lens.
        self.shifted = not self.parallel and 0 < far <= _LONG_LENS * closest
        #: Whether supersegments have 8 bytes.
        self.packed = vdi.packing is not None
        centre = rays.pixel_rays(vdi.camera, vdi.window_size, vdi.bounds).direction
        with kept_together() as keep:
            #: Direction of a centre ray per unit of view depth, model frame.
            centres = runtime.upload(centre.astype(np.float32), "centre rays", brief=True)
            self._centre = keep(centres)
            self._prepare(vdi, keep)

    @property
    def list_bytes(self) -> int:
        """Bytes of the lists on the device: headers and supersegments."""
        return sum(buffer.nbytes for buffer in {self.headers, self.faces, self.media})

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

    def _prepare(self, vdi: VDI, keep: Keep) -> None:
        """Bring the lists to the device, exact or packed, and build the occupancy grid."""
        with contextlib.ExitStack() as stack:
            if vdi.packing is not None:
                self._prepare_packed(vdi, vdi.packing, keep, stack.enter_context)
            else:
                # Take the lists from where they were made, or upload them
                held: dict[str, Any] = {}
                if hasattr(vdi.late, "on"):
                    held |= stack.enter_context(vdi.late.on(self.runtime))
                if not held:
                    arrays: Any = zip(_ARRAYS.items(), vdi.arrays, strict=True)
                    for (name, what), array in arrays:
                        held[name] = stack.enter_context(self.runtime.upload(array, what))
                self._prepare_lists(held, self._place_bundles(held, stack.enter_context), keep)
        if self.runtime.is_cpu:
            self.lit = _share_lit(vdi, *self.depths)

    def _prepare_packed(self, vdi: VDI, packing: Packed8, keep: Keep, briefly: Keep) -> None:
        """Prepare lists of 8-byte supersegments behind their scales, and count them."""
        runtime, self.depth_step = self.runtime, packing.step
        held: dict[str, Any] = {"step": packing.step}
        held["starts"] = briefly(runtime.upload(vdi.offsets, "list offsets"))
        for name in ("origins", "strides", "words"):
            what = f"{name} of 8-byte supersegments"
            held[name] = briefly(runtime.upload(getattr(packing, name), what))
        # Each list has a header, and words before its supersegments
        counts, offsets = vdi.counts.ravel(), vdi.offsets.view(np.int64)
        behind = np.cumsum(counts + LIST_HEADER * (counts > 0))
        self._tell_sizes(int(behind[-1]), int(counts.max()))
        headers = (behind - counts | counts << constants.FIRST_BITS).astype(np.uint64)
        self.headers = keep(runtime.upload(headers, "list headers"))
        occupied = np.flatnonzero(counts)
        first = packing.codes(offsets[occupied])[0]
        last = packing.codes(offsets[occupied + 1] - 1)[1]
        ends = [packing.depths(occupied, each) for each in (first, last)]
        self._tell_double_float(np.stack(ends, axis=1))
        entries = runtime.result((max(1, self._entries), 2), np.uint32, "supersegments")
        self.faces = self.media = keep(entries)
        prepare = runtime.bind(
            "raycasting/prepare.cl",
            "prepare_packed",
            **held,
            centre_ray=self._centre,
            headers=self.headers,
            faces=self.faces,
        )
        count = partial(prepare, padded(counts.size, GROUP), GROUP)
        self.occupancy = OccupancyGrid(self, count, keep)

    def _prepare_lists(self, arrays: dict[str, Any], begins: DeviceBuffer, keep: Keep) -> None:
        """Prepare exact lists, and count them in the occupancy grid.

        ``begins``: where bundles begin that have all supersegments of ``arrays``.
        """
        runtime, bundles = self.runtime, begins.shape[0] - 1
        self.headers = keep(runtime.result((bundles,), np.uint64, "list headers"))
        # A CPU writes them in our own memory, which systems give in large pages, a driver's in
        # small ones
        self.faces = keep(runtime.result((self._entries, 2), name="supersegment faces"))
        self.media = keep(runtime.result((self._entries, 4), name="supersegment media"))
        prepare = runtime.bind(
            "raycasting/prepare.cl",
            "prepare_lists",
            **{"cells": 0, **_NO_MEDIA, **arrays},
            begins=begins,
            centre_ray=self._centre,
            depth_kind=constants.PARALLEL if self.double_float else self.depth_kind,
            depth_origin=self.depth_origin,
            nearest=self.nearest,
            headers=self.headers,
            faces=self.faces,
            media=self.media,
        )
        self.occupancy = OccupancyGrid(self, partial(prepare, padded(bundles, GROUP), GROUP), keep)

    def _place_bundles(self, held: Mapping[str, Any], keep: Keep) -> DeviceBuffer:
        """Find where bundles begin, on the device, and what follows from the lists' sizes and ends.

        Nothing is uploaded.
        """
        runtime, (width, height) = self.runtime, self.window
        bundles = -(-width // BUNDLE) * -(-height // BUNDLE)
        blocks = -(-bundles // (GROUP * LISTS_PER_ITEM))
        with (
            runtime.buffer((bundles,), np.uint32, "lengths of bundles") as lengths,
            runtime.buffer((1,), np.uint32, "longest list") as longest,
            runtime.buffer((blocks,), np.uint64, "sums of lengths") as sums,
            runtime.result((width * height, 2), name="ends of lists") as ends,
        ):
            begins = keep(runtime.buffer((bundles + 1,), np.uint64, "where bundles begin"))
            for buffer, value in ((longest, 0), (begins, 0), (ends, np.nan)):
                runtime.fill(buffer, value)
            occupancy, offsets = "raycasting/occupancy.cl", "generation/offsets.cl"
            items, group = padded(bundles, GROUP), GROUP
            of_lists = {name: held[name] for name in _COUNTED} | {"width": width, "height": height}
            measure = runtime.bind(occupancy, "measure_bundles", **of_lists, lengths=lengths)
            measure(items, group, longest=longest, ends=ends)
            add = {"lists": bundles, "lengths": lengths, "partial": GROUP, "sums": sums}
            runtime.bind(offsets, "sum_lengths", **add)(blocks * GROUP, group)
            place = runtime.bind(offsets, "list_offsets", **add, made=0, all_offsets=begins)
            place(blocks * GROUP, group)
            entries = np.zeros(1, np.uint64)
            runtime.download_later(begins, entries, first=bundles)()
            self._tell_sizes(int(entries[0]), int(runtime.download(longest)[0]))
            found = runtime.download(ends)
            self._tell_double_float(found[~np.isnan(found[:, 0])])  # lists that are not empty
            return begins

    def _tell_sizes(self, entries: int, longest: int) -> None:
        """Set what follows from the entries of all lists, and the length of the longest."""
        self._entries = entries
        #: Whether offsets take 64 bits: kernels count words of 8 bytes, of which an entry takes up
        #: to two, by signed numbers.
        self.long_offsets = 2 * entries >= 2**31
        #: About how many supersegments a ray may meet: it crosses a border from list to list.
        self.most_media = sum(self.window) + longest

    def _tell_double_float(self, ends: NDArray[np.float32]) -> None:
        """Set what follows from how thin lists are for where they lie in the bounds' depths.

        ``ends``: the first front and the last back of the lists that are not empty, (n, 2).
        """
        near, far = (depth - self.depth_origin for depth in self.depths)
        front, back = np.clip(ends.T.astype(np.float64), near, far)
        rounded = np.maximum(np.abs(front), np.abs(back))
        if not (self.parallel or self.shifted):
            rounded = back + self.depth_origin
        thickness = (back - front).max(initial=0.0)
        #: Whether float32 has too few digits for rays, whose forms are double-floats then: 1 where
        #: the lists lie at the far end of the bounds' depths, 2 at the near one.
        self.double_float = 0
        if lists_are_far(rounded.max(initial=0.0), thickness, far - near):
            self.double_float = 2 if back.max() - near < far - front.min() else 1
        #: Which depth coordinate faces have, see ``lib/list_space.cl``.
        self.depth_kind = constants.RECIPROCAL
        if self.parallel or (self.shifted and not self.double_float):
            self.depth_kind = constants.PARALLEL if self.parallel else constants.SHIFTED
        #: ``-D`` names of kernels that read the lists, and their values.
        self.switches: dict[str, int | str] = {
            "OFFSET_T": "long" if self.long_offsets else "int",
            "PACKED": int(self.packed),
        }
        if self.double_float:
            self.switches["DOUBLE_FLOAT_RAYS"] = 1
        self.list_rows = self.list_space(self.camera)


class KeptValues(PreparedVDI):
    """A deferred VDI's lists on a device: what each of its looks is made of, in one pass."""

    def __init__(self, runtime: Runtime, deferred: DeferredVDI) -> None:
        arrays = {"means": deferred.mean, "spreads": deferred.spread, "steps": deferred.steps}
        self._lists = made_vdi(deferred.arrays, deferred)
        with kept_together() as keep:
            self.values = {
                name: keep(runtime.upload(array, f"{name} of values"))
                for name, array in arrays.items()
            }
            super().__init__(runtime, self._lists)

    def _prepare(self, vdi: VDI, keep: Keep) -> None:
        """Bring offsets and faces to the device."""
        arrays: Any = vdi.arrays
        self._faces = {
            name: keep(self.runtime.upload(array, _ARRAYS[name]))
            for name, array in zip(_COUNTED, arrays, strict=False)
        }
        self._begins = self._place_bundles(self._faces, keep)

    def shown(self, look: ValuesLook) -> PreparedVDI:
        """Return what a transfer function shows: what is transparent is left out."""
        runtime, shown = self.runtime, copy.copy(self)
        if runtime.is_cpu:
            shown.lit = _share_lit(self._lists, *self.depths, look)
        with (
            kept_together() as keep,
            runtime.upload(look.integrals, "integrals of a transfer function") as table,
        ):
            media = {**self.values, "integrals": table, "cells": CELLS}
            shown._prepare_lists({**self._faces, **media}, self._begins, keep)
        return shown


_made: weakref.WeakKeyDictionary[Any, dict[Runtime, tuple[Any, list[PreparedVDI]]]]
_made = weakref.WeakKeyDictionary()  # with the lock of whoever makes it
_made_lock = threading.Lock()


def prepared_vdi(runtime: Runtime, vdi: VDI | DeferredVDI) -> PreparedVDI:
    """Return a VDI, or the values of a deferred one, on the device: made once, kept as it lives.

    Whoever comes first makes it, others wait for that one only.
    """
    with _made_lock:
        places = _made.setdefault(vdi, {})
        lock, made = places.setdefault(runtime, (threading.Lock(), []))
    with runtime.holding(lock):
        if not made:
            if isinstance(vdi, DeferredVDI):
                made.append(KeptValues(runtime, vdi))
            elif isinstance(vdi.late, ValuesLook):
                values: Any = prepared_vdi(runtime, vdi.late.deferred)
                made.append(values.shown(vdi.late))
            else:
                made.append(PreparedVDI(runtime, vdi))
        return made[0]


def release_from_devices(things: Iterable[VDI | DeferredVDI | Volume | None]) -> None:
    """Release VDIs, values and volumes from devices; they are uploaded when used again."""
    for thing in things:
        if isinstance(thing, Volume):
            release_voxels(thing)
        elif thing is not None:
            with _made_lock:
                gone = _made.pop(thing, None)
            del gone  # without the lock
            if isinstance(thing, VDI) and hasattr(thing.late, "on"):
                thing.late.arrays()
