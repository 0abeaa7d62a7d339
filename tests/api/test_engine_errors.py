"""What the engine refuses, in which words, and that nothing stays behind."""

from __future__ import annotations

import functools
import gc
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from drawing import generate_vdi, raycast_volume, render_vdi
from runtimes import fresh_runtime

from pyvista_vdi import VDI, Camera, TransferFunction, Volume
from pyvista_vdi.device import Launch
from pyvista_vdi.errors import (
    Cancelled,
    DeviceMemoryError,
    InvalidArgumentError,
    InvalidCameraError,
    InvalidVolumeError,
)
from pyvista_vdi.generation.slices import estimate

WINDOW = (12, 9)
CAMERA = Camera((3.5, 3.5, 30), (3.5, 3.5, 3.5), (0, 1, 0))
TURNED = CAMERA.azimuth(20)


def some_volume(points=8, dtype=np.float32):
    rng = np.random.default_rng(1)
    return Volume((rng.random((points,) * 3) * 100).astype(dtype))


VOLUME = some_volume()
TRANSFER = TransferFunction(np.eye(3), [0.0, 0.3, 0.6], (0, 100), interpolation="linear")


@pytest.fixture
def make(runtime):
    """``generate_vdi`` of a small scene, with some arguments changed."""

    def generate(volume=VOLUME, camera=CAMERA, window_size=WINDOW, transfer=TRANSFER, **options):
        return generate_vdi(volume, camera, window_size, transfer, device=runtime, **options)

    return generate


@pytest.fixture
def draw(runtime):

    def render(volume=VOLUME, camera=CAMERA, window_size=WINDOW, transfer=TRANSFER, **options):
        return raycast_volume(volume, camera, window_size, transfer, device=runtime, **options)

    return render


@pytest.fixture
def view(runtime, make):
    vdi = make()

    def render(camera=TURNED, window_size=None, **options):
        return render_vdi(vdi, camera, window_size, device=runtime, **options)

    return render


WINDOW_EDGES = "between 1 and 65536 pixels along each edge; got"
SHORTEST = r"sample_distance must be a length of at least 2\.\d+e-05 model units"
PLANES = r"clipping_planes must be \(k, 6\) finite"

#: Which functions take an argument, values that they refuse, and the message.
REFUSED = [
    ("make draw", {"sample_distance": wrong}, rf"{SHORTEST}.*got {re.escape(repr(wrong))}$")
    for wrong in (0, -0.5, np.nan, np.inf, 1e-9, "small", [1])
]
REFUSED += [
    ("make draw view", {"window_size": wrong}, f"window_size must be .*{message}")
    for wrong, message in (
        ((0, 9), f"{WINDOW_EDGES} 0 x 9"),
        ((12, -1), f"{WINDOW_EDGES} 12 x -1"),
        ((65537, 9), f"{WINDOW_EDGES} 65537 x 9"),
        ((12.5, 9), r"two whole numbers of pixels; got \(12.5, 9\)"),
        ((np.nan, 9), "two whole numbers of pixels; got"),
        ((12, 9, 1), r"two whole numbers of pixels; got \(12, 9, 1\)"),
        (12, "two whole numbers of pixels; got 12"),
        ("ab", "two whole numbers of pixels; got 'ab'"),
    )
]
REFUSED += [
    ("make draw", change, message)
    for change, message in (
        ({"volume": np.ones((4, 4, 4))}, "expected a Volume, got ndarray"),
        ({"transfer": "bone"}, "expected a TransferFunction, got str"),
        ({"transfer": None}, "expected a TransferFunction, got NoneType"),
    )
]
REFUSED += [
    ("draw view", {"opaque_depth": depth}, message)
    for depth, message in (
        (np.ones(WINDOW), r"must have shape \(height, width\) = \(9, 12\); got \(12, 9\)"),
        (np.ones((9, 12, 1)), r"got \(9, 12, 1\)"),
        (np.full((9, 12), np.nan), "opaque_depth holds NaN: use inf where nothing is opaque"),
        (1.0, r"got \(\)"),
        ([[1, 2], [3]], r"opaque_depth must have shape \(height, width\) = \(9, 12\)"),
        ("near", "opaque_depth must have shape.*'near'"),
    )
]
REFUSED += [
    ("draw view", {"clipping_planes": planes}, message)
    for planes, message in (
        ([1, 0, 0, 0, 0, 1], rf"{PLANES}.*got shape \(6,\)"),
        (np.ones((2, 4)), rf"{PLANES}.*got shape \(2, 4\)"),
        ([[[0, 0, 0, 0, 0, 1]]], rf"{PLANES}.*got shape \(1, 1, 6\)"),
        ([[0, 0, 0, 0, np.nan, 1]], PLANES),
        ([[0, 0, 0, 0, 0, np.inf]], PLANES),
        ([[0, 0, 0, 0, 0, 0]], "a clipping plane's normal is zero: give its direction"),
        ([[0, 0, 0, 0, 0, 1], [1, 2, 3, 0, 0, 0]], "clipping plane's normal is zero"),
        ([[0, 0, 0, 0, 0, 1], [2]], PLANES),
        ("x < 0", rf"{PLANES}.*'x < 0'"),
    )
]


