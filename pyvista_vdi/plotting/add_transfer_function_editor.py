"""``Plotter.add_transfer_function_editor``: edit opacities and colours over the picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyvista as pv
import pyvista.plotting  # whole: pv.Plotter is missing while another thread imports it
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError, InvalidArgumentTypeError, UnsupportedError
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.types import ColorMapLike
from pyvista_vdi.plotting.classify import Looks
from pyvista_vdi.plotting.registration import Component
from pyvista_vdi.plotting.transfer_function_editor import TransferFunctionEditor
from pyvista_vdi.vtk_pipeline.drawing.mapper import VDIMapperMethods
from pyvista_vdi.vtk_pipeline.vtk import mutable, vtk_to_numpy, vtkVolume

#: The colour maps that ``c`` goes through.
COLOR_MAPS = ("gray", "bone", "viridis", "inferno", "coolwarm", "turbo")

#: Most bars of a histogram, and most values that it counts.
_BARS, _MOST_VALUES = 256, 1 << 24


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
        histogram: Any = None,
        cmap: str | Sequence[ColorMapLike] = COLOR_MAPS,
        color: Any = None,
        loc: Sequence[float] | None = None,
        size: Sequence[float] = (0.4, 0.32),
    ) -> TransferFunctionEditor:
        """Edit the opacities and colours of a volume over its picture, by mouse and keys.

        Points of the opacity curve are dragged, added by a click on the curve or a double click
        beside it, and deleted by a right click. A drag on the background moves the window to the
        left and right, and makes it wider upwards. While the mouse is over the editor keys are its
        own: Tab, arrows, ``a`` and Delete for points, ``c`` and ``p`` for the next colour map and
        preset, ``z``, ``y`` and ``r`` to undo, redo and reset.

        Parameters
        ----------
        actor : pyvista.Volume or vtkVolume
            Of ``add_volume``, or of ``add_vdi`` with a volume or a :class:`DeferredVDI`. Its
            property is what is edited, and what is shown: changes from elsewhere are in the editor
            with the next frame.
        histogram : (array_like, array_like) or False, optional
            Counts of the values and the edges between them, as ``numpy.histogram`` returns; by
            default those of the actor's volume, counted once; of a deferred VDI the lengths that
            have them. ``False``: none.
        cmap : list of colour maps
            What ``c`` goes through.
        color : ColorLike, optional
            Of lines and texts; the theme's font's by default.
        loc, size : (float, float), optional
            Lower left corner, and width and height, as shares of the viewport; by default in the
            upper right corner, a second one below the first.

        Returns
        -------
        TransferFunctionEditor
            The same by program: ``points``, ``window``, ``level``, ``apply_cmap``, ``undo`` ...

        Raises
        ------
        UnsupportedError
            If there is nothing to edit: RGBA brings its colours, and so does a VDI without its
            volume, unless it is a deferred one.
        InvalidArgumentError
            If the actor is no volume of this plotter, or another argument cannot be used.

        Examples
        --------
        >>> import pyvista as pv
        >>> import pyvista_vdi
        >>> plotter = pv.Plotter()
        >>> actor = plotter.add_vdi(pyvista_vdi.examples.load_brain())
        >>> editor = plotter.add_transfer_function_editor(actor)
        >>> plotter.show()  # doctest: +SKIP
        """
        plotter = self._plotter
        if not isinstance(actor, vtkVolume):
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
        mapper = actor.GetMapper()
        ours = isinstance(mapper, VDIMapperMethods)
        kept = mapper.driver.values_asked_for() if ours else None
        if ours and not mapper.GetSource() and kept is None:
            raise UnsupportedError(
                "this is a VDI without its volume, whose colours were fixed when it was generated: "
                "add the volume (add_vdi(volume)), or a VDI of classification='deferred', to edit "
                "its transfer function"
            )
        cmaps = [cmap] if isinstance(cmap, str) else [*cmap]
        for each in cmaps:
            Looks(cmap=each, clim=(0, 1)).lookup_table(np.empty(0))  # refused by name
        if histogram is None:
            histogram = _histogram(_values(actor)) if kept is None else _lengths(kept)
        elif histogram is not False:
            counts, edges = (np.asarray(each, dtype=float) for each in histogram)
            if counts.ndim != 1 or edges.shape != (len(counts) + 1,) or (np.diff(edges) <= 0).any():
                raise InvalidArgumentError(
                    "histogram must be counts and the rising edges between them, one more; got "
                    f"shapes {counts.shape} and {edges.shape}"
                )
            histogram = counts, edges
        if loc is None:
            others = [e for e in self._editors if e.renderer is renderer and e.actor is not actor]
            loc = (max(0, 0.98 - size[0]), max(0, 0.98 - (len(others) + 1) * (size[1] + 0.01)))
        editor = TransferFunctionEditor(
            plotter, renderer, actor, histogram or None, cmaps, color, loc=loc, size=size
        )
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


@pv.register_plotter_component("remove_transfer_function_editor", override=True)
class RemoveTransferFunctionEditor(Component):
    """Takes editors away: ``plotter.remove_transfer_function_editor()``.

    ``plotter``: held weakly.
    """

    def __call__(self, which: Any = None, render: bool = True) -> None:
        """Take transfer-function editors away; the volumes stay as they are.

        Parameters
        ----------
        which : TransferFunctionEditor or pyvista.Volume, optional
            The editor, or the actor that it edits; all of the plotter's by default.
        render : bool
            Whether the plotter renders at once.
        """
        self._plotter.add_transfer_function_editor.remove(which)
        if render and not self._plotter._first_time:
            self._plotter.render()


def _values(actor: Any) -> NDArray[Any]:
    """Return values of an actor's volume, of large ones those of some planes."""
    mapper = actor.GetMapper()
    source = mapper.GetSource() if isinstance(mapper, VDIMapperMethods) else None
    if source is not None:
        array = source.GetVolume().array
        step = -(-array.size // _MOST_VALUES)
        planes = range(min(step // 2, len(array) - 1), len(array), step)
        return np.concatenate([np.ravel(array[k : k + 1, :, :]) for k in planes])
    chosen = (mapper.GetScalarMode(), mapper.GetArrayAccessMode(), mapper.GetArrayId())
    scalars = mapper.GetScalars(
        mapper.GetDataSetInput(), *chosen, mapper.GetArrayName(), mutable(0)
    )
    if scalars is None:
        return np.empty(0)
    values = vtk_to_numpy(scalars).reshape(scalars.GetNumberOfTuples(), -1)[:, 0]
    return values[:: -(-len(values) // _MOST_VALUES)]  # type: ignore[no-any-return]


def _histogram(values: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]] | None:
    """Count finite values, whole numbers as many in each bar; ``None`` without any."""
    values = values[np.isfinite(values)]
    if not len(values):
        return None
    low, high, bars = float(values.min()), float(values.max()), _BARS
    if values.dtype.kind in "iu":
        numbers = int(high - low) + 1
        bars = max(1, numbers // -(-numbers // _BARS))
    return np.histogram(values, bars, (low, high) if low < high else (low - 0.5, low + 0.5))


def _lengths(kept: DeferredVDI) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the length that has each value, in steps: spreads are those of even values."""
    edges = np.linspace(0, 1, _BARS + 1)
    mean, reach = kept.mean.astype(float), np.sqrt(3) * kept.spread.astype(float)
    low = np.maximum(mean - reach, 0)
    high = np.maximum(np.minimum(mean + reach, 1), low + 0.5 / _BARS)
    density = kept.steps / (high - low)
    # What is below a value: a ramp for each supersegment, which begins and ends within some bar
    below = np.zeros(_BARS + 1)
    for sign, ends in ((1, low), (-1, high)):
        bar = np.minimum((ends * _BARS).astype(int) + 1, _BARS)  # the first edge that is above
        slope, rest = (
            np.cumsum(np.bincount(bar, weights, _BARS + 1)) for weights in (density, density * ends)
        )
        below += sign * (slope * edges - rest)
    return np.maximum(np.diff(below), 0), np.interp(edges, (0, 1), kept.value_range)
