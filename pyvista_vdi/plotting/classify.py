"""Classification arguments to tables, through the objects that ``add_volume`` builds them with."""

from __future__ import annotations

import difflib
import sys
import warnings
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import (
    InvalidArgumentError,
    InvalidVolumeError,
    MissingDependencyError,
    VDIWarning,
)
from pyvista_vdi.model.checks import as_float
from pyvista_vdi.model.lighting import Shading
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.vtk_pipeline.filters.properties import (
    RGBA_OPACITY,
    transfer_function_from_property,
)

#: Most entries of a table: building it takes PyVista time by the square, a second from here on.
_MAX_COLORS = 4096


@dataclass(frozen=True, kw_only=True)
class Looks:
    """``add_volume``'s arguments that say what a scalar looks like, with its names and defaults.

    :meth:`AddVDI.__call__` says what each means. What cannot be used is refused where it is used.
    ``theme`` is PyVista's, whose default colour map is used, the global one by default.
    """

    clim: float | ArrayLike | None = None
    n_colors: int = 256
    opacity: Any = "linear"
    cmap: Any = None
    flip_scalars: bool = False
    log_scale: bool = False
    categories: bool | int = False
    annotations: dict[float, str] | None = None
    theme: Any = None
    opacity_unit_distance: float | None = None
    interpolation: str = "nearest"
    shade: bool = False
    ambient: float | None = None
    diffuse: float = 0.7
    specular: float = 0.2
    specular_power: float = 10.0

    def of_rgba(self) -> Looks:
        """Return those of RGBA scalars: opacity is linear over ``clim``, as in ``add_volume``."""
        if not (isinstance(self.opacity, str) and self.opacity == "linear"):
            warnings.warn("opacity is ignored: RGBA scalars bring theirs", VDIWarning, stacklevel=3)
        return replace(self, opacity="linear")

    def lookup_table(self, scalars: NDArray[Any]) -> pv.LookupTable:
        """Return the lookup table that ``Plotter.add_volume`` would build for some values."""
        if isinstance(self.cmap, pv.LookupTable):
            return self.cmap
        low, high = _scalar_range(scalars, self.clim)
        if self.log_scale and low <= 0:
            low = sys.float_info.min
        n_colors = self.n_colors
        if self.categories:
            count = self.categories
            n_colors = len(np.unique(scalars)) if count is True else int(count)
        if not (isinstance(n_colors, int | np.integer) and 1 <= n_colors <= _MAX_COLORS):
            raise InvalidArgumentError(
                f"n_colors must be a whole number from 1 to {_MAX_COLORS}; got {n_colors!r}"
            )
        theme = self.theme or pv.global_theme
        colors = _color_map(theme.cmap if self.cmap is None else self.cmap)
        table = pv.LookupTable()
        table.apply_cmap(colors.reversed() if self.flip_scalars else colors, int(n_colors))
        _apply_opacity(table, self.opacity, int(n_colors))
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
        if self.interpolation not in ("nearest", "linear"):
            raise InvalidArgumentError(
                f"interpolation must be 'nearest' or 'linear'; got {self.interpolation!r}"
            )
        given = self.opacity_unit_distance
        if given is not None and not 0 < as_float(given) < np.inf:
            raise InvalidArgumentError(
                f"opacity_unit_distance must be a positive length in model units; got {given!r}"
            )
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
        """Set how a property reflects light; ``None`` leaves its ambient coefficient."""
        ambient = prop.ambient if self.ambient is None else self.ambient
        checked = Shading(ambient, self.diffuse, self.specular, self.specular_power)
        prop.ambient, prop.diffuse = checked.ambient, checked.diffuse
        prop.specular, prop.specular_power = checked.specular, checked.specular_power
        prop.shade = bool(self.shade)


def transfer_function_from_arguments(
    scalars: NDArray[Any], *, rgba: bool = False, **arguments: Any
) -> TransferFunction:
    """Return the transfer function that ``Plotter.add_volume`` would draw with.

    ``scalars`` are the volume's values, of any shape, ``rgba`` says whether they are RGBA, and the
    arguments are those of :class:`Looks`. The table has ``n_colors`` entries. PyVista stores
    opacities as bytes and cuts them at 0.998; so does this. What cannot be used is refused by name.
    """
    looks = Looks(**arguments)
    if rgba:
        looks = looks.of_rgba()
    prop = looks.volume_property(looks.lookup_table(scalars), rgba=rgba)
    if looks.shade:
        looks.light(prop)
    function = transfer_function_from_property(prop, rgba=rgba)
    if rgba or looks.opacity_unit_distance is not None:
        return function
    return function.replace(unit_distance=None)


def _scalar_range(scalars: NDArray[Any], clim: float | ArrayLike | None) -> tuple[float, float]:
    if clim is None:
        values = np.asarray(scalars)
        if values.dtype.kind == "f" and np.isnan(values).all():
            raise InvalidVolumeError("every value is NaN: there is nothing to render")
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
        raise InvalidArgumentError(
            f"clim must be one number or a pair (low, high); got {clim!r}"
        ) from error
    if not (np.isfinite(low) and np.isfinite(high) and low <= high):
        raise InvalidArgumentError(
            f"clim must be two finite numbers, the smaller first; got {(low, high)}"
        )
    return low, high


def _color_map(cmap: Any) -> Any:
    try:
        return pv.plotting.colors.get_cmap_safe(cmap)
    except ModuleNotFoundError as error:
        raise MissingDependencyError(str(error)) from error
    except (TypeError, ValueError) as error:
        hint = ""
        if isinstance(cmap, str):
            import matplotlib as mpl

            near = difflib.get_close_matches(cmap, list(mpl.colormaps), n=3)
            hint = f": did you mean {' or '.join(map(repr, near))}?" if near else ""
        raise InvalidArgumentError(
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
            names = _opacity_names(error)
            near = difflib.get_close_matches(opacity, names, n=1)
            hint = f": did you mean {near[0]!r}?" if near else f"; known are {', '.join(names)}"
        raise InvalidArgumentError(
            f"opacity={opacity!r} cannot be used{hint or f': {error}'}"
        ) from (error)


def _opacity_names(error: Exception) -> list[str]:
    """Return the names in PyVista's message: it keeps its table inside a function."""
    _, _, listed = str(error).partition("[")
    return [name.strip(" '\"") for name in listed.rstrip("]").split(",")] if listed else []


def _checked_opacities(opacity: Any, n_colors: int) -> Any:
    try:
        values = np.asarray(opacity, dtype=float)
    except (TypeError, ValueError) as error:
        raise InvalidArgumentError(
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
