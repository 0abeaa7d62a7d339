"""Classify deferred VDIs on a device, in one pass over their supersegments."""

from pyvista_vdi.device import get_runtime, padded
from pyvista_vdi.device.constants import GROUP
from pyvista_vdi.errors import NoDeviceError
from pyvista_vdi.model.classify_values import CELLS, Media, ValuesLook, classify
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.types import DeviceLike
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.prepared import kept_values


def classify_on_device(
    deferred: DeferredVDI, transfer_function: TransferFunction, device: DeviceLike | None = None
) -> VDI:
    """Return what :func:`~pyvista_vdi.model.classify_values.classify` does, computed on a device.

    On the host where there is none, or where it cannot hold the arrays.
    """
    try:
        runtime = get_runtime(device)
    except NoDeviceError:
        if device is not None:
            raise
        return classify(deferred, transfer_function)
    n = deferred.n_supersegments
    if n == 0 or 12 * n > runtime.info.max_allocation:
        return classify(deferred, transfer_function)

    def on_device(look: ValuesLook) -> Media:
        with (
            runtime.upload(look.integrals(), "integrals of a transfer function") as table,
            runtime.result((n, 3), name="supersegment colours") as colors,
            runtime.result((n,), name="optical depths") as optical_depths,
        ):
            launch = runtime.bind(
                "raycasting/classify_values.cl",
                "classify_values",
                **kept_values(runtime, deferred).values,
                integrals=table,
                colors=colors,
                optical_depths=optical_depths,
            )
            launch(padded(n, GROUP), GROUP, count=n, cells=CELLS)
            return runtime.download(colors), runtime.download(optical_depths)

    return classify(deferred, transfer_function, on_device)
