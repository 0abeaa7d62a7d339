"""A grid whose blocks are with the ranks of an MPI communicator, to a VDI on the first of them.

The two passes and the merging are those of :mod:`pyvista_vdi.large.passes`. A block stays where it
is: neighbours exchange a few points, everybody the lists that belong to somebody else's rows.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import DeviceError, InvalidArgumentError, MissingDependencyError
from pyvista_vdi.large.blocks import Blocks, Indices, Offset, Values
from pyvista_vdi.large.generate import NOWHERE, vdi_of
from pyvista_vdi.large.passes import Piece, Task, light_entering
from pyvista_vdi.large.rows import balanced
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.grid import Grid
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume

#: Tag of the messages that bring neighbours' points; the place of the neighbour is added.
_HALO_TAG = 7100


def mpi() -> Any:
    """Return mpi4py's module ``MPI``.

    Raises
    ------
    MissingDependencyError
        If mpi4py is not installed.
    """
    try:
        from mpi4py import MPI
    except ImportError as error:
        raise MissingDependencyError(
            f"several ranks need mpi4py ({error}): pip install 'pyvista-vdi[mpi]', for the Python "
            "that they run"
        ) from error
    return MPI


def generate_on_mpi(
    values: NDArray[Any],
    first: Sequence[int],
    grid: Grid,
    camera: Camera,
    window_size: Sequence[int],
    transfer_function: TransferFunction,
    options: GenerationOptions | None = None,
    *,
    comm: Any,
    device: Any = None,
    name: str = "values",
    metadata: Mapping[str, Any] | None = None,
    **changes: Any,
) -> VDI | None:
    """Make a VDI of a grid of which each rank has a block. All ranks call it together.

    Parameters
    ----------
    values : numpy.ndarray, shape (nz, ny, nx)
        The rank's own points, without those of its neighbours. Blocks are those of a grid of
        blocks: all ranks' cuts along an axis are the same, and each has four points at least.
    first : (int, int, int)
        Index x, y, z of its first point in the grid.
    grid : Grid
        The whole grid.
    camera : Camera
        The generating view V_O, the same on all ranks, as what follows is.
    window_size : (int, int)
        Lists along the window's width and height.
    transfer_function : TransferFunction
        Scalar to colour and opacity.
    options : GenerationOptions, optional
        How it is made.
    comm : mpi4py.MPI.Comm
        The ranks.
    device : optional
        Of this rank, see :func:`pyvista_vdi.list_devices`.
    name : str
        What the scalars are called.
    metadata : mapping, optional
        Entries to add to ``vdi.metadata``.
    **changes
        Options by name, in place of those in ``options``.

    Returns
    -------
    VDI or None
        The VDI on rank 0, nothing on the others. Its bytes do not depend on the ranks.

    Raises
    ------
    InvalidArgumentError
        On all ranks, if the blocks are not those of a grid of blocks.
    DeviceError
        On all ranks, if one of them fails; the message names it.
    """
    options = GenerationOptions.of(options, changes)
    with together(comm, "reading the arguments"):
        own = Volume(values, name=name)
        size = check_window_size(window_size)
    blocks, ranks = _blocks(comm, grid, own.dimensions, first)
    ends = comm.allgather(own.finite_range() if np.isfinite(own.array).any() else (np.nan,) * 2)
    low, high = zip(*ends, strict=True)
    scalars = (float(np.fmin.reduce(low)), float(np.fmax.reduce(high)))
    task = Task.of(blocks, Camera.from_any(camera), size, transfer_function, options, scalars)
    places = {rank: at for at, rank in ranks.items()}
    block = places[comm.rank]
    windows = blocks.windows(task.camera, task.size)
    window = windows.get(block, NOWHERE)
    with together(comm, "the first pass"):
        seen = task.first_pass(block, own.array, window, device)
    order, scattered, ambient = None, None, None
    summaries = comm.gather(seen._replace(slabs={}))
    with together(comm, "the light"):
        if comm.rank == 0:
            of_blocks = {at: summaries[rank] for at, rank in ranks.items()}
            found = light_entering(task, windows, of_blocks)
            order = list(found)
            if task.occlusion is not None:
                ambient = task.ambient([each.opacities for each in of_blocks.values()], device)
            scattered = [found.get(places[r]) for r in range(comm.size)]
    light = comm.scatter(scattered)
    order, ambient = comm.bcast((order, ambient))
    parts = _exchanged(comm, task, block, ranks, seen.slabs)
    piece = Piece(window, np.zeros((0, 0), np.uint16), np.zeros((0, 8), np.float32))
    with together(comm, "the second pass"):
        if light is not None:
            whole = blocks.with_halo(own.array, parts, task.halo)
            piece = task.second_pass(block, whole, window, light, device, ambient)
    ranges, counted = _ranges(comm, task, piece, light is not None)
    sent = [
        piece.rows(*ranges[r]) if light is not None and r < len(ranges) else None
        for r in range(comm.size)
    ]
    received = comm.alltoall(sent)
    rows = None
    with together(comm, "merging"):
        if comm.rank < len(ranges):
            y0, y1 = ranges[comm.rank]
            pieces = [received[ranks[at]] for at in order]
            rows = task.merge(y0, y1, pieces, device)
    gathered = comm.gather(rows)
    if comm.rank != 0:
        return None
    described: Any = SimpleNamespace(
        name=name,
        dimensions=grid.dimensions,
        spacing=grid.spacing,
        length=grid.length,
        array=own.array,
    )
    finished = [part for part in gathered if part is not None]
    device_name = get_runtime(device).info.name
    return vdi_of(task, described, finished, device_name, counted, metadata)


@contextmanager
def together(comm: Any, what: str) -> Iterator[None]:
    """Do something on all ranks; if one fails, all raise, so that nobody waits for it.

    Raises
    ------
    DeviceError
        On all ranks; the message says what failed, on how many of them, and why on the first.
    """
    error: Exception | None = None
    try:
        yield
    except Exception as caught:
        error = caught
    said = comm.allgather(None if error is None else f"{type(error).__name__}: {error}")
    failed = {rank: text for rank, text in enumerate(said) if text is not None}
    if failed:
        rank, text = next(iter(failed.items()))
        raise DeviceError(
            f"{what} failed on {len(failed)} of {comm.size} ranks; rank {rank}: {text}"
        ) from error


def _blocks(
    comm: Any, grid: Grid, points: Sequence[int], first: Sequence[int]
) -> tuple[Blocks, dict[Indices, int]]:
    """Return the grid of blocks that the ranks' make up, and which rank has which."""
    boxes = comm.allgather((tuple(int(k) for k in first)[::-1], tuple(points)[::-1]))
    whole = tuple(reversed(grid.dimensions))
    starts = [sorted({begin[axis] for begin, _ in boxes}) for axis in range(3)]
    cuts = tuple((*starts[axis], whole[axis]) for axis in range(3))
    lengths = [[b - a for a, b in itertools.pairwise(c)] for c in cuts]
    ranks: dict[Indices, int] = {}
    for rank, (begin, counts) in enumerate(boxes):
        z, y, x = (starts[axis].index(begin[axis]) for axis in range(3))
        expected = tuple(lengths[axis][k] for axis, k in enumerate((z, y, x)))
        if counts != expected or min(counts) < 4 or cuts[0][0] or cuts[1][0] or cuts[2][0]:
            raise InvalidArgumentError(
                f"rank {rank} has {counts} points from {begin} on, both (z, y, x), where blocks "
                f"along these cuts have {expected}: give blocks of one grid of blocks that cover "
                f"{whole} points, without ghost points, each with four points at least"
            )
        ranks[z, y, x] = rank
    if len(ranks) != np.prod([len(of_axis) for of_axis in lengths]):
        raise InvalidArgumentError(
            f"{comm.size} ranks have {len(ranks)} different blocks of "
            f"{' x '.join(str(len(of_axis)) for of_axis in lengths)}: one rank has one block"
        )
    z, y, x = (max(of_axis) for of_axis in lengths)
    return Blocks(grid, cuts, (z, y, x)), ranks


