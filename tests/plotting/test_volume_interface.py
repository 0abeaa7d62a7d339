"""``pyvista.Volume`` and its mapper, method by method: as with add_volume."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

pytestmark = pytest.mark.gl

N = 12
WINDOW = (80, 60)


def image():
    x = np.linspace(-1, 1, N)
    r = np.sqrt(x[:, None, None] ** 2 + x[None, :, None] ** 2 + x[None, None, :] ** 2)
    grid = pv.ImageData(dimensions=(N, N, N), spacing=(0.2, 0.2, 0.2))
    grid["v"] = (255 * (1 - r / 2) * (0.8 + 0.2 * x)).ravel()
    grid["w"] = (255 * np.abs(x)[:, None, None] * (0.5 + 0.5 * x[None, :, None]) * x**2).ravel()
    grid.cell_data["c"] = np.linspace(0, 255, grid.n_cells)
    grid.set_active_scalars("v")
    return grid


def other_image():
    grid = image()
    grid["v"] = grid["v"][::-1].copy()
    return grid


def table():
    made = pv.LookupTable("bone")
    made.apply_opacity([0, 0.3, 0.6])
    made.scalar_range = (0, 255)
    return made


def keeping(what, use):
    """Do something with an object, and return it: PyVista does not keep it alive."""
    use(what)
    return what


def own_table(actor):
    actor.mapper.lookup_table = made = table()
    actor.prop.apply_lookup_table(made)
    return made


#: What is done with a plotter (p) and an actor (a), whose pictures are compared afterwards.
CHANGES = {
    "nothing": lambda p, a: None,
    "dataset: active array by name": lambda p, a: setattr(
        a.mapper.dataset, "active_scalars_name", "w"
    ),
    "dataset: set_active_scalars": lambda p, a: a.mapper.dataset.set_active_scalars("w"),
    "dataset: values": lambda p, a: a.mapper.dataset.__setitem__("v", np.linspace(0, 255, N**3)),
    "dataset: another array": lambda p, a: a.mapper.dataset.__setitem__("u", np.zeros(N**3)),
    "dataset: another": lambda p, a: setattr(a.mapper, "dataset", other_image()),
    "SetInputData": lambda p, a: a.mapper.SetInputData(other_image()),
    "SetInputDataObject": lambda p, a: a.mapper.SetInputDataObject(0, other_image()),
    "scalar_map_mode=default": lambda p, a: setattr(a.mapper, "scalar_map_mode", "default"),
    "lookup_table: cmap": lambda p, a: setattr(a.mapper.lookup_table, "cmap", "hot"),
    "lookup_table: opacity": lambda p, a: a.mapper.lookup_table.apply_opacity([0, 0.9]),
    "lookup_table: another": lambda p, a: own_table(a),
    "scalar_range": lambda p, a: setattr(a.mapper, "scalar_range", (50, 200)),
    "update_scalar_bar_range": lambda p, a: p.update_scalar_bar_range((50, 200)),
    "interpolate_before_map": lambda p, a: setattr(a.mapper, "interpolate_before_map", True),
    "prop: apply_lookup_table": lambda p, a: keeping(table(), a.prop.apply_lookup_table),
    "prop: reapply_lookup_table": lambda p, a: a.prop.reapply_lookup_table(),
    "prop: another": lambda p, a: keeping(
        table(), lambda made: setattr(a, "prop", pv.VolumeProperty(lookup_table=made))
    ),
    "SetFinalColorWindow": lambda p, a: a.mapper.SetFinalColorWindow(0.5),
    "SetFinalColorLevel": lambda p, a: a.mapper.SetFinalColorLevel(0.2),
}


class Shown:
    """A plotter that shows the image one way, and what it shows after something was done."""

    def __init__(self, how, **more):
        self.data = image()
        self.plotter = pv.Plotter(off_screen=True, window_size=WINDOW)
        self.plotter.render_window.SetMultiSamples(0)
        looks = {"scalars": "v", "opacity": [0, 0.3], "clim": (0, 255), "show_scalar_bar": False}
        own = {"mapper": "gpu"} if how == "add_volume" else {"draw": "volume"}
        self.actor = getattr(self.plotter, how)(self.data, **looks, **own, **more)
        self.actor.mapper.SetSampleDistance(0.01)
        self.plotter.view_isometric()
        self.view = self.plotter.camera_position
        self.plotter.show(auto_close=False)

    def picture(self):
        self.plotter.camera_position = self.view
        self.plotter.render()
        return self.plotter.screenshot(return_img=True).astype(int)


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] * (k % 3 > 0)) for k, name in enumerate(CHANGES)],
)
def test_a_change_is_seen_as_with_add_volume(closed, name):
    pictures = []
    for how in ("add_volume", "add_vdi"):
        shown = Shown(how)
        kept = CHANGES[name](shown.plotter, shown.actor)
        pictures.append(shown.picture())
        shown.plotter.close()
        del kept
    # Seen: up to .28; without what is done 2 and more
    assert np.abs(pictures[0] - pictures[1]).mean() < 0.6
