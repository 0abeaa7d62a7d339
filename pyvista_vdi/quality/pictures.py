"""What pictures that are kept have told, by which VDI or volume draws the next one."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Literal

from pyvista_vdi.model.view import View

#: Least SSIM of a VDI's picture against the volume's for the VDI to be drawn where the volume is at
#: hand, and by what share the contrast within 4 x 4 pixels may differ, where nobody said otherwise.
SIMILAR, _SAME_CONTRAST = 0.98, 0.1
#: Pixels as wide as one list from which on a picture has less detail than its pixels could show.
FINE_ENOUGH = 1.25
#: Degrees from the VDI's view beyond which the volume's picture takes no longer than its own.
_FASTER_WITHIN = 10.0
#: Pictures by the volume, as near to the view at hand as this (about radians), that make a VDI of
#: the view worth while: about as many as it takes the time of, so that what is made in vain at most
#: doubles the cost.
_NEAR, _WORTH_A_VDI = 0.09, 12
#: Pictures by the volume, and estimates, that are remembered.
_PICTURES, _ESTIMATES = 2 * _WORTH_A_VDI, 64
#: Rays that an estimate casts, 16 tiles of 24 x 24 by the VDI and by the volume: a VDI of no more
#: pixels takes no longer to be made.
_JUDGED = 2 * 16 * 24**2
#: An estimate holds for pictures of views as near as this to its own (about radians).
_ANOTHER_JUDGEMENT = 0.02


@dataclass(frozen=True)
class Made:
    """A VDI that is there, as a view shows it; see :mod:`pyvista_vdi.quality.view_error`."""

    number: int  # by which it is known
    bounds: tuple[float, ...]  # of the volume, model frame
    content: Any = None  # of what it was made, and for which view
    screen: Any = None
    angle: float = 0.0
    magnification: float = 1.0
    coverage: float = 1.0
    pixels: float = 0.0  # in which it may be seen
    options: Any = None  # how it is drawn (clipping planes in world coordinates), compared by ==


@dataclass(frozen=True)
class Estimate:
    """What the SSIM of a VDI's picture was found to be."""

    vdi: int
    view: View
    ssim: float
    contrast: float = 1.0
    options: Any = None


@dataclass(frozen=True)
class Pictures:
    """What pictures that are kept have told; it is the same in every run."""

    content: Any = None  # of which they are
    vdi: int | None = None  # of which the estimates are
    by_volume: tuple[View, ...] = ()
    judged: tuple[Estimate, ...] = ()
    poor_from: float = math.inf  # degrees, of the nearest view that the VDI fails
    in_vain: bool = False  # whether a VDI was too poor near its own view

    def of(self, content: Any) -> Pictures:
        """Return the same, or of another content nothing."""
        return self if self.content == content else Pictures(content)

    def serves(
        self,
        made: Made,
        view: View,
        judged: Estimate | Literal[False] | None,
        bound: float | None,
        *,
        joint: bool,
        alone: bool,
    ) -> tuple[Pictures, bool | None]:
        """Return whether a VDI's picture of a view does; ``None`` where an estimate has to tell.

        ``judged`` is what that has told, ``alone`` whether a VDI of this very view would be kept.
        """
        known = self
        if known.vdi != made.number:
            known = replace(known, vdi=made.number, judged=(), poor_from=math.inf)
        if bound is None and made.magnification > FINE_ENOUGH:
            return known, False
        # What fails near the generating view fails farther away: the loss comes at once
        within = 180.0 if joint else _FASTER_WITHIN
        if made.angle > within or made.angle >= known.poor_from or made.coverage < 1:
            return known, False
        at_home = made.screen == view
        if judged is False or (joint and alone and not at_home and made.pixels <= _JUDGED):
            return known, False
        if judged is not None and judged not in known.judged:
            known = replace(known, judged=(*known.judged[1 - _ESTIMATES :], judged))
        same = [each for each in known.judged if each.options == made.options]
        apart = [view.distance(each.view, made.bounds) for each in same]
        if not apart or min(apart) > _ANOTHER_JUDGEMENT:
            return known, None
        error = same[apart.index(min(apart))]
        does = error.ssim >= (SIMILAR if bound is None else bound)
        if bound is None:
            does = does and abs(error.contrast - 1) <= _SAME_CONTRAST
        if not does and made.magnification <= FINE_ENOUGH:
            in_vain = known.in_vain or made.angle <= _FASTER_WITHIN
            known = replace(known, poor_from=made.angle, in_vain=in_vain)
        return known, does

    def drawn_by_volume(self, view: View) -> Pictures:
        """Note a picture that the volume drew; the same one once more costs nothing."""
        if self.by_volume and self.by_volume[-1] == view:
            return self
        return replace(self, by_volume=(*self.by_volume[1 - _PICTURES :], view))

    def deserve_vdi(self, view: View, bounds: tuple[float, ...]) -> bool:
        """Whether so many were drawn near this view that a VDI of it is worth while."""
        near = sum(view.distance(other, bounds) <= _NEAR for other in self.by_volume)
        return not self.in_vain and near >= _WORTH_A_VDI
