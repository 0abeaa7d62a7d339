"""Makes the VDIs of a set: as many, and from where, as pictures of all directions need."""

from __future__ import annotations

import dataclasses
import io
import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import (
    Cancelled,
    InvalidArgumentError,
    InvalidArgumentTypeError,
    warn_external,
)
from pyvista_vdi.extensions.series.writer import StepsWriter
from pyvista_vdi.extensions.sets.files import bytes_around
from pyvista_vdi.extensions.sets.render import blended
from pyvista_vdi.extensions.sets.sphere import orbit, spiral, spread
from pyvista_vdi.extensions.sets.vdi_set import VDISet
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import as_float, check_callback
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.coverage import bounds_corners, covering_view
from pyvista_vdi.model.inputs import as_volume
from pyvista_vdi.model.metrics import SSIM_WINDOW, compare_images
from pyvista_vdi.model.options import (
    GENERATION_NAMES,
    GenerationOptions,
    GenerationRequest,
    check_max_supersegments,
)
from pyvista_vdi.model.packing import Packed8
from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.quality.tiles import REACH, seen_region
from pyvista_vdi.quality.view_error import ViewErrorEstimator

_log = logging.getLogger(__name__)

#: What a set takes of generation: its precision is always "8-byte".
_OPTIONS = tuple(name for name in GENERATION_NAMES if name != "precision")

#: SSIM that every direction is to have.
TARGET_SSIM = 0.98
#: Directions of a sphere whose error is measured.
DIRECTIONS = 160
#: Most VDIs of a set.
MOST_VIEWS = 400
#: Half angle of the cone that a V_O of a set has to serve, degrees: others serve what is beyond.
VIEW_CONE = 30.0

#: Settings that are measured: lists per pixel along an edge, and the longest list. Each differs
#: from the usual one in one of both.
_USUAL = (1.0, 10)
_MEASURED = ((1.0, 5), _USUAL, (1.0, 20), (0.7, 10), (1.4, 10))
_LISTS, _LENGTHS = (
    (0.7, 0.77, 0.85, 0.92, 1.0, 1.1, 1.2, 1.3, 1.4),
    (5, 6, 7, 8, 10, 12, 14, 17, 20),
)
#: Lists per pixel where more do not fit into ``max_bytes``.
_FEW_LISTS = (0.2, 0.3, 0.4, 0.5, 0.6)
#: Bytes of a view beside its VDI, in the head and the index of a file, about.
_VIEW_BYTES = 600
#: Share of ``max_bytes`` that is planned for again where more was taken than expected.
_ROOM = 0.97
#: Degrees from V_O at which they are.
_ANGLES = (5.0, 10.0, 15.0, 20.0, 26.0)
#: How many directions they are measured from.
_PILOTS = 2
#: Shares of the progress: measuring, and what the first V_Os take.
_PILOT_SHARE, _FIRST_SHARE = 0.1, 0.6
#: Degrees from the nearest of n directions that are spread, times the root of n.
_SPACING = 138.0
#: Share of the loss that directions which are measured have to spare: others lie between them.
_SPARE = 0.05
#: Share of the loss that is allowed at the farthest by what was measured of a few directions.
_SHARE = 0.87
#: Loss next to V_O, times this, is borne between V_Os where it is above what is allowed.
_MORE_VIEWS = 1.25
#: Lists and their lengths of a V_O that comes to help, over those of the others.
_FINER = 1.3
#: Directions that miss the target next to a V_O of their own, after which it is given up.
_IN_VAIN = 4

Progress = Callable[[float], object]


