"""``add_vdi`` of plotters whose classes hide ``BasePlotter.__getattr__``, as pyvistaqt's do."""

from __future__ import annotations

import os
from importlib.util import find_spec

import pytest
from fresh_python import run_python
from virtual_screen import virtual_screen

pytestmark = pytest.mark.gl

#: A class like pyvistaqt's QtInteractor: what is no attribute is asked of the widget alone.
WIDGET = """
import sys
{imports}
assert "pyvista_vdi.plotting.component" not in sys.modules, "loaded before it is needed"
import pyvista as pv

class Widget:
    def __getattr__(self, name):
        raise AttributeError(name)

class WidgetPlotter(Widget, pv.Plotter):
    pass

plotter = WidgetPlotter(off_screen=True, window_size=(40, 30))
assert "add_vdi" in dir(plotter)
actor = plotter.add_vdi(pv.Wavelet(extent=(0, 5, 0, 5, 0, 5)), show_scalar_bar=False)
plotter.show(auto_close=False)
assert actor.vdi.n_supersegments > 0
names = [each.name for each in pv.registered_plotter_components()]
assert names.count("add_vdi") == 1, names
assert plotter.add_vdi is plotter.add_vdi
pv.unregister_plotter_component("add_vdi")
assert not hasattr(pv.Plotter, "add_vdi")
print("all well")
"""


@pytest.mark.parametrize(
    "imports", ["import pyvista_vdi", "import pyvista; pyvista.ImageData().vdi"]
)
def test_any_plotter_has_it_once_the_package_is_imported(imports):
    done = run_python(WIDGET.format(imports=imports))
    assert done.stdout.strip() == "all well", done.stdout + done.stderr


PICTURES = """
import numpy as np
import pyvista_vdi
import pyvistaqt as qt
import pyvista as pv

volume = pv.Wavelet(extent=(-10, 9, -10, 9, -10, 9))
pictures = []
for method in ("add_volume", "add_vdi"):
    plotter = qt.BackgroundPlotter(window_size=(320, 240), auto_update=False, toolbar=False)
    getattr(plotter, method)(volume, cmap="bone", show_scalar_bar=False)
    plotter.camera_position = "xy"
    for _ in range(3):
        plotter.app.processEvents()
        plotter.render()
    pictures.append(plotter.screenshot(return_img=True).astype(int))
    plotter.close()
vtks, ours = pictures
assert np.ptp(vtks) > 150
# Both step by half a voxel, from different places: seen are 17
assert np.abs(vtks - ours).max() < 40, np.abs(vtks - ours).max()
print("all well")
"""


@pytest.mark.slow
def test_pyvistaqt_draws_what_add_volume_draws():
    if find_spec("pyvistaqt") is None or find_spec("qtpy") is None:
        pytest.skip('pyvistaqt is not installed: pip install "pyvista-vdi[qt]"')
    left_out = ("VTK_DEFAULT_OPENGL_WINDOW", "WAYLAND_DISPLAY")
    kept = {name: os.environ.pop(name) for name in left_out if name in os.environ}
    try:
        with virtual_screen() as display:
            done = run_python(
                PICTURES,
                DISPLAY=display,
                QT_QPA_PLATFORM="xcb",
                PYVISTA_OFF_SCREEN="false",
                PYTHONWARNINGS="default",
            )
    finally:
        os.environ.update(kept)
    if "Could not load the Qt platform plugin" in done.stderr:
        pytest.skip(f"Qt lacks libraries of the system: {done.stderr.strip()[:300]}")
    assert done.stdout.strip() == "all well", done.stdout + done.stderr
