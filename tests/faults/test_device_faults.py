"""A device that runs short, fails or is lost: a clear error, and the next call works."""

from __future__ import annotations

import signal

import pytest
from drawing import generate_vdi
from faulty_driver import (
    ALLOCATIONS,
    CAMERA,
    LAUNCHES,
    OPERATIONS,
    TRANSFER,
    WAITS,
    WINDOW,
    fresh_volume,
    same,
    state_of,
)
from runtimes import fresh_runtime

from pyvista_vdi.device import programs
from pyvista_vdi.errors import Cancelled, DeviceError, DeviceMemoryError, KernelBuildError

#: Buffers of a volume and of a VDI that are on the device, and those that are always small.
VOLUME = {"volume 'values'", "ranges of macrocells"}
VDI = {
    *("list headers", "centre rays", "supersegment faces", "supersegment media"),
    *("occupancy counts", "occupancy masks"),
}
SMALL = {"transfer function", "visible macrocells"}
# Of a VDI that the error's frames hold: a GPU keeps them
LISTS = {"list offsets", "front depths", "back depths", "supersegment colours", "optical depths"}

every_operation = pytest.mark.parametrize(
    "operation", list(OPERATIONS.values()), ids=list(OPERATIONS)
)


def calls_of(driver, names, operation, runtime):
    """How often an operation calls some of the driver's functions, and what it makes."""
    operation(runtime)  # compiles
    driver.count(names)
    expected = operation(runtime)
    calls = driver.calls
    driver.work()
    return calls, expected


#: How many calls of the driver lie between two that fail: every one is tried in the long run.
strides = pytest.mark.parametrize("stride", [5, pytest.param(1, marks=pytest.mark.slow)])


@every_operation
@strides
@pytest.mark.parametrize("code", ["MEM_OBJECT_ALLOCATION_FAILURE"])
def test_memory_that_runs_out_at_each_allocation(runtime, driver, operation, code, stride):
    """Also while the error is kept, as an interactive session keeps its last one."""
    calls, expected = calls_of(driver, ALLOCATIONS, operation, runtime)
    assert calls >= 5
    before = state_of(runtime)
    for k in range(0, calls, stride):
        driver.fail(ALLOCATIONS, k, code)
        with pytest.raises(DeviceMemoryError, match="ran out of memory .*the driver says") as error:
            operation(runtime)
        driver.work()
        message = str(error.value)
        assert "for the buffer" in message
        assert "smaller volume, window size or max_supersegments" in message
        # A volume or a VDI on the device is there for its next frame; nothing is there by half
        kept = {name for name, _ in state_of(runtime)[0]} - {name for name, _ in before[0]}
        for cached in (VOLUME, VDI, LISTS):
            assert kept.isdisjoint(cached) or kept >= cached, (k, message)
        assert kept <= SMALL | VOLUME | VDI | LISTS, (k, message)
        del error
        assert state_of(runtime) == before, (k, message)
    assert same(operation(runtime), expected)


LOST = "start the program again if the device was lost"


@pytest.mark.parametrize(
    ("operation", "code", "error", "remedy"),
    [
        (OPERATIONS["generate"], "DEVICE_NOT_AVAILABLE", DeviceError, LOST),
        (OPERATIONS["render"], "INVALID_OPERATION", DeviceError, "try again"),
        (OPERATIONS["render_volume"], "OUT_OF_RESOURCES", DeviceMemoryError, "a smaller volume"),
    ],
)
def test_a_device_that_is_lost_in_the_middle(runtime, driver, operation, code, error, remedy):
    """At a launch, a copy or a fill: the first, the last, and some between."""
    calls, expected = calls_of(driver, LAUNCHES, operation, runtime)
    before = state_of(runtime)
    for k in sorted({0, 1, calls // 3, calls // 2, calls - 1}):
        driver.fail(LAUNCHES, k, code)
        with pytest.raises(error, match=f"the driver says {code}") as caught:
            operation(runtime)
        driver.work()
        assert remedy in str(caught.value)
        del caught
        assert state_of(runtime) == before
        assert same(operation(runtime), expected), k


@every_operation
def test_a_device_that_is_lost_while_it_is_waited_for(runtime, driver, operation):
    """Where drivers report what went wrong in a kernel."""
    expected = operation(runtime)
    before = state_of(runtime)
    driver.fail(WAITS, "each", "DEVICE_NOT_AVAILABLE")
    with pytest.raises(DeviceError, match=f"while (waiting|reading|writing).*{LOST}"):
        operation(runtime)
    driver.work()
    assert state_of(runtime) == before
    assert same(operation(runtime), expected)


@pytest.mark.parametrize(
    ("operation", "broken"),
    [
        ("generate", "generation/march_lists.cl"),
        ("render", "raycasting/raycast.cl raycasting/packets.cl"),
    ],
)
def test_a_kernel_that_does_not_compile(runtime, operation, broken, monkeypatch):
    """The message names the file and shows the compiler's log; nothing half made is kept.

    A device takes one of a step's files, for one ray or for sixteen.
    """
    operation, files = OPERATIONS[operation], broken.split()
    expected = operation(runtime)
    expand = programs.expand

    def spoiled(path):
        return expand(path) + ("int broken = missing_name;\n" if str(path) in files else "")

    # In a context of its own nothing is compiled yet
    fresh = fresh_runtime(runtime)
    before = state_of(fresh)
    with monkeypatch.context() as patched:
        patched.setattr(programs, "expand", spoiled)
        with pytest.raises(
            KernelBuildError, match=f"({'|'.join(files)}) does not compile on"
        ) as caught:
            operation(fresh)
    error = caught.value
    for said in (str(error), error.log, error.source):
        assert "missing_name" in said
    assert "-cl-std" in error.options
    del caught, error
    assert state_of(fresh) == before
    assert same(operation(fresh), expected)


@every_operation
@strides
def test_ctrl_c_at_each_use_of_the_device(runtime, driver, operation, stride):
    """A real SIGINT before each launch, copy, fill and allocation."""
    names = (*ALLOCATIONS, *LAUNCHES)
    calls, expected = calls_of(driver, names, operation, runtime)
    before = state_of(runtime)
    for k in range(0, calls, stride):
        driver.fail(names, k, lambda: signal.raise_signal(signal.SIGINT))
        with pytest.raises(KeyboardInterrupt):
            operation(runtime)
        driver.work()
        assert state_of(runtime) == before, k
    assert same(operation(runtime), expected)


def test_cancelling_at_each_report(runtime):
    """``progress`` that returns False, at every call."""
    arguments = (fresh_volume(), CAMERA, WINDOW, TRANSFER)
    options = {"device": runtime, "memory_limit": 2**21}  # slices of a few rows
    fractions = []
    generate_vdi(*arguments, progress=fractions.append, **options)
    assert len(fractions) > 5
    before = state_of(runtime)
    for last in range(len(fractions)):
        calls = []

        def progress(fraction, calls=calls, last=last):
            calls.append(fraction)
            return len(calls) <= last

        with pytest.raises(Cancelled):
            generate_vdi(*arguments, progress=progress, **options)
        assert state_of(runtime) == before
