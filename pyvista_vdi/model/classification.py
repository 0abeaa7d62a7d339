"""The classification arguments: ``Plotter.add_volume``'s, or what may stand in their place."""

from __future__ import annotations

import difflib
import json
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from types import MappingProxyType
from typing import Any

import numpy as np

from pyvista_vdi import registry
from pyvista_vdi.errors import (
    InvalidArgumentError,
    InvalidVolumeError,
    MissingDependencyError,
    UnsupportedError,
)
from pyvista_vdi.model.checks import as_flag, one_of
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume

#: Names and defaults of the arguments that say what a scalar looks like: ``add_volume``'s own,
#: and ``interpolation``, which ``add_volume`` leaves at VTK's default.
DEFAULTS: MappingProxyType[str, Any] = MappingProxyType(
    {
        "scalars": None,
        "preference": "point",
        "clim": None,
        "n_colors": 256,
        "opacity": "linear",
        "cmap": None,
        "flip_scalars": False,
        "opacity_unit_distance": None,
        "log_scale": False,
        "shade": False,
        "ambient": None,
        "diffuse": 0.7,
        "specular": 0.2,
        "specular_power": 10.0,
        "blending": "composite",
        "interpolation": "nearest",
    }
)

#: What may become of the scalars along a ray, as ``add_volume`` names it; the first is the default.
BLENDINGS = ("composite", "maximum", "minimum", "average", "additive")

#: What may be given in place of the arguments above.
IN_PLACE = ("volume_property", "transfer_function")

#: Arguments that choose the array and not its looks: they go together with IN_PLACE.
_CHOOSE_THE_ARRAY = ("scalars", "preference")

#: Names that are not ours, and what is meant: ``add_volume``'s aliases and near misses.
_MEANT = MappingProxyType(
    {
        "rng": "clim",
        "colormap": "cmap",
        "property": "volume_property",
        "prop": "volume_property",
        "unit_distance": "opacity_unit_distance",
        "interpolation_type": "interpolation",
        "step": "sample_distance",
        "n_supersegments": "max_supersegments",
        "size": "window_size",
    }
)


def range_to_classify(scalars: Any, clim: Any) -> Any:
    """Return ``clim``, or the range of what a masked array does not mask, as ``add_volume`` does.

    What is masked is drawn by its value all the same.
    """
    if clim is not None or not isinstance(scalars, np.ma.MaskedArray):
        return clim
    if scalars.mask.all():
        raise InvalidVolumeError("every one of the scalars is masked: there is nothing to render")
    return float(np.nanmin(scalars)), float(np.nanmax(scalars))


