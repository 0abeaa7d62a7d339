"""A chunked volume to a VDI on the local device, block by block."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.extensions.large.blocks import BLOCK_BYTES, Blocks, Indices, Read
from pyvista_vdi.extensions.large.passes import Piece, Rows, Seen, Task, light_entering
from pyvista_vdi.generation.generate import made_from, report
from pyvista_vdi.generation.list_arrays import require_room
from pyvista_vdi.model.options import GenerationRequest
from pyvista_vdi.model.packing import Arrays
from pyvista_vdi.model.ray_forms import Rectangle
from pyvista_vdi.model.vdi import VDI, made_vdi
from pyvista_vdi.model.volume import Volume

#: Blocks that would fit into a limit of memory: beside one there are lists, and its halo.
_BLOCKS_IN_LIMIT = 4
#: Where a block is of which V_O sees nothing.
NOWHERE = Rectangle(0, 0, 0, 0)


def task_of(
    request: GenerationRequest, chunks: Sequence[int], block_bytes: int | None = None
) -> Task:
    """Return a VDI's task."""
    volume, options = request.volume, request.options
    width, height = request.window_size
    require_room(0, (width, height))
    if volume.blanked is not None:
        raise UnsupportedError(
            f"the volume {volume.name!r} has blank points or cells, which volumes in blocks "
            "cannot have: write NaN there, or leave client out"
        )
    point_bytes = volume.array.dtype.itemsize * (4 if volume.rgba else 1)
    most = block_bytes or BLOCK_BYTES
    if options.memory_limit is not None:
        most = min(most, options.memory_limit // _BLOCKS_IN_LIMIT)
    blocks = Blocks.of(volume, chunks, point_bytes, most)
    gradients = request.transfer_function.gradient_opacities is not None
    scalars = volume.finite_range() if gradients else (np.nan, np.nan)  # nothing else asks
    return Task.of(blocks, request, scalars)


def vdi_of(
    task: Task,
    request: GenerationRequest,
    rows: Sequence[Rows],
    device_name: str,
    counted: Mapping[str, int],
) -> VDI:
    """Return the VDI of finished rows, from the lowest to the highest.

    ``counted``: the points that were read of the volume, again where they were, and the runs of
    all blocks together.
    """
    offsets = np.zeros(task.size[0] * task.size[1] + 1, np.uint64)
    np.cumsum(np.concatenate([part.lengths for part in rows]), out=offsets[1:])
    arrays = [np.concatenate([part[k] for part in rows]) for k in range(1, len(Rows._fields))]
    rays = task.rays()
    depth_origin = rays.forms(task.camera, task.size).rays.reference_depth
    made_by = made_from(
        request.replace(transfer_function=task.transfer_function, options=task.options),
        rays,
        device_name,
    )
    return made_vdi(
        task.camera,
        task.size,
        Arrays(offsets, *arrays),
        task.blocks.grid.bounds,
        depth_origin=depth_origin,
        metadata={**made_by, "blocks": list(task.blocks.counts), **counted, **request.metadata},
    ).with_precision(task.options.precision)


def chunks_of(volume: Volume, chunks: Sequence[int] | None) -> Sequence[int]:
    """Return where blocks of a volume may be cut."""
    if chunks is not None:
        return chunks
    if volume.chunks is not None:
        return volume.chunks.chunks
    raise InvalidArgumentError(f"the volume {volume.name!r} is not chunked: give chunks")


def generate_chunked(
    request: GenerationRequest,
    *,
    chunks: Sequence[int] | None = None,
    block_bytes: int | None = None,
) -> VDI:
    """Make a VDI of a volume block by block, each of which is read twice.

    ``chunks``: where blocks may be cut, points along z, y and x; the array's own by default.
    ``block_bytes``: most bytes of a block that has more than one chunk.
    """
    volume, device, progress = request.volume, request.device, request.progress
    task = task_of(request, chunks_of(volume, chunks), block_bytes)
    blocks, halo = task.blocks, task.halo
    windows = blocks.windows(task.camera, task.size)
    report(progress, 0.0)
    seen: dict[Indices, Seen] = {}
    order = task.to_read(windows)
    for k, block in enumerate(order):
        window = windows.get(block, NOWHERE)
        seen[block] = task.first_pass(block, volume.array[blocks.own(block)], window, device)
        report(progress, 0.4 * (k + 1) / len(order))
    ambient = (
        task.ambient([each.opacities for each in seen.values()], device) if task.occlusion else None
    )
    pieces: list[Piece] = []
    entering = light_entering(task, windows, seen)
    for k, (block, light) in enumerate(entering.items()):
        parts = {
            offset: halo.from_slabs(seen[other].slabs, offset)
            for offset, other in blocks.neighbours(block, halo).items()
        }
        values = blocks.with_halo(volume.array[blocks.own(block)], parts, halo)
        pieces.append(task.second_pass(block, values, windows[block], light, device, ambient))
        report(progress, 0.4 + 0.5 * (k + 1) / len(entering))
    rows = task.merge(0, task.size[1], pieces, device)
    report(progress, 1.0)
    counted = {
        "points_read": sum(Read(volume.array, blocks.own(b)).points for b in [*order, *entering]),
        "runs_merged": sum(len(piece.runs) for piece in pieces),
    }
    return vdi_of(task, request, [rows], get_runtime(device).info.name, counted)


#: Rows of lists are shared out in multiples of this.
ROWS = 4


def balanced(weights: NDArray[np.int64], parts: int) -> Iterator[tuple[int, int]]:
    """Cut rows into ranges of like weight, each of whole groups of four rows but the last."""
    groups = -(-len(weights) // ROWS)
    sums = np.add.reduceat(weights, np.arange(0, len(weights), ROWS)).cumsum()
    wanted = np.arange(1, parts) * (sums[-1] / parts)
    cuts = np.unique([0, *np.searchsorted(sums, wanted, side="right"), groups])
    for first, last in zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True):
        yield first * ROWS, min(last * ROWS, len(weights))
