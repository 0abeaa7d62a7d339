"""The benchmarks' arithmetic: what rays meet against the float64 reference, floors, and fits."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from pyvista_vdi.camera import Camera
from pyvista_vdi.occupancy import TILE
from pyvista_vdi.reference import build_vdi, render_pixels, samples, volume_image
from pyvista_vdi.reference.raycast import Lists, crossings, lines_of_pixel
from pyvista_vdi.standard_cases import filling_camera
from pyvista_vdi.transfer_function import TransferFunction
from pyvista_vdi.volume import Volume

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
if not BENCHMARKS.is_dir():
    pytest.skip("the benchmarks are not beside the tests", allow_module_level=True)
pytest.importorskip("tqdm")
sys.path.insert(0, str(BENCHMARKS))

import counting  # noqa: E402

SIZE = (24, 18)


def soft_volume(shape=(19, 22, 21), seed=3):
    """Return noise with an empty half, so that blocks, lists and cells are empty as well."""
    rng = np.random.default_rng(seed)
    array = rng.integers(60, 256, shape, dtype=np.uint8)
    array[:, :, : shape[2] // 2] = 0
    return Volume(array, spacing=(1.0, 1.2, 0.9))


def soft_function(opacity=0.3, interpolation="nearest"):
    """Return a table that makes scalars below a fifth of the range transparent."""
    opacities = np.interp(np.linspace(0, 1, 32), [0.2, 1.0], [0.0, opacity])
    opacities[:6] = 0
    colors = np.linspace((0.1, 0.2, 0.3), (0.9, 0.7, 0.5), 32)
    return TransferFunction(colors, opacities, (0.0, 255.0), interpolation=interpolation)


def every_pixel(size):
    """Return x and y of all pixels, the bottom row first."""
    y, x = np.divmod(np.arange(size[0] * size[1]), size[0])
    return x, y


@pytest.fixture(scope="module")
def scene():
    """Return a volume, its look, V_O and a VDI of it, made by the reference."""
    volume, function = soft_volume(), soft_function()
    view = filling_camera(volume.bounds, SIZE)
    return volume, function, view, build_vdi(volume, view, SIZE, function, max_supersegments=6)


def test_sampled_pixels_lie_in_the_middle_of_their_blocks():
    x, y = counting.sampled_pixels((24, 16), 8)
    assert sorted(set(x)) == [4, 12, 20]
    assert sorted(set(y)) == [4, 12]
    assert [len(n) for n in counting.sampled_pixels((3, 2), 8)] == [1, 1]


@pytest.mark.parametrize("angle", [0.0, 5.0, 30.0, 160.0])
@pytest.mark.parametrize("parallel", [False, True])
def test_walk_meets_what_the_reference_meets(scene, angle, parallel):
    _, _, view, vdi = scene
    camera = view.azimuth(angle).replace(
        parallel_projection=parallel, parallel_scale=12.0 if parallel else view.parallel_scale
    )
    x, y = every_pixel(SIZE)
    rays = counting.Rays.of(camera, SIZE, x, y)
    walk = counting.walk(counting.CountedVDI(vdi), rays, perspective=not parallel, cutoff=0.0)
    lists = Lists(vdi)
    met = np.zeros(len(x), int)
    for k, pixel in enumerate(zip(x.tolist(), y.tolist(), strict=True)):
        for line in lines_of_pixel(vdi, camera, SIZE, pixel):
            met[k] += len(crossings(lists, line).member)
    # A ray along a border between two lists belongs to either; what it meets there differs by a few
    assert np.mean(walk.met != met) < 0.02
    assert walk.met.sum() == pytest.approx(met.sum(), rel=0.002)
    assert met.sum() > len(x)  # the test is about something
    alpha = render_pixels(vdi, camera, SIZE, list(zip(x.tolist(), y.tolist(), strict=True)))[:, 3]
    np.testing.assert_allclose(1 - np.exp(-walk.optical_depth), alpha, atol=2e-6)


def test_walk_at_the_generating_view_stays_in_one_list(scene):
    _, _, view, vdi = scene
    x, y = every_pixel(SIZE)
    walk = counting.walk(counting.CountedVDI(vdi), counting.Rays.of(view, SIZE, x, y), cutoff=0.0)
    counts = np.diff(vdi.offsets.astype(int))
    assert walk.lists.max() == 1
    np.testing.assert_array_equal(walk.met, counts * walk.lists)
    np.testing.assert_array_equal(walk.filled, (counts > 0) * walk.lists)
    np.testing.assert_array_equal(walk.tiles, walk.lists)


def test_walk_steps_through_as_many_lists_as_it_crosses_borders(scene):
    _, _, view, vdi = scene
    camera = view.azimuth(40.0)
    x, y = every_pixel(SIZE)
    rays = counting.Rays.of(camera, SIZE, x, y)
    walk = counting.walk(counting.CountedVDI(vdi), rays, cutoff=0.0)
    at, slope = counting._viewport_lines(vdi, rays)
    for k in np.flatnonzero(walk.lists)[::7]:
        (line,) = lines_of_pixel(vdi, camera, SIZE, (int(x[k]), int(y[k])))
        borders = 0
        for axis, edge in enumerate(SIZE):
            place = [
                ((at[axis, k] + t * slope[axis, k]) / (at[3, k] + t * slope[3, k]) + 1) / 2 * edge
                for t in (line.t0, line.t1)
            ]
            # Borders strictly between where it begins and ends
            low, high = min(place) + 1e-9, max(place) - 1e-9
            borders += max(0, int(np.ceil(high)) - int(np.floor(low)) - 1)
        assert walk.lists[k] == borders + 1
        assert walk.occupied[k] <= walk.lists[k]
        assert walk.tiles[k] <= 1 + sum(-(-n // TILE) for n in SIZE)


def test_walk_counts_as_occupied_every_list_in_which_something_is_met(scene):
    volume, function, view, _ = scene
    lists = (4 * TILE, 2 * TILE)
    vdi = build_vdi(volume, view, lists, function, sample_distance=2.0, max_supersegments=3)
    x, y = every_pixel(SIZE)
    rays = counting.Rays.of(view.azimuth(25.0), SIZE, x, y)
    walk = counting.walk(counting.CountedVDI(vdi), rays, cutoff=0.0)
    assert (walk.occupied > 0)[walk.met > 0].all()
    assert (walk.occupied < walk.lists).any()  # half of the volume is empty


def test_a_walk_ends_where_no_light_is_left(scene):
    volume, _, view, _ = scene
    opaque = build_vdi(volume, view, SIZE, soft_function(1.0), max_supersegments=6)
    x, y = every_pixel(SIZE)
    rays = counting.Rays.of(view.azimuth(30.0), SIZE, x, y)
    counted = counting.CountedVDI(opaque)
    whole, cut = (counting.walk(counted, rays, cutoff=cutoff) for cutoff in (0.0, 1e-3))
    assert cut.lists.sum() < whole.lists.sum()
    through = np.exp(-whole.optical_depth) >= 1e-3
    np.testing.assert_array_equal(cut.lists[through], whole.lists[through])
    assert (np.exp(-cut.optical_depth) < 1e-3)[~through].all()


@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
def test_march_takes_the_samples_that_the_reference_takes(scene, interpolation):
    volume, _, view, _ = scene
    function = soft_function(interpolation=interpolation)
    x, y = every_pixel(SIZE)
    rays = counting.Rays.of(view, SIZE, x, y)
    blocks = counting.visible_blocks(volume, function)
    assert 0 < blocks.mean() < 1
    march = counting.march(volume, function, rays, 0.45, blocks=blocks, stops=False, runs=True)
    for k, ray in enumerate(samples(volume, view, SIZE, function, 0.45)):
        visible = int(np.count_nonzero(ray.optical_depth))
        # A last step of no length, or a midpoint between two voxels, is rounded either way
        assert abs(march.steps[k] - len(ray.length)) <= 1
        assert abs(march.visible[k] - visible) <= 1
        assert march.visible[k] <= march.looked[k] <= march.steps[k]
        assert march.runs[k] <= march.visible[k]
    assert march.visible.sum() > len(x)
    assert march.blocks.any()


def test_runs_of_a_homogeneous_slab_are_one():
    volume = Volume(np.full((9, 9, 9), 200, np.uint8))
    view = Camera((4, -30, 4), (4, 4, 4), (0, 0, 1))
    function = soft_function()
    x, y = every_pixel((5, 5))
    march = counting.march(
        volume,
        function,
        counting.Rays.of(view, (5, 5), x, y),
        0.5,
        blocks=counting.visible_blocks(volume, function),
        stops=False,
        runs=True,
    )
    assert set(march.runs[march.visible > 0]) == {1}


def test_a_march_that_stops_takes_no_more_samples(scene):
    volume, _, view, _ = scene
    function = soft_function(1.0)
    x, y = every_pixel(SIZE)
    arguments = (volume, function, counting.Rays.of(view, SIZE, x, y), 0.45)
    blocks = counting.visible_blocks(volume, function)
    whole, stopped = (
        counting.march(*arguments, blocks=blocks, stops=stops, cutoff=1e-2)
        for stops in (False, True)
    )
    assert (stopped.steps <= whole.steps).all()
    assert stopped.steps.sum() < whole.steps.sum()
    # Light that is left after all samples is left at every one before
    alpha = volume_image(volume, view, SIZE, function, 0.45)[::-1, :, 3].ravel()
    through = 1 - alpha > 1.01e-2
    np.testing.assert_array_equal(stopped.steps[through], whole.steps[through])
