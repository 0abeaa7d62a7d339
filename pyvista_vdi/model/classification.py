"""The classification arguments: ``Plotter.add_volume``'s, or what may stand in their place."""

import difflib
import inspect
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
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
from pyvista_vdi.model.options import (
    GenerationOptions,
    Options,
    QualityTarget,
    declared,
    option,
    record,
)
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.types import ColorMapLike, OpacityLike, RangeLike, ScalarsLike, VTKObject
from pyvista_vdi.model.volume import Volume

#: What may become of the scalars along a ray, as ``add_volume`` names it; the first is the default.
BLENDINGS = ("composite", "maximum", "minimum", "average", "additive")

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


class Described(Options):
    """Options of which metadata tell those that are given."""

    def describe(self) -> dict[str, Any]:
        """Return what differs from the defaults, in values that JSON can hold."""
        return {name: _plain(value) for name, value in self.given.items()}


@record
@dataclass(frozen=True, eq=False)
class ArrayChoice(Described):
    """``add_volume``'s arguments that say which scalars are seen, and how along a ray."""

    scalars: ScalarsLike | None = option(None, "name of an array, or the values")
    preference: str = option(
        "point",
        "which array, where points and cells both have one of that name",
        choices=("point", "cell"),
    )
    blending: str = option(
        "composite", "what becomes of the scalars along a ray", choices=BLENDINGS
    )

    def require_composite(self) -> None:
        """Refuse blend modes that a VDI does not have."""
        if self.blending != BLENDINGS[0]:
            raise UnsupportedError(
                f"blending={self.blending!r} is not supported: a VDI stores what is composited "
                "along a ray; pass blending='composite', or draw the volume itself by "
                "Plotter.add_volume or pyvista_vdi.render_volume"
            )


@record
@dataclass(frozen=True, eq=False)
class Look(Described):
    """``add_volume``'s arguments that say what a scalar looks like, with its names and defaults.

    ``interpolation``, which ``add_volume`` leaves at VTK's default, is one of them. What is not
    checked here is refused where a table is built of it.
    """

    clim: RangeLike | None = option(
        None, "range of the colour map; that of all values by default", aliases=("rng",)
    )
    n_colors: int = option(256, "entries of the colour map")
    opacity: OpacityLike = option("linear", "name, one opacity, or opacities")
    cmap: ColorMapLike | None = option(
        None, "colour map; the theme's by default", aliases=("colormap",)
    )
    flip_scalars: bool = option(False, "reverse the colour map")
    opacity_unit_distance: float | None = option(
        None,
        "length over which opacities are reached, model units; the volume's diagonal over its mean "
        "number of cells by default",
        aliases=("unit_distance",),
    )
    log_scale: bool = option(False, "map values to colours by their logarithm")
    shade: bool = option(False, "light the volume")
    ambient: float | None = option(None, "ambient light that is reflected, where shaded")
    diffuse: float | None = option(0.7, "diffuse light that is reflected, where shaded")
    specular: float | None = option(0.2, "specular light that is reflected, where shaded")
    specular_power: float | None = option(10.0, "how narrow highlights are, where shaded")
    interpolation: str = option(
        "nearest",
        'between voxels; ``add_volume`` draws ``"nearest"``',
        choices=("nearest", "linear"),
        aliases=("interpolation_type",),
    )


