"""A volume in blocks: cuts, halos, the order in which V_O sees them, and the VDI of one piece."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from drawing import generate_in_blocks, generate_vdi, request
from runtimes import fresh_runtime
from support.march_ways import VIEWS, WINDOW, ray_depths, transfer_for, volume_of

import pyvista_vdi as pvdi
from pyvista_vdi import Shading, TransferFunction, Volume
from pyvista_vdi.errors import Cancelled, DeviceMemoryError
from pyvista_vdi.extensions.large.blocks import Blocks, cuts_of, with_halo
from pyvista_vdi.extensions.large.generate import ranges_of
from pyvista_vdi.extensions.large.passes import Piece, Task
from pyvista_vdi.generation.deferred import generate_deferred, unclassified
from pyvista_vdi.model.deferred import lengths_of
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.options import CRITERIA, Deferral
from pyvista_vdi.model.ray_forms import Rectangle
from pyvista_vdi.model.volume import Grid
from pyvista_vdi.quality.targets import turned

CUTS = [(16, 16, 16), (47, 9, 50), (20, 41, 13)]


def blocks_of(volume, chunks, function=None, block_bytes=1):
    cuts = cuts_of(volume.array.shape, chunks, volume.array.dtype.itemsize, block_bytes)
    return Blocks.of(Grid.of(volume), cuts, function or transfer_for(volume))


def task_of(volume, camera, function, chunks, **options):
    asked = request(volume, camera, WINDOW, function, **options)
    return Task.of(blocks_of(volume, chunks, function), asked, (0, 255))


@pytest.mark.parametrize("points", [(5, 6, 7), (33, 16, 17), (40, 19, 64)])
@pytest.mark.parametrize("chunks", [(4, 4, 4), (16, 7, 100)])
def test_every_point_is_in_one_block(points, chunks):
    blocks = blocks_of(Volume(np.zeros(points, np.uint8)), chunks, block_bytes=2000)
    owners = np.zeros(points, int)
    for block in blocks:
        own = blocks.own(block)
        owners[own] += 1
        assert all(part.stop - part.start >= 4 or n < 8 for part, n in zip(own, points))  # noqa: B905
        assert all(part.start % chunk == 0 for part, chunk in zip(own, chunks, strict=True))
    assert (owners == 1).all()


def test_blocks_grow_up_to_the_bytes_that_they_may_have():
    for item, most, counts in ((1, 16**3, (4, 4, 4)), (2, 16**3, (4, 4, 8)), (1, 1, (8, 8, 8))):
        cuts = cuts_of((64, 64, 64), (8, 8, 8), item, most)
        assert tuple(len(of_axis) - 1 for of_axis in cuts) == counts


@pytest.mark.parametrize("shading", [None, Shading()], ids=["", "shaded"])
@pytest.mark.parametrize("chunks", [(4, 5, 6), (8, 19, 7)])
def test_neighbours_give_the_halo(shading, chunks):
    values = np.random.default_rng(1).integers(0, 255, (13, 19, 17), np.uint8)
    volume = Volume(values)
    blocks = blocks_of(volume, chunks, transfer_for(volume, shading=shading))
    assert (blocks.before, blocks.after) == ((1, 3) if shading else (0, 1))
    faces = {block: blocks.faces(values[blocks.own(block)]) for block in blocks}
    for block in blocks:
        around = blocks.neighbours(block).items()
        parts = {offset: faces[other][offset] for offset, other in around}
        found = with_halo(values[blocks.own(block)], parts)
        box = tuple(
            slice(max(part.start - blocks.before, 0), part.stop + blocks.after)
            for part in blocks.own(block)
        )
        np.testing.assert_array_equal(found, values[box], str(block))
        first = blocks.part(block, blocks.before, (0, 1)).first
        assert first == tuple(part.start for part in reversed(box))


def points_along(camera, x, y):
    """Homogeneous points of the model frame along the ray of a pixel."""
    t = np.linspace(0.01, 250, 2000)
    across = (np.array([x, y]) + 0.5) / WINDOW * 2 - 1 + camera.window_center
    u, v = across * np.array(camera.half_extent(WINDOW))
    scale = np.ones_like(t) if camera.parallel_projection else t
    return np.linalg.inv(camera.model_to_view) @ [u * scale, v * scale, t, np.ones_like(t)]


@pytest.mark.parametrize("view", VIEWS)
def test_rays_meet_blocks_in_their_order_and_windows(view):
    volume = volume_of("uint8")
    camera = VIEWS[view](volume)
    task = task_of(volume, camera, transfer_for(volume), (12, 10, 9))
    blocks = task.blocks
    order = {block: k for k, block in enumerate(blocks.in_order(camera))}
    assert sorted(order) == sorted(blocks)
    met = 0
    to_index = np.linalg.inv(volume.index_to_model)
    last = np.array(volume.dimensions)[:, None] - 1
    for x, y in itertools.product(range(0, WINDOW[0], 4), range(0, WINDOW[1], 3)):
        at = (to_index @ points_along(camera, x, y))[:3]
        at = at[::-1, ((at >= 0) & (at <= last)).all(axis=0)]
        numbers = [
            np.clip(np.searchsorted(cuts[1:-1], positions, side="right"), 0, len(cuts) - 2)
            for cuts, positions in zip(blocks.cuts, at, strict=True)
        ]
        passed = [
            block for block, _ in itertools.groupby(zip(*np.array(numbers).tolist(), strict=True))
        ]
        places = [order[block] for block in passed]
        assert places == sorted(places)
        for block in passed:
            window = task.window(block)
            assert window.x0 <= x < window.x1
            assert window.y0 <= y < window.y1
            met += 1
    assert met > 200


def both_ways(volume, camera, function, chunks=(16, 16, 16), **options):
    """Return the VDI of one piece, and that of blocks."""
    whole = generate_vdi(volume, camera, WINDOW, function, **options)
    return whole, generate_in_blocks(volume, camera, WINDOW, function, chunks=chunks, **options)


def check_ray_depths(found, whole):
    """Optical depths add up whatever is merged: a step that is lost or taken twice shows.

    float32 sums of up to 200 steps, in another order: 200 x 2^-24, and as much for the reference.
    """
    np.testing.assert_allclose(ray_depths(found), ray_depths(whole), rtol=2.4e-5, atol=1e-7)


@pytest.mark.every(3)
@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize(
    "cuts", [CUTS[0], *(pytest.param(c, marks=pytest.mark.slow) for c in CUTS[1:])], ids=str
)
def test_every_step_belongs_to_one_block(runtime, view, cuts):
    volume = volume_of("uint8", (1, 1.3, 0.8))
    camera = VIEWS[view](volume)
    options = {"max_supersegments": 12, "device": runtime.info.selector}
    whole, found = both_ways(volume, camera, transfer_for(volume, "linear"), cuts, **options)
    assert whole.n_supersegments > 500
    assert found.metadata["blocks"] != [1, 1, 1]
    assert np.diff(found.offsets.astype(np.int64)).max() <= 12
    check_ray_depths(found, whole)


BY_GRADIENT = {"gradient_opacities": np.linspace(0, 1, 8), "gradient_range": (0.0, 40.0)}
KINDS = {
    "bytes": ("uint8", "nearest", {}),
    "words": ("uint16", "linear", {}),
    "floats with NaN": ("float32", "linear", {}),
    "scaled": ("float64", "linear", {}),
    "shaded": ("uint8", "linear", {"shading": Shading()}),
    "gradient opacity": ("int16", "linear", BY_GRADIENT),
}


@pytest.mark.every(6)
@pytest.mark.parametrize("kind", KINDS)
def test_pictures_are_those_of_one_piece(runtime, kind):
    """At V_O to the rounding of float32; elsewhere lists are merged a little otherwise at faces.

    Noise in lists that are several voxels wide is the worst case: less is changed than by marching
    with steps that are two hundredths shorter.
    """
    dtype, interpolation, options = KINDS[kind]
    volume = volume_of(dtype)
    camera = VIEWS["all of it"](volume)
    function = transfer_for(volume, interpolation, **options)
    device = runtime.info.selector
    whole, found = both_ways(volume, camera, function, device=device)
    other = generate_vdi(volume, camera, WINDOW, function, device=device, sample_distance=0.49)
    for degrees in (0, 5, 30):
        view = turned(camera, volume.bounds, degrees)
        expected, drawn, by_other = (
            pvdi.render(vdi, view, device=device) for vdi in (whole, found, other)
        )
        compared = compare_images(expected, drawn)
        assert compared.ssim >= compare_images(expected, by_other).ssim, (degrees, compared)
        if degrees == 0:
            assert np.abs(expected - drawn).max() <= 1 / 255


@pytest.mark.every(3)
@pytest.mark.parametrize("criterion", CRITERIA)
def test_every_criterion(criterion):
    volume = volume_of("uint8")
    camera = VIEWS["all of it"](volume)
    options = {"criterion": criterion, "max_supersegments": 6}
    whole, found = both_ways(volume, camera, transfer_for(volume), **options)
    assert np.diff(found.offsets.astype(np.int64)).max() <= 6
    assert abs(found.n_supersegments / whole.n_supersegments - 1) < 0.01
    expected, drawn = (pvdi.render(vdi, turned(camera, volume.bounds, 5)) for vdi in (whole, found))
    # Of six supersegments each counts; measured: .9961 to 1
    assert compare_images(expected, drawn).ssim >= 0.995


def test_what_is_visible_only_between_two_blocks_is_seen():
    """Neither 0 nor 200 shows; half way between them, in the cell between two blocks, 100 does."""
    values = np.zeros((16, 16, 16), np.uint8)
    values[:, :, 8:] = 200
    volume = Volume(values)
    opacities = np.zeros(256)
    opacities[80:120] = 0.8
    function = TransferFunction(np.ones((256, 3)), opacities, (0, 255), interpolation="linear")
    camera = VIEWS["all of it"](volume)
    whole, found = both_ways(volume, camera, function, (8, 8, 8))
    assert whole.n_supersegments > 50
    np.testing.assert_allclose(ray_depths(found), ray_depths(whole), rtol=1e-5)


def first_passes(task, volume):
    """What the first pass finds in all blocks."""
    return {
        block: task.first_pass(block, volume.array[task.blocks.own(block)]) for block in task.blocks
    }


def first_depths(volume, camera, function, chunks):
    """Return the sums of the optical depths that the first pass finds in all blocks."""
    task, total = task_of(volume, camera, function, chunks), np.zeros(WINDOW[::-1])
    for block, seen in first_passes(task, volume).items():
        if seen.depths is not None:
            x0, x1, y0, y1 = task.window(block)
            total[y0:y1, x0:x1] += seen.depths
    return total


def test_the_first_pass_finds_the_light():
    """One step per voxel of a smooth medium: the same ones whatever the blocks."""
    z, y, x = np.mgrid[-1:1:40j, -1:1:36j, -1:1:44j]
    volume = Volume((200 * np.exp(-2 * (x**2 + y**2 + z**2))).astype(np.uint8))
    function = TransferFunction(np.ones((2, 3)), [0, 0.3], (0, 255), interpolation="nearest")
    camera = VIEWS["all of it"](volume)
    whole = ray_depths(generate_vdi(volume, camera, WINDOW, function)).reshape(WINDOW[::-1])
    coarse, fine = (first_depths(volume, camera, function, n) for n in ((20, 18, 22), (7, 9, 8)))
    deep = whole > 0.2
    assert deep.sum() > 500
    # At a face the last point stands for the next, which differs either way; if each block sampled
    # its own first step, the mean would be 2 % larger
    for depths in (coarse, fine):
        assert depths[deep].mean() == pytest.approx(whole[deep].mean(), rel=0.01)
        np.testing.assert_allclose(depths[deep], whole[deep], rtol=0.15)


@pytest.mark.parametrize(
    ("interpolation", "behind", "expected"),
    [("nearest", 100, 1), ("nearest", 200, 2), ("linear", 200, 4)],
)
def test_runs_are_joined_at_faces_where_they_are_alike(interpolation, behind, expected):
    """Blocks meet at z = 8. The medium changes before it, or by two steps of half a cell at it."""
    values = np.full((16, 16, 16), 100, np.uint8)
    values[9 if interpolation == "linear" else 8 :] = behind
    volume = Volume(values)
    table = np.linspace([1, 0, 0], [0, 1, 1], 256)
    function = TransferFunction(table, np.full(256, 0.2), (0, 255), interpolation=interpolation)
    camera = VIEWS["along an axis"](volume).replace(
        position=(7.5, 7.5, 60), focal_point=(7.5, 7.5, 7.5), parallel_scale=6
    )
    options = {"sample_distance": 0.5, "max_supersegments": 20}
    whole, vdi = both_ways(volume, camera, function, (8, 16, 16), **options)
    assert vdi.metadata["blocks"] == [2, 1, 1]
    found, of_whole = (np.diff(each.offsets.astype(int)) for each in (vdi, whole))
    assert (of_whole > 0).sum() > 500
    np.testing.assert_array_equal(of_whole[of_whole > 0], expected)
    np.testing.assert_array_equal(found, of_whole)


def test_rows_do_not_depend_on_where_they_are_cut():
    volume = volume_of("uint8")
    camera = VIEWS["all of it"](volume)
    task = task_of(volume, camera, transfer_for(volume), (8, 8, 8), max_supersegments=5)
    blocks, seen, pieces = task.blocks, first_passes(task, volume), []
    for block, light in task.light_entering({at: task.window(at) for at in blocks}, seen).items():
        others = blocks.neighbours(block)
        around = [seen.get(others.get(offset)) for offset in blocks.offsets]
        values = volume.array[blocks.own(block)]
        pieces.append(task.second_pass(block, values, light, None, *around))
    height = WINDOW[1]
    whole = task.merge(0, height, *pieces)
    for ranges in (ranges_of(height, 3), [(0, 1), (1, 30), (30, height)]):
        rows = [task.merge(y0, y1, *pieces) for y0, y1 in ranges]
        for k, expected in enumerate(whole):
            np.testing.assert_array_equal(np.concatenate([part[k] for part in rows]), expected)


def test_rows_are_shared_out():
    assert ranges_of(99, 4) == [(0, 24), (24, 48), (48, 72), (72, 99)]
    assert ranges_of(7, 3) == [(0, 4), (4, 7)]
    assert ranges_of(3, 9) == [(0, 3)]


def test_rows_of_a_piece():
    counts = np.array([[1, 0], [2, 1], [0, 0], [1, 1]], np.uint16)
    runs = np.arange(6 * 8, dtype=np.float32).reshape(6, 8)
    piece = Piece(Rectangle(3, 5, 10, 14), counts, runs)
    part = piece.rows(11, 13)
    assert part.window == Rectangle(3, 5, 11, 13)
    np.testing.assert_array_equal(part.counts, counts[1:3])
    np.testing.assert_array_equal(part.runs, runs[1:4])
    assert piece.rows(0, 10).counts.shape == (0, 2)
    assert len(piece.rows(14, 20).runs) == 0


@pytest.mark.parametrize(("radius", "view"), [(6.0, "all of it"), (20.0, "from inside")])
def test_occlusion_is_that_of_one_piece(default_runtime, radius, view):
    """Cells of one voxel and of two; what is out of sight darkens what is seen."""
    volume = volume_of("uint8")
    camera = VIEWS[view](volume)
    arguments = (volume, camera, transfer_for(volume, "linear"))
    bare = generate_vdi(volume, camera, WINDOW, arguments[-1])
    whole, vdi = both_ways(*arguments, (12, 10, 9), ambient_occlusion=radius)
    without, expected, found = (pvdi.render(each, camera) for each in (bare, whole, vdi))
    assert np.abs(without - expected).max() > 0.1
    # Opacities in the last cell before a neighbour are those of the last point: 0.3 / 255 measured
    assert np.abs(found - expected).max() <= 1 / 255
    assert vdi.metadata["ambient_occlusion"] == whole.metadata["ambient_occlusion"]


def test_a_grid_of_occlusion_that_is_too_large_is_refused_before_anything_is_read():
    da = pytest.importorskip("dask.array")
    read = []
    lazy = da.zeros((4096, 4096, 4096), np.uint8, chunks=512)
    volume = Volume(lazy.map_blocks(lambda part: read.append(1) or part, meta=lazy._meta))
    function = TransferFunction(np.ones((2, 3)), [0, 1], (0, 255))
    camera = VIEWS["all of it"](volume)
    with pytest.raises(DeviceMemoryError, match=r"radius of 8.*larger radius"):
        generate_in_blocks(volume, camera, WINDOW, function, ambient_occlusion=8.0)
    assert not read


@pytest.mark.parametrize("limit", [10_000, 700_000, 1_600_000, 8_000_000])
def test_no_more_memory_is_taken_than_allowed(runtime, limit):
    values = np.random.default_rng(1).integers(0, 255, (96, 96, 96)).astype(np.float32)
    volume = Volume(values)
    arguments = (volume, VIEWS["all of it"](volume), WINDOW, transfer_for(volume, "linear"))
    own = fresh_runtime(runtime)
    options = {"chunks": (24, 24, 24), "memory_limit": limit, "max_supersegments": 5}
    if limit < 1_000_000:
        with pytest.raises(DeviceMemoryError, match="rows of .* memory_limit is .* smaller chunks"):
            generate_in_blocks(*arguments, device=own, **options)
    else:
        generate_in_blocks(*arguments, device=own, **options)
        assert own.peak_allocated <= limit


def test_it_is_given_up_when_it_is_asked_to():
    volume = volume_of("uint8")
    told = []

    def progress(fraction):
        told.append(fraction)
        return fraction < 0.5

    with pytest.raises(Cancelled):
        generate_in_blocks(
            *(volume, VIEWS["all of it"](volume), WINDOW, transfer_for(volume)),
            chunks=(16, 16, 16),
            progress=progress,
        )
    assert told == sorted(told)
    assert 0.5 <= told[-1] < 0.9


@pytest.mark.parametrize("budget", [400, 5])
def test_blocks_keep_the_values_of_one_piece(budget, default_runtime):
    """Whatever is at their borders: per list, the length, and the sums of values and squares."""
    volume = volume_of("uint8")
    asked = request(
        *(volume, VIEWS["all of it"](volume), WINDOW, unclassified("linear")),
        max_supersegments=budget,
        device=default_runtime,
    )
    kept = Deferral("deferred", (20, 200), [2, 1])
    whole = generate_deferred(asked, kept)

    def make(made):
        view = made.volume, made.camera, WINDOW, made.transfer_function, made.options
        return generate_in_blocks(*view, chunks=(20, 14, 27), device=default_runtime)

    found = generate_deferred(asked, kept, make)
    assert found.metadata["blocks"] == [3, 3, 2]

    def sums(vdi):
        length, mean = lengths_of(vdi.lists) * vdi.share, vdi.mean.astype(float)
        ends = vdi.offsets.astype(int)
        of_rows = (length, length * mean, length * (mean**2 + vdi.spread.astype(float) ** 2))
        return [np.diff(np.append(0, np.cumsum(each))[ends]) for each in of_rows]

    # Of up to 200 steps and float32 values; a spread below 5e-4 is written as none
    for one, other in zip(sums(found), sums(whole), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-4, atol=1e-3)
    assert found.n_supersegments == pytest.approx(whole.n_supersegments, rel=0.05)
