"""``Plotter.add_transfer_function_editor``: a chart of opacities and colours over the picture."""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from typing import Any

import numpy as np
import pyvista as pv
import pyvista.plotting  # whole: pv.Plotter is missing while another thread imports it
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError, InvalidArgumentTypeError, UnsupportedError
from pyvista_vdi.model.presets import presets
from pyvista_vdi.model.types import ColorMapLike
from pyvista_vdi.plotting.classify import Looks
from pyvista_vdi.plotting.registration import Component
from pyvista_vdi.vtk_pipeline import vtk
from pyvista_vdi.vtk_pipeline.drawing.mapper import VDIMapperMethods

Rows = NDArray[np.float64]

#: The colour maps that ``c`` goes through.
COLOR_MAPS = ("gray", "bone", "viridis", "inferno", "coolwarm", "turbo")

#: Most bars of a histogram, most values that it counts, and most points that are shown.
_BARS, _MOST_VALUES, _MOST_NODES = 256, 1 << 24, 32

#: Opacity at the upper edge, so that points at 1 are seen whole.
_TOP = 1.1

#: Of observers: before PyVista's and the interactor's style (0), and before other widgets (0.5).
_PRIORITY = 1.0

#: Events over the chart, and what of VTK's style of charts gets them.
_EVENTS = {
    "LeftButtonPressEvent": "OnLeftButtonDown",
    "LeftButtonReleaseEvent": "OnLeftButtonUp",
    "LeftButtonDoubleClickEvent": "",
    "RightButtonPressEvent": "",
    "RightButtonReleaseEvent": "",
    "MouseMoveEvent": "OnMouseMove",
    "KeyPressEvent": "",
    "CharEvent": "",
}


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
        cmaps: Sequence[ColorMapLike],
        **place: Sequence[float],
    ) -> None:
        self._plotter, self._renderer = weakref.ref(plotter), weakref.ref(renderer)
        self._actor, self._cmaps, self._look = vtk.weakly(actor), list(cmaps), None
        # Which button is held, or "Deleted"; where it was pressed; the nodes before
        self._drag: tuple[str, Rows, list[Rows]] | None = None
        self._chart = pv.Chart2D(**place, x_label="", y_label="opacity", grid=False)
        ends = np.concatenate([rows[[0, -1], 0] for rows in [*map(rows_of, self._functions())]])
        histogram = _histogram(actor.GetMapper())
        if histogram is not None:
            counts, ends = histogram
            heights = np.log1p(counts) / max(np.log1p(counts).max(), 1e-9)
            self._chart.area(np.repeat(ends, 2)[1:-1], np.repeat(heights, 2), color="grey")
        self._range = float(ends.min()), float(ends.max())
        self._fill, self._shown = vtk.vtkCompositeTransferFunctionItem(), vtk.vtkPiecewiseFunction()
        self._handles = vtk.vtkCompositeControlPointsItem()
        self._handles.SetOpacityFunction(self._shown)
        self._handles.SetPointsFunction(self._handles.OpacityPointsFunction)
        self._handles.SetEndPointsRemovable(False)
        self._chart.background_color = (1.0, 1.0, 1.0, 0.8)  # its lines and texts are black
        self._chart.legend_visible = False
        self._chart.y_axis.range = (0, _TOP)
        self._chart.GetTitleProperties().SetFontSize(12)
        self._fill.SetMaskAboveCurve(True)
        self._chart.AddPlot(self._fill)
        self._chart.AddPlot(self._handles)
        renderer.add_chart(self._chart)
        self._style = vtk.vtkContextInteractorStyle()
        self._read()
        interactor = plotter.iren.interactor
        self._tags = {e: interactor.AddObserver(e, self._on_event, _PRIORITY) for e in _EVENTS}
        self._start = renderer.AddObserver("StartEvent", self._follow)

    @property
    def actor(self) -> Any:
        """The actor whose property is edited; ``None`` where it is gone."""
        return self._actor()

    @property
    def renderer(self) -> Any:
        """The renderer that shows the editor; ``None`` where it was taken away."""
        return self._renderer() if self._tags else None

    @property
    def points(self) -> Rows:
        """Value and opacity of each point, values rising, (n, 2); others may be set."""
        return rows_of(self._shown)[:, :2]

    @points.setter
    def points(self, points: ArrayLike) -> None:
        rows = np.asarray(points, dtype=float)
        pairs = rows.ndim == 2 and rows.shape[1] == 2 and len(rows) and np.isfinite(rows).all()
        if not pairs or (np.diff(rows[:, 0]) <= 0).any() or (np.abs(rows[:, 1] - 0.5) > 0.5).any():
            raise InvalidArgumentError(
                "points must be pairs of a value and an opacity, values rising and finite, "
                f"opacities 0 to 1; got {points!r}"
            )
        self._change(np.column_stack([rows, np.tile([0.5, 0.0], (len(rows), 1))]))

    @property
    def clim(self) -> tuple[float, float]:
        """Values over which colours change; setting them moves and stretches opacities, too."""
        low, high = self._functions()[1].GetRange()
        return float(low), float(high)

    @clim.setter
    def clim(self, clim: Sequence[float]) -> None:
        self._change(*_stretched([*map(rows_of, self._functions())], *map(float, clim)))

    def apply_cmap(self, cmap: ColorMapLike) -> None:
        """Colour the window as ``add_vdi`` does; a preset brings its opacities and range."""
        preset = presets[cmap] if isinstance(cmap, str) and cmap in presets else None
        clim = self.clim if preset is None else preset["clim"] or self._range
        table = Looks(cmap=cmap, clim=clim).lookup_table(np.empty(0))
        opacity = None if preset is None else rows_of(table.to_opacity_tf())
        self._change(opacity, rows_of(table.to_color_tf()), cmap)

    def remove(self) -> None:
        """Take the editor away; the actor stays as it is."""
        plotter, renderer = self._plotter(), self.renderer
        if plotter is not None and plotter.iren is not None:
            for tag in self._tags.values():
                plotter.iren.interactor.RemoveObserver(tag)
        self._tags, self._drag = {}, None
        if renderer is not None:
            renderer.RemoveObserver(self._start)
            if self._chart in renderer.get_charts():
                renderer.remove_chart(self._chart)

    # The property's functions

    def _functions(self) -> tuple[Any, Any]:
        """Return the property's functions, of opacity and of colour."""
        actor = self.actor
        if actor is None:
            raise InvalidArgumentError("the actor is gone, and its transfer function with it")
        prop = actor.GetProperty()
        if prop.GetColorChannels() == 1:  # grey: the same as RGB
            colored = vtk.vtkColorTransferFunction()
            _fill(colored, rows_of(prop.GetGrayTransferFunction())[:, [0, 1, 1, 1, 2, 3]])
            prop.SetColor(colored)
        return prop.GetScalarOpacity(), prop.GetRGBTransferFunction()

    def _change(self, opacity: Any = None, colors: Any = None, look: Any = None) -> None:
        """Put nodes into the functions that they are given for, and have all show them."""
        self._write(opacity, colors)
        self._look = self._look if look is None else look
        self._settle()

    def _write(self, opacity: Rows | None = None, colors: Rows | None = None) -> None:
        for function, rows in zip(self._functions(), (opacity, colors), strict=True):
            if rows is not None:
                _fill(function, rows)

    def _settle(self) -> None:
        """Show what is, in scalar bars, too."""
        actor = self._actor()
        table = getattr(actor.GetMapper(), "lookup_table", None)
        if isinstance(table, pv.LookupTable):
            opacity, color = self._functions()
            low, high = self.clim
            at = np.linspace(low, high, table.n_values)
            shown = np.geomspace(low, high, len(at)) if table.log_scale and low > 0 else at
            rgba = [
                [*color.GetColor(s), opacity.GetValue(x)] for s, x in zip(shown, at, strict=True)
            ]
            table.scalar_range = (low, high)
            table.values = np.rint(255 * np.clip(rgba, 0, 1)).astype(np.uint8)
            # PyVista has made functions of the table's bytes
            actor.GetProperty().SetScalarOpacity(opacity)
            actor.GetProperty().SetColor(color)
        self._read()
        self._render()

    def _follow(self, *_: Any) -> None:
        """Show, before a frame, what has become of the property, and go with the actor."""
        if not self._present():
            self.remove()
        elif self._seen != [(each, each.GetMTime()) for each in self._functions()]:
            self._look = None
            self._read()

    def _present(self) -> bool:
        """Whether the renderer still shows the actor."""
        actor, renderer = self.actor, self.renderer
        return actor is not None and renderer is not None and bool(renderer.HasViewProp(actor))

    def _read(self) -> None:
        """Show the property's functions, an opacity of many nodes by fewer points."""
        opacity, colors = self._functions()
        points = rows_of(opacity)
        if self._drag is None or self._drag[0] != "Left":  # whose points are under the mouse
            if len(points) > _MOST_NODES:
                points = points[np.linspace(0, len(points) - 1, _MOST_NODES).round().astype(int)]
            _fill(self._shown, points)
        self._fill.SetOpacityFunction(opacity)
        self._fill.SetColorTransferFunction(colors)
        self._handles.SetColorTransferFunction(colors)
        if self._drag is None:  # under the mouse the axis stays
            ends = (*self._range, points[0, 0], points[-1, 0])
            low, high = min(ends), max(ends)
            self._axis = (low, high) if low < high else (low - 0.5, low + 0.5)
            self._chart.x_axis.range = self._axis
            self._handles.SetUserBounds(*self._axis, 0, 1)
        named = f"{self._look}   " if isinstance(self._look, str) else ""
        low, high = self.clim
        self._chart.title = f"{named}window {high - low:.4g}   level {(low + high) / 2:.4g}"
        self._seen = [(each, each.GetMTime()) for each in (opacity, colors)]

    def _render(self) -> None:
        plotter = self._plotter()
        if plotter is not None and not plotter._first_time:
            plotter.render()

    # Mouse and keys

    def _on_event(self, interactor: Any, event: str) -> None:
        """Take an event that is the editor's, so that nothing else of the plotter gets it."""
        if not self._present():
            return  # the next frame takes the editor away
        x, y = interactor.GetEventPosition()
        at = np.subtract((x, y), self.renderer.GetOrigin()).astype(float)
        left, bottom, width, height = (self._chart.GetSize()[i] for i in range(4))
        over = (
            self._chart.visible
            and self.renderer.IsInViewport(x, y)
            and left <= at[0] <= left + width
            and bottom <= at[1] <= bottom + height
        )
        taken = self._drag is not None or (over and "Mouse" not in event)
        if event in ("KeyPressEvent", "CharEvent"):
            key = interactor.GetKeySym() or ""
            taken = over and key == "c"
            if taken and event == "KeyPressEvent":
                k = self._cmaps.index(self._look) if self._look in self._cmaps else -1
                self.apply_cmap(self._cmaps[(k + 1) % len(self._cmaps)])
        elif taken:
            self._moved(interactor, event, at)
        if taken and event in self._tags:
            interactor.GetCommand(self._tags[event]).AbortFlagOn()

    def _moved(self, interactor: Any, event: str, at: Rows) -> None:
        """Drag points by VTK's chart, and the window by the right button."""
        drawn = interactor.GetRenderWindow()
        if event.endswith("PressEvent") and self._drag is None:
            button, before = event.partition("Button")[0], [*map(rows_of, self._functions())]
            drawn.SetDesiredUpdateRate(interactor.GetDesiredUpdateRate())
            point = self._handles.FindPoint(self._at(at))
            if button == "Right" and point >= 0 and len(self.points) > 1:
                self._write(np.delete(rows_of(self._shown), point, axis=0))
                button = "Deleted"
            self._drag = button, at, before
        if self._drag is None:
            return
        button, begin, before = self._drag
        if button == "Left" and _EVENTS[event]:
            shown = self._shown.GetMTime()
            # For this event alone: it would have the plotter's, too
            self._style.SetInteractor(interactor)
            self._style.SetScene(self._chart.GetScene())
            getattr(self._style, _EVENTS[event])()
            self._style.SetScene(None)
            self._style.SetInteractor(None)
            if self._shown.GetMTime() != shown:
                self._write(rows_of(self._shown))
        elif button == "Right" and event == "MouseMoveEvent":
            across, up = np.subtract(self._at(at), self._at(begin))
            low, high = before[1][[0, -1], 0]
            level, half = (low + high) / 2 + across, (high - low or 1.0) / 2 * 4.0 ** (up / _TOP)
            self._write(*_stretched(before, level - half, level + half))
        self._read()
        if event.endswith("ReleaseEvent"):
            self._drag = None
            drawn.SetDesiredUpdateRate(interactor.GetStillUpdateRate())
            self._settle()
        self._render()

    def _at(self, pixel: Rows) -> tuple[float, float]:
        """Return the value and the opacity at a pixel."""
        low, high = np.array([self._chart.GetPoint1(), self._chart.GetPoint2()], dtype=float)
        across, up = (pixel - low) / np.maximum(high - low, 1)
        return float(self._axis[0] + across * (self._axis[1] - self._axis[0])), float(_TOP * up)


