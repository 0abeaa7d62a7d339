"""The options: each declared once, in records that are checked where they are made.

A field of a record declares an option: its name, type and default as in any dataclass, by
:func:`option` also what it is checked by, and in the record's docstring what it means. All else
follows: arguments of functions, their docstrings and stubs (``model/arguments.py``), options of the
command line, Set and Get of VTK's filters, and ParaView's properties.
"""

from __future__ import annotations

import inspect
import json
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, dataclass, field, replace
from functools import partial
from typing import Any, ClassVar, Literal, TypeAlias, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.model import types
from pyvista_vdi.model.ambient_occlusion import AmbientOcclusion, OcclusionGrid
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import Number, as_flag, as_floats, as_range, check_callback, one_of
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

#: Origin and normal of each plane; the side that the normal points to is kept.
Planes: TypeAlias = tuple[tuple[float, ...], ...]

#: The SSIM that a name asks for. "reference" asks for nothing: it is what is made without a target.
QUALITIES: dict[str, float | None] = {
    "reference": None,
    "high": 0.98,
    "balanced": 0.96,
    "fast": 0.93,
}


@dataclass
class Option:
    """An option, as it is declared.

    ``what`` is a sentence that begins small without a full stop, ``more`` those behind it; ``kind``
    is the argument's type. ``check`` returns a value as it is kept, or raises InvalidArgumentError;
    without one it is one of the ``choices`` that the type has, a truth value where that is one, or
    anything. ``standard`` is the default as it is kept.
    """

    name: str
    default: Any
    what: str
    more: str = ""
    kind: str = ""
    check: Callable[[Any], Any] | None = None
    choices: tuple[str, ...] = ()
    standard: Any = None

    def __post_init__(self) -> None:
        none, literal = "None" in self.kind, getattr(types, self.kind.removesuffix(" | None"), None)
        if isinstance(self.check, Number):
            self.check = replace(self.check, name=self.check.name or self.name, none=none)
        elif self.check is None and get_origin(literal) is Literal:
            self.choices = get_args(literal)
            self.check = partial(one_of, name=self.name, names=self.choices, none=none)
        elif self.check is None and self.kind == "bool":
            self.check = partial(as_flag, name=self.name)
        self.standard = self.default
        if self.check is not None and self.default is not MISSING:
            self.standard = self.check(self.default)


#: What the docstring of a record says of a field: its name, ``what``, and ``more``. Where Python
#: drops docstrings (-OO) options are not described, and all else is as it is.
_TEXT = re.compile(r"^(\w+): (.+)((?:\n +.+)*)", re.MULTILINE)


def option(default: Any, check: Callable[[Any], Any] | None = None, kind: str = "") -> Any:
    """Declare an option that is checked, or whose argument's type is another than the field's."""
    return field(default=default, metadata={"check": check, "kind": kind})


@dataclass(frozen=True)
class Options:
    """A record of options, each checked and brought to its type when the record is made.

    They are all fields but those of a mere :func:`dataclasses.field`; the docstring describes them.
    """

    #: The options, by their names.
    declared: ClassVar[dict[str, Option]] = {}

    def __init_subclass__(cls) -> None:
        """Gather the options that a record declares, behind those that it inherits."""
        found: dict[str, Option] = {}
        for base in reversed(cls.__mro__):
            found |= vars(base).get("declared", {})
        texts = {name: more for name, *more in _TEXT.findall(inspect.cleandoc(cls.__doc__ or ""))}
        for name, kind in inspect.get_annotations(cls).items():
            value: Any = vars(cls).get(name, MISSING)
            how: Mapping[str, Any] = {}
            if isinstance(value, Field):
                value, how = value.default, value.metadata
                if not how:
                    continue
            what, more = texts.get(name, ("", ""))
            taken = how.get("kind") or kind
            found[name] = Option(name, value, what, " ".join(more.split()), taken, how.get("check"))
        cls.declared = found

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


@dataclass(frozen=True)
class MediumOptions(Options):
    """How a classified volume is sampled: what generation and volume rendering both need.

    sample_distance: length of a step along a ray, model units; half the smallest spacing by default
    lights: what a shaded volume is lit by; one headlight by default, which is VTK's
        Pass ``plotter.renderer`` for a plotter's. A VDI has them as they stand at its view.
    ambient_occlusion: darken what is hidden from the light around it
        ``True``, or the radius up to which something hides, model units.
    memory_limit: most memory to take on the device, bytes; by default what the device has
        A volume that does not fit goes there brick by brick, which takes more time and changes no
        bit.
    """

    sample_distance: float | None = option(None, Number("a length in model units", open_ended=True))
    lights: Lights = option(None, Lights.from_any, "LightsLike | None")
    ambient_occlusion: AmbientOcclusion | None = option(
        None, AmbientOcclusion.from_any, "OcclusionLike | None"
    )
    memory_limit: int | None = option(None, Number("a whole number of bytes", 1, whole=True))

    def occlusion_bytes(self, volume: Volume) -> int:
        """Return what the grid of the ambient occlusion takes on the device, bytes."""
        if self.ambient_occlusion is None:
            return 0
        return OcclusionGrid(volume, self.ambient_occlusion).nbytes


