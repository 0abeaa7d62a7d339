"""Series and sets in a page: each step, or view, drawn as Python draws it, from files and folders.

javascript/player.test.js has which is shown when.
"""

import json
import zipfile

import numpy as np
import pytest
from browsers import in_base64, picture

import pyvista_vdi as pvdi
from pyvista_vdi.cli import main
from pyvista_vdi.extensions.sets.generate import orbit, spread
from pyvista_vdi.model.standard_cases import filling_camera

SIZE = (97, 55)
N = 9
VIEWS = 14


def grid():
    return np.meshgrid(*(np.linspace(-1, 1, 20),) * 3, indexing="ij")


@pytest.fixture(scope="module")
def path(default_runtime, tmp_path_factory):
    """The file of a ball that moves."""
    z, y, x = grid()

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
def set_path(default_runtime, tmp_path_factory):
    """The file of lumps that are seen from all sides."""
    z, y, x = grid()
    lumps = np.sin(5 * x) * np.cos(4 * y + 1) * np.sin(5 * z + 2)
    volume = pvdi.Volume(((1 + lumps) * (x**2 + y**2 + z**2 < 0.8)).astype("f4"))
    around = filling_camera(volume.bounds, SIZE)
    looks = {"cmap": "viridis", "opacity": "linear", "clim": (0, 2), "precision": "8-byte"}
    vdis = [
        pvdi.generate(volume, view, SIZE, max_supersegments=6, **looks)
        for view in orbit(around, volume.bounds, directions(VIEWS))
    ]
    made = pvdi.VDISet(vdis, camera=around, window_size=SIZE)
    return made.save(tmp_path_factory.mktemp("sets") / "lumps.vdiset", compression="deflate")


@pytest.fixture(scope="module")
def vdis(set_path):
    read = pvdi.read(set_path)
    read.blend = 0
    return read


def directions(n):
    return spread(n, (0, 0, 1), 180)


def folder_of(path):
    """The files of the folder that a ZIP stands for."""
    with zipfile.ZipFile(path) as archive:
        return {f"{path.name}/{name}": archive.read(name) for name in archive.namelist()}


@pytest.fixture
def shown_from(open_page):
    """Open a page that shows what lies at an address."""

    def shown_from(src, files, attributes="", ready=True, **options):
        attributes = f'src="{src}" {attributes}'
        page = open_page(SIZE, attributes=attributes, files=files, **options)
        if ready:
            page.ready()
        return page

    return shown_from


def seek(page, time):
    page.evaluate("(time) => { viewer.time = time; }", time)


def steps_of(page):
    """The steps that have been shown."""
    return [detail["step"] for name, detail in page.evaluate("heard") if name == "vditime"]


# -- series ----------------------------------------------------------------------------------------


def test_steps_of_a_folder_are_drawn_as_render_draws_them(series, path, shown_from):
    """Each is fetched when it is asked for."""
    page = shown_from("ball.vdis/", folder_of(path))
    assert page.evaluate("[viewer.series.times, viewer.series.length]") == [list(series.times), N]
    assert page.evaluate("[viewer.time, viewer.playing, viewer.status.state]") == [0, False, "full"]
    turned = series.camera.azimuth(40)
    page.assert_shows(series[0], SIZE, turned)
    page.asked.clear()
    for time, step in ((3.6, 7), (-9, 0), (99, N - 1)):
        seek(page, time)
        assert page.evaluate("viewer.time") == series.times[step]
        page.ready()
        # The view stays
        np.testing.assert_allclose(page.evaluate("viewer.camera.position"), turned.position)
        page.assert_shows(series[step], SIZE, turned)
        assert page.evaluate("viewer.status.supersegments") == series[step].n_supersegments
    assert steps_of(page) == [0, 7, 0, N - 1]
    assert {*page.asked} == {"ball.vdis/000007.vdi", f"ball.vdis/{N - 1:06}.vdi"}
    for call, why in (
        ("viewer.play({ rate: 0 })", "above 0"),
        ("viewer.time = 'x'", "is a number"),
    ):
        with pytest.raises(Exception, match=why):
            page.evaluate(f"() => {{ {call}; }}")


