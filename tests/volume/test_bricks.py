"""Volumes on the device brick by brick: the same to the last bit, within a stated memory."""

from __future__ import annotations

import gc
import math

import numpy as np
import pytest
from drawing import generate_vdi, raycast_volume
from runtimes import fresh_runtime, let_lack

from pyvista_vdi import Camera, TransferFunction, Volume
from pyvista_vdi.errors import DeviceMemoryError, InvalidArgumentError
from pyvista_vdi.generation.slices import estimate
from pyvista_vdi.model.checks import memory_limit_bytes
from pyvista_vdi.volume.bricks import BrickLayout, DeviceBricks

WINDOW = (20, 13)
#: Little enough that the volumes below do not fit, enough for the rays of that window.
LIMIT = 2.6 * 2**20
RNG = np.random.default_rng(7)
_K, _J, _I = np.meshgrid(*(np.arange(n) / 60 for n in (71, 150, 183)), indexing="ij")
#: Waves, and noise at every voxel, 0 to 1, with a transparent half; nowhere a multiple of a brick.
FIELD = np.clip(0.45 * np.sin(3 * _I * _J) * np.cos(4 * _K) + 0.25 * RNG.random(_I.shape), 0, 1)
CENTRE = np.array([91.0, 75.0, 35.0])


def volume_of(dtype):
    if np.dtype(dtype).kind == "f":
        return Volume((FIELD * 100).astype(dtype))
    info = np.iinfo(dtype)
    span = min(info.max - info.min, 60000)
    return Volume((FIELD * span + max(info.min, -30000)).astype(dtype))


def transfer_for(volume, interpolation="linear", **options):
    low, high = float(volume.scalars.min()), float(volume.scalars.max())
    opacities = np.clip(np.linspace(-0.3, 0.5, 64), 0, 1)
    colors = np.random.default_rng(3).random((64, 3))
    return TransferFunction(colors, opacities, (low, high), interpolation=interpolation, **options)


VIEWS = {
    "perspective": Camera(CENTRE + np.array([150, 90, 260]), CENTRE, (0, 1, 0)),
    "along an axis": Camera(CENTRE + np.array([0, 0, 400]), CENTRE, (0, 1, 0)),
    "parallel": Camera(
        CENTRE + np.array([-150, 90, -260]),
        CENTRE,
        (0, 1, 0),
        parallel_projection=True,
        parallel_scale=90,
    ),
    "inside": Camera(
        CENTRE + np.array([9, 3, 2]), CENTRE - np.array([80, 2, 11]), (0, 1, 0), view_angle=70.0
    ),
}


@pytest.fixture
def used(monkeypatch):
    made = []
    original = DeviceBricks.__init__

    def note(self, *args, **options):
        original(self, *args, **options)
        made.append(self)

    monkeypatch.setattr(DeviceBricks, "__init__", note)
    return made


def make(runtime, volume, camera, function, **options):
    options = {"sample_distance": 1.0, **options}
    return generate_vdi(volume, camera, WINDOW, function, device=runtime, **options)


@pytest.fixture
def scene():
    """Bytes, their transfer function and a view: the arguments of ``make``."""
    volume = volume_of(np.uint8)
    return volume, VIEWS["perspective"], transfer_for(volume)


@pytest.fixture
def same(runtime, used):
    """Make a VDI in one piece and brick by brick, and compare the bits."""

    def compared(volume, camera, function, *, limit=LIMIT, unseen=None, **options):
        whole = make(runtime, volume, camera, function, **options)
        assert whole.n_supersegments > 100
        assert not used
        again = volume if unseen is None else unseen
        limited = make(runtime, again, camera, function, memory_limit=limit, **options)
        assert used
        assert limited.equals(whole)
        return used[0]

    return compared


@pytest.mark.parametrize(
    ("name", "dtype", "interpolation"),
    [
        ("inside", "float32", "linear"),
        ("along an axis", "uint16", "nearest"),
        pytest.param("perspective", "uint8", "nearest", marks=pytest.mark.slow),
        pytest.param("parallel", "int16", "linear", marks=pytest.mark.slow),
    ],
)
def test_same_bytes_as_in_one_piece(runtime, used, same, name, dtype, interpolation):
    volume, camera = volume_of(dtype), VIEWS[name]
    function = transfer_for(volume, interpolation)
    assert same(volume, camera, function).copied > 1
    image, limited = (
        raycast_volume(volume, camera, WINDOW, function, device=runtime, **limit)
        for limit in ({}, {"memory_limit": LIMIT * 0.8})
    )
    assert len(used) == 2
    assert np.array_equal(limited, image)


def colours_of_their_own():
    rgba = RNG.integers(0, 256, (*FIELD.shape[:2], 100, 4), dtype=np.uint8)
    rgba[..., 3] = FIELD[..., :100] * 255
    return Volume(rgba), transfer_for(Volume(rgba))


def doubles_far_from_zero():
    values = FIELD[:, :, :120] + 1e9
    values[3, 4:9, 5] = np.nan
    span = (1e9 + 0.3, 1e9 + 0.7)
    return Volume(values), TransferFunction(np.eye(3), [0, 0.2, 0.4], span, interpolation="linear")


