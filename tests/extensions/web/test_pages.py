"""Pages with a VDI as files: every bit back, and refused by name where they are something else."""

from __future__ import annotations

import re

import numpy as np
import pytest
from strategies import random_vdi

import pyvista_vdi as pvdi
from pyvista_vdi import io
from pyvista_vdi.errors import VDIFileError


def small_vdi(seed=1):
    return random_vdi(np.random.default_rng(seed))


@pytest.mark.parametrize("precision", [None, "exact", "8-byte"])
def test_reading_gives_back_every_bit(precision, tmp_path):
    for seed in range(4):
        vdi = small_vdi(seed)
        path = vdi.save(tmp_path / "a.HTML", precision=precision)
        back = pvdi.read(path)
        assert back.equals(vdi.with_precision(precision or "8-byte")), seed
        assert back.precision == (precision or "8-byte")


def test_the_page_says_what_it_is(tmp_path):
    path = small_vdi().save(tmp_path / "a.html", title='<Knee> & "co"', background=(1, 0.5, 0))
    text = path.read_text(encoding="utf-8")
    assert "<title>&lt;Knee&gt; &amp; &quot;co&quot;</title>" in text
    assert "rgb(100% 50% 0%)" in text
    assert not re.search(r"https?://(?!www\.w3\.org)", text), "nothing is loaded from elsewhere"
    info = io.read_info(path)
    assert (info.path, info.codec, info.format_version) == (path, "deflate", 4)
    assert io.is_vdi_file(path)
    unnamed = small_vdi().save(tmp_path / "small.html").read_text(encoding="utf-8")
    assert "<title>small</title>" in unnamed


def test_a_foreign_page(tmp_path):
    path = tmp_path / "a.html"
    path.write_text("<!doctype html><p>hello")
    assert io.is_vdi_file(path)  # by its name: no volume has it, and the sentence is a page's
    for read in (pvdi.read, io.read_info):
        with pytest.raises(VDIFileError, match=r"a\.html is not a page with a VDI: it has no"):
            read(path)
    path.unlink()
    with pytest.raises(VDIFileError, match="No such file"):
        pvdi.read(path)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda text: text.replace(b"UEsDB", b"UEs*B", 1), "is no base64"),
        (lambda text: text[: len(text) - 400], "is truncated"),
        (lambda text: text.replace(b"UEsDB", b"AEsDB", 1), "is not a VDI file"),
    ],
)
def test_damaged_pages(change, why, tmp_path):
    page = small_vdi().save(tmp_path / "small.html")
    page.write_bytes(change(page.read_bytes()))
    with pytest.raises(VDIFileError, match=rf"small\.html {why}|damaged: .*{why}"):
        pvdi.read(page)
