"""Off-screen OpenGL for the plugin's tests, warnings of VTK as failures, and a look for leaks."""

from __future__ import annotations

import contextlib
import gc
import os
import sys

import pytest

if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
    # Read when the first window is made; without it VTK warns about the missing X server
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")

import pyvista as pv

from pyvista_vdi.vtk_pipeline.vtk import (
    vtkObjectBase,
    vtkOutputWindow,
    vtkStringOutputWindow,
    vtkVersion,
)


@pytest.fixture(autouse=True)
def off_screen(default_runtime, monkeypatch):
    """Every window off-screen, with PyVista's default theme."""
    monkeypatch.setattr(pv, "OFF_SCREEN", True)


@pytest.fixture(autouse=True)
def vtk_messages(off_screen):
    """Fail on anything that VTK writes to its output window."""
    with _caught() as window:
        yield
    assert window.GetOutput() == ""


@pytest.fixture(autouse=True)
def closed(vtk_messages):
    """Close all plotters of a test, whatever becomes of it."""
    yield
    pv.close_all()


@pytest.fixture
def expected_messages(vtk_messages):
    """What VTK writes to its output window, which is no failure here."""
    with _caught() as window:
        yield window


@contextlib.contextmanager
def _caught():
    window, before = vtkStringOutputWindow(), vtkOutputWindow.GetInstance()
    vtkOutputWindow.SetInstance(window)
    try:
        yield window
    finally:
        vtkOutputWindow.SetInstance(before)


@pytest.fixture
def plotter(request, vtk_messages):
    """A plotter of the size that the test's module calls ``WINDOW``."""
    plotter = pv.Plotter(window_size=request.module.WINDOW)
    yield plotter
    plotter.close()


@pytest.fixture
def no_leaks():
    """Fail if VTK objects that were made in the test outlive it; from VTK 9.7 on.

    Older ones keep some themselves: the same test, all else the same, leaves 34 objects with 9.4.2
    to 9.6.0 and none with 9.7.2.
    """
    if (vtkVersion.GetVTKMajorVersion(), vtkVersion.GetVTKMinorVersion()) < (9, 7):
        yield
        return
    gc.collect()

    def alive():
        # By type(): isinstance() would ask weak proxies, whose object may be gone
        return [o for o in gc.get_objects() if issubclass(type(o), vtkObjectBase)]

    before = {id(o) for o in alive()}
    yield
    pv.close_all()
    gc.collect()
    after = [o for o in alive() if id(o) not in before]
    assert not after, f"{len(after)} VTK objects left: {sorted({type(o).__name__ for o in after})}"
