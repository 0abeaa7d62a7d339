"""Memory on a device: transfers, limits, accounting."""

from __future__ import annotations

import contextlib
import gc
import threading
from dataclasses import replace

import numpy as np
import pytest

from pyvista_vdi import device as ocl
from pyvista_vdi.device import devices
from pyvista_vdi.errors import DeviceError, DeviceMemoryError, InvalidArgumentError

DTYPES = ["u1", "i1", "u2", "i2", "u4", "i4", "u8", "f4", "f8"]


@pytest.mark.parametrize("aligned", [True, False])
def test_upload_and_download(runtime, aligned):
    """Aligned arrays are used in place on a CPU."""
    values = np.random.default_rng(7).integers(0, 120, (5, 3, 4))
    gc.collect()
    before = runtime.allocated
    for dtype in DTYPES:
        array = ocl.aligned_empty((5, 3, 4), dtype) if aligned else np.empty((5, 3, 4), dtype)[::-1]
        assert array.ctypes.data % 4096 == 0 or not aligned
        array[...] = values
        with runtime.upload(array, name="values") as buffer:
            if aligned:  # of others it depends on where the allocator puts them
                assert runtime.allocated - before == (0 if runtime.is_cpu else array.nbytes)
            del array
            back = runtime.download(buffer)
            assert (back.dtype, back.shape) == (np.dtype(dtype), (5, 3, 4))
            np.testing.assert_array_equal(back, values)
            np.testing.assert_array_equal(
                runtime.download(buffer, np.empty(7, dtype)), values.ravel()[:7]
            )
            for change in (runtime.write, runtime.fill):
                with pytest.raises(InvalidArgumentError, match="'values' was uploaded"):
                    change(buffer, back if change == runtime.write else 0)
        assert runtime.allocated == before


@pytest.mark.parametrize("shape", [(3, 5), (1000, 7), (0, 4)])
def test_results_outlive_their_buffers(runtime, shape):
    """On a CPU the array is the buffer's memory: nothing is copied, and it stays when it goes."""
    before = runtime.allocated
    with runtime.result(shape, np.int32) as buffer:
        assert runtime.allocated - before >= buffer.nbytes
        runtime.fill(buffer, np.int32(-7))
        array = runtime.download(buffer)
        if runtime.is_cpu and 0 not in shape:
            assert runtime.download(buffer) is array
        part = runtime.download(buffer, np.empty(0, np.int32))
    assert runtime.allocated == before
    gc.collect()
    assert array.shape == shape
    assert array.dtype == np.int32
    assert array.flags.writeable
    assert part.shape == (0,)
    assert (array == -7).all()


@pytest.mark.parametrize("aligned", [True, False])
def test_a_target_gets_what_kernels_write(runtime, aligned):
    values = np.arange(1, 2001, dtype=np.float32).reshape(40, 50)
    array = ocl.aligned_empty((40, 50), np.float32) if aligned else np.empty(2001, np.float32)[1:]
    array = array.reshape(40, 50)
    array[...] = -1
    before = runtime.allocated
    with runtime.target(array, "values") as buffer:
        in_place = runtime.is_cpu and aligned
        assert (buffer.host is array) == in_place
        assert runtime.allocated - before == (0 if in_place else array.nbytes)
        for factor in (1, 3):  # also what is written after it was read
            runtime.write(buffer, factor * values)
            assert runtime.download(buffer, array) is array
            np.testing.assert_array_equal(array, factor * values)
        runtime.fill(buffer, np.float32(0.5))
        elsewhere = np.empty_like(array)
        np.testing.assert_array_equal(runtime.download(buffer, elsewhere), np.full((40, 50), 0.5))
    assert runtime.allocated == before
    for bad in (array[:, ::2], array.T):
        with pytest.raises(InvalidArgumentError, match="'values' must be C-contiguous"):
            runtime.target(bad, "values")
    array.flags.writeable = False
    with pytest.raises(InvalidArgumentError, match="writeable=False"):
        runtime.target(array, "values")


def test_write_fill_and_download_into(runtime):
    out = np.empty((2, 3), np.int32)
    with runtime.buffer((2, 3), np.int32, name="six") as buffer:
        runtime.write(buffer, np.arange(6, dtype=np.int32).reshape(2, 3)[:, ::-1])
        assert runtime.download(buffer, out=out) is out
        np.testing.assert_array_equal(out, [[2, 1, 0], [5, 4, 3]])
        runtime.fill(buffer, 255)
        assert np.all(runtime.download(buffer) == -1)
        runtime.fill(buffer, np.int32(-5))
        assert np.all(runtime.download(buffer) == -5)
        for use, message in (
            (
                lambda: runtime.write(buffer, np.zeros(6, np.float32)),
                "'six' exchanges C-contiguous",
            ),
            (lambda: runtime.write(buffer, np.zeros(7, np.int32)), "6 at most; the array has 7"),
            (lambda: runtime.download(buffer, out=np.zeros(6, np.float32)), "'six'"),
            (lambda: runtime.download(buffer, out=np.zeros((3, 2), np.int32).T[::-1]), "'six'"),
        ):
            with pytest.raises(InvalidArgumentError, match=message):
                use()


