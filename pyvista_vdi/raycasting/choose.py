"""Which kernel draws a scene on a device, with which switches: one record, chosen in one place."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pyvista_vdi.device import Runtime
from pyvista_vdi.device.constants import COLUMN_ITEMS, GROUP, block_items, part_columns
from pyvista_vdi.model.float32_limits import summation
from pyvista_vdi.raycasting.packets import LANES
from pyvista_vdi.raycasting.scene import Scene

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


def choose(device: Runtime, scene: Scene) -> ChosenKernel:
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
    prepared, options = scene.prepared, scene.options
    lists = prepared.switches  # OFFSET_T, PACKED; DOUBLE_FLOAT_RAYS where it is needed
    compensated = summation(options.preview_samples or prepared.most_media)
    sums: dict[str, int | str] = {"COMPENSATED": compensated}
    double_float, cropped = prepared.double_float, scene.regions != 0
    suit_blocks = not double_float and not prepared.long_offsets

    if options.preview_samples is not None:
        switches = {**lists, **sums}
        counts = {"counts": prepared.occupancy.counts, "samples": options.preview_samples}
        items = block_items(*scene.size)
        return ChosenKernel(
            ("raycasting/preview.cl", "preview"), switches, items, GROUP, counts, whole=True
        )

    # What rays cross of one of several VDIs
    if scene.segments:
        lanes = LANES if device.is_cpu and suit_blocks else 1
        switches = {**lists, "LANES": lanes}
        return ChosenKernel(
            ("multi_vdi/segments.cl", "segments"), switches, 0, GROUP // lanes, {}, lanes
        )

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
    in_vectors = device.is_cpu and not double_float and compensated < 2
    in_blocks = in_vectors and suit_blocks
    uncropped = in_vectors and not cropped
    if uncropped and scene.aligned is not None:
        kernel = "raycasting/aligned_view.cl", "raycast_aligned_view"
        own = {"origin": scene.aligned.origin}
        items = scene.aligned.items
        return ChosenKernel(kernel, {**lists, **sums}, items, LANES, own, LANES, whole=True)
    # Each ray is still in one list: the kernel for single rays has a loop along it. Cropped rays
    # are followed in blocks where they can be
    if scene.one_list and not (cropped and in_blocks):
        return by_columns(_RAYCAST, {**lists, **sums, "LANES": 1})

    # Rays that have many lists in common
    packets = scene.packets if uncropped else None
    if packets is not None:
        switches = {**lists, **sums}
        across: dict[str, Any] = {"epipole": packets.epipole, "part": packets.part}
        across |= {"upright": packets.upright, "sweep_v": packets.sweep_v}
        return ChosenKernel(
            ("raycasting/packets.cl", "raycast_packets"),
            switches,
            packets.items,
            LANES,
            across,
            LANES,
        )
    lanes = LANES if in_blocks else 1
    switches = {**lists, **sums, "LANES": lanes}
    return by_columns(_RAYCAST, switches, lanes)


def choose_merge(device: Runtime, scenes: Sequence[Scene]) -> ChosenKernel:
    """Return the variant that merges what rays cross of several VDIs."""
    compensated = summation(sum(scene.prepared.most_media for scene in scenes))
    lanes = LANES if device.is_cpu and compensated < 2 else 1
    switches = {"STREAMS": len(scenes), "COMPENSATED": compensated, "LANES": lanes}
    return ChosenKernel(("multi_vdi/merge.cl", "merge"), switches, 0, GROUP // lanes, {}, lanes)
