"""The VDIs on the documentation's pages, in a real browser, against the raycaster.

``PYVISTA_VDI_SITE`` names a built site, as `.ci/run` has one. Without it the pages' own HTML blocks
stand in a bare page, beside small VDIs that the same code makes.
"""

from __future__ import annotations

import importlib.util
import os
import re
from pathlib import Path

import numpy as np
import pytest
from browsers import LONG, Page

import pyvista_vdi as pvdi

CHECKOUT = Path(os.environ.get("PYVISTA_VDI_CHECKOUT") or Path(__file__).resolve().parents[2])
DOCS = CHECKOUT / "docs"
NAMES = {"brain.html", "rayleigh_taylor.html"}

pytestmark = pytest.mark.skipif(
    not (DOCS / "live.py").is_file(),
    reason="no documentation at hand: set PYVISTA_VDI_CHECKOUT to a checkout",
)


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
    made = live.make(folder / live.FOLDER, (120, 90))
    assert {path.name for path in made} == NAMES
    for name in ("index", "gallery"):
        text = (DOCS / f"{name}.md").read_text(encoding="utf-8")
        blocks = re.findall(r"^<(?:div|iframe).*?^$", text, re.MULTILINE | re.DOTALL)
        blocks = [block for block in blocks if "<iframe" in block]  # cards' pictures are not here
        body = "".join(block + '<p style="height: 1500px">' for block in blocks)
        content = f'<!doctype html><meta charset="utf-8">{body}'
        (folder / f"{name}.html").write_text(content, encoding="utf-8")
    return folder


@pytest.mark.slow  # .ci/run has it of the built site
@pytest.mark.parametrize("name", ["index", "gallery"])
def test_vdis_turn_on_the_page(site, chromium, name):
    context = chromium.new_context(viewport={"width": 1280, "height": 800})
    try:
        page = Page(context.new_page(), {}, None)
        page.page.goto((site / f"{name}.html").as_uri())
        frames = page.page.locator("iframe")
        assert frames.count() == 2
        seen = set()
        for k in range(2):
            frames.nth(k).scroll_into_view_if_needed()
            frame = frames.nth(k).element_handle().content_frame()
            frame.wait_for_function(
                "document.querySelector('vdi-viewer')?.status?.state === 'full'", timeout=LONG
            )
            path = site / "live" / Path(frame.url).name
            seen.add(path.name)
            box = frames.nth(k).bounding_box()
            assert box["width"] / box["height"] == pytest.approx(4 / 3, rel=0.02)
            turns_as_python_says(page.page, frame, box, pvdi.read(path))
        assert seen == NAMES
        assert not page.complaints
    finally:
        context.close()


def turns_as_python_says(page, frame, box, vdi):
    """Drag in the page; the picture is then the raycaster's from where the drag led."""
    frame.evaluate(
        """async () => {
          window.viewer = document.querySelector("vdi-viewer");
          await viewer.ready;
        }"""
    )
    before = frame.evaluate("viewer.camera.position")
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 30, y + 10)
    page.mouse.up()
    frame.wait_for_function(
        "(before) => viewer.camera.position.some((c, k) => c !== before[k])", arg=before
    )
    camera = frame.evaluate("viewer.camera")
    turned = vdi.camera.replace(
        position=camera["position"], focal_point=camera["focal_point"], view_up=camera["view_up"]
    )
    width, height = 120, 90
    data = frame.evaluate(
        """async ([width, height]) =>
          Array.from((await viewer.screenshot({ width, height })).data)""",
        [width, height],
    )
    got = np.array(data).reshape(height, width, 4)
    want = np.rint(pvdi.render(vdi, turned, (width, height)) * 255)
    assert want[..., 3].max() > 200  # something is seen
    off = np.abs(got - want).max(axis=2)
    # The bound, as in test_one_file.py
    assert (off <= 2).mean() >= 0.999


def test_the_first_page_is_light(site):
    """Two VDIs of a few MB, and frames that wait until they are near the screen."""
    sizes = [(site / "live" / name).stat().st_size for name in NAMES]
    assert sum(sizes) < 10e6
    for name in ("index", "gallery"):
        text = (site / f"{name}.html").read_text(encoding="utf-8")
        assert (
            len(re.findall(r"<iframe [^>]*loading=\"lazy\"", text)) == text.count("<iframe ") == 2
        )
