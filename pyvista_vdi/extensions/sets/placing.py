"""Chooses how the VDIs of a set are made, and puts V_Os among views until all reach a goal."""

from __future__ import annotations

import dataclasses
import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import Cancelled, warn_external
from pyvista_vdi.extensions.sets.files import bytes_around
from pyvista_vdi.extensions.sets.vdi_set import VDISet
from pyvista_vdi.extensions.sets.view_maker import FINER, SetSettings, ViewMaker, file_bytes
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI

_log = logging.getLogger(__name__)

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
#: Directions that miss the target next to a V_O of their own, after which it is given up.
_IN_VAIN = 4

Progress = Callable[[float], object]


class Placing:
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
        self._growth = (FINER, FINER)

    def measure(self, lists: float | None, max_supersegments: int | None, *, sphere: bool) -> None:
        """Find out by a few VDIs what settings are expected to give: the choices."""
        self._growth = (
            FINER if lists is None else 1.0,
            FINER if max_supersegments is None else 1.0,
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
            "chosen": {"lists": settings.lists, "max_supersegments": settings.max_supersegments},
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
