"""``add_vdi`` of plotters whose classes hide ``BasePlotter.__getattr__``, as pyvistaqt's do."""

from __future__ import annotations

import pytest
from fresh_python import run_python

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
