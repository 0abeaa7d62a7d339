"""Series in a page: every step drawn as Python draws it, sought, played, skipped where damaged."""

import zipfile

import numpy as np
import pytest
from browsers import WITHOUT_WORKERS, file_of, in_base64

import pyvista_vdi as pvdi
from pyvista_vdi.cli import main
from pyvista_vdi.model.standard_cases import filling_camera

SIZE = (97, 55)
N = 9


@pytest.fixture(scope="module")
def path(default_runtime, tmp_path_factory):
    """The file of a ball that moves."""
    z, y, x = np.meshgrid(*(np.linspace(-1, 1, 20),) * 3, indexing="ij")

    def ball(i):
        centre = 0.1 * i - 0.4
        return pvdi.Volume((1 - np.sqrt((x - centre) ** 2 + y**2 + z**2)).clip(0).astype("f4"))

    camera = filling_camera(ball(0).bounds, SIZE)
    looks = {"cmap": "viridis", "opacity": "linear", "clim": (0, 1)}
    made = pvdi.generate_series(ball, camera, SIZE, [0.5 * i for i in range(N)], **looks)
    path = tmp_path_factory.mktemp("series") / "ball.vdis"
    return made.save(path, precision="8-byte", compression="deflate")


@pytest.fixture(scope="module")
def series(path):
    return pvdi.read(path)


@pytest.fixture(scope="module")
def data(path):
    return path.read_bytes()


def end_of(path, step):
    """Where in a file what shows a step ends."""
    with zipfile.ZipFile(path) as archive:
        member = archive.getinfo(f"{step:06}.vdi")
    return member.header_offset + 30 + len(member.filename) + member.file_size


@pytest.fixture
def playing(data, path, open_page):
    """A page that shows the series: its file, or its folder."""

    def playing(content=data, attributes="", ready=True, folder=False, **options):
        files = {"ball.vdis": content}
        if folder:
            with zipfile.ZipFile(path) as archive:
                files = {f"ball.vdis/{name}": archive.read(name) for name in archive.namelist()}
        attributes = f'src="ball.vdis{"/" * folder}" {attributes}'
        page = open_page(SIZE, attributes=attributes, files=files, **options)
        if ready:
            page.ready()
        return page

    return playing


def seek(page, time):
    page.evaluate("(time) => { viewer.time = time; }", time)


def shown(page):
    """The steps that have been shown."""
    heard = page.evaluate("heard")
    return [detail["step"] for name, detail in heard if name == "vditime"]


def play_to_the_end(page, rate):
    page.evaluate("(rate) => viewer.play({ rate, loop: false })", rate)
    page.wait_for("!viewer.playing")
    page.ready()


def test_steps_are_drawn_as_render_draws_them(series, playing):
    page = playing()
    assert page.evaluate("[viewer.series.times, viewer.series.length]") == [list(series.times), N]
    assert page.evaluate("[viewer.time, viewer.playing, viewer.status.state]") == [0, False, "full"]
    turned = series.camera.azimuth(40)
    page.assert_shows(series[0], SIZE, turned)
    for time, step in ((3.6, 7), (-9, 0), (1.2, 2), (99, N - 1)):
        seek(page, time)
        assert page.evaluate("viewer.time") == series.times[step]
        page.ready()
        # The view stays
        position = page.evaluate("viewer.camera.position")
        np.testing.assert_allclose(position, turned.position)
        page.assert_shows(series[step], SIZE, turned)
        assert page.evaluate("viewer.status.supersegments") == series[step].n_supersegments
    assert shown(page) == [0, 7, 0, 2, N - 1]


def test_it_plays_to_its_end_in_order(series, playing):
    page = playing()
    # In one task: it may have played to its end before a second one is heard
    assert page.evaluate("() => { viewer.play({ rate: 20, loop: false }); return viewer.playing; }")
    page.wait_for("!viewer.playing")
    page.ready()
    steps = shown(page)
    assert steps == sorted(set(steps))
    assert (steps[0], steps[-1]) == (0, N - 1)
    page.assert_shows(series[N - 1], SIZE, series.camera)
    # From the first step again
    begun = page.evaluate("() => { viewer.play({ rate: 50, loop: false }); return viewer.time; }")
    assert begun == series.times[0]
    page.wait_for("!viewer.playing")
    page.ready()
    again = shown(page)[len(steps) :]  # none, where decoding one takes longer than all of them last
    assert again == sorted(set(again))
    assert shown(page)[-1] == N - 1


