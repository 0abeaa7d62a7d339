"""The options: each declared once, in records that are checked where they are made.

A field that is made by :func:`option` declares an option: its name, type and default as in any
dataclass, and beside them what it means in a sentence, what it is checked by, its choices and other
names. The public functions write the same names and defaults out, which ``tests/api/test_options``
compares; the command line and ParaView's properties are made of :func:`declared`.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import partial
from typing import Any, ClassVar, TypeVar

import numpy as np

from pyvista_vdi.errors import InvalidArgumentError, InvalidArgumentTypeError, UnsupportedError
from pyvista_vdi.model.ambient_occlusion import AmbientOcclusion, OcclusionGrid
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import (
    as_flag,
    as_float,
    as_range,
    as_whole,
    check_callback,
    memory_limit_bytes,
    one_of,
)
from pyvista_vdi.model.lighting import Lights
from pyvista_vdi.model.packing import PRECISIONS
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.types import DeviceLike, Metadata, Progress
from pyvista_vdi.model.volume import Volume

#: Most supersegments that a list may be allowed.
MAX_SUPERSEGMENTS = 4096

#: What may decide where a list is cut that must be shortened; ``docs/concepts.md`` says what each
#: means. The first is the default.
CRITERIA = ("least-error", "homogeneity")

#: The SSIM that a name asks for. "reference" asks for nothing: it is what is made without a target.
QUALITIES: dict[str, float | None] = {
    "reference": None,
    "high": 0.98,
    "balanced": 0.96,
    "fast": 0.93,
}

#: Merge error that no picture shows: a difference of a thousandth of full opacity over one voxel.
_INDISTINGUISHABLE = 1e-6

_Record = TypeVar("_Record", bound="Options")


@dataclass(frozen=True)
class Option:
    """An option, as it is declared: an argument's ``name``, its ``default``, ``what`` it means.

    ``what`` is a sentence that begins small and has no full stop. ``check`` returns a value as it
    is kept, or raises InvalidArgumentError; without one a value is one of the choices, a truth
    value where the default is one, and else whatever is given. ``choices`` are the texts that are
    taken, where these are all; ``aliases`` other names by which users may call it; ``standard`` is
    the default as it is kept.
    """

    name: str
    default: Any
    what: str
    check: Callable[[Any], Any] | None = None
    choices: tuple[str, ...] = ()
    aliases: tuple[str, ...] = ()
    standard: Any = None

    def named(self, name: str) -> "Option":
        """Return it with its name, and with a check that follows from choices and default."""
        check = self.check
        if check is None and self.choices:
            check = partial(one_of, name=name, names=self.choices)
        elif check is None and isinstance(self.default, bool):
            check = partial(as_flag, name=name)
        standard = self.default if check is None else check(self.default)
        return replace(self, name=name, check=check, standard=standard)


def option(
    default: Any,
    what: str,
    check: Callable[[Any], Any] | None = None,
    *,
    choices: Sequence[str] = (),
    aliases: Sequence[str] = (),
) -> Any:
    """Declare an option as a field of a record."""
    told = Option("", default, what, check, tuple(choices), tuple(aliases))
    return field(default=default, metadata={"option": told})


def declared(*records: "type[Options]") -> dict[str, Option]:
    """Return the options that some records declare, by their names."""
    return {name: told for record in records for name, told in record.declared.items()}


@dataclass(frozen=True)
class Options:
    """A record of options, each checked and brought to its type when the record is made."""

    #: The options, by their names.
    declared: ClassVar[Mapping[str, Option]] = {}

    def __post_init__(self) -> None:
        for name, told in self.declared.items():
            value = getattr(self, name)
            if told.check is not None:  # defaults were checked where they were declared
                kept = told.standard if value is told.default else told.check(value)
                object.__setattr__(self, name, kept)

    @classmethod
    def checked(cls: type[_Record], *given: Any, **named: Any) -> _Record:
        """Return a record of what a user gave, whatever its types are."""
        return cls(*given, **named)

    @classmethod
    def of(cls: type[_Record], options: _Record | None, changes: Mapping[str, Any]) -> _Record:
        """Return options with some of them changed, or the defaults; TypeError if one is none."""
        if options is None:
            return cls(**changes)
        if not isinstance(options, cls):
            raise InvalidArgumentTypeError(f"options must be {cls.__name__}; got {options!r}")
        return replace(options, **changes) if changes else options

    @property
    def given(self) -> dict[str, Any]:
        """The options that differ from their defaults; arrays always do."""
        found = {}
        for name, told in self.declared.items():
            value, default = getattr(self, name), told.standard
            if value is not default and not (type(value) is type(default) and value == default):
                found[name] = value
        return found


def record(cls: type[_Record]) -> type[_Record]:
    """Gather the options that a record's fields declare; for classes, above ``@dataclass``."""
    told = {each.name: each.metadata.get("option") for each in fields(cls)}
    cls.declared = {name: each.named(name) for name, each in told.items() if each}
    return cls


