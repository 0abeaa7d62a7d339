"""Bars that show how far reading, writing, drawing and measuring are; a window without a screen."""

from __future__ import annotations

import io as text_io
import os
import shutil
import subprocess
import sys
from typing import ClassVar

import numpy as np
import pytest
from extension_marks import cases
from strategies import random_vdi
from virtual_screen import virtual_screen

import pyvista_vdi as pvdi
from pyvista_vdi import cli
from pyvista_vdi.cli import inputs
from pyvista_vdi.device import programs
from pyvista_vdi.errors import Cancelled
from pyvista_vdi.plotting import progress

VDI = random_vdi(np.random.default_rng(1))


class Bar:
    """Stands for every bar; keeps what it was told."""

    told: ClassVar[list] = []

    def __init__(self, label):
        self.label = label

    def __call__(self, fraction, doing=None):
        self.told.append((self.label, round(fraction, 6), doing))

    def pulse(self):
        pass

    def close(self):
        pass


@pytest.fixture
def told(monkeypatch):
    monkeypatch.setattr(inputs, "DelayedBar", Bar)
    monkeypatch.setattr(Bar, "told", [])
    return Bar.told


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


def test_convert_and_render_have_a_bar(told, tmp_path, default_runtime):
    files = [str(vdi.save(tmp_path / f"{i}.vdi")) for i, vdi in enumerate((VDI, VDI))]
    for verb, inputs_, target, last in (
        ("convert", files[:1], "b.vdi", ("converting", 1, "writing")),
        ("render", files, "a.png", ("rendering", 0.5, "drawing")),
    ):
        told.clear()
        assert cli.main([verb, *inputs_, "-o", str(tmp_path / target)]) == 0
        assert told[-1] == last
        assert {(label, doing) for label, _, doing in told} == {(last[0], "reading"), last[::2]}
        fractions = [fraction for _, fraction, _ in told]
        assert fractions == sorted(fractions)
        assert fractions[0] == 0
        assert len(set(fractions)) >= 3


def test_generate_has_a_bar_for_its_file(told, tmp_path, default_runtime):
    np.save(tmp_path / "v.npy", np.random.default_rng(1).random((8, 8, 8), np.float32))
    arguments = ["generate", str(tmp_path / "v.npy"), "-o", str(tmp_path / "a.vdi")]
    assert cli.main([*arguments, "--size", "16x12"]) == 0
    assert told[-1] == ("writing it", 1.0, None)


def test_a_bar_shows_the_time_where_work_does_not_say_how_far_it_is(monkeypatch):
    stream = text_io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    bar = progress.DelayedBar(always=True, label="rendering")

    def pulsed():
        before = len(stream.getvalue())
        bar.pulse()
        return stream.getvalue()[before:]

    assert pulsed() == ""  # not begun: nothing to show
    bar(0.5, "drawing")
    assert "rendering: drawing:  50%" in pulsed()
    bar.close()
    assert pulsed() == ""


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


def test_view_takes_a_display_that_is_there():
    pytest.importorskip("pyvista")
    if not sys.platform.startswith("linux") or shutil.which("Xvfb") is None:
        pytest.skip("Xvfb is not installed")
    code = "from pyvista_vdi.plotting.screen import why_no_window; print(why_no_window())"
    kept = {k: v for k, v in os.environ.items() if k != "VTK_DEFAULT_OPENGL_WINDOW"}
    with virtual_screen() as display:
        result = subprocess.run(
            [sys.executable, "-c", code],
            env={**kept, "DISPLAY": display},
            capture_output=True,
            text=True,
            check=False,
        )
    assert (result.returncode, result.stdout) == (0, "None\n"), result.stderr


def test_a_bar_says_that_kernels_are_compiled_while_they_are(capsys, monkeypatch):
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    monkeypatch.setattr(programs, "on_compiling", set())
    monkeypatch.setattr(progress, "on_compiling", programs.on_compiling)
    bar = progress.DelayedBar(always=True)
    bar(0.0)
    for tell in tuple(programs.on_compiling):
        tell()
    bar.pulse()
    assert "generating a VDI: compiling kernels:   0%" in capsys.readouterr().err
    bar(0.5)
    bar.pulse()
    assert "generating a VDI:  50%" in capsys.readouterr().err.split("\r")[-1]
    bar(1.0)
    assert not programs.on_compiling
