"""Drivers that fail when told to, or note what makes a host wait, and the scene of such tests."""

from __future__ import annotations

import contextlib
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
WAITS = ("finish", "enqueue_map_buffer", "enqueue_copy")

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
    """Counts calls of the driver's functions, lets one of them fail, or notes those that wait."""

    def __init__(self, monkeypatch):
        self._cl = devices.opencl()
        self.calls = 0
        self._fail_at = None
        self._error = None
        self._names = ()
        for name in (*ALLOCATIONS, *LAUNCHES, "enqueue_map_buffer"):
            monkeypatch.setattr(self._cl, name, self._wrapped(name, getattr(self._cl, name)))
        queue = self._cl.CommandQueue
        monkeypatch.setattr(queue, "finish", self._wrapped("finish", queue.finish))
        self._patch = monkeypatch

    def _wrapped(self, name, function):
        def call(*args, **kwargs):
            if name in self._names:
                self.calls += 1
                if self._fail_at in (self.calls - 1, "each"):
                    self._fail()
            return function(*args, **kwargs)

        return call

    @contextlib.contextmanager
    def noting(self):
        """Note what keeps a host and a device from working at the same time, and what is copied.

        (what, bytes) of each buffer made of host memory, release of memory that a command in the
        queue may use, wait, and copy, which is "read" or "written" and may block.
        """
        cl, noted, in_use, arguments = self._cl, [], set(), {}
        memory = cl.MemoryObjectHolder
        flags = cl.mem_flags.COPY_HOST_PTR | cl.mem_flags.USE_HOST_PTR

        def before(owner, name, note):
            function = getattr(owner, name)

            def call(*args, **kwargs):
                note(*args, **kwargs)
                return function(*args, **kwargs)

            patch.setattr(owner, name, call)

        def waits(what, nbytes=0):
            noted.append((what, nbytes))
            in_use.clear()

        def makes(context, access, size=0, hostbuf=None):
            if access & flags:
                noted.append(("buffer of host memory", hostbuf.nbytes))

        def takes(kernel, place, value):
            given = arguments.setdefault(kernel.int_ptr, {})
            given[place] = value.int_ptr if isinstance(value, memory) else None

        def runs(queue, kernel, *_, **__):
            in_use.update(arguments[kernel.int_ptr].values())

        def releases(released):
            if released.int_ptr in in_use:
                noted.append(("release in use", released.size))

        def copies(queue, dest, src, is_blocking=True, **_):
            way, host = ("written", src) if isinstance(dest, memory) else ("read", dest)
            if is_blocking:
                waits(f"{way}, blocking", host.nbytes)
                return
            noted.append((way, host.nbytes))
            in_use.update(each.int_ptr for each in (dest, src) if each is not host)

        with self._patch.context() as patch:
            before(cl, "Buffer", makes)
            before(cl.Kernel, "set_arg", takes)
            before(cl, "enqueue_nd_range_kernel", runs)
            before(cl.MemoryObject, "release", releases)
            before(cl, "enqueue_copy", copies)
            before(cl, "enqueue_map_buffer", lambda *_, **__: waits("mapped"))
            before(cl.CommandQueue, "finish", lambda queue: waits("finish"))
            before(cl.Event, "wait", lambda event: noted.append(("wait", 0)))
            yield noted

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
    living = sorted((buffer.name, buffer.nbytes) for buffer in _BUFFERS if buffer.memory)
    return living, runtime.allocated


def same(first, second):
    return all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))
