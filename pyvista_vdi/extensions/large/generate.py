"""A chunked volume to a VDI block by block, on the local device or on the workers of a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext
from functools import partial
from itertools import pairwise, zip_longest
from operator import getitem
from typing import Any

import numpy as np

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import InvalidArgumentError, InvalidArgumentTypeError, needing
from pyvista_vdi.extensions.large.blocks import BLOCK_BYTES, Blocks, cuts_of
from pyvista_vdi.extensions.large.passes import BlockSummary, Piece, Rows, Task
from pyvista_vdi.generation.generate import made_from, report
from pyvista_vdi.model.options import GenerationRequest
from pyvista_vdi.model.packing import Arrays
from pyvista_vdi.model.types import ClientLike
from pyvista_vdi.model.vdi import VDI, made_vdi

#: Blocks that would fit into a limit of memory: beside one there are lists, and its halo.
_BLOCKS_IN_LIMIT = 4
#: Rows of lists are shared out in multiples of this.
_ROWS = 4


def generate_in_blocks(
    request: GenerationRequest,
    client: ClientLike | None = None,
    *,
    block_bytes: int = BLOCK_BYTES,
) -> VDI:
    """Make a VDI of a chunked volume block by block, each of which is read twice.

    ``client``: a ``distributed.Client``, or the address of a Dask scheduler, whose workers make it;
    the local device by default. ``block_bytes``: most bytes of a block that has more than one
    chunk.
    """
    volume, limit = request.volume, request.options.memory_limit
    if limit is not None:
        block_bytes = min(block_bytes, limit // _BLOCKS_IN_LIMIT)
    array: Any = volume.array
    cuts = cuts_of(array.shape, array.chunks, array.dtype.itemsize, block_bytes)
    blocks = Blocks.of(volume, cuts, request.transfer_function)
    gradients = request.transfer_function.gradient_opacities is not None
    scalars = volume.finite_range() if gradients else (np.nan, np.nan)  # nothing else asks
    task = Task.of(blocks, request, scalars)
    if client is None:
        return _generated(request, task, _Here(request))
    with needing("a cluster needs dask.distributed: pip install 'pyvista-vdi[dask]'"):
        from distributed import Client

        from pyvista_vdi.extensions.large.on_dask import Cluster
    if not isinstance(client, str | Client):
        raise InvalidArgumentTypeError(
            f"client must be a distributed.Client or the address of a scheduler; got "
            f"{type(client).__name__}: give distributed.Client(cluster) for a cluster"
        )
    try:
        connection = Client(client) if isinstance(client, str) else nullcontext(client)
    except (OSError, ValueError) as error:
        raise InvalidArgumentError(
            f"no Dask scheduler answers at {client!r} ({error}): `dask scheduler` starts one and "
            "says its address"
        ) from error
    with connection as connected, Cluster(connected, request, task) as workers:
        return _generated(request, task, workers)


def _generated(request: GenerationRequest, task: Task, workers: Any) -> VDI:
    """Make a VDI by a :class:`_Here` or a :class:`~.on_dask.Cluster`."""
    report(request.progress, 0.0)
    blocks = task.blocks
    windows = {block: task.window(block) for block in blocks}

    # Find how much light each block lets through, and so how much enters those behind it
    order = task.to_read(windows)
    values = dict(zip(order, workers.values(map(blocks.own, order)), strict=True))
    first = workers.map("first-pass", task.first_pass, order, order, values.values(), share=0.4)
    seen = workers.map("seen", BlockSummary.without_faces, order, first.values(), fetch=True)
    entering = task.light_entering(windows, seen)

    # Make the lists of each block in which something may be seen
    visible = list(entering)
    around = [blocks.neighbours(block) for block in visible]
    pieces = workers.map(
        "second-pass",
        task.second_pass,
        visible,
        visible,
        [values[block] for block in visible],
        entering.values(),
        *([first.get(found.get(at)) for found in around] for at in blocks.offsets),
        share=0.4,
    )
    del values, first

    # Merge those of all blocks, some rows at a time
    ranges = ranges_of(task.size[1], workers.ranges)
    rows = []
    for y0, y1 in ranges:
        met = [at for at in visible if windows[at].y0 < y1 and windows[at].y1 > y0]
        columns = [pieces[at] for at in met], [y0] * len(met), [y1] * len(met)
        rows.append(workers.map("rows", Piece.rows, [(*at, y0) for at in met], *columns).values())
    of_ranges = *zip(*ranges, strict=True), *zip_longest(*rows)
    merged = workers.map("merge", task.merge, ranges, *of_ranges, share=0.2, fetch=True)
    return vdi_of(task, request, [merged[at] for at in ranges], workers.device_name)


def vdi_of(task: Task, request: GenerationRequest, rows: Sequence[Rows], device_name: str) -> VDI:
    """Return the VDI of finished rows, from the lowest to the highest."""
    lengths, front, back, color, depth = map(np.concatenate, zip(*rows, strict=True))
    offsets = np.zeros(len(lengths) + 1, np.uint64)
    np.cumsum(lengths, out=offsets[1:])
    asked = request.replace(transfer_function=task.transfer_function, options=task.options)
    made_by = made_from(asked, task.rays, device_name)
    return made_vdi(
        Arrays(offsets, front, back, color, depth),
        camera=task.camera,
        window_size=task.size,
        bounds=task.blocks.grid.bounds,
        depth_origin=task.rays.forms(task.camera, task.size).rays.reference_depth,
        metadata={**made_by, "blocks": list(task.blocks.counts), **request.metadata},
    ).with_precision(task.options.precision)


def ranges_of(rows: int, parts: int) -> list[tuple[int, int]]:
    """Cut rows into so many ranges at most, each of whole groups of four rows but the last."""
    groups = -(-rows // _ROWS)
    cuts = np.unique(np.linspace(0, groups, parts + 1).astype(int)) * _ROWS
    return list(pairwise(np.minimum(cuts, rows).tolist()))


class _Here:
    """Does all parts of a task in this process, one after the other."""

    #: Ranges of rows that are merged apart from each other
    ranges = 1

    def __init__(self, request: GenerationRequest) -> None:
        self._array, self._progress, self._done = request.volume.array, request.progress, 0.0
        self.device_name = get_runtime(request.device).info.name

    def values(self, boxes: Iterable[tuple[slice, ...]]) -> list[Any]:
        """Return what reads the volume's values in boxes."""
        return [partial(getitem, self._array, box) for box in boxes]

    def map(
        self,
        _name: str,
        function: Callable[..., Any],
        places: Sequence[tuple[int, ...]],
        *columns: Iterable[Any],
        share: float = 0.0,
        fetch: bool = False,
    ) -> dict[Any, Any]:
        """Return what a function returns for each place, of its arguments; ``share`` of all."""
        found = {}
        for at, *arguments in zip(places, *columns, strict=True):
            found[at] = function(*arguments)
            if share:
                self._done = min(self._done + share / len(places), 1.0)
                report(self._progress, self._done)
        return found