@record
@dataclass(frozen=True, eq=False)
class Classification(Look, ArrayChoice):
    """The classification arguments of one call, checked.

    InvalidArgumentError if ``transfer_function`` or ``volume_property`` is mixed with arguments
    that it replaces, or a value cannot be used.
    """

    volume_property: VTKObject | None = option(
        None, "in place of the others, as it is", aliases=("property", "prop")
    )
    transfer_function: TransferFunction | None = option(
        None, "in place of the others; it needs no PyVista"
    )

    def __post_init__(self) -> None:
        in_place = [name for name in IN_PLACE if getattr(self, name) is not None]
        if len(in_place) > 1:
            raise InvalidArgumentError(
                "volume_property and transfer_function were both given: pass one of them"
            )
        replaced = sorted({*self.given} & {*Look.declared}) if in_place else ()
        if replaced:
            raise InvalidArgumentError(
                f"{in_place[0]} stands in place of {', '.join(replaced)}: leave out either "
                f"{in_place[0]} or the {'others' if len(replaced) > 1 else 'other'}"
            )
        super().__post_init__()

    @classmethod
    def composited(
        cls, given: Mapping[str, Any], function: str, others: Sequence[str] = ()
    ) -> "Classification":
        """Return the classification of a VDI by arguments that a function was given.

        ``others`` are the function's other keyword arguments: a TypeError for an unknown name
        suggests the nearest one. InvalidArgumentError or UnsupportedError if a value cannot be
        used.
        """
        refuse_unknown(given, function, (*declared(Classification), *others))
        made = cls(**given)
        made.require_composite()
        return made

    def require_no_look(self) -> None:
        """Refuse a look where values are kept to be classified afterwards."""
        given = {*self.given} & {*Look.declared, *IN_PLACE} - {"interpolation"}
        if "shade" in given:
            raise UnsupportedError(
                "shade=True needs the volume's gradients, which a deferred VDI does not keep: "
                "leave shade out, or classification='deferred'"
            )
        if given:
            names = ", ".join(sorted(given))
            raise InvalidArgumentError(
                f"classification='deferred' keeps values, whatever their look: give {names} to "
                "classified() of what is returned"
            )

    @property
    def in_place(self) -> bool:
        """Whether a transfer function or a property stands in place of ``add_volume``'s."""
        return any(getattr(self, name) is not None for name in IN_PLACE)

    def changed(self, changes: Mapping[str, Any]) -> "Classification":
        """Return these arguments with some of them changed."""
        return replace(self, **changes)

    def transfer_function_of(self, volume: Volume) -> TransferFunction:
        """Return the transfer function that the arguments describe for a volume.

        InvalidArgumentError if a colour map, an opacity or another value is not one that
        ``add_volume`` takes, MissingDependencyError if PyVista is needed to build it and not
        installed.
        """
        if self.transfer_function is not None:
            return _checked_transfer_function(self.transfer_function)
        if self.volume_property is not None:
            from_property = registry.method("TransferFunction.from_property")
            return from_property(  # type: ignore[no-any-return]
                self.volume_property, volume, rgba=volume.rgba
            )
        if find_spec("pyvista") is None:
            raise MissingDependencyError(
                "colour maps and opacities by name are built by PyVista, which is not installed: "
                'install it by pip install "pyvista-vdi[plot]", or pass '
                "transfer_function=pyvista_vdi.TransferFunction(colors, opacities, scalar_range)"
            )
        arguments = {each.name: getattr(self, each.name) for each in fields(Look)}
        arguments["clim"] = range_to_classify(self.scalars, self.clim)
        from_arguments = registry.method("TransferFunction.from_arguments")
        return from_arguments(  # type: ignore[no-any-return]
            volume.array, rgba=volume.rgba, **arguments
        )


def _checked_transfer_function(table: object) -> TransferFunction:
    if isinstance(table, TransferFunction):
        return table
    hint = (
        ": pass a vtkVolumeProperty as volume_property="
        if hasattr(table, "GetScalarOpacity")
        else ""
    )
    raise InvalidArgumentError(
        "transfer_function must be a pyvista_vdi.TransferFunction; "
        f"got {type(table).__name__}{hint}"
    )


#: Names that are not ours, and what is meant: ``add_volume``'s aliases and near misses.
_MEANT = {
    "size": "window_size",
    **{
        alias: each.name
        for each in declared(Classification, GenerationOptions, QualityTarget).values()
        for alias in each.aliases
    },
}


def refuse_keywords(
    given: Mapping[str, Any],
    function: Callable[..., object],
    called: str | None = None,
    aliases: Sequence[str] = (),
) -> None:
    """Raise TypeError for the first keyword that a function was given and does not know."""
    if not given:
        return
    parameters = inspect.signature(function).parameters.values()
    named = [each.name for each in parameters if each.kind is not each.VAR_KEYWORD]
    known = (*aliases, *(name for name in named if name != "self"))
    refuse_unknown(given, called or function.__name__, known)


def refuse_unknown(given: Mapping[str, Any], function: str, known: tuple[str, ...]) -> None:
    """Raise TypeError for the first argument whose name is not known, and suggest the nearest."""
    for name in given:
        if name in known:
            continue
        near = difflib.get_close_matches(name, known, n=1)
        meant = _MEANT.get(name)
        suggestion = meant if meant in known else near[0] if near else None
        hint = f"did you mean {suggestion!r}?" if suggestion else f"known are {', '.join(known)}"
        if name in ("classification", "value_range", "importance"):
            hint = "values in place of colours are kept by generate, generate_series and InSitu"
        elif (meant or name) not in known and (meant or name) in (*Look.declared, *IN_PLACE):
            hint = (
                "this VDI's colours are fixed: give it to generate, or generate with "
                "classification='deferred', which keeps values"
            )
        raise TypeError(f"{function}() got an unexpected keyword argument {name!r}: {hint}")


def _plain(value: Any) -> Any:
    """Return a value as JSON can hold it; what it cannot hold as its short description."""
    if isinstance(value, TransferFunction):
        return value.to_dict()
    if hasattr(value, "tolist"):
        value = value.tolist()
    try:
        return json.loads(json.dumps(value, allow_nan=False))
    except (TypeError, ValueError):
        return getattr(value, "name", None) or type(value).__name__
