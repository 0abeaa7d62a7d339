"""Series in memory: sequence, times, slices, and what generates them."""

from __future__ import annotations

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi.errors import (
    Cancelled,
    InvalidArgumentError,
    InvalidVDIError,
    InvalidVolumeError,
    VDIWarning,
)
from pyvista_vdi.model.standard_cases import filling_camera

SIZE = (20, 12)
SPACING = (1.0, 1.0, 0.5)


def _table():
    shades = np.linspace(0, 1, 16)
    colors = np.stack([shades, shades**2, 1 - shades], axis=1)
    return pvdi.TransferFunction(colors, shades * 0.7, (0.0, 60.0))


@pytest.fixture(scope="module")
def volumes():
    z, y, x = np.mgrid[:9, :8, :7]
    return [pvdi.Volume((x * y + z + 3 * k).astype(np.float32), SPACING) for k in range(4)]


@pytest.fixture(scope="module")
def camera(volumes):
    return filling_camera(volumes[0].bounds, SIZE)


@pytest.fixture(scope="module")
def series(volumes, camera, default_runtime):
    return pvdi.generate_series(
        volumes, camera, SIZE, (0.5, 1.0, 2.0, 4.0), transfer_function=_table()
    )


def test_a_step_is_what_generate_makes_of_its_volume(series, volumes, camera):
    assert isinstance(series, pvdi.VDISeries)
    assert (len(series), series.times) == (4, (0.5, 1.0, 2.0, 4.0))
    assert (series.camera, series.window_size) == (camera, SIZE)
    assert series.bounds == series[0].bounds
    for vdi, volume in zip(series, volumes, strict=True):
        alone = pvdi.generate(volume, camera, SIZE, transfer_function=_table(), precision="8-byte")
        assert vdi.equals(alone)
        assert vdi.precision == "8-byte"
    assert not series[0].equals(series[1])
    assert "4 steps" in repr(series)


def test_slices_are_series_and_negative_indices_count_from_the_end(series):
    assert series[-1] is series[3]
    part = series[1::2]
    assert isinstance(part, pvdi.VDISeries)
    assert part.times == (1.0, 4.0)
    assert part[1] is series[3]
    with pytest.raises(IndexError, match=r"\[\d+\] is out of range: there are \d+ steps"):
        series[4]


def test_nearest_is_the_step_nearest_in_time(series):
    times = np.linspace(-1, 6, 57)
    expected = [int(np.argmin(np.abs(np.array(series.times) - time))) for time in times]
    assert [series.nearest(time) for time in times] == expected
    assert series.nearest(1.5) == 1  # of two, the earlier
    with pytest.raises(InvalidArgumentError, match="finite"):
        series.nearest(float("nan"))


def test_volumes_in_many_shapes_are_the_same_series(series, volumes, camera):
    looks = {"transfer_function": _table()}
    stack = np.stack([volume.array for volume in volumes])
    called = []
    shapes = {
        "iterator": (iter(volumes), {}),
        "function": (lambda i: called.append(i) or volumes[i], {"times": series.times}),
        "array": (stack, {"spacing": SPACING}),
    }
    for name, (steps, more) in shapes.items():
        other = pvdi.generate_series(steps, camera, SIZE, **more, **looks)
        assert all(a.equals(b) for a, b in zip(other, series, strict=True)), name
    assert called == [0, 1, 2, 3]


@pytest.fixture
def store(volumes, tmp_path):
    """The volumes as time steps of a store."""
    zarr = pytest.importorskip("zarr")
    stack = np.stack([volume.array for volume in volumes])
    path = str(tmp_path / "t.zarr")
    array = zarr.open(path, mode="w", shape=stack.shape, chunks=(1, 4, 4, 4), dtype="f4")
    array[...] = stack
    array.attrs["spacing"] = SPACING[::-1]
    return path


def test_steps_of_a_store_are_made_chunk_by_chunk(store, camera, default_runtime, tmp_path):
    looks = {"transfer_function": _table()}
    steps = [pvdi.read_volume(store, time=k) for k in range(4)]
    expected = [pvdi.generate(step, camera, SIZE, precision="8-byte", **looks) for step in steps]
    assert all("blocks" in vdi.metadata for vdi in expected)
    for volumes, times in (
        (steps, None),
        (steps[2], None),
        (pvdi.read_volume(store), (1, 2, 3, 5)),
    ):
        series = pvdi.generate_series(volumes, camera, SIZE, times, **looks)
        assert series.times == (times or (0, 1, 2, 3))
        assert all(a.equals(b) for a, b in zip(series, expected, strict=True))
    with pvdi.SeriesWriter(tmp_path / "a.vdis", camera, SIZE, **looks) as out:
        for step in steps:
            out.append(step)
    written = pvdi.read(tmp_path / "a.vdis")
    assert all(a.equals(b) for a, b in zip(written, expected, strict=True))


