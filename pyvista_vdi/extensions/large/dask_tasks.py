"""What runs on the workers of a Dask cluster: functions of their arguments, pickled by name."""

from __future__ import annotations

import functools
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from distributed import Worker, get_worker
from distributed.protocol.pickle import dumps, loads
from numpy.typing import NDArray

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import (
    Cancelled,
    DeviceError,
    DeviceMemoryError,
    InvalidVolumeError,
    NoDeviceError,
    VDIFileError,
)
from pyvista_vdi.extensions.large.blocks import Indices, Read, Values
from pyvista_vdi.extensions.large.passes import Opacities, Piece, Rows, Seen, Task
from pyvista_vdi.model.chunked import ChunkedArray
from pyvista_vdi.model.ray_forms import Rectangle
from pyvista_vdi.model.store_identity import Digests, check_digests, digests_of

#: Errors that keep their type where they say which block they are of.
_OURS = (DeviceMemoryError, InvalidVolumeError, NoDeviceError, VDIFileError)
#: A worker's threads do one block after the other: a block's memory is needed once.
_one_block = threading.Lock()


def wrong_with(digests: Digests) -> str | None:
    """Return what is wrong with a worker's files, if anything is."""
    try:
        check_digests(digests)
    except InvalidVolumeError as error:
        return str(error)
    return None


def device_name(device: Any) -> str:
    """Return the name of a worker's device."""
    return get_runtime(device).info.name


def memory_limit(dask_worker: Worker) -> int | None:
    """Return how many bytes a worker may take; Dask hands it in by the parameter's name."""
    return dask_worker.memory_manager.memory_limit


class Sent:
    """A chunked array on its way to workers: unpickled where a part is read.

    Dask waits for ever where arguments cannot be unpickled, as arrays of files that are not there.
    """

    def __init__(self, array: ChunkedArray, digests: Digests, run: str) -> None:
        self.dtype, self._array = array.dtype, dumps(array)
        self._digests, self._run = digests, run

    def __getitem__(self, box: tuple[slice, ...]) -> Values:
        _check_once(self._digests, self._run)
        try:
            array: ChunkedArray = loads(self._array)
        except Exception as error:
            raise InvalidVolumeError(
                f"the volume's array cannot be opened there ({type(error).__name__}: {error}): "
                "each worker needs the library that reads it, and the right to read its files"
            ) from error
        return array[box]


@functools.lru_cache(maxsize=64)
def _check_once(digests: Digests, run: str) -> None:
    """Check a worker's files, once for a run: it may have joined after all were asked."""
    check_digests(digests)


def digests_in(lazy: Any) -> Digests:
    """Return what tells the files of arrays in a Dask graph from others."""
    layers = getattr(lazy.dask, "layers", {}).values()
    arrays = [value for layer in layers if len(layer) == 1 for value in layer.values()]
    return tuple(pair for array in arrays for pair in digests_of(array))


def read(task: Task, block: Indices, read: Read) -> Values:
    """Read a block."""
    with _naming(task, block):
        return read()


def first_pass(task: Task, device: Any, block: Indices, values: Any, window: Rectangle) -> Seen:
    """Do the first pass of a block."""
    with _at(task, block):
        return task.first_pass(block, _at_hand(values), window, device)


def second_pass(
    task: Task,
    device: Any,
    block: Indices,
    values: Any,
    window: Rectangle,
    light: NDArray[np.float16],
    ambient: NDArray[np.float32] | None,
    *around: Seen | None,
) -> Piece:
    """Do the second pass of a block."""
    with _at(task, block):
        halo = task.halo
        neighbours = zip(halo.offsets(), around, strict=True)
        parts = {at: halo.from_slabs(seen.slabs, at) for at, seen in neighbours if seen is not None}
        whole = task.blocks.with_halo(_at_hand(values), parts, halo)
        return task.second_pass(block, whole, window, light, device, ambient)


def rows(piece: Piece, y0: int, y1: int) -> Piece:
    """Return some rows of a block's lists."""
    part = piece.rows(y0, y1)
    return part._replace(runs=part.runs.copy())


def merge(task: Task, device: Any, at: tuple[int, int], *pieces: Piece | None) -> Rows:
    """Merge rows of all blocks."""
    with _at(task, at):
        return task.merge(*at, [piece for piece in pieces if piece is not None], device)


def without_slabs(seen: Seen) -> Seen:
    """Return what the first pass has found, without the points at the block's sides."""
    return seen._replace(slabs={}, opacities=None)


def opacities(seen: Seen) -> Opacities | None:
    """Return a block's opacities."""
    return seen.opacities


def ambient(task: Task, device: Any, *opacities: Opacities | None) -> NDArray[np.float32]:
    """Return the mean transmittance around every node of the volume, from all blocks' opacities."""
    with _at(task, ()):
        return task.ambient(opacities, device)


def lengths(piece: Piece) -> NDArray[np.int64]:
    """Return how many runs each row of a block has."""
    return piece.counts.sum(axis=1, dtype=np.int64)


def _at_hand(values: Any) -> Values:
    found: Values = values() if isinstance(values, Read) else values
    return found


@contextmanager
def _at(task: Task, at: tuple[int, ...]) -> Iterator[None]:
    """Do one thing at a time in a process, and say what failed where."""
    with _naming(task, at), _one_block:
        yield


@contextmanager
def _naming(task: Task, at: tuple[int, ...]) -> Iterator[None]:
    try:
        yield
    except (Cancelled, MemoryError):
        raise
    except Exception as error:
        kind = type(error) if isinstance(error, _OURS) else DeviceError
        raise kind(f"{named(task, at)} on worker {get_worker().address}: {error}") from error


def named(task: Task, at: tuple[int, ...]) -> str:
    """Return what messages call a block, rows or the light."""
    if not at:
        return "the VDI's ambient occlusion"
    if len(at) < 3:
        return f"rows {at[0]} and following of the VDI"
    box = ", ".join(f"{part.start}:{part.stop}" for part in task.blocks.own((at[0], at[1], at[2])))
    return f"block {at[:3]} (points [{box}] of the volume)"