@dataclass(frozen=True)
class SetSettings:
    """How the VDIs of a set are made.

    Attributes
    ----------
    lists : float
        Lists along an edge over pixels of the pictures.
    max_supersegments : int
        Longest list.
    views : int
        V_Os to begin with.
    nbytes : float
        Expected bytes of their VDIs; NaN where nothing was measured.
    growth : (float, float)
        Lists along an edge, and the longest list, of a V_O that comes to help over the others': 1
        where the user has said what they are.
    """

    lists: float
    max_supersegments: int
    views: int
    nbytes: float = math.nan
    growth: tuple[float, float] = (_FINER, _FINER)

    def finer(self) -> SetSettings:
        """Return those of a V_O that comes to help where others did not do."""
        denser, longer = self.growth
        longest = math.ceil(longer * self.max_supersegments)
        return dataclasses.replace(self, lists=denser * self.lists, max_supersegments=longest)


def generate_set(
    volume: Any,
    views: Any = "sphere",
    window_size: Sequence[int] = (640, 360),
    *,
    camera: Any = None,
    target_ssim: float = TARGET_SSIM,
    max_bytes: int | None = None,
    max_views: int = MOST_VIEWS,
    lists: float | None = None,
    max_supersegments: int | None = None,
    device: Any = None,
    progress: Progress | None = None,
    **options: Any,
) -> VDISet:
    """Generate VDIs of a volume from as many views as pictures from all sides need.

    A few VDIs tell how lists are to be made and about how many V_Os it takes. Then the error of
    pictures between the V_Os is measured, and where it is largest another V_O is put, until each
    direction reaches the target.

    Parameters
    ----------
    volume : pyvista.ImageData or vtkImageData or Volume
        As for :func:`pyvista_vdi.generate`. It is uploaded once.
    views : "sphere" or sequence of cameras
        What is to be seen: the volume from all directions, or from these views. V_Os are put
        among these.
    window_size : (int, int)
        Width and height of the pictures, pixels.
    camera : pyvista.Camera or vtkCamera or Camera, optional
        A view of the sphere: it tells how far the eye is from the centre of the volume, the lens
        and what is up. By default the view that the volume just fills.
    target_ssim : float
        SSIM against volume rendering that each direction is to have, 0 to 1.
    max_bytes : int, optional
        Most bytes of the file that :meth:`VDISet.save` writes by default; goes before the target.
    max_views : int
        Most VDIs.
    lists : float, optional
        Lists along an edge over pixels, for all V_Os; by default what takes the fewest bytes by a
        short measurement.
    max_supersegments : int, optional
        Longest list; by default by that measurement as well.
    device : str, int or device, optional
        Where it runs; by default ``PYVISTA_VDI_DEVICE``, else the best device found.
    progress : callable, optional
        Called with about the finished fraction, 0 to 1; work stops if it returns ``False``.
    **options
        All else that :func:`pyvista_vdi.generate` takes, classification included, but for
        ``precision``, which is ``"8-byte"``, and a dial. ``view_cone`` is 30 by default.

    Returns
    -------
    VDISet
        In memory. ``about["reached"]`` says what was measured in the end.

    Raises
    ------
    TypeError
        If a keyword is unknown.
    InvalidArgumentError
        If an argument is out of its range.
    Cancelled
        If ``progress`` returned ``False``.

    Warns
    -----
    VDIWarning
        If the target is not reached everywhere; if no VDI is small enough for ``max_bytes``.

    See Also
    --------
    generate : has the options, and the other errors.

    Examples
    --------
    >>> import pyvista_vdi as pvdi
    >>> volume = pvdi.examples.load_brain(as_volume=True)
    >>> vdis = pvdi.generate_set(volume, window_size=(640, 360), cmap="bone")  # doctest: +SKIP
    >>> vdis.save("brain.vdiset")  # doctest: +SKIP
    """
    check_callback(progress)
    size = check_window_size(window_size)
    goal = as_float(target_ssim)
    if not 0 < goal < 1:
        raise InvalidArgumentError(f"target_ssim must be between 0 and 1; got {target_ssim!r}")
    if max_bytes is not None and not as_float(max_bytes) > 0:
        raise InvalidArgumentError(f"max_bytes must be above 0; got {max_bytes!r}")
    if not 1 <= as_float(max_views) < math.inf:
        raise InvalidArgumentError(f"max_views must be 1 or more; got {max_views!r}")
    if lists is not None and not 0.05 <= as_float(lists) <= 8:
        raise InvalidArgumentError(f"lists must be 0.05 to 8 per pixel; got {lists!r}")
    if max_supersegments is not None:
        max_supersegments = check_max_supersegments(max_supersegments)
    if min(size) < SSIM_WINDOW:
        raise InvalidArgumentError(
            f"a window of {size[0]} x {size[1]} pixels has no SSIM to place views by: it takes "
            f"{SSIM_WINDOW} along each edge"
        )
    looks = Classification.composited(
        {n: v for n, v in options.items() if n not in _OPTIONS}, "generate_set", _OPTIONS
    )
    read = as_volume(volume, looks.scalars, looks.preference)
    maker = ViewMaker(
        read,
        looks.transfer_function_of(read),
        size,
        GenerationOptions(
            **{
                "view_cone": VIEW_CONE,
                "precision": "8-byte",
                **{n: v for n, v in options.items() if n in _OPTIONS},
            }
        ),
        {"classification": looks.describe(), "scalars": read.name},
        device,
    )
    if isinstance(views, str):
        if views != "sphere":
            raise InvalidArgumentError(f"views must be 'sphere' or cameras; got {views!r}")
        around = filling_camera(read.bounds, size) if camera is None else Camera.from_any(camera)
        probes = orbit(around, read.bounds, spiral(DIRECTIONS))
    else:
        if camera is not None:
            raise InvalidArgumentError("camera is for views='sphere': leave it out with cameras")
        if not np.iterable(views):
            raise InvalidArgumentTypeError(f"views must be 'sphere' or cameras; got {views!r}")
        probes = [Camera.from_any(view) for view in views]
        if not probes:
            raise InvalidArgumentError("there is no view: pass at least one camera")
    sphere = isinstance(views, str)
    placing = _Placing(maker, probes, goal, max_bytes, int(max_views), progress)
    placing.measure(lists, max_supersegments, sphere=sphere)
    settings, vdi_set = placing.placed(
        lambda n: orbit(probes[0], read.bounds, spread(n)) if sphere else probes[:1],
        around if sphere else probes[0],
    )
    vdi_set._maker = Growth(maker, settings, goal)
    return vdi_set


