"""The editor of transfer functions: what mouse, keys and program do, and whose events they are."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError, InvalidArgumentTypeError, UnsupportedError
from pyvista_vdi.plotting.add_transfer_function_editor import rows_of

pytestmark = pytest.mark.gl

WINDOW = (300, 240)

BARE = {"show_scalar_bar": False}

CMAPS = ["gray", "bone", "mri-brain"]

#: A curve of few points.
POINTS = np.array([[0.0, 0.0], [100.0, 0.2], [200.0, 0.8]])


class Hand:
    """Mouse and keys over a plotter's editor."""

    def __init__(self, plotter, editor):
        self.interactor, self.editor = plotter.iren.interactor, editor

    def pixel(self, value, opacity):
        """Where the window shows a value and an opacity."""
        chart = next(c for c in self.editor.renderer.get_charts())
        low, high = np.array([chart.GetPoint1(), chart.GetPoint2()])
        (x0, x1), (y0, y1) = chart.x_axis.range, chart.y_axis.range
        share = (value - x0) / (x1 - x0), (opacity - y0) / (y1 - y0)
        return low + share * (high - low) + self.editor.renderer.GetOrigin()

    def send(self, event, place, key=None):
        x, y = (round(float(each)) for each in place)
        self.interactor.SetEventInformation(x, y, 0, 0, chr(0), 0, key)
        self.interactor.InvokeEvent(f"{event}Event")

    def drag(self, begin, *places, button="Left"):
        """Press, move and release, at pixels."""
        self.send(f"{button}ButtonPress", begin)
        for place in places:
            self.send("MouseMove", place)
        self.send(f"{button}ButtonRelease", places[-1] if places else begin)

    def key(self, name, place=None):
        place = self.pixel(150, 0.9) if place is None else place
        self.send("KeyPress", place, name)
        self.send("Char", place, name)


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
    editor = plotter.add_transfer_function_editor(actor, cmap=CMAPS, size=(0.8, 0.6))
    plotter.show(auto_close=False)
    editor.points = POINTS
    return plotter, actor, editor, Hand(plotter, editor)


def test_points_are_moved_added_and_deleted_and_the_picture_follows(edited):
    plotter, actor, editor, hand = edited
    camera, before = plotter.camera_position, picture(plotter)
    hand.drag(hand.pixel(100, 0.2), hand.pixel(80, 0.4), hand.pixel(60, 0.6))
    assert functions(actor)[0][:, :2] == pytest.approx(editor.points)
    assert editor.points[1] == pytest.approx([60, 0.6], abs=1.5)  # a pixel
    assert editor.points[[0, 2]] == pytest.approx(POINTS[[0, 2]])
    assert plotter.camera_position == camera
    assert np.abs(picture(plotter) - before).mean() > 1
    hand.drag(hand.pixel(150, 0.5))
    assert editor.points[2] == pytest.approx([150, 0.5], abs=1.5)
    assert functions(actor)[0][:, :2] == pytest.approx(editor.points)
    hand.drag(hand.pixel(150, 0.5), hand.pixel(900, 3.0))  # onto its neighbour: they become one
    assert editor.points == pytest.approx(functions(actor)[0][:, :2])
    assert len(editor.points) == 3
    hand.drag(hand.pixel(60, 0.6), button="Right")
    assert len(editor.points) == len(functions(actor)[0]) == 2
    # Without the editor the picture is that of the same functions
    editor.remove()
    plotter.render()
    shown = picture(plotter)
    actor.GetProperty().GetScalarOpacity().Modified()
    plotter.render()
    np.testing.assert_array_equal(picture(plotter), shown)


@pytest.mark.parametrize(("by", "stretched"), [((40, 0), False), ((0, 40), True)])
def test_a_drag_with_the_right_button_sets_level_and_window(edited, by, stretched):
    plotter, actor, editor, hand = edited
    before, begin = functions(actor), hand.pixel(30, 0.9)
    camera = plotter.camera_position
    hand.drag(begin, begin + np.divide(by, 2), begin + by, button="Right")
    low, high = editor.clim
    stretch, shift = (high - low) / 200, (low + high) / 2 - 100
    assert (stretch > 1.01, shift > 1) == (stretched, not stretched)
    for old, new in zip(before, functions(actor), strict=True):
        assert new[:, 0] == pytest.approx(100 + shift + (old[:, 0] - 100) * stretch)
        assert new[:, 1:] == pytest.approx(old[:, 1:])
    assert actor.mapper.lookup_table.scalar_range == pytest.approx(editor.clim)  # of scalar bars
    assert plotter.camera_position == camera


