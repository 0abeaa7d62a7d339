"""The options: each declared once, in records that are checked where they are made.

A field that is made by :func:`option` declares an option: its name, type and default as in any
dataclass, and beside them what it means, what it is checked by, its choices and other names. All
else follows: arguments of functions, their docstrings and stubs (``model/arguments.py``), options
of the command line, Set and Get of VTK's filters, and ParaView's properties.
"""

from __future__ import annotations

import json
import math
import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache, partial
from typing import Any, ClassVar, Literal, TypeAlias, TypeVar, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.model import types
from pyvista_vdi.model.ambient_occlusion import AmbientOcclusion, OcclusionGrid
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import (
    Number,
    as_flag,
    as_floats,
    as_range,
    check_callback,
    one_of,
)
from pyvista_vdi.model.cropping import Cropping
from pyvista_vdi.model.lighting import Lights
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.types import (
    Coverage,
    Criterion,
    DeviceLike,
    Draw,
    Policy,
    Precision,
    Progress,
    Quality,
    When,
)
from pyvista_vdi.model.volume import Volume

#: Most supersegments that a list may be allowed.
MAX_SUPERSEGMENTS = 4096

#: A ray ends where less transmittance than this is left, unless told otherwise: no channel loses
#: more than that.
TRANSMITTANCE_CUTOFF = 1e-6
#: Most samples of a ray in a preview: each has a half, and float32 counts halves up to 2^24.
MAX_PREVIEW_SAMPLES = 2**23

#: Origin and normal of each plane; the side that the normal points to is kept.
Planes: TypeAlias = tuple[tuple[float, ...], ...]

#: The SSIM that a name asks for. "reference" asks for nothing: it is what is made without a target.
QUALITIES: dict[str, float | None] = {
    "reference": None,
    "high": 0.98,
    "balanced": 0.96,
    "fast": 0.93,
}

#: Merge error that no picture shows: a difference of a thousandth of full opacity over one voxel.
_INDISTINGUISHABLE = 1e-6

#: What may be said of bytes.
_BYTES = Number("a whole number of bytes", 1, whole=True)

_Record = TypeVar("_Record", bound="Options")

#: The records that are declared.
RECORDS: list[type[Options]] = []


@dataclass
class Option:
    """An option, as it is declared.

    ``what`` is a sentence that begins small without a full stop, ``more`` those behind it; ``kind``
    is the argument's type. ``check`` returns a value as it is kept, or raises InvalidArgumentError;
    without one it is one of the ``choices``, a truth value where the default is one, or anything. A
    ``setting`` stands in :class:`Settings`; ``standard`` is the default as it is kept.
    """

    name: str
    default: Any
    what: str
    more: str = ""
    kind: str = "Any"
    check: Callable[[Any], Any] | None = None
    choices: tuple[str, ...] = ()
    setting: bool = False
    standard: Any = None


#: What documentation calls the types of ``model/types.py``.
_WORDS = {
    "ArrayLike": "array_like of float",
    "CameraLike": "pyvista.Camera or vtkCamera or Camera",
    "ColorMapLike": "str, list, matplotlib colour map or pyvista.LookupTable",
    "CroppingLike": "Cropping or vtkVolumeMapper or sequence of six numbers or pair",
    "DeviceLike": "str or int",
    "LightsLike": "renderer, or sequence of Light, vtkLight or pyvista.Light",
    "MatrixLike": "array_like, shape (4, 4)",
    "OcclusionLike": "bool, float or AmbientOcclusion",
    "OpacityLike": "str or float or array_like",
    "RangeLike": "float or (float, float)",
    "ScalarsLike": "str or numpy.ndarray",
    "VTKObject": "vtkVolumeProperty",
}


