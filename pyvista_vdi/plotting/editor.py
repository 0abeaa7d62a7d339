"""An editor of transfer functions: a chart of opacities and colours over a plotter's picture."""

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
from pyvista_vdi.vtk_pipeline import vtk
from pyvista_vdi.vtk_pipeline.drawing.mapper import VDIMapperMethods

Rows = NDArray[np.float64]

#: Most bars of a histogram, most values that it counts, and most points that are shown.
_BARS, _MOST_VALUES, _MOST_NODES = 256, 1 << 24, 32


class TransferFunctionEditor:
    """An editor over a plotter; what it shows is the actor's volume property, and nothing else.

    ``plotter.vdi.add_transfer_function_editor(actor)`` makes it. Its chart is one of PyVista's:
    VTK moves, adds and deletes points where the chart is interactive.
    """

    def __init__(
        self, plotter: Any, actor: Any, loc: Sequence[float], size: Sequence[float]
    ) -> None:
        # Refuse what cannot be edited
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
        counts, ends = _histogram(actor.GetMapper())
        self._plotter, self._renderer = weakref.ref(plotter), weakref.ref(renderer)
        self._actor, self._range = vtk.weakly(actor), (float(ends[0]), float(ends[-1]))

        # Draw the histogram, the curve with its colours, and its points
        self._chart = pv.Chart2D(loc=loc, size=size, x_label="", y_label="opacity", grid=False)
        heights = np.log1p(counts) / max(np.log1p(counts).max(), 1e-9)
        self._chart.area(np.repeat(ends, 2)[1:-1], np.repeat(heights, 2), color="grey")
        self._curve = vtk.vtkCompositeTransferFunctionItem()
        self._shown = vtk.vtkPiecewiseFunction()
        self._handles = vtk.vtkCompositeControlPointsItem()
        self._handles.SetOpacityFunction(self._shown)
        self._handles.SetPointsFunction(self._handles.OpacityPointsFunction)
        self._handles.SetEndPointsRemovable(False)
        self._chart.background_color = (1.0, 1.0, 1.0, 0.8)  # its lines and texts are black
        self._chart.legend_visible = False
        self._chart.y_axis.range = (0, 1.1)  # so that points at 1 are seen whole
        self._curve.SetMaskAboveCurve(True)
        self._chart.AddPlot(self._curve)
        self._chart.AddPlot(self._handles)
        renderer.add_chart(self._chart)
        self._read()
        self._handles.AddObserver("EndEvent", self._edited)
        self._start = renderer.AddObserver("StartEvent", self._follow)

    @property
    def actor(self) -> Any:
        """The actor whose property is edited; ``None`` where it is gone."""
        return self._actor()

    @property
    def renderer(self) -> Any:
        """The renderer that shows the editor; ``None`` where it was taken away."""
        renderer = self._renderer()
        shown = renderer is not None and self._chart in renderer.get_charts()
        return renderer if shown else None

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
        _fill(self._functions()[0], np.column_stack([rows, np.tile([0.5, 0.0], (len(rows), 1))]))
        self._settle()
        self._read()

    def apply_cmap(self, cmap: ColorMapLike) -> None:
        """Colour the values as ``add_vdi`` does; a preset brings its opacities and range."""
        opacity, colors = self._functions()
        preset = presets[cmap] if isinstance(cmap, str) and cmap in presets else None
        clim = colors.GetRange() if preset is None else preset["clim"] or self._range
        table = Looks(cmap=cmap, clim=clim).lookup_table(np.empty(0))
        _fill(colors, rows_of(table.to_color_tf()))
        if preset is not None:
            _fill(opacity, rows_of(table.to_opacity_tf()))
        self._settle()
        self._read()

    def remove(self) -> None:
        """Take the editor away; the actor stays as it is."""
        shown, renderer = self.renderer, self._renderer()
        self._handles.RemoveObservers("EndEvent")
        if renderer is not None:
            renderer.RemoveObserver(self._start)
        if shown is not None:
            shown.remove_chart(self._chart)

    def _functions(self) -> tuple[Any, Any]:
        """Return the property's functions, of opacity and of colour."""
        actor = self.actor
        if actor is None:
            raise InvalidArgumentError("the actor is gone, and its transfer function with it")
        return actor.GetProperty().GetScalarOpacity(), actor.GetProperty().GetRGBTransferFunction()

    def _edited(self, *_: Any) -> None:
        """Take the points that were moved, added or deleted by hand."""
        if self.renderer is not None and self.actor is not None:
            _fill(self._functions()[0], rows_of(self._shown))
            self._settle()

    def _settle(self) -> None:
        """Show what is, in scalar bars, too."""
        actor, (opacity, color) = self.actor, self._functions()
        table = getattr(actor.GetMapper(), "lookup_table", None)
        if isinstance(table, pv.LookupTable):
            low, high = color.GetRange()
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
        self._seen = [(each, each.GetMTime()) for each in (opacity, color)]
        plotter = self._plotter()
        if plotter is not None:
            plotter.render()

    def _follow(self, *_: Any) -> None:
        """Show, before a frame, what has become of the property, and go with the actor."""
        renderer = self.renderer
        if renderer is None or self.actor is None or not renderer.HasViewProp(self.actor):
            self.remove()
        elif self._seen != [(each, each.GetMTime()) for each in self._functions()]:
            self._read()

    def _read(self) -> None:
        """Show the property's functions, an opacity of many nodes by fewer points."""
        opacity, colors = self._functions()
        points = rows_of(opacity)
        if len(points) > _MOST_NODES:
            points = points[np.linspace(0, len(points) - 1, _MOST_NODES).round().astype(int)]
        _fill(self._shown, points)
        ends = (*self._range, points[0, 0], points[-1, 0])
        self._chart.x_axis.range = low, high = min(ends), max(ends)
        self._handles.SetUserBounds(low, high, 0, 1)
        self._curve.SetOpacityFunction(opacity)
        self._curve.SetColorTransferFunction(colors)
        self._handles.SetColorTransferFunction(colors)
        self._seen = [(each, each.GetMTime()) for each in (opacity, colors)]


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


def _histogram(mapper: Any) -> tuple[NDArray[Any], NDArray[Any]]:
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
    low, high, bars = float(values.min()), float(values.max()), _BARS
    if values.dtype.kind in "iu":
        bars = min(bars, int(high - low) + 1)
    return np.histogram(values, bars, (low, high) if low < high else (low - 0.5, low + 0.5))
