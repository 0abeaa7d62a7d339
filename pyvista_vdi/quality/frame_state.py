"""What decides which picture a frame shows, and what can happen to it: records that never change.

:func:`pyvista_vdi.quality.decide.decide` takes a :class:`FrameState` and an event, and returns the
state after it and the actions that follow. VDIs are known by numbers here, and volumes by what they
are made of. In names, *stored* is a VDI that is shown without its volume: of a file, a series or a
set. What comes from a volume has the events without that word.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol, TypeAlias

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.checks import as_float
from pyvista_vdi.model.render_options import TRANSMITTANCE_CUTOFF
from pyvista_vdi.model.types import Policy
from pyvista_vdi.model.view import View
from pyvista_vdi.quality.frame_rate import FrameRate

#: What can be raycast for a frame.
RenderMode: TypeAlias = Literal["vdi", "volume"]


class Request(Protocol):
    """Everything that a VDI is made of."""

    @property
    def content(self) -> Any:
        """Equal where what is generated from is, the view apart."""

    @property
    def key(self) -> Any:
        """Equal where the VDIs would be."""

    @property
    def screen(self) -> View:
        """The view that it is made for."""


def checked_image_distance(value: Any) -> float:
    """Return for how many pixels along each edge a ray is cast; 1 to 100, as far as VTK goes."""
    distance = as_float(value)
    if isinstance(value, bool) or not 1 <= distance <= 100:
        raise InvalidArgumentError(
            f"the image sample distance must be a number from 1 to 100; got {value!r}"
        )
    return distance


@dataclass(frozen=True)
class Settings:
    """What a user sets of a mapper; VTK's names, and the meaning, are in its methods."""

    draw: Literal["auto", "vdi", "volume"] = "auto"
    regenerate: Policy = "auto"
    regenerate_below: float | None = None
    automatic_view: bool = True
    opacity_multiplier: float = 1.0
    transmittance_cutoff: float = TRANSMITTANCE_CUTOFF
    image_distance: float = 1.0
    picking_opacity: float = 0.05  # as in VTK's pickers for volumes
    picking_accumulated: bool = True
    adjust: bool = True  # whether frames of a motion may have fewer rays
    adjust_multi_samples: bool = True
    update_rate: float = 1.0  # 1/s, from which on a frame is of a motion; as vtkSmartVolumeMapper
    target: float | None = None  # frames per second; None: the window's desired update rate
    off_screen: bool | None = None  # whether off-screen is watched; None: where a browser does

    @property
    def previews(self) -> bool:
        """Whether a frame of a motion may have fewer rays."""
        return self.adjust and self.target != 0


@dataclass(frozen=True)
class Sight:
    """A VDI that is there, as a view shows it; see :mod:`pyvista_vdi.quality.view_error`."""

    vdi: int  # its number
    bounds: tuple[float, ...]  # of the volume, model frame
    request: Request | None = None  # what it was made of, where that is known
    angle: float = 0.0
    magnification: float = 1.0
    coverage: float = 1.0
    pixels: float = 0.0  # in which it may be seen
    options: Any = None  # how it is drawn (clipping planes in world coordinates), compared by ==


@dataclass(frozen=True)
class Making:
    """A VDI that is being made behind the frames: of what, for which view, and why."""

    content: Any
    screen: View
    for_view: bool  # because of the view alone, and not whatever the view does meanwhile


@dataclass(frozen=True)
class Estimate:
    """What the SSIM of a VDI's picture was found to be."""

    vdi: int
    view: View
    ssim: float
    contrast: float = 1.0
    options: Any = None


@dataclass(frozen=True)
class Costs:
    """What rays have taken, and which render mode was chosen by that."""

    volume: float | None = None  # seconds per pixel
    at_v_o: tuple[tuple[int, float], ...] = ()  # of a VDI, as if at V_O, by neighbourhoods of angle
    way: RenderMode = "vdi"