def test_it_begins_anew_turns_meanwhile_and_pauses(series, playing):
    page = playing(attributes="autoplay", ready=False)
    rounds = """heard.filter(([name]) => name === "vditime").map(([, { step }]) => step)
      .filter((step, k, steps) => k > 0 && step < steps[k - 1]).length"""
    page.wait_for(f"{rounds} >= 2")
    turned = series.camera.azimuth(60)
    page.evaluate("(position) => { viewer.camera = { ...viewer.camera, position }; }",
                  list(turned.position))  # fmt: skip
    page.wait_for(f"{rounds} >= 3")
    page.evaluate("viewer.pause()")
    page.ready()
    assert not page.evaluate("viewer.playing")
    page.assert_shows(series[series.nearest(page.evaluate("viewer.time"))], SIZE, turned)


@pytest.mark.slow
def test_steps_that_are_not_ready_are_left_out(playing):
    page = playing()
    play_to_the_end(page, 1e5)
    steps = shown(page)
    assert steps[-1] == N - 1
    assert len(steps) <= 5  # the first, one or a few of those made ahead, the last


@pytest.mark.slow
def test_the_slider_the_button_and_keys(playing):
    page = playing()
    keyboard, bar = page.page.keyboard, page.page.locator("vdi-viewer .controls")
    assert bar.is_visible()
    slider, button = bar.locator("input"), bar.locator("button")
    slider.fill("4")
    page.wait_for("viewer.time === 2")
    assert bar.locator("output").inner_text() == "2"
    page.page.locator("vdi-viewer canvas").first.focus()
    for key in ("Period", "Period", "Comma"):
        keyboard.press(key)
    assert page.evaluate("viewer.time") == 2.5
    keyboard.press("Space")
    assert page.evaluate("viewer.playing")
    assert button.get_attribute("aria-label") == "Pause"
    button.click()
    assert not page.evaluate("viewer.playing")
    button.focus()
    keyboard.press("Space")
    assert page.evaluate("viewer.playing")
    page.evaluate("viewer.pause()")
    page.ready()
    assert slider.input_value() == str(page.evaluate("viewer.series.nearest(viewer.time)"))


def test_a_damaged_step_is_named_and_skipped(series, data, path, playing):
    k = 3
    changed = bytearray(data)
    changed[(end_of(path, k - 1) + end_of(path, k)) // 2] ^= 1
    page = playing(bytes(changed))
    seek(page, series.times[k])
    why = page.evaluate("viewer.ready.catch(({ message }) => message)")
    assert f"step {k} cannot be shown" in why
    assert "checksum" in why
    alert = page.page.locator("vdi-viewer p")
    assert alert.is_visible()
    assert why in alert.inner_text()
    seek(page, 0)
    page.ready()
    assert not alert.is_visible()
    play_to_the_end(page, 15)
    assert k not in shown(page)
    assert shown(page)[-1] == N - 1


@pytest.mark.slow
def test_a_file_that_is_cut_off_plays_to_its_last_step(series, data, path, playing):
    page = playing(data[: end_of(path, 4) + 9])
    page.wait_for("viewer.series.complete")
    assert page.evaluate("viewer.series.times") == list(series.times[:5])
    play_to_the_end(page, 30)
    assert shown(page)[-1] == 4


def test_files_that_are_no_series_are_a_sentence(data, open_page):
    page = open_page(SIZE)
    for content, why in (
        (data.replace(b'"version": 1', b'"version": 7', 1), "checksum"),
        (data[:400], "no whole VDI"),
        (data[:5], "is truncated"),
    ):
        with pytest.raises(Exception, match=why):
            page.load(content)
        assert page.evaluate("viewer.status.state") == "error"


def test_steps_of_a_folder_are_fetched_when_they_are_asked_for(series, playing):
    page = playing(folder=True)
    page.asked.clear()
    seek(page, 4)
    page.ready()
    assert {*page.asked} == {"ball.vdis/000008.vdi"}
    page.assert_shows(series[8], SIZE, series.camera)
    play_to_the_end(page, 20)
    assert shown(page)[-1] == N - 1


def test_the_first_step_is_shown_while_the_rest_comes(series, data, path, open_page):
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
        [in_base64(data), end_of(path, 1) + 5],
    )
    page.wait_for("heard.some(([name]) => name === 'vditime')")
    assert page.evaluate("[viewer.series.times.length, viewer.series.complete]") == [2, False]
    page.evaluate("goOn()")
    page.wait_for("viewer.series.complete")
    assert page.evaluate("viewer.series.times") == list(series.times)
    time = page.page.get_by_label("Time", exact=True)
    assert time.get_attribute("max") == str(N - 1)


