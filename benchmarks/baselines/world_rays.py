"""Lochmann et al. 2016: rays in the world that step through V_O's image by projection."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baselines.medium import KERNELS, DeviceMedium, view_of
from pyvista_vdi.device import Runtime
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.render_options import TRANSMITTANCE_CUTOFF
from pyvista_vdi.model.vdi import VDI


class WorldRays(DeviceMedium):
    """A VDI drawn by rays of the new view, every supersegment intersected as a pyramid's part.

    Theirs is of ``criterion="transmittance"``. ``binary``: whether a list's first supersegment is
    found by halving, not by looking from its beginning.
    """

    def __init__(self, runtime: Runtime, vdi: VDI, *, binary: bool = True) -> None:
        super().__init__(runtime, vdi)
        defines = {"BINARY_SEARCH": 1} if binary else {}
        self._kernel = runtime.kernel(KERNELS, "world_rays", defines)

    def image(self, camera: Camera, size: tuple[int, int]) -> NDArray[np.float32]:
        """Draw a frame; premultiplied RGBA (H, W, 4)."""
        before = (*self.lists, np.int32(self.wide), np.int32(self.high))
        after = (np.float32(TRANSMITTANCE_CUTOFF),)
        return self.draw(self._kernel, view_of(self, camera, size), size, before, after)
