"""The classification arguments: ``Plotter.add_volume``'s, or what may stand in their place."""

from __future__ import annotations

from dataclasses import dataclass, fields
from importlib.util import find_spec
from typing import Any

import numpy as np

from pyvista_vdi import registry
from pyvista_vdi.errors import (
    InvalidArgumentError,
    InvalidVolumeError,
    MissingDependencyError,
    UnsupportedError,
)
from pyvista_vdi.model.checks import Number
from pyvista_vdi.model.options import Options, option
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.types import (
    ColorMapLike,
    Interpolation,
    OpacityLike,
    Preference,
    PropertyLike,
    RangeLike,
    ScalarsLike,
)
from pyvista_vdi.model.volume import Volume

#: What may be given in place of the arguments above.
IN_PLACE = ("volume_property", "transfer_function")


def range_to_classify(scalars: ScalarsLike | None, clim: RangeLike | None) -> RangeLike | None:
    """Return ``clim``, or the range of what a masked array does not mask, as ``add_volume`` does.

    What is masked is drawn by its value all the same.
    """
    if clim is not None or not isinstance(scalars, np.ma.MaskedArray):
        return clim
    if scalars.mask.all():
        raise InvalidVolumeError("every one of the scalars is masked: there is nothing to render")
    return float(np.nanmin(scalars)), float(np.nanmax(scalars))


def _composite(mode: Any) -> str:
    """Return ``"composite"``, as PyVista and VTK call it, or refuse what a VDI does not have."""
    name = mode.lower() if isinstance(mode, str) else mode
    if isinstance(mode, str | int) and name in ("composite", "comp", 0):
        return "composite"
    raise UnsupportedError(
        f"blending={mode!r} is not supported: a VDI stores what is composited along a ray; pass "
        "blending='composite', or draw the volume itself by Plotter.add_volume"
    )


@dataclass(frozen=True, eq=False)
class ArrayChoice(Options):
    """``add_volume``'s arguments that say which scalars are seen, and how along a ray.

    scalars: name of an array, or the values, per point or per cell
        RGBA as uint8 (n, 4). By default the active ones.
    preference: which array, where points and cells both have one of that name
    blending: what becomes of the scalars along a ray
        As in ``add_volume``; a VDI has ``"composite"`` alone.
    """

    scalars: ScalarsLike | None = None
    preference: Preference = "point"
    blending: str = option("composite", _composite, "str | int")


@dataclass(frozen=True, eq=False)
class Look(Options):
    """``add_volume``'s arguments that say what a scalar looks like, with its names and defaults.

    ``interpolation``, which ``add_volume`` leaves at VTK's default, is one of them. What is not
    checked here is refused where a table is built of it.

    clim: range of the colour map; that of all values by default
    n_colors: entries of the colour map
    opacity: name, one opacity, or opacities
        As in ``add_volume``: an array of length ``n_colors`` is taken as it is, 0 to 255; a shorter
        one is 0 to 1 and interpolated.
    cmap: colour map; the theme's by default
    flip_scalars: reverse the colour map
    opacity_unit_distance: length over which opacities are reached, model units
        By default the volume's diagonal over its mean number of cells.
    log_scale: map values to colours by their logarithm
    shade: light the volume
        A shaded VDI has the lights as they stand at its generating view; other lights, and another
        place among lights of the scene, regenerate it.
    ambient: ambient light that is reflected, where shaded
    diffuse: diffuse light that is reflected, where shaded
    specular: specular light that is reflected, where shaded
    specular_power: how narrow highlights are, where shaded
    interpolation: between voxels; ``add_volume`` draws ``"nearest"``
    """

    clim: RangeLike | None = None
    # Building more colours takes PyVista time by the square, some seconds here
    n_colors: int = option(256, Number(low=1, high=16384, whole=True))
    opacity: OpacityLike = "linear"
    cmap: ColorMapLike | None = None
    flip_scalars: bool = False
    opacity_unit_distance: float | None = option(
        None, Number("a length in model units", open_ended=True)
    )
    log_scale: bool = False
    shade: bool = False
    ambient: float | None = None
    diffuse: float | None = 0.7
    specular: float | None = 0.2
    specular_power: float | None = 10.0
    interpolation: Interpolation = "nearest"


@dataclass(frozen=True, eq=False)
class Classification(Look, ArrayChoice):
    """The classification arguments of one call, checked.

    volume_property: in place of the others, as it is
    transfer_function: in place of the others; it needs no PyVista
    """

    volume_property: PropertyLike | None = None
    transfer_function: TransferFunction | None = None

    def __post_init__(self) -> None:
        in_place = [name for name in IN_PLACE if getattr(self, name) is not None]
        replaced = [*in_place[1:], *sorted({*self.given} & {*Look.declared})]
        if in_place and replaced:
            raise InvalidArgumentError(
                f"{in_place[0]} stands in place of {', '.join(replaced)}: leave out the one or the "
                "other"
            )
        super().__post_init__()

    def require_no_look(self) -> None:
        """Refuse a look where values are kept to be classified afterwards."""
        given = {*self.given} & {*Look.declared, *IN_PLACE} - {"interpolation"}
        if given:
            raise InvalidArgumentError(
                f"classification='deferred' keeps values, whatever their look: give "
                f"{', '.join(sorted(given))} to classified() of what is returned, but for shade"
            )

    def transfer_function_of(self, volume: Volume) -> TransferFunction:
        """Return the transfer function that the arguments describe for a volume."""
        table: Any = self.transfer_function
        if isinstance(table, TransferFunction):
            return table
        if table is not None:
            raise InvalidArgumentError(
                "transfer_function must be a pyvista_vdi.TransferFunction; got "
                f"{type(table).__name__}: pass a vtkVolumeProperty as volume_property="
            )
        if self.volume_property is not None:
            from_property = registry.method("TransferFunction.from_property")
            made: TransferFunction = from_property(self.volume_property, volume, rgba=volume.rgba)
            return made
        if find_spec("pyvista") is None:
            raise MissingDependencyError(
                "colour maps and opacities by name are built by PyVista, which is not installed: "
                'install it by pip install "pyvista-vdi[plot]", or pass '
                "transfer_function=pyvista_vdi.TransferFunction(colors, opacities, scalar_range)"
            )
        arguments = {each.name: getattr(self, each.name) for each in fields(Look)}
        arguments["clim"] = range_to_classify(self.scalars, self.clim)
        from_arguments = registry.method("TransferFunction.from_arguments")
        scalars = volume.array if volume.rgba else np.array(volume.finite_range())
        built: TransferFunction = from_arguments(scalars, rgba=volume.rgba, **arguments)
        return built