def test_it_plays_by_slider_button_and_keys(series, path, shown_from):
    """Keys of its own and no others; and it turns meanwhile."""
    page = shown_from("ball.vdis", {"ball.vdis": path.read_bytes()})
    bar = page.page.locator("vdi-viewer .controls")
    slider, button = bar.locator("input"), bar.locator("button")
    slider.fill("4")
    page.wait_for("viewer.time === 2")
    assert bar.locator("output").inner_text() == "2"
    canvas, keyboard = page.page.locator("vdi-viewer canvas").first, page.page.keyboard
    canvas.focus()
    for key in ("Period", "Period", "Comma", "a", "Control+Comma"):
        keyboard.press(key)
    assert page.evaluate("[viewer.time, viewer.playing]") == [2.5, False]
    slider.focus()
    keyboard.press("ArrowLeft")
    assert page.evaluate("viewer.time") == 2
    keyboard.press("Space")
    assert page.evaluate("viewer.playing")
    assert button.get_attribute("aria-label") == "Pause"
    turned = series.camera.azimuth(60)
    page.evaluate("(position) => { viewer.camera = { ...viewer.camera, position }; }",
                  list(turned.position))  # fmt: skip
    button.click()
    page.ready()
    assert not page.evaluate("viewer.playing")
    page.assert_shows(series[series.nearest(page.evaluate("viewer.time"))], SIZE, turned)
    assert slider.input_value() == str(page.evaluate("viewer.series.nearest(viewer.time)"))
    page.evaluate("() => viewer.play({ rate: 50, loop: false })")
    page.wait_for("!viewer.playing")
    page.ready()
    page.assert_shows(series[N - 1], SIZE, turned)


@pytest.mark.slow
def test_a_damaged_step_is_named_and_the_next_is_shown(series, path, shown_from):
    files = folder_of(path) | {"ball.vdis/000003.vdi": b"broken" * 9}
    page = shown_from("ball.vdis/", files)
    seek(page, series.times[3])
    why = page.evaluate("viewer.ready.catch(({ message }) => message)")
    assert "step 3 cannot be shown: this is no VDI file" in why
    alert = page.page.locator("vdi-viewer p")
    assert why in alert.inner_text()
    seek(page, 0)
    page.ready()
    assert not alert.is_visible()


def test_the_first_step_is_shown_while_the_rest_comes(series, path, open_page):
    data = path.read_bytes()
    with zipfile.ZipFile(path) as archive:
        third = archive.getinfo("000002.vdi").header_offset
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
        [in_base64(data), third + 5],
    )
    page.wait_for("heard.some(([name]) => name === 'vditime')")
    assert page.evaluate("[viewer.series.times.length, viewer.series.complete]") == [2, False]
    page.evaluate("goOn()")
    page.wait_for("viewer.series.complete")
    assert page.evaluate("viewer.series.times") == list(series.times)
    assert page.page.get_by_label("Time", exact=True).get_attribute("max") == str(N - 1)


@pytest.mark.slow
def test_a_step_that_was_given_up_comes_when_the_element_is_back(series, path, shown_from):
    page = shown_from("ball.vdis", {"ball.vdis": path.read_bytes()})
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


def test_a_page_of_its_own_plays_from_disk_and_links_to_a_time(series, open_page, tmp_path):
    """It stands still for who asked for less motion, also in the midst of it."""
    path = series.save(tmp_path / "a ball.html", autoplay=True, background=(0.1, 0.2, 0.3))
    read = pvdi.read(path)
    assert isinstance(read, pvdi.VDISeries)
    assert read.times == series.times
    assert all(one.equals(other) for one, other in zip(read, series, strict=True))
    page = open_page(url=path.as_uri(), viewport={"width": 160, "height": 90})
    page.wait_for("viewer.series?.complete && viewer.playing && viewer.time > 1")
    assert page.page.title() == "a ball"
    page.page.emulate_media(reduced_motion="reduce")
    page.wait_for("!viewer.playing")
    seek(page, 4)
    page.assert_shows(series[8], SIZE, series.camera)
    page.wait_for("location.hash.endsWith('/time:4')")
    other = open_page(url=page.evaluate("location.href"), reduced_motion="reduce")
    other.wait_for("viewer.time === 4")
    other.ready()
    assert not other.evaluate("viewer.playing")
    np.testing.assert_array_equal(picture(other, SIZE), picture(page, SIZE))


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


