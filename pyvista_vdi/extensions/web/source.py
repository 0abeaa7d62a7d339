"""What a server serves: a volume or time steps of one, of which it makes VDIs for views.

Everything here may be called from several threads; none of it knows clients or sockets.
"""

from __future__ import annotations

import math
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import Any, TypeVar

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.extensions.web.messages import Offer, Wish
from pyvista_vdi.extensions.web.still import webp
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.coverage import bounds_corners, view_in_sight
from pyvista_vdi.model.inputs import as_volume
from pyvista_vdi.model.options import GenerationOptions, GenerationRequest
from pyvista_vdi.model.render_options import FrameRequest, RenderOptions
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.view import View
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.quality.view_error import ViewErrorEstimator
from pyvista_vdi.volume.rays import checked_sample_distance
from pyvista_vdi.volume.render import raycast_volume

_T = TypeVar("_T")

#: Lists of a coarse VDI at most, 352 x 198, and its longest. docs/decisions/web.md, "Served": fewer
#: lists show, longer ones hardly do, for twice the bytes.
COARSE_LISTS = 352 * 198
COARSE_LONGEST = 3
#: A coarse VDI has at most this share of the lists of the full one; where that would leave fewer
#: than the second number, the full one is made at once.
_COARSE_SHARE = 0.3
_FEWEST_LISTS = 2048
#: Volumes, and looks of them with what estimates need, that are kept on host and device.
_VOLUMES = 2
_CONTENTS = 4
#: Bytes of VDIs that clients were sent and that are kept to judge them by.
_KEPT_BYTES = 2**30

CMAPS = (
    *("viridis", "plasma", "inferno", "magma", "cividis", "turbo", "gray", "bone", "hot", "copper"),
    *("coolwarm", "twilight", "jet"),
)
OPACITIES = (
    *("linear", "linear_r", "geom", "geom_r", "sigmoid", "sigmoid_3", "sigmoid_5", "sigmoid_7"),
    *("sigmoid_10", "sigmoid_15", "sigmoid_20", "foreground"),
)
_NAMED = {"cmap": CMAPS, "opacity": OPACITIES}


