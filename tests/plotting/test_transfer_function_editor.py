"""The editor of transfer functions: what mouse, keys and program do, and whose events they are."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError, InvalidArgumentTypeError, UnsupportedError
from pyvista_vdi.plotting.add_transfer_function_editor import _lengths
from pyvista_vdi.plotting.edited_property import rows_of, simplified
from pyvista_vdi.vtk_pipeline.vtk import vtkVolume

pytestmark = pytest.mark.gl

WINDOW = (300, 240)

#: A curve of few points.
POINTS = np.array([[0.0, 0.0], [100.0, 0.2], [200.0, 0.8]])


class Hand:
    """Mouse and keys over a plotter's editor."""

    def __init__(self, plotter, editor):
        self.interactor, self.editor = plotter.iren.interactor, editor

    def pixel(self, value, opacity):
        """Where the window shows a value and an opacity."""
        at = self.editor._pixels(np.array([[value, opacity]]))[0]
        return at + self.editor.renderer.GetOrigin()

    def send(self, event, place, *, repeat=0, key=None):
        x, y = (round(float(each)) for each in place)
        self.interactor.SetEventInformation(x, y, 0, 0, chr(0), repeat, key)
        self.interactor.InvokeEvent(f"{event}Event")

    def drag(self, begin, *places, button="Left", repeat=0):
        """Press, move and release, at pixels."""
        self.send(f"{button}ButtonPress", begin, repeat=repeat)
        for place in places:
            self.send("MouseMove", place)
        self.send(f"{button}ButtonRelease", places[-1] if places else begin)

    def key(self, name, place=None):
        self.send("KeyPress", self.pixel(150, 0.9) if place is None else place, key=name)
        self.send("Char", self.pixel(150, 0.9) if place is None else place, key=name)


def functions(actor):
    prop = actor.prop
    return rows_of(prop.GetScalarOpacity()), rows_of(prop.GetRGBTransferFunction())


def picture(plotter):
    return np.asarray(plotter.screenshot(return_img=True))[..., :3].astype(int)


@pytest.fixture(params=["add_volume", "add_vdi"])
def edited(request, plotter):
    """A plotter, an actor with its editor, and a hand."""
    add = getattr(plotter, request.param)
    actor = add(soft_ball(), **{**LOOKS, "show_scalar_bar": True, "clim": (0, 200)})
    editor = plotter.add_transfer_function_editor(actor, size=(0.8, 0.6))
    plotter.show(auto_close=False)
    editor.points = POINTS
    return plotter, actor, editor, Hand(plotter, editor)


