"""Blocks on the workers of a Dask cluster: real processes, of which some die."""

from __future__ import annotations

import os
import signal

import numpy as np
import pytest

pytest.importorskip("distributed", reason="dask.distributed is not installed (extra: dask)")

import dask
import dask.array as da
from distributed import Client, LocalCluster
from support.march_ways import VIEWS, WINDOW, transfer_for, volume_of

from pyvista_vdi import Volume
from pyvista_vdi.errors import Cancelled, DeviceError, NoDeviceError, VDIWarning
from pyvista_vdi.large.generate import generate_chunked
from pyvista_vdi.large.on_dask import generate_on_dask
from pyvista_vdi.large.rows import balanced

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
    client.run_on_scheduler(_nothing_left)


def _nothing_left(dask_scheduler):
    assert not [key for key in dask_scheduler.tasks if "pass" in str(key)]


def test_dask_arrays_are_computed_where_they_are_needed(client, scene, expected):
    (volume, *rest), options = scene
    lazy = Volume(da.from_array(volume.array, chunks=(16, 16, 16)), volume.spacing)
    options = {key: value for key, value in options.items() if key != "chunks"}
    check_same(generate_on_dask(lazy, *rest, client=client, **options), expected)


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
