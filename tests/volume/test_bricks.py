"""Volumes on the device brick by brick: the same to the last bit, within a stated memory."""

from __future__ import annotations

import gc
import math

import numpy as np
import pytest
import strategies
from drawing import raycast_volume

from pyvista_vdi import Camera, Light, TransferFunction, Volume
from pyvista_vdi.errors import Cancelled, DeviceMemoryError, InvalidArgumentError
from pyvista_vdi.generation.estimate import estimate
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.checks import memory_limit_bytes
from pyvista_vdi.model.lighting import Shading
from pyvista_vdi.quality.view_error import ViewErrorEstimator
from pyvista_vdi.volume import bricks
from pyvista_vdi.volume.bricks import BrickLayout, DeviceBricks, fitting_layout, in_parts

WINDOW = (20, 13)
#: Little enough that the volumes below do not fit, enough for the rays of that window.
LIMIT = 2.6 * 2**20
RNG = np.random.default_rng(7)
_K, _J, _I = np.meshgrid(*(np.arange(n) / 60 for n in (71, 150, 183)), indexing="ij")
#: Waves, and noise at every voxel, 0 to 1, with a transparent half; nowhere a multiple of a brick.
FIELD = np.clip(0.45 * np.sin(3 * _I * _J) * np.cos(4 * _K) + 0.25 * RNG.random(_I.shape), 0, 1)
SHADES = Shading(ambient=0.2, diffuse=0.7, specular=0.4, specular_power=8.0)
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
    """The bricks that were made, in order."""
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


# -- the same bytes -------------------------------------------------------------------------------


@pytest.mark.every(6)
@pytest.mark.parametrize("name", VIEWS)
@pytest.mark.parametrize(
    ("dtype", "interpolation"),
    [("uint8", "nearest"), ("int16", "linear"), ("uint16", "nearest"), ("float32", "linear")],
)
def test_same_bytes_as_in_one_piece(runtime, used, name, dtype, interpolation):
    volume = volume_of(dtype)
    function = transfer_for(volume, interpolation)
    whole = make(runtime, volume, VIEWS[name], function)
    assert whole.n_supersegments > 100
    assert not used
    in_bricks = make(runtime, volume, VIEWS[name], function, memory_limit=LIMIT)
    assert used
    assert used[0].copied > 1
    assert in_bricks.equals(whole)
    image = raycast_volume(volume, VIEWS[name], WINDOW, function, device=runtime)
    limited = raycast_volume(
        volume, VIEWS[name], WINDOW, function, memory_limit=LIMIT * 0.8, device=runtime
    )
    assert len(used) == 2
    assert np.array_equal(limited, image)


@pytest.mark.every(4)
@pytest.mark.parametrize("shift", [3, 4, 5, 6])
@pytest.mark.parametrize("slots", [1, 2, 7])
def test_same_bytes_whatever_the_bricks(runtime, used, monkeypatch, shift, slots):
    volume = volume_of(np.uint8)
    function, camera = transfer_for(volume), VIEWS["perspective"]
    whole = make(runtime, volume, camera, function, sample_distance=0.5)
    layout = BrickLayout.of(volume.dimensions, shift, False, 1)
    monkeypatch.setattr(
        "pyvista_vdi.volume.classified_volume.fitting_layout", lambda *args: (layout, slots)
    )
    few = make(runtime, volume, camera, function, sample_distance=0.5, memory_limit=LIMIT)
    assert used[0].copied >= min(slots, layout.n_bricks)
    assert few.equals(whole)


@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("looks", "interpolation"),
    [
        ({"shading": SHADES, "gradient_opacities": [0.2, 1], "gradient_range": (0, 30)}, "linear"),
        ({"gradient_opacities": np.linspace(0, 1, 5), "gradient_range": (0, 40)}, "nearest"),
    ],
    ids=["shaded", "gradient opacity"],
)
def test_gradients_see_beyond_their_brick(runtime, used, looks, interpolation):
    volume = volume_of(np.uint8)
    function = transfer_for(volume, interpolation, **looks)
    camera = VIEWS["perspective"]
    lamp = Light("scene", (200, 300, 100), tuple(CENTRE), positional=True, cone_angle=120.0)
    lights = [Light("camera", (1, 0.5, 0.2)), lamp]
    whole = make(runtime, volume, camera, function, lights=lights)
    limited = make(runtime, volume, camera, function, lights=lights, memory_limit=LIMIT)
    assert used[0].layout.gradients
    assert limited.equals(whole)


