"""Blocks on the workers of a Dask cluster: real processes, of which some die."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("distributed", reason="dask.distributed is not installed (extra: dask)")

import dask
import dask.array as da
from distributed import Client, LocalCluster
from drawing import generate_chunked, generate_on_dask
from support.march_ways import VIEWS, WINDOW, transfer_for, volume_of

from pyvista_vdi import Volume, generate, open_volume
from pyvista_vdi.errors import (
    Cancelled,
    DeviceError,
    InvalidArgumentError,
    InvalidArgumentTypeError,
    InvalidVolumeError,
    NoDeviceError,
    VDIWarning,
)
from pyvista_vdi.extensions.large.generate import balanced

#: Seconds within which a worker starts on the busiest machine; more is a worker that never does.
STARTED = 120


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dask")
    with (
        # Else a worker that is missing this long after it was killed once, 15 seconds, is given up
        # for good, even where it was back in between and was killed again
        dask.config.set({"distributed.deploy.lost-worker-timeout": "1 hour"}),
        LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=":0", local_directory=str(folder)
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client


@pytest.fixture(scope="module")
def scene():
    volume = volume_of("uint8")
    options = {"max_supersegments": 8, "chunks": (16, 16, 16), "block_bytes": 1}
    return (volume, VIEWS["all of it"](volume), WINDOW, transfer_for(volume, "linear")), options


@pytest.fixture(scope="module")
def expected(scene, default_runtime):
    arguments, options = scene
    return generate_chunked(*arguments, device=default_runtime, **options)


def check_same(vdi, expected):
    assert vdi.equals(expected)


def test_whoever_makes_it_the_bytes_are_the_same(client, scene, expected):
    arguments, options = scene
    told = []
    check_same(
        generate_on_dask(*arguments, client=client, progress=told.append, **options), expected
    )
    assert told == sorted(told)
    assert told[0] == 0
    assert told[-1] == pytest.approx(1)
    one = list(client.nthreads())[:1]
    check_same(generate_on_dask(*arguments, client=client, workers=one, **options), expected)


def test_values_are_the_same_by_workers(client, scene, default_runtime):
    volume, camera, size, _ = scene[0]
    chunked = Volume(da.from_array(volume.array, chunks=(16, 41, 25)), volume.spacing)
    options = {"classification": "deferred", "value_range": (20, 200), "max_supersegments": 8}
    expected = generate(chunked, camera, size, device=default_runtime, **options)
    assert expected.n_supersegments > 1000
    check_same(generate(chunked, camera, size, client=client, **options), expected)


@pytest.mark.slow
def test_occlusion_is_the_same_by_workers(client, scene, default_runtime):
    arguments, options = scene
    options = {**options, "ambient_occlusion": 8.0}
    expected = generate_chunked(*arguments, device=default_runtime, **options)
    check_same(generate_on_dask(*arguments, client=client, **options), expected)


def kill_once(pid, fraction):
    """Return a progress callback that kills a worker once that much is done."""
    alive = [True]

    def progress(done):
        if done >= fraction and alive[0]:
            alive[0] = False
            os.kill(pid(), signal.SIGKILL)

    return progress


@pytest.mark.parametrize(
    "fraction",
    [
        0.3,
        *(
            pytest.param(round(at, 2), marks=pytest.mark.slow)
            for at in np.random.default_rng(7).random(10)
        ),
    ],
)
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="processes are killed by SIGKILL")
def test_a_killed_worker_changes_nothing(client, scene, expected, fraction):
    arguments, options = scene
    client.wait_for_workers(2, timeout=STARTED)
    progress = kill_once(lambda: min(client.run(os.getpid).values()), fraction)
    check_same(generate_on_dask(*arguments, client=client, progress=progress, **options), expected)
    client.wait_for_workers(2, timeout=STARTED)


def test_cancelled_at_once(client, scene):
    arguments, options = scene
    with pytest.raises(Cancelled):
        generate_on_dask(*arguments, client=client, progress=lambda done: done < 0.1, **options)
    ends = time.monotonic() + STARTED  # the client's request may still be on its way
    while left := client.run_on_scheduler(_left):
        assert time.monotonic() < ends, left
        time.sleep(0.05)


def _left(dask_scheduler):
    return [str(key) for key in dask_scheduler.tasks if "pass" in str(key)]


def test_dask_arrays_are_computed_where_they_are_needed(client, scene, expected):
    (volume, *rest), options = scene
    lazy = Volume(da.from_array(volume.array, chunks=(16, 16, 16)), volume.spacing)
    options = {key: value for key, value in options.items() if key != "chunks"}
    check_same(generate_on_dask(lazy, *rest, client=client, **options), expected)


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ("cluster", InvalidArgumentTypeError, r"a LocalCluster: give distributed.Client\(cluster"),
        (7, InvalidArgumentTypeError, "an? int"),
        ("tcp://127.0.0.1:1", InvalidArgumentError, "no Dask scheduler answers at 'tcp://127"),
    ],
)
def test_what_is_no_client_is_refused(client, scene, given, error, message):
    (volume, camera, size, function), _ = scene
    lazy = Volume(da.from_array(volume.array, chunks=(16, 16, 16)))
    wrong = client.cluster if given == "cluster" else given
    with (
        dask.config.set({"distributed.comm.timeouts.connect": "1s"}),
        pytest.raises(error, match=message),
    ):
        generate(lazy, camera, size, transfer_function=function, client=wrong)


def test_an_address_is_that_of_its_scheduler(client, scene):
    (volume, camera, size, function), _ = scene
    lazy = Volume(da.from_array(volume.array, chunks=(16, 16, 16)), volume.spacing)
    found = generate(
        lazy, camera, size, transfer_function=function, client=client.scheduler.address
    )
    assert found.n_supersegments > 1000


def test_dask_arrays_of_unknown_chunks_say_what_to_call(scene):
    (volume, *_), _ = scene
    lazy = da.from_array(volume.array, chunks=(16, 16, 16))
    with pytest.raises(InvalidVolumeError, match="compute_chunk_sizes"):
        Volume(lazy[lazy[:, 0, 0] < 200])


def test_what_cannot_be_read_is_named(client, scene):
    (volume, *rest), options = scene

    def broken(part, block_info=None):
        if block_info[0]["chunk-location"] == (1, 1, 1):
            raise OSError("the disk is gone")
        return part

    array = da.from_array(volume.array, chunks=(16, 16, 16)).map_blocks(broken, dtype=np.uint8)
    options = {key: value for key, value in options.items() if key != "chunks"}
    with pytest.raises(DeviceError, match=r"block \(1, 1, 1\) \(points \[16:32.*disk is gone"):
        generate_on_dask(Volume(array), *rest, client=client, **options)


def zarr_store(folder, values, **options):
    zarr = pytest.importorskip("zarr")
    array = zarr.open(
        str(folder / "s"), mode="w", shape=values.shape, chunks=(16, 16, 16), dtype="u1", **options
    )
    array[...] = values
    return folder / "s"


def hdf5_store(folder, values):
    with pytest.importorskip("h5py").File(folder / "s", "w") as file:
        file.create_dataset("d", data=values, chunks=(16, 16, 16))
    return folder / "s"


STORES = {
    "zarr": zarr_store,
    "zarr2": lambda *of: zarr_store(*of, zarr_format=2),
    "hdf5": hdf5_store,
}


@pytest.fixture
def in_folders(client, tmp_path, monkeypatch):
    """Have this process and the workers work in folders, of which each has its own for a while."""
    client.wait_for_workers(2, timeout=STARTED)
    before = client.run(os.getcwd)
    names = ("here", "none", "other", "part")
    for name in names:
        (tmp_path / name).mkdir()
    monkeypatch.chdir(tmp_path / "here")

    def go(*places):
        for worker, place in zip(client.nthreads(), places, strict=True):
            client.run(os.chdir, str(tmp_path / place), workers=[worker])
        return tmp_path / "here"

    yield go
    for worker, folder in before.items():
        client.run(os.chdir, folder, workers=[worker])


def generated(opened, rest, client, **options):
    options |= {"client": client, "max_supersegments": 8, "block_bytes": 1}
    return generate_on_dask(opened, *rest, **options)


@pytest.mark.skipif(not Path("/proc/self/cwd").exists(), reason="a path that differs by process")
@pytest.mark.parametrize("kind", [*STORES, "dask"])
@pytest.mark.parametrize(
    ("where", "said"), [("none", "cannot be read there"), ("other", "another file")]
)
def test_a_worker_that_has_not_the_same_store_is_named(
    client, scene, in_folders, where, said, kind
):
    (volume, *rest), _ = scene
    here = in_folders("here", where)
    make = STORES["zarr" if kind == "dask" else kind]
    make(here, volume.array)
    if where != "none":
        make(here.parent / where, volume.array // 2)
    path = "/proc/self/cwd/s"  # as of a mount that is not the same on all machines
    opened = Volume(da.from_zarr(path)) if kind == "dask" else open_volume(path)
    bad = list(client.nthreads())[1]
    with pytest.raises(InvalidVolumeError, match=rf"{bad}.*/s.*{said}"):
        generated(opened, rest, client)


@pytest.mark.every(9)
@pytest.mark.parametrize("kind", STORES)
def test_relative_paths_are_this_process_s_and_changes_are_seen_while_it_is_open(
    client, scene, in_folders, kind, default_runtime
):
    (volume, *rest), _ = scene
    here = in_folders("none", "none")
    STORES[kind](here, volume.array)
    opened = open_volume("s")
    whole = generate_chunked(opened, *rest, max_supersegments=8, block_bytes=1)
    check_same(generated(opened, rest, client), whole)
    if kind == "hdf5":
        del opened
    changed = np.where(volume.array > 100, 0, volume.array)
    STORES[kind](here, changed)
    if kind == "hdf5":
        opened = open_volume("s")
    found = generated(opened, rest, client)
    check_same(
        found,
        generate_chunked(
            Volume(changed), *rest, max_supersegments=8, chunks=(16,) * 3, block_bytes=1
        ),
    )
    assert not found.equals(whole)


def test_workers_without_a_device_are_named(client, scene, expected):
    arguments, options = scene
    workers = list(client.nthreads())
    before = os.environ.get("PYVISTA_VDI_DEVICE", "")

    def choose(name, only=None):
        client.run(lambda: os.environ.update(PYVISTA_VDI_DEVICE=name), workers=only)

    try:
        choose("nobody", workers[:1])
        with pytest.warns(VDIWarning, match=f"1 of 2 workers.*{workers[0]}.*nobody"):
            vdi = generate_on_dask(*arguments, client=client, **options)
        check_same(vdi, expected)
        choose("nobody")
        with pytest.raises(NoDeviceError, match=f"no worker.*{workers[0]}"):
            generate_on_dask(*arguments, client=client, **options)
    finally:
        choose(before)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="processes are killed by SIGKILL")
def test_nobody_waits_for_workers_that_are_gone(client, scene):
    arguments, options = scene
    client.wait_for_workers(2, timeout=STARTED)
    one = list(client.nthreads())[:1]
    pid = next(iter(client.run(os.getpid, workers=one).values()))
    progress = kill_once(lambda: pid, 0.2)
    with pytest.raises(DeviceError, match=f"are gone: {one[0]}"):
        generate_on_dask(*arguments, client=client, workers=one, progress=progress, **options)
    client.wait_for_workers(2, timeout=STARTED)


def test_rows_are_balanced_by_what_is_in_them():
    weights = np.zeros(99, np.int64)
    weights[40:60] = 100
    ranges = list(balanced(weights, 4))
    assert ranges[0][0] == 0
    assert ranges[-1][1] == 99
    assert all(a[1] == b[0] for a, b in zip(ranges, ranges[1:]))  # noqa: B905, RUF007
    assert all(y0 % 4 == 0 for y0, _ in ranges)
    # A group of four rows is 400 of 2000: a range has a fourth of all, or one group more or less
    assert all(abs(weights[y0:y1].sum() - 500) <= 400 for y0, y1 in ranges)
    assert list(balanced(np.zeros(7, np.int64), 3)) == [(0, 7)]
    assert list(balanced(np.ones(3, np.int64), 9)) == [(0, 3)]
