"""The time steps of VTK's and PyVista's sources: read when they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from threading import Lock
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.vtk_pipeline.filters.algorithm import announced_times
from pyvista_vdi.vtk_pipeline.vtk import vtkCompositeDataSet


def steps_and_times(source: Any) -> tuple[Sequence[Any], tuple[float, ...]]:
    """Return the steps of a source as a sequence of VTK's data, and their times.

    ``source``: what announces times (``TIME_STEPS``), or is a reader of PyVista with
    ``time_values``. Raises InvalidArgumentError if it has no times.
    """
    read: Callable[[int], Any]
    if hasattr(source, "time_values"):
        times, read = tuple(source.time_values), partial(_read_point, source)
    else:
        source.UpdateInformation()
        times = announced_times(source.GetOutputInformation(0))
        read = partial(_update_to, source, times)
    if not times:
        raise InvalidArgumentError(
            f"{type(source).__name__} announces no time steps, which a series is made of: use what "
            "it gives as one volume, or one VDI"
        )
    return Steps(read, len(times)), times


class Steps(Sequence[Any]):
    """What a function returns for each step; called by one thread at a time: there is one source.

    ``read``: gets the step's index. ``n``: how many there are.
    """

    def __init__(self, read: Callable[[int], Any], n: int) -> None:
        self._read, self._n = read, n
        self._lock = Lock()

    def __len__(self) -> int:
        return self._n

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [self[i] for i in range(self._n)[index]]
        with self._lock:
            return self._read(range(self._n)[index])


def _read_point(reader: Any, i: int) -> Any:
    reader.set_active_time_point(i)
    return _only_block(reader.read())


def _update_to(algorithm: Any, times: Sequence[float], i: int) -> Any:
    algorithm.UpdateTimeStep(times[i])
    data = _only_block(algorithm.GetOutputDataObject(0))
    step = data.NewInstance()
    step.ShallowCopy(data)  # the output is another one at another time
    return step


def _only_block(data: Any) -> Any:
    """Return the only block of a composite data set, as files with times often have; else it."""
    if not isinstance(data, vtkCompositeDataSet):
        return data
    blocks, iterator = [], data.NewIterator()
    iterator.InitTraversal()
    while not iterator.IsDoneWithTraversal():
        blocks.append(iterator.GetCurrentDataObject())
        iterator.GoToNextItem()
    return blocks[0] if len(blocks) == 1 else data