class ViewMaker:
    """Makes VDIs of one volume that cover all of it, for pictures of one window, and judges them.

    Parameters
    ----------
    volume, transfer_function
        What is seen.
    window_size : (int, int)
        Of the pictures.
    options : GenerationOptions
        How it is made but for its lists.
    metadata : dict
        Entries for the VDIs' metadata.
    device : optional
        See :func:`pyvista_vdi.list_devices`.
    """

    def __init__(
        self,
        volume: Volume,
        transfer_function: TransferFunction,
        window_size: tuple[int, int],
        options: GenerationOptions,
        metadata: dict[str, Any],
        device: Any = None,
    ) -> None:
        self.volume, self.window_size = volume, window_size
        self._table, self._options = transfer_function, options
        self._metadata, self._device = metadata, device
        self._medium: ViewErrorEstimator | None = None

    def __call__(self, view: Camera, lists: float, max_supersegments: int) -> VDI:
        """Return the VDI of a view."""
        width, height = (max(1, round(lists * edge)) for edge in self.window_size)
        corners = bounds_corners(self.volume.bounds)
        covering = covering_view(view, (width, height), corners)
        camera, size = covering or (view, (width, height))
        options = replace(self._options, max_supersegments=max_supersegments)
        request = GenerationRequest(
            self.volume, self._table, camera, size, options, self._device, metadata=self._metadata
        )
        return _lean(generate_vdi(request))

    def of(self, settings: SetSettings) -> Callable[[Camera], VDI]:
        """Return what makes the VDI of a view by these settings."""
        return lambda view: self(view, settings.lists, settings.max_supersegments)

    def truth(self, view: Camera) -> _Truth | None:
        """Return the volume's picture of a view; ``None`` where nothing is seen."""
        if self._medium is None:
            medium = {n: getattr(self._options, n) for n in _MEDIUM}
            self._medium = ViewErrorEstimator(
                self.volume, self._table, device=self._device, **medium
            )
        found = seen_region(view, self.window_size, (self.volume.bounds, self.volume.bounds))
        if found is None:
            return None
        # With what SSIM looks at around each pixel, as far as there are pixels
        first = np.maximum(np.asarray(found.first) - REACH, 0)
        end = np.minimum(np.add(found.first, found.extent) + REACH, self.window_size)
        width, height = (int(n) for n in np.maximum(end - first, SSIM_WINDOW))
        lens = view.tile(self.window_size, [int(n) for n in first], (width, height))
        inner = (width - 2 * REACH) * (height - 2 * REACH)
        whole = math.prod(edge - 2 * REACH for edge in self.window_size)
        picture = self._medium.volume_tile(lens, (width, height))
        return _Truth(lens, (width, height), picture, inner / whole, self._device)

    def ssim(self, parts: Sequence[tuple[VDI, float]], view: Camera) -> float:
        """Return the SSIM of a view that is blended of VDIs; 1 where nothing is seen."""
        truth = self.truth(view)
        return 1.0 if truth is None else truth.ssim(*parts)