def check_max_supersegments(max_supersegments: Any) -> int:
    """Return ``max_supersegments`` as an int between 1 and :data:`MAX_SUPERSEGMENTS`."""
    limit = as_whole(max_supersegments)
    if not 1 <= limit <= MAX_SUPERSEGMENTS:
        raise InvalidArgumentError(
            f"max_supersegments must be a whole number from 1 to {MAX_SUPERSEGMENTS}; "
            f"got {max_supersegments!r}"
        )
    return int(limit)


def _tolerance(tolerance: Any) -> float:
    difference = as_float(tolerance)
    if not 0 <= difference < np.inf:
        raise InvalidArgumentError(f"tolerance must be a number >= 0; got {tolerance!r}")
    return difference


def _view_cone(view_cone: Any) -> float:
    angle = as_float(view_cone)
    if not 0 <= angle <= 90:
        raise InvalidArgumentError(
            f"view_cone must be an angle between 0 and 90 degrees; got {view_cone!r}"
        )
    return angle


def _within(name: str, high: float, what: str) -> Callable[[Any], float | None]:
    """Return a check of a number above 0 and below another; ``None`` passes."""

    def check(value: Any) -> float | None:
        number = as_float(value)
        if value is not None and (isinstance(value, bool) or not 0 < number < high):
            raise InvalidArgumentError(f"{name} must be {what}; got {value!r}")
        return None if value is None else number

    return check


@record
@dataclass(frozen=True)
class MediumOptions(Options):
    """How a classified volume is sampled: what generation and volume rendering both need.

    Attributes
    ----------
    sample_distance : float, optional
        Length of a step along a ray, model units; half the smallest spacing by default. What a
        volume allows is checked with the volume.
    lights : Lights
        What a shaded volume is lit by; one headlight by default. Whatever
        :meth:`Lights.from_any` takes may be given.
    ambient_occlusion : AmbientOcclusion, optional
        Darkens what is hidden from the light around it; whatever
        :meth:`AmbientOcclusion.from_any` takes may be given.
    memory_limit : int, optional
        Most bytes to take on the device, or a text such as ``"2 GiB"``; by default what the device
        has. A volume that does not fit goes there brick by brick, which takes more time and
        changes no bit.

    Raises
    ------
    InvalidArgumentError
        If a value is out of range.
    """

    sample_distance: float | None = option(
        None, "length of a step along a ray, model units", aliases=("step",)
    )
    lights: Lights = option(None, "what a shaded volume is lit by", Lights.from_any)
    ambient_occlusion: AmbientOcclusion | None = option(
        None, "darken what is hidden from the light around it", AmbientOcclusion.from_any
    )
    memory_limit: int | None = option(None, "most memory to take on the device", memory_limit_bytes)

    def occlusion_bytes(self, volume: Volume) -> int:
        """Return what the grid of the ambient occlusion takes on the device, bytes."""
        if self.ambient_occlusion is None:
            return 0
        return OcclusionGrid.of(volume, self.ambient_occlusion).nbytes


