"""Series in a page: every step drawn as Python draws it, sought, played, skipped where damaged."""

from __future__ import annotations

import base64

import numpy as np
import pytest
from browsers import Page

import pyvista_vdi as pvdi
from pyvista_vdi.model.standard_cases import filling_camera

SIZE = (97, 55)
#: Of 255: as of tests/web/test_element.py.
CLOSE = 1.0
N = 9

READY = "viewer.ready.then(() => true)"

WITHOUT_WORKERS = """
window.Worker = class { constructor() { throw new Error("forbidden"); } };
"""


@pytest.fixture(scope="module")
def series(default_runtime, tmp_path_factory):
    """A ball that moves, and stands still between the fifth step and the seventh."""
    z, y, x = np.meshgrid(*(np.linspace(-1, 1, 20),) * 3, indexing="ij")

    def ball(i):
        centre = 0.1 * (i if i < 5 else max(4, i - 2)) - 0.4
        return pvdi.Volume((1 - np.sqrt((x - centre) ** 2 + y**2 + z**2)).clip(0).astype("f4"))

    camera = filling_camera(ball(0).bounds, SIZE)
    looks = {"cmap": "viridis", "opacity": "linear", "clim": (0, 1)}
    made = pvdi.generate_series(ball, camera, SIZE, [0.5 * i for i in range(N)], **looks)
    path = tmp_path_factory.mktemp("series") / "ball.vdis"
    made.save(path, precision="8-byte")
    return pvdi.read(path)


@pytest.fixture(scope="module")
def frames(series):
    """Places of the frames' contents, and their bytes; a step that no other is written by."""
    return [(place + 40, header.n_bytes, header.by) for place, header in series._steps._frames]


@pytest.fixture(scope="module")
def data(series):
    return series._steps._path.read_bytes()


@pytest.fixture
def playing(data, open_page):
    """A page that shows the series."""

    def playing(content=data, attributes="", **options):
        attributes = f'src="ball.vdis" {attributes}'
        return open_page(SIZE, attributes=attributes, files={"ball.vdis": content}, **options)

    return playing


def worst(picture, vdi, camera):
    return np.abs(picture - pvdi.render(vdi, camera, picture.shape[1::-1]) * 255.0).max()


def shown(page):
    """The steps that have been shown."""
    heard = page.evaluate("heard")
    return [detail["step"] for name, detail in heard if name == "vditime"]


def test_steps_are_drawn_as_render_draws_them(series, playing):
    page = playing()
    page.evaluate(READY)
    assert page.evaluate("[viewer.series.times, viewer.series.length]") == [list(series.times), N]
    assert page.evaluate("[viewer.time, viewer.playing, viewer.status.state]") == [0, False, "full"]
    turned = series.camera.azimuth(40)
    assert worst(page.screenshot(turned, SIZE), series[0], turned) <= CLOSE
    for time, step in ((3.6, 7), (-9, 0), (1.2, 2), (99, N - 1)):
        page.evaluate("(time) => { viewer.time = time; }", time)
        assert page.evaluate("viewer.time") == series.times[step]
        page.evaluate(READY)
        # The view stays
        position = page.evaluate("viewer.camera.position")
        np.testing.assert_allclose(position, turned.position)
        assert worst(page.screenshot(turned, SIZE), series[step], turned) <= CLOSE
        assert page.evaluate("viewer.status.supersegments") == series[step].n_supersegments
    assert shown(page) == [0, 7, 0, 2, N - 1]


def test_it_plays_to_its_end_in_order(series, playing):
    page = playing()
    page.evaluate(READY)
    # In one task: it may have played to its end before a second one is heard
    assert page.evaluate("() => { viewer.play({ rate: 20, loop: false }); return viewer.playing; }")
    page.wait_for("!viewer.playing")
    page.evaluate(READY)
    steps = shown(page)
    assert steps == sorted(set(steps))
    assert (steps[0], steps[-1]) == (0, N - 1)
    assert worst(page.screenshot(series.camera, SIZE), series[N - 1], series.camera) <= CLOSE
    # From the first step again
    begun = page.evaluate("() => { viewer.play({ rate: 50, loop: false }); return viewer.time; }")
    assert begun == series.times[0]
    page.wait_for("!viewer.playing")
    page.evaluate(READY)
    again = shown(page)[len(steps) :]  # none, where decoding one takes longer than all of them last
    assert again == sorted(set(again))
    assert shown(page)[-1] == N - 1


