"""What this package's VTK algorithms share: settings, errors, times, and a volume property."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numpy.typing import ArrayLike

from pyvista_vdi.errors import Cancelled, InvalidVDIError, VDIError
from pyvista_vdi.model.camera import check_window_size
from pyvista_vdi.model.types import CameraLike
from pyvista_vdi.vtk_pipeline import vtk
from pyvista_vdi.vtk_pipeline.filters.properties import check_property, color_function
from pyvista_vdi.vtk_pipeline.filters.view import camera_of

PIPELINE = vtk.vtkStreamingDemandDrivenPipeline
WHOLE_EXTENT = PIPELINE.WHOLE_EXTENT()
UPDATE_TIME_STEP = PIPELINE.UPDATE_TIME_STEP()


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
        self._set: dict[str, Any] = {}  # settings that are not their defaults, by names
        self._error: BaseException | None = None
        self._python_waits = False
        self._before: Any = None

    def SetInputConnection(self, *args: Any) -> None:
        """Set what makes the input, a port of another algorithm (optionally after a number)."""
        super().SetInputConnection(*args)
        # Of an algorithm in Python VTK holds no more than what is written in C++
        self._before = None if args[-1] is None else args[-1].GetProducer()

    def SetInputData(self, data: Any) -> None:
        """Set the input."""
        self.SetInputDataObject(data)

    def Update(self, *args: Any) -> None:
        """Bring the output up to date, and raise what went wrong."""
        self._python_waits = True
        try:
            # What vtkAlgorithm.Update() does, which does not say whether it went well
            port = 0 if self.GetNumberOfOutputPorts() else -1
            done = self.GetExecutive().Update(*(args or (port,)))
        finally:
            self._python_waits = False
        error, self._error = self._error, None
        if error is not None:
            self.Modified()  # so that the next update tries again
            raise error
        if not done:
            raise self.bad_input(
                f"{type(self).__name__} has no input (SetInputDataObject, SetInputConnection), or "
                "what is before it failed: then VTK's output window says why"
            )

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
                said = error if isinstance(error, VDIError) else repr(error)
                window = vtk.vtkOutputWindow.GetInstance()
                window.DisplayErrorText(f"{type(self).__name__}: {said}\n")
            if self.GetNumberOfOutputPorts():
                vtk.vtkDataObject.GetData(outputs, 0).Initialize()
        return 1

    def _execute(self, inputs: Any, outputs: Any) -> None:
        raise NotImplementedError

    def _change(self, name: str, value: Any, default: Any = None) -> None:
        """Keep a setting, and be out of date where it is another value."""
        if self._set.get(name, default) != value:
            self._set[name] = value
            self.Modified()


def accessors(
    name: str,
    what: str,
    default: Any = None,
    check: Callable[..., Any] = lambda value: value,
) -> tuple[Callable[..., None], Callable[..., Any]]:
    """Return an algorithm's Set and Get of a setting; ``check`` returns a value as it is kept."""

    def setter(self: Any, *value: Any, **named: Any) -> None:
        self._change(name, check(*value, **named), default)

    def getter(self: Any) -> Any:
        return self._set.get(name, default)

    return named_pair(name, what, setter, getter)


def named_pair(name: str, what: str, *methods: Callable[..., Any]) -> Any:
    """Return the Set and Get of a setting with names, in ``CamelCase``, and docstrings."""
    for method, verb, says in zip(methods, ("Set", "Get"), ("Set", "Return"), strict=True):
        method.__name__ = f"{verb}{name.title().replace('_', '')}"
        method.__doc__ = f"{says} {what}."
    return methods


def held_by_vtk(*things: Any) -> vtk.vtkCollection:
    """Return what keeps VTK objects alive in C++ alone: what the user hands to an algorithm.

    Before 9.7 VTK frees a node of its table of wrappers twice (``vtkPythonUtil::FindObject``)
    where the attributes of an algorithm that is gone are the last in Python to hold an object
    of a Python class, such as a ``pyvista.VolumeProperty``, that lives on in C++.
    """
    held = vtk.vtkCollection()
    for thing in things:
        held.AddItem(thing)
    return held