@pytest.mark.parametrize("criterion", strategies.criteria()[1:])
def test_same_bytes_by_every_criterion(runtime, used, criterion):
    volume = volume_of(np.uint8)
    function, camera = transfer_for(volume), VIEWS["parallel"]
    options = {"criterion": criterion, "max_supersegments": 4}
    whole = make(runtime, volume, camera, function, **options)
    limited = make(runtime, volume, camera, function, memory_limit=5 * 2**20, **options)
    assert used
    assert limited.equals(whole)


def test_colours_of_their_own(runtime, used):
    rgba = RNG.integers(0, 256, (*FIELD.shape[:2], 100, 4), dtype=np.uint8)
    rgba[..., 3] = FIELD[..., :100] * 255
    volume = Volume(rgba)
    function = transfer_for(volume)
    whole = make(runtime, volume, VIEWS["inside"], function)
    limited = make(runtime, volume, VIEWS["inside"], function, memory_limit=LIMIT)
    assert used
    assert limited.equals(whole)


def test_scalars_taken_relative_to_the_range(runtime, used):
    """Scaled as they are copied: doubles, far from zero, one of them none."""
    values = FIELD[:, :, :120] + 1e9
    values[3, 4:9, 5] = np.nan
    volume = Volume(values)
    function = TransferFunction(
        np.eye(3), [0, 0.2, 0.4], (1e9 + 0.3, 1e9 + 0.7), interpolation="linear"
    )
    whole = make(runtime, volume, VIEWS["perspective"], function)
    assert whole.n_supersegments > 100
    limited = make(runtime, volume, VIEWS["perspective"], function, memory_limit=LIMIT)
    assert used
    assert limited.equals(whole)


def test_floats_too_large_to_subtract(runtime, used):
    values = (FIELD * 100).astype(np.float32)
    values[0, 0, 0] = 3e38
    volume = Volume(values)
    function = TransferFunction(np.eye(3), [0, 0.2, 0.4], (30, 90), interpolation="linear")
    whole = make(runtime, volume, VIEWS["perspective"], function)
    unseen = Volume(values)  # nobody has looked for its largest value
    limited = make(runtime, unseen, VIEWS["perspective"], function, memory_limit=LIMIT)
    assert used
    assert limited.equals(whole)


def test_pictures_with_all_that_ends_a_ray(runtime, used):
    volume = volume_of(np.uint8)
    function, camera = transfer_for(volume), VIEWS["perspective"]
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


def test_a_file_larger_than_the_bricks(runtime, used, tmp_path):
    volume = volume_of(np.uint16)
    function, camera = transfer_for(volume, "nearest"), VIEWS["perspective"]
    whole = make(runtime, volume, camera, function)
    array = np.memmap(tmp_path / "voxels", np.uint16, "w+", shape=volume.array.shape)
    array[...] = volume.array
    mapped = Volume(array)
    assert np.shares_memory(mapped.array, array)
    assert make(runtime, mapped, camera, function, memory_limit=LIMIT).equals(whole)
    assert used


def test_views_are_judged_within_the_limit(runtime, used):
    volume = volume_of(np.uint8)
    function, camera = transfer_for(volume), VIEWS["perspective"]
    vdi = make(runtime, volume, camera, function)
    options = {"sample_distance": 1.0, "device": runtime}
    view, window = camera.azimuth(20), (90, 60)
    free = ViewErrorEstimator(volume, function, **options)
    short = ViewErrorEstimator(volume, function, memory_limit=2.9 * 2**20, **options)
    judged, limited = (one.estimate(vdi, view, window) for one in (free, short))
    assert used
    assert limited == judged


def test_the_same_in_the_background(runtime, used):
    volume = volume_of(np.uint8)
    function, camera = transfer_for(volume), VIEWS["perspective"]
    whole = make(runtime, volume, camera, function)
    with runtime.background():
        limited = make(runtime, volume, camera, function, memory_limit=LIMIT)
    assert used
    assert limited.equals(whole)


# -- what goes to the device ----------------------------------------------------------------------


