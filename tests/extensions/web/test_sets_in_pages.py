"""Sets in a page: each view is drawn by the VDI nearest to it, which is fetched when it is near."""

import json

import numpy as np
import pytest
from browsers import in_base64
from stored_frames import frames_of

import pyvista_vdi as pvdi
from pyvista_vdi.extensions.series import layout
from pyvista_vdi.extensions.sets import files
from pyvista_vdi.extensions.sets.sphere import orbit, spiral, spread
from pyvista_vdi.model.standard_cases import filling_camera

SIZE = (97, 55)


@pytest.fixture(scope="module")
def path(default_runtime, tmp_path_factory):
    z, y, x = np.meshgrid(*(np.linspace(-1, 1, 20),) * 3, indexing="ij")
    lumps = np.sin(5 * x) * np.cos(4 * y + 1) * np.sin(5 * z + 2)
    volume = pvdi.Volume(((1 + lumps) * (x**2 + y**2 + z**2 < 0.8)).astype("f4"))
    around = filling_camera(volume.bounds, SIZE)
    looks = {"cmap": "viridis", "opacity": "linear", "clim": (0, 2), "precision": "8-byte"}
    made = pvdi.VDISet.of(
        [
            pvdi.generate(volume, view, SIZE, max_supersegments=6, **looks)
            for view in orbit(around, volume.bounds, spread(14))
        ]
    )
    made.about["camera"] = around.to_dict()
    return made.save(tmp_path_factory.mktemp("sets") / "lumps.vdiset")


@pytest.fixture(scope="module")
def vdis(path):
    read = pvdi.read(path)
    read.blend = 0
    return read


@pytest.fixture(scope="module")
def data(path):
    return path.read_bytes()


@pytest.fixture
def turning(data, open_page):
    """A page that shows the set."""

    def turning(content=data, **options):
        return open_page(
            SIZE, attributes='src="lumps.vdiset"', files={"lumps.vdiset": content}, **options
        )

    return turning


def test_each_view_is_drawn_by_the_vdi_nearest_to_it(vdis, turning):
    page = turning()
    page.ready()
    np.testing.assert_allclose(page.evaluate("viewer.camera.position"), vdis.camera.position)
    assert page.evaluate("viewer.set") == {"length": 14, "nearest": vdis.nearest(vdis.camera)}
    assert page.evaluate("[viewer.series, viewer.time, viewer.playing]") == [None, None, False]
    seen = set()
    for view in [vdis.camera, *orbit(vdis.camera, vdis.bounds, spiral(7))]:
        page.assert_shows(vdis, SIZE, view)
        seen.add(vdis.nearest(view))
        assert page.evaluate("viewer.set.nearest") == vdis.nearest(view)
    assert len(seen) > 4
    # Of two eyes in one line the nearer one's distance counts as well
    near = vdis.camera.replace(position=0.5 * np.add(vdis.camera.position, vdis.camera.focal_point))
    page.assert_shows(vdis, SIZE, near)
    assert page.page.locator("vdi-viewer .controls").is_hidden()
    with pytest.raises(Exception, match="no series"):
        page.evaluate("viewer.play()")


def test_a_page_from_disk_has_the_set_in_it(vdis, path, open_page, tmp_path):
    page = pvdi.read(path).save(tmp_path / "lumps.html", title="Lumps", background=(1, 1, 1))
    again = pvdi.read(page)
    assert isinstance(again, pvdi.VDISet)
    assert all(one.equals(other) for one, other in zip(again, vdis, strict=True))
    assert again.camera == vdis.camera
    shown = open_page(url=page.as_uri())
    shown.ready()
    shown.wait_for("viewer.set.length === 14")  # the rest is read behind the first
    for view in [vdis.camera, vdis.camera.azimuth(100)]:
        shown.assert_shows(vdis, SIZE, view)
    with pytest.raises(pvdi.InvalidArgumentError, match="controls"):
        pvdi.read(path).save(tmp_path / "b.html", controls="some")
    assert [each.name for each in tmp_path.iterdir()] == ["lumps.html"]


@pytest.mark.slow
def test_views_are_fetched_as_it_turns(vdis, data, turning):
    page = turning(in_parts=("lumps.vdiset",))
    page.ready()
    places = [place for place, _ in frames_of(data)]

    def fetched():
        begun = {part[0] for name, part in page.asked if name == "lumps.vdiset" and part}
        return {i for i, place in enumerate(places) if place in begun}

    # The nearest, and those that a view which does not move heads for: not all
    page.wait_for("viewer.set.nearest >= 0")
    ahead = set(np.argsort(vdis.distances(vdis.camera), kind="stable")[:4].tolist())
    for _ in range(1000):
        if ahead <= fetched():
            break
        page.page.wait_for_timeout(20)
    assert ahead <= fetched()
    assert len(fetched()) <= 5
    # On its way around, what comes next is there before it is the nearest
    early = late = 0
    nearest = vdis.nearest(vdis.camera)
    for angle in range(8, 121, 8):
        view = vdis.camera.azimuth(angle)
        before = fetched()
        page.assert_shows(vdis, SIZE, view)
        if vdis.nearest(view) != nearest:
            nearest = vdis.nearest(view)
            early, late = early + (nearest in before), late + (nearest not in before)
    assert early >= 1
    assert late == 0


@pytest.mark.slow
def test_a_damaged_view_is_named_and_others_are_shown(vdis, data, turning):
    nearest = vdis.nearest(vdis.camera)
    place, header = frames_of(data)[nearest]
    broken = bytearray(data)
    broken[place + header.n_bytes // 2] ^= 0x55
    page = turning(bytes(broken), expected="damaged")
    page.wait_for('heard.some(([name]) => name === "error")')
    message = next(detail["message"] for name, detail in page.evaluate("heard") if name == "error")
    assert f"step {nearest} of the" in message
    other = next(i for i in range(14) if i != nearest)
    view = orbit(vdis.camera, vdis.bounds, spread(14))[other]
    page.evaluate("(camera) => { viewer.camera = camera; }", view.to_dict())
    page.wait_for('viewer.status.state === "full"')


def test_heads_that_are_wrong_are_said(data, open_page):
    begin = 20 + int.from_bytes(data[12:16], "little")
    page = open_page(SIZE)
    for change in ({"views": []}, {"bounds": [1, 2]}, {"views": [{"position": [0, 0, 0]}]}):
        head = {**json.loads(data[20:begin]), **change}
        content = layout.head_bytes(head, files.MAGIC) + data[begin:]
        said = page.evaluate(
            "(text) => viewer.load(bytesOf(text)).then(() => '', (error) => error.message)",
            in_base64(content[: begin + 5000]),
        )
        assert "does not say from where" in said
