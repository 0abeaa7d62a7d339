"""The benchmarks' arithmetic: what rays meet against the float64 reference, floors, and fits.

The scenes are counted once for all models that are held to them: hence more than 500 lines.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pyvista_vdi.device.constants import STACK
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.compositing import optical_depth_over_length
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.reference import build_vdi, render_pixels, samples, volume_image
from pyvista_vdi.reference.raycast import Lists, crossings, lines_of_pixel

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
if not BENCHMARKS.is_dir():
    pytest.skip("the benchmarks are not beside the tests", allow_module_level=True)
pytest.importorskip("tqdm")
sys.path.insert(0, str(BENCHMARKS))

import counting  # noqa: E402
import machine  # noqa: E402
import model  # noqa: E402
import scaling  # noqa: E402

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


def test_sampled_blocks_hold_four_by_four_pixels_one_after_the_other():
    x, y = counting.sampled_blocks((24, 18), 12)
    blocks = np.stack([x, y], axis=1).reshape(-1, 16, 2)
    corners = {(int(a), int(b)) for a, b in blocks.min(axis=1)}
    assert corners == {(4, 4), (16, 4)}
    assert len(counting.sampled_blocks((24, 18), 4)[0]) == 24 * 16
    assert len(counting.sampled_blocks((24, 18), 100)[0]) == 16
    for block in blocks:
        assert len({tuple(pixel) for pixel in block.tolist()}) == 16
        assert (np.ptp(block, axis=0) == 3).all()
    assert x.max() < 24
    assert y.max() < 18


def test_busy_lanes_are_those_that_do_not_wait_for_the_longest():
    turns = np.zeros(32, int)
    turns[:16] = 10  # one block in step
    assert counting.busy_lanes(turns) == 1.0
    turns[16] = 10  # and one with a single ray
    assert counting.busy_lanes(turns) == pytest.approx(17 / 32)
    assert counting.busy_lanes(np.zeros(16, int)) == 1.0


@pytest.mark.every(3)
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
    # One list a ray: a block waits for the ray that meets most in it
    turns = np.reshape(walk.lists + walk.met, (-1, counting.LANES))
    np.testing.assert_array_equal(
        walk.in_step.reshape(turns.shape), np.broadcast_to(turns.max(1)[:, None], turns.shape)
    )


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
        assert walk.tiles[k] <= 1 + sum(-(-n // STACK) for n in SIZE)


def test_walk_counts_as_occupied_every_list_in_which_something_is_met(scene):
    volume, function, view, _ = scene
    lists = (4 * STACK, 2 * STACK)
    vdi = build_vdi(volume, view, lists, function, sample_distance=2.0, max_supersegments=3)
    x, y = every_pixel(SIZE)
    rays = counting.Rays.of(view.azimuth(25.0), SIZE, x, y)
    walk = counting.walk(counting.CountedVDI(vdi), rays, cutoff=0.0)
    assert (walk.occupied > 0)[walk.met > 0].all()
    assert (walk.occupied < walk.lists).any()  # half of the volume is empty


@pytest.mark.every(3)
@pytest.mark.parametrize("angle", [0.0, 30.0, 170.0])
def test_a_walk_ends_where_no_light_is_left(scene, angle):
    volume, _, view, _ = scene
    opaque = build_vdi(volume, view, SIZE, soft_function(1.0), max_supersegments=6)
    x, y = every_pixel(SIZE)
    rays = counting.Rays.of(view.azimuth(angle), SIZE, x, y)
    counted = counting.CountedVDI(opaque)
    whole, cut = (counting.walk(counted, rays, cutoff=cutoff) for cutoff in (0.0, 1e-3))
    assert angle == 0 or cut.lists.sum() < whole.lists.sum()
    through = np.exp(-whole.optical_depth) >= 1e-3
    np.testing.assert_array_equal(cut.lists[through], whole.lists[through])
    assert (np.exp(-cut.optical_depth) < 1e-3)[~through].all()
    lists, met = Lists(opaque), np.zeros(len(x), int)
    for k, pixel in enumerate(zip(x.tolist(), y.tolist(), strict=True)):
        for line in lines_of_pixel(opaque, view.azimuth(angle), SIZE, pixel):
            found = crossings(lists, line)
            tau = optical_depth_over_length(
                lists.optical_depth[found.member], found.length, lists.length[found.member]
            )
            before = np.cumsum(tau) - tau
            met[k] = np.count_nonzero(before < -np.log(1e-3))
    assert np.mean(cut.met != met) < 0.02
    assert cut.met.sum() == pytest.approx(met.sum(), rel=0.005)
    assert cut.met.sum() < whole.met.sum()


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


@pytest.mark.parametrize("opacity", [0.3, 1.0])
def test_runs_are_the_lists_that_generation_makes_without_a_budget(runtime, opacity):
    volume, function = soft_volume(), soft_function(opacity)
    view = filling_camera(volume.bounds, SIZE)
    vdi = generate_vdi(
        volume, view, SIZE, function, max_supersegments=500, sample_distance=0.45, device=runtime
    )
    x, y = every_pixel(SIZE)
    march = counting.march(
        volume,
        function,
        counting.Rays.of(view, SIZE, x, y),
        0.45,
        blocks=counting.visible_blocks(volume, function),
        stops=False,
        runs=True,
    )
    lengths = vdi.counts.ravel()
    # A midpoint between two voxels is rounded either way
    assert np.mean(march.runs != lengths) < 0.03
    assert march.runs.sum() == pytest.approx(lengths.sum(), rel=0.005)


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


# -- floors ----------------------------------------------------------------------------------------

#: A machine with round figures: 10 and 5 GB/s, 10^9 gathers of 4 bytes from a cache, a tenth of
#: that from memory and a quarter where each is waited for.
MACHINE = {
    "caches": {"L1": "32K", "L2": "1M"},
    "streams": {"read": 10e9, "write": 5e9},
    "arithmetic": {"multiply_add": 100e9, "divide": 10e9, "exponential": 1e9},
    "launches": {"waited": 1e-5},
    "transfers": {"download": 2e9},
    "gathers": {
        "near": {"4": [[2**14, 1e9], [2**28, 1e8]], "16": [[2**14, 5e8], [2**28, 5e7]]},
        "near, chained": {"4": [[2**14, 2.5e8], [2**28, 2.5e7]], "16": [[2**14, 1e8]]},
    },
}


def test_rates_are_those_of_the_device_that_is_asked_about(tmp_path):
    def runtime(name):
        return SimpleNamespace(info=SimpleNamespace(kind="CPU", full_name=name))

    with pytest.raises(
        SystemExit, match=r"machine_cpu.json holds nothing of a / b: run machine.py"
    ):
        machine.Rates.read_for(runtime("a / b"), tmp_path)
    results = {**MACHINE, "system": {"device": "a / b"}}
    (tmp_path / "machine_cpu.json").write_text(json.dumps(results))
    assert machine.Rates.read_for(runtime("a / b"), tmp_path).read == 10e9
    with pytest.raises(SystemExit, match="holds nothing of c / d"):
        machine.Rates.read_for(runtime("c / d"), tmp_path)


def test_rates_are_interpolated_between_working_sets_and_taken_from_the_next_larger_element():
    rates = machine.Rates(MACHINE)
    assert rates.gather(4, 2**14) == pytest.approx(1e9)
    assert rates.gather(4, 2**21) == pytest.approx(1e8 * 10**0.5)  # half way by logarithms
    assert rates.gather(4, 1) == pytest.approx(1e9)
    assert rates.gather(4, 2**40) == pytest.approx(1e8)
    assert rates.gather(8, 2**14) == pytest.approx(5e8)
    assert rates.gather(32, 2**14) == pytest.approx(5e8)


def test_the_floor_is_the_slowest_resource_and_what_nothing_overlaps():
    work = model.Work(
        read=1e9,
        write=1e9,
        gathers=(model.Gathers(5e8, 4, 2**14),),
        operations=model.Operations(multiply_add=1e9, divide=1e9, exponential=1e8),
        launches=2,
        download=2e8,
    )
    floor = model.floor_of(work, machine.Rates(MACHINE))
    assert floor.memory == pytest.approx(0.1 + 0.2)
    assert floor.gathers == pytest.approx(0.5)
    assert floor.arithmetic == pytest.approx(0.01 + 0.1 + 0.1)
    assert floor.around == pytest.approx(2e-5 + 0.1)
    assert floor.waiting == pytest.approx(2.0)
    assert floor.seconds == pytest.approx(0.5 + 0.1 + 2e-5)
    assert floor.bound == "gathers (L1)"


def test_the_work_of_a_frame_at_the_generating_view_is_one_list_a_ray(scene):
    _, _, view, vdi = scene
    x, y = every_pixel(SIZE)
    walk = counting.walk(counting.CountedVDI(vdi), counting.Rays.of(view, SIZE, x, y), cutoff=0.0)
    plain, skipping = (
        model.raycast_work(walk, SIZE, vdi.nbytes, skips=skips) for skips in (False, True)
    )
    visits, faces, media, tiles = (g.elements for g in plain.gathers)
    # Lists that the bounds' silhouette misses are empty, and no ray enters them
    assert visits == pytest.approx(walk.lists.sum())
    assert media == pytest.approx(vdi.n_supersegments)
    assert faces == pytest.approx(vdi.n_supersegments + np.count_nonzero(np.diff(vdi.offsets)))
    assert tiles == 0
    assert plain.write == 16 * SIZE[0] * SIZE[1]
    assert plain.operations.exponential == pytest.approx(vdi.n_supersegments)
    assert skipping.gathers[3].elements == pytest.approx(walk.tiles.sum())
    assert skipping.gathers[0].elements <= visits


def test_stages_are_known_by_their_kernels_names():
    kernels = {
        "march": ("longest_marches", "march_lists"),
        "shorten": ("shorten_lists",),
        "pack": ("sum_lengths", "list_offsets", "pack_lists"),
    }
    for stage, names in kernels.items():
        assert [model.stage_of(name) for name in names] == [stage] * len(names)


def test_medians_are_of_sums_in_each_run():
    runs = [{"a1": 1.0, "a2": 2.0, "": 5.0}, {"a1": 3.0, "a2": 3.0, "": 7.0}]
    assert model.medians(runs, lambda name: name[:1]) == {"a": 4.5, "": 6.0}


@pytest.mark.parametrize(
    ("size", "place"), [(2**10, "L1"), (2**15, "L1"), (2**15 + 1, "L2"), (2**30, "memory")]
)
def test_a_working_set_lies_in_the_smallest_cache_that_holds_it(size, place):
    assert machine.cache_of(size, {"L1": "32K", "L2": "1024K", "L3": "32M"}) == place


# -- fits ------------------------------------------------------------------------------------------


def test_a_power_law_is_found_exactly_and_noise_widens_its_interval():
    x = np.array([1.0, 2.0, 4.0, 8.0, 16.0])
    exact = scaling.fitted(x, 3.0 * x**1.5)
    assert exact.exponent == pytest.approx(1.5)
    assert exact.margin == pytest.approx(0, abs=1e-9)
    noisy = scaling.fitted(x, 3.0 * x**1.5 * np.exp([0.1, -0.1, 0.1, -0.1, 0.1]))
    assert noisy.margin > 0.05
    assert abs(noisy.exponent - 1.5) < noisy.margin
    assert noisy.residual == pytest.approx(0.1, abs=0.03)


def test_the_interval_is_that_of_a_textbook():
    # Logarithms 0 to 4 and 0.1, 0.9, 2.2, 2.9, 4.1, for which scipy.stats.linregress has a standard
    # error of 0.0489898 for (t quantile of three degrees of freedom by scipy: 3.182446)
    x = np.exp([0.0, 1.0, 2.0, 3.0, 4.0])
    y = np.exp([0.1, 0.9, 2.2, 2.9, 4.1])
    assert scaling.fitted(x, y).exponent == pytest.approx(1.0)
    assert scaling.fitted(x, y).margin == pytest.approx(3.182446 * 0.0489898, rel=1e-3)


def test_two_points_have_no_interval():
    fit = scaling.fitted([1.0, 2.0], [1.0, 4.0])
    assert fit.exponent == pytest.approx(2.0)
    assert fit.margin == np.inf


def test_what_comes_on_top_is_fitted_without_the_first_cost():
    rows = [{"value": v, "seconds": {"VDI frame": 2.0 + 0.5 * v}} for v in (0.0, 1.0, 2.0, 8.0)]
    found = scaling.fits(scaling.AXES["angle"], rows)
    assert found["VDI frame"].exponent == pytest.approx(1.0)
    flat = [{"value": v, "seconds": {"VDI frame": 2.0}} for v in (0.0, 1.0, 2.0)]
    assert scaling.fits(scaling.AXES["angle"], flat) == {}


def test_two_cores_must_bring_a_factor():
    assert scaling.verdict(1.8) == "met"
    assert scaling.verdict(1.79) == "missed"


@pytest.mark.parametrize(
    ("interpolation", "voxels", "entries"), [("nearest", 1, 1), ("linear", 8, 2)]
)
def test_the_work_of_a_march_is_a_voxel_and_an_entry_a_sample(
    scene, interpolation, voxels, entries
):
    volume, _, view, _ = scene
    function = soft_function(interpolation=interpolation)
    x, y = every_pixel(SIZE)
    blocks = counting.visible_blocks(volume, function)
    march = counting.march(
        volume, function, counting.Rays.of(view, SIZE, x, y), 0.9, blocks=blocks, stops=True
    )
    work = model.march_work(march, volume, function, SIZE, blocks.mean(), records=False)
    assert work.gathers[0].elements == pytest.approx(voxels * march.looked.sum())
    assert work.gathers[1].elements == pytest.approx(entries * march.looked.sum())
    assert work.operations.exponential == pytest.approx(entries * march.visible.sum())
    sampled = work.gathers[0].elements * volume.array.itemsize
    assert work.read == pytest.approx(min(blocks.mean() * volume.array.nbytes, sampled))
    recorded = model.march_work(march, volume, function, SIZE, blocks.mean(), records=True)
    assert recorded.write == 0
    assert recorded.operations.divide > work.operations.divide


def test_scalings_report_has_exponents_and_says_what_is_not_measured():
    rows = [
        {"value": v, "seconds": dict.fromkeys(scaling.QUANTITIES, 0.001 * v**0.5)}
        for v in (1.0, 4.0, 16.0)
    ]
    results = {
        "volume": "heptane",
        "procedural": "beechnut_like",
        "window_size": [64, 36],
        "max_supersegments": 20,
        "angle": 10.0,
        "interpolation": "nearest",
        "clock": "cpu",
        "system": {},
        "axes": {"pixels": rows, "cores": None},
    }
    text = scaling.report(results)
    assert "| pixels | 0.50 ± 0.00 | 0.50 ± 0.00 | 0.50 ± 0.00 |" in text
    assert "1 to 2 (not measured here)" in text
    results["axes"]["cores"] = {
        "ratio": {"VDI frame": 1.9, "render_volume": 1.7, "generation": 1.8}
    }
    assert "| 1.90, met | 1.70, missed | 1.80, met |" in scaling.report(results)
