"""The VDIs on the documentation's pages, in a real browser, against the raycaster.

``PYVISTA_VDI_SITE`` names a built site, as `.ci/run` has one. Without it the pages' own HTML blocks
stand in a bare page, beside small VDIs that the same code makes.
"""

import importlib.util
import os
import re
from pathlib import Path

import numpy as np
import pytest
from browsers import LONG, picture

import pyvista_vdi as pvdi

CHECKOUT = Path(os.environ.get("PYVISTA_VDI_CHECKOUT") or Path(__file__).resolve().parents[3])
DOCS = CHECKOUT / "docs"
NAMES = {"brain.html", "rayleigh_taylor.html"}
SIZE = (120, 90)

pytestmark = [
    pytest.mark.slow,  # .ci/run has it of the built site
    pytest.mark.skipif(
        not (DOCS / "live.py").is_file(),
        reason="no documentation at hand: set PYVISTA_VDI_CHECKOUT to a checkout",
    ),
]


@pytest.fixture(scope="module")
def site(tmp_path_factory, default_runtime):
    """A folder with index.html, gallery.html and the pages of the VDIs."""
    built = os.environ.get("PYVISTA_VDI_SITE")
    if built:
        return Path(built)
    pytest.importorskip("pyvista")
    folder = tmp_path_factory.mktemp("site")
    spec = importlib.util.spec_from_file_location("live", DOCS / "live.py")
    live = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(live)
    assert {path.name for path in live.make(folder / live.FOLDER, SIZE)} == NAMES
    for name in ("index", "gallery"):
        text = (DOCS / f"{name}.md").read_text(encoding="utf-8")
        blocks = re.findall(r"^<(?:div|iframe).*?^$", text, re.MULTILINE | re.DOTALL)
        blocks = [block for block in blocks if "<iframe" in block]  # cards' pictures are not here
        body = "".join(block + '<p style="height: 1500px">' for block in blocks)
        content = f'<!doctype html><meta charset="utf-8">{body}'
        (folder / f"{name}.html").write_text(content, encoding="utf-8")
    return folder


@pytest.mark.parametrize("name", ["index", "gallery"])
def test_vdis_turn_on_the_page(site, open_page, name):
    """Dragged in the page; the picture is then the raycaster's from where the drag led."""
    page = open_page(viewport={"width": 1280, "height": 800}).page
    page.goto((site / f"{name}.html").as_uri())
    frames = page.locator("iframe")
    assert frames.count() == 2
    seen = set()
    for k in range(2):
        frames.nth(k).scroll_into_view_if_needed()
        frame = frames.nth(k).element_handle().content_frame()
        loaded = "document.querySelector('vdi-viewer')?.status?.state === 'full'"
        frame.wait_for_function(loaded, timeout=LONG)
        frame.evaluate(
            """async () => {
              window.viewer = document.querySelector("vdi-viewer");
              await viewer.ready;
            }"""
        )
        path = site / "live" / Path(frame.url).name
        seen.add(path.name)
        box, before = frames.nth(k).bounding_box(), frame.evaluate("viewer.camera.position")
        assert box["width"] / box["height"] == pytest.approx(4 / 3, rel=0.02)
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 30, y + 10)
        page.mouse.up()
        frame.wait_for_function(
            "(before) => viewer.camera.position.some((c, k) => c !== before[k])", arg=before
        )
        camera, vdi = frame.evaluate("viewer.camera"), pvdi.read(path)
        keys = ("position", "focal_point", "view_up")
        turned = vdi.camera.replace(**{key: camera[key] for key in keys})
        want = np.rint(pvdi.render(vdi, turned, SIZE) * 255)
        assert want[..., 3].max() > 200  # something is seen
        # The bound, as in test_one_file.py
        assert (np.abs(picture(frame, SIZE) - want).max(axis=2) <= 2).mean() >= 0.999
    assert seen == NAMES


def test_the_first_page_is_light(site):
    """Two VDIs of a few MB, and frames that wait until they are near the screen."""
    assert sum((site / "live" / name).stat().st_size for name in NAMES) < 10e6
    for name in ("index", "gallery"):
        text = (site / f"{name}.html").read_text(encoding="utf-8")
        lazy = re.findall(r"<iframe [^>]*loading=\"lazy\"", text)
        assert len(lazy) == text.count("<iframe ") == 2
