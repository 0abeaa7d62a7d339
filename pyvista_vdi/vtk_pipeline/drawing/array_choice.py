"""Which of a volume's arrays is drawn, and at which steps, chosen as of VTK's volume mappers."""

from __future__ import annotations

from typing import Any, NoReturn

from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.vtk_pipeline.filters.convert import scalars_of
from pyvista_vdi.vtk_pipeline.filters.source import VDISource

#: VTK's numbers of scalar modes, and how ``GetScalarModeAsString`` calls them.
_MODES = ("Default", "UsePointData", "UseCellData", "UsePointFieldData", "UseCellFieldData")
_ACTIVE, _FIELD = (0, 1), 3

#: VTK's number of arrays that are chosen by name, and not by id.
_BY_NAME = 1


class ArrayChoiceMethods:
    """VTK's methods that choose an array; the VDI is made anew of it.

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
            _refuse_cells()
        self._scalar_mode = mode
        self.choose_array()

    def GetScalarMode(self) -> int:
        """Return VTK's number of the scalar mode."""
        return self._scalar_mode

    def GetScalarModeAsString(self) -> str:
        """Return the scalar mode's name."""
        return _MODES[self._scalar_mode]

    def SetScalarModeToDefault(self) -> None:
        """Draw the array that the volume was added with."""
        self.SetScalarMode(0)

    def SetScalarModeToUsePointData(self) -> None:
        """Draw the array that the volume was added with."""
        self.SetScalarMode(1)

    def SetScalarModeToUseCellData(self) -> NoReturn:
        """Refuse."""
        _refuse_cells()

    def SetScalarModeToUsePointFieldData(self) -> None:
        """Draw the array of ``SelectScalarArray``."""
        self.SetScalarMode(_FIELD)

    def SetScalarModeToUseCellFieldData(self) -> NoReturn:
        """Refuse."""
        _refuse_cells()

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
        """Set the length of a step, model units, of which the VDI is made anew.

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


def _refuse_cells() -> NoReturn:
    raise UnsupportedError(
        "a VDI is made of values at points, to which those of cells are averaged: choose an array "
        "of either kind by SetScalarModeToUsePointFieldData and SelectScalarArray(name)"
    )
