"""A program that the package is a part of: its threads, its state, and a user without a home."""

from __future__ import annotations

import sys

import pytest
from fresh_python import run_python

import pyvista_vdi as pvdi

#: What programs here begin with.
HEAD = """
import sys, threading
import numpy as np

values = np.random.default_rng(0).random((12, 12, 12), dtype=np.float32)
ramp = np.linspace(0, 1, 8)

def scene():
    import pyvista_vdi as pvdi
    looks = pvdi.TransferFunction(np.stack([ramp] * 3, axis=1), 0.2 * ramp, (0, 1))
    return pvdi.Volume(values), pvdi.Camera((5, -40, 20), (5, 5, 5), (0, 0, 1)), (24, 16), looks

def generated():
    import pyvista_vdi as pvdi
    volume, camera, size, looks = scene()
    return pvdi.generate(volume, camera, size, transfer_function=looks)

def plotted():
    import pyvista as pv
    plotter = pv.Plotter(off_screen=True, window_size=(24, 16))
    plotter.add_vdi(values, show_scalar_bar=False)
    picture = plotter.screenshot(None, return_img=True)
    plotter.close()
    return picture.mean()
"""


#: After PyVista's own lazy import, during which pv.Plotter fails in other threads.
AT_A_BARRIER = """
import pyvista as pv, pyvista_vdi
pv.Plotter
start, found = threading.Barrier(8), []

def use():
    start.wait()
    try:
        found.append(plotted())
    except BaseException as error:
        found.append(f"{type(error).__name__}: {error}")

threads = [threading.Thread(target=use) for _ in range(8)]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
assert all(each == found[0] for each in found), found
assert "Error" not in str(found[0]), found
print("all well")
"""


@pytest.mark.gl
def test_eight_threads_use_it_first():
    done = run_python(HEAD + AT_A_BARRIER, PYOPENCL_NO_CACHE="1")
    assert done.stdout == "all well\n", done.stdout + done.stderr


#: All that a process has once, and that this package has no business with. Libraries that change
#: some of it are imported before: PYOPENCL_HOME is pyopencl's, and SciPy and numcodecs add filters.
STATE = """
import locale, logging, os, random, signal, warnings
import matplotlib, numcodecs, pyopencl, pyvista as pv, scipy.special, skimage.metrics, tqdm
import numpy as np

pv.Plotter(off_screen=True).add_volume(np.zeros((3, 3, 3)))
loggers = [logging.getLogger(name) for name in (None, *logging.root.manager.loggerDict)]

def state():
    return {
        "warnings filters": list(warnings.filters),
        "how warnings are shown": (warnings.showwarning, warnings.formatwarning),
        "signal handlers": [signal.getsignal(each) for each in sorted(signal.valid_signals())],
        "environment": dict(os.environ),
        "NumPy's errors": np.geterr(),
        "NumPy's printing": np.get_printoptions(),
        "random numbers": (random.getstate(), repr(np.random.get_state())),
        "logging": (logging.root.manager.disable, [
            (each.name, each.level, each.handlers, each.disabled) for each in loggers
        ]),
        "locale": locale.setlocale(locale.LC_ALL),
        "folder": os.getcwd(),
        "matplotlib": dict(matplotlib.rcParams),
        "theme": pv.global_theme.to_dict(),
        "hooks": (sys.excepthook, sys.unraisablehook, sys.displayhook, threading.excepthook),
        "switches": (sys.getrecursionlimit(), sys.getswitchinterval(), sys.getdlopenflags()),
        "tracing": (sys.gettrace(), sys.getprofile()),
        "streams": (sys.stdout, sys.stderr, sys.stdin),
        "importing": sys.path[:],
    }

before = state()
"""

#: What most programs do.
JOB = """
import pyvista_vdi as pvdi, pathlib, tempfile

vdi, camera = generated(), scene()[1]
picture = pvdi.render(vdi, camera.azimuth(5))
volume, _, size, looks = scene()
exact = pvdi.render_volume(volume, camera.azimuth(5), size, transfer_function=looks)
pvdi.compare_images(picture, exact)
plotted()
grid = pv.wrap(values)
grid.vdi.generate(camera, size, cmap="bone")
folder = pathlib.Path(tempfile.mkdtemp())
vdi.save(folder / "a.vdi")
assert pvdi.read(folder / "a.vdi").equals(vdi)
grid.save(folder / "grid.vti")
(folder / "broken.vtk").write_text("nothing of VTK's")
assert pvdi.read_volume(folder / "grid.vti").array.size == grid.n_points
try:
    pvdi.read_volume(folder / "broken.vtk")
except pvdi.InvalidVolumeError:
    pass
"""

SAME = """
after = state()
changed = [name for name in before if repr(before[name]) != repr(after[name])]
assert not changed, {name: (before[name], after[name]) for name in changed}
print("all well")
"""


@pytest.mark.gl
def test_nothing_of_the_process_is_changed():
    # VTK 9.4 sets the locale to C
    done = run_python(HEAD + STATE + JOB + SAME, PYOPENCL_NO_CACHE="1", LC_ALL="C")
    assert done.stdout == "all well\n", done.stdout + done.stderr


HOMELESS = """
import logging
import matplotlib, pyvista, pyvista_vdi as pvdi  # whose own messages are said by now
logging.basicConfig(format="%(name)s: %(message)s", force=True)
assert plotted() > 0 and generated().n_supersegments > 0
print(*[info.full_name for info in pvdi.list_devices()], sep="\\n")
"""


@pytest.mark.gl
@pytest.mark.skipif(sys.platform != "linux", reason="folders and variables of Linux")
def test_without_a_folder_that_can_be_written_it_draws_and_says_so_once(tmp_path):
    variables = {"HOME": "/proc", "XDG_CACHE_HOME": "/proc/cache", "TMPDIR": str(tmp_path)}
    done = run_python(HEAD + HOMELESS, MPLCONFIGDIR=str(tmp_path), **variables)
    assert done.stdout.splitlines() == [info.full_name for info in pvdi.list_devices()]
    said = [line for line in done.stderr.splitlines() if "cannot be written" in line]
    assert len(said) == 1, done.stderr
    assert said[0].startswith("pyvista_vdi.model.user_cache: the user's cache folder")
    assert "Traceback" not in done.stderr
