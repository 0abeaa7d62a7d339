"""Drivers that fail when they are told to, and the scene that faults are tried on."""

from __future__ import annotations

import gc
import weakref

import numpy as np
from drawing import generate_vdi, raycast_volume, render_vdi

from pyvista_vdi import Camera, TransferFunction, Volume
from pyvista_vdi.device import DeviceBuffer, devices
from pyvista_vdi.raycasting.prepared import prepared_vdi

#: The driver's functions that the runtime calls, by what they are for.
ALLOCATIONS = ("Buffer",)
LAUNCHES = ("enqueue_nd_range_kernel", "enqueue_copy", "enqueue_fill_buffer")
WAITS = ("finish",)

WINDOW = (24, 17)
CAMERA = Camera((3.5, 3.5, 30), (3.5, 3.5, 3.5), (0, 1, 0))
TURNED = CAMERA.azimuth(20)
TRANSFER = TransferFunction(np.eye(3), [0.0, 0.3, 0.6], (0, 100), interpolation="linear")


def fresh_volume():
    """A new object: nothing of it is on a device."""
    rng = np.random.default_rng(1)
    return Volume((rng.random((8, 9, 10)) * 100).astype(np.float32))


def _generate(runtime):
    vdi = generate_vdi(fresh_volume(), CAMERA, WINDOW, TRANSFER, device=runtime)
    return [vdi.offsets, vdi.front, vdi.back, vdi.color, vdi.optical_depth]


def _prepare(runtime):
    vdi = generate_vdi(fresh_volume(), CAMERA, WINDOW, TRANSFER, device=runtime)
    prepared = prepared_vdi(runtime, vdi)
    return [runtime.download(prepared.occupancy.counts), runtime.download(prepared.occupancy.masks)]


def _render(runtime):
    vdi = generate_vdi(fresh_volume(), CAMERA, WINDOW, TRANSFER, device=runtime)
    return [render_vdi(vdi, TURNED, device=runtime)]


def _render_volume(runtime):
    return [raycast_volume(fresh_volume(), TURNED, WINDOW, TRANSFER, device=runtime)]


#: Public operations on objects that the device has not seen, and their results as bytes.
OPERATIONS = {
    "generate": _generate,
    "prepare": _prepare,
    "render": _render,
    "render_volume": _render_volume,
}


class Driver:
    """Counts calls of the driver's functions, and lets one of them fail."""

    def __init__(self, monkeypatch):
        self._cl = devices.opencl()
        self.calls = 0
        self._fail_at = None
        self._error = None
        self._names = ()
        for name in (*ALLOCATIONS, *LAUNCHES):
            monkeypatch.setattr(self._cl, name, self._wrapped(name, getattr(self._cl, name)))
        queue = self._cl.CommandQueue
        monkeypatch.setattr(queue, "finish", self._wrapped("finish", queue.finish))

    def _wrapped(self, name, function):
        def call(*args, **kwargs):
            if name in self._names:
                self.calls += 1
                if self._fail_at in (self.calls - 1, "each"):
                    self._fail()
            return function(*args, **kwargs)

        return call

    def _fail(self):
        if callable(self._error):
            self._error()
            return
        raise self.error(self._error)

    def error(self, code):
        """An error as the driver raises it."""

        class DriverError(self._cl.Error):
            pass

        DriverError.code = getattr(self._cl.status_code, code)
        return DriverError(f"the driver says {code}")

    def count(self, names):
        """Count the calls of some functions from now on."""
        self._names, self._fail_at, self.calls = names, None, 0

    def fail(self, names, at, error):
        """Let call number ``at`` of some functions, or each, fail by a code, or call ``error``."""
        self._names, self._fail_at, self._error, self.calls = names, at, error, 0

    def work(self):
        """Let everything work again."""
        self._names, self._fail_at = (), None


#: Those that nobody has let go of; not by ``gc.get_objects``, which spoils the tuples that other
#: threads are making (tuple() of a generator then raises SystemError, or worse).
_BUFFERS = weakref.WeakSet()


def _noted(self, *args, _init=DeviceBuffer.__init__, **kwargs):
    _init(self, *args, **kwargs)
    _BUFFERS.add(self)


DeviceBuffer.__init__ = _noted


def state_of(runtime):
    """What must be as before when something went wrong: buffers, memory."""
    gc.collect()
    living = sorted((buffer.name, buffer.nbytes) for buffer in _BUFFERS if not buffer.released)
    return living, runtime.allocated


def same(first, second):
    return all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))
