"""Memory on a device: transfers, limits, accounting."""

from __future__ import annotations

import gc
from dataclasses import replace

import numpy as np
import pytest

from pyvista_vdi.device import devices
from pyvista_vdi.errors import DeviceError, DeviceMemoryError
from pyvista_vdi.model.host_memory import aligned_empty

DTYPES = ["u1", "i2", "f8"]


@pytest.mark.parametrize("aligned", [True, False])
def test_upload_and_download(runtime, aligned):
    """Aligned arrays are used in place on a CPU."""
    values = np.random.default_rng(7).integers(0, 120, (50, 30, 64))
    gc.collect()
    before = runtime.allocated
    for dtype in DTYPES:
        array = (
            aligned_empty((50, 30, 64), dtype) if aligned else np.empty((50, 30, 64), dtype)[::-1]
        )
        assert array.ctypes.data % 4096 == 0 or not aligned
        array[...] = values
        with runtime.upload(array, name="values") as buffer:
            if aligned:  # of others it depends on where the allocator puts them
                assert runtime.allocated - before == (0 if runtime.is_cpu else array.nbytes)
            del array
            back = runtime.download(buffer)
            assert (back.dtype, back.shape) == (np.dtype(dtype), (50, 30, 64))
            np.testing.assert_array_equal(back, values)
            np.testing.assert_array_equal(
                runtime.download(buffer, np.empty(7, dtype)), values.ravel()[:7]
            )
        assert runtime.allocated == before


@pytest.mark.parametrize("shape", [(1000, 7), (0, 4)])
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
    array = aligned_empty((40, 50), np.float32) if aligned else np.empty(2001, np.float32)[1:]
    array = array.reshape(40, 50)
    array[...] = -1
    before = runtime.allocated
    with runtime.result(array.shape, name="values", out=array) as buffer:
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
    for array in (np.zeros(2**19), aligned_empty(2**19, np.float64)):
        with pytest.raises(DeviceMemoryError, match="'volume' needs 4.00 MiB"):
            small.upload(array, name="volume")
    with pytest.raises(DeviceMemoryError, match=r"no room for an array of 1073741824.00 GiB"):
        aligned_empty(2**60, np.uint8)
    with small.buffer((2**18,), name="one"), small.buffer((2**18 - 1,), name="two"):
        with pytest.raises(DeviceMemoryError, match=r"'three' needs .* are in use: release"):
            small.buffer((2,), name="three")
        with small.buffer((1,), name="the rest"):
            assert small.allocated == before + 2**21
    assert small.allocated == before


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("MEM_OBJECT_ALLOCATION_FAILURE", DeviceMemoryError),
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
