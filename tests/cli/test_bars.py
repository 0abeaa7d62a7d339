"""How far reading and writing are; a window without a screen."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from extension_marks import cases
from strategies import random_vdi

import pyvista_vdi as pvdi
from pyvista_vdi import cli
from pyvista_vdi.errors import Cancelled

VDI = random_vdi(np.random.default_rng(1))


@pytest.mark.parametrize("suffix", cases(".vdi", ".exr"))
def test_files_say_how_far_they_are(suffix, tmp_path):
    path, written, read = tmp_path / f"a{suffix}", [], []
    VDI.save(path, progress=written.append)
    found = pvdi.read(path, progress=read.append)
    assert suffix == ".exr" or found.equals(VDI)
    for fractions in (written, read):
        assert fractions == sorted(fractions)
        assert fractions[-1] == 1.0


def test_a_callback_ends_reading_and_writing(tmp_path):
    path = VDI.save(tmp_path / "a.vdi")
    before = path.read_bytes()
    with pytest.raises(Cancelled, match="reading or writing"):
        VDI.save(path, progress=lambda _: False)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    with pytest.raises(Cancelled, match="reading or writing"):
        pvdi.read(path, progress=lambda _: False)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems have a screen")
@pytest.mark.parametrize("display", [None, ":4711"])
def test_view_without_a_display_says_so(display, tmp_path, monkeypatch, capsys):
    pytest.importorskip("pyvista")
    if display is None:
        monkeypatch.delenv("DISPLAY", raising=False)
    else:
        monkeypatch.setenv("DISPLAY", display)
        monkeypatch.setenv("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    assert cli.main(["view", str(VDI.save(tmp_path / "a.vdi"))]) == 1
    error = capsys.readouterr().err
    assert error.startswith("pyvista-vdi: error: no window can be opened: ")
    assert error.endswith("write a picture instead: --screenshot FILE.png\n")
    assert ("DISPLAY names no X display" if display is None else display) in error
