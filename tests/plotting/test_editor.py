"""The editor of transfer functions: what mouse and program do, on volumes of VTK's and of ours."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.plotting.editor import rows_of

pytestmark = pytest.mark.gl

WINDOW = (300, 240)

BARE = {"show_scalar_bar": False}

#: A curve of few points.
POINTS = np.array([[0.0, 0.0], [100.0, 0.2], [200.0, 0.8]])


class Hand:
    """Mouse and keys over a plotter's editor, whose chart has them."""

    def __init__(self, plotter, editor):
        self.interactor, self.editor = plotter.iren.interactor, editor
        self.chart = editor.renderer.get_charts()[-1]
        plotter.set_chart_interaction(self.chart)

    def pixel(self, value, opacity):
        """Where the window shows a value and an opacity."""
        low, high = np.array([self.chart.GetPoint1(), self.chart.GetPoint2()])
        (x0, x1), (y0, y1) = self.chart.x_axis.range, self.chart.y_axis.range
        share = (value - x0) / (x1 - x0), (opacity - y0) / (y1 - y0)
        return low + share * (high - low) + self.editor.renderer.GetOrigin()

    def send(self, event, place, key=None):
        x, y = (round(float(each)) for each in place)
        self.interactor.SetEventInformation(x, y, 0, 0, chr(0), 0, key)
        self.interactor.InvokeEvent(f"{event}Event")

    def drag(self, begin, *places):
        """Press, move and release, at pixels."""
        self.send("LeftButtonPress", begin)
        for place in places:
            self.send("MouseMove", place)
        self.send("LeftButtonRelease", places[-1] if places else begin)


def functions(actor):
    prop = actor.GetProperty()
    return rows_of(prop.GetScalarOpacity()), rows_of(prop.GetRGBTransferFunction())


def picture(plotter):
    return np.asarray(plotter.screenshot(return_img=True))[..., :3].astype(int)


def deferred(plotter):
    plotter.camera_position = [(0, 0, 5), (0, 0, 0), (0, 1, 0)]
    camera = pvdi.Camera.from_any(plotter.camera)
    how = {"classification": "deferred", "value_range": (0, 200)}
    return pvdi.generate(soft_ball(), camera, tuple(plotter.window_size), **how)


@pytest.fixture(params=["add_volume", "add_vdi", "deferred"])
def edited(request, plotter):
    """A plotter, an actor with its editor, and a hand: the same for all of them."""
    look = {**LOOKS, "show_scalar_bar": False, "clim": (0, 200)}
    if request.param == "deferred":
        look = {"cmap": look["cmap"], "opacity": [0, 0.3], "clim": (0, 200), **BARE}
        actor = plotter.add_vdi(deferred(plotter), **look)
    else:
        actor = getattr(plotter, request.param)(soft_ball(), **look)
    editor = plotter.vdi.add_transfer_function_editor(actor, size=(0.8, 0.6), loc=(0.1, 0.3))
    plotter.show(auto_close=False)
    editor.points = POINTS
    return plotter, actor, editor, Hand(plotter, editor)


def test_points_are_moved_added_and_deleted_and_the_picture_follows(edited):
    plotter, actor, editor, hand = edited
    before = picture(plotter)
    hand.drag(hand.pixel(100, 0.2), hand.pixel(80, 0.4), hand.pixel(60, 0.6))
    assert functions(actor)[0][:, :2] == pytest.approx(editor.points)
    assert editor.points[1] == pytest.approx([60, 0.6], abs=1.5)  # a pixel
    assert editor.points[[0, 2]] == pytest.approx(POINTS[[0, 2]])
    assert np.abs(picture(plotter) - before).mean() > 1
    hand.drag(hand.pixel(150, 0.5))
    assert editor.points[2] == pytest.approx([150, 0.5], abs=1.5)
    assert functions(actor)[0][:, :2] == pytest.approx(editor.points)
    hand.send("KeyRelease", hand.pixel(150, 0.5), "Delete")
    assert len(editor.points) == len(functions(actor)[0]) == 3
    # Without the editor the picture is that of the same functions
    editor.remove()
    shown = picture(plotter)
    actor.GetProperty().GetScalarOpacity().Modified()
    np.testing.assert_array_equal(picture(plotter), shown)


@pytest.mark.parametrize("add", ["add_volume", "add_vdi"])
def test_colours_are_those_of_a_map_or_a_preset_and_of_the_scalar_bar(plotter, add):
    actor = getattr(plotter, add)(soft_ball(), **{**LOOKS, "clim": (0, 200)})
    editor = plotter.vdi.add_transfer_function_editor(actor)
    opacity, _ = functions(actor)
    editor.apply_cmap("bone")
    want = rows_of(pv.LookupTable("bone").to_color_tf())
    assert functions(actor)[1][:, 1:4] == pytest.approx(want[:, 1:4], abs=1 / 255)
    np.testing.assert_array_equal(functions(actor)[0], opacity)
    table = actor.mapper.lookup_table
    assert table.values[-1, :3] == pytest.approx(255 * want[-1, 1:4], abs=1)
    editor.apply_cmap("mri-brain")
    other = pv.Plotter().add_vdi(soft_ball(), cmap="mri-brain", **BARE)
    for got, want in zip(functions(actor), functions(other), strict=True):
        assert got[:, 1:] == pytest.approx(want[:, 1:])  # over the values that there are


@pytest.mark.parametrize("add", ["add_volume", "add_vdi"])
def test_it_goes_by_name_or_with_its_actor_and_nothing_stays(add, no_leaks):
    plotter = pv.Plotter(window_size=WINDOW)
    actors = [getattr(plotter, add)(soft_ball(8), name=name, **LOOKS) for name in "abc"]
    editors = [plotter.vdi.add_transfer_function_editor(actor) for actor in actors]
    again = plotter.vdi.add_transfer_function_editor(actors[2])
    assert editors[2].renderer is None
    plotter.show(auto_close=False)
    plotter.remove_actor("a")
    assert editors[0].renderer is None
    editors[1].remove()
    assert len(plotter.renderer.get_charts()) == 1
    plotter.clear()
    plotter.render()
    assert again.renderer is None
    del actors
    with pytest.raises(InvalidArgumentError, match="the actor is gone"):
        editors[0].apply_cmap("bone")
    plotter.close()


def bars(plotter):
    """The corners of the histogram of the last editor."""
    (area,) = plotter.renderer.get_charts()[-1].plots()
    return np.asarray(area.x), np.asarray(area.y1)


def test_the_histogram_counts_what_the_actor_draws(plotter):
    grid = pv.ImageData(dimensions=(5, 5, 5))
    grid["real"] = np.arange(125.0)
    grid["real"][:5] = np.nan
    grid["whole"] = (np.arange(125) % 5).astype(np.int16)
    for add in (plotter.add_volume, plotter.add_vdi):
        for scalars, want in (("real", (5, 124, 512)), ("whole", (0, 4, 10))):
            actor = add(grid.copy(), scalars=scalars, clim=(0, 4), **BARE)
            plotter.vdi.add_transfer_function_editor(actor, size=(0.4, 0.2))
            x, y = bars(plotter)
            assert (x[0], x[-1], len(x)) == want
            assert scalars == "real" or (y == 1).all()  # a bar for each whole number
    kept = deferred(plotter)
    plotter.vdi.add_transfer_function_editor(plotter.add_vdi(kept, cmap="bone", **BARE))
    x, y = bars(plotter)
    assert (x[0], x[-1], len(x)) == (0, 200, 512)