def test_keys_take_colour_maps_and_presets_and_what_is_elsewhere_is_the_plotter_s(edited):
    plotter, actor, editor, hand = edited
    opacity, _ = functions(actor)
    pressed = []
    for key in ("c", "m"):
        plotter.add_key_event(key, lambda key=key: pressed.append(key))
    for name in (*CMAPS, *CMAPS[:1]):
        if name == "mri-brain":
            np.testing.assert_array_equal(functions(actor)[0], opacity)
        hand.key("c")
        judge = pv.LookupTable(name) if name != "mri-brain" else None
        if judge is not None:
            want = rows_of(judge.to_color_tf())
            assert functions(actor)[1][:, 1:4] == pytest.approx(want[:, 1:4], abs=1 / 255)
            continue
        other = pv.Plotter().add_vdi(soft_ball(), cmap=name, **BARE)
        for got, want in zip(functions(actor), functions(other), strict=True):
            assert got[:, 1:] == pytest.approx(want[:, 1:])  # over the values that there are
    hand.key("m")  # which the editor has no use for
    hand.key("c", (5, 5))
    assert pressed == ["m", "c"]
    camera, points = plotter.camera_position, editor.points
    hand.drag((20, 20), (30, 25), (60, 50))
    assert plotter.camera_position != camera
    camera = plotter.camera_position
    plotter.renderer.get_charts()[0].visible = False
    hand.drag(hand.pixel(100, 0.2), hand.pixel(80, 0.4), hand.pixel(60, 0.6))
    assert plotter.camera_position != camera
    np.testing.assert_array_equal(editor.points, points)


def test_changes_from_elsewhere_are_shown(plotter):
    actor = plotter.add_volume(soft_ball(), **LOOKS)
    editor = plotter.add_transfer_function_editor(actor)
    plotter.show(auto_close=False)
    assert len(editor.points) == 32  # of 256, as PyVista makes them
    table = pv.LookupTable("viridis", scalar_range=(50, 90))
    table.apply_opacity([0.0, 1.0])
    actor.prop.apply_lookup_table(table)
    plotter.render()
    assert editor.clim == (50, 90)
    assert editor.points[[0, -1]] == pytest.approx(np.array([[50, 0], [90, 0.998]]), abs=0.01)
    prop = pv.VolumeProperty()
    prop.SetColor(table.to_color_tf())
    prop.GetScalarOpacity().RemoveAllPoints()
    prop.GetScalarOpacity().AddPoint(60, 0.4)
    prop.GetScalarOpacity().AddPoint(80, 0.5)
    actor.prop = prop
    plotter.render()
    assert editor.points.tolist() == [[60, 0.4], [80, 0.5]]
    # Grey, as VTK's properties are at first
    prop.SetColor(prop.GetScalarOpacity())
    plotter.render()
    editor.clim = (0, 100)
    assert prop.GetColorChannels() == 3
    assert editor.points.tolist() == [[0, 0.4], [100, 0.5]]


def test_each_plot_s_editors_have_the_events_of_its_viewport():
    plotter = pv.Plotter(shape=(1, 2), window_size=(600, 240))
    editors, actors = [], []
    for column, add in enumerate(("add_volume", "add_vdi")):
        plotter.subplot(0, column)
        actors.append(getattr(plotter, add)(soft_ball(), **LOOKS))
    for actor in actors:  # whichever plot is active
        editors.append(plotter.add_transfer_function_editor(actor, size=(0.8, 0.6)))
    plotter.show(auto_close=False)
    for editor, renderer in zip(editors, plotter.renderers, strict=True):
        assert editor.renderer is renderer
        editor.points = POINTS
    hands = [Hand(plotter, editor) for editor in editors]
    hands[1].drag(hands[1].pixel(100, 0.2), hands[1].pixel(60, 0.6))
    assert editors[0].points == pytest.approx(POINTS)
    assert editors[1].points[1] == pytest.approx([60, 0.6], abs=1.5)
    cameras = [each.camera.position for each in plotter.renderers]
    hands[0].drag((20, 20), (40, 30), (60, 60))
    now = [each.camera.position for each in plotter.renderers]
    assert now[0] != cameras[0]
    assert now[1] == cameras[1]
    plotter.close()


