"""Whether VTK can open a window that somebody sees."""

from __future__ import annotations

import os
import sys

from pyvista_vdi.plotting.imports import import_pyvista

#: VTK's windows that are on no screen.
_OFF_SCREEN = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")


def why_no_window() -> str | None:
    """Return why no window can be opened, or ``None``.

    VTK would draw off-screen, and return at once from showing what it drew.
    """
    if not sys.platform.startswith("linux"):
        return None
    display = os.environ.get("DISPLAY")
    if not display:
        return "DISPLAY names no X display"
    import_pyvista()  # says what is missing where VTK cannot be loaded
    from pyvista_vdi.vtk_pipeline.vtk import vtkRenderWindow

    kind = vtkRenderWindow().GetClassName()
    if kind not in _OFF_SCREEN:
        return None
    return (
        f"VTK draws in a {kind}, off-screen: the display {display} cannot be reached, or "
        "VTK_DEFAULT_OPENGL_WINDOW asks for it"
    )