@pytest.mark.parametrize(
    ("functions", "change", "message"),
    REFUSED,
    ids=[f"{next(iter(change))}-{k}" for k, (_, change, _) in enumerate(REFUSED)],
)
def test_arguments_that_are_refused(make, draw, view, functions, change, message):
    for name in functions.split():
        with pytest.raises(InvalidArgumentError, match=message):
            {"make": make, "draw": draw, "view": view}[name](**change)
    asked = {"window_size": WINDOW, **change}
    if "window_size" in change:
        with pytest.raises(InvalidArgumentError, match=message):
            estimate(VOLUME, **asked)


@pytest.mark.parametrize("huge", [1.0, 1e18, 1e30, 1e300])
def test_any_tolerance_leaves_one_supersegment_at_least(make, huge):
    """One where nothing transparent lies between: all of the medium is in the lists still."""
    vdi = make(tolerance=huge)
    whole = make(max_supersegments=1)
    np.testing.assert_array_equal(vdi.counts > 0, whole.counts > 0)
    # Merging adds optical depths, one rounding each
    assert vdi.optical_depth.sum() == pytest.approx(whole.optical_depth.sum(), rel=1e-5)
    assert vdi.metadata["tolerance"] == huge


def test_arguments_at_their_limits(make):
    for right in (1, 4096, np.int64(3), 7.0):
        assert 0 < make(max_supersegments=right).counts.max() <= right
    for right in (0, 90, 45.5):
        assert make(view_cone=right).metadata["view_cone"] == right


def test_a_volume_too_thin_for_the_default_step(make, draw):
    """Found by fuzzing: rays of 10^18 steps were begun."""
    thin = Volume(some_volume().array, (1e-9, 1, 1e9))
    for function in (make, draw):
        with pytest.raises(InvalidArgumentError, match="half the smallest spacing, 5e-10, is less"):
            function(thin)


def test_a_step_longer_than_every_ray_is_one_step(make, draw):
    images = [draw(sample_distance=step) for step in (1e3, 1e30, 1e300)]
    assert images[0][..., 3].max() > 0
    for image in images[1:]:
        np.testing.assert_array_equal(image, images[0])
    assert make(sample_distance=1e300).counts.max() == 1


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_volume_of_nan(make, draw, dtype):
    volume = Volume(np.full((4, 4, 4), np.nan, dtype), name="density")
    for function in (make, draw):
        for _ in range(2):  # nothing of the first is remembered as good
            with pytest.raises(InvalidVolumeError, match="every value of 'density' is NaN"):
                function(volume=volume)


