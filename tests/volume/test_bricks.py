"""Volumes on the device brick by brick: the same to the last bit, within a stated memory."""

from __future__ import annotations

import gc

import numpy as np
import pytest
from drawing import generate_vdi, raycast_volume
from runtimes import fresh_runtime, let_lack

from pyvista_vdi import Camera, Light, Shading, TransferFunction, Volume
from pyvista_vdi.errors import DeviceMemoryError
from pyvista_vdi.volume.bricks import DeviceBricks

WINDOW = (20, 13)
#: Little enough that the volumes below do not fit, enough for the rays of that window.
LIMIT = int(2.6 * 2**20)
RNG = np.random.default_rng(7)
_K, _J, _I = np.meshgrid(*(np.arange(n) / 60 for n in (71, 150, 183)), indexing="ij")
#: Waves, and noise at every voxel, 0 to 1, with a transparent half; nowhere a multiple of a brick.
FIELD = np.clip(0.45 * np.sin(3 * _I * _J) * np.cos(4 * _K) + 0.25 * RNG.random(_I.shape), 0, 1)
CENTRE = np.array([91.0, 75.0, 35.0])


def volume_of():
    return Volume((FIELD * 100).astype(np.float32))


def transfer_for(volume, **options):
    low, high = float(volume.scalars.min()), float(volume.scalars.max())
    opacities = np.clip(np.linspace(-0.3, 0.5, 64), 0, 1)
    colors = np.random.default_rng(3).random((64, 3))
    return TransferFunction(colors, opacities, (low, high), interpolation="linear", **options)


VIEWS = {
    "perspective": Camera(CENTRE + np.array([150, 90, 260]), CENTRE, (0, 1, 0)),
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
    """Floats, their transfer function and a view: the arguments of ``make``."""
    volume = volume_of()
    return volume, VIEWS["perspective"], transfer_for(volume)


LIT = {
    "shading": Shading(ambient=0.2, diffuse=0.7, specular=0.4, specular_power=8.0),
    "gradient_opacities": [0.2, 1],
    "gradient_range": (0, 30),
}
LAMP = Light("scene", (200, 300, 100), tuple(CENTRE), positional=True, cone_angle=120.0)


@pytest.mark.parametrize(
    ("view", "looks", "colours"),
    [
        ("inside", {}, False),
        ("parallel", LIT, False),  # gradients see beyond their brick
        ("perspective", {}, True),
    ],
)
def test_same_bytes_as_in_one_piece(runtime, used, view, looks, colours):
    """A VDI and a picture with all that ends a ray."""
    camera, volume = VIEWS[view], volume_of()
    if colours:
        rgba = RNG.integers(0, 256, (*FIELD.shape[:2], 100, 4), dtype=np.uint8)
        rgba[..., 3] = FIELD[..., :100] * 255
        volume = Volume(rgba)
    function = transfer_for(volume, **looks)
    lights = [Light("camera", (1, 0.5, 0.2)), LAMP] if looks else None
    depth = np.full(WINDOW[::-1], np.inf)
    depth[3:9] = np.linspace(250, 400, WINDOW[0])
    shown = {"opaque_depth": depth, "clipping_planes": [[*CENTRE, 1, 0.2, 0]]}
    shown |= {"cropping": ((20, 120, 30, 100, 10, 60), "fence"), "opacity_multiplier": 0.7}
    options = {"lights": lights, "device": runtime}
    whole = make(runtime, volume, camera, function, lights=lights)
    image = raycast_volume(volume, camera, WINDOW, function, **shown, **options)
    assert whole.n_supersegments > 100
    assert not used
    again = Volume(volume.array)  # of which nobody has looked for the largest value
    limited = make(runtime, again, camera, function, lights=lights, memory_limit=LIMIT)
    assert limited.equals(whole)
    shown["memory_limit"] = LIMIT * 4 // 5
    assert np.array_equal(
        raycast_volume(again, camera, WINDOW, function, **shown, **options), image
    )
    assert len(used) == 2
    assert used[0].copied > 1


@pytest.mark.parametrize("limit", [2.45, 3.0])
def test_the_limit_is_kept(runtime, used, limit):
    volume, camera = volume_of(), VIEWS["perspective"]
    function, limit = transfer_for(volume), int(limit * 2**20)
    for draw in (generate_vdi, raycast_volume):
        own = fresh_runtime(runtime)
        options = {"memory_limit": limit, "sample_distance": 1.0, "device": own}
        draw(volume, camera, WINDOW, function, **options)
        assert 0.5 * limit < own.peak_allocated <= limit
        used.clear()
        gc.collect()
        assert own.allocated == 0


@pytest.mark.parametrize("buffer", ["recorded runs", "wanted bricks"])
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


@pytest.mark.parametrize("limit", [1, 900 * 2**10])
def test_too_little_even_for_one_brick(runtime, scene, limit):
    volume, camera, function = scene
    message = (
        r"'density', 183 x 150 x 71 of float32 takes \d+\.\d+ MiB \(\d+ bytes\) in one piece and "
        r"at least \d\.\d+ MiB \(\d+ bytes\) brick by brick, \d+ rows of 20 lists of up to 20 "
        r"supersegments included; memory_limit is .*: raise memory_limit"
    )
    with pytest.raises(DeviceMemoryError, match=message):
        make(runtime, Volume(volume.array, name="density"), camera, function, memory_limit=limit)