def floats_too_large_to_subtract():
    values = (FIELD * 100).astype(np.float32)
    values[0, 0, 0] = 3e38
    function = TransferFunction(np.eye(3), [0, 0.2, 0.4], (30, 90), interpolation="linear")
    return Volume(values), function


@pytest.mark.parametrize(
    "kind", [colours_of_their_own, doubles_far_from_zero, floats_too_large_to_subtract]
)
def test_same_bytes_of_other_scalars(same, kind):
    volume, function = kind()
    # Nobody has looked for the largest value of the other
    same(volume, VIEWS["perspective"], function, unseen=Volume(volume.array))


def test_pictures_with_all_that_ends_a_ray(runtime, used, scene):
    volume, camera, function = scene
    depth = np.full(WINDOW[::-1], np.inf)
    depth[3:9] = np.linspace(250, 400, WINDOW[0])
    options = {
        "opaque_depth": depth,
        "clipping_planes": [[*CENTRE, 1, 0.2, 0]],
        "cropping": ((20, 120, 30, 100, 10, 60), "fence"),
        "opacity_multiplier": 0.7,
        "early_termination": False,
        "device": runtime,
    }
    image = raycast_volume(volume, camera, WINDOW, function, **options)
    assert 0 < np.count_nonzero(image[..., 3]) < image[..., 3].size
    limited = raycast_volume(volume, camera, WINDOW, function, memory_limit=LIMIT * 0.8, **options)
    assert used
    assert np.array_equal(limited, image)


def test_what_was_used_longest_ago_makes_room(runtime):
    array = np.arange(33 * 33 * 65, dtype=np.float32).reshape(33, 33, 65)
    layout = BrickLayout.of((65, 33, 33), 4, False, 4)
    held = DeviceBricks(runtime, array, np.asarray, np.float32, layout, 3, None, None, "some")
    assert layout.counts == (4, 2, 2)

    def rounds(*wanted):
        copied, places = held.copied, []
        for _ in held.rounds(np.array(wanted, np.intp)):
            slots, pool = runtime.download(held.slots), runtime.download(held.pool)
            now = np.flatnonzero(slots >= 0)
            places.append(now.tolist())
            for brick in now:
                grid, _ = layout.region(int(brick))
                assert np.array_equal(pool[slots[brick]].reshape(17, 17, 17), array[grid])
        return places, held.copied - copied

    assert rounds(0, 1, 2) == ([[0, 1, 2]], 3)
    assert rounds(1, 5) == ([[1, 5]], 1)  # in the place of 0 or 2, which came first
    assert rounds(1, 5) == ([[1, 5]], 0)
    places, copied = rounds(*range(16))
    assert sorted(brick for one in places for brick in one) == list(range(16))
    assert copied == 13  # three were there, and had their turn first
    assert {1, 5} <= set(places[0])
    assert rounds() == ([], 0)


@pytest.mark.every(4)
@pytest.mark.parametrize("limit", [2.45, 2.6, 3.0, 4.0])
def test_the_limit_is_kept_and_the_estimate_says_so(runtime, used, limit):
    volume, camera = volume_of(np.float32), VIEWS["perspective"]
    function, limit = transfer_for(volume), int(limit * 2**20)
    stated = estimate(volume, WINDOW, memory_limit=limit)
    assert stated.volume + stated.working == limit
    for draw in (generate_vdi, raycast_volume):
        own = fresh_runtime(runtime)
        options = {"memory_limit": limit, "sample_distance": 1.0, "device": own}
        draw(volume, camera, WINDOW, function, **options)
        assert 0.5 * limit < own.peak_allocated <= limit
        used.clear()
        gc.collect()
        assert own.allocated == 0


@pytest.mark.parametrize("buffer", ["samples of steps", "recorded runs", "wanted bricks"])
def test_an_error_that_is_kept_keeps_no_bricks(runtime, used, scene, monkeypatch, buffer):
    gc.collect()
    before = runtime.allocated
    let_lack(monkeypatch, runtime, buffer)
    with pytest.raises(DeviceMemoryError, match="no room for") as kept:
        make(runtime, *scene, memory_limit=LIMIT)
    # Tables and what is known of the blocks may stay for as long as the error does
    assert runtime.allocated - before < 2**16
    del kept
    used.clear()
    gc.collect()
    assert runtime.allocated == before


@pytest.mark.parametrize("limit", [1, "900 KiB", 1.5 * 2**20])
def test_too_little_even_for_one_brick(runtime, scene, limit):
    volume, camera, function = scene
    message = (
        r"'density', 183 x 150 x 71 of uint8 takes 3\.\d+ MiB \(\d+ bytes\) in one piece and at "
        r"least \d\.\d+ MiB \(\d+ bytes\) brick by brick, \d+ rows of 20 lists of up to 20 "
        r"supersegments included; memory_limit is .*: raise memory_limit"
    )
    with pytest.raises(DeviceMemoryError, match=message):
        make(runtime, Volume(volume.array, name="density"), camera, function, memory_limit=limit)


@pytest.mark.parametrize(
    "wrong",
    [0, -1, 0.5, "", "GiB", "2 GiB or so", "1..5 MB", "2 bits", True, [], math.nan, math.inf],
)
def test_no_sizes(wrong):
    with pytest.raises(InvalidArgumentError, match="memory_limit must be a number of bytes"):
        memory_limit_bytes(wrong)
