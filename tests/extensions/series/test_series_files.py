"""``.vdis``: what is written is read, from folders and files, whatever becomes of the writer."""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import stepped_vdis
from stepped_vdis import SIZE, packed_steps, same

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError, VDIFileError


@pytest.fixture(scope="module")
def steps():
    return packed_steps(5)


@pytest.fixture(scope="module", params=["folder", "file"])
def saved(request, steps, tmp_path_factory):
    path = tmp_path_factory.mktemp("series") / "a.vdis"
    times = np.arange(5) * 0.5
    if request.param == "file":
        return pvdi.VDISeries(steps, times).save(path)
    with pvdi.SeriesWriter(path) as out:
        for step, at in zip(steps, times, strict=True):
            out.append(step, at)
    return path


def all_same(read, steps):
    return all(same(one, other) for one, other in zip(read, steps, strict=True))


def test_every_step_is_read_to_the_last_bit(steps, saved):
    series = pvdi.read(f"{saved}{os.sep}" if saved.is_dir() else saved)  # as shells complete it
    assert isinstance(series, pvdi.VDISeries)
    assert series.times == (0.0, 0.5, 1.0, 1.5, 2.0)
    assert (series.camera, series.window_size) == (steps[0].camera, SIZE)
    assert series.bounds == steps[0].bounds
    assert all_same(series, steps)
    assert same(series[1:3][1], steps[2])
    assert all_same(pickle.loads(pickle.dumps(series)), steps)

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(lambda i: series[i].equals(steps[i]), [0, 4, 2, 1, 3] * 4))


def content_of(folder):
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def turned_away(vdi):
    arrays = (vdi.offsets, vdi.front, vdi.back, vdi.color, vdi.optical_depth)
    return pvdi.VDI(vdi.camera.azimuth(3), vdi.window_size, *arrays, vdi.bounds)


def test_what_was_appended_is_readable_at_once_and_continued_replaced_or_kept(steps, tmp_path):
    path = tmp_path / "a.vdis"
    with pvdi.SeriesWriter(path) as out:
        with pytest.raises(VDIFileError, match="no finished step"):
            pvdi.read(path)
        for k, vdi in enumerate(steps[:3]):
            out.append(vdi, 10.0 + k)
            assert all_same(pvdi.read(path), steps[: k + 1])
        with pytest.raises(InvalidArgumentError, match="camera and window_size"):
            out.append(object(), 15.0)
    with pytest.raises(VDIFileError, match="closed"):
        out.append(steps[0])
    whole = content_of(path)
    with pytest.raises(VDIFileError, match=r"is there already with 3 .*append=True.*overwrite"):
        pvdi.SeriesWriter(path)
    with pytest.raises(VDIFileError, match="it is a folder"):
        pvdi.VDISeries(steps).save(path)
    with pvdi.SeriesWriter(path, append=True) as out:
        assert len(out) == 3
        with pytest.raises(InvalidArgumentError, match=r"ascend; got 12\.0 after 12\.0"):
            out.append(steps[3], 12.0)
        with pytest.raises(InvalidArgumentError, match="its camera is"):
            out.append(turned_away(steps[3]), 13.0)
    assert content_of(path) == whole
    with pvdi.SeriesWriter(path, append=True) as out:
        for k, vdi in enumerate(steps[3:]):
            out.append(vdi, 13.0 + k)
    assert all_same(pvdi.read(path), steps)
    with pvdi.SeriesWriter(path, overwrite=True) as out:
        out.append(steps[0])
    assert len(pvdi.read(path)) == 1
    assert not (path / "000001.vdi").exists()


@pytest.mark.parametrize("content", [b"not a series", b""])
def test_files_of_others_are_named_and_stay(content, steps, tmp_path):
    path = tmp_path / "a.vdis"
    path.write_bytes(content)
    with pytest.raises(VDIFileError, match="no series of VDIs"):
        pvdi.read(path)
    for way in ({}, {"append": True}, {"overwrite": True}):
        with pytest.raises(VDIFileError, match="cannot be written"):
            pvdi.SeriesWriter(path, **way)
    with pytest.raises(VDIFileError, match="something else: choose another name"):
        pvdi.VDISeries(steps).save(path)
    assert path.read_bytes() == content


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"version": 2}, "version 2.*upgrade"),
        ({"times": [1, 1]}, "must ascend"),
        ({"times": None}, "incomplete"),
    ],
)
def test_times_that_cannot_be_are_refused(change, why, steps, tmp_path):
    path = tmp_path / "a.vdis"
    with pvdi.SeriesWriter(path) as out:
        out.append(steps[0])
    head = json.loads((path / "series.json").read_text())
    (path / "series.json").write_text(json.dumps(head | change))
    with pytest.raises(VDIFileError, match=why):
        pvdi.read(path)


def test_a_file_that_is_cut_off_or_changed_is_noticed(tmp_path):
    steps, path = packed_steps(3, size=(6, 4)), tmp_path / "a.vdis"
    data = pvdi.VDISeries(steps).save(path).read_bytes()
    for n in [*range(0, len(data), 397), len(data) - 1]:
        path.write_bytes(data[:n])
        with pytest.raises(VDIFileError):
            pvdi.read(path)
    random = np.random.default_rng(0)
    for place in random.integers(0, len(data), 60).tolist():
        path.write_bytes(data[:place] + bytes([data[place] ^ 0x10]) + data[place + 1 :])
        with contextlib.suppress(VDIFileError):
            series = pvdi.read(path)
            for i, step in enumerate(steps):
                assert series[i].equals(step)  # or it raises


def test_a_step_that_does_not_fit_is_not_counted(steps, tmp_path):
    resource = pytest.importorskip("resource")
    path = tmp_path / "a.vdis"
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    with pvdi.SeriesWriter(path) as out:
        out.append(steps[0])
        before = content_of(path)
        resource.setrlimit(resource.RLIMIT_FSIZE, (2000, limits[1]))  # bytes, as of a full disk
        try:
            with pytest.raises(VDIFileError, match=r"000001\.vdi could not be written"):
                out.append(steps[1])
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        assert content_of(path) == before
        out.append(steps[2])
    assert all_same(pvdi.read(path), [steps[0], steps[2]])


_WRITES = """
import sys
sys.path[:0] = {folders!r}
import pyvista_vdi as pvdi
from stepped_vdis import packed_steps
steps = packed_steps(8, size=(12, 8))
with pvdi.SeriesWriter({path!r}, append=True) as out:
    print("begun", flush=True)
    for k in range(100000):
        out.append(steps[k % 8])
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no SIGKILL on this system")
def test_a_second_writer_is_refused_until_the_first_is_killed_whose_steps_stay(tmp_path):
    steps, path = packed_steps(8, size=(12, 8)), tmp_path / "a.vdis"
    code = _WRITES.format(folders=[str(Path(stepped_vdis.__file__).parent)], path=str(path))
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE) as process:
        process.stdout.readline()
        for way in ({}, {"append": True}, {"overwrite": True}):
            with pytest.raises(VDIFileError, match="being written by another"):
                pvdi.SeriesWriter(path, **way)
        while not (path / "000009.vdi").exists() and process.poll() is None:
            time.sleep(0.001)
        process.kill()
    series = pvdi.read(path)
    assert len(series) > 8
    assert all(step.equals(steps[i % 8]) for i, step in enumerate(series))
    with pvdi.SeriesWriter(path, append=True) as out:
        with pytest.raises(VDIFileError, match="being written by another"):
            pvdi.SeriesWriter(path, append=True)
        out.append(steps[0])
    assert len(pvdi.read(path)) == len(series) + 1
