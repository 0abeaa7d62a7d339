"""Series in memory: sequence, times, slices, and what generates them."""

from __future__ import annotations

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi.errors import Cancelled, InvalidArgumentError, InvalidVDIError, InvalidVolumeError
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


def test_slices_are_series_and_the_nearest_is_found_in_time(series):
    assert series[-1] is series[3]
    part = series[1::2]
    assert isinstance(part, pvdi.VDISeries)
    assert part.times == (1.0, 4.0)
    assert part[1] is series[3]
    with pytest.raises(IndexError, match=r"\[\d+\] is out of range: there are \d+ steps"):
        series[4]
    assert [series.nearest(time) for time in (-1, 1.5, 1.6, 9)] == [0, 1, 2, 3]
    with pytest.raises(InvalidArgumentError, match="finite"):
        series.nearest(float("nan"))


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


def test_steps_of_a_store_are_made_chunk_by_chunk(store, camera, default_runtime):
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


def test_workers_make_the_steps(store, volumes, camera, default_runtime, tmp_path):
    distributed = pytest.importorskip("distributed")
    looks = {"transfer_function": _table()}
    steps = [pvdi.read_volume(store, time=k) for k in range(2)]
    expected = pvdi.generate_series(steps, camera, SIZE, **looks)
    with (
        distributed.LocalCluster(n_workers=1, processes=False, dashboard_address=":0") as cluster,
        distributed.Client(cluster) as client,
    ):
        by_workers = pvdi.generate_series(steps, camera, SIZE, client=client, **looks)
        with pvdi.SeriesWriter(tmp_path / "a.vdis", camera, SIZE, client=client, **looks) as out:
            for step in steps:
                out.append(step)
        with pytest.raises(InvalidArgumentError, match="client is for chunked volumes"):
            pvdi.generate_series(volumes, camera, SIZE, client=client, **looks)
    for made in (by_workers, pvdi.read(tmp_path / "a.vdis")):
        assert all(a.equals(b) for a, b in zip(made, expected, strict=True))


def test_a_step_that_cannot_be_made_is_named_and_work_is_cancelled(volumes, camera):
    empty = pvdi.Volume(np.full((9, 8, 7), np.nan, np.float32), SPACING)
    looks = {"transfer_function": _table()}
    said = "step 2: every value of 'values' is NaN: .*leave"
    with pytest.raises(InvalidVolumeError, match=said):
        pvdi.generate_series([*volumes[:2], empty], camera, SIZE, **looks)
    with pytest.raises(Cancelled):
        pvdi.generate_series(volumes, camera, SIZE, progress=lambda done: done < 0.5, **looks)


def test_colours_stand_for_the_same_values_in_all_steps(volumes, camera, default_runtime):
    pytest.importorskip("pyvista")
    series = pvdi.generate_series(volumes[:2], camera, SIZE, cmap="bone", opacity="linear")
    clim = volumes[0].finite_range()
    alone = pvdi.generate(
        volumes[1], camera, SIZE, cmap="bone", opacity="linear", clim=clim, precision="8-byte"
    )
    assert series[1].equals(alone)
    assert [vdi.metadata["classification"] for vdi in series] == [{"cmap": "bone"}] * 2


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"times": (0, 1, 1, 2)}, "ascend"),
        ({"times": (0, 1, 2)}, "4 steps and 3 times"),
        ({"times": (0, 1, 2, float("inf"))}, "finite"),
        ({"volumes": []}, "at least one"),
        ({"volumes": 3}, "one for each step; got int"),
        ({"quality": "fast"}, "quality"),
    ],
)
def test_what_cannot_be_a_series_is_refused(change, what, volumes, camera):
    arguments = {"volumes": volumes, "camera": camera, "window_size": SIZE, **change}
    with pytest.raises((InvalidArgumentError, TypeError), match=what):
        pvdi.generate_series(**arguments, transfer_function=_table())


def test_series_of_vdis_at_hand(series):
    assert pvdi.VDISeries(list(series)).times == (0.0, 1.0, 2.0, 3.0)
    for steps, times, why in (([], None, "at least one"), (series, [3], "4 steps and 1 times")):
        with pytest.raises(InvalidArgumentError, match=why):
            pvdi.VDISeries(steps, times)
    with pytest.raises(InvalidVDIError, match="in a list"):
        pvdi.VDISeries(series[0])
