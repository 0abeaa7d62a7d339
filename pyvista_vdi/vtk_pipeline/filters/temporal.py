"""The time steps of VTK's and PyVista's sources: read when they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from threading import Lock
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.vtk_pipeline.filters.algorithm import TIME_STEPS
from pyvista_vdi.vtk_pipeline.vtk import vtkCompositeDataSet, vtkImageData


def steps_and_times(source: Any) -> tuple[Sequence[Any], tuple[float, ...]]:
    """Return the steps of a source as a sequence of VTK's data, and their times.

    ``source``: what announces times (``TIME_STEPS``), or is a reader of PyVista with
    ``time_values``. Raises InvalidArgumentError if it has no times.
    """
    of_pyvista = hasattr(source, "time_values")
    if of_pyvista:
        times = tuple(source.time_values)
    else:
        source.UpdateInformation()
        information = source.GetOutputInformation(0)
        times = tuple(information.Get(TIME_STEPS) or ()) if information.Has(TIME_STEPS) else ()

    def read(i: int) -> Any:
        if of_pyvista:
            source.set_active_time_point(i)
            return only_grid(source.read())
        source.UpdateTimeStep(times[i])
        data = only_grid(source.GetOutputDataObject(0))
        step = data.NewInstance()
        step.ShallowCopy(data)  # the output is another one at another time
        return step

    if not times:
        raise InvalidArgumentError(
            f"{type(source).__name__} announces no time steps: use it as one volume, or as one VDI"
        )
    return StepSequence(read, len(times)), times


class StepSequence(Sequence[Any]):
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


def only_grid(data: Any) -> Any:
    """Return the only uniform grid of a composite data set, or its only block; else the whole."""
    if not isinstance(data, vtkCompositeDataSet):
        return data
    blocks, iterator = [], data.NewIterator()
    iterator.InitTraversal()
    while not iterator.IsDoneWithTraversal():
        blocks.append(iterator.GetCurrentDataObject())
        iterator.GoToNextItem()
    found = [block for block in blocks if isinstance(block, vtkImageData)] or blocks
    return found[0] if len(found) == 1 else data
