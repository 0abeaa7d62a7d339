"""Sets in a page: each view is drawn by the VDI nearest to it, which is fetched when it is near."""

import json
import zipfile

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi.extensions.sets.generate import orbit, spread
from pyvista_vdi.model.standard_cases import filling_camera

SIZE = (97, 55)


def directions(n):
    return spread(n, (0, 0, 1), 180)


@pytest.fixture(scope="module")
def path(default_runtime, tmp_path_factory):
    z, y, x = np.meshgrid(*(np.linspace(-1, 1, 20),) * 3, indexing="ij")
    lumps = np.sin(5 * x) * np.cos(4 * y + 1) * np.sin(5 * z + 2)
    volume = pvdi.Volume(((1 + lumps) * (x**2 + y**2 + z**2 < 0.8)).astype("f4"))
    around = filling_camera(volume.bounds, SIZE)
    looks = {"cmap": "viridis", "opacity": "linear", "clim": (0, 2), "precision": "8-byte"}
    vdis = [
        pvdi.generate(volume, view, SIZE, max_supersegments=6, **looks)
        for view in orbit(around, volume.bounds, directions(14))
    ]
    made = pvdi.VDISet(vdis, camera=around, window_size=SIZE)
    return made.save(tmp_path_factory.mktemp("sets") / "lumps.vdiset", compression="deflate")


@pytest.fixture(scope="module")
def vdis(path):
    read = pvdi.read(path)
    read.blend = 0
    return read


@pytest.fixture(scope="module")
def data(path):
    return path.read_bytes()


@pytest.fixture(scope="module")
def folder(path):
    """The files of the set's folder."""
    with zipfile.ZipFile(path) as archive:
        return {f"lumps.vdiset/{name}": archive.read(name) for name in archive.namelist()}


@pytest.fixture
def turning(data, open_page):
    """A page that shows the set."""

    def turning(files=None, **options):
        files = files or {"lumps.vdiset": data}
        source = min(files).partition("/")
        attributes = f'src="{source[0]}{source[1]}"'
        return open_page(SIZE, attributes=attributes, files=files, **options)

    return turning


def test_each_view_is_drawn_by_the_vdi_nearest_to_it(vdis, turning):
    page = turning()
    page.ready()
    np.testing.assert_allclose(page.evaluate("viewer.camera.position"), vdis.camera.position)
    assert page.evaluate("viewer.set") == {"length": 14, "nearest": vdis.nearest(vdis.camera)}
    assert page.evaluate("[viewer.series, viewer.time, viewer.playing]") == [None, None, False]
    seen = set()
    for view in [vdis.camera, *orbit(vdis.camera, vdis.bounds, directions(7))]:
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
def test_views_are_fetched_as_it_turns(vdis, folder, turning):
    page = turning(folder)
    page.ready()

    def fetched():
        names = {name.rpartition("/")[2] for name in page.asked}
        return {int(name[:6]) for name in names if name[:6].isdigit()}

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
def test_a_damaged_view_is_named_and_others_are_shown(vdis, folder, turning):
    nearest = vdis.nearest(vdis.camera)
    page = turning(folder | {f"lumps.vdiset/{nearest:06}.vdi": b"broken" * 9}, expected="no VDI")
    page.wait_for('heard.some(([name]) => name === "error")')
    message = next(detail["message"] for name, detail in page.evaluate("heard") if name == "error")
    assert f"view {nearest} cannot be shown" in message
    other = next(i for i in range(14) if i != nearest)
    view = orbit(vdis.camera, vdis.bounds, directions(14))[other]
    page.evaluate("(camera) => { viewer.camera = camera; }", view.to_dict())
    page.wait_for('viewer.status.state === "full"')


@pytest.mark.parametrize("change", [{"views": []}, {"bounds": [1, 2]}, {"camera": {}}])
def test_what_the_json_says_wrongly_is_said(change, folder, turning):
    head = json.loads(folder["lumps.vdiset/set.json"]) | change
    page = turning({"lumps.vdiset/set.json": json.dumps(head).encode()}, expected="damaged")
    page.wait_for('heard.some(([name]) => name === "error")')
    message = next(detail["message"] for name, detail in page.evaluate("heard") if name == "error")
    assert "set.json says what cannot be" in message
