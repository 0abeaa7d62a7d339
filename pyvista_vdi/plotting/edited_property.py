"""An actor's volume property, of which changes can be taken back; nodes of its functions."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pyvista as pv
import pyvista.plotting  # whole: pv.LookupTable is missing while another thread imports it
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.vtk_pipeline.vtk import vtkColorTransferFunction, weakly

#: A function of more nodes is edited by fewer points, no farther from it than this.
_MOST_NODES, _NEAR = 32, 0.01

Rows = NDArray[np.float64]


class EditedProperty:
    """The functions of an actor's property, and what they were before.

    Parameters
    ----------
    actor : vtkVolume
        Held weakly.
    """

    def __init__(self, actor: Any) -> None:
        self.actor = weakly(actor)
        self.look: Any = ""  # the colour map, or the preset, that was applied last
        self._done: list[dict[str, Any]] = []
        self._undone: list[dict[str, Any]] = []
        self.first = self.state()

    def functions(self) -> tuple[Any, Any]:
        """Return the property's functions, of opacity and of colour."""
        actor = self.actor()
        if actor is None:
            raise InvalidArgumentError("the actor is gone, and its transfer function with it")
        prop = actor.GetProperty()
        if prop.GetColorChannels() == 1:  # grey: the same as RGB
            colored = vtkColorTransferFunction()
            fill(colored, rows_of(prop.GetGrayTransferFunction())[:, [0, 1, 1, 1, 2, 3]])
            prop.SetColor(colored)
        return prop.GetScalarOpacity(), prop.GetRGBTransferFunction()

    def versions(self) -> list[Any]:
        """Return what differs once anybody has changed a function."""
        return [(each, each.GetMTime()) for each in self.functions()]

    def state(self) -> dict[str, Any]:
        """Return the nodes of both functions, as :meth:`write` takes them."""
        opacity, colors = map(rows_of, self.functions())
        return {"opacity": opacity, "colors": colors, "look": self.look}

    def write(
        self, opacity: Rows | None = None, colors: Rows | None = None, look: Any = None
    ) -> None:
        """Put nodes into the functions that they are given for."""
        for function, rows in zip(self.functions(), (opacity, colors), strict=True):
            if rows is not None:
                fill(function, rows)
        self.look = self.look if look is None else look

    def settle(self, before: dict[str, Any]) -> bool:
        """Remember the state before a change, and return whether there was one."""
        after = self.state()
        if all(np.array_equal(before[name], after[name]) for name in ("opacity", "colors")):
            return False
        self._done.append(before)
        self._undone.clear()
        self._tell_table()
        return True

    def undo(self) -> None:
        """Take the last change back, if there is one."""
        self._swap(self._done, self._undone)

    def redo(self) -> None:
        """Make the change again that was taken back last."""
        self._swap(self._undone, self._done)

    def _swap(self, taken: list[dict[str, Any]], kept: list[dict[str, Any]]) -> None:
        if taken:
            kept.append(self.state())
            self.write(**taken.pop())
            self._tell_table()

    def _tell_table(self) -> None:
        """Write the functions into the actor's lookup table, which scalar bars show."""
        table = getattr(self.actor().GetMapper(), "lookup_table", None)
        if not isinstance(table, pv.LookupTable):
            return
        opacity, color = self.functions()
        low, high = color.GetRange()
        at = np.linspace(low, high, table.n_values)
        logarithmic = table.log_scale and low > 0
        shown = np.geomspace(low, high, table.n_values) if logarithmic else at
        rgba = [[*color.GetColor(s), opacity.GetValue(x)] for s, x in zip(shown, at, strict=True)]
        table.scalar_range = (low, high)
        table.values = np.rint(255 * np.clip(rgba, 0, 1)).astype(np.uint8)
        # PyVista has made functions of the table's bytes
        self.actor().GetProperty().SetScalarOpacity(opacity)
        self.actor().GetProperty().SetColor(color)


def windowed(state: dict[str, Any], window: float, level: float) -> dict[str, Any]:
    """Return a state's nodes, moved and stretched so that the colours have this window."""
    if not (np.isfinite([window, level]).all() and window > 0):
        raise InvalidArgumentError(
            f"window must be a positive width of values and level a value, finite; got {window!r} "
            f"and {level!r}"
        )
    low, high = state["colors"][[0, -1], 0]
    scale = window / (high - low) if high > low else 1.0
    moved = {name: state[name].copy() for name in ("opacity", "colors")}
    for rows in moved.values():
        rows[:, 0] = level + (rows[:, 0] - (low + high) / 2) * scale
    return moved


def rows_of(function: Any) -> Rows:
    """Return the nodes of an opacity function, (n, 4), or of a colour function, (n, 6)."""
    rows = np.empty((function.GetSize(), 6 if function.IsA("vtkColorTransferFunction") else 4))
    for k in range(len(rows)):
        function.GetNodeValue(k, rows[k])
    return rows


def fill(function: Any, rows: Rows) -> None:
    """Replace a function's nodes."""
    function.RemoveAllPoints()
    add = getattr(function, "AddRGBPoint", None) or function.AddPoint
    for row in rows.tolist():
        add(*row)


def simplified(rows: Rows) -> Rows:
    """Return as few of many nodes as keep the curve (Douglas and Peucker)."""
    if len(rows) <= _MOST_NODES:
        return rows
    kept = {0, len(rows) - 1}
    while True:
        found = set()
        for first, last in pairwise(sorted(kept)):
            inner = rows[first : last + 1]
            line = np.interp(inner[:, 0], inner[[0, -1], 0], inner[[0, -1], 1])
            off = np.abs(inner[:, 1] - line)
            if off.max() > _NEAR:
                found.add(first + int(off.argmax()))
        if not found:
            return rows[sorted(kept)]
        kept |= found
