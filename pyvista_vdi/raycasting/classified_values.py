"""Classify deferred VDIs on a device, in one pass over their supersegments."""

import threading
import weakref

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import DeviceBuffer, Runtime, get_runtime, padded
from pyvista_vdi.device.constants import GROUP
from pyvista_vdi.errors import NoDeviceError
from pyvista_vdi.model.classify_values import CELLS, Media, classify
from pyvista_vdi.model.deferred import DeferredVDI, Floats
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.types import DeviceLike
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.kernels import CLASSIFY_VALUES

#: Whole numbers of this stand for opacities: sums over all cells stay below 2^63.
_UNITS = 2.0**40

#: What is on devices of a deferred VDI: means, spreads and steps, which no look changes.
_uploads: weakref.WeakKeyDictionary[DeferredVDI, dict[Runtime, dict[str, DeviceBuffer]]] = (
    weakref.WeakKeyDictionary()
)
_lock = threading.Lock()


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

    def on_device(deferred: DeferredVDI, of_cells: Floats) -> Media:
        with (
            runtime.upload(integrals(of_cells), "integrals of a transfer function") as table,
            runtime.buffer((n, 3), name="supersegment colours") as colors,
            runtime.buffer((n,), name="optical depths") as optical_depths,
        ):
            launch = runtime.bind(
                CLASSIFY_VALUES,
                **values_on_device(runtime, deferred),
                integrals=table,
                colors=colors,
                optical_depths=optical_depths,
            )
            launch(padded(n, GROUP), GROUP, count=n, cells=CELLS)
            return runtime.download(colors), runtime.download(optical_depths)

    return classify(deferred, transfer_function, on_device)


def release_values(deferred: DeferredVDI) -> None:
    """Release a deferred VDI's values from devices; they are uploaded when used again."""
    with _lock:
        gone = _uploads.pop(deferred, None)
    del gone  # without the lock


def integrals(of_cells: Floats) -> NDArray[np.float32]:
    """Return what kernels take of a transfer function, float32 (CELLS + 2, 2, 4).

    The low end of the range, then the integrals over cells up to each. Pairs of a large part and
    what it leaves. Where nothing is added, nothing changes: sums are of whole numbers.
    """
    units = np.rint(of_cells * _UNITS).astype(np.int64)
    table = np.zeros((CELLS + 2, 4), np.int64)
    table[0] = units[0]
    np.cumsum(units[1:], axis=0, out=table[2:])
    whole = table / _UNITS
    large = whole.astype(np.float32)
    return np.stack([large, (whole - large).astype(np.float32)], axis=1)


def values_on_device(runtime: Runtime, deferred: DeferredVDI) -> dict[str, DeviceBuffer]:
    """Return means, spreads and steps on a device, made once for a deferred VDI."""
    with runtime.holding(_lock):
        kept = _uploads.setdefault(deferred, {})
        if runtime not in kept:
            arrays = {"means": deferred.mean, "spreads": deferred.spread, "steps": deferred.steps}
            kept[runtime] = {
                name: runtime.upload(np.ascontiguousarray(array), f"{name} of values")
                for name, array in arrays.items()
            }
            runtime.finish()  # a thread with another queue may use them next
        return kept[runtime]
