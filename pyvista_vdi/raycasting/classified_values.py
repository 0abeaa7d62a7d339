"""Classify deferred VDIs on a device, in one pass over their supersegments."""

from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import Runtime, get_runtime, padded
from pyvista_vdi.device.constants import GROUP
from pyvista_vdi.model.packing import Arrays
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.types import DeviceLike
from pyvista_vdi.model.vdi import CELLS, VDI, DeferredVDI, classification_of, made_vdi


@dataclass(frozen=True, eq=False)
class ValuesLook:
    """Values and a transfer function's integrals, of which a device makes arrays when asked."""

    runtime: Runtime
    deferred: DeferredVDI
    integrals: NDArray[np.float32]

    def media_of(self, rows: Any) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return straight colours, float32 (n, 3), and optical depths, float32 (n,)."""
        runtime, kept = self.runtime, self.deferred
        arrays = {"means": kept.mean, "spreads": kept.spread, "steps": kept.steps}
        n = len(kept.mean[rows])
        with ExitStack() as stack:
            hold = stack.enter_context
            held = {
                name: hold(runtime.upload(array[rows], f"{name} of values"))
                for name, array in arrays.items()
            }
            table = hold(runtime.upload(self.integrals, "integrals of a transfer function"))
            colors = hold(runtime.result((n, 3), name="supersegment colours"))
            optical_depths = hold(runtime.result((n,), name="optical depths"))
            held |= {"integrals": table, "colors": colors, "optical_depths": optical_depths}
            launch = runtime.bind("raycasting/classify_values.cl", "classify_values", **held)
            launch(padded(n, GROUP), GROUP, count=n, cells=CELLS)
            return runtime.download(colors), runtime.download(optical_depths)

    def arrays(self) -> Arrays:
        """Return the arrays: what is transparent is left out."""
        color, optical_depth = self.media_of(slice(None))
        arrays = self.deferred.arrays._replace(color=color, optical_depth=optical_depth)
        rows = np.flatnonzero(optical_depth > 0)
        return arrays.take(np.searchsorted(rows, arrays.offsets.view(np.int64)), rows)


def classify_on_device(
    deferred: DeferredVDI, transfer_function: TransferFunction, device: DeviceLike | None = None
) -> VDI:
    """Return what a transfer function makes of values, whose arrays a device makes when asked."""
    integrals, metadata = classification_of(deferred, transfer_function)
    look = ValuesLook(get_runtime(device), deferred, integrals)
    lists = look if deferred.n_supersegments else deferred.arrays
    return made_vdi(lists, deferred, metadata=metadata)
