"""A grid whose blocks are with the ranks of an MPI communicator, to a VDI on the first of them.

The two passes and the merging are those of :mod:`pyvista_vdi.extensions.large.passes`. A block
stays where it is: neighbours exchange a few points, everybody the lists that belong to somebody
else's rows.
"""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi import errors
from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import (
    DeviceError,
    DeviceMemoryError,
    InvalidArgumentError,
    InvalidArgumentTypeError,
    MissingDependencyError,
    VDIError,
    with_article,
)
from pyvista_vdi.extensions.large.blocks import Blocks, Indices, Offset, Values
from pyvista_vdi.extensions.large.generate import NOWHERE, balanced, vdi_of
from pyvista_vdi.extensions.large.passes import Piece, Task, light_entering
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.checks import three_wholes
from pyvista_vdi.model.lighting import Lights
from pyvista_vdi.model.options import GenerationOptions, GenerationRequest
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Grid, Volume

#: Tag of the messages that bring neighbours' points; the place of the neighbour is added.
_HALO_TAG = 7100
#: Ranks that a message tells the blocks of.
_MOST_NAMED = 8
#: What ``first`` is, for who gives something else.
_FIRST = "first must be the index x, y, z of the block's first point in the whole grid"


def mpi() -> Any:
    """Return mpi4py's module ``MPI``."""
    try:
        from mpi4py import MPI
    except ImportError as error:
        raise MissingDependencyError(
            f"several ranks need mpi4py ({error}): pip install 'pyvista-vdi[mpi]', for the Python "
            "that they run"
        ) from error
    return MPI


def checked_ranks(comm: Any) -> Any:
    """Return a communicator, or tell all ranks that one of them was given something else."""
    if all(hasattr(comm, name) for name in ("rank", "size", "allgather", "alltoall", "scatter")):
        return comm
    with together(mpi().COMM_WORLD, "reading the arguments"):  # where the others most likely are
        raise InvalidArgumentTypeError(
            f"comm must be a communicator of mpi4py, such as MPI.COMM_WORLD; got "
            f"{with_article(type(comm).__name__)}"
        )


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
    VDIError
        On all ranks, if an argument of one of them cannot be used, or if one fails: of the kind
        that is told there, :class:`~pyvista_vdi.errors.InvalidArgumentError` say. The message names
        the rank.
    InvalidArgumentError
        On all ranks, if the blocks are not those of a grid of blocks, or the ranks were given
        different arguments.
    """
    comm = checked_ranks(comm)
    with together(comm, "reading the arguments", InvalidArgumentError):
        for wanted, thing in ((Grid, grid), (TransferFunction, transfer_function)):
            if not isinstance(thing, wanted):
                raise InvalidArgumentTypeError(
                    f"expected a {wanted.__name__}, got {type(thing).__name__}"
                )
        own = Volume(values, name=name).load()
        options = GenerationOptions.of(options, changes)
        whole: Any = SimpleNamespace(
            name=name,
            dimensions=grid.dimensions,
            spacing=grid.spacing,
            length=grid.length,
            array=own.array,
        )
        size: Any = window_size
        request = GenerationRequest(
            whole, transfer_function, camera, size, options, device, metadata=metadata or {}
        )
        first = three_wholes(first, _FIRST, 0)
        get_runtime(device)
        own_ends = own.finite_range() if np.isfinite(own.array).any() else (np.nan, np.nan)
    require_same(
        comm,
        camera=request.camera.to_dict(),
        window_size=request.window_size,
        grid=(grid.dimensions, grid.spacing, grid.origin, grid.direction.tolist()),
        transfer_function=transfer_function.to_dict(),
        # What devices may take differs, and lights are those of the first rank
        options=replace(options, memory_limit=None, lights=Lights()),
        values=(f"of type {own.array.dtype}", own.array.shape[3:]),
    )
    blocks, ranks = _blocks(comm, grid, own.dimensions, first)
    low, high = zip(*comm.allgather(own_ends), strict=True)
    scalars = (float(np.fmin.reduce(low)), float(np.fmax.reduce(high)))
    task = Task.of(blocks, request, scalars)
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
    sent: list[Piece | None] = []
    with together(comm, "cutting the lists into rows"):
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
    gathered, vdi = comm.gather(rows), None
    with together(comm, "putting the lists together"):
        if comm.rank == 0:
            finished = [part for part in gathered if part is not None]
            device_name = get_runtime(device).info.name
            vdi = vdi_of(task, request, finished, device_name, counted)
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
    comm: Any, grid: Grid, points: Sequence[int], first: Sequence[int]
) -> tuple[Blocks, dict[Indices, int]]:
    """Return the grid of blocks that the ranks' make up, and which rank has which."""
    boxes = comm.allgather((tuple(first)[::-1], tuple(points)[::-1]))
    whole = tuple(reversed(grid.dimensions))
    starts = [sorted({begin[axis] for begin, _ in boxes}) for axis in range(3)]
    cuts = tuple((*starts[axis], whole[axis]) for axis in range(3))
    lengths = [[b - a for a, b in itertools.pairwise(c)] for c in cuts]
    ranks: dict[Indices, int] = {}
    right = not any(of_axis[0] for of_axis in cuts)
    for rank, (begin, counts) in enumerate(boxes):
        z, y, x = (starts[axis].index(begin[axis]) for axis in range(3))
        expected = tuple(lengths[axis][k] for axis, k in enumerate((z, y, x)))
        right &= counts == expected and min(counts) >= 4
        ranks[z, y, x] = rank
    if not right or len(ranks) != np.prod([len(of_axis) for of_axis in lengths]):
        given = [
            f"rank {rank} has {counts[::-1]} from {begin[::-1]} on"
            for rank, (begin, counts) in enumerate(boxes[:_MOST_NAMED])
        ]
        raise InvalidArgumentError(
            f"the points of {len(boxes)} ranks are not those of one grid of blocks that cover "
            f"{grid.dimensions}, all along x, y and z: {', '.join(given)}"
            f"{' ...' if len(boxes) > _MOST_NAMED else ''}; give each rank a block of its own, cut "
            "where all others are cut, without ghost points, of four points at least"
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
    halo, parts = task.halo, []
    with together(comm, "cutting out what the neighbours need"):
        for number, offset in enumerate(halo.offsets()):
            z, y, x = (k - along for k, along in zip(block, offset, strict=True))
            if (z, y, x) in ranks:  # to it, this block is the neighbour in that direction
                part = np.ascontiguousarray(halo.from_slabs(slabs, offset))
                parts.append((part, ranks[z, y, x], _HALO_TAG + number))
    requests = [comm.isend(part, rank, tag=tag) for part, rank, tag in parts]
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