def assert_drawn_as_set(plotter, actor, editor):
    """Without the editor the picture is that of another plotter with the same functions."""
    camera, (opacity, colors) = plotter.camera_position, functions(actor)
    plotter.remove_transfer_function_editor(editor)
    other = pv.Plotter(window_size=WINDOW)
    add = other.add_vdi if "VDI" in type(actor).__name__ else other.add_volume
    judge = add(soft_ball(), **{**LOOKS, "show_scalar_bar": True, "clim": (0, 200)})
    for function, rows in zip(
        (judge.prop.GetScalarOpacity(), judge.prop.GetRGBTransferFunction()),
        (opacity, colors),
        strict=True,
    ):
        function.RemoveAllPoints()
        for row in rows:
            (function.AddRGBPoint if len(row) == 6 else function.AddPoint)(*row)
    judge.mapper.lookup_table.scalar_range = actor.mapper.lookup_table.scalar_range
    judge.prop.SetScalarOpacity(actor.prop.GetScalarOpacity())
    judge.prop.SetColor(actor.prop.GetRGBTransferFunction())
    other.camera_position = camera
    other.show(auto_close=False)
    top = slice(0, WINDOW[1] * 3 // 4)  # above the scalar bars, whose tables are bytes
    np.testing.assert_array_equal(picture(plotter)[top], picture(other)[top])
    other.close()


def test_a_dragged_point_is_the_function_s_and_the_picture_follows(edited):
    plotter, actor, editor, hand = edited
    camera, before = plotter.camera_position, picture(plotter)
    hand.drag(hand.pixel(100, 0.2), hand.pixel(80, 0.4), hand.pixel(60, 0.6))
    opacity, _ = functions(actor)
    assert opacity[:, :2] == pytest.approx(editor.points)
    assert editor.points[1] == pytest.approx([60, 0.6], abs=1.5)  # a pixel
    assert editor.points[[0, 2]] == pytest.approx(POINTS[[0, 2]])
    assert plotter.camera_position == camera
    assert np.abs(picture(plotter) - before).mean() > 1
    assert_drawn_as_set(plotter, actor, editor)


@pytest.mark.every(2)
def test_points_stay_between_their_neighbours_and_within_opacities(edited):
    _, _, editor, hand = edited
    hand.drag(hand.pixel(100, 0.2), hand.pixel(190, 3.0), hand.pixel(900, 3.0))
    assert editor.points[1] == pytest.approx([200, 1], abs=0.3)
    assert (np.diff(editor.points[:, 0]) > 0).all()


@pytest.mark.every(2)
def test_a_click_on_the_curve_and_a_double_click_add_a_point_and_a_right_click_deletes_it(edited):
    _, _, editor, hand = edited
    hand.drag(hand.pixel(150, 0.5), hand.pixel(150, 0.7))
    assert len(editor.points) == 4
    assert editor.points[2] == pytest.approx([150, 0.7], abs=1.5)
    hand.drag(hand.pixel(50, 0.9), repeat=0)  # beside the curve: nothing yet
    assert len(editor.points) == 4
    hand.drag(hand.pixel(50, 0.9), repeat=1)
    assert len(editor.points) == 5
    assert editor.points[1] == pytest.approx([50, 0.9], abs=1.5)
    hand.send("LeftButtonDoubleClick", hand.pixel(50, 0.9))  # what some systems send as well
    hand.send("LeftButtonRelease", hand.pixel(50, 0.9))
    assert len(editor.points) == 5
    hand.drag(hand.pixel(50, 0.9), button="Right")
    hand.drag(hand.pixel(20, 0.9), button="Right")  # nothing is there
    assert len(editor.points) == 4
    for _ in range(3):
        editor.undo()
    assert editor.points == pytest.approx(POINTS)


@pytest.mark.every(2)
@pytest.mark.parametrize(
    ("by", "window", "level"), [((40, 0), 200, None), ((0, 40), None, 100), ((0, -40), None, 100)]
)
def test_a_drag_on_the_background_sets_level_and_window(edited, by, window, level):
    plotter, actor, editor, hand = edited
    before, begin = functions(actor), hand.pixel(30, 0.9)
    camera = plotter.camera_position
    hand.drag(begin, begin + np.divide(by, 2), begin + by)
    after = functions(actor)
    low, high = editor._corners()
    shift, stretch = by[0] / (high - low)[0] * 200, 4 ** (by[1] / (high - low)[1])
    assert editor.window == pytest.approx(window or 200 * stretch)
    assert editor.level == pytest.approx(level or 100 + shift)
    for old, new in zip(before, after, strict=True):
        assert new[:, 0] == pytest.approx(100 + shift + (old[:, 0] - 100) * stretch)
        assert new[:, 1:] == pytest.approx(old[:, 1:])
    # The scalar bar has the same window
    low, high = actor.mapper.lookup_table.scalar_range
    assert (high - low, (low + high) / 2) == pytest.approx((editor.window, editor.level))
    assert plotter.camera_position == camera
    assert_drawn_as_set(plotter, actor, editor)


@pytest.mark.every(2)
def test_keys_do_what_the_mouse_does(edited):
    _, _, editor, hand = edited
    one = (editor._axis[1] - editor._axis[0]) / 100
    hand.key("Left")
    hand.key("Up")
    assert (editor.level, editor.window) == pytest.approx((100 - one, 204))
    hand.key("r")
    hand.key("z")
    hand.key("z")
    hand.key("z")
    assert editor.points == pytest.approx(POINTS)
    hand.key("Tab")
    hand.key("Tab")
    hand.key("Right")
    hand.key("Up")
    one = (editor._axis[1] - editor._axis[0]) / 100
    assert editor.points[1] == pytest.approx([100 + one, 0.21])
    hand.key("a")  # beside it
    assert editor.points[2] == pytest.approx((editor.points[1] + editor.points[3]) / 2)
    hand.key("Delete")
    assert len(editor.points) == 3
    hand.key("Escape")
    hand.key("BackSpace")  # nothing is chosen
    assert len(editor.points) == 3


@pytest.mark.every(2)
def test_colour_maps_go_round_and_keep_the_opacity(edited):
    _, actor, editor, hand = edited
    opacity, _ = functions(actor)
    for key, name in (("c", "gray"), ("c", "bone"), ("C", "gray"), ("C", "turbo")):
        hand.key(key)
        want = pv.LookupTable(name).to_color_tf()
        got, want = functions(actor)[1], rows_of(want)
        assert got[:, 1:4] == pytest.approx(want[:, 1:4], abs=1 / 255)
        assert editor._chart.title.startswith(name)
    assert (editor.window, editor.level) == (200, 100)
    np.testing.assert_array_equal(functions(actor)[0], opacity)


@pytest.mark.parametrize("name", ["mri-brain", "ct-bone"])
def test_a_preset_is_what_add_vdi_makes_of_its_name(edited, name):
    _, actor, editor, _ = edited
    editor.apply_preset(name)
    other = pv.Plotter(window_size=WINDOW)
    judge = other.add_vdi(soft_ball(), cmap=name, show_scalar_bar=False)
    for got, want in zip(functions(actor), functions(judge), strict=True):
        assert got == pytest.approx(want)
    other.close()
    with pytest.raises(InvalidArgumentError, match="mean 'ct-bone'"):
        editor.apply_preset("ct-bones")


def test_undo_redo_and_reset(plotter):
    actor = plotter.add_volume(soft_ball(), **LOOKS)
    first = functions(actor)
    editor = plotter.add_transfer_function_editor(actor)
    plotter.show(auto_close=False)
    states = []
    for change in (
        lambda: setattr(editor, "points", POINTS),
        lambda: setattr(editor, "level", 50),
        lambda: editor.apply_cmap(["red", "blue"]),
        editor.reset,
    ):
        change()
        states.append(functions(actor))

    def assert_are(want):
        for got, rows in zip(functions(actor), want, strict=True):
            np.testing.assert_array_equal(got, rows)

    assert_are(first)
    for want in states[-2::-1]:
        editor.undo()
        assert_are(want)
    editor.undo()
    editor.undo()  # one too many
    assert_are(first)
    for want in states:
        editor.redo()
        assert_are(want)
    editor.redo()
    assert_are(first)
    editor.undo()
    editor.window = 10
    editor.redo()  # another change was made: nothing to make again
    assert editor.window == 10


@pytest.mark.every(2)
def test_changes_from_elsewhere_are_shown(edited):
    plotter, actor, editor, _ = edited
    table = pv.LookupTable("viridis", scalar_range=(50, 90))
    table.apply_opacity([0.0, 1.0])
    actor.prop.apply_lookup_table(table)
    plotter.render()
    assert (editor.window, editor.level) == (40, 70)
    assert editor.points == pytest.approx(np.array([[50, 0], [90, 0.998]]), abs=0.01)
    actor.prop.GetScalarOpacity().AddPoint(70, 0.1)
    plotter.render()
    assert [70, 0.1] in editor.points.tolist()
    if "VDI" not in type(actor).__name__:
        prop = pv.VolumeProperty()
        prop.SetColor(table.to_color_tf())
        prop.GetScalarOpacity().RemoveAllPoints()
        prop.GetScalarOpacity().AddPoint(60, 0.4)
        actor.prop = prop
        plotter.render()
        assert editor.points.tolist() == [[60, 0.4]]


@pytest.mark.every(2)
def test_what_is_not_over_the_editor_is_the_plotter_s(edited):
    plotter, _, editor, hand = edited
    pressed = []
    for key in ("c", "m"):
        plotter.add_key_event(key, lambda key=key: pressed.append(key))
    camera = plotter.camera_position
    hand.key("c")
    hand.key("m")  # which the editor has no use for
    assert pressed == ["m"]
    hand.key("c", (5, 5))
    assert pressed == ["m", "c"]
    hand.drag((20, 20), (30, 25), (60, 50))
    assert plotter.camera_position != camera
    camera, points = plotter.camera_position, editor.points
    editor._chart.visible = False
    hand.drag(hand.pixel(100, 0.2), hand.pixel(80, 0.4), hand.pixel(60, 0.6))
    assert plotter.camera_position != camera
    np.testing.assert_array_equal(editor.points, points)


@pytest.mark.every(2)
def test_a_double_click_leaves_the_chart_to_the_editor(edited):
    _, _, editor, hand = edited
    place = hand.pixel(50, 0.9)
    hand.drag(place)
    hand.drag(place)  # PyVista's own clock counts two clicks
    assert not editor._chart.GetInteractive()


def test_each_plot_s_editor_has_the_events_of_its_viewport():
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
    hands[0].key("c", hands[0].pixel(50, 0.5))
    assert (functions(actors[0])[1] != functions(actors[1])[1]).any()
    cameras = [each.camera.position for each in plotter.renderers]
    hands[0].drag((20, 20), (40, 30), (60, 60))
    now = [each.camera.position for each in plotter.renderers]
    assert now[0] != cameras[0]
    assert now[1] == cameras[1]
    plotter.close()


def test_two_editors_of_a_plot_stand_one_below_the_other(plotter):
    actors = [plotter.add_volume(soft_ball(8), name=name, **LOOKS) for name in "ab"]
    editors = [plotter.add_transfer_function_editor(actor) for actor in actors]
    again = plotter.add_transfer_function_editor(actors[1])
    assert [each._chart.loc[1] for each in (*editors, again)] == pytest.approx([0.65, 0.32, 0.32])
    assert [each.renderer is None for each in (*editors, again)] == [False, True, False]
    assert len(plotter.renderer.get_charts()) == 2


@pytest.mark.every(2)
@pytest.mark.parametrize("add", ["add_volume", "add_vdi"])
def test_it_goes_by_name_or_with_its_actor_and_nothing_stays(add, no_leaks):
    plotter = pv.Plotter(window_size=WINDOW)
    actors = [getattr(plotter, add)(soft_ball(8), name=name, **LOOKS) for name in "abc"]
    editors = [plotter.add_transfer_function_editor(actor, size=(0.5, 0.4)) for actor in actors]
    plotter.show(auto_close=False)
    plotter.remove_actor("a")
    assert editors[0].renderer is None
    plotter.remove_transfer_function_editor(actors[1])
    assert editors[1].renderer is None
    assert [chart is editors[2]._chart for chart in plotter.renderer.get_charts()] == [True]
    hand = Hand(plotter, editors[2])
    place = hand.pixel(50, 0.9)
    plotter.remove_transfer_function_editor()
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
        editors[0].window = 3
    plotter.close()


def test_the_histogram_counts_what_the_actor_draws(plotter):
    grid = pv.ImageData(dimensions=(5, 5, 5))
    grid["other"] = np.zeros(125)
    grid["real"] = np.arange(125.0)
    grid["real"][:5] = np.nan
    grid["whole"] = (np.arange(125) % 5).astype(np.int16)
    seen = []
    for add in (plotter.add_volume, plotter.add_vdi):
        for scalars in ("real", "whole"):
            actor = add(grid.copy(), scalars=scalars, clim=(0, 4), **BARE)
            x, y = bars(plotter.add_transfer_function_editor(actor, size=(0.4, 0.2)))
            seen.append((x[0], x[-1], len(x), np.unique(y).tolist()))
    assert seen[:2] == seen[2:]
    assert seen[0][:3] == (5, 124, 512)
    assert seen[1] == (0, 4, 10, [1])  # a bar for each whole number, of equal heights


BARE = {"show_scalar_bar": False}


def bars(editor):
    """The corners of the histogram that is drawn."""
    (area,) = editor._chart.plots()
    return np.asarray(area.x), np.asarray(area.y1)


def test_a_histogram_may_be_given_or_left_out(plotter):
    actor = plotter.add_volume(soft_ball(8), clim=(10, 20), **BARE)
    x, y = bars(plotter.add_transfer_function_editor(actor, histogram=([1, 3, 0], [0, 1, 2, 3])))
    assert x.tolist() == [0, 1, 1, 2, 2, 3]
    assert y == pytest.approx(np.repeat(np.log([2, 4, 1]), 2) / np.log(4))
    editor = plotter.add_transfer_function_editor(actor, histogram=False)
    assert list(editor._chart.plots()) == []
    assert editor._axis == (10, 20)
    with pytest.raises(InvalidArgumentError, match=r"one more; got shapes \(3,\) and \(3,\)"):
        plotter.add_transfer_function_editor(actor, histogram=([1, 3, 0], [0, 1, 2]))
    assert editor.renderer is plotter.renderer  # what is refused takes nothing away


def test_a_volume_of_vtk_s_that_is_grey(plotter):
    given = plotter.add_volume(soft_ball(8), **BARE)
    actor = vtkVolume()
    actor.SetMapper(given.mapper)
    prop = actor.GetProperty()
    for function in (prop.GetGrayTransferFunction(), prop.GetScalarOpacity()):
        function.RemoveAllPoints()
        function.AddPoint(0, 0)
        function.AddPoint(255, 1)
    plotter.add_actor(actor)
    editor = plotter.add_transfer_function_editor(actor)
    plotter.show(auto_close=False)
    editor.level = 100
    assert editor.points == pytest.approx(np.array([[-27.5, 0], [227.5, 1]]))
    colors = rows_of(actor.GetProperty().GetRGBTransferFunction())
    assert colors[:, :4] == pytest.approx(np.array([[-27.5, 0, 0, 0], [227.5, 1, 1, 1]]))


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
    for points, why in (([1, 2], "pairs"), ([[1, 0], [1, 1]], "rise"), ([[0, 2]], "0 to 1")):
        with pytest.raises(InvalidArgumentError, match=why):
            editor.points = points
    with pytest.raises(InvalidArgumentError, match="positive width"):
        editor.window = 0


def test_many_nodes_are_shown_by_few_points_near_the_curve():
    x = np.linspace(0, 10, 256)
    for y in (x / 10, 1 / (1 + np.exp(5 - x)), np.abs(np.sin(x))):
        rows = np.column_stack([x, y, np.full((256, 2), (0.5, 0.0))])
        few = simplified(rows)
        assert len(few) < 50
        assert np.abs(np.interp(x, few[:, 0], few[:, 1]) - y).max() <= 0.01
        assert {*few[:, 0]} <= {*x}
    np.testing.assert_array_equal(simplified(rows[:20]), rows[:20])


@pytest.fixture
def kept(plotter):
    """A deferred VDI of the ball, for the plotter's view."""
    plotter.camera_position = [(0, 0, 5), (0, 0, 0), (0, 1, 0)]
    ball = soft_ball()
    size, camera = tuple(plotter.window_size), pvdi.Camera.from_any(plotter.camera)
    return pvdi.generate(ball, camera, size, classification="deferred", value_range=(20, 220))


def test_drags_classify_a_deferred_vdi_anew_and_nothing_is_generated(plotter, kept, monkeypatch):
    actor = plotter.add_vdi(kept, cmap="bone", opacity=[0, 0.3], show_scalar_bar=False)
    editor = plotter.add_transfer_function_editor(actor, size=(0.8, 0.6))
    plotter.show(auto_close=False)
    editor.points = [[20, 0], [120, 0.2], [220, 0.5]]
    hand, before = Hand(plotter, editor), picture(plotter)
    monkeypatch.setattr("pyvista_vdi.generation.deferred.generate_vdi", None)
    hand.drag(hand.pixel(120, 0.2), hand.pixel(110, 0.5), hand.pixel(100, 0.8))
    assert editor.points[1] == pytest.approx([100, 0.8], abs=1.5)
    assert functions(actor)[0][:, :2] == pytest.approx(editor.points)
    plotter.remove_transfer_function_editor(editor)
    shown = picture(plotter)
    assert np.abs(shown - before).mean() > 1
    plotter.remove_actor(actor)
    plotter.add_vdi(kept.classified(volume_property=actor.prop), show_scalar_bar=False)
    assert np.abs(shown - picture(plotter)).max() <= 1


def test_the_histogram_of_a_deferred_vdi_is_of_lengths(plotter, kept):
    actor = plotter.add_vdi(kept, cmap="bone", show_scalar_bar=False)
    counts, edges = _lengths(kept)
    assert (edges[0], edges[-1], len(counts)) == (20, 220, 256)
    assert counts.sum() == pytest.approx(kept.steps.sum(), rel=1e-3)
    reach = np.sqrt(3) * kept.spread
    low, high = np.maximum(kept.mean - reach, 0), np.minimum(kept.mean + reach, 1)
    below = np.clip((0.25 - low) / np.maximum(high - low, 0.5 / 256), 0, 1)
    assert counts[:64].sum() == pytest.approx((kept.steps * below).sum(), rel=1e-3)
    _, heights = bars(plotter.add_transfer_function_editor(actor))
    assert heights == pytest.approx(np.repeat(np.log1p(counts) / np.log1p(counts).max(), 2))
