"""A program that the package is a part of: its threads, its state, and a user without a home."""

from __future__ import annotations

import os
import sys

import pytest
from fresh_python import run_python

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
PLOTTERS = "import pyvista as pv, pyvista_vdi\npv.Plotter"
SAVED = "import tempfile\nvdi, folder = generated(), tempfile.mkdtemp()"

#: What is imported, registered, compiled or kept when it is first used: what is there before, the
#: use, and what it is to give.
FIRST_USES = {
    "names": (
        "import pyvista_vdi as pvdi",
        "all(getattr(pvdi, name) is not None for name in pvdi.__all__)",
    ),
    "names of rooms": (
        "from pyvista_vdi import vtk_pipeline\nfrom pyvista_vdi.extensions import web",
        "[getattr(room, name) for room in (vtk_pipeline, web) for name in room.__all__]",
    ),
    "importing all": ("", "__import__('pyvista_vdi').generate is not None"),
    "importing PyVista": (
        "import pyvista_vdi",
        "__import__('pyvista.plotting').plotting.Plotter.add_vdi is not None",
    ),
    "a plotter's component": (PLOTTERS, "pv.Plotter.add_vdi.__name__"),
    "a component that is less used": (
        PLOTTERS,
        "pv.Plotter(off_screen=True).vdi is not None",
    ),
    "a data set's accessor": (
        PLOTTERS,
        "pv.ImageData().vdi is not None",
    ),
    "add_vdi": (PLOTTERS, "plotted()"),
    "the list of devices": (
        "import pyvista_vdi as pvdi",
        "[device.full_name for device in pvdi.list_devices()]",
    ),
    "a runtime": (
        "from pyvista_vdi.device import get_runtime",
        "id(get_runtime())",
    ),
    "generating": ("import pyvista_vdi as pvdi", "generated().n_supersegments"),
    "one VDI drawn": (
        "import pyvista_vdi as pvdi\nvdi, camera = generated(), scene()[1]",
        "pvdi.render(vdi, camera.azimuth(3)).tobytes()",
    ),
    "one volume drawn": (
        "import pyvista_vdi as pvdi\nvolume, camera, size, looks = scene()",
        "pvdi.render_volume(volume, camera, size, transfer_function=looks).tobytes()",
    ),
    "looks by name": (
        "import pyvista_vdi as pvdi\nvolume, camera, size, _ = scene()",
        "pvdi.generate(volume, camera, size, cmap='bone').n_supersegments",
    ),
    "saved and read": (
        f"import pyvista_vdi as pvdi\n{SAVED}",
        "pvdi.read(vdi.save(f'{folder}/{threading.get_ident()}.vdi')).equals(vdi)",
    ),
    "pages": (
        SAVED,
        "vdi.save(f'{folder}/{threading.get_ident()}.html').stat().st_size",
    ),
}

AT_A_BARRIER = """
start, found = threading.Barrier(8), []

def use():
    start.wait()
    try:
        found.append({use})
    except BaseException as error:
        found.append(f"{{type(error).__name__}}: {{error}}")

threads = [threading.Thread(target=use) for _ in range(8)]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
assert all(each == found[0] for each in found), found
assert "Error" not in str(found[0]), found
print("all well")
"""


@pytest.mark.gl
@pytest.mark.every(4)
@pytest.mark.parametrize("what", FIRST_USES)
def test_eight_threads_use_it_first(what):
    before, use = FIRST_USES[what]
    done = run_python(HEAD + before + AT_A_BARRIER.format(use=use), PYOPENCL_NO_CACHE="1")
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

#: A program's own warnings, given all the time.
WARNED = """
shown, issued, over = [], 0, threading.Event()
warnings.simplefilter("always")
warnings.showwarning = lambda message, *_, **__: shown.append(str(message))
before = state()

def warn():
    global issued
    while not over.is_set():
        warnings.warn(f"mine, {issued}")
        issued += 1
        over.wait(0.002)

warning = threading.Thread(target=warn, daemon=True)  # a job that fails ends the program
warning.start()
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
over.set()
warning.join()
after = state()
changed = [name for name in before if repr(before[name]) != repr(after[name])]
assert not changed, {name: (before[name], after[name]) for name in changed}
mine = sum(each.startswith("mine, ") for each in shown)
assert mine == issued > 20, f"{issued} warnings issued, {mine} shown"
print("all well")
"""


@pytest.mark.gl
def test_nothing_of_the_process_is_changed_and_no_warning_of_its_threads_lost():
    done = run_python(HEAD + STATE + WARNED + JOB + SAME, PYOPENCL_NO_CACHE="1")
    assert done.stdout == "all well\n", done.stdout + done.stderr


#: A container's user, whom the system does not know.
UNKNOWN = """
import os, pwd

def unknown(uid):
    raise KeyError(uid)

pwd.getpwuid = unknown
del os.environ["HOME"], os.environ["XDG_CACHE_HOME"]
"""

HOMELESS = """
import logging
import matplotlib, pyvista  # whose own messages are said by now
logging.basicConfig(format="%(name)s: %(message)s", force=True)
assert plotted() > 0 and generated().n_supersegments > 0
print("all well")
"""


@pytest.mark.gl
@pytest.mark.skipif(sys.platform != "linux", reason="folders and variables of Linux")
@pytest.mark.every(4)
@pytest.mark.parametrize("temporary", [True, False])
@pytest.mark.parametrize("home", ["/proc", "a file", "none"])
def test_without_a_folder_that_can_be_written_it_draws_and_says_so_once(home, temporary, tmp_path):
    variables = {"HOME": home, "XDG_CACHE_HOME": f"{home}/cache", "TMPDIR": str(tmp_path)}
    if home == "a file":  # at the place of each cache
        for name in ("pytools", "pyvista-vdi"):
            (tmp_path / name).touch()
        variables["XDG_CACHE_HOME"] = str(tmp_path)
    head = UNKNOWN if home == "none" else ""
    folder = tmp_path / f"pyvista-vdi-{os.getuid()}"
    if not temporary:
        folder.touch()
    done = run_python(head + HEAD + HOMELESS, MPLCONFIGDIR=str(tmp_path), **variables)
    assert done.stdout == "all well\n", done.stdout + done.stderr
    assert bool(list(folder.glob("programs/*"))) == temporary
    said = [line for line in done.stderr.splitlines() if "cannot be written" in line]
    assert len(said) == 1, done.stderr
    assert said[0].startswith("pyvista_vdi.model.user_cache: the user's cache folder")
    assert "Traceback" not in done.stderr
