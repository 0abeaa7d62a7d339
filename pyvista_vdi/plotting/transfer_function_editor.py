"""The editor of a transfer function: a chart over a plotter, and what mouse and keys do in it."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pyvista as pv
import pyvista.plotting  # whole: pv.Plotter is missing while another thread imports it
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.presets import presets
from pyvista_vdi.model.types import ColorMapLike
from pyvista_vdi.plotting.classify import Looks
from pyvista_vdi.plotting.edited_property import (
    EditedProperty,
    Rows,
    fill,
    rows_of,
    simplified,
    windowed,
)
from pyvista_vdi.vtk_pipeline.vtk import vtkPiecewiseFunction

#: Pixels from a point, or from the curve, within which the mouse meets it.
_REACH = 8

#: Shares of the axis that points keep between them: VTK's textures resolve no closer nodes.
_APART = 1e-3

#: Opacity at the upper edge, so that points at 1 are seen whole.
_TOP = 1.1

#: Of observers: before PyVista's and the interactor's style (0), and before other widgets (0.5).
_PRIORITY = 1.0

_EVENTS = (
    *("LeftButtonPressEvent", "LeftButtonDoubleClickEvent", "LeftButtonReleaseEvent"),
    *("RightButtonPressEvent", "RightButtonReleaseEvent", "MouseMoveEvent"),
    *("KeyPressEvent", "CharEvent"),
)

_ARROWS = {"Left": (-1, 0), "Right": (1, 0), "Up": (0, 1), "Down": (0, -1)}


class TransferFunctionEditor:
    """An editor over a plotter; what it shows is the actor's volume property, and nothing else.

    ``plotter.add_transfer_function_editor(actor)`` makes it, with the arguments of
    :meth:`AddTransferFunctionEditor.__call__`.
    """

    def __init__(
        self,
        plotter: Any,
        renderer: Any,
        actor: Any,
        histogram: tuple[Rows, Rows] | None,
        cmaps: Sequence[ColorMapLike],
        color: Any,
        **place: Sequence[float],
    ) -> None:
        self._plotter, self._renderer = weakref.ref(plotter), weakref.ref(renderer)
        self._edited, self._cmaps = EditedProperty(actor), list(cmaps)
        # What moves by the mouse: a point, the window or nothing; where it was pressed; the state
        self._drag: tuple[str, NDArray[Any], dict[str, Any]] | None = None
        self._current = -1  # the point that keys are for
        self._chart = pv.Chart2D(**place, x_label="", y_label="opacity", grid=False)
        if histogram is None:
            x = np.concatenate([rows_of(each)[:, 0] for each in self._edited.functions()])
            self._range = float(x.min()), float(x.max())
        else:
            counts, edges = histogram
            self._range = float(edges[0]), float(edges[-1])
            heights = np.log1p(counts) / max(np.log1p(counts).max(), 1e-9)
            self._chart.area(np.repeat(edges, 2)[1:-1], np.repeat(heights, 2), color="grey")
        # Here, because cvista has none of them, and all but the editor does without
        from pyvista_vdi.vtk_pipeline.vtk import (
            vtkCompositeControlPointsItem,
            vtkCompositeTransferFunctionItem,
        )

        self._fill = vtkCompositeTransferFunctionItem()
        self._handles, self._shown = vtkCompositeControlPointsItem(), vtkPiecewiseFunction()
        self._handles.SetOpacityFunction(self._shown)
        self._handles.SetPointsFunction(self._handles.OpacityPointsFunction)
        self._paint(
            pv.Color(color, default_color=plotter._theme.font.color), renderer.background_color
        )
        self._chart.AddPlot(self._fill)
        self._chart.AddPlot(self._handles)
        renderer.add_chart(self._chart)
        self._read()
        observe = plotter.iren.interactor.AddObserver
        self._tags = {event: observe(event, self._on_event, _PRIORITY) for event in _EVENTS}
        self._start = renderer.AddObserver("StartEvent", self._follow)

    @property
    def actor(self) -> Any:
        """The actor whose property is edited; ``None`` where it is gone."""
        return self._edited.actor()

    @property
    def renderer(self) -> Any:
        """The renderer that shows the editor; ``None`` where it was taken away."""
        return self._renderer() if self._tags else None

    @property
    def points(self) -> Rows:
        """Value and opacity of each point, values rising, (n, 2); others may be set."""
        return self._points[:, :2].copy()

    @points.setter
    def points(self, points: ArrayLike) -> None:
        rows = np.asarray(points, dtype=float)
        if rows.ndim != 2 or rows.shape[1] != 2 or not len(rows) or not np.isfinite(rows).all():
            raise InvalidArgumentError(
                f"points must be pairs of a value and an opacity, finite; got {points!r}"
            )
        if (np.diff(rows[:, 0]) <= 0).any() or rows[:, 1].min() < 0 or rows[:, 1].max() > 1:
            raise InvalidArgumentError(
                f"the points' values must rise, and their opacities be 0 to 1; got {points!r}"
            )
        self._change(points=np.column_stack([rows, np.tile([0.5, 0.0], (len(rows), 1))]))

    @property
    def window(self) -> float:
        """Width of the values over which colours change; setting it stretches opacities, too."""
        low, high = self._edited.functions()[1].GetRange()
        return float(high - low)

    @window.setter
    def window(self, window: float) -> None:
        self._change(**windowed(self._edited.state(), window, self.level))

    @property
    def level(self) -> float:
        """Middle of the values over which colours change; setting it moves opacities, too."""
        return float(np.mean(self._edited.functions()[1].GetRange()))

    @level.setter
    def level(self, level: float) -> None:
        self._change(**windowed(self._edited.state(), self.window, level))

    def apply_cmap(self, cmap: ColorMapLike) -> None:
        """Colour the window by a colour map: a name, or what else ``add_volume`` takes."""
        table = Looks(cmap=cmap, clim=self._edited.functions()[1].GetRange()).lookup_table(
            np.empty(0)
        )
        self._change(colors=rows_of(table.to_color_tf()), look=cmap)

    def apply_preset(self, name: str) -> None:
        """Take colours, opacities and range of one of :data:`pyvista_vdi.presets`."""
        clim = presets[name]["clim"]  # MRI's have none: they are of the values' range
        table = Looks(cmap=name, clim=self._range if clim is None else clim).lookup_table(
            np.empty(0)
        )
        opacity, colors = rows_of(table.to_opacity_tf()), rows_of(table.to_color_tf())
        self._change(opacity=opacity, colors=colors, look=name)

    def undo(self) -> None:
        """Take the last change back, if there is one."""
        self._edited.undo()
        self._read()
        self._render()

    def redo(self) -> None:
        """Make the change again that was taken back last."""
        self._edited.redo()
        self._read()
        self._render()

    def reset(self) -> None:
        """Return to what was there when the editor was added; :meth:`undo` takes it back."""
        self._change(**self._edited.first)

    def remove(self) -> None:
        """Take the editor away; the actor stays as it is."""
        plotter, renderer = self._plotter(), self.renderer
        if plotter is not None and plotter.iren is not None:
            for tag in self._tags.values():
                plotter.iren.interactor.RemoveObserver(tag)
        self._tags, self._drag = {}, None
        if renderer is not None:
            renderer.RemoveObserver(self._start)
            if any(chart is self._chart for chart in renderer.get_charts()):
                renderer.remove_chart(self._chart)

    def _paint(self, color: pv.Color, behind: pv.Color) -> None:
        """Choose how the chart and its items look."""
        chart, points = self._chart, self._handles
        chart.background_color = (*behind.float_rgb, 0.6)
        chart.border_color = (*color.float_rgb, 0.3)
        chart.legend_visible = False
        chart.y_axis.range = (0, _TOP)
        chart.y_axis.tick_locations = (0, 0.5, 1)
        for axis in (chart.x_axis, chart.y_axis):
            axis.pen.color = color
            axis.tick_label_size = axis.label_size = 11
            axis.GetLabelProperties().SetColor(color.float_rgb)
            axis.GetTitleProperties().SetColor(color.float_rgb)
        chart.GetTitleProperties().SetColor(color.float_rgb)
        chart.GetTitleProperties().SetFontSize(12)
        for pen in (self._fill.GetPolyLinePen(), points.GetPen()):
            pen.SetWidth(1.5)
            pen.SetColor(*color.int_rgb)
        self._fill.SetMaskAboveCurve(True)
        points.SetScreenPointRadius(5)

    def _present(self) -> bool:
        """Whether the renderer still shows the actor."""
        actor, renderer = self._edited.actor(), self.renderer
        return actor is not None and renderer is not None and bool(renderer.HasViewProp(actor))

    def _follow(self, *_: Any) -> None:
        """Show, before a frame, what has become of the property, and go with the actor."""
        if not self._present():
            self.remove()
        elif self._seen != self._edited.versions():
            self._edited.look = ""
            self._read()

    def _read(self, points: Rows | None = None) -> None:
        """Show the property's functions, by these points, or those that come close to it."""
        opacity, colors = self._edited.functions()
        if points is None:
            points, self._current = simplified(rows_of(opacity)), -1
        self._points = points
        fill(self._shown, points)
        self._fill.SetOpacityFunction(opacity)
        self._fill.SetColorTransferFunction(colors)
        self._handles.SetColorTransferFunction(colors)
        self._handles.SetCurrentPoint(self._current)
        if self._drag is None:  # under the mouse the axis stays
            ends = (*self._range, points[0, 0], points[-1, 0])
            low, high = min(ends), max(ends)
            self._axis = (low, high) if low < high else (low - 0.5, low + 0.5)
            self._chart.x_axis.range = self._axis
            self._handles.SetUserBounds(*self._axis, 0, 1)
        named = (
            f"{self._edited.look}   "
            if isinstance(self._edited.look, str) and self._edited.look
            else ""
        )
        self._chart.title = f"{named}window {self.window:.4g}   level {self.level:.4g}"
        self._seen = self._edited.versions()

    def _write(
        self,
        opacity: Rows | None = None,
        colors: Rows | None = None,
        look: Any = None,
        points: Rows | None = None,
    ) -> None:
        """Put nodes into the property's functions."""
        self._edited.write(opacity if points is None else points, colors, look)
        self._read(points)

    def _change(self, make: Callable[..., object] | None = None, *args: Any, **nodes: Any) -> None:
        """Make a change that :meth:`undo` takes back, and show it."""
        before = self._edited.state()
        (make or self._write)(*args, **nodes)
        self._settle(before)

    def _settle(self, before: dict[str, Any]) -> None:
        """Remember what was before, if it was another, and show what is."""
        if self._edited.settle(before):
            self._read(self._points if self._current >= 0 else None)
        self._render()

    def _render(self) -> None:
        plotter = self._plotter()
        if plotter is not None and not plotter._first_time:
            plotter.render()

    def _put(self, index: int, value: float, opacity: float) -> None:
        """Move a point, not past its neighbours."""
        points, gap = self._points.copy(), _APART * (self._axis[1] - self._axis[0])
        low = points[index - 1, 0] + gap if index else self._axis[0]
        high = points[index + 1, 0] - gap if index + 1 < len(points) else self._axis[1]
        points[index, :2] = np.clip(value, low, max(low, high)), np.clip(opacity, 0, 1)
        self._write(points=points)

    def _add(self, value: float, opacity: float) -> None:
        """Add a point, or move the one that is at this value, and make it the current one."""
        points, value = self._points, float(np.clip(value, *self._axis))
        away = np.abs(points[:, 0] - value)
        if away.min() < _APART * (self._axis[1] - self._axis[0]):
            self._current = int(away.argmin())
            self._put(self._current, value, opacity)
        else:
            self._current = int(np.searchsorted(points[:, 0], value))
            row = [value, np.clip(opacity, 0, 1), 0.5, 0.0]
            self._write(points=np.insert(points, self._current, row, axis=0))

    def _add_beside(self) -> None:
        """Add a point halfway between the current one, or the first, and the next."""
        k = max(0, min(self._current, len(self._points) - 2))
        self._add(*self._points[k : k + 2, :2].mean(axis=0))

    def _delete(self, index: int) -> None:
        if index >= 0 and len(self._points) > 1:
            self._current = -1
            self._write(points=np.delete(self._points, index, axis=0))

    def _choose(self, index: int) -> None:
        self._current = index
        self._read(self._points)

    def _step(self, across: int, up: int) -> None:
        """Move the current point by a hundredth; without one, level or window."""
        one = (self._axis[1] - self._axis[0]) / 100
        if self._current >= 0:
            value, opacity = self._points[self._current, :2]
            self._put(self._current, value + across * one, opacity + up / 100)
        else:
            window, level = self.window * 1.02**up, self.level + across * one
            self._write(**windowed(self._edited.state(), window or 1.0, level))

    def _on_event(self, interactor: Any, event: str) -> None:
        """Take an event that is the editor's, so that nothing else of the plotter gets it."""
        if not self._present():
            return  # the next frame takes the editor away
        x, y = interactor.GetEventPosition()
        at = np.subtract((x, y), self.renderer.GetOrigin())
        left, bottom, width, height = (self._chart.GetSize()[i] for i in range(4))
        over = (
            self._chart.visible
            and self.renderer.IsInViewport(x, y)
            and left <= at[0] <= left + width
            and bottom <= at[1] <= bottom + height
        )
        taken = self._drag is not None
        if event in ("KeyPressEvent", "CharEvent"):
            action = self._action(interactor.GetKeySym() or "") if over else None
            taken = action is not None
            if action is not None and event == "KeyPressEvent":
                action()
        elif event == "MouseMoveEvent":
            if self._drag is not None:
                self._dragged(at, *self._drag)
                self._render()
        elif event.endswith("ReleaseEvent"):
            if self._drag is not None:
                before, self._drag = self._drag[2], None
                self._read(self._points)
                interactor.GetRenderWindow().SetDesiredUpdateRate(interactor.GetStillUpdateRate())
                self._settle(before)
        elif over:
            taken = True
            self._pressed(interactor, event, at)
            interactor.GetRenderWindow().SetDesiredUpdateRate(interactor.GetDesiredUpdateRate())
            self._render()
        if taken and event in self._tags:
            interactor.GetCommand(self._tags[event]).AbortFlagOn()

    def _pressed(self, interactor: Any, event: str, at: NDArray[Any]) -> None:
        """Begin to drag a point, one that is added on the curve, or window and level."""
        before, what, (value, opacity) = self._edited.state(), "point", self._at(at)
        near = np.hypot(*(self._pixels(self._points) - at).T)
        index = int(near.argmin()) if near.min() <= _REACH else -1
        twice = "Double" in event or interactor.GetRepeatCount() > 0
        curve = self._pixels(np.array([[value, self._edited.functions()[0].GetValue(value)]]))[0]
        inside = self._axis[0] <= value <= self._axis[1]
        if event.startswith("Right"):
            what = "nothing"
            self._delete(index)
        elif index >= 0:
            self._choose(index)
        elif twice or (inside and abs(curve[1] - at[1]) <= _REACH):
            self._add(value, opacity)
        else:
            what = "window"
            self._choose(-1)
        self._drag = what, at, before

    def _dragged(
        self, at: NDArray[Any], what: str, begin: NDArray[Any], before: dict[str, Any]
    ) -> None:
        if what == "point" and self._current >= 0:  # none where it was changed from elsewhere
            self._put(self._current, *self._at(at))
        elif what == "window":
            low, high = self._corners()
            across, up = (at - begin) / np.maximum(high - low, 1)
            x = before["colors"][:, 0]
            window = (x[-1] - x[0] or 1.0) * 4.0**up
            level = (x[0] + x[-1]) / 2 + across * (self._axis[1] - self._axis[0])
            self._write(**windowed(before, window, level))

    def _corners(self) -> Rows:
        """Return where the axes begin and end, pixels from the viewport's corner."""
        return np.array([self._chart.GetPoint1(), self._chart.GetPoint2()], dtype=float)

    def _pixels(self, points: Rows) -> Rows:
        low, high = self._corners()
        extent = (self._axis[1] - self._axis[0], _TOP)
        return low + (points[:, :2] - (self._axis[0], 0)) / extent * (high - low)  # type: ignore[no-any-return]

    def _at(self, pixel: NDArray[Any]) -> tuple[float, float]:
        """Return the value and the opacity at a pixel."""
        low, high = self._corners()
        across, up = (pixel - low) / np.maximum(high - low, 1)
        return float(self._axis[0] + across * (self._axis[1] - self._axis[0])), float(_TOP * up)

    def _action(self, key: str) -> Callable[[], object] | None:
        """Return what a key does; ``None`` for keys that are the plotter's."""
        if key in _ARROWS:
            return lambda: self._change(self._step, *_ARROWS[key])
        if key in ("c", "C", "p", "P"):
            apply: Callable[[Any], None] = self.apply_cmap
            names, step = self._cmaps, 1 if key.islower() else -1
            if key in ("p", "P"):
                apply, names = self.apply_preset, [*presets]
            k = names.index(self._edited.look) if self._edited.look in names else min(0, -step)
            return lambda: apply(names[(k + step) % len(names)])
        return {
            "Tab": lambda: self._change(self._choose, (self._current + 1) % len(self._points)),
            "Escape": lambda: self._change(self._choose, -1),
            "Delete": lambda: self._change(self._delete, self._current),
            "BackSpace": lambda: self._change(self._delete, self._current),
            "a": lambda: self._change(self._add_beside),
            "r": self.reset,
            "z": self.undo,
            "Z": self.redo,
            "y": self.redo,
        }.get(key)
