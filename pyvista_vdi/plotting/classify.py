"""Classification arguments to tables, through the objects that ``add_volume`` builds them with."""

from __future__ import annotations

import difflib
import sys
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
import pyvista as pv
import pyvista.plotting  # whole: pv.LookupTable is missing while another thread imports it
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import (
    InvalidArgumentError,
    InvalidArgumentTypeError,
    InvalidVolumeError,
    MissingDependencyError,
    VDIError,
    warn_external,
)
from pyvista_vdi.model.checks import as_float, suggestion
from pyvista_vdi.model.chunked import ChunkedArray
from pyvista_vdi.model.classification import Look
from pyvista_vdi.model.lighting import Shading
from pyvista_vdi.model.options import option
from pyvista_vdi.model.presets import presets
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.vtk_pipeline.filters.properties import (
    RGBA_OPACITY,
    transfer_function_from_property,
)

#: Arguments whose whole effect is a lookup table.
_IN_TABLES = {"clim", "n_colors", "opacity", "cmap", "flip_scalars", "log_scale", "theme"}
#: Transfer functions by what they were made of, so many at most.
_made: dict[tuple[Any, ...], TransferFunction] = {}
_MOST_MADE = 64


def _categories(count: Any) -> bool | int:
    if count and not isinstance(count, int | np.integer):
        raise InvalidArgumentTypeError(
            f"categories must be True, False or a whole number; got {count!r}"
        )
    return count  # type: ignore[no-any-return]


@dataclass(frozen=True, eq=False)
class Looks(Look):
    """What a scalar looks like in a plotter, whose ``theme`` has the default colour map.

    categories: as many colours as there are different values, or this many
    annotations: texts beside the scalar bar, by value
    """

    categories: bool | int = option(False, _categories)
    annotations: dict[float, str] | None = None
    theme: Any = field(default=None)

    def of_rgba(self) -> Looks:
        """Return those of RGBA scalars: opacity is linear over ``clim``, as in ``add_volume``."""
        if not (isinstance(self.opacity, str) and self.opacity == "linear"):
            warn_external("opacity is ignored: RGBA scalars bring theirs")
        return replace(self, opacity="linear")

    def scalar_range(self, table: pv.LookupTable, volume: Volume) -> tuple[float, float]:
        """Return what ``add_volume``'s mapper says: not a given table's own range, which it has."""
        if table is not self.cmap:
            return table.scalar_range
        return volume.finite_range() if self.clim is None else _scalar_range(None, self.clim)

    def lookup_table(self, scalars: NDArray[Any]) -> pv.LookupTable:
        """Return the lookup table that ``Plotter.add_volume`` would build for some values."""
        if isinstance(self.cmap, pv.LookupTable):
            return self.cmap
        if isinstance(self.cmap, str) and self.cmap in presets:
            # Its colours, and its range and opacity where none are given; shade is asked for apart
            preset = presets[self.cmap]
            look = {n: v for n, v in preset.items() if n not in ("clim", "opacity", "shade")}
            look |= {} if self.clim is not None else {"clim": preset["clim"]}
            linear = isinstance(self.opacity, str) and self.opacity == "linear"
            look |= {"opacity": preset["opacity"]} if linear else {}
            return replace(self, **look).lookup_table(scalars)
        low, high = _scalar_range(scalars, self.clim)
        if self.log_scale and low <= 0:
            low = sys.float_info.min
        n_colors = self.n_colors
        if self.categories:
            count = len(np.unique(scalars)) if self.categories is True else self.categories
            n_colors = replace(self, n_colors=count).n_colors
        theme = self.theme or pv.global_theme
        colors = _color_map(theme.cmap if self.cmap is None else self.cmap)
        table = pv.LookupTable()
        table.apply_cmap(colors.reversed() if self.flip_scalars else colors, n_colors)
        _apply_opacity(table, self.opacity, n_colors)
        table.scalar_range = (low, high)
        table.log_scale = bool(self.log_scale)
        if isinstance(self.annotations, dict):
            table.annotations = self.annotations
        return table

    def volume_property(
        self, table: pv.LookupTable, default_distance: float | None = None, *, rgba: bool = False
    ) -> pv.VolumeProperty:
        """Return the volume property that ``Plotter.add_volume`` would build, without shading.

        ``default_distance`` is the opacity unit distance where none is given. ``add_volume``
        leaves VTK's unit distance of an RGBA volume's fourth component, 1, whatever is asked for;
        an explicit one is honoured here.
        """
        given = self.opacity_unit_distance
        prop = pv.VolumeProperty(
            lookup_table=table,
            interpolation_type=self.interpolation,
            opacity_unit_distance=default_distance if given is None else given,
        )
        if rgba:
            prop.independent_components = False
            if given is not None:
                prop.SetScalarOpacityUnitDistance(RGBA_OPACITY, given)
        return prop

    def light(self, prop: pv.VolumeProperty) -> None:
        """Set how a property reflects light; ``None`` leaves a coefficient as it is."""
        names = [field.name for field in fields(Shading)]
        given = {name: getattr(self, name) for name in names}
        checked = Shading(**{n: getattr(prop, n) if v is None else v for n, v in given.items()})
        for name in names:
            setattr(prop, name, getattr(checked, name))
        prop.shade = bool(self.shade)