def test_one_finite_value_is_enough(make, draw):
    array = np.full((4, 4, 4), np.nan, np.float32)
    array[2, 2, 2] = 50
    nearest = TRANSFER.replace(interpolation="nearest")
    camera = Camera((1.5, 1.5, 12), (1.5, 1.5, 1.5), (0, 1, 0))
    image = draw(Volume(array), camera, transfer=nearest)
    assert np.isfinite(image).all()
    assert image[..., 3].max() > 0
    assert make(Volume(array), camera, transfer=nearest).n_supersegments > 0


def test_other_types_of_vdi_and_camera(runtime, make, view):
    with pytest.raises(InvalidArgumentError, match="expected a VDI, got str"):
        render_vdi("knee.vdi", CAMERA, WINDOW, device=runtime)
    for function in (make, view):
        with pytest.raises(InvalidCameraError):
            function(camera=(0, 0, 1))


def test_a_clipping_planes_normal_may_have_any_length(draw, view):
    for function in (draw, view):
        unit = function(clipping_planes=[[3.5, 0, 0, 1, 0, 0]])
        assert 0 < np.count_nonzero(unit[..., 3]) < unit[..., 3].size
        for length in (1e-300, 1e-45, 1e-20, 1e20, 1e50, 1e300):
            same = function(clipping_planes=[[3.5, 0, 0, length, 0, 0]])
            np.testing.assert_array_equal(same, unit)


def limited(runtime, monkeypatch, *, buffer=2**40, total=2**40):
    """Let the runtime believe in less memory: per buffer, and beyond what it holds now."""
    gc.collect()
    info = replace(runtime.info, max_allocation=buffer, global_memory=runtime.allocated + total)
    monkeypatch.setattr(runtime, "info", info)


def has_memory(total, monkeypatch):
    """Let the host have so many bytes."""
    found = SimpleNamespace(total=total, available=total)
    monkeypatch.setattr("psutil.virtual_memory", lambda: found)


def test_a_volume_too_large_is_named(runtime, make, draw, monkeypatch):
    volume = Volume(np.ones((64, 64, 64), np.float32), name="density")
    limited(runtime, monkeypatch, buffer=2**14)  # a brick of 17 x 17 x 17 points needs 19 KiB
    before = runtime.allocated
    message = "volume 'density', 64 x 64 x 64 of float32 .*brick by brick.* 16.00 KiB .*per buffer"
    for function in (make, draw):
        with pytest.raises(DeviceMemoryError, match=message):
            function(volume=volume)
    del volume  # with which what is known of it is kept
    gc.collect()
    assert runtime.allocated == before


@pytest.mark.every(3)
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_working_memory_too_small_is_named(runtime, make, monkeypatch, share):
    make()  # the volume is on the device
    working = estimate(VOLUME, WINDOW).working
    gc.collect()
    before = runtime.allocated
    limited(runtime, monkeypatch, total=int(share * 0.8 * working))
    buffers = "recorded runs|merge errors|merge thresholds|list lengths|front depths|back depths"
    with pytest.raises(DeviceMemoryError, match=f"the buffer '({buffers})' needs") as caught:
        make()
    assert "max_supersegments" in str(caught.value)
    del caught
    gc.collect()
    assert runtime.allocated == before


def test_a_window_beyond_memory_is_refused_before_anything_is_drawn(
    runtime, make, draw, view, monkeypatch
):
    view()
    limited(runtime, monkeypatch, buffer=2**30, total=2**31)
    before, peak = runtime.allocated, runtime.peak_allocated
    started = []
    monkeypatch.setattr(Launch, "__call__", lambda *args, **_: started.append(args))
    message = "'image' needs 64.00 GiB.*allows 1.00 GiB.*per buffer.*window size"
    with pytest.raises(DeviceMemoryError, match=message):
        view(window_size=(65536, 65536))
    assert not started
    assert runtime.peak_allocated <= max(peak, before + 2**20)
    monkeypatch.undo()
    limited(runtime, monkeypatch, buffer=2**30, total=2**31)
    with pytest.raises(DeviceMemoryError, match=message):
        draw(window_size=(65536, 65536))
    # Four rows of lists at the very least are made at a time
    has_memory(2**60, monkeypatch)
    with pytest.raises(DeviceMemoryError, match="'recorded runs' needs .* GiB"):
        make(window_size=(65536, 65536), max_supersegments=4096)
    gc.collect()
    assert runtime.allocated == before