# -- sets ------------------------------------------------------------------------------------------


def test_each_view_is_drawn_by_the_vdi_nearest_to_it(vdis, set_path, shown_from):
    page = shown_from("lumps.vdiset/", folder_of(set_path))
    np.testing.assert_allclose(page.evaluate("viewer.camera.position"), vdis.camera.position)
    assert page.evaluate("viewer.set") == {"length": VIEWS, "nearest": vdis.nearest(vdis.camera)}
    assert page.evaluate("[viewer.series, viewer.time, viewer.playing]") == [None, None, False]
    # The nearest, and its neighbours: not all
    names = {name.rpartition("/")[2] for name in page.asked}
    assert len({name for name in names if name[:6].isdigit()}) <= 5
    seen = set()
    for view in [vdis.camera, *orbit(vdis.camera, vdis.bounds, directions(5))]:
        page.assert_shows(vdis, SIZE, view)
        seen.add(vdis.nearest(view))
        assert page.evaluate("viewer.set.nearest") == vdis.nearest(view)
    assert len(seen) > 3
    # Of two eyes in one line the nearer one's distance counts as well
    near = vdis.camera.replace(position=0.5 * np.add(vdis.camera.position, vdis.camera.focal_point))
    page.assert_shows(vdis, SIZE, near)
    assert page.page.locator("vdi-viewer .controls").is_hidden()
    with pytest.raises(Exception, match="no series"):
        page.evaluate("viewer.play()")


def test_a_page_from_disk_has_the_set_in_it(vdis, set_path, open_page, tmp_path):
    page = pvdi.read(set_path).save(tmp_path / "lumps.html", title="Lumps", background=(1, 1, 1))
    again = pvdi.read(page)
    assert isinstance(again, pvdi.VDISet)
    assert all(one.equals(other) for one, other in zip(again, vdis, strict=True))
    assert again.camera == vdis.camera
    shown = open_page(url=page.as_uri())
    shown.ready()
    shown.wait_for("viewer.set.length === 14")  # the rest is read behind the first
    shown.assert_shows(vdis, SIZE, vdis.camera.azimuth(100))
    with pytest.raises(pvdi.InvalidArgumentError, match="controls"):
        pvdi.read(set_path).save(tmp_path / "b.html", controls="some")
    assert [each.name for each in tmp_path.iterdir()] == ["lumps.html"]


@pytest.mark.slow
def test_what_is_wrong_with_a_set_is_said(vdis, set_path, shown_from):
    """A view that is damaged is named, and others are shown."""
    files, nearest = folder_of(set_path), vdis.nearest(vdis.camera)
    head = json.loads(files["lumps.vdiset/set.json"]) | {"bounds": [1, 2]}
    wrong = {"lumps.vdiset/set.json": json.dumps(head).encode()}
    broken = {f"lumps.vdiset/{nearest:06}.vdi": b"broken" * 9}
    for change, why in (
        (wrong, "set.json says what cannot be"),
        (broken, f"view {nearest} cannot"),
    ):
        page = shown_from("lumps.vdiset/", files | change, ready=False)
        page.wait_for('heard.some(([name]) => name === "error")')
        assert why in page.evaluate('heard.find(([name]) => name === "error")[1].message')
    other = next(i for i in range(VIEWS) if i != nearest)
    view = orbit(vdis.camera, vdis.bounds, directions(VIEWS))[other]
    page.evaluate("(camera) => { viewer.camera = camera; }", view.to_dict())
    page.wait_for('viewer.status.state === "full"')
