"""Classify deferred VDIs on a device, in one pass over their supersegments."""

from typing import Any

import numpy as np

from pyvista_vdi.device import get_runtime, padded
from pyvista_vdi.device.constants import GROUP
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.types import DeviceLike
from pyvista_vdi.model.vdi import CELLS, VDI, DeferredVDI, Media, ValuesLook, classify


def classify_on_device(
    deferred: DeferredVDI, transfer_function: TransferFunction, device: DeviceLike | None = None
) -> VDI:
    """Return what a transfer function makes of values, whose arrays a device makes when asked."""
    runtime = get_runtime(device)

    def media_of(look: ValuesLook, rows: Any) -> Media:
        """Return straight colours, float32 (n, 3), and optical depths, float32 (n,)."""
        kept = (deferred.mean, deferred.spread, deferred.steps)
        means, spreads, steps = (np.ascontiguousarray(each[rows]) for each in kept)
        n = len(means)
        if n == 0:
            return np.zeros((0, 3), np.float32), np.zeros(0, np.float32)
        with (
            runtime.upload(means, "means of values") as of_means,
            runtime.upload(spreads, "spreads of values") as of_spreads,
            runtime.upload(steps, "steps of values") as of_steps,
            runtime.upload(look.integrals, "integrals of a transfer function") as table,
            runtime.result((n, 3), name="supersegment colours") as colors,
            runtime.result((n,), name="optical depths") as optical_depths,
        ):
            launch = runtime.bind(
                "raycasting/classify_values.cl",
                "classify_values",
                means=of_means,
                spreads=of_spreads,
                steps=of_steps,
                integrals=table,
                colors=colors,
                optical_depths=optical_depths,
            )
            launch(padded(n, GROUP), GROUP, count=n, cells=CELLS)
            return runtime.download(colors), runtime.download(optical_depths)

    return classify(deferred, transfer_function, media_of)
