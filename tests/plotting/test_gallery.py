"""The gallery's scripts write the pictures that are shown of them."""

from __future__ import annotations

import os
import runpy
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

CHECKOUT = Path(os.environ.get("PYVISTA_VDI_CHECKOUT") or Path(__file__).resolve().parents[2])
GALLERY = CHECKOUT / "docs" / "gallery"

#: Those that are run with every change; the others take as long, each, or longer.
QUICK = ("ct_pins", "ct_projections")

pytestmark = [
    pytest.mark.gl,
    pytest.mark.skipif(
        not GALLERY.is_dir(),
        reason="no documentation at hand: set PYVISTA_VDI_CHECKOUT to a checkout",
    ),
]


def scripts():
    """Name each script, most of them for the nightly run."""
    for script in sorted(GALLERY.glob("*.py")):
        marks = () if script.stem in QUICK else pytest.mark.slow
        yield pytest.param(script.stem, marks=marks)


@pytest.mark.every(3)
@pytest.mark.parametrize("name", [*scripts()])
def test_a_script_writes_its_picture(name, tmp_path, monkeypatch, default_runtime):
    pyvista = pytest.importorskip("pyvista")
    monkeypatch.setattr(pyvista, "OFF_SCREEN", True)
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(GALLERY / f"{name}.py"))
    assert [file.name for file in tmp_path.iterdir()] == [f"{name}.png"]
    shown = CHECKOUT / "docs" / "images" / f"gallery-{name}.jpg"
    stored = BytesIO()  # as docs/make_gallery.py does
    Image.open(tmp_path / f"{name}.png").convert("RGB").save(stored, "jpeg", quality=85)
    written, kept = (np.asarray(Image.open(file), dtype=float) for file in (stored, shown))
    assert written.shape == kept.shape
    # The same where it was made; fonts, drivers and devices differ in few pixels
    assert np.abs(written - kept).mean() < 1


def test_every_script_has_its_picture_and_says_what_it_is():
    found = sorted(GALLERY.glob("*.py"))
    assert 6 <= len(found) <= 12
    for script in found:
        text = script.read_text(encoding="utf-8")
        name = f"gallery-{script.stem}.jpg"
        assert f".. image:: /images/{name}\n   :alt: " in text
        assert f"sphinx_gallery_thumbnail_path = 'images/{name}'" in text
        assert (CHECKOUT / "docs" / "images" / name).stat().st_size <= 150 * 1024