@record
@dataclass(frozen=True)
class GenerationOptions(MediumOptions):
    """How a VDI is made.

    Attributes
    ----------
    max_supersegments : int
        Longest list, 1 to 4096; never exceeded, and nothing that is not transparent is dropped.
    criterion : {"least-error", "homogeneity"}
        What decides where a list that must be shortened is cut. ``"least-error"``: neighbours are
        merged where the error is least. ``"homogeneity"`` (the paper's, after Frey et al. 2013): a
        supersegment goes on while the medium is like its mean so far, by the least threshold that
        keeps the budget on this ray. It records up to 512 runs of a ray before unlike ones are
        merged, which takes more time and, in wide windows, memory. By both, neighbours within
        ``tolerance`` are merged.
    tolerance : float
        Neighbours are merged even under budget where this changes (opacity-weighted colour,
        opacity) per voxel, in the root of the sum of squares along the ray, by no more than this.
        0 merges only what is homogeneous.
    view_cone : float
        Half angle in degrees, 0 to 90, of the cone of views that must be served: what V_O cannot
        see at all counts ``1 - cos(view_cone)`` as much as what it sees when neighbours are merged
        by least error or within ``tolerance``. ``"homogeneity"`` cuts without regard to it.
    precision : {"exact", "8-byte"}
        What a supersegment takes; see :meth:`VDI.with_precision`.
    sample_distance, lights, ambient_occlusion, memory_limit
        As for :class:`MediumOptions`. The light is baked into the colours: it stays as it is where
        V_O has it. So is the occlusion, which is the same from every view.

    Raises
    ------
    InvalidArgumentError
        If a value is out of range.
    """

    # A new field goes behind the others: the public functions give them by their order
    max_supersegments: int = option(
        20, "longest list, 1 to 4096", check_max_supersegments, aliases=("n_supersegments",)
    )
    criterion: str = option(
        "least-error",
        "what decides where a list that must be shortened is cut",
        choices=CRITERIA,
    )
    tolerance: float = option(0.0, "error that may be traded for shorter lists", _tolerance)
    view_cone: float = option(
        60.0, "half angle of the cone of new views that must be served, degrees", _view_cone
    )
    precision: str = option("exact", "what a supersegment takes", choices=PRECISIONS)

    @property
    def hidden_weight(self) -> float:
        """Weight of what V_O cannot see at all when neighbours are merged, 0 to 1."""
        return float(1 - np.cos(np.radians(self.view_cone)))

    @property
    def finest_error(self) -> float:
        """Merge error up to which neighbours are always merged."""
        # Differences stay below 1e18, whose square float32 still holds
        return max(min(self.tolerance, 1e18) ** 2, _INDISTINGUISHABLE)


@record
@dataclass(frozen=True)
class Deferral(Options):
    """When scalars are classified, and what is kept of them until then: docs/deferred.md.

    Attributes
    ----------
    classification : {"baked", "deferred"}
        When scalars are classified: as the VDI is made, or by whoever shows it.
    value_range : (float, float), optional
        Least and largest scalar to keep; all by default.
    importance : array_like of float, optional
        Weights over the range, or points (scalar, weight), by which errors count; 1 by default.

    Raises
    ------
    InvalidArgumentError
        If a range or an importance is given and nothing is deferred.
    """

    classification: str = option(
        "baked",
        "when scalars are classified: as the VDI is made, or by whoever shows it",
        choices=("baked", "deferred"),
    )
    value_range: Any = option(None, "least and largest scalar to keep, where deferred")
    importance: Any = option(None, "how much errors count over the range, where deferred")

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("value_range", "importance"):
            if getattr(self, name) is not None and self.classification != "deferred":
                raise InvalidArgumentError(
                    f"{name}={getattr(self, name)!r} says what is kept to be classified "
                    f"afterwards: give classification='deferred' as well, or leave {name} out"
                )
        low, high = (0, 1) if self.value_range is None else as_range(self.value_range)
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise InvalidArgumentError(
                f"value_range must be two finite scalars, low < high; got {self.value_range!r}"
            )

    @property
    def deferred(self) -> bool:
        """Whether values are kept."""
        return self.classification == "deferred"

    def refuse_target(self, target: "QualityTarget") -> None:
        """Refuse, where values are kept, a target by which settings would be chosen."""
        if self.deferred and target:
            raise UnsupportedError(
                f"{', '.join(target.given)} choose settings by a look, which a deferred VDI does "
                "not have: give max_supersegments"
            )