def _exchanged(
    comm: Any,
    task: Task,
    block: Indices,
    ranks: Mapping[Indices, int],
    slabs: Mapping[tuple[int, int], Values],
) -> dict[Offset, Values]:
    """Return what a block needs of its neighbours' points, which they send."""
    halo, requests = task.halo, []
    for number, offset in enumerate(halo.offsets()):
        z, y, x = (k - along for k, along in zip(block, offset, strict=True))
        if (z, y, x) in ranks:  # to it, this block is the neighbour in that direction
            part = np.ascontiguousarray(halo.from_slabs(slabs, offset))
            requests.append(comm.isend(part, ranks[z, y, x], tag=_HALO_TAG + number))
    numbers = {offset: number for number, offset in enumerate(halo.offsets())}
    found = {
        offset: comm.recv(source=ranks[other], tag=_HALO_TAG + numbers[offset])
        for offset, other in task.blocks.neighbours(block, halo).items()
    }
    for request in requests:
        request.wait()
    return found


def _ranges(
    comm: Any, task: Task, piece: Piece, seen: bool
) -> tuple[list[tuple[int, int]], dict[str, int]]:
    """Return the rows that each rank merges, and what there is of points and runs."""
    of_rows = np.zeros(task.size[1], np.int64)
    if seen:
        of_rows[piece.window.y0 : piece.window.y1] = piece.counts.sum(axis=1, dtype=np.int64)
    of_rows = sum(comm.allgather(of_rows))
    points = int(np.prod(task.blocks.grid.dimensions))
    counted = {"points_read": points, "runs_merged": int(of_rows.sum())}
    return list(balanced(of_rows, comm.size)), counted
