"""Disks that fill, processes that are killed or race while they save: whole files or old ones."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from faulty_disk import vdi_number, watch_new_files

from pyvista_vdi import io, registry
from pyvista_vdi.errors import VDIFileError

posix = pytest.mark.skipif(os.name != "posix", reason="POSIX signals and limits")
SUFFIXES = [one.suffix for one in registry.formats() if one.holds == "VDI"]
formats = pytest.mark.parametrize("suffix", SUFFIXES)

#: Where this process finds what tests share.
SUPPORT = Path(__file__).parents[1] / "support"

#: Seconds after which a test that waits for another process gives up.
PATIENCE = 600


def options(suffix, compression=None):
    """What a VDI is saved with so that reading gives its bits: pages are in 8 bytes by default."""
    if suffix == ".html":
        return {"precision": "exact"}  # deflated always
    return {"compression": compression} if compression and suffix != ".exr" else {}


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


def fill():
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def interrupt():
    signal.raise_signal(signal.SIGINT)


@posix
@pytest.mark.parametrize(
    ("suffix", "fault", "old"),
    [(".vdi", fill, True), (".vdi", interrupt, True), (".html", fill, False)],
)
def test_a_disk_that_fills_and_ctrl_c_at_each_write(suffix, fault, old, monkeypatch, tmp_path):
    path, left = tmp_path / f"a{suffix}", []

    def reached():
        left.append(1)
        if len(left) == fault_at:
            fault()

    watch_new_files(reached, monkeypatch.setattr)
    fault_at = None
    if old:
        vdi_number(1).save(path)
        before = path.read_bytes()
    left.clear()
    vdi_number(2).save(tmp_path / f"counted{suffix}", **options(suffix))
    calls = len(left)
    (tmp_path / f"counted{suffix}").unlink()
    # OpenEXR hands over all at once, and a page is one text
    assert calls > (10 if suffix == ".vdi" else 1)
    error, message = (VDIFileError, "could not be written: No space left on device")
    if fault is interrupt:
        error, message = KeyboardInterrupt, None
    for fault_at in range(1, calls + 1, 1 if fault is fill else 3):
        left.clear()
        with pytest.raises(error, match=message):
            vdi_number(2).save(path, **options(suffix))
        assert names_in(tmp_path) == [path.name] * old, fault_at
        assert not old or path.read_bytes() == before, fault_at
    fault_at = None
    vdi_number(2).save(path, **options(suffix))
    found = io.read(path)
    assert found.equals(vdi_number(2)) or suffix == ".exr"  # which is rounded


@formats
@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_a_disk_that_fails_at_the_last_steps(suffix, step, monkeypatch, tmp_path):
    path = vdi_number(1).save(tmp_path / f"a{suffix}")
    before = path.read_bytes()

    def fail(*_):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(os if step == "fsync" else type(path), step, fail)
    with pytest.raises(VDIFileError, match="could not be written: Input/output error"):
        vdi_number(2).save(path)
    monkeypatch.undo()
    assert path.read_bytes() == before
    assert names_in(tmp_path) == [path.name]


#: A program that saves, and one that saves until it is told to end.
SAVE = """
import select, sys, time
sys.path.insert(0, {support!r})
from faulty_disk import stop_for_good_at, vdi_number
vdi = vdi_number({seed})
"""
SAVE_AND_STOP = """
stop_for_good_at({moment})
vdi.save({path!r}, **{options!r})
print("saved", flush=True)
time.sleep(3600)
"""
SAVE_OFTEN = """
sys.stdin.readline()
while not select.select([sys.stdin], [], [], 0)[0]:
    vdi.save({path!r}, **{options!r})
"""


def saving(program, path, seed, **more):
    """Start a process that saves VDI number ``seed``."""
    code = (SAVE + program).format(
        support=str(SUPPORT), seed=seed, path=str(path), options=options(path.suffix), **more
    )
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    return subprocess.Popen([sys.executable, "-c", code], **pipes)


def killed_at(moment, path):
    """Kill a process that saves at a moment; what it had said by then."""
    process = saving(SAVE_AND_STOP, path, 2, moment=moment)
    try:
        return process.stdout.readline().strip()
    finally:
        process.kill()
        process.communicate(timeout=PATIENCE)


@posix
@pytest.mark.parametrize(
    "moments", [(0, 7, 9999), pytest.param((*range(0, 40, 3), 9999), marks=pytest.mark.slow)]
)
def test_a_process_that_is_killed_while_it_saves(moments, tmp_path):
    """SIGKILL at any moment: the old file is intact, or the new one is whole."""
    path = vdi_number(1).save(tmp_path / "a.vdi")
    before = path.read_bytes()
    outcomes = set()
    for moment in moments:
        path.write_bytes(before)
        said = killed_at(moment, path)
        outcomes.add(said)
        if said == "now":
            assert path.read_bytes() == before, moment
        else:
            assert said in ("moved", "saved")
            assert np.array_equal(io.read(path).counts, vdi_number(2).counts)
        for left in set(names_in(tmp_path)) - {path.name}:
            # The dead process could not remove it: hidden, named after the file, never read
            assert left.startswith(f".{path.name}.")
            assert left.endswith(".tmp")
            (tmp_path / left).unlink()
    assert outcomes >= {"now", "saved"}


def test_two_processes_that_save_to_one_name(tmp_path):
    """Whoever reads meanwhile finds one of their files, whole."""
    path = vdi_number(1).save(tmp_path / "a.vdi")
    processes = [saving(SAVE_OFTEN, path, seed) for seed in (1, 2)]
    known, seen = [vdi_number(1).counts, vdi_number(2).counts], []

    def look():
        vdi = io.read(path)
        (found,) = [i for i, one in enumerate(known) if np.array_equal(one, vdi.counts)]
        seen.append(found)

    try:
        for process in processes:
            process.stdin.write("go\n")
            process.stdin.flush()
        # They save until they are told to end
        deadline = time.monotonic() + PATIENCE
        while len(seen) < 60 or set(seen) != {0, 1}:
            assert time.monotonic() < deadline
            look()
        for process in processes:
            process.stdin.close()
        for process in processes:
            process.wait(PATIENCE)
        look()
    finally:
        for process in processes:
            process.kill()
            process.wait()
            process.stdout.close()
    assert [process.returncode for process in processes] == [0, 0]
    assert names_in(tmp_path) == [path.name]
