"""What draws a picture that is kept, VDI or volume: told by the view, never by time."""

from __future__ import annotations

import weakref
from collections import deque
from collections.abc import Callable
from typing import Any

from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.view import View
from pyvista_vdi.quality.view_error import ViewError, angle_from_generating_view, coverage

#: Least SSIM of a VDI's picture against the volume's for the VDI to be drawn where the volume is at
#: hand, and by what share the contrast within 4 x 4 pixels may differ, where nobody said otherwise.
SIMILAR, _SAME_CONTRAST = 0.98, 0.1
#: Pixels as wide as one list from which on a picture has less detail than its pixels could show.
FINE_ENOUGH = 1.25
#: Degrees from V_O beyond which the volume's picture takes no longer than the VDI's.
_FASTER_WITHIN = 10.0

#: Pictures by the volume, as near to the view at hand as this (about radians), that make a VDI of
#: the view worth while: about as many as it takes the time of, so that what is made in vain at most
#: doubles the cost.
_NEAR, _WORTH_A_VDI = 0.09, 12
#: Pictures by the volume, and estimates, that are remembered.
_PICTURES, _ESTIMATES = 2 * _WORTH_A_VDI, 64
#: An estimate holds for views as near as this to its own (about radians).
_ANOTHER_ESTIMATE = 0.02


class Pictures:
    """Chooses for each picture between a VDI and the volume, the same in every run.

    A VDI is drawn where it has all that the view shows, at its detail, and where an estimate says
    that the picture is like the volume's; beyond some degrees from V_O the volume is as fast.
    """

    def __init__(self) -> None:
        self._by_volume: deque[View] = deque(maxlen=_PICTURES)
        self._judged: list[tuple[View, Any, ViewError]] = []
        self._of: Callable[[], VDI | None] = lambda: None  # a weak reference
        self._poor_from = float("inf")  # degrees from V_O, of the nearest view that the VDI fails
        self._in_vain = False  # whether a VDI was too poor near its own view

    def serves(
        self,
        vdi: VDI,
        view: View,
        *,
        detail: float,
        bound: float | None,
        options: Any,
        estimate: Callable[[], ViewError],
        within: float = _FASTER_WITHIN,
    ) -> bool:
        """Whether a VDI's picture of a view does.

        ``vdi``: of what the volume is now. ``view``: of the whole picture. ``detail``:
        magnification of the picture's own pixels, see
        :func:`~pyvista_vdi.quality.view_error.magnification`. ``bound``: least SSIM that does;
        ``None``: :data:`SIMILAR`, and as much contrast and detail. ``options``: what else an
        estimate depends on, compared by ``==``. ``estimate``: makes an estimate for this view,
        where no former one tells. ``within``: degrees from V_O.
        """
        if self._of() is not vdi:
            self._of, self._judged, self._poor_from = weakref.ref(vdi), [], float("inf")
        if bound is None and detail > FINE_ENOUGH:
            return False
        angle = angle_from_generating_view(vdi, view.camera)
        # What fails near V_O fails farther away: the loss comes with the first degrees
        if angle > within or angle >= self._poor_from or coverage(vdi, view.camera, view.size) < 1:
            return False
        nearest, error = min(
            (
                (view.distance(other, vdi.bounds), error)
                for other, shown, error in self._judged
                if shown == options
            ),
            key=lambda found: found[0],
            default=(float("inf"), None),
        )
        if error is None or nearest > _ANOTHER_ESTIMATE:
            error = estimate()
            self._judged = [*self._judged[1 - _ESTIMATES :], (view, options, error)]
        does = error.ssim >= (SIMILAR if bound is None else bound)
        if bound is None:
            does = does and abs(error.contrast - 1) <= _SAME_CONTRAST
        if not does and detail <= FINE_ENOUGH:
            self._poor_from = angle
            self._in_vain = self._in_vain or angle <= _FASTER_WITHIN
        return does

    def error(self, view: View) -> ViewError | None:
        """Return the estimate that was made for exactly this view; ``None`` if none was."""
        return next((e for other, _, e in reversed(self._judged) if other == view), None)

    def drawn_by_volume(self, view: View) -> None:
        """Note a picture that the volume drew; the same one once more costs nothing."""
        if not self._by_volume or self._by_volume[-1] != view:
            self._by_volume.append(view)

    def deserves_vdi(self, view: View, bounds: tuple[float, ...]) -> bool:
        """Whether so many pictures were drawn near this view that a VDI of it is worth while."""
        near = sum(view.distance(other, bounds) <= _NEAR for other in self._by_volume)
        return not self._in_vain and near >= _WORTH_A_VDI