@pytest.mark.parametrize("add", ["add_volume", "add_vdi"])
def test_it_goes_by_name_or_with_its_actor_and_nothing_stays(add, no_leaks):
    plotter = pv.Plotter(window_size=WINDOW)
    actors = [getattr(plotter, add)(soft_ball(8), name=name, **LOOKS) for name in "abc"]
    editors = [plotter.add_transfer_function_editor(actor) for actor in actors]
    again = plotter.add_transfer_function_editor(actors[2])
    assert editors[2].renderer is None
    places = [chart.loc[1] for chart in plotter.renderer.get_charts()]
    assert places == pytest.approx([0.65, 0.32, 0])  # one below the other
    plotter.show(auto_close=False)
    plotter.remove_actor("a")
    assert editors[0].renderer is None
    plotter.add_transfer_function_editor.remove(actors[1])
    assert editors[1].renderer is None
    hand = Hand(plotter, again)
    place = hand.pixel(50, 0.9)
    plotter.add_transfer_function_editor.remove()
    assert plotter.renderer.get_charts() == []
    camera = plotter.camera_position
    hand.drag(place, place + 20, place + 40)
    assert plotter.camera_position != camera
    last = plotter.add_transfer_function_editor(actors[1])
    plotter.clear()
    plotter.render()
    assert last.renderer is None
    del actors
    with pytest.raises(InvalidArgumentError, match="the actor is gone"):
        editors[0].clim = (0, 3)
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
            plotter.add_transfer_function_editor(actor, size=(0.4, 0.2))
            x, y = bars(plotter)
            assert (x[0], x[-1], len(x)) == want
            assert scalars == "real" or (y == 1).all()  # a bar for each whole number
    kept = deferred(plotter)
    plotter.add_transfer_function_editor(plotter.add_vdi(kept, cmap="bone", **BARE))
    x, y = bars(plotter)
    assert (x[0], x[-1], len(x)) == (0, 200, 512)


def test_what_has_no_transfer_function_is_refused_by_name(plotter):
    ball = soft_ball(8)
    edit = plotter.add_transfer_function_editor
    vdi = pvdi.generate(ball, pvdi.Camera((0, 0, 5), (0, 0, 0), (0, 1, 0)), (8, 8))
    with pytest.raises(UnsupportedError, match="a VDI without its volume"):
        edit(plotter.add_vdi(vdi, **BARE))
    actor = plotter.add_volume(ball, **BARE)
    with pytest.raises(InvalidArgumentError, match="did you mean 'bone'"):
        edit(actor, cmap=["bones"])
    with pytest.raises(InvalidArgumentTypeError, match="one of them where that is a list"):
        edit([actor])
    with pytest.raises(InvalidArgumentError, match="not in this plotter"):
        pv.Plotter().add_transfer_function_editor(actor)
    rgba = ball.copy()
    rgba["v"] = np.zeros((ball.n_points, 4), np.uint8)
    with pytest.raises(UnsupportedError, match="RGBA"):
        edit(plotter.add_volume(rgba, **BARE))
    assert plotter.renderer.get_charts() == []
    editor = edit(actor, cmap="bone")
    for points in ([1, 2], [[1, 0], [1, 1]], [[0, 2]], [[0, np.nan]]):
        with pytest.raises(InvalidArgumentError, match="pairs of a value and an opacity"):
            editor.points = points
    with pytest.raises(InvalidArgumentError, match="the smaller first"):
        editor.clim = (3, 3)
    with pytest.raises(InvalidArgumentError, match="mean 'ct-bone'"):
        editor.apply_cmap("ct-bones")