def _stretched(nodes: list[Rows], low: float, high: float) -> list[Rows]:
    """Return nodes, moved and stretched so that the colours change from low to high."""
    if not (np.isfinite([low, high]).all() and low < high):
        raise InvalidArgumentError(
            f"clim must be two finite values, the smaller first; got {(low, high)}"
        )
    first, last = nodes[1][[0, -1], 0]
    scale = (high - low) / (last - first) if last > first else 1.0
    moved = [rows.copy() for rows in nodes]
    for rows in moved:
        rows[:, 0] = low + (rows[:, 0] - first) * scale
    return moved


def rows_of(function: Any) -> Rows:
    """Return the nodes of an opacity function, (n, 4), or of a colour function, (n, 6)."""
    rows = np.empty((function.GetSize(), 6 if function.IsA("vtkColorTransferFunction") else 4))
    for k in range(len(rows)):
        function.GetNodeValue(k, rows[k])
    return rows


def _fill(function: Any, rows: Rows) -> None:
    """Replace a function's nodes."""
    function.RemoveAllPoints()
    add = getattr(function, "AddRGBPoint", None) or function.AddPoint
    for row in rows.tolist():
        add(*row)


@pv.register_plotter_component("add_transfer_function_editor", override=True)
class AddTransferFunctionEditor(Component):
    """Adds editors of transfer functions: ``plotter.add_transfer_function_editor(actor)``.

    ``plotter``: held weakly.
    """

    def __init__(self, plotter: Any) -> None:
        super().__init__(plotter)
        self._editors: list[TransferFunctionEditor] = []

    def __call__(
        self,
        actor: Any,
        *,
        cmap: str | Sequence[ColorMapLike] = COLOR_MAPS,
        loc: Sequence[float] | None = None,
        size: Sequence[float] = (0.4, 0.32),
    ) -> TransferFunctionEditor:
        """Edit the opacities and colours of a volume over its picture and its values' histogram.

        Points of the opacity curve are dragged, added by a click, and deleted by a right click. A
        drag with the right button moves the window to the left and right, and makes it wider
        upwards. With the mouse over the editor, ``c`` takes the next colour map.

        Parameters
        ----------
        actor : pyvista.Volume or vtkVolume
            Of ``add_volume``, or of ``add_vdi`` with a volume or a :class:`DeferredVDI`. Its
            property is edited; what others change of it is shown with the next frame.
        cmap : list of colour maps
            What ``c`` goes through; presets among them bring their opacities and range.
        loc, size : (float, float), optional
            Lower left corner, and width and height, as shares of the viewport; by default in the
            upper right corner, a second one below the first.

        Returns
        -------
        TransferFunctionEditor
            The same by program: ``points``, ``clim``, ``apply_cmap``, ``remove``.

        Raises
        ------
        UnsupportedError
            If there is nothing to edit: RGBA brings its colours, and so does a VDI without its
            volume, unless it is a deferred one.
        InvalidArgumentError
            If the actor is no volume of this plotter, or another argument cannot be used.
        """
        plotter = self._plotter
        if not isinstance(actor, vtk.vtkVolume):
            raise InvalidArgumentTypeError(
                "actor must be what add_volume or add_vdi has returned, one of them where that is "
                f"a list; got {type(actor).__name__}"
            )
        renderer = next((each for each in plotter.renderers if each.HasViewProp(actor)), None)
        if renderer is None:
            raise InvalidArgumentError("the actor is not in this plotter: add it first")
        if not actor.GetProperty().GetIndependentComponents():
            raise UnsupportedError(
                "the volume's scalars are RGBA, which bring their colours: there is no transfer "
                "function to edit"
            )
        cmaps = [cmap] if isinstance(cmap, str) else [*cmap]
        for each in cmaps:
            Looks(cmap=each, clim=(0, 1)).lookup_table(np.empty(0))  # refused by name
        if loc is None:
            others = [e for e in self._editors if e.renderer is renderer and e.actor is not actor]
            loc = (max(0, 0.98 - size[0]), max(0, 0.98 - (len(others) + 1) * (size[1] + 0.01)))
        editor = TransferFunctionEditor(plotter, renderer, actor, cmaps, loc=loc, size=size)
        self.remove(actor)
        self._editors.append(editor)
        if not plotter._first_time:
            plotter.render()
        return editor

    def remove(self, which: Any = None) -> None:
        """Take away the editor, that of an actor, or all."""
        for each in self._editors:
            if which is None or which is each or which is each.actor:
                each.remove()
        self._editors = [each for each in self._editors if each.renderer is not None]

    def __plotter_close__(self) -> None:
        """Observe nothing any more."""
        self.remove()

    def __plotter_deep_clean__(self) -> None:
        """Nothing else is held."""


def _histogram(mapper: Any) -> tuple[NDArray[Any], NDArray[Any]] | None:
    """Count a mapper's finite values, whole numbers one a bar; of values that are kept, lengths."""
    if not isinstance(mapper, VDIMapperMethods):
        values = pv.wrap(mapper.GetInput()).active_scalars
    elif (source := mapper.GetSource()) is not None:
        values = source.GetVolume().array
    elif (kept := mapper.driver.values_asked_for()) is not None:
        counts, edges = np.histogram(kept.mean, _BARS, (0, 1), weights=kept.steps)
        return counts, np.interp(edges, (0, 1), kept.value_range)
    else:
        raise UnsupportedError(
            "this is a VDI without its volume, whose colours were fixed when it was generated: "
            "add the volume (add_vdi(volume)), or a VDI of classification='deferred', to edit "
            "its transfer function"
        )
    values = np.ravel(values)[:: -(-np.size(values) // _MOST_VALUES)]
    values = values[np.isfinite(values)]
    if not len(values):
        return None
    low, high, bars = float(values.min()), float(values.max()), _BARS
    if values.dtype.kind in "iu":
        bars = min(bars, int(high - low) + 1)
    return np.histogram(values, bars, (low, high) if low < high else (low - 0.5, low + 0.5))
