"""Pictures that are blended of several VDIs' of the same scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.raycast import render_vdi


def blended(parts: Sequence[tuple[VDI, float]], request: FrameRequest) -> NDArray[np.float32]:
    """Return the mean of what VDIs show, with their weights; float32 (H, W, 4), premultiplied."""
    (vdi, weight), *others = parts
    image: NDArray[Any] = render_vdi(vdi, request)
    if others:
        image *= np.float32(weight)
    for vdi, weight in others:
        image += np.float32(weight) * render_vdi(vdi, request.replace(out=None))
    return image
