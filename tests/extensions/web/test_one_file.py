"""One file with viewer and VDI: from disk, offline, in a real browser."""

import numpy as np
import pytest
from strategies import random_vdi

import pyvista_vdi as pvdi
from pyvista_vdi.errors import VDIFileError

SIZE = (160, 90)
VIEWPORT = {"width": 320, "height": 180}


@pytest.fixture
def open_file(open_page, tmp_path):
    """Write a page and open it."""

    def open_file(content, name="a.html", **how):
        (tmp_path / name).write_bytes(content)
        return open_page(url=(tmp_path / name).as_uri(), viewport=VIEWPORT, **how)

    return open_file


def test_the_picture_is_python_s(vdi, open_file, tmp_path):
    name = "a page & <more>.HTML"
    page = open_file(vdi.save(tmp_path / name, precision="exact").read_bytes(), name)
    page.ready()
    assert page.page.title() == "a page & <more>"
    assert pvdi.read(tmp_path / name).equals(vdi)
    for camera in (vdi.camera.azimuth(25), vdi.camera.azimuth(180)):
        got = page.screenshot(camera, SIZE).astype(int)
        off = np.abs(got - np.rint(pvdi.render(vdi, camera, SIZE) * 255)).max(axis=2)
        # Where a ray runs along a border, one list or the other is met
        assert (off <= 2).mean() >= 0.999
        assert off.max() <= 24
    assert page.evaluate("[viewer.clientWidth, viewer.clientHeight]") == [320, 180]


def test_without_scripts_there_is_the_still_picture(vdi, open_page, tmp_path):
    url = vdi.save(tmp_path / "a.html").as_uri()
    page = open_page(url=url, viewport=VIEWPORT, java_script_enabled=False).page
    image = page.locator("vdi-viewer > img")
    assert image.is_visible()
    assert (image.bounding_box()["width"], image.bounding_box()["height"]) == SIZE
    assert "Scripts are turned off" in page.locator("noscript").inner_text()


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda text: text.replace(b"UEsDB", b"UEs*DB", 1), "is no base64"),
        (lambda text: text[: len(text) - 400], "is truncated"),
        (lambda text: text.replace(b"UEsDB", b"AEsDB", 1), "is not a VDI file"),
        (lambda _: b"<!doctype html><p>hello", "is not a page with a VDI: it has no"),
    ],
)
def test_damaged_pages(change, why, tmp_path):
    page = random_vdi(np.random.default_rng(1)).save(tmp_path / "small.html")
    page.write_bytes(change(page.read_bytes()))
    with pytest.raises(VDIFileError, match=rf"small\.html {why}|damaged: .*{why}"):
        pvdi.read(page)