@record
@dataclass(frozen=True)
class QualityTarget(Options):
    """What is asked of a VDI in place of settings, which are chosen to reach it: docs/dial.md.

    Attributes
    ----------
    quality : {"reference", "high", "balanced", "fast"}, optional
        A name for an SSIM; ``"reference"`` asks for nothing.
    target_ssim : float, optional
        Goal: SSIM of a picture at ``target_angle`` against volume rendering.
    target_fps : float, optional
        Limit: frames per second of full frames, at least.
    max_bytes : int, optional
        Limit: bytes of the VDI on the device.
    target_angle : float
        Degrees from V_O.

    Raises
    ------
    InvalidArgumentError
        If one is out of range, or they contradict each other.
    """

    quality: str | None = option(
        None,
        "choose the settings by how good pictures are to be",
        lambda name: name if name is None else one_of(name, "quality", tuple(QUALITIES)),
        choices=tuple(QUALITIES),
    )
    target_ssim: float | None = option(
        None, "the same by a number, 0 to 1", _within("target_ssim", 1, "an SSIM between 0 and 1")
    )
    target_fps: float | None = option(
        None,
        "least full frames per second",
        _within("target_fps", math.inf, "frames per second above 0"),
    )
    max_bytes: int | None = option(
        None,
        "most bytes of the VDI on the device",
        _within("max_bytes", math.inf, "a number of bytes above 0"),
    )
    target_angle: float = option(
        30.0,
        "degrees by which the view is turned from V_O for which the SSIM is predicted",
        _within("target_angle", 180, "an angle between 0 and 180 degrees"),
    )

    def __post_init__(self) -> None:
        if self.quality is not None and self.target_ssim is not None:
            raise InvalidArgumentError(
                f"quality={self.quality!r} and target_ssim={self.target_ssim!r} both say how good "
                "pictures are to be: give one of them"
            )
        super().__post_init__()
        if self.max_bytes is not None:
            object.__setattr__(self, "max_bytes", int(self.max_bytes))
        if self.quality == "reference" and (self.target_fps, self.max_bytes) != (None, None):
            raise InvalidArgumentError(
                "quality='reference' is what is made without a dial, so that target_fps and "
                "max_bytes have nothing to choose: leave them out, or ask for 'high'"
            )

    @property
    def ssim(self) -> float | None:
        """The goal, by its name or as a number."""
        return self.target_ssim if self.quality is None else QUALITIES[self.quality]

    def __bool__(self) -> bool:
        """Whether anything is asked for, so that settings are to be chosen."""
        return (self.ssim, self.target_fps, self.max_bytes) != (None, None, None)

    def to_dict(self) -> dict[str, Any]:
        """Return what was asked for, by the names of the arguments."""
        return {name: value for name, value in self.given.items() if name != "target_angle"}


#: The names of what :class:`GenerationOptions` takes, which tell it from a classification.
GENERATION_NAMES = tuple(declared(GenerationOptions))


@dataclass(frozen=True, eq=False)
class GenerationRequest:
    """A VDI that is asked for: of what, from where, and how; carried whole to what makes it.

    Parameters
    ----------
    volume : Volume
        The scalars.
    transfer_function : TransferFunction
        Scalar to colour and opacity.
    camera : Camera or vtkCamera or pyvista.Camera
        The generating view V_O.
    window_size : (int, int)
        Width and height of V_O's window in pixels: one list each.
    options : GenerationOptions
        How it is made.
    device : optional
        See :func:`pyvista_vdi.list_devices`.
    progress : callable, optional
        Called with the fraction done, 0 to 1, between slices of work; when it returns False the
        work is given up.
    metadata : mapping
        Entries to add to ``vdi.metadata``.

    Raises
    ------
    InvalidCameraError, InvalidArgumentError
        If the camera, the window or ``progress`` cannot be used.
    """

    volume: Volume
    transfer_function: TransferFunction
    camera: Camera
    window_size: tuple[int, int]
    options: GenerationOptions = field(default_factory=GenerationOptions)
    device: DeviceLike | None = None
    progress: Progress | None = None
    metadata: Metadata = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_callback(self.progress)
        object.__setattr__(self, "camera", Camera.from_any(self.camera))
        object.__setattr__(self, "window_size", check_window_size(self.window_size))

    def replace(self, **changes: Any) -> "GenerationRequest":
        """Return the same request but for some of its fields."""
        return replace(self, **changes)