class SceneAlgorithm(Algorithm):
    """An algorithm with a view, a device and a volume property, whose changes it follows."""

    SetDevice, GetDevice = accessors("device", "the OpenCL device; ``None`` is the default one")
    SetWindowSize, GetWindowSize = accessors(
        "window_size",
        "the pictures' width and height in pixels, as two numbers or one pair; ``None``: that of a "
        "mapper's first frame for a ``VDISource``, :attr:`VDI.picture_size` for ``VDIToImage``",
        check=lambda *size: (
            None if size == (None,) else check_window_size(size[0] if len(size) == 1 else size)
        ),
    )
    _, GetCamera = accessors("camera", "the view, as it was set; ``None`` where none was")

    _property: vtk.vtkCollection | None = None  # with it alone
    _observed: tuple[vtk.vtkCollection, list[int]] | None = None  # and their observers

    def SetCamera(
        self, camera: CameraLike | None, model_transform: ArrayLike | None = None
    ) -> None:
        """Set the view: a copy is kept.

        Parameters
        ----------
        camera : vtkCamera or pyvista.Camera or Camera or None
            ``None``, the default, is the view of a mapper's first frame for a ``VDISource``, and
            the generating view for ``VDIToImage``.
        model_transform : array_like, shape (4, 4), optional
            Where the volume stands in that view's world: the actor's matrix.

        Raises
        ------
        InvalidCameraError, UnsupportedError
            If it is no camera, or has what the optical model has no place for.
        """
        self._change("camera", None if camera is None else camera_of(camera, model_transform))

    def SetVolumeProperty(self, prop: Any) -> None:
        """Set the volume property; later changes to it make the output out of date.

        Raises
        ------
        UnsupportedError, InvalidArgumentError
            If it cannot be honoured: see ``transfer_function_from_property``. Functions without
            points may be filled later, before the next update.
        """
        if prop is not None:
            check_property(prop, rgba=not prop.GetIndependentComponents())
        if prop is not self.GetVolumeProperty():
            self._property = None if prop is None else held_by_vtk(prop)
            self._observe_property()
            self.Modified()

    def GetVolumeProperty(self) -> Any:
        """Return the volume property."""
        return None if self._property is None else self._property.GetItemAsObject(0)

    def _observe_property(self) -> None:
        """Modify this algorithm whenever the property or one of its functions is modified."""
        if self._observed is not None:
            for i, tag in enumerate(self._observed[1]):
                self._observed[0].GetItemAsObject(i).RemoveObserver(tag)
        self._observed, prop = None, self.GetVolumeProperty()
        if prop is None:
            return
        there = [prop, color_function(prop), prop.GetScalarOpacity()]
        if prop.HasGradientOpacity():
            there.append(prop.GetStoredGradientOpacity())

        def changed(algorithm: SceneAlgorithm) -> None:
            algorithm._observe_property()  # its functions may be others now
            algorithm.Modified()

        self._observed = held_by_vtk(*there), [watch(each, self, changed) for each in there]


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


def announce(
    outputs: Any, window_size: tuple[int, int], scalars: tuple[int, int] = (vtk.VTK_UNSIGNED_INT, 1)
) -> None:
    """Tell the pipeline that an image of one point per pixel will come.

    ``scalars`` are VTK's number of a type, and components: those of the form of a VDI by default.
    VTK's filters of images write as many as they were told into what they allocate.
    """
    width, height = window_size
    information = outputs.GetInformationObject(0)
    information.Set(WHOLE_EXTENT, (0, width - 1, 0, height - 1, 0, 0), 6)
    information.Set(vtk.vtkImageData.SPACING(), (1.0, 1.0, 1.0), 3)
    information.Set(vtk.vtkImageData.ORIGIN(), (0.0, 0.0, 0.0), 3)
    vtk.vtkDataObject.SetPointDataActiveScalarInfo(information, *scalars)


def wanted_time(information: Any) -> float | None:
    """Return the time that is asked of a port; ``None`` if none is."""
    return information.Get(UPDATE_TIME_STEP) if information.Has(UPDATE_TIME_STEP) else None


def ask_for_all(inputs: Any) -> None:
    """Ask for the whole input, whatever part of the output is wanted."""
    information = inputs[0].GetInformationObject(0)
    if information is not None and information.Has(WHOLE_EXTENT):
        whole = information.Get(WHOLE_EXTENT)
        information.Set(PIPELINE.UPDATE_EXTENT(), whole, 6)
