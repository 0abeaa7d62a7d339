"""What this package's VTK algorithms share: how they say what went wrong."""

from __future__ import annotations

from typing import Any

from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonCore import vtkOutputWindow
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkImageData
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline


class Algorithm(VTKPythonAlgorithmBase):
    """An algorithm whose errors reach whoever asked for the update.

    Python's ``Update`` raises them; an update that VTK asks for writes them to VTK's output window
    and gives an empty output.
    """

    def __init__(self, **ports: Any) -> None:
        super().__init__(**ports)
        self._error: BaseException | None = None
        self._python_waits = False

    def Update(self, *args: Any) -> Any:
        """Bring the output up to date, and raise what went wrong."""
        self._python_waits = True
        try:
            result = super().Update(*args)
        finally:
            self._python_waits = False
        error, self._error = self._error, None
        if error is not None:
            self.Modified()  # so that the next update tries again
            raise error
        return result

    def RequestData(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Execute; VTK's request."""
        self._error = None
        try:
            self._execute(inputs, outputs)
        except BaseException as error:  # VTK would print it and go on (or exit, on Ctrl-C)
            self._error = error
            if not self._python_waits:
                name = type(self).__name__
                vtkOutputWindow.GetInstance().DisplayErrorText(f"{name}: {error}\n")
            if self.GetNumberOfOutputPorts():
                vtkDataObject.GetData(outputs, 0).Initialize()
        return 1

    def _execute(self, inputs: Any, outputs: Any) -> None:
        raise NotImplementedError

    def _change(self, attribute: str, value: Any) -> None:
        if getattr(self, attribute) != value:
            setattr(self, attribute, value)
            self.Modified()


def announce(outputs: Any, window_size: tuple[int, int]) -> None:
    """Tell the pipeline that an image of one point per pixel will come."""
    width, height = window_size
    information = outputs.GetInformationObject(0)
    executive = vtkStreamingDemandDrivenPipeline
    information.Set(executive.WHOLE_EXTENT(), (0, width - 1, 0, height - 1, 0, 0), 6)
    information.Set(vtkImageData.SPACING(), (1.0, 1.0, 1.0), 3)
    information.Set(vtkImageData.ORIGIN(), (0.0, 0.0, 0.0), 3)


def ask_for_all(inputs: Any) -> None:
    """Ask for the whole input, whatever part of the output is wanted."""
    information = inputs[0].GetInformationObject(0)
    executive = vtkStreamingDemandDrivenPipeline
    if information is not None and information.Has(executive.WHOLE_EXTENT()):
        information.Set(executive.UPDATE_EXTENT(), information.Get(executive.WHOLE_EXTENT()), 6)
