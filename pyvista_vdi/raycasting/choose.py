"""Which kernel draws a scene on a device, with which switches: one record, chosen in one place.

Rays of one plane through the eyes of V_O and V_N cross the same lists, if not at the same depth. On
a CPU a packet of such rays loads each list once. That pays where rays cross many lists
(docs/decisions/packets.md). Where they do not, a CPU follows them one by one, in blocks.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device.constants import (
    BLOCK_RAYS,
    BUNDLE,
    COLUMN_ITEMS,
    GROUP,
    PLANE_FORMS,
    STEEPEST,
    block_items,
    part_columns,
)
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.model.float32_limits import summation
from pyvista_vdi.raycasting.scene import Scene

#: Rays of a packet, side by side.
LANES = BLOCK_RAYS
#: Packets of a strip that begin before the window, or behind it: the steepest line that a packet
#: follows rises by less over its length.
MARGIN = math.ceil(STEEPEST * LANES)
#: Lists that a ray crosses before its light ends, over those that lie between a packet's first and
#: last ray, from which packets are faster: what they have in common (docs/decisions/packets.md).
#: Where a device has vectors of 16 floats, and where shorter ones, of which packets use more.
LEAST_IN_COMMON, LEAST_IN_COMMON_OF_SHORT_VECTORS = 4.5, 10.0
#: Pixels along the shorter edge of what is drawn from which packets are faster.
LEAST_PIXELS = 200
#: Rays along each edge of the window that are asked how many lists they cross.
_PROBES = 7
#: Lists that a ray may be away from the centre of its own, of the half that it has.
_FARTHEST_FROM_CENTRE = 0.125
#: Pixels that list (0, 0) may be away from the window's first one.
_FARTHEST_ORIGIN = 2**24

_RAYCAST = "raycasting/raycast.cl", "raycast"


@dataclass(frozen=True)
class ChosenKernel:
    """A kernel that draws a scene, by its file and name, and how it is launched.

    ``switches`` are its ``-D`` options, eight at most. ``items`` are its work-items, each of which
    follows ``rays`` rays, and ``group`` those of a group; of segments, 0 and those of a group.
    ``arguments`` are the kernel's own, beside what all kernels take that draw a frame. ``whole``:
    it writes every pixel of the window, those beside :attr:`Scene.part`, too.
    """

    kernel: tuple[str, str]
    switches: Mapping[str, int | str]
    items: int
    group: int
    arguments: Mapping[str, Any]
    rays: int = 1
    whole: bool = False


def choose(scene: Scene) -> ChosenKernel:
    """Return the variant that draws a scene on a device: of the first row that fits.

    ==========  =====================================================  ========================
    asked for   where                                                  kernel
    ==========  =====================================================  ========================
    a preview   everywhere                                             ``preview``
    segments    CPU; lists suit blocks                                 ``segments``, LANES=16
    segments    elsewhere                                              ``segments``
    first hits  everywhere                                             ``first_hits``
    a picture   CPU; V_O's view, a list for each pixel; not cropped    ``raycast_aligned_view``
    a picture   V_O's view, but for cropped ones that blocks can draw  ``raycast``, one_list
    a picture   CPU; rays have many lists in common; not cropped       ``raycast_packets``
    a picture   CPU; lists suit blocks                                 ``raycast``, LANES=16
    a picture   all else                                               ``raycast``
    ==========  =====================================================  ========================

    Lists *suit blocks* that have offsets of 32 bits, and rays in float32. Of pictures, *CPU* also
    means rays in float32, and sums that need not carry what they round off (COMPENSATED below 2).
    The reasons are in docs/decisions/index.md.
    """
    prepared, options, is_cpu = scene.prepared, scene.options, scene.prepared.runtime.is_cpu
    lists = prepared.switches  # OFFSET_T, PACKED; DOUBLE_FLOAT_RAYS where it is needed
    compensated = summation(options.preview_samples or prepared.most_media)
    switches = {**lists, "COMPENSATED": compensated}
    double_float, cropped = prepared.double_float, scene.regions != 0
    suit_blocks = not double_float and not prepared.long_offsets

    if options.preview_samples is not None:
        counts = {"counts": prepared.occupancy.counts, "samples": options.preview_samples}
        kernel, items = ("raycasting/preview.cl", "preview"), block_items(*scene.size)
        return ChosenKernel(kernel, switches, items, GROUP, counts, whole=True)

    # What rays cross of one of several VDIs
    if scene.segments:
        lanes = LANES if is_cpu and suit_blocks else 1
        kernel, switches = ("multi_vdi/segments.cl", "segments"), {**lists, "LANES": lanes}
        return ChosenKernel(kernel, switches, 0, GROUP // lanes, {}, lanes)

    def by_columns(
        kernel: tuple[str, str], switches: Mapping[str, int | str], rays: int = 1, **own: Any
    ) -> ChosenKernel:
        """Return the variant that draws the scene's part in strips, column by column."""
        columns = part_columns(scene.part)
        items = COLUMN_ITEMS * int(columns[2]) * int(columns[3])
        own = {"part": columns, **own}
        return ChosenKernel(kernel, switches, items // rays, COLUMN_ITEMS // rays, own, rays)

    if scene.hit is not None:
        return by_columns(
            ("raycasting/first_hits.cl", "first_hits"),
            lists,
            least_optical_depth=scene.hit.optical_depth,
            accumulated=int(scene.hit.accumulated),
        )

    # At V_O, each pixel from a list of its own
    in_vectors = is_cpu and not double_float and compensated < 2
    in_blocks = in_vectors and suit_blocks
    uncropped = in_vectors and not cropped
    if uncropped and (chosen := aligned_view(scene, switches)) is not None:
        return chosen
    # Each ray is still in one list: the kernel for single rays has a loop along it. Cropped rays
    # are followed in blocks where they can be
    if scene.one_list and not (cropped and in_blocks):
        return by_columns(_RAYCAST, {**switches, "LANES": 1})

    # Rays that have many lists in common
    if uncropped and (chosen := in_packets(scene, switches)) is not None:
        return chosen
    lanes = LANES if in_blocks else 1
    return by_columns(_RAYCAST, {**switches, "LANES": lanes}, lanes)


def choose_merge(scenes: Sequence[Scene]) -> ChosenKernel:
    """Return the variant that merges what rays cross of several VDIs."""
    compensated = summation(sum(scene.prepared.most_media for scene in scenes))
    lanes = LANES if scenes[0].prepared.runtime.is_cpu and compensated < 2 else 1
    switches = {"STREAMS": len(scenes), "COMPENSATED": compensated, "LANES": lanes}
    return ChosenKernel(("multi_vdi/merge.cl", "merge"), switches, 0, GROUP // lanes, {}, lanes)


def aligned_view(scene: Scene, switches: Mapping[str, int | str]) -> ChosenKernel | None:
    """Return how pixels are drawn from a list of their own; None if a ray is in another, too."""
    size, window, parallel = scene.size, scene.prepared.window, scene.prepared.parallel
    # The forms of (u, v, depth, denominator), and the t between which a ray may meet something
    coordinates = scene.forms[:4]
    near, far = rays.depth_range(scene.camera, scene.prepared.bounds)
    near = max(near, rays.nearest_depth(scene.camera, scene.prepared.bounds))
    ends = near - scene.reference_depth, far - scene.reference_depth
    first: list[int] = []
    # The corners, edges and middle speak for all: places depend on the pixel by a homography
    for x, y in itertools.product(*((0, pixels // 2, pixels - 1) for pixels in size)):
        # Value and slope of (u, v, depth, denominator) along the pixel's ray
        pixel = np.array([1.0, x + 0.5 - size[0] / 2, y + 0.5 - size[1] / 2])
        values, slopes = (coordinates @ pixel).T
        for t in ends:
            u, v, _, w = (values + t * slopes).tolist()
            # V_O's depth grows along the ray
            if not (w > 0 and slopes[2 if parallel else 3] > 0):
                return None
            # Where list (0, 0) would be, if the ray met its own list in the middle
            origin_x = x + 0.5 - (u / w + window[0] / 2)
            origin_y = y + 0.5 - (v / w + window[1] / 2)
            if not first:
                if not max(abs(origin_x), abs(origin_y)) < _FARTHEST_ORIGIN:
                    return None
                first = [round(origin_x), round(origin_y)]
            away = max(abs(origin_x - first[0]), abs(origin_y - first[1]))
            if not away <= _FARTHEST_FROM_CENTRE:
                return None
    # Packets begin at multiples of their size, in lists; whole groups of them are launched
    wide, high = (LANES, 1) if scene.prepared.packed else (LANES // BUNDLE, BUNDLE)
    first_i, first_j = -first[0] // wide * wide, -first[1] // high * high
    packets_wide = -(-(size[0] - first[0] - first_i) // wide)
    packets_high = -(-(size[1] - first[1] - first_j) // high)
    items = -(-(packets_wide * packets_high) // LANES) * LANES
    # The pixel of list (0, 0), which may lie beside V_N's window
    own = {"origin": np.array(first, np.int32)}
    kernel = "raycasting/aligned_view.cl", "raycast_aligned_view"
    return ChosenKernel(kernel, switches, items, LANES, own, LANES, whole=True)


def in_packets(scene: Scene, switches: Mapping[str, int | str]) -> ChosenKernel | None:
    """Return how rays are dealt to packets of a part of a frame; None if it is not faster."""
    part, size, prepared = scene.part, scene.size, scene.prepared
    if min(part.x1 - part.x0, part.y1 - part.y0) < LEAST_PIXELS:
        return None
    # Where V_N sees the eye of V_O: homogeneous pixel offsets from its window's centre. The eye of
    # a parallel projection is at infinity, against its direction
    to_model = rays.inverse_affine(prepared.camera.model_to_view)
    eye = to_model[:, 2] if prepared.parallel else to_model[:, 3]
    u, v, _, w = scene.camera.viewport_matrix(size) @ scene.camera.model_to_view @ eye
    epipole = np.array([u * size[0] / 2, v * size[1] / 2, w])
    # The line through the window's centre leads along the rows, or along the columns
    upright = bool(abs(epipole[1]) > abs(epipole[0]))
    crossed, across_packet = _lists_crossed(scene, upright)
    long_vectors = prepared.runtime.vector_floats >= 16
    least = LEAST_IN_COMMON if long_vectors else LEAST_IN_COMMON_OF_SHORT_VECTORS
    if prepared.lit * crossed.sum() < least * across_packet.sum():
        return None
    along, across = (part.x0, part.x1), (part.y0, part.y1)
    if upright:
        along, across = across, along
        epipole = epipole[[1, 0, 2]]
    first = along[0] // LANES
    strips = -(-along[1] // LANES) - first
    numbers = -(-(across[1] - across[0] + 2 * MARGIN) // LANES) * LANES
    scaled = epipole / max(np.abs(epipole).max(), np.finfo(np.float64).tiny)
    own = {
        "epipole": np.append(scaled, 0.0).astype(np.float32),
        # First strip, strips, number of each one's first packet, unused
        "part": np.array([first, strips, across[0] - MARGIN, 0], np.int32),
        "upright": upright,  # whether packets stand on end in the window
        "sweep_v": bool(crossed[1] > crossed[0]),  # whether they sweep along v, not along u
    }
    kernel = "raycasting/packets.cl", "raycast_packets"
    return ChosenKernel(kernel, switches, strips * numbers, LANES, own, LANES)


def _lists_crossed(scene: Scene, upright: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how many lists a ray crosses along u and v, and how wide a packet is, float64 (2,).

    Means of the rays that meet what they are clipped to; nothing is crossed if none does. A packet
    is as wide as where its rays are halfway.
    """
    coordinates, planes = scene.forms[:4], scene.forms[PLANE_FORMS:][: scene.planes]
    edges = [(np.arange(_PROBES) + 0.5) / _PROBES * pixels - pixels / 2 for pixels in scene.size]
    a, b = (offsets.reshape(-1) for offsets in np.meshgrid(*edges))
    pixels = np.stack([np.ones_like(a), a, b])
    last = pixels + np.array([[0], [0 if upright else LANES], [LANES if upright else 0]])
    with np.errstate(all="ignore"):  # rays that miss, and planes that are parallel to a ray
        clipped = planes @ pixels
        values, slopes = clipped[:, 0], clipped[:, 1]
        crossings = -values / slopes
        begins = np.where(slopes > 0, crossings, -np.inf).max(axis=0)
        ends = np.where(slopes < 0, crossings, np.inf).min(axis=0)
        outside = ((slopes == 0) & (values < 0)).any(axis=0)
        halfway = 0.5 * (begins + ends)
        crossed = np.abs(_places(coordinates, pixels, ends) - _places(coordinates, pixels, begins))
        wide = np.abs(_places(coordinates, last, halfway) - _places(coordinates, pixels, halfway))
        meets = (begins < ends) & ~outside & np.isfinite(crossed + wide).all(axis=0)
    if not meets.any():
        return np.zeros(2), np.ones(2)
    return crossed[:, meets].mean(axis=1), wide[:, meets].mean(axis=1)


def _places(
    coordinates: NDArray[np.float64], pixels: NDArray[np.float64], t: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (u, v) of the pixels' rays at t, float64 (2, n)."""
    values, slopes = np.moveaxis(coordinates @ pixels, 1, 0)
    u, v, _, denominator = values + t * slopes
    return np.stack([u / denominator, v / denominator])