class Classification:
    """The classification arguments of one call, checked.

    Parameters
    ----------
    given : mapping of str to object
        The keyword arguments as the user gave them.
    function : str
        Name of the function they were given to, for messages.
    others : tuple of str
        That function's other keyword arguments, for suggestions.
    blendings : sequence of str
        The blend modes that it has.

    Raises
    ------
    TypeError
        If a name is unknown; the message suggests the nearest one.
    InvalidArgumentError
        If ``transfer_function`` or ``volume_property`` is mixed with arguments that it replaces.
    UnsupportedError
        If another blending mode or anything else is asked for that is not honoured.
    """

    def __init__(
        self,
        given: Mapping[str, Any],
        function: str,
        others: tuple[str, ...] = (),
        blendings: Sequence[str] = BLENDINGS[:1],
    ) -> None:
        refuse_unknown(given, function, (*DEFAULTS, *IN_PLACE, *others))
        self._function = function
        self._in_place = {n: given[n] for n in IN_PLACE if given.get(n) is not None}
        self._given = {n: v for n, v in given.items() if n in DEFAULTS}
        self._refuse_mixtures()
        self._refuse_unsupported(blendings)

    @property
    def given(self) -> Mapping[str, Any]:
        """The arguments as they were given."""
        return {**self._given, **self._in_place}

    @property
    def in_place(self) -> bool:
        """Whether a transfer function or a property stands in place of ``add_volume``'s."""
        return bool(self._in_place)

    def changed(self, changes: Mapping[str, Any]) -> Classification:
        """Return these arguments with some of them changed."""
        return Classification({**self.given, **changes}, self._function)

    @property
    def blending(self) -> str:
        """What becomes of the scalars along a ray: one of :data:`BLENDINGS`."""
        return str(self._given.get("blending", DEFAULTS["blending"]))

    @property
    def scalars(self) -> Any:
        """Name of the array or its values, ``None`` for the active one."""
        return self._given.get("scalars")

    @property
    def preference(self) -> str:
        """``"point"`` or ``"cell"``: which array where both kinds have one of that name."""
        return str(self._given.get("preference", DEFAULTS["preference"]))

    def transfer_function(self, volume: Volume) -> TransferFunction:
        """Return the transfer function that the arguments describe for this volume.

        Raises
        ------
        InvalidArgumentError
            If a colour map, an opacity or another value is not one that ``add_volume`` takes.
        MissingDependencyError
            If PyVista is needed to build it and not installed.
        """
        if "transfer_function" in self._in_place:
            return self._checked_transfer_function()
        if "volume_property" in self._in_place:
            from_property = registry.method("TransferFunction.from_property")
            return from_property(  # type: ignore[no-any-return]
                self._in_place["volume_property"], volume, rgba=volume.rgba
            )
        if find_spec("pyvista") is None:
            raise MissingDependencyError(
                "colour maps and opacities by name are built by PyVista, which is not installed: "
                'install it by pip install "pyvista-vdi[plot]", or pass '
                "transfer_function=pyvista_vdi.TransferFunction(colors, opacities, scalar_range)"
            )
        left_out = (*_CHOOSE_THE_ARRAY, "blending")
        arguments = {n: v for n, v in {**DEFAULTS, **self._given}.items() if n not in left_out}
        arguments["clim"] = range_to_classify(self.scalars, arguments["clim"])
        from_arguments = registry.method("TransferFunction.from_arguments")
        return from_arguments(  # type: ignore[no-any-return]
            volume.array, rgba=volume.rgba, **arguments
        )

    def describe(self) -> dict[str, Any]:
        """Return the arguments as given, in values that JSON can hold."""
        return {name: _plain(value) for name, value in self.given.items()}

    def _refuse_mixtures(self) -> None:
        if len(self._in_place) > 1:
            raise InvalidArgumentError(
                "volume_property and transfer_function were both given: pass one of them"
            )
        replaced = sorted(set(self._given) - {*_CHOOSE_THE_ARRAY, "blending"})
        if self._in_place and replaced:
            (name,) = self._in_place
            raise InvalidArgumentError(
                f"{name} stands in place of {', '.join(replaced)}: "
                f"leave out either {name} or the {'others' if len(replaced) > 1 else 'other'}"
            )

    def _refuse_unsupported(self, blendings: Sequence[str]) -> None:
        one_of(self.blending, "blending", BLENDINGS)
        if self.blending not in blendings:
            raise UnsupportedError(
                f"blending={self.blending!r} is not supported: a VDI stores what is composited "
                "along a ray; pass blending='composite', or draw the volume itself by "
                "Plotter.add_volume or pyvista_vdi.render_volume"
            )
        one_of(self._given.get("interpolation", "nearest"), "interpolation", ("nearest", "linear"))
        one_of(self.preference, "preference", ("point", "cell"))
        for name in ("flip_scalars", "log_scale", "shade"):
            as_flag(self._given.get(name), name)

    def _checked_transfer_function(self) -> TransferFunction:
        table = self._in_place["transfer_function"]
        if not isinstance(table, TransferFunction):
            hint = (
                ": pass a vtkVolumeProperty as volume_property="
                if hasattr(table, "GetScalarOpacity")
                else ""
            )
            raise InvalidArgumentError(
                f"transfer_function must be a pyvista_vdi.TransferFunction; "
                f"got {type(table).__name__}{hint}"
            )
        return table


def refuse_unknown(given: Mapping[str, Any], function: str, known: tuple[str, ...]) -> None:
    """Raise TypeError for the first argument whose name is not known, and suggest the nearest."""
    for name in given:
        if name in known:
            continue
        near = difflib.get_close_matches(name, known, n=1)
        meant = _MEANT.get(name)
        suggestion = meant if meant in known else near[0] if near else None
        hint = f"did you mean {suggestion!r}?" if suggestion else f"known are {', '.join(known)}"
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
