"""Several threads, and processes that fork: the same pictures, or a clear error; never a hang."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from drawing import generate_vdi, render_vdi
from faulty_driver import CAMERA, TRANSFER, WINDOW, fresh_volume, state_of
from fresh_python import run_python
from strategies import random_vdi

import pyvista_vdi as pvdi

#: Seconds after which a process counts as one that hangs.
PATIENCE = 600

SUPPORT = str(Path(__file__).parents[1] / "support")


#: What every program begins with.
HEAD = f"""
import multiprocessing, sys, warnings
sys.path.insert(0, {SUPPORT!r})
warnings.simplefilter("ignore", DeprecationWarning)  # Python's of forks
import numpy as np
import pyvista_vdi as pvdi
from faulty_driver import CAMERA, TRANSFER, WINDOW, fresh_volume
from pyvista_vdi.device import get_runtime
from drawing import generate_vdi
fork = multiprocessing.get_context("fork")
"""


def finished(code, *arguments):
    """Run code in a new process, which must end; its output."""
    done = run_python(HEAD + code, *arguments)
    assert done.returncode == 0, f"{done.returncode}: {done.stdout}{done.stderr}"
    return done.stdout


def test_one_vdi_drawn_by_many_threads(runtime):
    """The first frames race to put it on the device; it goes there once."""
    views = [CAMERA.azimuth(angle) for angle in range(0, 160, 20)]
    vdi = generate_vdi(fresh_volume(), CAMERA, WINDOW, TRANSFER, device=runtime)
    expected = [render_vdi(vdi, view, device=runtime) for view in views]
    del vdi
    before = state_of(runtime)
    shared = generate_vdi(fresh_volume(), CAMERA, WINDOW, TRANSFER, device=runtime)
    barrier = threading.Barrier(len(views))

    def draw(view, vdi=shared):
        barrier.wait()
        return [render_vdi(vdi, view, device=runtime) for _ in range(5)]

    with ThreadPoolExecutor(len(views)) as pool:
        for images, image in zip(pool.map(draw, views), expected, strict=True):
            for drawn in images:
                np.testing.assert_array_equal(drawn, image)

    def media(state):
        return [name for name, _ in state[0]].count("supersegment media")

    assert media(state_of(runtime)) == 1 + media(before)
    del shared, draw
    assert state_of(runtime) == before


# -- forks -----------------------------------------------------------------------------------------

FORK = """
import gc, os
from pyvista_vdi.device import list_devices
from pyvista_vdi.model.host_memory import aligned_empty
from drawing import render_vdi

runtime = get_runtime(sys.argv[1])
volume = fresh_volume()
vdi = generate_vdi(volume, CAMERA, WINDOW, TRANSFER, device=runtime)
image = render_vdi(vdi, CAMERA, device=runtime)
in_place = runtime.upload(aligned_empty((256, 256), np.float32))

def child():
    said = []
    for use in (
        lambda: render_vdi(vdi, CAMERA, device=runtime),
        lambda: pvdi.render(vdi, CAMERA),
        lambda: generate_vdi(volume, CAMERA, WINDOW, TRANSFER, device=runtime),
        list_devices,
        lambda: runtime.buffer((4,)),
        runtime.finish,
    ):
        try:
            use()
        except pvdi.DeviceError as error:
            said.append(str(error))
    assert len(said) == 6 and len(set(said)) == 1, said
    assert "forked" in said[0] and "spawn" in said[0], said
    # Files need no driver
    vdi.save(sys.argv[2])
    assert pvdi.read(sys.argv[2]).equals(vdi)
    # What was on the device goes without waiting for it
    for name in ("vdi", "volume", "in_place"):
        globals().pop(name)
    gc.collect()

for _ in range(2):
    process = fork.Process(target=child)
    process.start()
    process.join(600)
    assert process.exitcode == 0, process.exitcode
number = os.fork()
if number == 0:
    child()
    sys.exit(0)  # what Python does at exit does not hang either
assert os.waitpid(number, 0)[1] == 0
assert np.array_equal(render_vdi(vdi, CAMERA, device=runtime), image)
print("well")
"""

FORK_BEFORE = """
def child(queue):
    runtime = get_runtime(sys.argv[1])
    queue.put(generate_vdi(fresh_volume(), CAMERA, WINDOW, TRANSFER, device=runtime))

queue = fork.Queue()
process = fork.Process(target=child, args=(queue,))
process.start()
made = queue.get(timeout=600)
process.join(600)
assert process.exitcode == 0
assert made.n_supersegments > 0
print("well")
"""

forks = pytest.mark.skipif(not hasattr(os, "fork"), reason="forks")


@forks
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_fork_of_a_process_that_used_a_device(runtime, tmp_path):
    """A clear error at once: drivers' threads do not follow, and PoCL would wait for them."""
    assert finished(FORK, runtime.info.selector, str(tmp_path / "a.vdi")) == "well\n"


@forks
def test_a_fork_before_a_device_is_used(runtime):
    assert finished(FORK_BEFORE, runtime.info.selector) == "well\n"


SPAWN = """
import multiprocessing, sys
import pyvista_vdi as pvdi
def draw(angle):
    vdi = pvdi.read(sys.argv[1])
    return pvdi.render(vdi, vdi.camera.azimuth(angle)).sum()
if __name__ == "__main__":
    here = draw(5)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.map(draw, [5]) == [here]
    print("the same")
"""


def test_spawned_processes_draw_and_take_vdis(default_runtime, tmp_path):
    """What the message recommends; VDIs go there by pickling, to the last bit."""
    vdi = random_vdi(np.random.default_rng(2))
    back = pickle.loads(pickle.dumps(vdi))
    assert isinstance(back, pvdi.VDI)
    assert back.equals(vdi)
    (tmp_path / "work.py").write_text(SPAWN)
    program = [sys.executable, str(tmp_path / "work.py"), str(vdi.save(tmp_path / "a.vdi"))]
    done = subprocess.run(program, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert (done.returncode, done.stdout) == (0, "the same\n"), done.stderr
