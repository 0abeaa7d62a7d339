"""What draws a picture that is kept, VDI or volume: told by the view, never by time."""

from __future__ import annotations

import math

from pyvista_vdi.model.view import View
from pyvista_vdi.quality.frame_state import FrameAsked, Pictures, Sight
from pyvista_vdi.quality.records import replace

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
#: Rays that an estimate casts, 16 tiles of 24 x 24 by the VDI and by the volume: a VDI of no more
#: pixels takes no longer to be made.
_JUDGED = 2 * 16 * 24**2
#: An estimate holds for pictures of views as near as this to its own (about radians).
_ANOTHER_JUDGEMENT = 0.02


def serves(
    pictures: Pictures, seen: Sight, f: FrameAsked, bound: float | None
) -> tuple[Pictures, bool | None]:
    """Return whether a VDI's picture of a view does; ``None`` where an estimate has to tell."""
    if pictures.vdi != seen.vdi:
        pictures = replace(pictures, vdi=seen.vdi, judged=(), poor_from=math.inf)
    if bound is None and seen.magnification > FINE_ENOUGH:
        return pictures, False
    # What fails near V_O fails farther away: the loss comes with the first degrees
    within = 180.0 if f.joint else _FASTER_WITHIN
    if seen.angle > within or seen.angle >= pictures.poor_from or seen.coverage < 1:
        return pictures, False
    if f.judged is False:
        return pictures, False
    alone = f.joint and f.one_view and f.own_pixels  # what is made is kept
    at_home = seen.request is not None and seen.request.screen == f.view
    if alone and not at_home and seen.pixels <= _JUDGED:
        return pictures, False
    if f.judged is not None and f.judged not in pictures.judged:
        pictures = replace(pictures, judged=(*pictures.judged[1 - _ESTIMATES :], f.judged))
    apart, error = min(
        (
            (f.view.distance(each.view, seen.bounds), each)
            for each in pictures.judged
            if each.options == seen.options
        ),
        key=lambda found: found[0],
        default=(math.inf, None),
    )
    if error is None or apart > _ANOTHER_JUDGEMENT:
        return pictures, None
    does = error.ssim >= (SIMILAR if bound is None else bound)
    if bound is None:
        does = does and abs(error.contrast - 1) <= _SAME_CONTRAST
    if not does and seen.magnification <= FINE_ENOUGH:
        in_vain = pictures.in_vain or seen.angle <= _FASTER_WITHIN
        pictures = replace(pictures, poor_from=seen.angle, in_vain=in_vain)
    return pictures, does


def drawn_by_volume(pictures: Pictures, view: View) -> Pictures:
    """Note a picture that the volume drew; the same one once more costs nothing."""
    if pictures.by_volume and pictures.by_volume[-1] == view:
        return pictures
    return replace(pictures, by_volume=(*pictures.by_volume[1 - _PICTURES :], view))


def deserves_vdi(pictures: Pictures, view: View, bounds: tuple[float, ...]) -> bool:
    """Whether so many pictures were drawn near this view that a VDI of it is worth while."""
    near = sum(view.distance(other, bounds) <= _NEAR for other in pictures.by_volume)
    return not pictures.in_vain and near >= _WORTH_A_VDI