@dataclass(frozen=True, eq=False)
class _Truth:
    """The volume's picture of what is seen of it in a view."""

    lens: Camera
    size: tuple[int, int]
    picture: NDArray[np.float32]
    share: float  # of the whole picture's pixels that have an SSIM
    device: Any

    def ssim(self, *parts: tuple[VDI, float]) -> float:
        """Return the SSIM of the picture of the whole view that is blended of VDIs."""
        seen = blended(parts, FrameRequest(self.lens, self.size, device=self.device))
        return 1.0 - self.share * (1.0 - compare_images(seen, self.picture).ssim)


_MEDIUM = ("sample_distance", "lights", "ambient_occlusion", "memory_limit")


@dataclass(frozen=True)
class Growth:
    """Makes VDIs of other views of a set's volume."""

    maker: ViewMaker
    settings: SetSettings
    goal: float

    def __call__(self, camera: Camera) -> VDI:
        """Return a VDI of a view, made as those of the set."""
        return self.maker.of(self.settings)(camera)

    def lacking(self, vdi_set: VDISet, camera: Camera) -> VDI | None:
        """Return a finer VDI of a view that does not reach the goal, else None."""
        parts = [(vdi_set[i], weight) for i, weight in vdi_set.weights(camera)]
        if self.maker.ssim(parts, camera) >= self.goal:
            return None
        return self.maker.of(self.settings.finer())(camera)


