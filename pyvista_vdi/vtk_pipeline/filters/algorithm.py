"""What this package's VTK algorithms share: how they say what went wrong, and what they ask for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from pyvista_vdi.errors import Cancelled, InvalidVDIError, VDIError
from pyvista_vdi.vtk_pipeline import vtk

TIME_STEPS = vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS()
TIME_RANGE = vtk.vtkStreamingDemandDrivenPipeline.TIME_RANGE()
UPDATE_TIME_STEP = vtk.vtkStreamingDemandDrivenPipeline.UPDATE_TIME_STEP()


class Algorithm(vtk.VTKPythonAlgorithmBase):
    """An algorithm whose errors reach whoever asked for the update.

    Python's ``Update`` raises them; an update that VTK asks for writes them to VTK's output window
    and gives an empty output. ``picture_size`` is that of the VDI that it gives, as it
    announces it, or ``None``: VTK's information has no place for it.
    """

    picture_size: tuple[int, int] | None = None
    #: What an input is that is not there.
    bad_input: type[VDIError] = InvalidVDIError

    def __init__(self, **ports: Any) -> None:
        super().__init__(**ports)
        self._error: BaseException | None = None
        self._python_waits = False
        self._before: Any = None

    def SetInputDataObject(self, *args: Any) -> None:
        """Set the input (optionally after a port number, 0)."""
        for each in args:
            vtk.require_this_build(type(each))
        super().SetInputDataObject(*args)
        self._before = None

    def SetInputConnection(self, *args: Any) -> None:
        """Set what makes the input, a port of another algorithm (optionally after a number)."""
        for each in args:
            vtk.require_this_build(type(each))
        super().SetInputConnection(*args)
        # Of an algorithm in Python VTK holds no more than what is written in C++
        self._before = None if args[-1] is None else args[-1].GetProducer()

    def Update(self, *args: Any) -> None:
        """Bring the output up to date, and raise what went wrong."""
        if not self._updated(*args):
            failed = f"what is before {type(self).__name__} failed: VTK's output window says why"
            connected = self.GetNumberOfInputConnections(0) > 0
            raise self.bad_input(failed if connected else self._no_input())

    def _no_input(self) -> str:
        return f"{type(self).__name__} has no input: call SetInputDataObject or SetInputConnection"

    def UpdateTimeStep(self, time: float, *args: Any) -> None:
        """Bring the output up to date as of a time, and raise what went wrong.

        The time stays asked for until another one is. Pieces and ghosts, which VTK's method takes
        as well, make no difference: images come whole.
        """
        self.UpdateInformation()
        self.GetOutputInformation(0).Set(UPDATE_TIME_STEP, float(time))
        self.Update()

    def _updated(self, *args: Any) -> bool:
        """Update, and return whether what is before this algorithm went well."""
        self._python_waits = True
        try:
            if args:
                super().Update(*args)
                done = True
            else:  # what vtkAlgorithm.Update() does, which does not say whether it went well
                done = self.GetExecutive().Update(0 if self.GetNumberOfOutputPorts() else -1)
        finally:
            self._python_waits = False
        error, self._error = self._error, None
        if error is not None:
            self.Modified()  # so that the next update tries again
            raise error
        return bool(done)

    def RequestUpdateExtent(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Ask for the whole input, whatever part of the output is wanted."""
        if self.GetNumberOfInputPorts():
            ask_for_all(inputs)
        return 1

    def RequestData(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Execute; VTK's request."""
        self._error = None
        try:
            self._execute(inputs, outputs)
        except BaseException as error:  # VTK would print it and go on (or exit, on Ctrl-C)
            self._error = error
            if not self._python_waits and not isinstance(error, Cancelled):
                name = type(self).__name__
                known = isinstance(error, VDIError)
                said = error if known else f"{type(error).__name__}: {error}".rstrip(": ")
                vtk.vtkOutputWindow.GetInstance().DisplayErrorText(f"{name}: {said}\n")
            if self.GetNumberOfOutputPorts():
                vtk.vtkDataObject.GetData(outputs, 0).Initialize()
        return 1

    def _execute(self, inputs: Any, outputs: Any) -> None:
        raise NotImplementedError

    def _change(self, attribute: str, value: Any) -> None:
        if getattr(self, attribute) != value:
            setattr(self, attribute, value)
            self.Modified()


class Held:
    """A VTK object that an attribute keeps alive in C++ alone: what the user hands to an algorithm.

    Before 9.7 VTK frees a node of its table of wrappers twice (``vtkPythonUtil::FindObject``)
    where the attributes of an algorithm that is gone are the last in Python to hold an object
    of a Python class, such as a ``pyvista.VolumeProperty``, that lives on in C++.
    """

    def __init__(self, thing: Any) -> None:
        self._holder = vtk.vtkCollection()
        self._holder.AddItem(thing)

    def get(self) -> Any:
        """Return the object."""
        return self._holder.GetItemAsObject(0)


def watch(
    thing: Any, algorithm: Any, changed: Callable[[Any], None], event: str = "ModifiedEvent"
) -> int:
    """Call ``changed(algorithm)`` when a VTK object is modified, which does not keep the algorithm.

    Returns the observer's tag.
    """
    weak = vtk.weakly(algorithm)

    def modified(*_: Any) -> None:
        found = weak()
        if found is not None:
            changed(found)

    return int(thing.AddObserver(event, modified))


def whole_extent(information: Any) -> tuple[int, ...] | None:
    """Return the extent that a port announces, if it does."""
    key = vtk.vtkStreamingDemandDrivenPipeline.WHOLE_EXTENT()
    return information.Get(key) if information is not None and information.Has(key) else None


def announce(
    outputs: Any, window_size: tuple[int, int], scalars: tuple[int, int] = (vtk.VTK_UNSIGNED_INT, 1)
) -> None:
    """Tell the pipeline that an image of one point per pixel will come.

    ``scalars`` are VTK's number of a type, and components: those of the form of a VDI by default.
    VTK's filters of images write as many as they were told into what they allocate.
    """
    width, height = window_size
    information = outputs.GetInformationObject(0)
    extent = (0, width - 1, 0, height - 1, 0, 0)
    information.Set(vtk.vtkStreamingDemandDrivenPipeline.WHOLE_EXTENT(), extent, 6)
    information.Set(vtk.vtkImageData.SPACING(), (1.0, 1.0, 1.0), 3)
    information.Set(vtk.vtkImageData.ORIGIN(), (0.0, 0.0, 0.0), 3)
    vtk.vtkDataObject.SetPointDataActiveScalarInfo(information, *scalars)


def announce_times(outputs: Any, times: Sequence[float]) -> None:
    """Tell the pipeline the times of the steps; that there are none, if so."""
    information = outputs.GetInformationObject(0)
    if times:
        information.Set(TIME_STEPS, times, len(times))
        information.Set(TIME_RANGE, (times[0], times[-1]), 2)
    else:
        information.Remove(TIME_STEPS)
        information.Remove(TIME_RANGE)


def announced_times(information: Any) -> tuple[float, ...]:
    """Return the times of the steps that a port announces."""
    return tuple(information.Get(TIME_STEPS) or ()) if information.Has(TIME_STEPS) else ()


def wanted_time(information: Any) -> float | None:
    """Return the time that is asked of a port; ``None`` if none is."""
    return information.Get(UPDATE_TIME_STEP) if information.Has(UPDATE_TIME_STEP) else None


def is_aborted(algorithm: Any) -> bool:
    """Whether an algorithm or one before it was told to stop, which leaves values out."""
    there = [algorithm]
    for each in there:
        for port in range(each.GetNumberOfInputPorts()):
            for i in range(each.GetNumberOfInputConnections(port)):
                before = each.GetInputAlgorithm(port, i)
                if before not in there:
                    there.append(before)
    return any(each.GetAbortExecute() for each in there)


def ask_for_all(inputs: Any) -> None:
    """Ask for the whole input, whatever part of the output is wanted."""
    information = inputs[0].GetInformationObject(0)
    extent = whole_extent(information)
    if extent is not None:
        information.Set(vtk.vtkStreamingDemandDrivenPipeline.UPDATE_EXTENT(), extent, 6)
