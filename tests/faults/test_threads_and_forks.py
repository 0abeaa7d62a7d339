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
from drawing import generate_vdi, raycast_volume, render_vdi
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


def test_threads_that_do_different_things(runtime):
    """Generating, rendering, volume rendering, saving and reading, all at once."""
    volume = fresh_volume()
    made = generate_vdi(volume, CAMERA, WINDOW, TRANSFER, device=runtime)
    image = render_vdi(made, CAMERA.azimuth(30), device=runtime)
    picture = raycast_volume(volume, CAMERA, WINDOW, TRANSFER, device=runtime)

    def generate():
        assert generate_vdi(volume, CAMERA, WINDOW, TRANSFER, device=runtime).equals(made)

    def draw():
        np.testing.assert_array_equal(render_vdi(made, CAMERA.azimuth(30), device=runtime), image)

    def draw_volume():
        drawn = raycast_volume(volume, CAMERA, WINDOW, TRANSFER, device=runtime)
        np.testing.assert_array_equal(drawn, picture)

    with ThreadPoolExecutor(6) as pool:
        for future in [pool.submit(f) for f in (generate, draw, draw_volume) * 10]:
            future.result(PATIENCE)


TWO_PLOTTERS = """
from concurrent.futures import ThreadPoolExecutor
import pyvista as pv
from strategies import random_vdi

vdi = random_vdi(np.random.default_rng(4), max_window=(40, 30))
corners = np.reshape(vdi.bounds, (3, 2))
centre, size = corners.mean(axis=1), np.ptp(corners, axis=1).max()

def pictures(first):
    plotter = pv.Plotter(window_size=(120, 90), off_screen=True)
    plotter.add_vdi(vdi, regenerate="never", show_scalar_bar=False)
    shown = []
    for angle in np.radians(np.arange(first, first + 120, 10)):
        eye = centre + 3 * size * np.array([np.cos(angle), np.sin(angle), 0.3])
        plotter.camera_position = (tuple(eye), tuple(centre), (0, 0, 1))
        shown.append(plotter.screenshot(return_img=True))
    plotter.close()
    return shown

alone = [pictures(0), pictures(90)]
assert len(np.unique(alone[0][0])) > 10
with ThreadPoolExecutor(2) as pool:
    together = list(pool.map(pictures, (0, 90)))
assert np.array_equal(alone, together)
print("the same")
"""


@pytest.mark.slow
def test_two_plotters_in_two_threads(default_runtime):
    """Each thread makes, uses and closes its own window; the VDI is shared."""
    pytest.importorskip("pyvista")
    assert finished(TWO_PLOTTERS) == "the same\n"


MANY_VDIS = """
import gc, threading
import pyvista as pv
from pyvista_vdi.vtk_pipeline.vtk import vtkAssembly, vtkObjectBase

def grid(number):
    grid = pv.ImageData(dimensions=(6, 6, 6), origin=(0.4 * number, 0.3 * number, 0))
    grid["v"] = np.arange(216, dtype=np.uint8)
    return grid

def scene(columns):
    # No actor is kept here, nor by PyVista but for the one added last
    plotter = pv.Plotter(shape=(1, columns), off_screen=True, window_size=(60, 45))
    for number in range(8):
        plotter.subplot(0, number % columns)
        plotter.add_vdi(grid(number), name=str(number), show_scalar_bar=False)
    assembly = vtkAssembly()
    assembly.AddPart(plotter.add_vdi(grid(8), name="8", show_scalar_bar=False))
    plotter.remove_actor("8")
    plotter.add_actor(assembly)
    plotter.volume = None
    plotter.show(auto_close=False)
    for number in range(4):
        plotter.camera.azimuth += 5
        plotter.render()
        plotter.remove_actor(str(number))
    plotter.clear()
    plotter.add_vdi(grid(0), show_scalar_bar=False)
    plotter.render()
    plotter.close()

def alive():
    gc.collect()
    return sum(issubclass(type(each), vtkObjectBase) for each in gc.get_objects())

def collect():
    while not ended.wait(0.05):
        gc.collect()

scene(1)
before, ended = alive(), threading.Event()
collector = threading.Thread(target=collect, daemon=True)
collector.start()
gc.set_threshold(1, 1, 1)
for turn in range(int(sys.argv[1])):
    scene(1 + turn % 2)
ended.set()
collector.join()
assert alive() <= before
print("nothing is left")
"""


@pytest.mark.parametrize("turns", [2, pytest.param(30, marks=pytest.mark.slow)])
def test_many_vdis_while_python_collects(default_runtime, turns):
    """At any allocation, and in another thread: VTK is asked for nothing within a collection."""
    pytest.importorskip("pyvista")
    assert finished(MANY_VDIS, str(turns)) == "nothing is left\n"


# -- forks -----------------------------------------------------------------------------------------

FORK = """
import gc, os
from pyvista_vdi.device import aligned_empty, list_devices
from drawing import render_vdi

runtime = get_runtime(sys.argv[1])
volume = fresh_volume()
vdi = generate_vdi(volume, CAMERA, WINDOW, TRANSFER, device=runtime)
image = render_vdi(vdi, CAMERA, device=runtime)
in_place = runtime.upload(aligned_empty((64, 64), np.float32))

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
