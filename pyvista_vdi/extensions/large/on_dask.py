"""The workers of a Dask cluster, and what runs there.

The client submits calls and sums up the light; values, lists and rows stay with the workers and go
from one to the other. Every call is of a function of its arguments, so that Dask does again what
was lost with a worker. Which worker did what, and what came first, changes no bit.
"""

from __future__ import annotations

import functools
import os
import threading
import uuid
import weakref
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from typing import Any

from distributed import CancelledError, Client, Future, KilledWorker, as_completed, get_worker
from distributed.protocol.pickle import dumps, loads

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import DeviceError, InvalidVolumeError, NoDeviceError, VDIError
from pyvista_vdi.extensions.large.blocks import Values
from pyvista_vdi.extensions.large.passes import Task
from pyvista_vdi.generation.generate import report
from pyvista_vdi.model.options import GenerationRequest

#: Times that Dask tries again what a lost worker was at.
_RETRIES = 3
#: Ranges of rows for each worker, so that one with more to do does not keep all others waiting.
_RANGES_PER_WORKER = 4
#: A worker's threads do one block after the other: a block's memory is needed once.
_one_block = threading.Lock()


class Cluster(AbstractContextManager["Cluster"]):
    """Has the workers of a Dask cluster do the parts of a task; what they lack is refused."""

    def __init__(self, client: Client, request: GenerationRequest, task: Task) -> None:
        self._client, self._task = client, task
        array: Any = request.volume.array
        self._progress, self._done = request.progress, 0.0
        self._token, self._stage = uuid.uuid4().hex[:12], 0
        self._futures: weakref.WeakSet[Future[Any]] = weakref.WeakSet()  # that are still wanted
        self._array = array.array
        files = [str(path) for path in array.files]
        self._sent = None if array.lazy else (dumps(array), files)
        answers = client.run(_able, request.device, files, on_error="return")
        if not answers:
            raise NoDeviceError("the cluster has no workers: start some, or wait for them")
        failed = {at: answer for at, answer in answers.items() if not isinstance(answer, str)}
        for at, error in failed.items():
            kind = type(error) if isinstance(error, VDIError) else DeviceError
            raise kind(
                f"{len(failed)} of {len(answers)} workers cannot take part; worker {at}: {error}"
            )
        self.ranges = _RANGES_PER_WORKER * len(answers)
        self.device_name = ", ".join(sorted(set(answers.values())))

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None:
            self._client.cancel(list(self._futures), force=True)

    def values(self, boxes: Iterable[tuple[slice, ...]]) -> list[Any]:
        """Return what reads the volume's values in boxes, or, if Dask computes them, futures."""
        if self._sent is not None:
            return [functools.partial(_read, *self._sent, box) for box in boxes]
        futures = self._client.compute([self._array[box] for box in boxes])
        self._futures.update(futures)
        return list(futures)

    def map(
        self,
        name: str,
        function: Callable[..., Any],
        places: Sequence[tuple[int, ...]],
        *columns: Iterable[Any],
        share: float = 0.0,
        fetch: bool = False,
    ) -> dict[Any, Any]:
        """Return futures of what a function returns for each place, of its arguments.

        Those that are a ``share`` of the whole are waited for. ``fetch``: return what they hold,
        made again if it was lost meanwhile.
        """
        self._stage += 1
        futures = self._client.map(
            functools.partial(_do, self._task, function),
            places,
            *map(list, columns),
            key=[(f"{name}-{self._token}", *at) for at in places],
            retries=_RETRIES,
            pure=False,
            # Merged rows need less memory than pieces: before the next range is cut
            priority=self._stage,
        )
        self._futures.update(futures)
        at_place = dict(zip(futures, places, strict=True))
        for future in as_completed(futures) if share else ():
            if future.status != "finished":
                with self._naming(at_place[future]):
                    future.result()
            self._done = min(self._done + share / len(places), 1.0)
            report(self._progress, self._done)
        with self._naming(None):
            found = self._client.gather(futures) if fetch else futures
        return dict(zip(places, found, strict=True))

    @contextmanager
    def _naming(self, at: tuple[int, ...] | None) -> Iterator[None]:
        what = "a part of the VDI" if at is None else _named(self._task, at)
        try:
            yield
        except KilledWorker as error:
            raise DeviceError(
                f"{what} could not be made: the workers that were at it died, {_RETRIES + 1} in "
                "all (of too little memory, mostly): give workers more memory, or store the "
                f"volume in smaller chunks; {error}"
            ) from error
        except (VDIError, CancelledError):
            raise
        except Exception as error:  # of whoever reads: it does not know what for
            raise DeviceError(
                f"{what} could not be made: {type(error).__name__}: {error}"
            ) from error


def _read(pickled: bytes, files: list[str], box: tuple[slice, ...]) -> Values:
    """Read a part of an array, unpickled here.

    Dask waits for ever where arguments cannot be unpickled, as arrays of files that are not there.
    """
    _check_files(files)
    try:
        array = loads(pickled)
    except Exception as error:
        raise InvalidVolumeError(
            f"the volume's array cannot be opened there ({type(error).__name__}: {error}): each "
            "worker needs the library that reads it, and the right to read its files"
        ) from error
    values: Values = array[box]
    return values


def _check_files(files: list[str]) -> None:
    """Raise InvalidVolumeError for a file that is not here: zarr reads what is absent as 0."""
    for file in files:
        if not os.path.exists(file):  # noqa: PTH110 - as it was opened
            raise InvalidVolumeError(
                f"{file} cannot be read there: every worker needs the whole store by that path"
            )


def _able(device: Any, files: list[str]) -> str:
    """Return the name of a worker's device, if it has one and the volume's files."""
    _check_files(files)
    return get_runtime(device).info.name


def _do(task: Task, function: Callable[..., Any], at: tuple[int, ...], *arguments: Any) -> Any:
    """Call a function on a worker, one at a time, and say what failed where."""
    try:
        with _one_block:
            return function(*arguments)
    except Exception as error:
        kind = type(error) if isinstance(error, VDIError) else DeviceError
        said = str(error) or type(error).__name__
        raise kind(f"{_named(task, at)} on worker {get_worker().address}: {said}") from error


def _named(task: Task, at: tuple[int, ...]) -> str:
    """Return what messages call a block, rows or the light."""
    if len(at) < 3:
        return f"rows {at[0]} and following of the VDI"
    box = ", ".join(f"{part.start}:{part.stop}" for part in task.blocks.own((at[0], at[1], at[2])))
    return f"block {at[:3]} (points [{box}] of the volume)"