def option(
    default: Any,
    what: str,
    more: str = "",
    *,
    check: Callable[[Any], Any] | None = None,
    takes: str = "",
    setting: bool = False,
) -> Any:
    """Declare an option as a field of a record; it ``takes`` a type, by default the field's."""
    told = Option("", default, what, more, takes, check, (), setting)
    return field(default=default, metadata={"option": told})


@cache
def declared(*records: type[Options]) -> Mapping[str, Option]:
    """Return the options that some records declare, by their names."""
    return {name: told for record in records for name, told in record.declared.items()}


@dataclass(frozen=True)
class Options:
    """A record of options, each checked and brought to its type when the record is made."""

    #: The options, by their names.
    declared: ClassVar[Mapping[str, Option]] = {}
    #: What is said of one where it is not taken.
    elsewhere: ClassVar[str] = ""

    def __post_init__(self) -> None:
        for name, told in self.declared.items():
            value = getattr(self, name)
            if told.check is not None:  # defaults were checked where they were declared
                kept = told.standard if value is told.default else told.check(value)
                object.__setattr__(self, name, kept)

    @property
    def given(self) -> dict[str, Any]:
        """The options that differ from their defaults; arrays always do."""
        found = {}
        for name, told in self.declared.items():
            value, default = getattr(self, name), told.standard
            if value is not default and not (type(value) is type(default) and value == default):
                found[name] = value
        return found

    def describe(self) -> dict[str, Any]:
        """Return :attr:`given` for metadata; what JSON cannot hold as a short description."""
        found = {}
        for name, given in self.given.items():
            value = given.to_dict() if isinstance(given, TransferFunction) else given
            value = value.tolist() if hasattr(value, "tolist") else value
            try:
                found[name] = json.loads(json.dumps(value, allow_nan=False))
            except (TypeError, ValueError):
                found[name] = getattr(value, "name", None) or type(value).__name__
        return found


def record(cls: type[_Record]) -> type[_Record]:
    """Gather the options that a record's fields declare; for classes, above ``@dataclass``."""
    cls.declared = {each.name: each.metadata["option"] for each in fields(cls) if each.metadata}
    for each in fields(cls):
        told = cls.declared.get(each.name)
        if told is None or told.name:  # it is of the record that this one extends
            continue
        told.name, told.kind = each.name, told.kind or str(each.type)
        none, alias = "None" in told.kind, getattr(types, told.kind.removesuffix(" | None"), None)
        if isinstance(told.check, Number):
            told.check = replace(told.check, name=told.name, none=none)
        elif told.check is None and get_origin(alias) is Literal:
            told.choices = get_args(alias)
            told.check = partial(one_of, name=told.name, names=told.choices, none=none)
        elif told.check is None and told.kind == "bool":
            told.check = partial(as_flag, name=told.name)
        told.standard = told.default if told.check is None else told.check(told.default)
    RECORDS.append(cls)
    return cls


def entries(options: Iterable[Option], indent: int = 4) -> str:
    """Return what documentation has of options, as numpydoc's parameters."""
    margin, text = " " * indent, ""
    for told in options:
        words = [_WORDS.get(part, part) for part in told.kind.split(" | ") if part != "None"]
        if told.choices:
            words = ['{"' + '", "'.join(told.choices) + '"}']
        optional = ", optional" if "None" in told.kind else ""
        text += f"{margin}{told.name} : {' or '.join(words)}{optional}\n"
        said = f"{told.what[0].upper()}{told.what[1:]}. {told.more}".rstrip()
        inner: Any = {"initial_indent": margin + "    ", "subsequent_indent": margin + "    "}
        text += textwrap.fill(said, 100, break_long_words=False, **inner) + "\n"
    return text


