"""What is seen, in the address of a page: a link shows it, and a page comes back as it was."""

import numpy as np
import pytest
from browsers import file_of, picture
from plugin_scenes import soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.extensions.web.page import page as page_of
from pyvista_vdi.model.standard_cases import filling_camera

SIZE = (160, 90)
VIEWPORT = {"width": 320, "height": 180}

INFOS = """
window.infos = [];
console.info = (text) => infos.push(text);
"""

SETTLED = "viewer.ready.then(() => new Promise((next) => setTimeout(next, 500)))"


@pytest.fixture
def address(vdi, tmp_path):
    (tmp_path / "a.html").write_bytes(page_of(vdi))
    return (tmp_path / "a.html").as_uri()


@pytest.fixture
def opened(open_page):
    """Open an address from disk; ``window.infos`` has what is said by the way."""

    def opened(url, *, ready=True):
        page = open_page(url=url, viewport=VIEWPORT, before=INFOS)
        if ready:
            page.ready()
        return page

    return opened


def link_of(page):
    page.evaluate(SETTLED)
    return page.evaluate("location.href")


def test_a_link_shows_what_was_seen_and_a_page_comes_back(address, opened):
    page = opened(address)
    assert link_of(page) == address  # nothing is said of what the page begins with
    length = page.evaluate("history.length")
    page.evaluate(
        """() => {
          viewer.camera = { ...viewer.camera, position: [2.1, 1 / 3, -1.7], view_angle: 41 };
          viewer.look = { brightness: 1.5, opacity: 2, clip: [0.1, 1, 0, 1, 0, 0.7] };
        }"""
    )
    link = link_of(page)
    assert link.startswith(f"{address}#view=position:2.1,0.3333333333333333,-1.7/focal_point:")
    assert page.evaluate("history.length") == length
    shown = picture(page, SIZE)
    other = opened(link)
    page.page.reload()
    page.evaluate("window.viewer = document.querySelector('vdi-viewer')")
    page.ready()
    for each in (other, page):
        assert each.evaluate("viewer.look.clip") == [0.1, 1, 0, 1, 0, 0.7]
        np.testing.assert_array_equal(picture(each, SIZE), shown)
        assert link_of(each) == link
    other.evaluate("viewer.resetCamera(), viewer.look = {}")
    assert link_of(other).rstrip("#") == address


def test_an_address_that_is_changed_is_followed(address, opened):
    page = opened(f"{address}#other=1")
    home = page.evaluate("viewer.camera")
    page.evaluate("viewer.look = { opacity: 2 }")
    link = link_of(page)
    assert "#other=1&view=" in link
    page.evaluate("location.hash = location.hash.replace('opacity:2', 'opacity:3')")
    page.wait_for("viewer.look.opacity === 3")
    page.evaluate("location.hash = '#elsewhere'")  # a place in the page, say
    page.page.wait_for_timeout(50)
    assert page.evaluate("viewer.look.opacity") == 3
    page.evaluate("location.hash = ''")
    page.wait_for("viewer.look.opacity === 1")
    assert page.evaluate("viewer.camera") == home


#: Texts that say no view, and why.
NO_VIEWS = [
    ("position:1,2", "position of a view in an address is 3 numbers"),
    ("position:1,2,3/focal_point:1,2,3/view_up:0,0,1/view_angle:30", "are the same point"),
    ("position:1,2,3/focal_point:0,0,0/view_up:0,0,1/view_angle:30/opacity:-1", "opacity"),
    ("constructor:1", 'no "constructor"'),
    ("", 'no ""'),
]


def test_texts_that_say_no_view_are_refused_by_name(open_page):
    told = open_page(SIZE).evaluate(
        """async (texts) => {
          const { viewOfText } = await import("./link.js");
          return texts.map((text) => { try { viewOfText(text) } catch (e) { return String(e) } });
        }""",
        [text for text, _ in NO_VIEWS],
    )
    for text, (_, why) in zip(told, NO_VIEWS, strict=True):
        assert text.startswith("TypeError")
        assert why in text


def test_what_is_no_view_is_not_followed_and_not_an_error(address, opened, vdi):
    page = opened(f"{address}#view=%E0%A4")
    page.evaluate("location.hash = '#view=position:1,2'")
    page.wait_for("infos.length === 2")
    assert all("is not followed" in text for text in page.evaluate("infos"))
    np.testing.assert_allclose(page.evaluate("viewer.camera.position"), vdi.camera.position)


def test_of_several_viewers_the_first_of_a_key_is_followed(vdi, open_page):
    page = open_page(SIZE, attributes='hash="left"', files={"ball.vdi": file_of(vdi)})
    page.evaluate(
        """async () => {
          for (const key of ["left", "right", null]) {
            const viewer = document.createElement("vdi-viewer");
            if (key) viewer.setAttribute("hash", key);
            document.body.append(viewer);
          }
          window.all = [...document.querySelectorAll("vdi-viewer")];
          await Promise.all(all.map((each) => each.load("ball.vdi")));
          all.forEach((each, k) => (each.look = { opacity: k + 2 }));
          await new Promise((next) => setTimeout(next, 500));
        }"""
    )
    hash_ = page.evaluate("location.hash")
    parts = dict(part.split("=") for part in hash_.removeprefix("#").split("&"))
    assert sorted(parts) == ["left", "right"]
    assert parts["left"].endswith("/opacity:2")
    assert parts["right"].endswith("/opacity:4")
    page.evaluate("location.hash = location.hash.replaceAll('opacity', 'brightness')")
    page.wait_for("all[2].look.brightness === 4")
    looks = page.evaluate("all.map(({ look }) => [look.brightness, look.opacity])")
    assert looks == [[2, 1], [1, 3], [4, 1], [1, 5]]
    page.evaluate("history.replaceState(null, '', '#')")


def test_the_time_of_a_series_is_in_the_link(default_runtime, opened, tmp_path):
    balls = [soft_ball() for _ in range(3)]
    for k, ball in enumerate(balls):
        ball["v"] = ball["v"] * (1 - 0.2 * k)
    camera = filling_camera(balls[0].bounds, SIZE)
    series = pvdi.generate_series(balls, camera, SIZE, [0.0, 0.5, 1.5], cmap="viridis")
    path = series.save(tmp_path / "balls.html", autoplay=True)
    page = opened(path.as_uri(), ready=False)  # it plays
    page.wait_for("viewer.series")
    page.evaluate("viewer.pause(), viewer.time = 1.5, viewer.ready.then(() => true)")
    link = link_of(page)
    assert link.endswith("/time:1.5")
    other = opened(link)
    other.wait_for("viewer.time === 1.5")
    other.ready()
    assert not other.evaluate("viewer.playing")
    np.testing.assert_array_equal(picture(other, SIZE), picture(page, SIZE))


def test_a_viewer_in_a_page_of_others_leaves_the_address_alone(vdi, open_page):
    page = open_page(SIZE)
    page.load(file_of(vdi))
    before = link_of(page)
    page.evaluate("viewer.look = { opacity: 2 }")
    assert link_of(page) == before
    assert page.evaluate("viewer.shadowRoot.querySelector('[aria-label^=\"Copy a link\"]').hidden")