def test_it_begins_anew_turns_meanwhile_and_pauses(series, playing):
    page = playing(attributes="autoplay")
    rounds = """heard.filter(([name]) => name === "vditime").map(([, { step }]) => step)
      .filter((step, k, steps) => k > 0 && step < steps[k - 1]).length"""
    page.wait_for(f"{rounds} >= 2")
    turned = series.camera.azimuth(60)
    page.evaluate("(position) => { viewer.camera = { ...viewer.camera, position }; }",
                  list(turned.position))  # fmt: skip
    page.wait_for(f"{rounds} >= 3")
    page.evaluate("viewer.pause()")
    page.evaluate(READY)
    assert not page.evaluate("viewer.playing")
    step = series.nearest(page.evaluate("viewer.time"))
    assert worst(page.screenshot(turned, SIZE), series[step], turned) <= CLOSE


@pytest.mark.slow
def test_steps_that_are_not_ready_are_left_out(playing):
    page = playing()
    page.evaluate(READY)
    page.evaluate("viewer.play({ rate: 1e5, loop: false })")
    page.wait_for("!viewer.playing")
    page.evaluate(READY)
    steps = shown(page)
    assert steps[-1] == N - 1
    assert len(steps) <= 5  # the first, one or a few of those made ahead, the last


@pytest.mark.slow
def test_the_slider_the_button_and_keys(series, playing):
    page = playing()
    page.evaluate(READY)
    bar = page.page.locator("vdi-viewer .controls")
    assert bar.is_visible()
    slider, button = bar.locator("input"), bar.locator("button")
    slider.fill("4")
    page.wait_for("viewer.time === 2")
    assert bar.locator("output").inner_text() == "2"
    page.page.locator("vdi-viewer canvas").first.focus()
    page.page.keyboard.press("Period")
    page.page.keyboard.press("Period")
    page.page.keyboard.press("Comma")
    assert page.evaluate("viewer.time") == 2.5
    page.page.keyboard.press("Space")
    assert page.evaluate("viewer.playing")
    assert button.get_attribute("aria-label") == "Pause"
    button.click()
    assert not page.evaluate("viewer.playing")
    button.focus()
    page.page.keyboard.press("Space")
    assert page.evaluate("viewer.playing")
    page.evaluate("viewer.pause()")
    page.evaluate(READY)
    step = page.evaluate("viewer.series.nearest(viewer.time)")
    assert slider.input_value() == str(step)


def test_a_damaged_step_is_named_and_skipped(series, data, frames, playing):
    """One that no other step is written by."""
    needed = {by for _, _, by in frames}
    k = next(i for i in range(1, N - 1) if i not in needed)
    changed = bytearray(data)
    changed[frames[k][0] + 30] ^= 1
    page = playing(bytes(changed))
    page.evaluate(READY)
    page.evaluate("(time) => { viewer.time = time; }", series.times[k])
    why = page.evaluate("viewer.ready.catch(({ message }) => message)")
    assert f"step {k} of the series" in why
    assert "checksum" in why
    alert = page.page.locator("vdi-viewer p")
    assert alert.is_visible()
    assert why in alert.inner_text()
    page.evaluate("viewer.time = 0")
    page.evaluate(READY)
    assert not alert.is_visible()
    page.evaluate("viewer.play({ rate: 15, loop: false })")
    page.wait_for("!viewer.playing")
    page.evaluate(READY)
    assert k not in shown(page)
    assert shown(page)[-1] == N - 1


@pytest.mark.slow
def test_a_file_that_is_cut_off_plays_to_its_last_step(series, data, frames, playing):
    place, size, _ = frames[4]
    page = playing(data[: place + size + 9], in_parts=["ball.vdis"])
    page.evaluate(READY)
    # Without an index it is read as a whole, by one more request
    assert [part is None for name, part in page.asked if name == "ball.vdis"][-1]
    page.wait_for("viewer.series.complete")
    assert page.evaluate("viewer.series.times") == list(series.times[:5])
    page.evaluate("viewer.play({ rate: 30, loop: false })")
    page.wait_for("!viewer.playing")
    page.evaluate(READY)
    assert shown(page)[-1] == 4