@record
@dataclass(frozen=True)
class MediumOptions(Options):
    """How a classified volume is sampled: what generation and volume rendering both need."""

    sample_distance: float | None = option(
        None,
        "length of a step along a ray, model units; half the smallest spacing by default",
        check=Number("a length in model units", open_ended=True),
        setting=True,
    )
    lights: Lights = option(
        None,
        "what a shaded volume is lit by; one headlight by default, which is VTK's",
        "Pass ``plotter.renderer`` for a plotter's. A VDI has them as they stand at its view.",
        check=Lights.from_any,
        takes="LightsLike | None",
    )
    ambient_occlusion: AmbientOcclusion | None = option(
        None,
        "darken what is hidden from the light around it",
        "``True``, or the radius up to which something hides, model units.",
        check=AmbientOcclusion.from_any,
        takes="OcclusionLike | None",
    )
    memory_limit: int | None = option(
        None,
        "most memory to take on the device",
        "Bytes; by default what the device has. A volume that does not fit goes there brick by "
        "brick, which takes more time and changes no bit.",
        check=_BYTES,
        setting=True,
    )

    def occlusion_bytes(self, volume: Volume) -> int:
        """Return what the grid of the ambient occlusion takes on the device, bytes."""
        if self.ambient_occlusion is None:
            return 0
        return OcclusionGrid(volume, self.ambient_occlusion).nbytes


