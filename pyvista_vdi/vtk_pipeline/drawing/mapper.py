"""``VDIMapper``: a real VTK volume mapper that draws a raycast VDI.

VTK does not call Python overrides of C++ methods, so nothing here overrides ``Render``. The mapper
is VTK's GPU ray caster on a proxy image of 2 x 2 x 2 voxels that has the VDI's bounds; observers
on its start and end events have the image of exactly this frame raycast and bound as a texture,
and the fragment shader that ``VDIActor`` installs looks it up.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.vtk_pipeline.drawing.driver import Driver
from pyvista_vdi.vtk_pipeline.drawing.refused import OF_MAPPERS, refusing
from pyvista_vdi.vtk_pipeline.drawing.settings import with_settings
from pyvista_vdi.vtk_pipeline.filters.convert import scalars_of
from pyvista_vdi.vtk_pipeline.filters.inputs import Input, SourceInput, input_of, input_of_port
from pyvista_vdi.vtk_pipeline.filters.source import VDISource
from pyvista_vdi.vtk_pipeline.vtk import vtkOpenGLGPUVolumeRayCastMapper

#: Coarsest preview by default: every fourth pixel along each edge. VTK's default is 10.
COARSEST = 4.0


def _on_start(mapper: Any, event: str) -> None:
    driver = mapper.driver
    driver.begin(mapper)
    driver.box.begin(driver.actor)


def _on_end(mapper: Any, event: str) -> None:
    driver = mapper.driver
    driver.end()
    driver.box.end()


#: VTK's numbers of scalar modes, and how ``GetScalarModeAsString`` calls them.
_MODES = ("Default", "UsePointData", "UseCellData", "UsePointFieldData", "UseCellFieldData")
_ACTIVE, _FIELD = (0, 1), 3

#: VTK's number of arrays that are chosen by name, and not by id.
_BY_NAME = 1


def _to_mode(mode: int) -> Callable[[Any], None]:
    def method(self: Any) -> None:
        self.SetScalarMode(mode)

    method.__doc__ = f"Call SetScalarMode({mode})."
    return method


class ArrayChoiceMethods:
    """VTK's methods that choose an array; the VDI is regenerated.

    What they say is kept from the proxy, which has no such array, and told to the source.
    """

    _scalar_mode = 1
    _added: tuple[str | None, str] | None = None  # what the source drew before anything was chosen

    def own_source(self: Any, what: str) -> VDISource:
        """Return the source, which no other mapper draws from now on.

        Raises
        ------
        UnsupportedError
            If there is none; ``what`` says what cannot be changed.
        """
        source = self.GetSource()
        if source is None:
            raise UnsupportedError(
                f"a VDI without its volume keeps {what}: generate another from the volume"
            )
        shown = self.driver.input
        if not shown.alone:
            shown = shown.separate()
            self.driver.set_input(shown)
        return shown.source  # type: ignore[no-any-return]

    def SetScalarMode(self, mode: int) -> None:
        """Draw the array that the volume was added with, or one of its arrays by name or id.

        Parameters
        ----------
        mode : int
            0 or 1: the array it was added with. 3: that of ``SelectScalarArray``.

        Raises
        ------
        UnsupportedError
            For VTK's modes of cell arrays, or if there is only a VDI.
        InvalidArgumentError
            If it is no mode.
        """
        if mode not in range(len(_MODES)):
            raise InvalidArgumentError(f"a scalar mode is a number from 0 to 4; got {mode!r}")
        if mode not in (*_ACTIVE, _FIELD):
            raise UnsupportedError(
                "a VDI is made of values at points, to which those of cells are averaged: choose "
                "an array of either kind by SetScalarModeToUsePointFieldData and "
                "SelectScalarArray(name)"
            )
        self._scalar_mode = mode
        self.choose_array()

    def GetScalarMode(self) -> int:
        """Return VTK's number of the scalar mode."""
        return self._scalar_mode

    def GetScalarModeAsString(self) -> str:
        """Return the scalar mode's name."""
        return _MODES[self._scalar_mode]

    SetScalarModeToDefault, SetScalarModeToUsePointData = _to_mode(0), _to_mode(1)
    SetScalarModeToUseCellData, SetScalarModeToUseCellFieldData = _to_mode(2), _to_mode(4)
    SetScalarModeToUsePointFieldData = _to_mode(_FIELD)

    def SelectScalarArray(self, array: str | int) -> None:
        """Choose an array by name or id, which ``SetScalarModeToUsePointFieldData`` draws."""
        super().SelectScalarArray(array)  # type: ignore[misc]
        self.choose_array()

    def SetArrayName(self, name: str) -> None:
        """Choose an array by name, if it is accessed by name."""
        self._note_array(name)
        self.choose_array()

    def SetArrayId(self, number: int) -> None:
        """Choose an array by id, if it is accessed by id."""
        self._note_array(number)
        self.choose_array()

    def SetArrayAccessMode(self, mode: int) -> None:
        """Choose by id (0) or by name (1)."""
        super().SetArrayAccessMode(mode)  # type: ignore[misc]
        self.choose_array()

    def take_array_choice(self: Any, other: ArrayChoiceMethods) -> None:
        """Copy the choice of an array from another mapper of the same source."""
        theirs: Any = other
        self._note_array(theirs.GetArrayId())
        if theirs.GetArrayName() is not None:
            self._note_array(theirs.GetArrayName())
        super().SetArrayAccessMode(theirs.GetArrayAccessMode())  # type: ignore[misc]
        self._scalar_mode, self._added = other._scalar_mode, other._added

    def _note_array(self: Any, array: str | int) -> None:
        """Set name or id, and not which of them counts, by what VTK 9.4 has as well."""
        mode = self.GetArrayAccessMode()
        super().SelectScalarArray(array)  # type: ignore[misc]
        super().SetArrayAccessMode(mode)  # type: ignore[misc]

    def choose_array(self: Any) -> None:
        """Tell the source what is chosen by now, if that is an array, and there is a source."""
        if self._scalar_mode in _ACTIVE:
            if self._added is not None:
                self.own_source("its scalars").SetScalars(*self._added)
            return
        if self.driver.input is None:
            return
        source = self.own_source("its scalars")
        name = self.GetArrayName() or None
        if self.GetArrayAccessMode() != _BY_NAME:
            name = source.UpdateInput().GetPointData().GetArrayName(self.GetArrayId())
        if name is not None:  # else nothing has been chosen yet
            if source.GetNumberOfInputConnections(0) > 0:
                scalars_of(source.UpdateInput(), name)  # refuses what is not there
            self._added = self._added or (source.GetScalars(), source.GetPreference())
            source.SetScalars(name)

    def SetSampleDistance(self, distance: float) -> None:
        """Set the length of a step, model units, from which the VDI is regenerated.

        Raises
        ------
        InvalidArgumentError
            If it is not positive.
        UnsupportedError
            If there is only a VDI.
        """
        self.own_source("the steps that it was made of").SetSampleDistance(distance)

    def GetSampleDistance(self: Any) -> float:
        """Return the length of a step, model units; VTK's default where none was set."""
        source = self.GetSource()
        set_by_hand = None if source is None else source.GetSampleDistance()
        return super().GetSampleDistance() if set_by_hand is None else set_by_hand  # type: ignore[misc]