class _Placing:
    """Puts V_Os among views until all reach a goal."""

    def __init__(
        self,
        maker: ViewMaker,
        probes: list[Camera],
        goal: float,
        max_bytes: int | None,
        max_views: int,
        progress: Progress | None,
    ) -> None:
        self._maker, self._probes, self._goal = maker, probes, goal
        self._aim = 1 - (1 - _SPARE) * (1 - goal)
        self._limit = math.inf if max_bytes is None else float(max_bytes)
        self._max_views = max_views
        self._progress, self._done = progress, 0.0
        self._choices: list[_Choice] = []
        self._coarse: list[_Choice] = []
        self._growth = (_FINER, _FINER)

    def measure(self, lists: float | None, max_supersegments: int | None, *, sphere: bool) -> None:
        """Find out by a few VDIs what settings are expected to give: the choices."""
        self._growth = (
            _FINER if lists is None else 1.0,
            _FINER if max_supersegments is None else 1.0,
        )
        if lists is None or max_supersegments is None:
            measured = self._measured(_MEASURED)
        elif sphere:
            measured = self._measured([(lists, max_supersegments)])
        else:
            only = SetSettings(lists, max_supersegments, 1, growth=self._growth)
            self._choices = [_Choice(only, 0.0, np.zeros(len(_ANGLES)))]
            return
        lengths = _LENGTHS if max_supersegments is None else (max_supersegments,)

        def choices(several: Sequence[float]) -> list[_Choice]:
            settings = [(per_pixel, longest) for per_pixel in several for longest in lengths]
            return [self._fewest(*each, *measured.expected(*each)) for each in settings]

        self._choices = choices(_LISTS if lists is None else (lists,))
        if lists is None and self._limit < math.inf:
            self._coarse = choices(_FEW_LISTS)

    def _chosen(self, limit: float) -> SetSettings:
        """Return how the VDIs are to be made so that they take so many bytes at most."""
        allowed = _SHARE * (1 - self._goal)
        reaching = [
            each.settings
            for each in self._choices
            if each.loss <= allowed and not each.settings.nbytes > limit
        ]
        if reaching:
            return min(reaching, key=lambda settings: settings.nbytes)

        def falls_short(each: _Choice) -> tuple[float, float]:
            within, loss = each.within(limit)
            return max(1.0, within.nbytes / limit), loss

        return min(self._choices + self._coarse, key=falls_short).within(limit)[0]

    def _fewest(
        self, lists: float, longest: int, losses: NDArray[np.float64], nbytes: float
    ) -> _Choice:
        """Return the settings with as many views as keep the goal; and what is lost then."""
        angles = np.asarray(_ANGLES)
        worst = np.maximum.accumulate(losses)
        # Where lists are too few from the beginning on, more views hardly help
        allowed = max(_SHARE * (1 - self._goal), _MORE_VIEWS * float(worst[0]))
        angle = angles[-1] if worst[-1] <= allowed else float(np.interp(allowed, worst, angles))
        angle = max(angle, angles[0])
        views = min(self._max_views, math.ceil((_SPACING / angle) ** 2))
        loss = float(np.interp(angle, angles, worst))
        nbytes = views * (nbytes + _VIEW_BYTES)
        settings = SetSettings(lists, longest, views, nbytes, self._growth)
        return _Choice(settings, loss, worst)

    def _measured(self, settings: Sequence[tuple[float, int]]) -> _Measured:
        """Measure a few settings from a few of the views."""
        losses = np.zeros((len(settings), len(_ANGLES)))
        nbytes = np.zeros(len(settings))
        at = np.linspace(0, len(self._probes), _PILOTS, endpoint=False).astype(int)
        pilots = [self._probes[i] for i in at + len(self._probes) // (2 * _PILOTS)]
        for k, pilot in enumerate(pilots):
            turned = [pilot.azimuth(a) if k % 2 else pilot.elevation(a) for a in _ANGLES]
            truths = [self._maker.truth(view) for view in turned]
            for i, (lists, longest) in enumerate(settings):
                self._report(_PILOT_SHARE * (k + i / len(settings)) / _PILOTS)
                vdi = self._maker(pilot, lists, longest)
                nbytes[i] = max(nbytes[i], file_bytes(vdi))
                for j, truth in enumerate(truths):
                    lost = 0.0 if truth is None else 1 - truth.ssim((vdi, 1.0))
                    losses[i, j] = max(losses[i, j], lost)
        return _Measured(settings, losses, nbytes)

    def placed(
        self, first: Callable[[int], list[Camera]], camera: Camera
    ) -> tuple[SetSettings, VDISet]:
        """Return the set: V_Os to begin with, and then one after the other where it is worst.

        ``first`` returns so many views to begin with, and ``camera`` is kept in the set.
        """
        settings, vdis, frames = self._begun(first, camera)
        vdi_set = VDISet(vdis, window_size=self._maker.window_size)
        finer = self._maker.of(settings.finer())
        ssim = np.full(len(self._probes), -np.inf)
        shown: list[Any] = [None] * len(self._probes)
        hopeless = np.zeros(len(self._probes), bool)
        full = False
        while True:
            self._judge(vdi_set, ssim, shown)
            worst = int(np.where(hopeless, np.inf, ssim).argmin())
            if ssim[worst] >= self._aim or np.count_nonzero(hopeless) >= _IN_VAIN:
                break
            full = frames * (1 + 1 / len(vdi_set)) > self._limit  # of VDIs that are no finer
            if full or len(vdi_set) >= self._max_views:
                break
            more = finer(self._probes[worst])
            if self._limit < math.inf:
                frames += file_bytes(more)
                full = frames + self._around([*vdi_set, more], settings, camera) > self._limit
            if full:
                break
            vdi_set.add(more)
            self._judge(vdi_set, ssim, shown)
            hopeless[worst] = ssim[worst] < self._aim  # although from its own V_O
        self._warn(ssim, full)
        vdi_set.about = self._about(settings, ssim, camera)
        self._report(1.0)
        return settings, vdi_set

    def _begun(
        self, first: Callable[[int], list[Camera]], camera: Camera
    ) -> tuple[SetSettings, list[VDI], int]:
        """Return settings that are within the limit, the first VDIs, and bytes of their frames."""
        settings = self._chosen(self._limit)
        while True:
            _log.debug("a set of %s", settings)
            vdis, frames, nbytes = self._made(settings, first(settings.views), camera)
            if nbytes <= self._limit:
                return settings, vdis, frames
            # They take more than expected: as much less is planned for
            before, share = settings, _ROOM * self._limit / nbytes
            settings = self._chosen(share * before.nbytes)
            if settings == before or math.isnan(before.nbytes):
                width, height = vdis[0].window_size
                warn_external(
                    f"max_bytes={self._limit:.0f} cannot be kept: the smallest set, one VDI of "
                    f"{width} x {height} lists of up to {before.max_supersegments}, takes {nbytes} "
                    "bytes; allow more, or ask for a smaller window, or for fewer or shorter lists"
                )
                return before, vdis, frames

    def _made(
        self, settings: SetSettings, views: list[Camera], camera: Camera
    ) -> tuple[list[VDI], int, int]:
        """Return VDIs, bytes of their frames, and of the file: estimated once it is too large."""
        make, frames, nbytes = self._maker.of(settings), 0, 0
        vdis: list[VDI] = []
        for view in views:
            self._report(_PILOT_SHARE + _FIRST_SHARE * len(vdis) / len(views))
            vdis.append(make(view))
            if self._limit < math.inf:
                frames += file_bytes(vdis[-1])
                nbytes = frames + self._around(vdis, settings, camera)
                if nbytes > self._limit:
                    return vdis, frames, nbytes * len(views) // len(vdis)
        return vdis, frames, nbytes

    def _around(self, vdis: Sequence[VDI], settings: SetSettings, camera: Camera) -> int:
        """Return the bytes of head and index of a file of these VDIs."""
        about = self._about(settings, np.full(len(self._probes), 1 / 3), camera)
        return bytes_around(VDISet(vdis, window_size=self._maker.window_size, about=about))

    def _judge(self, vdi_set: VDISet, ssim: NDArray[Any], shown: list[Any]) -> None:
        """Measure the views that are shown by other VDIs than before, or by others as well."""
        for i, view in enumerate(self._probes):
            parts = vdi_set.weights(view)
            if parts != shown[i]:
                done = _PILOT_SHARE + _FIRST_SHARE
                self._report(done + (1 - done) * i / len(self._probes))
                shown[i] = parts
                ssim[i] = self._maker.ssim([(vdi_set[k], w) for k, w in parts], view)

    def _warn(self, ssim: NDArray[np.float64], full: bool) -> None:
        missed = int((ssim < self._goal).sum())
        if missed:
            within = f" within max_bytes={self._limit:.0f}" if full else ""
            warn_external(
                f"target_ssim={self._goal:g} is not reached in {missed} of {len(ssim)} directions"
                f"{within}: {ssim.min():.4f} is the worst; allow more bytes or views, more or "
                "longer lists, or ask for less"
            )

    def _about(
        self, settings: SetSettings, ssim: NDArray[np.float64], camera: Camera
    ) -> dict[str, Any]:
        return {
            "target_ssim": self._goal,
            "chosen": {
                "lists": settings.lists,
                "max_supersegments": settings.max_supersegments,
            },
            "reached": {
                "directions": len(ssim),
                "least": round(float(ssim.min()), 5),
                "mean": round(float(ssim.mean()), 5),
                "below_target": int((ssim < self._goal).sum()),
            },
            "camera": camera.to_dict(),
        }

    def _report(self, fraction: float) -> None:
        self._done = max(self._done, min(1.0, fraction))  # where it begins anew, too
        if self._progress is not None and self._progress(self._done) is False:
            raise Cancelled("making a set of VDIs was cancelled")


@dataclass(frozen=True, eq=False)
class _Choice:
    """Settings with as many views as keep the goal, what they lose, and at each angle."""

    settings: SetSettings
    loss: float
    losses: NDArray[np.float64]

    def within(self, limit: float) -> tuple[SetSettings, float]:
        """Return them with as many views as a limit of bytes allows, one at least; and the loss."""
        full = self.settings
        if not full.nbytes > limit:
            return full, self.loss
        each = full.nbytes / full.views
        views = max(1, int(limit / each))
        angle = min(180.0, _SPACING / math.sqrt(views))
        loss = float(_between(list(_ANGLES), self.losses, angle))
        return dataclasses.replace(full, views=views, nbytes=views * each), max(self.loss, loss)


@dataclass(frozen=True)
class _Measured:
    """What settings, lists per pixel and the longest list, lose at each angle, and their bytes."""

    settings: Sequence[tuple[float, int]]
    losses: NDArray[np.float64]
    nbytes: NDArray[np.float64]

    def expected(self, lists: float, longest: int) -> tuple[NDArray[np.float64], float]:
        """Return the losses at each angle, and the bytes, of other settings.

        What short lists lose and what few lists lose add up; bytes are their product.
        """
        rows = np.column_stack([self.losses, np.log(self.nbytes)])
        if (lists, longest) in self.settings:
            found = rows[self.settings.index((lists, longest))]
        else:
            usual = rows[self.settings.index(_USUAL)]
            found = (
                self._along(rows, 1, longest, _USUAL[0])
                + self._along(rows, 0, lists, _USUAL[1])
                - usual
            )
        return np.maximum(found[:-1], 0.0), float(math.exp(found[-1]))

    def _along(
        self, rows: NDArray[np.float64], which: int, value: float, other: float
    ) -> NDArray[np.float64]:
        """Return rows interpolated along one of both settings, the other one as usual."""
        chosen = sorted(
            (setting[which], i)
            for i, setting in enumerate(self.settings)
            if setting[1 - which] == other
        )
        at = [math.log(there) for there, _ in chosen]
        return _between(at, rows[[i for _, i in chosen]], math.log(value))


def _between(at: list[float], rows: NDArray[np.float64], x: float) -> NDArray[np.float64]:
    """Return rows interpolated linearly, and continued beyond the ends."""
    k = int(np.clip(np.searchsorted(at, x) - 1, 0, len(at) - 2))
    share = (x - at[k]) / (at[k + 1] - at[k])
    return np.asarray(rows[k] + share * (rows[k + 1] - rows[k]))


def file_bytes(vdi: VDI) -> int:
    """Return what a VDI takes in a .vdiset file with the defaults of :meth:`VDISet.save`."""
    stream = io.BytesIO()
    StepsWriter("8-byte", 0.0, 1, "zstd", 1).write(stream, vdi, 0.0)
    return stream.tell()


def _lean(vdi: VDI) -> VDI:
    """Return a packed VDI without the arrays that are unpacked when they are asked for."""
    if not isinstance(vdi.packing, Packed8):
        return vdi
    return VDI._of_packing(
        vdi.camera,
        vdi.window_size,
        vdi.offsets,
        vdi.packing,
        vdi.bounds,
        depth_origin=vdi.depth_origin,
        metadata=vdi.metadata,
    )
