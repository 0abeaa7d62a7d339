"""The regeneration policy: from which error or turn on a view needs a VDI of its own.

Distances between views are those of :meth:`pyvista_vdi.model.view.View.distance`: about radians,
for a volume that fills the picture.
"""

from __future__ import annotations

#: Estimated SSIM below which a view at rest gets a VDI of its own. Over the measured views a VDI
#: of 20 supersegments keeps .96 to .99 when it is only turned; zooming in by two, or looking past
#: what V_O's window covered, falls below (docs/regeneration.md).
REGENERATE_BELOW = 0.95
#: Nearer to V_O than this, a VDI of the view itself would show the same.
AT_HOME = 0.02
#: Farther than this from the view that a VDI is being made for, it is given up.
OUT_OF_DATE = 0.7

#: While the view moves this multiple of the error is borne: what is made then is soon out of date.
_PATIENCE_IN_MOTION = 2.0
#: Farther than this from the last estimate's view, another is made: at rest, and in motion.
_ANOTHER_ESTIMATE = 0.005
_ANOTHER_ESTIMATE_IN_MOTION = 0.3


def estimate_is_old(apart: float, *, moving: bool) -> bool:
    """Whether a view that is so far from the last estimate's asks for another estimate."""
    return apart > (_ANOTHER_ESTIMATE_IN_MOTION if moving else _ANOTHER_ESTIMATE)


def is_poor(ssim: float, bound: float, *, moving: bool) -> bool:
    """Whether a picture of this estimated SSIM asks for another VDI."""
    return ssim < 1 - (1 - bound) * (_PATIENCE_IN_MOTION if moving else 1)