@with_settings
@refusing(OF_MAPPERS)
class VDIMapperMethods(ArrayChoiceMethods):
    """What makes a GPU volume mapper draw a VDI; mixed into VTK's and into PyVista's."""

    _driver: Driver | None = None

    def _become_vdi_mapper(self: Any) -> None:
        """Install proxy and observers; to be called once, from ``__init__``."""
        self._driver = Driver()
        super().SetAutoAdjustSampleDistances(0)  # type: ignore[misc]
        super().SetImageSampleDistance(1.0)  # type: ignore[misc]
        self.SetMaximumImageSampleDistance(COARSEST)
        super().SetInputConnection(self._driver.box.GetOutputPort())  # type: ignore[misc]
        # Plain functions: they get the mapper from VTK and hold nothing
        self.AddObserver("VolumeMapperRenderStartEvent", _on_start)
        self.AddObserver("VolumeMapperRenderEndEvent", _on_end)

    @property
    def driver(self) -> Driver:
        """What draws; made with the mapper."""
        assert self._driver is not None
        return self._driver

    def SetInputConnection(self, *args: Any) -> None:
        """Draw what a :class:`VDISource` (or a reader of canonical images) makes."""
        _require_first_port("SetInputConnection", args)
        port = args[-1]
        self._set_input(None if port is None else input_of_port(port))

    def SetInputDataObject(self, *args: Any) -> None:
        """Draw a VDI in its canonical form."""
        _require_first_port("SetInputDataObject", args)
        self.SetInputData(args[-1])

    def SetInputData(self, data: Any) -> None:
        """Draw a VDI, or its canonical image."""
        self._set_input(None if data is None else input_of(data))

    def RemoveInputConnection(self, *args: Any) -> None:
        """Draw nothing any more; RemoveAllInputConnections and RemoveAllInputs do the same."""
        self._set_input(None)

    RemoveAllInputConnections = RemoveAllInputs = RemoveInputConnection

    def GetInputDataObject(self, *args: Any) -> Any:
        """Return the box of the VDI's bounds that VTK is given in its place, and warn.

        Nothing that draws asks for it by this method; what writes the scene for another renderer
        does, and gets an empty box.
        """
        self.driver.say_not_exported()
        return super().GetInputDataObject(*args)  # type: ignore[misc]

    def GetDataSetInput(self) -> Any:
        """Return the volume that the VDI is made of; without one, the box of the VDI's bounds."""
        source = self.GetSource()
        volume = None if source is None else source.GetInputDataObject(0, 0)
        return self.driver.proxy if volume is None else volume

    GetInput = GetDataObjectInput = GetDataSetInput

    def SetVDI(self, vdi: VDI) -> None:
        """Draw this VDI."""
        self._set_input(input_of(vdi))

    def SetSeries(self, series: VDICollection) -> None:
        """Draw a step of this series, the first one at first: see :attr:`VDIActor.time`.

        InvalidArgumentError is raised if it is none.
        """
        self._set_collection(series, "Series", times=True)

    def GetSeries(self) -> VDICollection | None:
        """Return the series of which a step is drawn; ``None`` where there is none."""
        return self._collection(times=True)

    def SetVDISet(self, vdi_set: VDICollection) -> None:
        """Draw a set: of each frame's view the VDI that is nearest, or a blend of several.

        InvalidArgumentError is raised if it is none.
        """
        self._set_collection(vdi_set, "Set", times=False)

    def GetVDISet(self) -> VDICollection | None:
        """Return the set that is drawn; ``None`` where there is none."""
        return self._collection(times=False)

    def _set_collection(self, given: VDICollection, kind: str, *, times: bool) -> None:
        if not isinstance(given, VDICollection) or (given.times is not None) != times:
            method, name = f"Set{'' if times else 'VDI'}{kind}", f"VDI{kind}"
            raise InvalidArgumentError(
                f"{method} takes a {name}; got {type(given).__name__}: {name}(vdis) makes one of "
                "several VDIs"
            )
        self._set_input(input_of(given))

    def _collection(self, *, times: bool) -> VDICollection | None:
        shown = None if self.driver.input is None else self.driver.input.collection
        return shown if shown is not None and (shown.times is not None) == times else None

    def GetVDI(self) -> VDI | None:
        """Return the VDI that was drawn last, or would be drawn; ``None`` before the first."""
        source = self.driver.input
        if source is None:
            return None
        return source.last() if isinstance(source, SourceInput) else source.vdi()

    def GetSource(self) -> VDISource | None:
        """Return the :class:`VDISource` at the input, if it is one."""
        source = self.driver.input
        return source.source if isinstance(source, SourceInput) else None

    def SetDevice(self, device: Any) -> None:
        """Choose the OpenCL device; ``None`` is the default one."""
        self.driver.device = device

    def GetDevice(self) -> Any:
        """Return the device as it was set."""
        return self.driver.device

    # In VTK's GPU mapper SetAutoAdjustSampleDistances would draw VTK's own volume into a smaller
    # framebuffer, so its own switch stays off, and what is called from Python keeps ours.

    def AutoAdjustSampleDistancesOn(self: Any) -> None:
        """Draw previews."""
        self.SetAutoAdjustSampleDistances(True)

    def AutoAdjustSampleDistancesOff(self: Any) -> None:
        """Draw every frame in full."""
        self.SetAutoAdjustSampleDistances(False)

    def ShallowCopy(self: Any, other: Any) -> None:
        """Draw what another :class:`VDIMapper` draws, in the same way; the source is shared.

        Raises
        ------
        InvalidArgumentError
            If it is a mapper of VTK's.
        """
        if not isinstance(other, VDIMapperMethods):
            raise InvalidArgumentError(
                f"a VDIMapper copies a VDIMapper; got {type(other).__name__}: put a VDISource "
                "between its input and this mapper (SetInputConnection)"
            )
        theirs: Any = other
        shown = other.driver.input
        self.driver.set_input(None if shown is None else shown.shared())
        self.take_array_choice(theirs)
        self.SetDevice(theirs.GetDevice())
        self.driver.set(**vars(other.driver.settings))
        self.SetMaximumImageSampleDistance(theirs.GetMaximumImageSampleDistance())
        self.SetCropping(theirs.GetCropping())
        self.SetCroppingRegionPlanes(theirs.GetCroppingRegionPlanes())
        self.SetCroppingRegionFlags(theirs.GetCroppingRegionFlags())
        planes = theirs.GetClippingPlanes()
        self.RemoveAllClippingPlanes()
        for i in range(0 if planes is None else planes.GetNumberOfItems()):
            self.AddClippingPlane(planes.GetItem(i))

    def NewInstance(self) -> VDIMapperMethods:
        """Return another mapper of this class, with nothing to draw yet."""
        return type(self)()

    def _set_input(self: Any, source: Input | None) -> None:
        self.driver.set_input(source)
        self._added = None
        if self.GetSource() is not None:
            self.choose_array()  # which may have been named before
        self.Modified()