def test_files_that_are_no_series_are_a_sentence(data, open_page):
    page = open_page(SIZE)
    for content, why in (
        (data[:8] + b"\7" + data[9:], "format version 7"),
        (data[:60] + b"#" + data[61:], "head is not what was written"),
        (data[:400], "no finished step"),
        (data[:5], "no finished step"),
    ):
        with pytest.raises(Exception, match=why):
            page.load(content)
        assert page.evaluate("viewer.status.state") == "error"


def test_steps_are_fetched_when_they_are_asked_for(series, data, frames, playing):
    """Where the server gives parts; the first of them is longer than most of this small file."""
    script = """import { Series } from "./series.js";
    const of = Series.ofParts;
    Series.ofParts = (parts) => of({ ...parts, first: parts.first.subarray(0, 700) });"""
    page = playing(in_parts=["ball.vdis"], script=script)
    page.wait_for("viewer.series")
    page.evaluate("viewer.load('ball.vdis').then(() => true)")
    page.asked.clear()
    page.evaluate("viewer.time = 4")
    page.evaluate(READY)
    place, size, by = frames[8]
    wanted = {(place, place + size - 1)}
    while by >= 0:
        place, size, by = frames[by]
        wanted.add((place, place + size - 1))
    asked = {part for name, part in page.asked if name == "ball.vdis"}
    assert asked <= wanted
    assert (frames[8][0], sum(frames[8][:2]) - 1) in asked
    assert worst(page.screenshot(series.camera, SIZE), series[8], series.camera) <= CLOSE


def test_the_first_step_is_shown_while_the_rest_comes(series, data, frames, open_page):
    page = open_page(SIZE)
    page.evaluate(
        """([text, cut]) => {
          const bytes = bytesOf(text), rest = Promise.withResolvers();
          async function* pieces() {
            yield textOf(bytes.subarray(0, cut - cut % 3));
            await rest.promise;
            yield bytes.subarray(cut - cut % 3);
          }
          window.goOn = rest.resolve;
          window.loaded = viewer.load(pieces()).then(() => true);
        }""",
        [base64.b64encode(data).decode(), sum(frames[1][:2]) + 5],
    )
    page.wait_for("heard.some(([name]) => name === 'vditime')")
    assert page.evaluate("[viewer.series.times.length, viewer.series.complete]") == [2, False]
    page.evaluate("goOn()")
    page.wait_for("viewer.series.complete")
    assert page.evaluate("viewer.series.times") == list(series.times)
    assert page.page.locator("vdi-viewer input").get_attribute("max") == str(N - 1)


@pytest.mark.slow
def test_a_series_that_is_closed_starts_no_worker(data, playing):
    """Neither for the step that was being fetched, nor for those that were to come."""
    page = playing(script='import { Series } from "./series.js"; window.Series = Series;')
    page.evaluate(READY)
    answers = page.evaluate(
        """async (text) => {
          const bytes = bytesOf(text), opened = Promise.withResolvers();
          async function* pieces() { yield bytes; }
          await Series.ofPieces(pieces(), opened.resolve);
          const series = await opened.promise, make = window.Worker;
          window.made = 0;
          window.Worker = class extends make { constructor(...rest) { super(...rest); ++made; } };
          const asked = [series.prepared(0), series.prepared(1)];
          await null; // the first has begun
          series.close();
          const names = asked.map((step) => step.then(() => "shown", ({ name }) => name));
          return [...await Promise.all(names), made];
        }""",
        base64.b64encode(data).decode(),
    )
    assert answers == ["AbortError", "AbortError", 0]


@pytest.mark.slow
def test_a_step_that_was_given_up_comes_when_the_element_is_back(series, playing):
    page = playing()
    page.evaluate(READY)
    page.evaluate(
        """async () => {
          const { parentNode } = viewer;
          viewer.time = 3;
          viewer.remove();
          await new Promise((done) => setTimeout(done));
          parentNode.append(viewer);
        }"""
    )
    page.evaluate(READY)
    assert worst(page.screenshot(series.camera, SIZE), series[6], series.camera) <= CLOSE


