"""A grid whose blocks are with the ranks of an MPI communicator, to a VDI on the first of them.

The two passes and the merging are those of :mod:`pyvista_vdi.extensions.large.passes`. A block
stays where it is: neighbours exchange a few points, everybody the lists that belong to somebody
else's rows.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from pyvista_vdi import errors
from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import (
    DeviceError,
    DeviceMemoryError,
    InvalidArgumentError,
    InvalidArgumentTypeError,
    VDIError,
    needing,
)
from pyvista_vdi.extensions.large.blocks import Blocks, Ends, Indices
from pyvista_vdi.extensions.large.generate import ranges_of, vdi_of
from pyvista_vdi.extensions.large.passes import Task
from pyvista_vdi.model.options import GenerationRequest
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Grid


@dataclass(kw_only=True)
class SharedGrid(Grid):
    """A grid whose points are shared out, in place of a request's volume.

    ``array``: this rank's; ``first``: index x, y, z of the first of them; ``ends``: the least and
    the largest scalar of all; ``rgba``: whether every point has a colour of its own.
    """

    array: NDArray[Any]
    first: tuple[int, int, int]
    ends: Ends
    rgba: bool
    name: str = "values"
    chunked: bool = False

    def finite_range(self) -> Ends:
        """Return the least and the largest scalar, NaN left out."""
        return self.ends


def ranks_of(comm: Any) -> Any:
    """Return a communicator, all ranks for None; tell all if one was given something else."""
    needed = ("rank", "size", "allgather", "alltoall", "scatter")
    if comm is not None and all(hasattr(comm, name) for name in needed):
        return comm
    how = "pip install 'pyvista-vdi[mpi]', for the Python that they run"
    with needing(f"several ranks need mpi4py: {how}"):
        from mpi4py import MPI
    if comm is None:
        return MPI.COMM_WORLD
    with together(MPI.COMM_WORLD, "reading the arguments"):  # where the others most likely are
        raise InvalidArgumentTypeError(
            f"comm must be a communicator of mpi4py, such as MPI.COMM_WORLD; got "
            f"{type(comm).__name__}"
        )


def generate_on_mpi(request: GenerationRequest, comm: Any) -> VDI | None:
    """Make a VDI of a :class:`SharedGrid`, on the first rank; all call it together.

    Its bytes do not depend on the ranks. InvalidArgumentError if the blocks are not those of a grid
    of blocks, and what else one of the ranks raises, are raised on all of them.
    """
    grid: Any = request.volume
    blocks, ranks = _blocks(comm, grid, request.transfer_function)
    task = Task.of(blocks, request, grid.ends)
    places = {rank: at for at, rank in ranks.items()}
    block, offsets = places[comm.rank], blocks.offsets
    with together(comm, "the first pass"):
        seen = task.first_pass(block, grid.array)

    # The first rank sums up the light, neighbours send each other what they need
    light: dict[Indices, Any] = {}
    summaries = comm.gather(seen.without_faces())
    with together(comm, "the light"):
        if comm.rank == 0:
            of_blocks = {at: summaries[rank] for at, rank in ranks.items()}
            light = task.light_entering({at: task.window(at) for at in blocks}, of_blocks)
    order = comm.bcast(list(light))
    entering = comm.scatter([light.get(places[r]) for r in range(comm.size)])
    sent: list[Any] = [None] * comm.size
    for offset in offsets:
        z, y, x = (k - along for k, along in zip(block, offset, strict=True))
        if (z, y, x) in ranks:  # to it, this block is the neighbour in that direction
            faces = {offset: seen.faces[offset]}
            sent[ranks[z, y, x]] = seen._replace(faces=faces, depths=None)
    received, others = comm.alltoall(sent), blocks.neighbours(block)
    around = [received[ranks[others[at]]] if at in others else None for at in offsets]

    # Each makes the lists of its block, and merges those of all blocks in some rows
    pieces: list[Any] = [None] * comm.size
    ranges = ranges_of(task.size[1], comm.size)
    with together(comm, "the second pass"):
        if entering is not None:
            piece = task.second_pass(block, grid.array, entering, *around)
            pieces[: len(ranges)] = [piece.rows(y0, y1) for y0, y1 in ranges]
    pieces, rows, vdi = comm.alltoall(pieces), None, None
    with together(comm, "merging"):
        if comm.rank < len(ranges):
            rows = task.merge(*ranges[comm.rank], *(pieces[ranks[at]] for at in order))
    gathered = comm.gather(rows)
    with together(comm, "putting the lists together"):
        if comm.rank == 0:
            finished = [part for part in gathered if part is not None]
            vdi = vdi_of(task, request, finished, get_runtime(request.device).info.name)
    return vdi


@contextmanager
def together(comm: Any, what: str, otherwise: type[VDIError] = DeviceError) -> Iterator[None]:
    """Do something on all ranks; if one fails, all raise, so that nobody waits for it.

    What is done may do something together itself. Between a failure and the end of the block
    the others meet no other collective call than that of such a block. The error is of the kind
    that the first rank has that fails, or ``otherwise`` if that is none of this package's.
    """
    error: Exception | None = None
    try:
        yield
    except Exception as caught:
        if getattr(caught, "told_to_all_ranks", False):
            raise
        error = caught
    said = comm.allgather(None if error is None else _kind_and_text(error, otherwise))
    failed = {rank: kind_and_text for rank, kind_and_text in enumerate(said) if kind_and_text}
    if not failed:
        return
    if comm.size == 1 and isinstance(error, VDIError):
        raise error
    rank, (kind, text) = next(iter(failed.items()))
    told = getattr(errors, kind)(
        f"{what} failed on {len(failed)} of {comm.size} ranks; rank {rank}: {text}"
    )
    told.told_to_all_ranks = True
    raise told from error


def _kind_and_text(error: Exception, otherwise: type[VDIError]) -> tuple[str, str]:
    """Return the name of the error that tells of another, and in which words."""
    kind = type(error).__name__
    if kind in errors.__all__:
        return kind, str(error)
    if isinstance(error, MemoryError):
        return DeviceMemoryError.__name__, f"{kind}: {error}"
    if isinstance(error, TypeError) and otherwise is InvalidArgumentError:
        return InvalidArgumentTypeError.__name__, str(error)
    return otherwise.__name__, f"{kind}: {error}"


def require_same(comm: Any, **things: Any) -> None:
    """Raise InvalidArgumentError on all ranks if they were given different things.

    ``things`` are told apart by what ``repr`` says of them.
    """
    own = {
        name: (hashlib.sha256(repr(thing).encode()).digest(), repr(thing)[:80])
        for name, thing in things.items()
    }
    for rank, others in enumerate(given := comm.allgather(own)):
        for name, (digest, text) in others.items():
            if digest != given[0][name][0]:
                raise InvalidArgumentError(
                    f"{name} must be the same on all ranks; rank 0 has {given[0][name][1]}, and "
                    f"rank {rank} {text}"
                )


def _blocks(
    comm: Any, grid: SharedGrid, function: TransferFunction
) -> tuple[Blocks, dict[Indices, int]]:
    """Return the grid of blocks that the ranks' make up, and which rank has which."""
    boxes = comm.allgather((grid.first[::-1], grid.array.shape[:3]))
    begins = (sorted({begin[axis] for begin, _ in boxes}) for axis in range(3))
    cuts = tuple((*of_axis, n) for of_axis, n in zip(begins, grid.dimensions[::-1], strict=True))
    blocks, ranks = Blocks.of(grid, cuts, function), {}
    for rank, (begin, points) in enumerate(boxes):
        z, y, x = (of_axis.index(at) for of_axis, at in zip(cuts, begin, strict=True))
        ends = [part.stop for part in blocks.own((z, y, x))]
        if ends == [at + n for at, n in zip(begin, points, strict=True)] and min(points) >= 4:
            ranks[z, y, x] = rank
    complete = len(ranks) == len(boxes) == math.prod(blocks.counts)
    if any(of_axis[0] for of_axis in cuts) or not complete:
        given = [
            f"rank {rank} has {points[::-1]} from {begin[::-1]} on"
            for rank, (begin, points) in enumerate(boxes)
        ]
        raise InvalidArgumentError(
            f"the points of {len(boxes)} ranks are not those of one grid of blocks that cover "
            f"{grid.dimensions}, all along x, y and z: {', '.join(given[:8])}"
            f"{' ...' if len(given) > 8 else ''}; give each rank a block of its own, cut "
            "where all others are cut, without ghost points, of four points at least"
        )
    return blocks, ranks
