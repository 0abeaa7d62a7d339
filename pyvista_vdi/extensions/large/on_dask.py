"""A chunked volume to a VDI on the workers of a Dask cluster.

The client submits tasks and sums up the light; values, lists and rows stay with the workers and go
from one to the other. Every task is a function of its arguments, so that Dask does again what was
lost with a worker. Which worker did what, and what came first, changes no bit.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import zip_longest
from typing import Any

import numpy as np
from distributed import CancelledError, Client, Future, KilledWorker, as_completed, wait
from numpy.typing import NDArray

from pyvista_vdi.errors import (
    DeviceError,
    InvalidVolumeError,
    NoDeviceError,
    VDIError,
    warn_external,
)
from pyvista_vdi.extensions.large import dask_tasks as work
from pyvista_vdi.extensions.large.blocks import Indices, Read
from pyvista_vdi.extensions.large.generate import (
    NOWHERE,
    balanced,
    chunks_of,
    task_of,
    vdi_of,
)
from pyvista_vdi.extensions.large.passes import Rows, Task, light_entering
from pyvista_vdi.generation.generate import Progress, report
from pyvista_vdi.model.options import GenerationRequest
from pyvista_vdi.model.ray_forms import Rectangle
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume

#: Share of the workers' memory that values may take which are kept from the first pass to the
#: second; otherwise they are read again.
_SHARE_FOR_VALUES = 0.25
#: Times that Dask tries again what a lost worker was at.
_RETRIES = 3
#: Seconds after which is looked whether the only workers that may do something are still there.
_LOOK_EVERY = 5.0
#: Ranges of rows for each worker, so that one with more to do does not keep all others waiting.
RANGES_PER_WORKER = 4
#: Shares of the two passes and of the merging in what is reported.
_SHARES = (0.4, 0.4, 0.2)


def generate_on_dask(
    request: GenerationRequest,
    *,
    client: Client,
    workers: Sequence[str] | None = None,
    chunks: Sequence[int] | None = None,
    block_bytes: int | None = None,
) -> VDI:
    """Make a VDI of a chunked volume on the workers of a cluster.

    The request's ``device`` is a selector that each worker understands; ``workers`` are the
    addresses of those that may be taken. The others are as for :func:`generate_chunked`.
    """
    volume, device = request.volume, request.device
    able = _workers_with_device(client, device, workers)
    task = task_of(request, chunks_of(volume, chunks), block_bytes)
    run = _Run(client, task, volume, list(able), device, request.progress)
    try:
        rows = run.rows()
    except BaseException:
        run.cancel()
        raise
    names = sorted(set(able.values()))
    return vdi_of(task, request, rows, ", ".join(names), run.counted)


class _Run:
    """One generation on a Dask cluster: its futures, and what is known so far."""

    def __init__(
        self,
        client: Client,
        task: Task,
        volume: Volume,
        workers: list[str],
        device: Any,
        progress: Progress | None,
    ) -> None:
        self._client, self._task, self._volume = client, task, volume
        self._workers, self._device, self._progress = workers, device, progress
        self._token = uuid.uuid4().hex[:12]
        self._futures: list[Future[Any]] = []
        # A worker that is started again has another address: tasks are tied to some only where
        # others may not do them. (Not asked of `scheduler_info`, whose answer the client replaces
        # now and then by one without workers, from another thread.)
        some = {"workers": workers, "allow_other_workers": False}
        self._where: dict[str, Any] = some if len(workers) < len(client.nthreads()) else {}
        limits = client.run(work.memory_limit, workers=workers, on_error="ignore")
        memory = sum(limit or np.inf for limit in limits.values())
        self._sent = self._array_for_workers()
        self._kept = volume.array.nbytes <= _SHARE_FOR_VALUES * memory
        self._done = 0.0
        self.counted: dict[str, int] = {}

    def rows(self) -> list[Rows]:
        """Return the finished lists, from the lowest rows to the highest."""
        task, blocks, halo = self._task, self._task.blocks, self._task.halo
        report(self._progress, 0.0)
        windows = blocks.windows(task.camera, task.size)
        order = task.to_read(windows)
        reads = {block: Read(self._sent, blocks.own(block)) for block in order}
        values = self._values(reads)
        in_window = [windows.get(block, NOWHERE) for block in order]
        first = self._mapped(
            "first-pass", order, self._bound(work.first_pass), order, values.values(), in_window
        )
        seen = self._gathered("seen", first, work.without_slabs, _SHARES[0])
        entering = light_entering(task, windows, seen)
        ambient: list[Any] = [None] * len(entering)
        if task.occlusion is not None:
            parts = self._mapped("opacities", order, work.opacities, first.values())
            columns = ([part] for part in parts.values())
            (found,) = self._mapped("ambient", [()], self._bound(work.ambient), *columns).values()
            ambient = [found] * len(entering)
        again = () if self._kept else entering
        self.counted["points_read"] = sum(reads[block].points for block in [*order, *again])
        around = [blocks.neighbours(block, halo) for block in entering]
        pieces = self._mapped(
            "second-pass",
            entering,
            self._bound(work.second_pass),
            entering,
            [values[block] for block in entering],
            [windows[block] for block in entering],
            entering.values(),
            ambient,
            *([first.get(found.get(at)) for found in around] for at in halo.offsets()),
        )
        del values, seen
        lengths = self._gathered("lengths", pieces, work.lengths, _SHARES[1])
        first.clear()
        self.counted["runs_merged"] = int(sum(many.sum() for many in lengths.values()))
        return self._merged(windows, pieces, lengths)

    def cancel(self) -> None:
        """Cancel what has not been done."""
        self._client.cancel(self._futures, force=True)

    def _values(self, reads: Mapping[Indices, Read]) -> dict[Indices, Any]:
        """Return blocks' points, as futures where they are kept, or what reads them."""
        array = self._volume.chunks
        if array is None:
            return {block: read().copy() for block, read in reads.items()}  # go with the tasks
        if array.lazy is not None:
            futures = self._client.compute(
                [array.lazy[r.box] for r in reads.values()], **self._where
            )
            return dict(zip(reads, futures, strict=True))
        if not self._kept:
            return dict(reads)
        return self._mapped("read", reads, partial(work.read, self._task), reads, reads.values())

    def _array_for_workers(self) -> Any:
        """Return the array as it goes to workers, each of which has shown that it has its files."""
        array = self._volume.chunks
        if array is None:
            return self._volume.array
        digests = array.digests() if array.lazy is None else work.digests_in(array.lazy)
        answers = self._client.run(
            work.wrong_with, digests, workers=self._workers, on_error="return"
        )
        failed = {at: error for at, error in answers.items() if error is not None}
        if failed:
            at, error = next(iter(failed.items()))
            raise InvalidVolumeError(
                f"{len(failed)} of {len(answers)} workers do not read what this process does; "
                f"worker {at}: {error}"
            )
        return array if array.lazy is not None else work.Sent(array, digests, self._token)

    def _bound(self, function: Callable[..., Any]) -> Callable[..., Any]:
        return partial(function, self._task, self._device)

    def _mapped(
        self,
        name: str,
        places: Iterable[tuple[int, ...]],
        function: Callable[..., Any],
        *columns: Iterable[Any],
        priority: int = 0,
    ) -> dict[Any, Future[Any]]:
        """Submit a function of each place's arguments, all of them as one graph."""
        at = list(places)
        futures = self._client.map(
            function,
            *map(list, columns),
            key=[(f"{name}-{self._token}", *place) for place in at],
            retries=_RETRIES,
            pure=False,
            priority=priority,
            **self._where,
        )
        self._futures += futures
        return dict(zip(at, futures, strict=True))

    def _gathered(
        self,
        name: str,
        futures: Mapping[Indices, Future[Any]],
        function: Callable[[Any], Any],
        share: float,
    ) -> dict[Indices, Any]:
        """Return what a function makes of each block's result, as they come."""
        mapped = self._mapped(name, futures, function, futures.values())
        parts = {future: block for block, future in mapped.items()}
        found = {}
        for future in self._completed(parts):
            found[parts[future]] = self._result(future, parts[future])
            self._report(share / len(parts))
        return found

    def _merged(
        self,
        windows: Mapping[Indices, Rectangle],
        pieces: Mapping[Indices, Future[Any]],
        lengths: Mapping[Indices, NDArray[np.int64]],
    ) -> list[Rows]:
        height = self._task.size[1]
        of_rows = np.zeros(height, np.int64)
        for block, many in lengths.items():
            window = windows[block]
            of_rows[window.y0 : window.y1] += many
        ranges = list(balanced(of_rows, RANGES_PER_WORKER * len(self._workers)))
        cut = [
            (block, y0, y1)
            for y0, y1 in ranges
            for block in pieces
            if windows[block].y0 < y1 and windows[block].y1 > y0
        ]
        rows = self._mapped(
            "rows",
            [(*block, y0) for block, y0, _ in cut],
            work.rows,
            [pieces[block] for block, _, _ in cut],
            *zip(*(ends for _, *ends in cut), strict=True),
        )
        of_ranges: dict[int, list[Future[Any]]] = {y0: [] for y0, _ in ranges}
        for block, y0, _ in cut:
            of_ranges[y0].append(rows[(*block, y0)])
        # Merged rows need less memory than pieces: before the next range is cut
        mapped = self._mapped(
            "merge",
            ranges,
            self._bound(work.merge),
            ranges,
            *zip_longest(*of_ranges.values()),
            priority=1,
        )
        merged = {future: y0 for (y0, _), future in mapped.items()}
        found: dict[int, Rows] = {}
        for future in self._completed(merged):
            found[merged[future]] = self._result(future, (merged[future],))
            self._report(_SHARES[2] / len(merged))
        return [found[y0] for y0 in sorted(found)]

    def _completed(self, futures: Collection[Future[Any]]) -> Iterator[Future[Any]]:
        """Yield futures as they are done, as long as there are workers that may do them."""
        if not self._where:
            yield from as_completed(futures)
            return
        pending = set(futures)
        while pending:
            try:
                done, pending = wait(pending, _LOOK_EVERY, return_when="FIRST_COMPLETED")
            except TimeoutError:
                self._require_workers()
                continue
            yield from done

    def _require_workers(self) -> None:
        if not set(self._client.nthreads()) & set(self._workers):
            raise DeviceError(
                f"the workers that may make the VDI are gone: {', '.join(self._workers)}"
            )

    def _value(self, future: Future[Any]) -> Any:
        """Return what a future that was done holds, made again if it was lost meanwhile."""
        while self._where:
            try:
                return future.result(timeout=_LOOK_EVERY)
            except TimeoutError:
                self._require_workers()
        return future.result()

    def _result(self, future: Future[Any], at: tuple[int, ...]) -> Any:
        try:
            return self._value(future)
        except KilledWorker as error:
            raise DeviceError(
                f"{work.named(self._task, at)} could not be made: the workers that were at it "
                f"died, {_RETRIES + 1} in all (of too little memory, mostly): give workers more "
                f"memory, or store the volume in smaller chunks; {error}"
            ) from error
        except (VDIError, CancelledError):
            raise
        except Exception as error:  # of whoever reads: it does not know what for
            raise DeviceError(
                f"{work.named(self._task, at)} could not be made: {type(error).__name__}: {error}"
            ) from error

    def _report(self, share: float) -> None:
        self._done = min(self._done + share, 1.0)
        report(self._progress, self._done)


def _workers_with_device(
    client: Client, device: Any, workers: Sequence[str] | None
) -> dict[str, str]:
    """Return the device of each worker that has one; warn of the others."""
    answers = client.run(
        work.device_name,
        device,
        workers=None if workers is None else list(workers),
        on_error="return",
    )
    if not answers:
        raise NoDeviceError("the cluster has no workers: start some, or wait for them")
    without = {at: answer for at, answer in answers.items() if not isinstance(answer, str)}
    names = "; ".join(f"{at}: {answer}" for at, answer in without.items())
    if len(without) == len(answers):
        raise NoDeviceError(f"no worker of the cluster has an OpenCL device: {names}")
    if without:
        warn_external(
            f"{len(without)} of {len(answers)} workers have no OpenCL device and do nothing: "
            f"{names}"
        )
    return {at: name for at, name in answers.items() if at not in without}