@dataclass(frozen=True)
class GenerationOptions(MediumOptions):
    """How a VDI is made.

    max_supersegments: longest list, 1 to 4096
        A promise: never exceeded, and nothing that is not transparent is dropped for it.
    criterion: what decides where a list that must be shortened is cut
        ``"least-error"``: neighbours are merged where the error is least. ``"homogeneity"`` (the
        paper's, after Frey et al. 2013): a supersegment goes on while the medium is like its mean
        so far, by the least threshold that keeps the budget on this ray.
    tolerance: error that may be traded for shorter lists
        Per voxel, in opacity-weighted colour and opacity. 0 merges only what is homogeneous.
    view_cone: half angle of the cone of new views that must be served, degrees
        The wider, the more of the budget goes to what the generating view cannot see:
        ``1 - cos(view_cone)`` of what the seen counts.
    precision: what a supersegment takes
        On devices and in files: see :meth:`VDI.with_precision`.
    """

    max_supersegments: int = option(20, Number(low=1, high=4096, whole=True))
    criterion: Criterion = "least-error"
    tolerance: float = option(0.0, Number())
    view_cone: float = option(60.0, Number("an angle in degrees", high=90))
    precision: Precision = "exact"

    @property
    def finest_error(self) -> float:
        """Merge error up to which neighbours are always merged."""
        # Differences stay below 1e18, whose square float32 still holds, and no picture shows one of
        # a thousandth of full opacity over one voxel
        return max(min(self.tolerance, 1e18) ** 2, 1e-6)


@dataclass(frozen=True)
class Deferral(Options):
    """When scalars are classified, and what is kept of them until then: docs/deferred.md.

    classification: when scalars are classified: as the VDI is made, or by whoever shows it
        Deferred, it is a :class:`DeferredVDI`, of which ``classified(cmap=..., opacity=...)`` makes
        a VDI without the volume, and in a plotter ``actor.prop`` (docs/deferred.md). Of the look it
        takes ``interpolation`` only.
    value_range: least and largest scalar to keep, where deferred
        All by default. What is outside is empty.
    """

    classification: When = "baked"
    value_range: Any = option(None, kind="RangeLike | None")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.value_range is None:
            return
        if not self.deferred:
            raise InvalidArgumentError(
                f"value_range={self.value_range!r} says what is kept to be classified afterwards: "
                "give classification='deferred' as well, or leave value_range out"
            )
        low, high = as_range(self.value_range)
        if not -math.inf < low < high < math.inf:
            raise InvalidArgumentError(
                f"value_range must be two finite scalars, low < high; got {self.value_range!r}"
            )

    @property
    def deferred(self) -> bool:
        """Whether values are kept."""
        return self.classification == "deferred"


@dataclass(frozen=True)
class QualityTarget(Options):
    """What is asked of a VDI in place of settings, which are chosen to reach it: docs/dial.md.

    quality: choose the settings by how good pictures are to be
        By a table: an SSIM against volume rendering of 0.98, 0.96 or 0.945 in the mean of 48
        scenes. ``"reference"`` is what is made where nothing is given. ``target_ssim``,
        ``full_fps`` and ``max_bytes`` have the scene measured on the device, once. All choose the
        VDI's ``window_size``, ``max_supersegments`` and ``precision``, so that these and
        ``tolerance`` cannot be given as well, and ``window_size`` is that of the pictures.
        ``vdi.metadata["dial"]`` says what was chosen: docs/dial.md.
    target_ssim: SSIM that pictures are to have, 0 to 1
        In place of ``quality``: 30 degrees from V_O, against volume rendering.
    full_fps: least rate of still frames, per second
        Predicted for this device. Goes before quality.
    max_bytes: most bytes of the VDI on the device
        Not of files. Goes before all others; limits alone give the best that is within them.
    """

    quality: Quality | None = None
    target_ssim: float | None = option(None, Number("an SSIM", high=1, open_ended=True))
    full_fps: float | None = option(None, Number("frames per second", open_ended=True))
    max_bytes: int | None = option(None, Number("a whole number of bytes", 1, whole=True))

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

    def refuse_deferred(self) -> None:
        """Refuse to choose settings where values are kept, whatever their look."""
        if self:
            raise UnsupportedError(
                f"{', '.join(self.given)} choose settings by a look, which a deferred VDI does "
                "not have: give max_supersegments"
            )


