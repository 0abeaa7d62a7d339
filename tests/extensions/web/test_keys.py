"""Keys: those that a viewer takes reach nothing around it, and it swallows no others."""

from functools import partial

import pytest
from browsers import file_of
from plugin_scenes import soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.model.standard_cases import filling_camera

SIZE = (97, 55)

#: A page with shortcuts of its own, which hears keys before and after what has the focus.
LISTENING = """
window.reached = [];
for (const kind of ["keydown", "keypress", "keyup"]) {
  for (const capture of [true, false]) {
    document.addEventListener(kind, ({ key, defaultPrevented }) => {
      if (!["Shift", "Control", "Alt", "Meta"].includes(key)) {
        reached.push([kind, capture, key, defaultPrevented]);
      }
    }, { capture });
  }
}
"""

ARROWS = ["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown"]
TAKEN = [*ARROWS, *(f"Shift+{key}" for key in ARROWS), "+", "=", "-", "r", "Shift+R"]
NOT_TAKEN = [
    *("a", "b", "d", "m", "x", "z", "1", "Escape", "Enter", "Delete", "Home", "PageDown", "Space"),
    *(",", ".", "Shift+Enter", "Control+Enter", "Control+s", "Control+b", "Alt+r", "Meta+r"),
    *("Control+ArrowLeft", "Alt+ArrowUp", "Control+=", "Control+-", "Control+Shift+ArrowUp"),
]


@pytest.fixture(scope="module")
def data(default_runtime):
    volume = soft_ball()
    camera = filling_camera(volume.bounds, SIZE)
    return file_of(pvdi.generate(volume, camera, SIZE, cmap="viridis", clim=(0, 1)))


@pytest.fixture(scope="module")
def series(default_runtime, tmp_path_factory):
    """The bytes of a series of three steps."""
    volume = soft_ball()
    camera = filling_camera(volume.bounds, SIZE)
    made = pvdi.generate_series([volume] * 3, camera, SIZE, [0.0, 0.5, 1.0], cmap="viridis")
    path = made.save(
        tmp_path_factory.mktemp("series") / "ball.vdis", precision="8-byte", compression="deflate"
    )
    return path.read_bytes()


class Pressed:
    """Presses keys on what has the focus, and returns what the page then was told."""

    def __init__(self, page):
        self.page = page
        self.page.evaluate(
            """() => {
              for (const name of ["input", "div"]) {
                document.querySelector(`body > ${name}`)?.remove();
                document.body.append(document.createElement(name));
              }
              document.querySelector("div").tabIndex = 0;
            }"""
        )

    def at(self, focused, *keys):
        """Press keys with the focus at what a JavaScript expression is."""
        self.page.evaluate(f"{focused}.focus({{ preventScroll: true }}), reached.length = 0")
        for key in keys:
            self.page.page.keyboard.press(key)
        return self.page.evaluate("reached")

    def of_the_viewer(self, part, *keys):
        return self.at(f"viewer.shadowRoot.querySelector('{part}')", *keys)

    def anywhere(self, *keys):
        """Return what the page is told of keys where there is no viewer."""
        return self.at("document.querySelector('body > div')", *keys)


@pytest.fixture
def pressed(data, open_page):
    return Pressed(open_page(SIZE, data=data, before=LISTENING))


@pytest.fixture
def playing(series, open_page):
    """The same with a series in the viewer."""
    page = open_page(
        SIZE, attributes='src="ball.vdis"', files={"ball.vdis": series}, before=LISTENING
    )
    page.ready()
    return Pressed(page)


def test_what_it_takes_reaches_nothing_else(pressed):
    look = partial(pressed.page.evaluate, "viewer.camera")
    for key in TAKEN:
        pressed.page.evaluate("viewer.resetCamera()")
        first = look()
        if key in ("r", "Shift+R"):
            pressed.of_the_viewer("canvas", "ArrowLeft")
            assert look() != first
        told = pressed.of_the_viewer("canvas", key)
        assert (look() == first) == (key in ("r", "Shift+R")), key
        assert told == [], key
        assert pressed.anywhere(key)  # the page has its shortcuts still


def test_arrows_that_it_takes_do_not_scroll_the_page(data, open_page):
    pressed = Pressed(
        open_page(SIZE, data=data, before=LISTENING, viewport={"width": 200, "height": 200})
    )
    pressed.page.evaluate("document.body.style.height = '5000px'")
    pressed.of_the_viewer("canvas", *["ArrowDown"] * 5)
    pressed.page.page.wait_for_timeout(300)
    assert pressed.page.evaluate("scrollY") == 0
    pressed.anywhere("ArrowDown")
    pressed.page.wait_for("scrollY > 0")


def test_what_it_does_not_take_reaches_the_page_as_without_it(pressed):
    before = pressed.page.evaluate("viewer.camera")
    for key in NOT_TAKEN:
        assert pressed.of_the_viewer("canvas", key) == pressed.anywhere(key) != [], key
        assert pressed.page.evaluate("viewer.camera") == before, key


def test_what_is_typed_elsewhere_is_none_of_its(pressed):
    before = pressed.page.evaluate("viewer.camera")
    pressed.of_the_viewer("canvas", "Escape")
    keys = [*"rR+-= ,.", *ARROWS]
    assert pressed.at("document.querySelector('body > input')", *keys) == pressed.anywhere(*keys)
    assert pressed.page.evaluate("document.querySelector('body > input').value") == "rR+-= ,."
    assert pressed.page.evaluate("viewer.camera") == before


def test_a_viewer_with_nothing_to_be_turned_takes_none(open_page):
    pressed = Pressed(open_page(SIZE, before=LISTENING))
    assert pressed.of_the_viewer("canvas", *TAKEN) == pressed.anywhere(*TAKEN)


#: What has the focus in a viewer with a series; a key; and what is then another.
OF_SERIES = [
    ("canvas", "Space", "playing"),
    ("canvas", ",", "time"),
    ("canvas", ".", "time"),
    ("canvas", "ArrowLeft", "camera.position[0]"),
    (".controls input", "Space", "playing"),
    *((".controls input", key, "time") for key in (",", ".", *ARROWS, "Home", "End")),
    (".controls button", "Space", "playing"),
    (".controls button", "Enter", "playing"),
]


def test_a_series_takes_keys_of_its_own_and_no_others(playing):
    names = ["playing", "time", "camera.position[0]"]
    look = partial(playing.page.evaluate, f"[{', '.join(f'viewer.{name}' for name in names)}]")
    for part, key, changes in OF_SERIES:
        playing.page.evaluate("viewer.time = 0.5, viewer.ready.then(() => true)")
        before = dict(zip(names, look(), strict=True))
        told = playing.of_the_viewer(part, key)
        after = dict(zip(names, look(), strict=True))
        playing.page.evaluate("viewer.pause()")
        if changes == "playing":  # and then the time, sooner or later
            after["time"] = before["time"]
        assert {name for name in after if after[name] != before[name]} == {changes}, (part, key)
        assert told == [], (part, key)
    keys = ["a", "b", "Escape", "Control+,", "Alt+."]
    for part in ("canvas", ".controls input", ".controls button"):
        assert playing.of_the_viewer(part, *keys) == playing.anywhere(*keys), part
        assert not playing.page.evaluate("viewer.playing")