@pytest.mark.parametrize("behind_frames", [False, True])
def test_download_later(runtime, behind_frames):
    values = np.arange(20, dtype=np.float32).reshape(5, 4)
    out = np.zeros(6, np.float32)
    with (
        runtime.background() if behind_frames else contextlib.nullcontext(),
        runtime.upload(values, "values") as buffer,
    ):
        wait = runtime.download_later(buffer, out, first=3)
        wait()
        np.testing.assert_array_equal(out, np.arange(3, 9))
        runtime.download_later(buffer, out[:0], first=20)()
        for first in (-1, 15):
            with pytest.raises(InvalidArgumentError, match=f"has 6 of float32 from {first} on"):
                runtime.download_later(buffer, out, first=first)
        with pytest.raises(InvalidArgumentError, match="float32"):
            runtime.download_later(buffer, out.astype(np.float64))
        out.flags.writeable = False
        with pytest.raises(InvalidArgumentError, match="writeable=False"):
            runtime.download_later(buffer, out)


def test_accounting_follows_release_and_garbage_collection(runtime):
    gc.collect()
    before = runtime.allocated
    kept = runtime.buffer((1000,), np.float64)
    dropped = runtime.buffer((500,), np.float64)
    assert runtime.allocated == before + 12000
    assert runtime.peak_allocated >= before + 12000
    del dropped
    gc.collect()
    assert runtime.allocated == before + 8000
    kept.release()
    kept.release()
    assert kept.released
    assert runtime.allocated == before


def test_accounting_is_safe_between_threads(runtime):
    before = runtime.allocated

    def work() -> None:
        for _ in range(500):
            runtime.buffer((1,)).release()
            kept = runtime.buffer((1,))
            del kept  # goes back by itself

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert runtime.allocated == before


@pytest.fixture
def small(runtime, monkeypatch):
    """The runtime, with 1 MiB per buffer and 2 MiB beyond what is allocated now."""
    gc.collect()
    info = replace(runtime.info, max_allocation=2**20, global_memory=runtime.allocated + 2 * 2**20)
    monkeypatch.setattr(runtime, "info", info)
    return runtime


def test_too_large_a_buffer_is_refused_before_it_is_taken(small):
    before = small.allocated
    message = r"'colours' needs 1.50 MiB \(1572864 bytes\).*1.00 MiB.*per buffer"
    with pytest.raises(DeviceMemoryError, match=message) as caught:
        small.buffer((3 * 2**17,), name="colours")
    assert isinstance(caught.value, MemoryError)
    assert "max_supersegments" in str(caught.value)
    for array in (np.zeros(2**19), ocl.aligned_empty(2**19, np.float64)):
        with pytest.raises(DeviceMemoryError, match="'volume' needs 4.00 MiB"):
            small.upload(array, name="volume")
    with small.buffer((2**18,), name="one"), small.buffer((2**18 - 1,), name="two"):
        with pytest.raises(DeviceMemoryError, match=r"'three' needs .* are in use: release"):
            small.buffer((2,), name="three")
        with small.buffer((1,), name="the rest"):
            assert small.allocated == before + 2**21
    assert small.allocated == before


def test_drivers_refusal_of_a_buffer_is_a_memory_error(runtime, monkeypatch):
    without_limits = replace(runtime.info, max_allocation=2**62, global_memory=2**62)
    monkeypatch.setattr(runtime, "info", without_limits)
    before = runtime.allocated
    message = "ran out of memory or resources while alloc.*'vast'"
    if not runtime.is_cpu:
        pytest.skip("NVIDIA's driver takes no memory before it is used")
    with pytest.raises(DeviceMemoryError, match=message):
        runtime.buffer((2**59,), name="vast")
    assert runtime.allocated == before


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("MEM_OBJECT_ALLOCATION_FAILURE", DeviceMemoryError),
        ("OUT_OF_RESOURCES", DeviceMemoryError),
        ("OUT_OF_HOST_MEMORY", DeviceMemoryError),
        ("INVALID_ARG_SIZE", DeviceError),
        ("DEVICE_NOT_AVAILABLE", DeviceError),
        (None, DeviceError),
    ],
)
def test_driver_errors_keep_their_cause_and_kind(runtime, monkeypatch, code, expected):
    class DriverError(devices.opencl().Error):
        pass

    if code is not None:
        DriverError.code = getattr(devices.opencl().status_code, code)
    driver_error = DriverError("as the driver says")

    def refused(*_, **__):
        raise driver_error

    with runtime.buffer((1,), name="soup") as buffer:
        monkeypatch.setattr(devices.opencl(), "enqueue_fill_buffer", refused)
        with pytest.raises(expected, match="while filling.*'soup'.*as the driver says") as caught:
            runtime.fill(buffer, 0)
    assert type(caught.value) is expected
    assert caught.value.__cause__ is driver_error