@record
@dataclass(frozen=True)
class GenerationOptions(MediumOptions):
    """How a VDI is made."""

    max_supersegments: int = option(
        20,
        f"longest list, 1 to {MAX_SUPERSEGMENTS}",
        "A promise: never exceeded, and nothing that is not transparent is dropped for it.",
        check=Number(low=1, high=MAX_SUPERSEGMENTS, whole=True),
    )
    criterion: Criterion = option(
        "least-error",
        "what decides where a list that must be shortened is cut",
        '``"least-error"``: neighbours are merged where the error is least. ``"homogeneity"`` (the '
        "paper's, after Frey et al. 2013): a supersegment goes on while the medium is like its "
        "mean so far, by the least threshold that keeps the budget on this ray.",
        setting=True,
    )
    tolerance: float = option(
        0.0,
        "error that may be traded for shorter lists",
        "Per voxel, in opacity-weighted colour and opacity. 0 merges only what is homogeneous.",
        check=Number(),
        setting=True,
    )
    view_cone: float = option(
        60.0,
        "half angle of the cone of new views that must be served, degrees",
        "The wider, the more of the budget goes to what the generating view cannot see: "
        "``1 - cos(view_cone)`` of what the seen counts.",
        check=Number("an angle in degrees", high=90),
        setting=True,
    )
    precision: Precision = option(
        "exact",
        "what a supersegment takes",
        "On devices and in files: see :meth:`VDI.with_precision`.",
    )

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
    """When scalars are classified, and what is kept of them until then: docs/deferred.md."""

    classification: When = option(
        "baked",
        "when scalars are classified: as the VDI is made, or by whoever shows it",
        "Deferred, it is a :class:`DeferredVDI`, of which ``classified(cmap=..., opacity=...)`` "
        "makes a VDI without the volume, and in a plotter ``actor.prop`` (docs/deferred.md). Of "
        "the look it takes ``interpolation`` only.",
    )
    value_range: Any = option(
        None,
        "least and largest scalar to keep, where deferred",
        "All by default. What is outside is empty.",
        takes="RangeLike | None",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.value_range is not None and not self.deferred:
            raise InvalidArgumentError(
                f"value_range={self.value_range!r} says what is kept to be classified afterwards: "
                "give classification='deferred' as well, or leave value_range out"
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

    def refuse_target(self, target: QualityTarget) -> None:
        """Refuse, where values are kept, a target by which settings would be chosen."""
        if self.deferred and target:
            raise UnsupportedError(
                f"{', '.join(target.given)} choose settings by a look, which a deferred VDI does "
                "not have: give max_supersegments"
            )


@record
@dataclass(frozen=True)
class QualityTarget(Options):
    """What is asked of a VDI in place of settings, which are chosen to reach it: docs/dial.md."""

    quality: Quality | None = option(
        None,
        "choose the settings by how good pictures are to be",
        "By a table: an SSIM against volume rendering of 0.98, 0.96 or 0.945 in the mean of 48 "
        'scenes. ``"reference"`` is what is made where nothing is given. ``target_ssim``, '
        "``full_fps`` and ``max_bytes`` have the scene measured on the device, once. All choose "
        "the VDI's ``window_size``, ``max_supersegments`` and ``precision``, so that these and "
        "``tolerance`` cannot be given as well, and ``window_size`` is that of the pictures. "
        '``vdi.metadata["dial"]`` says what was chosen: docs/dial.md.',
    )
    target_ssim: float | None = option(
        None,
        "SSIM that pictures are to have, 0 to 1",
        "In place of ``quality``: 30 degrees from V_O, against volume rendering.",
        check=Number("an SSIM", high=1, open_ended=True),
    )
    full_fps: float | None = option(
        None,
        "least rate of still frames, per second",
        "Predicted for this device. Goes before quality.",
        check=Number("frames per second", open_ended=True),
    )
    max_bytes: int | None = option(
        None,
        "most bytes of the VDI on the device",
        "Not of files. Goes before all others; limits alone give the best that is within them.",
        check=_BYTES,
    )

    def __post_init__(self) -> None:
        given = self.given
        free = len(given) > 1 and self.quality == "reference"  # made without a choice
        if free or given.keys() >= {"quality", "target_ssim"}:
            said = " and ".join(f"{name}={value!r}" for name, value in given.items())
            raise InvalidArgumentError(f"{said} each say how good pictures are: give one of them")
        super().__post_init__()

    @property
    def ssim(self) -> float | None:
        """The goal, by its name or as a number."""
        return self.target_ssim if self.quality is None else QUALITIES[self.quality]

    def __bool__(self) -> bool:
        """Whether anything is asked for, so that settings are to be chosen."""
        return (self.ssim, self.full_fps, self.max_bytes) != (None, None, None)


@dataclass(frozen=True, eq=False)
class GenerationRequest:
    """A VDI that is asked for: of what, from where, and how; carried whole to what makes it."""

    volume: Volume
    transfer_function: TransferFunction
    camera: Camera  # the generating view V_O; VTK's or PyVista's becomes ours
    window_size: tuple[int, int]  # of V_O, pixels: one list each
    options: GenerationOptions = field(default_factory=GenerationOptions)
    device: DeviceLike | None = None
    progress: Progress | None = None  # called between slices of work; False gives it up
    metadata: Mapping[str, Any] = field(default_factory=dict)  # entries to add to those of the VDI

    def __post_init__(self) -> None:
        check_callback(self.progress)
        object.__setattr__(self, "camera", Camera.from_any(self.camera))
        object.__setattr__(self, "window_size", check_window_size(self.window_size))

    replace = replace


def checked_planes(planes: Any) -> Planes:
    """Return clipping planes as tuples of six floats; none for ``None``."""
    if planes is None or (np.iterable(planes) and not [*planes]):
        return ()
    table = as_floats(planes)
    shaped = table.ndim == 2 and table.shape[1] == 6 and np.isfinite(table).all()
    if not shaped or not table[:, 3:].any(axis=1).all():
        raise InvalidArgumentError(
            "clipping_planes must be (k, 6) finite numbers, origin and normal of each plane, which "
            f"is not zero; got {planes!r}"
        )
    return tuple(map(tuple, table.tolist()))


@record
@dataclass(frozen=True)
class RenderOptions(Options):
    """What of a VDI, or of a volume, is drawn, how dense it is, and how exactly.

    Options that compare equal give the same picture of the same view.
    """

    clipping_planes: Any = option(
        None,
        "origin and normal of each plane, world coordinates",
        "Shape (k, 6); the side that the normal points to is kept, as with VTK's mappers.",
        check=checked_planes,
        takes="ArrayLike | None",
    )
    cropping: Any = option(
        None,
        "which of 27 regions of the data's own coordinates are drawn",
        "A :class:`Cropping`, a mapper's, the six planes of a box, or a pair of these and regions: "
        'flags, or ``"fence"``, ``"cross"`` ...',
        check=Cropping.from_any,
        takes="CroppingLike | None",
    )
    opacity_multiplier: float = option(
        1.0,
        "factor of the extinction, 0 or above",
        "2 is twice as dense, as by half of the opacity unit distance.",
        check=Number("a factor of the extinction"),
    )
    preview_samples: int | None = option(
        None,
        "look a VDI up at so many points of each ray",
        "An approximation (paper section 5); a smaller ``window_size`` is the better one. For a "
        "single VDI only.",
        check=Number(low=1, high=MAX_PREVIEW_SAMPLES, whole=True),
    )
    transmittance_cutoff: float = option(
        TRANSMITTANCE_CUTOFF,
        "a ray ends where less light than this is left, 0 to below 1",
        "No channel loses more: 0.004 changes a picture of 8 bits by one step at most, and saves a "
        "fifth to two fifths of the work where things are opaque. For a single VDI only.",
        check=Number("a share of the light", high=np.nextafter(1.0, 0.0)),
        setting=True,
    )
    skip_empty: bool = True

    replace = replace


@dataclass(frozen=True, eq=False)
class FrameRequest:
    """A frame that is asked for: the view V_N, how it looks, and where its picture goes.

    The camera's ``model_transform`` says where the model frame is now. ``opaque_depth`` is the view
    depth at which each ray ends, world units, (height, width), top row first, inf where nothing is
    opaque; it is checked where rays are made of it. ``out`` is an array for the picture, float32
    (height, width, 4), C-contiguous: a CPU device draws into it without a copy if it begins at a
    multiple of 4096 bytes (:func:`pyvista_vdi.model.host_memory.aligned_empty`).
    """

    camera: Camera
    size: tuple[int, int]
    options: RenderOptions = field(default_factory=RenderOptions)
    opaque_depth: ArrayLike | None = None
    device: Any = None
    out: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "camera", Camera.from_any(self.camera))
        put(self, "size", check_window_size(self.size))

    replace = replace


@record
@dataclass(frozen=True)
class DrawingOptions(Options):
    """How frames are drawn."""

    target_fps: float | None = option(
        30.0,
        "frames per second to be kept while the view moves",
        "By drawing fewer pixels. ``None``: the interactor's ``DesiredUpdateRate``, as for VTK's "
        "own levels of detail; 0: every frame is full.",
        check=Number("frames per second"),
    )
    regenerate: Policy = option(
        "auto",
        "when a view gets a VDI of its own",
        '``"auto"``: in windows on the screen, where the estimated SSIM of its picture is below '
        "``regenerate_below``. "
        '``"never"``: only ``actor.regenerate()``. Changed data and transfer functions are always '
        "made anew.",
    )
    regenerate_below: float | None = option(
        None,
        "estimated SSIM, 0 to 1, below which a VDI does not do for a view",
        '``regenerate="auto"`` makes another, by default below 0.95, and ``draw="auto"`` draws the '
        "volume in its place, by default below 0.98.",
        check=Number("an SSIM", high=1),
        setting=True,
    )
    draw: Draw = option(
        "auto",
        "what is raycast where the volume is at hand",
        '``"auto"``: on the screen by what gives the better picture within ``target_fps``, the VDI '
        "near its view and the volume far from it; off-screen the volume. Volumes that overlap are "
        "drawn by VDIs. ``actor.status.drawn`` says what was drawn.",
    )
    coverage: Coverage = option(
        "bounds",
        "what the VDI's window covers",
        '``"bounds"``: the whole volume, so that neither panning nor zooming out shows a cut edge. '
        '``"view"``: the window.',
        setting=True,
    )