@pytest.mark.slow
def test_a_series_that_is_closed_starts_no_worker(data, playing):
    """Neither for the step that was being fetched, nor for those that were to come."""
    page = playing(script='import { Series } from "./series.js"; window.Series = Series;')
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
        in_base64(data),
    )
    assert answers == ["AbortError", "AbortError", 0]


@pytest.mark.slow
def test_a_step_that_was_given_up_comes_when_the_element_is_back(series, playing):
    page = playing()
    page.evaluate(
        """async () => {
          const { parentNode } = viewer;
          viewer.time = 3;
          viewer.remove();
          await new Promise((done) => setTimeout(done));
          parentNode.append(viewer);
        }"""
    )
    page.ready()
    page.assert_shows(series[6], SIZE, series.camera)


@pytest.mark.slow
def test_without_workers_the_page_plays(series, playing):
    page = playing(before=WITHOUT_WORKERS)
    seek(page, 2)
    page.assert_shows(series[4], SIZE, series.camera)


@pytest.mark.slow
def test_another_file_takes_its_place_and_the_element_can_move(series, data, playing):
    page = playing(attributes="autoplay")
    page.evaluate("{ const { parentNode } = viewer; viewer.remove(); parentNode.append(viewer); }")
    assert not page.evaluate("viewer.playing")
    seek(page, 3)
    page.wait_for("heard.at(-1)[0] === 'framedrawn' && heard.at(-1)[1].full")
    page.assert_shows(series[6], SIZE, series.camera)
    page.load(file_of(series[2]))
    assert page.evaluate("[viewer.series, viewer.time, viewer.playing]") == [None, None, False]
    assert not page.page.locator("vdi-viewer .controls").is_visible()
    page.assert_shows(series[2], SIZE, series.camera)
    for call in ("viewer.play()", "viewer.time = 1"):
        with pytest.raises(Exception, match="no series"):
            page.evaluate(f"() => {{ {call}; }}")
    page.load(data)
    for call, why in (
        ("viewer.play({ rate: 0 })", "above 0"),
        ("viewer.time = 'x'", "is a number"),
    ):
        with pytest.raises(Exception, match=why):
            page.evaluate(f"() => {{ {call}; }}")


def test_a_page_of_its_own_plays_from_disk(series, open_page, tmp_path):
    path = series.save(tmp_path / "a ball.html", autoplay=True, background=(0.1, 0.2, 0.3))
    read = pvdi.read(path)
    assert isinstance(read, pvdi.VDISeries)
    assert read.times == series.times
    assert all(one.equals(other) for one, other in zip(read, series, strict=True))
    page = open_page(url=path.as_uri(), viewport={"width": 160, "height": 90})
    page.wait_for("viewer.series?.complete && viewer.playing && viewer.time > 1")
    page.evaluate("viewer.pause()")
    seek(page, 4)
    page.assert_shows(series[8], SIZE, series.camera)
    assert page.page.title() == "a ball"


def test_pages_are_read_and_converted_as_files_are(series, tmp_path, capsys):
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
    with pytest.raises(pvdi.errors.VDIFileError, match="truncated"):
        pvdi.read(page)
    page.write_bytes(b"<p>nothing</p>")
    with pytest.raises(pvdi.errors.VDIFileError, match="not a page"):
        pvdi.read(page)