@pytest.mark.parametrize(
    ("dtype", "window", "limit"),
    [(np.uint8, (64, 48), 20), (np.float32, (37, 5), 1), (np.float64, (16, 16), 300)],
)
def test_the_estimate_bounds_what_is_taken(runtime, dtype, window, limit):
    volume = some_volume(24, dtype)
    stated = estimate(volume, window, max_supersegments=limit)
    camera = Camera((11.5, 11.5, 90), (11.5, 11.5, 11.5), (0, 1, 0))
    own = fresh_runtime(runtime)
    vdi = generate_vdi(volume, camera, window, TRANSFER, max_supersegments=limit, device=own)
    taken = own.peak_allocated
    # Beside it only what is small: forms, table, and 9 bytes for each block of 8 x 8 x 8 points
    assert taken <= stated.volume + stated.working + 2**14
    assert taken >= stated.working / 4
    assert vdi.nbytes <= stated.vdi_worst_case
    assert stated.total == stated.volume + stated.vdi_worst_case + stated.working


@pytest.mark.parametrize(("low", "bytes_each"), [(0.0, 2), (60000.0, 4)])
def test_the_estimate_counts_scalars_taken_relative(runtime, low, bytes_each):
    volume = Volume((60000 + np.arange(32**3).reshape(32, 32, 32) % 90).astype(np.uint16))
    function = TransferFunction([[1, 1, 1]] * 2, [0, 0.2], (low, 60090.0))
    stated = estimate(volume, (16, 16), transfer_function=function)
    assert stated.volume == bytes_each * 32**3
    camera = Camera((15.5, 15.5, 90), (15.5, 15.5, 15.5), (0, 1, 0))
    own = fresh_runtime(runtime)
    generate_vdi(volume, camera, (16, 16), function, device=own)
    assert stated.volume < own.peak_allocated <= stated.volume + stated.working + 2**14


@pytest.fixture
def sliced(make):
    """``make`` in slices of four rows, so that a small window takes several."""
    return functools.partial(make, memory_limit="2.5 MiB")


def test_progress_goes_from_nothing_to_all(make, sliced):
    fractions = []
    sliced(progress=fractions.append)
    assert fractions == [0.0, 4 / 9, 8 / 9, 1.0]
    for answer in (None, 0, "", True):  # only False cancels
        assert isinstance(make(progress=lambda _, answer=answer: answer), VDI)


@pytest.mark.parametrize("error", [Cancelled, KeyboardInterrupt, ValueError])
@pytest.mark.parametrize("at", [0.0, 4 / 9, 1.0])
def test_giving_up_leaves_nothing_allocated(runtime, sliced, at, error):
    kept = sliced()
    gc.collect()
    before, calls = runtime.allocated, []

    def progress(fraction):
        calls.append(fraction)
        if fraction == at and error is not Cancelled:
            raise error(f"generation was cancelled at {at:.0%}")
        return fraction < at

    with pytest.raises(error, match=f"generation was cancelled at {at:.0%}"):
        sliced(progress=progress)
    assert calls[-1] == at
    gc.collect()
    assert runtime.allocated == before
    # And the device is as good as before
    assert sliced().equals(kept)


@pytest.mark.parametrize(
    ("memory", "window", "message"),
    [
        # Before any work
        (2**30, (65536, 65536), r"65536 x 65536 lists needs 32\.00 GiB.* has 1\.00"),
        # Room for the offsets of its lists and nothing more
        (8 * WINDOW[0] * WINDOW[1], WINDOW, "12 x 9 lists .* lower the window size"),
    ],
)
def test_a_vdi_that_the_host_cannot_hold_is_refused(make, monkeypatch, memory, window, message):
    has_memory(memory, monkeypatch)
    with pytest.raises(DeviceMemoryError, match=message):
        make(window_size=window)