def _require_first_port(method: str, args: tuple[Any, ...]) -> None:
    if len(args) > 1 and args[0] != 0:
        raise UnsupportedError(
            f"{method}({args[0]}, ...): a VDIMapper has one input, port 0: give each VDI its own "
            "VDIMapper and VDIActor"
        )


class VDIMapper(VDIMapperMethods, vtkOpenGLGPUVolumeRayCastMapper):
    """The mapper of a :class:`VDIActor`: draws a VDI in a VTK renderer.

    The input is a :class:`VDISource` (``SetInputConnection``), a VDI in its canonical form
    (``SetInputData``) or a :class:`~pyvista_vdi.VDI` (``SetVDI``). Before each frame it brings
    the input up to date and raycasts it from the frame's view, ending rays at opaque geometry;
    an image is kept as long as view, depth and VDI stay the same. Clipping planes
    (``AddClippingPlane``), cropping (``SetCropping`` and its regions) and the opacity multiplier
    act on the next frame without another VDI. What of VTK's mapper a VDI has no place for, such as
    other blending modes, masks and depth images, is refused by the method's name.

    Notes
    -----
    A problem while drawing is reported once as a ``VDIWarning`` and the last good image stays:
    exceptions cannot pass through VTK's renderer. Where nothing is left to draw, nothing is shown.
    """

    def __init__(self) -> None:
        self._become_vdi_mapper()
