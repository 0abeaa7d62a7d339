"""``pyvista.Volume`` and its mapper, method by method: as with add_volume, or refused by name."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

from pyvista_vdi.errors import UnsupportedError, VDIError
from pyvista_vdi.vtk_pipeline.vtk import vtkPlane

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


def show_copy(plotter, actor, **options):
    copied = actor.copy(**options)
    plotter.remove_actor(actor)
    plotter.add_actor(copied)
    copied.mapper.SetSampleDistance(actor.mapper.GetSampleDistance())  # PyVista's copies lose it


def own_table(actor):
    actor.mapper.lookup_table = made = table()
    actor.prop.apply_lookup_table(made)
    return made


def rows(values):
    return [float(f"{value:.6g}") for value in values]


#: What is done with a plotter (p) and an actor (a), whose pictures are compared afterwards.
CHANGES = {
    "nothing": lambda p, a: None,
    "dataset: active array by name": lambda p, a: setattr(
        a.mapper.dataset, "active_scalars_name", "w"
    ),
    "dataset: set_active_scalars": lambda p, a: a.mapper.dataset.set_active_scalars("w"),
    "dataset: values": lambda p, a: a.mapper.dataset.__setitem__("v", np.linspace(0, 255, N**3)),
    "dataset: another array": lambda p, a: a.mapper.dataset.__setitem__("u", np.zeros(N**3)),
    "dataset: spacing": lambda p, a: setattr(a.mapper.dataset, "spacing", (0.2, 0.1, 0.2)),
    "dataset: origin": lambda p, a: setattr(a.mapper.dataset, "origin", (0.5, 0.1, 0.2)),
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
    "blend_mode": lambda p, a: setattr(a.mapper, "blend_mode", "composite"),
    "update": lambda p, a: a.mapper.update(),
    "prop: apply_lookup_table": lambda p, a: keeping(table(), a.prop.apply_lookup_table),
    "prop: reapply_lookup_table": lambda p, a: a.prop.reapply_lookup_table(),
    "prop: shade": lambda p, a: setattr(a.prop, "shade", True),
    "prop: interpolation_type": lambda p, a: setattr(a.prop, "interpolation_type", "linear"),
    "prop: opacity_unit_distance": lambda p, a: setattr(a.prop, "opacity_unit_distance", 0.05),
    "prop: another": lambda p, a: keeping(
        table(), lambda made: setattr(a, "prop", pv.VolumeProperty(lookup_table=made))
    ),
    "prop: copy": lambda p, a: setattr(a, "prop", a.prop.copy()),
    "copy": show_copy,
    "shallow copy": lambda p, a: show_copy(p, a, deep=False),
    "visibility": lambda p, a: setattr(a, "visibility", False),
    "position": lambda p, a: setattr(a, "position", (0.5, 0.2, 0)),
    "scale": lambda p, a: setattr(a, "scale", (1, 0.5, 1)),
    "orientation": lambda p, a: setattr(a, "orientation", (20, 30, 0)),
    "user_matrix": lambda p, a: setattr(a, "user_matrix", np.diag([1, 0.5, 1, 1.0])),
    "AddClippingPlane": lambda p, a: keeping(vtkPlane(), a.mapper.AddClippingPlane) and None,
    "SetFinalColorWindow": lambda p, a: a.mapper.SetFinalColorWindow(0.5),
    "SetFinalColorLevel": lambda p, a: a.mapper.SetFinalColorLevel(0.2),
}

#: What it says, compared as it is.
VALUES = {
    "dataset": lambda p, a: (type(a.mapper.dataset), a.mapper.dataset.active_scalars_name),
    "GetInput": lambda p, a: a.mapper.GetInput().GetDimensions(),
    "GetDataSetInput": lambda p, a: a.mapper.GetDataSetInput().GetDimensions(),
    "GetDataObjectInput": lambda p, a: a.mapper.GetDataObjectInput().GetDimensions(),
    "bounds": lambda p, a: rows([*a.mapper.bounds, *a.bounds]),
    "center": lambda p, a: rows([*a.mapper.center, *a.center, a.length]),
    "scalar_map_mode": lambda p, a: (a.mapper.scalar_map_mode, a.mapper.GetScalarMode()),
    "array_name": lambda p, a: a.mapper.array_name,
    "scalar_range": lambda p, a: rows(a.mapper.scalar_range),
    "table's range": lambda p, a: rows(a.mapper.lookup_table.scalar_range),
    "interpolate_before_map": lambda p, a: a.mapper.interpolate_before_map,
    "blend_mode": lambda p, a: a.mapper.blend_mode,
    "sample distance": lambda p, a: round(a.mapper.GetSampleDistance(), 6),
    "property": lambda p, a: (type(a.prop), a.prop.independent_components, a.prop.ambient),
    "visibility": lambda p, a: a.GetVisibility(),
    "plotter's": lambda p, a: (p.mapper is a.mapper, p.volume is a),
    "a copy's property": lambda p, a: (
        setattr(a.copy().prop, "ambient", 0.7),
        a.prop.ambient,
        setattr(a.copy(deep=False).prop, "ambient", 0.7),
        a.prop.ambient,
    ),
}

#: What a VDI cannot honour, and words of what is said.
REFUSED = {
    "blend_mode": (lambda a: setattr(a.mapper, "blend_mode", "maximum"), "composite blending"),
    "volume's connection": (
        lambda a: a.mapper.SetInputConnection(a.mapper.GetSource().GetInputConnection(0, 0)),
        "is not a VDI.*VDISource",
    ),
    "sample distance": (lambda a: a.mapper.SetSampleDistance(-1.0), "sample_distance.*got -1.0"),
    "mask": (lambda a: a.mapper.SetMaskInput(image()), "set masked voxels"),
    "scattering": (lambda a: a.mapper.SetVolumetricScatteringBlending(0.5), "ambient_occlusion"),
    "another mapper": (
        lambda a: setattr(a, "mapper", pv.plotting.mapper.SmartVolumeMapper()),
        "needs a VDIMapper; got SmartVolumeMapper",
    ),
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


@pytest.mark.parametrize("name", VALUES)
def test_a_value_is_that_of_add_volume(closed, name):
    values = []
    for how in ("add_volume", "add_vdi"):
        shown = Shown(how)
        values.append(VALUES[name](shown.plotter, shown.actor))
        shown.plotter.close()
    assert values[0] == values[1]


@pytest.mark.parametrize("name", REFUSED)
def test_what_a_vdi_cannot_honour_is_refused_by_name(closed, name):
    change, words = REFUSED[name]
    shown = Shown("add_vdi")
    before = shown.picture()
    with pytest.raises(VDIError, match=words):
        change(shown.actor)
    np.testing.assert_array_equal(shown.picture(), before)


def test_a_vdi_without_its_volume_has_no_other_array_and_no_other_steps(plotter):
    actor = plotter.add_vdi(image().vdi.generate(plotter.camera, (8, 6)))
    with pytest.raises(UnsupportedError, match="keeps the steps"):
        actor.mapper.SetSampleDistance(0.1)


@pytest.mark.parametrize("draw", ["vdi", "volume"])
def test_the_user_s_arrays_stay_as_they_are(plotter, draw):
    data = image()

    def state():
        parts = [data.GetPointData(), data.GetCellData(), data.GetFieldData()]
        arrays = [part.GetArray(i) for part in parts for i in range(part.GetNumberOfArrays())]
        times = [thing.GetMTime() for thing in (data, *parts, *arrays)]
        values = [data[name].tobytes() for name in data.array_names]
        return data.active_scalars_name, data.array_names, times, values

    before = state()
    actor = plotter.add_vdi(data, draw=draw)
    plotter.show(auto_close=False)
    actor.mapper.dataset.active_scalars_name = "w"
    actor.mapper.dataset["u"] = np.zeros(N**3)
    plotter.render()
    assert state() == before
