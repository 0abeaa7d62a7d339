"""opencl/generation/shorten_lists.cl does the same for a block of rays as for each of them."""

from __future__ import annotations

import numpy as np
import pytest
from recorded_runs import EXTREMES, as_runs, random_records

from pyvista_vdi import Volume
from pyvista_vdi.device.constants import GROUP, block_items
from pyvista_vdi.generation.kernels import SHORTEN_LISTS
from pyvista_vdi.model.ray_forms import Rectangle
from pyvista_vdi.volume.rays import GridRays

LANES = 16
WINDOW = (13, 23)  # blocks of rays reach beyond it
FIRST_ROW, ROWS = 6, 14


def forms():
    """Rays that get the longer per unit of t the farther from the middle they are."""
    rng = np.random.default_rng(3)
    return rng.normal(size=(6, 6)).astype(np.float32)


def shortened(runtime, lanes, records, limit, exactly, *, hidden_weight=0.25, reference=0.7):
    """Counts, thresholds and records after one launch, by work-item; counts by list."""
    width, _ = WINDOW
    items = block_items(width, ROWS)
    capacity = max(map(len, records))
    rng = np.random.default_rng(4)
    # What lies behind a record is anything
    bits = rng.integers(0, 2**32, (items, capacity, 8), dtype=np.uint32)
    runs = bits.view(np.float32)
    counts = np.zeros((ROWS, width), np.uint32)
    item = np.arange(items)
    columns = -(-width // 4)
    x = item // 16 % columns * 4 + item % 4
    y = item // 16 // columns * 4 + item // 4 % 4
    inside = np.flatnonzero((x < width) & (y < ROWS))
    for k, at in enumerate(inside):
        record = records[k % len(records)]
        runs[at, : len(record)] = record
        counts[y[at], x[at]] = len(record)
    thresholds = np.full(items, 1e-6, np.float32)
    thresholds[::3] = 1e-2
    grid = GridRays(Volume(np.zeros((2, 2, 2))), 1.0, 1.0)
    window = Rectangle(0, width, FIRST_ROW, FIRST_ROW + ROWS)
    numbers = {"capacity": capacity, "limit": limit, "grain": 1, "window_row": 0, "finest": 1e-6}
    with (
        runtime.upload(forms()) as rays,
        runtime.buffer(thresholds.shape) as of_items,
        runtime.buffer(runs.shape) as all_records,
        runtime.buffer((items, capacity)) as errors,
        runtime.buffer(counts.shape, np.uint32) as lengths,
    ):
        runtime.write(of_items, thresholds)
        runtime.write(all_records, runs)
        runtime.write(lengths, counts)
        launch = runtime.bind(
            SHORTEN_LISTS,
            {"DOUBLE_FLOAT_RAYS": 0, "LANES": lanes},
            view=grid.view(WINDOW, 0, window),
            forms=rays,
            recording={**numbers, "reference_length": reference, "hidden_weight": hidden_weight},
            exactly=exactly,
            thresholds=of_items,
            records=all_records,
            errors=errors,
            counts=lengths,
        )
        launch(items // lanes, GROUP // lanes)
        after = runtime.download(lengths)
        left = runtime.download(all_records)
        kept = [left[at, : after[y[at], x[at]]] for at in inside]
        return after, runtime.download(of_items)[inside], np.concatenate(kept)


def check_the_same(runtime, records, limit, exactly, **options):
    if not runtime.is_cpu:
        pytest.skip("only CPU devices shorten records in blocks")
    expected = shortened(runtime, 1, records, limit, exactly, **options)
    found = shortened(runtime, LANES, records, limit, exactly, **options)
    for name, a, b in zip(("counts", "thresholds", "records"), expected, found, strict=True):
        np.testing.assert_array_equal(a.view(np.uint32), b.view(np.uint32), name)
    assert expected[0].max() <= limit
    return expected


@pytest.mark.every(3)
@pytest.mark.parametrize("exactly", [False, True], ids=["room", "exactly"])
@pytest.mark.parametrize("limit", [1, 7, 20, 52])
def test_records_of_all_lengths(runtime, limit, exactly):
    rng = np.random.default_rng(5)
    records = [as_runs(s) for s in random_records(6, 40, 60)]
    records += [as_runs(s) for s in random_records(7, 12, 170, least=150)]
    records += [np.empty((0, 8), np.float32)] * 9
    rng.shuffle(records)
    _, thresholds, _ = check_the_same(runtime, records, limit, exactly)
    assert (len(np.unique(thresholds)) > 2) == (not exactly)


@pytest.mark.parametrize("exactly", [False, True], ids=["room", "exactly"])
@pytest.mark.parametrize("hidden_weight", [0.0, 1.0])
def test_equal_errors_are_merged_in_the_same_order(runtime, exactly, hidden_weight):
    """Of equal errors the first is merged first."""
    alike = [EXTREMES[name] for name in ("all equal", "all equal, apart", "black")]
    check_the_same(runtime, alike, 5, exactly, hidden_weight=hidden_weight)


def test_a_slice_with_nothing_to_shorten_stays(runtime):
    records = [as_runs(s) for s in random_records(8, 30, 9)]
    after, _, _ = check_the_same(runtime, records, 9, True)
    assert after.sum() > 100


@pytest.mark.extremes
@pytest.mark.parametrize("exactly", [False, True], ids=["room", "exactly"])
@pytest.mark.parametrize(("limit", "reference"), [(1, 1e-30), (7, 1.0), (39, 1e30)])
def test_any_finite_record(runtime, reference, limit, exactly):
    check_the_same(runtime, list(EXTREMES.values()), limit, exactly, reference=reference)
