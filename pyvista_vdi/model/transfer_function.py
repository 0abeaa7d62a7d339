"""The transfer function: scalar to colour and opacity, one table."""

from __future__ import annotations

import reprlib
from dataclasses import KW_ONLY, asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.checks import Number, as_floats, as_range, one_of
from pyvista_vdi.model.lighting import Shading

#: Optical depth that a fully opaque sample gets per step: exp(-30) is 1e-13, nothing passes.
OPAQUE_OPTICAL_DEPTH = 30.0

#: Share of a volume's scalar range beyond which VTK tells no gradient magnitudes apart.
GRADIENT_SHARE = 0.25


@dataclass(frozen=True, eq=False, repr=False)
class TransferFunction:
    """Colour and opacity by scalar, piecewise linear between equidistant nodes.

    Immutable. Scalars outside ``scalar_range`` take the nearest end's entry; NaN is transparent.
    An RGBA volume has colours of its own: only the opacities are taken, by its fourth component.

    Parameters
    ----------
    colors : array_like of float, shape (n, 3)
        RGB, 0 to 1, at n equidistant scalars from ``scalar_range[0]`` to ``scalar_range[1]``.
    opacities : array_like of float, shape (n,)
        Opacity a, 0 to 1, of a slab of thickness ``unit_distance`` at those scalars.
    scalar_range : (float, float)
        Scalars of the first and of the last entry; where they are equal, every scalar takes the
        first entry at or below, and the last entry above.
    unit_distance : float, optional
        Opacity unit distance U in model units; by default the volume's
        :attr:`~pyvista_vdi.Volume.default_unit_distance`.
    interpolation : {"nearest", "linear"}
        How samples are taken between the volume's points. ``"nearest"`` is what
        ``Plotter.add_volume`` draws by default (VTK's default volume property).
    shading : Shading, optional
        How samples reflect light; without it they have the table's colours.
    gradient_opacities : array_like of float, shape (n,), optional
        Factors of a step's opacity, 0 to 1, at n equidistant gradient magnitudes.
    gradient_range : (float, float), optional
        Gradient magnitudes of the first and of the last factor, in scalars per mean spacing.

    Raises
    ------
    InvalidArgumentError
        If the tables do not fit together or a value is out of range.

    Notes
    -----
    The extinction at a scalar x is sigma(x) = -log1p(-a(x)) / U: opacity is interpolated first and
    converted then, as VTK does (docs/dev/conventions.md#from-a-volume-to-the-medium). Where a is 1
    the medium is opaque whatever U is: every step then has an optical depth of at least
    :data:`OPAQUE_OPTICAL_DEPTH`.

    A gradient opacity g makes of a step's opacity alpha g alpha, as VTK's GPU mapper does. The
    magnitude is that of central differences over a voxel each way, times the mean of the three
    spacings; above a quarter of the volume's scalar range it counts as that, which is where VTK's
    table ends.
    """

    colors: Any
    opacities: Any
    scalar_range: Any
    _: KW_ONLY
    unit_distance: float | None = None
    interpolation: str = "nearest"
    shading: Shading | None = None
    gradient_opacities: Any = None
    gradient_range: Any = None

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "colors", _table("colors", self.colors, (3,)))
        put(self, "opacities", _table("opacities", self.opacities, ()))
        if len(self.colors) != len(self.opacities):
            raise InvalidArgumentError(
                f"a transfer function needs as many opacities as colors; got "
                f"{len(self.opacities)} and {len(self.colors)}"
            )
        low, high = as_range(self.scalar_range)
        if not (np.isfinite(low) and np.isfinite(high) and low <= high):
            raise InvalidArgumentError(
                f"scalar_range (clim) must be two finite numbers, the smaller first; "
                f"got {self.scalar_range!r}"
            )
        put(self, "scalar_range", (low, high))
        length = Number("a length in model units", open_ended=True, none=True)
        put(self, "unit_distance", length(self.unit_distance, "unit_distance"))
        one_of(self.interpolation, "interpolation", ("nearest", "linear"))
        if not isinstance(self.shading, Shading | None):
            raise InvalidArgumentError(
                f"shading must be a pyvista_vdi.Shading; got {type(self.shading).__name__}"
            )
        if self.gradient_opacities is not None or self.gradient_range is not None:
            factors = _table("gradient_opacities", self.gradient_opacities, ())
            low, high = as_range(self.gradient_range)
            if not (np.isfinite(low) and np.isfinite(high) and 0 <= low < high):
                raise InvalidArgumentError(
                    "gradient_range must be the two magnitudes of gradient_opacities, "
                    f"0 <= low < high; got {self.gradient_range!r}"
                )
            put(self, "gradient_opacities", factors)
            put(self, "gradient_range", (low, high))

    replace = replace

    def to_dict(self) -> dict[str, Any]:
        """Return what can be written to JSON: the whole table and its range."""
        return {
            name: asdict(value) if isinstance(value, Shading) else np.asarray(value).tolist()
            for name, value in vars(self).items()
            if value is not None or name == "unit_distance"
        }

    @classmethod
    def from_dict(cls, state: dict[str, Any]) -> TransferFunction:
        """Return the transfer function that :meth:`to_dict` described."""
        try:
            shading = state.get("shading")
            return cls(**{**state, "shading": None if shading is None else Shading(**shading)})
        except (TypeError, AttributeError) as error:
            raise InvalidArgumentError(
                f"this is no description of a transfer function: {error}"
            ) from error

    def __eq__(self, other: object) -> bool:
        return isinstance(other, TransferFunction) and all(
            np.array_equal(own, others)
            for own, others in zip(vars(self).values(), vars(other).values(), strict=True)
        )

    def __hash__(self) -> int:
        return hash((self.colors.tobytes(), self.opacities.tobytes(), self.scalar_range))

    def __repr__(self) -> str:
        return (
            f"TransferFunction({len(self.opacities)} entries over {self.scalar_range}, "
            f"unit_distance={self.unit_distance}, interpolation={self.interpolation!r})"
        )


def _table(name: str, values: ArrayLike, item: tuple[int, ...]) -> NDArray[np.float32]:
    with np.errstate(over="ignore"):  # infinite then, and refused for its value
        table = as_floats(values).astype(np.float32)
    shaped = table.ndim == 1 + len(item) and table.shape[1:] == item and len(table) > 0
    if not shaped or not ((table >= 0) & (table <= 1)).all():
        ends = f", from {table.min()} to {table.max()}" if table.size else ""
        raise InvalidArgumentError(
            f"{name} must be numbers from 0 to 1, of shape {'(n, 3)' if item else '(n,)'}; got "
            f"{reprlib.repr(values)}, of shape {table.shape}{ends}"
        )
    table.setflags(write=False)
    return table