@dataclass(frozen=True)
class Pictures:
    """What pictures that are kept have told; it is the same in every run."""

    content: Any = None  # of which they are
    vdi: int | None = None  # of which the estimates are
    by_volume: tuple[View, ...] = ()
    judged: tuple[Estimate, ...] = ()
    poor_from: float = math.inf  # degrees from V_O, of the nearest view that the VDI fails
    in_vain: bool = False  # whether a VDI was too poor near its own view


@dataclass(frozen=True)
class FrameState:
    """All that decides which picture a mapper's next frame shows."""

    settings: Settings = field(default_factory=Settings)
    # Behind the frames: the one VDI that is being made, if any, and estimates of errors of views
    making: Making | None = None
    estimating: bool = False
    estimate: Estimate | None = None  # the last one
    estimated_at: float = -math.inf  # when it was begun, seconds
    # What the last frame was looked at
    behind: bool = False  # whether VDIs are made behind the frames, because somebody watches
    number: Any = None  # of the frame
    stamp: Any = None  # of all that it depends on
    view: View | None = None
    moving: bool = False  # whether a hand moves
    moved_at: float = 0.0  # since when the view is that, seconds
    by_vdi: bool = True  # whether the VDI was drawn
    # What is not tried again: stamps, of VDIs behind the frames and in one, and a volume's content
    failed: Any = None
    failed_in_frame: Any = None
    refused: Any = None
    # What frames have told: of rays' costs, off-screen, and of volumes until a VDI is made
    costs: Costs = field(default_factory=Costs)
    pictures: Pictures = field(default_factory=Pictures)
    placeholder: FrameRate = field(default_factory=FrameRate)


# What can happen


@dataclass(frozen=True)
class FrameAsked:
    """A renderer is about to show what comes from a volume."""

    now: float  # seconds
    number: Any  # of the window's frame, equal for both eyes and all viewports
    view: View  # between the eyes
    stamp: Any  # changes whenever it is worth trying again to make a VDI
    wanted: Any = None  # what the next VDI would be made of: a Request, unless there is trouble
    trouble: Exception | None = None
    seen: Sight | None = None  # the VDI that was made last
    watched: bool = False  # whether somebody watches the window
    one_view: bool = True  # whether no other renderer or mapper shows the VDI
    joint: bool = False  # whether another volume overlaps it in the picture
    whole: bool = True  # whether it is no tile of a picture
    own_pixels: bool = True  # whether its pixels are the view's
    moving: bool = False
    previews: bool = False  # whether it may have fewer rays because a hand moves
    seconds: float = math.inf  # what a frame of a motion may take
    # What was found out about this very frame
    look: bool | None = None  # whether it is a whole picture that was not looked at before
    answer: bool | None = None  # what a policy said
    judged: Estimate | Literal[False] | None = None  # the estimate that was made, if one could be
    refused: tuple[Any, ...] = ()  # contents whose volume the device cannot draw


@dataclass(frozen=True)
class StoredAsked:
    """A renderer is about to show a VDI that has no volume, or one of a series or set."""

    stamp: Any


@dataclass(frozen=True)
class StoredSeen:
    """Such a VDI as the frame's view shows it, ``cone`` degrees about V_O being what it serves."""

    seen: Sight
    cone: float
    remedy: str


@dataclass(frozen=True)
class TimePassed:
    """Nothing is drawn at the moment; the rest as in :class:`FrameAsked`."""

    now: float
    seen: Sight | None
    stamp: Any


@dataclass(frozen=True)
class VDIReady:
    """A VDI was made behind the frames."""


@dataclass(frozen=True)
class EstimateReady:
    """An estimate was made behind the frames."""

    estimate: Estimate


@dataclass(frozen=True)
class Failed:
    """Something cannot be done, at this stamp: behind the frames, or in one."""

    error: BaseException
    stamp: Any = None
    in_frame: bool = False


