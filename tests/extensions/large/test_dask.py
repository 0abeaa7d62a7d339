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
from drawing import generate_in_blocks
from support.march_ways import VIEWS, WINDOW, transfer_for, volume_of

from pyvista_vdi import Volume, generate, read_volume
from pyvista_vdi.errors import (
    Cancelled,
    DeviceError,
    InvalidArgumentError,
    InvalidArgumentTypeError,
    InvalidVolumeError,
)

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


def lazy(array):
    return da.from_array(array, chunks=(16, 16, 16))


@pytest.fixture(scope="module")
def scene():
    volume = volume_of("uint8")
    view = VIEWS["all of it"](volume), WINDOW, transfer_for(volume, "linear")
    return (Volume(lazy(volume.array)), *view), {"max_supersegments": 8}


@pytest.fixture(scope="module")
def expected(scene, default_runtime):
    arguments, options = scene
    return generate_in_blocks(*arguments, device=default_runtime, **options)


def test_whoever_makes_it_the_bytes_are_the_same(client, scene, expected):
    arguments, options = scene
    told = []
    found = generate_in_blocks(*arguments, client=client, progress=told.append, **options)
    assert found.equals(expected)
    assert told == sorted(told)
    assert told[0] == 0
    assert told[-1] == pytest.approx(1)


def test_values_are_the_same_by_workers(client, scene, default_runtime):
    volume, camera, size, _ = scene[0]
    options = {"classification": "deferred", "value_range": (20, 200), "max_supersegments": 8}
    expected = generate(volume, camera, size, device=default_runtime, **options)
    assert expected.n_supersegments > 1000
    assert generate(volume, camera, size, client=client, **options).equals(expected)


def kill_once(pid, fraction):
    """Return a progress callback that kills a worker once that much is done."""
    alive = [True]

    def progress(done):
        if done >= fraction and alive[0]:
            alive[0] = False
            os.kill(pid(), signal.SIGKILL)

    return progress


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="processes are killed by SIGKILL")
def test_a_killed_worker_changes_nothing(client, scene, expected):
    arguments, options = scene
    client.wait_for_workers(2, timeout=STARTED)
    progress = kill_once(lambda: min(client.run(os.getpid).values()), 0.3)
    found = generate_in_blocks(*arguments, client=client, progress=progress, **options)
    assert found.equals(expected)
    client.wait_for_workers(2, timeout=STARTED)


def test_cancelled_at_once(client, scene):
    arguments, options = scene
    with pytest.raises(Cancelled):
        generate_in_blocks(*arguments, client=client, progress=lambda done: done < 0.1, **options)
    ends = time.monotonic() + STARTED  # the client's request may still be on its way
    while left := client.run_on_scheduler(_left):
        assert time.monotonic() < ends, left
        time.sleep(0.05)


def _left(dask_scheduler):
    return [str(key) for key in dask_scheduler.tasks if "pass" in str(key)]


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ("cluster", InvalidArgumentTypeError, r"LocalCluster: give distributed.Client\(cluster"),
        ("tcp://127.0.0.1:1", InvalidArgumentError, "no Dask scheduler answers at 'tcp://127"),
    ],
)
def test_what_is_no_client_is_refused(client, scene, given, error, message):
    (volume, camera, size, function), _ = scene
    wrong = client.cluster if given == "cluster" else given
    with (
        dask.config.set({"distributed.comm.timeouts.connect": "1s"}),
        pytest.raises(error, match=message),
    ):
        generate(volume, camera, size, transfer_function=function, client=wrong)


@pytest.mark.parametrize(
    ("fails", "says"),
    [
        ("raises", r"block \(1, 1, 1\) \(points \[16:32.*disk is gone"),
        pytest.param("dies", r"block \(1, 1, 1\).*died, 4 in all", marks=pytest.mark.slow),
    ],
)
def test_what_cannot_be_read_is_named(client, scene, fails, says):
    (_, *rest), options = scene

    def broken(part, block_info=None):
        if block_info[0]["chunk-location"] != (1, 1, 1):
            return part
        if fails == "dies":
            os._exit(9)  # as of too little memory
        raise OSError("the disk is gone")

    array = lazy(volume_of("uint8").array).map_blocks(broken, dtype=np.uint8)
    with pytest.raises(DeviceError, match=says):
        generate_in_blocks(Volume(array), *rest, client=client, **options)
    client.wait_for_workers(2, timeout=STARTED)


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


@pytest.mark.skipif(not Path("/proc/self/cwd").exists(), reason="a path that differs by process")
@pytest.mark.parametrize("kind", ["hdf5", "dask"])
def test_a_worker_that_has_not_the_store_is_named(client, scene, in_folders, kind):
    (_, *rest), options = scene
    STORES["zarr" if kind == "dask" else kind](in_folders("here", "none"), volume_of("uint8").array)
    path = "/proc/self/cwd/s"  # as of a mount that is not the same on all machines
    opened = Volume(da.from_zarr(path)) if kind == "dask" else read_volume(path)
    bad = list(client.nthreads())[1]
    with pytest.raises(InvalidVolumeError, match=rf"{bad}.*/s.* cannot be read there"):
        generate_in_blocks(opened, *rest, client=client, **options)