def transfer_function_from_arguments(
    scalars: NDArray[Any], *, rgba: bool = False, **arguments: Any
) -> TransferFunction:
    """Return the transfer function that ``Plotter.add_volume`` would draw with.

    ``scalars`` are the volume's values or their ends, of any shape, ``rgba`` says whether they are
    RGBA, and the arguments are those of :class:`Looks`. The table has ``n_colors`` entries. PyVista
    stores opacities as bytes and cuts them at 0.998; so does this. What cannot be used is refused
    by name. Of the same table and arguments it is the same object.
    """
    looks = Looks(**arguments)
    if rgba:
        looks = looks.of_rgba()
    table = looks.lookup_table(scalars)
    others = [value for name, value in arguments.items() if name not in _IN_TABLES]
    made_of = (table.values.tobytes(), table.scalar_range, table.log_scale, rgba, repr(others))
    made = None if table is looks.cmap else _made.get(made_of)
    if made is None:
        prop = looks.volume_property(table, rgba=rgba)
        if looks.shade:
            looks.light(prop)
        made = transfer_function_from_property(prop, rgba=rgba)
        if not (rgba or looks.opacity_unit_distance is not None):
            made = made.replace(unit_distance=None)
        if len(_made) >= _MOST_MADE:
            _made.clear()
        _made[made_of] = made
    return made


def stored_table(vdi: VDI) -> pv.LookupTable | None:
    """Return the colours and opacities that a VDI was made with, if its metadata has them."""
    try:
        stored = TransferFunction.from_dict(vdi.metadata["transfer_function"])
    except (KeyError, VDIError):  # metadata may be anybody's
        return None
    colors = np.column_stack([stored.colors, stored.opacities])
    table = pv.LookupTable()
    table.values = np.round(colors * 255).astype(np.uint8)
    table.scalar_range = stored.scalar_range
    return table


def _scalar_range(scalars: Any, clim: float | ArrayLike | None) -> tuple[float, float]:
    if clim is None:
        # Of what is read chunk by chunk the ends are found so
        values = np.asarray(scalars.ends if isinstance(scalars, ChunkedArray) else scalars)
        if values.dtype.kind == "f" and np.isnan(values).all():
            raise InvalidVolumeError(
                "every value is NaN: there is nothing to render; choose another array, or leave "
                "this volume out"
            )
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        if not (np.isfinite(low) and np.isfinite(high)):
            raise InvalidArgumentError(
                f"the values reach from {low} to {high}: give a finite range as clim=(low, high)"
            )
        return low, high
    if isinstance(clim, int | float | np.number):
        clim = (-as_float(clim), as_float(clim))
    try:
        low, high = (float(v) for v in clim)  # type: ignore[union-attr, arg-type]
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidArgumentTypeError(
            f"clim must be one number or a pair (low, high); got {clim!r}"
        ) from error
    if not (np.isfinite(low) and np.isfinite(high) and low <= high):
        raise InvalidArgumentError(
            f"clim must be two finite numbers, the smaller first; got {(low, high)}"
        )
    return low, high


def _color_map(cmap: Any) -> Any:
    try:
        colors = pv.plotting.colors.get_cmap_safe(cmap)
        if isinstance(cmap, list):
            colors(0.0)  # names are looked up only now
        return colors
    except ModuleNotFoundError as error:
        raise MissingDependencyError(str(error)) from error
    except (TypeError, ValueError) as error:
        kind = InvalidArgumentError if isinstance(error, ValueError) else InvalidArgumentTypeError
        hint = ""
        if isinstance(cmap, str):
            import matplotlib as mpl

            near = difflib.get_close_matches(cmap, [*mpl.colormaps, *presets], n=3)
            hint = f": did you mean {' or '.join(map(repr, near))}?" if near else ""
        raise kind(
            f"cmap={cmap!r} is no colour map (a name, a list of colour names, a matplotlib "
            f"colour map or a pyvista.LookupTable){hint}"
        ) from error


def _apply_opacity(table: pv.LookupTable, opacity: Any, n_colors: int) -> None:
    if not isinstance(opacity, str | int | float):
        opacity = _checked_opacities(opacity, n_colors)
    try:
        table.apply_opacity(opacity)
    except (TypeError, ValueError) as error:
        hint = ""
        if isinstance(opacity, str):
            # In PyVista's message: it keeps its table inside a function
            listed = str(error).partition("[")[2].rstrip("]")
            names = [name.strip(" '\"") for name in listed.split(",")] if listed else []
            hint = f": {suggestion(opacity, names)}"
        raise InvalidArgumentError(
            f"opacity={opacity!r} cannot be used{hint or f': {error}'}"
        ) from error


def _checked_opacities(opacity: Any, n_colors: int) -> Any:
    try:
        values = np.asarray(opacity).astype(float, casting="same_kind")
    except (TypeError, ValueError) as error:
        raise InvalidArgumentTypeError(
            f"opacity must be a name, a number or an array of numbers; got {opacity!r}"
        ) from error
    if values.ndim == 0:
        return float(values)
    if values.ndim != 1 or not 1 <= len(values) <= n_colors or not np.isfinite(values).all():
        raise InvalidArgumentError(
            f"an opacity array must have 1 to n_colors={n_colors} finite entries; got shape "
            f"{values.shape}"
        )
    if len(values) == n_colors and (values.min() < 0 or values.max() > 255):
        raise InvalidArgumentError(
            f"an opacity array as long as n_colors={n_colors} is taken as it is, 0 to 255; got "
            f"values from {values.min():g} to {values.max():g}"
        )
    with np.errstate(over="ignore"):
        spread = np.ptp(values)
    if (
        len(values) < n_colors
        and (values.min() < 0 or values.max() > 1)
        and not 0 < spread < np.inf
    ):
        raise InvalidArgumentError(
            "an opacity array beyond 0 to 1 is stretched to that range, for which it needs "
            f"different values of finite distance; got {values.min():g} to {values.max():g}"
        )
    return list(opacity) if isinstance(opacity, tuple) else opacity