@dataclass(frozen=True)
class Interrupted:
    """What is before the source, or making a VDI in a frame, was aborted."""

    error: Exception
    shown: bool  # whether there is something to be shown


@dataclass(frozen=True)
class FrameTook:
    """A frame's rays have taken so many seconds: a way, seen so many degrees from V_O."""

    way: RenderMode
    angle: float
    pixels: float
    seconds: float


@dataclass(frozen=True)
class PlaceholderTook:
    """A volume that is drawn until a VDI is made has taken so many seconds for its rays."""

    pixels: int
    seconds: float


@dataclass(frozen=True)
class VDIAsked:
    """Somebody asks for the VDI, which is ``there`` or not."""

    there: bool
    stamp: Any


@dataclass(frozen=True)
class ViewPicked:
    """Somebody picks in a view, of which the VDI has that share."""

    coverage: float


@dataclass(frozen=True)
class InputChanged:
    """Something else is drawn from now on, or what failed is to be tried again."""

    another: bool = True


@dataclass(frozen=True)
class Closed:
    """The window is closed; a frame of another one may come."""


Event: TypeAlias = (
    FrameAsked
    | TimePassed
    | VDIReady
    | EstimateReady
    | Failed
    | Interrupted
    | FrameTook
    | PlaceholderTook
    | VDIAsked
    | ViewPicked
    | StoredAsked
    | StoredSeen
    | InputChanged
    | Closed
)


# What is to be done


@dataclass(frozen=True)
class Show:
    """Draw the frame by a VDI or by a volume.

    ``what`` is the VDI made ``"last"``, or one of ``"this view"``, made now; the volume of what a
    VDI is being made of (``"making"``), of the view (``"wanted"``), which may be in bricks, or of
    the VDI that is there (``"made"``); or what was shown before (``"before"``). Where the device
    cannot draw the volume, ``asked`` is asked again.
    """

    what: Literal["last", "this view", "making", "wanted", "made", "before"]
    asked: FrameAsked | None = None
    content: Any = None
    in_bricks: bool = False


@dataclass(frozen=True)
class Generate:
    """Make a VDI behind the frames, of a view or, without one, of the source's own."""

    screen: View | None


@dataclass(frozen=True)
class EstimateError:
    """Estimate the error of a VDI in a view, behind the frames."""

    vdi: int
    view: View
    options: Any


@dataclass(frozen=True)
class Judge:
    """Estimate it now, and ask again."""

    asked: FrameAsked


@dataclass(frozen=True)
class AskPolicy:
    """Ask the user's policy, and ask again."""

    asked: FrameAsked


@dataclass(frozen=True)
class AskAgain:
    """Ask again: a VDI was made in the frame."""

    asked: FrameAsked


@dataclass(frozen=True)
class Do:
    """Do something that has no more to it.

    ``"take view"`` and ``"follow view"`` have the next VDI made of the frame's view, the latter
    unless somebody has chosen one; ``"update"`` has the source make its VDI now; ``"prepare"``
    compiles behind the frames what the first change would wait for; ``"take"`` swaps the VDI that
    is ready in; ``"forget view"`` waits for another frame's.
    """

    what: Literal[
        "take view",
        "follow view",
        "update",
        "prepare",
        "take",
        "drop vdi",
        "drop estimate",
        "forget view",
        "forget volume",
    ]


@dataclass(frozen=True)
class Complain:
    """Warn once that a VDI cannot be made anew."""

    error: BaseException


@dataclass(frozen=True)
class Warn:
    """Warn once for each cause."""

    message: str
    cause: str


@dataclass(frozen=True)
class Raise:
    """Tell whoever asked."""

    error: BaseException


Action: TypeAlias = (
    Show | Generate | EstimateError | Judge | AskPolicy | AskAgain | Do | Complain | Warn | Raise
)
Decision: TypeAlias = tuple[FrameState, tuple[Action, ...]]