def test_transparent_bricks_stay_where_they_are(runtime, used):
    array = np.zeros((97, 97, 97), np.uint8)
    array[41:47, 73:87, 73:87] = 200  # inside 1 x 2 x 2 blocks of 8 cells, whatever the bricks
    volume = Volume(array)
    function = TransferFunction(np.eye(3), [0, 0.2, 0.4], (0, 200))
    camera = Camera((48, 48, 300), (48, 48, 48), (0, 1, 0))
    vdi = make(runtime, volume, camera, function, memory_limit=2.4 * 2**20)
    assert vdi.n_supersegments
    (held,) = used
    cells = np.stack(np.meshgrid([72, 87], [72, 87], [40, 47]), axis=-1).reshape(-1, 3)
    x, y, _ = held.layout.counts
    opaque = set((cells >> held.layout.shift) @ [1, x, x * y])
    assert set(held._slot_of) <= opaque
    assert held.copied == len(held._slot_of)


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
def test_the_limit_is_kept_and_the_estimate_says_so(runtime, used, monkeypatch, limit):
    volume = volume_of(np.float32)
    function, camera = transfer_for(volume, shading=SHADES), VIEWS["perspective"]
    limit = int(limit * 2**20)
    stated = estimate(volume, WINDOW, memory_limit=limit)
    assert stated.volume + stated.working == limit
    gc.collect()
    for function_of in (make, lambda *args, **options: raycast_volume(
        *args[1:3], WINDOW, args[3], device=runtime, **options
    )):  # fmt: skip
        monkeypatch.setattr(runtime._ledger, "peak", before := runtime.allocated)
        function_of(runtime, volume, camera, function, memory_limit=limit)
        assert runtime.peak_allocated - before <= limit
        used.clear()
        gc.collect()
        assert runtime.allocated == before


def test_a_limit_that_holds_the_volume_changes_nothing(runtime, used):
    volume = volume_of(np.uint8)
    function, camera = transfer_for(volume), VIEWS["perspective"]
    stated = estimate(volume, WINDOW, memory_limit="1 GiB")
    assert stated.volume < 1.1 * volume.array.nbytes + 2**20
    vdi = make(runtime, volume, camera, function, memory_limit="1 GiB")
    assert not used
    assert vdi.equals(make(runtime, volume, camera, function))


def test_progress_can_end_it_and_nothing_stays(runtime, used):
    volume = volume_of(np.uint8)
    function, camera = transfer_for(volume), VIEWS["perspective"]
    gc.collect()
    before = runtime.allocated
    with pytest.raises(Cancelled):
        make(
            runtime, volume, camera, function, memory_limit=LIMIT, progress=lambda done: done < 0.5
        )
    assert used
    used.clear()
    gc.collect()
    assert runtime.allocated == before


@pytest.mark.every(3)
@pytest.mark.parametrize("buffer", ["samples of steps", "recorded runs", "wanted bricks"])
def test_an_error_that_is_kept_keeps_no_bricks(runtime, used, monkeypatch, buffer):
    volume = volume_of(np.uint8)
    function, camera = transfer_for(volume), VIEWS["perspective"]
    gc.collect()
    before, take = runtime.allocated, runtime._ledger.take

    def scarce(name, *args):
        if name == buffer:
            raise DeviceMemoryError(f"no room for {name}")
        return take(name, *args)

    monkeypatch.setattr(runtime._ledger, "take", scarce)
    with pytest.raises(DeviceMemoryError, match="no room for") as kept:
        make(runtime, volume, camera, function, memory_limit=LIMIT)
    # Tables and what is known of the blocks may stay for as long as the error does
    assert runtime.allocated - before < 2**16
    del kept
    used.clear()
    gc.collect()
    assert runtime.allocated == before


# -- what is refused ------------------------------------------------------------------------------


@pytest.mark.parametrize("limit", [1, "900 KiB", 1.5 * 2**20])
def test_too_little_even_for_one_brick(runtime, limit):
    volume = Volume(volume_of(np.uint8).array, name="density")
    function, camera = transfer_for(volume), VIEWS["perspective"]
    message = (
        r"'density', 183 x 150 x 71 of uint8 takes 3\.\d+ MiB \(\d+ bytes\) in one piece and at "
        r"least \d\.\d+ MiB \(\d+ bytes\) brick by brick, \d+ rows of 20 lists of up to 20 "
        r"supersegments included; memory_limit is .*: raise memory_limit"
    )
    with pytest.raises(DeviceMemoryError, match=message):
        make(runtime, volume, camera, function, memory_limit=limit)


