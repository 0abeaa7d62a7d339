"""Brady et al. 1997: cells of equal length, composited once and blended in nearby views."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baselines.medium import KERNELS, DeviceMedium, view_of
from pyvista_vdi.device import Runtime, padded
from pyvista_vdi.device.work_order import GROUP
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI


class TwoPhase(DeviceMedium):
    """A VDI's medium in levels of equal depth, each a picture on a rectangle across V_O.

    The medium is what phase one composites; theirs is a volume.
    """

    def __init__(self, runtime: Runtime, vdi: VDI, levels: int) -> None:
        super().__init__(runtime, vdi)
        lists, cells = self.wide * self.high, self.wide * self.high * levels
        first = float(self.faces[:, 0].min(initial=np.inf)) if len(self.faces) else 0.0
        last = float(self.faces[:, 1].max(initial=-np.inf)) if len(self.faces) else 1.0
        thickness = (last - first) / levels
        self._levels = (np.float32(first), np.float32(thickness), np.int32(levels))
        self.cells = runtime.buffer((levels, lists, 4), name="cells")
        own = view_of(self, vdi.camera, vdi.window_size)
        with runtime.upload(own.forms, "rays of V_O") as forms:
            runtime.launch(
                runtime.kernel(KERNELS, "cut_cells"),
                padded(cells, GROUP),
                GROUP,
                *self.lists,
                *self._levels,
                forms,
                np.int32(own.planes),
                np.int32(self.wide),
                np.int32(self.high),
                self.cells,
            )
            runtime.finish()
        self._kernel = runtime.kernel(KERNELS, "blend_levels")

    @property
    def nbytes(self) -> int:
        """Bytes of the cells: the lists are not needed any more."""
        return self.cells.nbytes

    def image(self, camera: Camera, size: tuple[int, int]) -> NDArray[np.float32]:
        """Draw a frame; premultiplied RGBA (H, W, 4)."""
        view = view_of(self, camera, size)
        first_t = -np.inf if camera.parallel_projection else -view.reference_depth
        before = (self.cells, *self._levels, np.int32(self.wide), np.int32(self.high))
        return self.draw(self._kernel, view, size, before, (np.float32(first_t),))