@pytest.mark.slow
def test_without_workers_the_page_plays(series, playing):
    page = playing(before=WITHOUT_WORKERS)
    page.evaluate(READY)
    page.evaluate("viewer.time = 2")
    assert worst(page.screenshot(series.camera, SIZE), series[4], series.camera) <= CLOSE


@pytest.mark.slow
def test_another_file_takes_its_place_and_the_element_can_move(series, data, playing, tmp_path):
    page = playing(attributes="autoplay")
    page.evaluate(READY)
    page.evaluate("{ const { parentNode } = viewer; viewer.remove(); parentNode.append(viewer); }")
    assert not page.evaluate("viewer.playing")
    page.evaluate("viewer.time = 3")
    page.wait_for("heard.at(-1)[0] === 'framedrawn' && heard.at(-1)[1].full")
    assert worst(page.screenshot(series.camera, SIZE), series[6], series.camera) <= CLOSE
    page.load(series[2].save(tmp_path / "a.vdi").read_bytes())
    assert page.evaluate("[viewer.series, viewer.time, viewer.playing]") == [None, None, False]
    assert not page.page.locator("vdi-viewer .controls").is_visible()
    assert worst(page.screenshot(series.camera, SIZE), series[2], series.camera) <= CLOSE
    for call in ("viewer.play()", "viewer.time = 1"):
        with pytest.raises(Exception, match="no series"):
            page.evaluate(f"() => {{ {call}; }}")
    page.load(data)
    with pytest.raises(Exception, match="above 0"):
        page.evaluate("viewer.play({ rate: 0 })")
    with pytest.raises(Exception, match="is a number"):
        page.evaluate("() => { viewer.time = 'x'; }")


def test_a_page_of_its_own_plays_from_disk(series, chromium, tmp_path):
    path = series.save(tmp_path / "a ball.html", autoplay=True, background=(0.1, 0.2, 0.3))
    read = pvdi.read(path)
    assert isinstance(read, pvdi.VDISeries)
    assert read.times == series.times
    assert all(one.equals(other) for one, other in zip(read, series, strict=True))
    context = chromium.new_context(viewport={"width": 160, "height": 90})
    try:
        page = Page(context.new_page(), {}, None)
        asked = []
        page.page.on("request", lambda request: asked.append(request.url))
        page.page.goto(path.as_uri())
        page.evaluate(
            """() => {
              window.viewer = document.querySelector("vdi-viewer");
              window.textOf = (bytes) => btoa(String.fromCharCode(...bytes));
            }"""
        )
        page.wait_for("viewer.series?.complete && viewer.playing && viewer.time > 1")
        page.evaluate("viewer.pause()")
        page.evaluate("viewer.time = 4")
        assert worst(page.screenshot(series.camera, SIZE), series[8], series.camera) <= CLOSE
        assert page.page.title() == "a ball"
        assert not [url for url in asked if not url.startswith((path.as_uri(), "blob:"))]
    finally:
        context.close()
    assert not page.complaints


def test_pages_are_read_and_converted_as_files_are(series, tmp_path, capsys):
    from pyvista_vdi.cli import main

    path, page, again = (tmp_path / name for name in ("a.vdis", "a.html", "b.vdis"))
    series.save(path)
    assert main(["convert", str(path), "-o", str(page)]) == 0
    assert main(["info", str(page)]) == 0
    assert "9, times 0 to 4" in capsys.readouterr().out
    assert main(["convert", str(page), "-o", str(again)]) == 0
    assert all(a.equals(b) for a, b in zip(pvdi.read(again), series, strict=True))
    text = page.read_bytes()
    assert text.count(b'<script type="application/vdi+base64">') == 2
    page.write_bytes(text[: text.rindex(b"</script>") - 3000])
    short = pvdi.read(page)  # cut off: it ends with its last finished step
    assert 0 < len(short) < len(series)
    page.write_bytes(b"<p>nothing</p>")
    with pytest.raises(pvdi.errors.VDIFileError, match="not a page"):
        pvdi.read(page)