def test_ambient_occlusion_needs_the_volume_in_one_piece(runtime):
    volume = volume_of(np.uint8)
    function, camera = transfer_for(volume), VIEWS["perspective"]
    with pytest.raises(
        DeviceMemoryError, match=r"ambient occlusion needs .* in one piece, 1\.86 MiB .*raise"
    ):
        make(runtime, volume, camera, function, ambient_occlusion=40.0, memory_limit=3.6 * 2**20)


@pytest.mark.parametrize(
    ("text", "nbytes"),
    [
        (None, None),
        (4096, 4096),
        (2.5e9, 2500000000),
        (np.int64(7), 7),
        ("123", 123),
        ("2 GiB", 2**31),
        ("2gib", 2**31),
        (" 1.5 MB ", 1500000),
        ("3 KiB", 3072),
        ("1TiB", 2**40),
        ("12 b", 12),
    ],
)
def test_sizes(text, nbytes):
    assert memory_limit_bytes(text) == nbytes


@pytest.mark.parametrize(
    "wrong",
    [0, -1, 0.5, "", "GiB", "2 GiB or so", "1..5 MB", "2 bits", True, [], math.nan, math.inf],
)
def test_no_sizes(wrong):
    with pytest.raises(InvalidArgumentError, match="memory_limit must be a number of bytes"):
        memory_limit_bytes(wrong)


# -- layouts --------------------------------------------------------------------------------------


@pytest.mark.parametrize("dimensions", [(2, 2, 2), (65, 64, 66), (130, 17, 33), (300, 200, 100)])
@pytest.mark.parametrize("gradients", [False, True])
@pytest.mark.parametrize("shift", bricks._SHIFTS)
def test_bricks_cover_every_cell_and_what_its_samples_read(dimensions, gradients, shift):
    layout = BrickLayout.of(dimensions, shift, gradients, 1)
    array = np.zeros(dimensions[::-1], np.uint8)
    edge = 2**shift
    covered = np.zeros(array.shape, bool)
    for brick in range(layout.n_bricks):
        grid, own = layout.region(brick)
        part = array[grid]
        assert min(part.shape) > 0
        assert max(part.shape) <= layout.points
        covered[grid] = True
        x, y, _ = layout.counts
        numbers = (brick // (x * y), brick // x % y, brick % x)
        for n, points, place, inside in zip(numbers, array.shape, grid, own, strict=True):
            first, last = n * edge, min((n + 1) * edge, points - 1)  # points of its cells
            reads = (first - gradients, last + 2 * gradients)
            assert place.start <= max(reads[0], 0)
            assert place.stop > min(reads[1], points - 1)
            # Address of a point: its index less that of the brick's first
            assert place.start - inside.start == first - layout.before
    assert covered.all()


def test_few_bytes_make_small_bricks():
    found = [fitting_layout((1025,) * 3, 1, False, n * 2**20, 2**40) for n in (1, 4, 100, 20000)]
    shifts, slots = zip(*((layout.shift, n) for layout, n in found), strict=True)
    assert shifts == (5, 5, 6, 6)
    assert slots[-1] == 16**3  # all of them
    assert slots[-2] == (100 * 2**20 - 8 * 16**3) // 65**3
    assert fitting_layout((1025,) * 3, 1, False, 2**15, 2**40) is None
    # And no more than one buffer may hold
    layout, few = fitting_layout((1025,) * 3, 4, True, 2**34, 2**27)
    assert few * layout.brick_bytes <= 2**27


@pytest.mark.parametrize("nbytes", [1, 3000, 50000, 10**6])
@pytest.mark.parametrize("blocks", [(1, 1, 1), (5, 4, 3), (40, 1, 7)])
def test_parts_have_whole_blocks_and_leave_out_none(blocks, nbytes):
    x, y, z = blocks
    seen = np.zeros((z, y, x), int)
    for place, points in in_parts(blocks, 8, 2, nbytes):
        seen[place] += 1
        lengths = [p.stop - p.start for p in points]
        assert all(p.start == 8 * b.start for p, b in zip(points, place, strict=True))
        assert all(p.stop == 8 * b.stop + 1 for p, b in zip(points, place, strict=True))
        assert math.prod(lengths) <= max(nbytes / 2, 9**3)
    assert (seen == 1).all()