def test_workers_make_the_steps(store, volumes, camera, default_runtime, tmp_path):
    distributed = pytest.importorskip("distributed")
    import dask.array

    looks = {"transfer_function": _table()}
    steps = [pvdi.read_volume(store, time=k) for k in range(2)]
    stack = dask.array.from_array(np.stack([v.array for v in volumes[:2]]), (1, 4, 4, 4))
    expected = pvdi.generate_series(steps, camera, SIZE, **looks)
    with (
        distributed.LocalCluster(n_workers=1, processes=False, dashboard_address=":0") as cluster,
        distributed.Client(cluster) as client,
    ):
        by_workers = pvdi.generate_series(steps, camera, SIZE, client=client, **looks)
        arrays = pvdi.generate_series(stack, camera, SIZE, spacing=SPACING, client=client, **looks)
        with pvdi.SeriesWriter(tmp_path / "a.vdis", camera, SIZE, client=client, **looks) as out:
            for step in steps:
                out.append(step)
        with pytest.raises(InvalidArgumentError, match="client is for chunked volumes"):
            pvdi.generate_series(volumes, camera, SIZE, client=client, **looks)
    for made in (by_workers, arrays, pvdi.read(tmp_path / "a.vdis")):
        assert all(a.equals(b) for a, b in zip(made, expected, strict=True))


def test_a_step_that_cannot_be_made_is_named(volumes, camera, default_runtime, tmp_path):
    empty = pvdi.Volume(np.full((9, 8, 7), np.nan, np.float32), SPACING)
    looks = {"transfer_function": _table()}
    said = "step 2: every value of 'values' is NaN: .*leave"
    with pytest.raises(InvalidVolumeError, match=said):
        pvdi.generate_series([*volumes[:2], empty], camera, SIZE, **looks)
    with pvdi.SeriesWriter(tmp_path / "a.vdis", camera, SIZE, **looks) as out:
        for volume in volumes[:2]:
            out.append(volume)
        with pytest.raises(InvalidVolumeError, match=said):
            out.append(empty)
        out.append(volumes[2])  # the series goes on
    assert len(pvdi.read(tmp_path / "a.vdis")) == 3


def test_bytes_that_a_later_step_needs_are_told_once(camera, default_runtime):
    size = (48, 36)
    low, high = (
        pvdi.Volume((np.random.default_rng(1).random((12, 12, 12)) < share).astype("u1") * 60)
        for share in (0.01, 0.5)
    )
    view = filling_camera(low.bounds, size)
    with pytest.warns(
        VDIWarning, match=r"max_bytes=9000 is not kept by all .* one has \d{5} "
    ) as said:
        pvdi.generate_series(
            [low, low, high, high], view, size, max_bytes=9000, transfer_function=_table()
        )
    assert len(said) == 1


def test_colours_stand_for_the_same_values_in_all_steps(volumes, camera, default_runtime):
    pytest.importorskip("pyvista")
    series = pvdi.generate_series(volumes[:2], camera, SIZE, cmap="bone", opacity="linear")
    clim = volumes[0].finite_range()
    alone = pvdi.generate(
        volumes[1], camera, SIZE, cmap="bone", opacity="linear", clim=clim, precision="8-byte"
    )
    assert series[1].equals(alone)
    assert [vdi.metadata["classification"] for vdi in series] == [{"cmap": "bone"}] * 2


def test_a_dial_chooses_once(volumes, default_runtime):
    camera = filling_camera(volumes[0].bounds, (32, 24))
    series = pvdi.generate_series(
        volumes[:3], camera, (32, 24), quality="fast", transfer_function=_table()
    )
    assert len({vdi.window_size for vdi in series}) == 1
    assert {vdi.picture_size for vdi in series} == {(32, 24)}


def test_progress_is_that_of_the_whole_series(volumes, camera, default_runtime):
    heard = []
    pvdi.generate_series(volumes, camera, SIZE, transfer_function=_table(), progress=heard.append)
    assert heard == sorted(heard)
    assert heard[-1] == 1
    with pytest.raises(Cancelled):
        pvdi.generate_series(
            volumes, camera, SIZE, transfer_function=_table(), progress=lambda f: f < 0.5
        )


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"times": (0, 1, 1, 2)}, "ascend"),
        ({"times": (0, 1, 2)}, "4 steps and 3 times"),
        ({"times": (0, 1, 2, float("inf"))}, "finite"),
        ({"volumes": []}, "at least one"),
        ({"volumes": 3}, "iterable"),
        ({"volumes": lambda i: i}, "pass times"),
    ],
)
def test_what_cannot_be_a_series_is_refused(change, what, volumes, camera):
    arguments = {"volumes": volumes, "camera": camera, "window_size": SIZE, **change}
    with pytest.raises(InvalidArgumentError, match=what):
        pvdi.generate_series(**arguments, transfer_function=_table())


def test_series_of_vdis_at_hand(series):
    again = pvdi.VDISeries(list(series))
    assert again.times == (0.0, 1.0, 2.0, 3.0)
    assert again[2] is series[2]
    with pytest.raises(InvalidArgumentError, match="at least one"):
        pvdi.VDISeries([])
    with pytest.raises(InvalidVDIError, match="in a list"):
        pvdi.VDISeries(series[0])
    with pytest.raises(InvalidArgumentError, match="4 steps and 1 times"):
        pvdi.VDISeries(series, [3])
