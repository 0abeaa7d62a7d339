"""What a VDI's user can choose, as points of a sweep: one setting each."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.options import CRITERIA, check_max_supersegments
from pyvista_vdi.model.packing import PRECISIONS

#: Most settings of one sweep: each is drawn many times from every angle.
MOST_SETTINGS = 500

#: How values of an axis are spelled, the least and the most of numbers (finer steps than the engine
#: takes are refused by it), and what a sweep takes beside the default.
_AXES: Mapping[str, tuple[str, tuple[float, float] | None, tuple[Any, ...]]] = {
    "max_supersegments": ("N_S {:g}", None, (5, 10, 15, 30, 40)),
    "tolerance": ("tolerance {:g}", (0.0, 1e6), (0.01, 0.1)),
    "lists": ("lists x{:g}", (0.05, 8.0), (0.5, 1.5, 2.0)),
    "precision": ("{}", None, ("8-byte",)),
    "skip_empty": ("{}", None, (False,)),
    "preview": ("preview x{:g}", (0.02, 1.0), (0.7, 0.5, 0.35)),
    "criterion": ("{}", None, ("homogeneity",)),
    "view_cone": ("view cone {:g}", (0.0, 90.0), (0.0, 30.0, 90.0)),
    "sample_distance": ("steps {:g}", (1e-3, 100.0), (0.25, 1.0)),
}

#: Values of each axis in a sweep, beside the default.
AXES: Mapping[str, tuple[Any, ...]] = {name: values for name, (_, _, values) in _AXES.items()}

#: Axes that are swept by default; the others have a right value for each scene, or compare methods.
DEFAULT_AXES, ON_REQUEST = tuple(AXES)[:6], tuple(AXES)[6:]

#: The same where there is little time.
QUICK_AXES: Mapping[str, tuple[Any, ...]] = {
    "max_supersegments": (5, 10, 40),
    "lists": (0.5, 2.0),
    "precision": ("8-byte",),
    "skip_empty": (False,),
    "preview": (0.5,),
}


@dataclass(frozen=True)
class Setting:
    """One choice of everything that trades accuracy for time and memory.

    A value that is out of its range raises InvalidArgumentError.

    Parameters
    ----------
    max_supersegments, tolerance : int, float
        Longest list, the paper's N_S, and error per list that may be traded for shorter ones.
    lists : float
        Lists along each edge of the VDI over pixels along that edge of the frame.
    precision : {"exact", "8-byte"}
        What a supersegment takes on the device and in a file.
    skip_empty : bool
        Whether frames pass by empty space.
    preview : float
        Share of the frame's edges that is drawn, 0 to 1, before it is brought to size: what a
        plotter does while the view moves.
    criterion, view_cone : str, float
        What decides where lists are cut, and for which new views: half an angle, degrees.
    sample_distance : float
        Step of generation over the volume's smallest spacing.
    """

    max_supersegments: int = 20
    tolerance: float = 0.0
    lists: float = 1.0
    precision: str = "exact"
    skip_empty: bool = True
    preview: float = 1.0
    criterion: str = "least-error"
    view_cone: float = 60.0
    sample_distance: float = 0.5

    def __post_init__(self) -> None:
        check_max_supersegments(self.max_supersegments)
        for name, choices in (("precision", PRECISIONS), ("criterion", CRITERIA)):
            if (value := getattr(self, name)) not in choices:
                raise InvalidArgumentError(
                    f"{name} must be one of {', '.join(choices)}; got {value!r}"
                )
        for name, (_, limits, _) in _AXES.items():
            if limits is not None:
                value, (least, most) = getattr(self, name), limits
                if not (math.isfinite(value) and least <= value <= most):
                    raise InvalidArgumentError(
                        f"{name} must be from {least:g} to {most:g}; got {value!r}"
                    )

    @property
    def name(self) -> str:
        """What differs from the defaults: ``"N_S 10, lists x2"``, or ``"default"``."""
        changes = self.changes
        if "skip_empty" in changes:
            changes["skip_empty"] = "no skipping"
        return ", ".join(_AXES[n][0].format(value) for n, value in changes.items()) or "default"

    @property
    def changes(self) -> dict[str, Any]:
        """Values that differ from the defaults, by name."""
        values = {field.name: (getattr(self, field.name), field.default) for field in fields(self)}
        return {name: value for name, (value, default) in values.items() if value != default}

    @property
    def generated(self) -> "Setting":
        """The same without what can be chosen after generation: settings of one VDI share it."""
        return replace(self, precision="exact", skip_empty=True, preview=1.0)

    def to_dict(self) -> dict[str, Any]:
        """Return the values by name."""
        return asdict(self)


#: Knobs that are worth turning together: bytes spent on more lists or on longer ones, saved by
#: packing and spent again, and time saved twice.
PAIRS: tuple[Mapping[str, Any], ...] = (
    {"max_supersegments": 40, "lists": 0.5},
    {"max_supersegments": 10, "lists": 1.5},
    {"max_supersegments": 10, "lists": 2.0},
    {"max_supersegments": 5, "lists": 2.0},
    {"tolerance": 0.01, "lists": 2.0},
    {"max_supersegments": 5, "precision": "8-byte"},
    {"max_supersegments": 10, "precision": "8-byte"},
    {"max_supersegments": 40, "precision": "8-byte"},
    {"lists": 0.5, "precision": "8-byte"},
    {"lists": 1.5, "precision": "8-byte"},
    {"lists": 2.0, "precision": "8-byte"},
    {"max_supersegments": 10, "lists": 2.0, "precision": "8-byte"},
    {"precision": "8-byte", "preview": 0.7},
    {"lists": 0.5, "preview": 0.5},
    {"max_supersegments": 10, "preview": 0.5},
)


def sweep(
    axes: Mapping[str, Sequence[Any]] | Sequence[str] | None = None,
    *,
    base: Setting | None = None,
    pairs: bool = True,
) -> tuple[Setting, ...]:
    """Return the settings of a sweep: the base first, and every value of every axis by itself.

    An unknown axis, a value out of its range and too many settings raise InvalidArgumentError.

    Parameters
    ----------
    axes : mapping of str to sequence, or sequence of str, optional
        Values by name of a :class:`Setting`'s parameter, or names whose usual values are taken;
        by default N_S, tolerance, lists, precision, skipping and preview.
    base : Setting, optional
        Where all begins; the defaults of :func:`pyvista_vdi.generate` unless given.
    pairs : bool
        Add the pairs of values that are worth having together, of those axes that are swept.

    Examples
    --------
    >>> from pyvista_vdi.measure.tradeoff import sweep
    >>> [setting.name for setting in sweep({"lists": (0.5, 2)})]
    ['default', 'lists x0.5', 'lists x2']
    """
    base, axes = base or Setting(), DEFAULT_AXES if axes is None else axes
    if unknown := [name for name in axes if name not in AXES]:
        raise InvalidArgumentError(f"there is no axis {unknown[0]!r}: known are {', '.join(AXES)}")
    given = axes if isinstance(axes, Mapping) else AXES
    chosen = {name: tuple(given[name]) for name in axes}
    changes = [{}, *({n: value} for n, values in chosen.items() for value in values)]
    if pairs:
        every = (dict(pair) for pair in PAIRS)
        changes += [p for p in every if all(v in chosen.get(n, ()) for n, v in p.items())]
    settings = tuple(dict.fromkeys(replace(base, **change) for change in changes))
    if len(settings) > MOST_SETTINGS:
        raise InvalidArgumentError(
            f"the sweep has {len(settings)} settings, more than {MOST_SETTINGS}: name fewer axes "
            "or values"
        )
    return settings
