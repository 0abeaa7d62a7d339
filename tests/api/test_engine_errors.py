"""What the engine refuses, in which words, and that nothing stays behind."""

from __future__ import annotations

import functools
import gc
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from drawing import generate_vdi, raycast_volume

from pyvista_vdi import Camera, TransferFunction, Volume
from pyvista_vdi.errors import Cancelled, DeviceMemoryError, InvalidArgumentError

WINDOW = (12, 9)
CAMERA = Camera((3.5, 3.5, 30), (3.5, 3.5, 3.5), (0, 1, 0))


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


def test_a_volume_too_thin_for_the_default_step(make, draw):
    """Found by fuzzing: rays of 10^18 steps were begun."""
    thin = Volume(some_volume().array, (1e-9, 1, 1e9))
    for function in (make, draw):
        with pytest.raises(InvalidArgumentError, match="half the smallest spacing, 5e-10, is less"):
            function(thin)


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


@pytest.fixture
def sliced(make):
    """``make`` in slices of four rows, so that a small window takes several."""
    return functools.partial(make, memory_limit=5 * 2**19)


@pytest.mark.parametrize(("error", "at"), [(Cancelled, 4 / 9), (KeyboardInterrupt, 1.0)])
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