@dataclass(frozen=True, eq=False)
class GenerationRequest(Options):
    """A VDI that is asked for: of what, from where, and how; carried whole to what makes it.

    volume: scalars on a uniform grid
        Spacing, origin and direction matrix are honoured, cell data are converted as
        ``Plotter.add_volume`` does.
    transfer_function: what classifies it
    camera: the generating view V_O
    window_size: width and height in pixels: lists along each edge of the viewport
    progress: called with the finished fraction, 0 to 1; work stops if it returns ``False``
    """

    volume: Volume = field(metadata={"kind": "VolumeLike"})
    transfer_function: TransferFunction
    camera: Camera = field(metadata={"check": Camera.from_any, "kind": "CameraLike"})
    window_size: tuple[int, int] = field(
        metadata={"check": check_window_size, "kind": "WindowSize"}
    )
    options: GenerationOptions = field(default_factory=GenerationOptions)
    device: DeviceLike | None = field(default=None)
    progress: Progress | None = option(None, check_callback)
    metadata: Mapping[str, Any] = field(default_factory=dict)  # entries to add to those of the VDI

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


@dataclass(frozen=True)
class RenderOptions(Options):
    """What of a VDI, or of a volume, is drawn, how dense it is, and how exactly.

    Options that compare equal give the same picture of the same view.

    clipping_planes: origin and normal of each plane, world coordinates
        The side that the normal points to is kept, as with VTK's mappers.
    cropping: which of 27 regions of the data's own coordinates are drawn
        A :class:`Cropping`, a mapper's, the six planes of a box, or a pair of these and regions:
        flags, or ``"fence"``, ``"cross"`` ...
    opacity_multiplier: factor of the extinction, 0 or above
        2 is twice as dense, as by half of the opacity unit distance.
    preview_samples: look a VDI up at so many points of each ray
        An approximation (paper section 5); a smaller ``window_size`` is the better one. For a
        single VDI only.
    transmittance_cutoff: a ray ends where less light than this is left, 0 to below 1
        No channel loses more: 0.004 changes a picture of 8 bits by one step at most, and saves a
        fifth to two fifths of the work where things are opaque. For a single VDI only.
    """

    clipping_planes: Any = option(None, checked_planes, "PlanesLike | None")
    cropping: Any = option(None, Cropping.from_any, "CroppingLike | None")
    opacity_multiplier: float = option(1.0, Number("a finite factor of the extinction"))
    # Each sample has a half, and float32 counts halves up to 2^24
    preview_samples: int | None = option(None, Number(low=1, high=2**23, whole=True))
    transmittance_cutoff: float = option(1e-6, Number(high=1, below=True))
    skip_empty: bool = field(default=True)

    replace = replace


@dataclass(frozen=True, eq=False)
class FrameRequest(Options):
    """A frame that is asked for: the view V_N, how it looks, and where its picture goes.

    camera: the new view V_N
        Its model transform places the model frame in the world.
    window_size: width and height of the image in pixels
        By default those that a VDI was made for, :attr:`VDI.picture_size`; of several, where all
        have the same. Of a volume they must be given.
    opaque_depth: view depth at which each ray ends
        Distance from the eye along the view direction, world units, top row first; infinity where
        nothing is opaque.
    device: where it runs; by default ``PYVISTA_VDI_DEVICE``, else the best device found
    out: an array for the picture, float32 (height, width, 4), C-contiguous
        A CPU device draws into it without a copy if it begins at a multiple of 4096 bytes
        (:func:`pyvista_vdi.model.host_memory.aligned_empty`).
    """

    camera: Camera = field(metadata={"check": Camera.from_any, "kind": "CameraLike"})
    window_size: tuple[int, int] = field(
        metadata={"check": check_window_size, "kind": "WindowSize"}
    )
    options: RenderOptions = field(default_factory=RenderOptions)
    opaque_depth: ArrayLike | None = option(None, kind="DepthLike | None")  # checked by rays' maker
    device: Any = option(None, kind="DeviceLike | None")
    out: NDArray[np.float32] | None = None

    replace = replace


@dataclass(frozen=True)
class DrawingOptions(Options):
    """How frames are drawn.

    target_fps: frames per second to be kept while the view moves
        By drawing fewer pixels. ``None``: the interactor's ``DesiredUpdateRate``, as for VTK's own
        levels of detail; 0: every frame is full.
    regenerate: when a view gets a VDI of its own
        ``"auto"``: in windows on the screen, where the estimated SSIM of its picture is below
        ``regenerate_below``. ``"never"``: only ``actor.regenerate()``. Changed data and transfer
        functions are always made anew.
    regenerate_below: estimated SSIM, 0 to 1, below which a VDI does not do for a view
        ``regenerate="auto"`` makes another, by default below 0.95, and ``draw="auto"`` draws the
        volume in its place, by default below 0.98.
    draw: what is raycast where the volume is at hand
        ``"auto"``: on the screen by what gives the better picture within ``target_fps``, the VDI
        near its view and the volume far from it; off-screen the volume. Volumes that overlap are
        drawn by VDIs. ``actor.status.drawn`` says what was drawn.
    coverage: what the VDI's window covers
        ``"bounds"``: the whole volume, so that neither panning nor zooming out shows a cut edge.
        ``"view"``: the window.
    """

    target_fps: float | None = option(30.0, Number("a number of frames per second"))
    regenerate: Policy = "auto"
    regenerate_below: float | None = option(None, Number("an SSIM", high=1))
    draw: Draw = "auto"
    coverage: Coverage = "bounds"