class _Recent:
    """The values that were asked for last, by their keys; each is made once, under a lock.

    So nobody may ask from within ``Runtime.background``, where others wait for the device.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._values: OrderedDict[Hashable, Any] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, key: Hashable, make: Callable[[], _T]) -> _T:
        """Return the value of a key, which is made if it is not there."""
        with self._lock:
            if key not in self._values:
                while len(self._values) >= self._most:
                    self._values.popitem(last=False)  # its buffers go before others are taken
                self._values[key] = make()
            self._values.move_to_end(key)
            return self._values[key]  # type: ignore[no-any-return]


@dataclass(frozen=True, eq=False)
class Made:
    """A VDI that was made for a client: what of, and how good."""

    wish: Wish  # what it was made for
    view: View  # the wish's
    level: str  # whether a full one is to follow
    #: Its lists; (0, 0) where nothing of the volume is in view, and there is no VDI
    window_size: tuple[int, int]


class Source:
    """A volume, or time steps of one, and how VDIs of it are made."""

    def __init__(
        self,
        volumes: Sequence[Any],
        looks: Classification,
        options: GenerationOptions,
        *,
        lists: int,
        device: Any = None,
    ) -> None:
        if len(volumes) == 0:
            raise InvalidArgumentError("there is no volume to serve: give at least one time step")
        self._volumes = volumes
        self._looks = looks
        self._options = options
        self._lists = lists
        self._recent_volumes, self._contents = _Recent(_VOLUMES), _Recent(_CONTENTS)
        self._estimators = _Recent(_VOLUMES)
        self._kept: OrderedDict[Made, VDI] = OrderedDict()
        self._lock = threading.Lock()
        self.runtime = get_runtime(device)
        first = self.volume(0)
        self.bounds = first.bounds
        #: Of the transfer function; what is wrong with that is refused now, not to a client
        self.range = self.transfer_function(Wish()).scalar_range
        checked_sample_distance(first, options.sample_distance)  # likewise
        named = {name: getattr(looks, name) for name in _NAMED}
        self.started_with = {n: v for n, v in named.items() if isinstance(v, str)}
        free = find_spec("pyvista") is not None and not first.rgba and not looks.in_place
        self.offer = Offer(len(volumes), *(self._names(n, free) for n in _NAMED))

    def _names(self, name: str, free: bool) -> tuple[str, ...]:
        """Return what clients may choose, the name that the server was started with among it."""
        started = self.started_with.get(name)
        return tuple(dict.fromkeys((*_NAMED[name], *filter(None, [started])))) if free else ()

    def volume(self, step: int) -> Volume:
        """Return a time step."""
        looks = self._looks

        def load() -> Volume:
            return as_volume(self._volumes[step], looks.scalars, looks.preference)

        return self._recent_volumes.get(step, load)

    def transfer_function(self, wish: Wish) -> TransferFunction:
        """Return how a client wants to see its time step."""
        volume = self.volume(wish.step)

        def build() -> TransferFunction:
            changes = {n: v for n, v in vars(wish.look).items() if v is not None}
            return self._looks.changed(changes).transfer_function_of(volume)

        return self._contents.get(wish.content, build)

    def first_level(self, wish: Wish) -> str:
        """Return what is to be made first for a view: ``"coarse"``, or ``"full"`` of few lists."""
        shown = self._in_sight(wish, self._lists)
        lists = 0 if shown is None else math.prod(shown[1])
        return "full" if lists * _COARSE_SHARE < _FEWEST_LISTS else "coarse"

    def make(
        self, wish: Wish, level: str, cancelled: Callable[[], bool]
    ) -> tuple[Made, VDI | None]:
        """Make a VDI for a view, of the lists that are in sight."""
        assert wish.view is not None
        seen, options = self._in_sight(wish, self._lists), self._options
        if seen is not None and level == "coarse":
            longest = min(COARSE_LONGEST, options.max_supersegments)
            options = replace(options, max_supersegments=longest)
            seen = self._in_sight(wish, min(COARSE_LISTS, int(math.prod(seen[1]) * _COARSE_SHARE)))
        if seen is None:
            return Made(wish, wish.view, "full", (0, 0)), None
        camera, size = seen
        # Before the device is held: these wait for each other
        volume, look = self.volume(wish.step), self.transfer_function(wish)
        with self.runtime.background(cancelled):
            vdi = generate_vdi(GenerationRequest(volume, look, camera, size, options, self.runtime))
        made = Made(wish, wish.view, level, vdi.window_size)
        self._keep(made, vdi)
        return made, vdi

    def picture(self, wish: Wish, cancelled: Callable[[], bool]) -> bytes:
        """Return the volume's own picture of a view, as an image file; none where it is not seen.

        It has the view's pixels, or fewer: no more of the volume than the most lists of a VDI.
        """
        assert wish.view is not None
        seen = self._in_sight(wish, math.prod(wish.view.size))
        if seen is None:
            return b""
        share = min(1.0, math.sqrt(self._lists / math.prod(seen[1])))
        width, height = (max(1, round(edge * share)) for edge in wish.view.size)
        volume, look = self.volume(wish.step), self.transfer_function(wish)
        shown = RenderOptions(clipping_planes=wish.planes or None)
        request = FrameRequest(wish.view.camera, (width, height), shown, None, self.runtime)
        with self.runtime.background(cancelled):
            image = raycast_volume(volume, look, request, self._options)
        return webp(image)

    def estimate(self, made: Made, wish: Wish, cancelled: Callable[[], bool]) -> float:
        """Return the SSIM that a client's picture is estimated to have; 0 if that is not known."""
        with self._lock:
            vdi = self._kept.get(made)
        if vdi is None or wish.view is None:
            return float(made.window_size == (0, 0) and self._in_sight(wish, self._lists) is None)
        volume, look = self.volume(wish.step), self.transfer_function(wish)
        estimator = self._estimators.get(
            wish.content,
            lambda: ViewErrorEstimator(volume, look, self._options, device=self.runtime),
        )
        camera, size = wish.view.camera, wish.view.size
        with self.runtime.background(cancelled):
            return estimator.estimate(vdi, camera, size, clipping_planes=wish.planes or None).ssim

    def forget(self, made: Made | None) -> None:
        """Drop a VDI that is judged no more."""
        with self._lock:
            self._kept.pop(made, None)  # type: ignore[arg-type]

    def _in_sight(self, wish: Wish, lists: int) -> Any:
        """Return the view whose window is what shows the volume, of so many lists at most."""
        assert wish.view is not None
        corners = bounds_corners(self.volume(wish.step).bounds)
        size = wish.view.size
        seen = view_in_sight(wish.view.camera, size, corners)
        if seen is None or math.prod(seen[1]) <= lists:
            return seen
        share = math.sqrt(lists / math.prod(seen[1]))
        return view_in_sight(
            wish.view.camera, tuple(max(1, int(edge * share)) for edge in size), corners
        )

    def _keep(self, made: Made, vdi: VDI) -> None:
        with self._lock:
            self._kept[made] = vdi
            while len(self._kept) > 1 and sum(v.nbytes for v in self._kept.values()) > _KEPT_BYTES:
                self._kept.popitem(last=False)
