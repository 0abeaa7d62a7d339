"""PyVista and VTK, or how to get them; imports neither by itself."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

from pyvista_vdi.errors import MissingDependencyError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.vtk_pipeline.vtk import explain_import_error

#: VTK's windows that are on no screen.
_OFF_SCREEN = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")


def import_pyvista() -> Any:
    """Return the module; MissingDependencyError says how to get it, or what VTK lacks."""
    try:
        import pyvista as pv
    except ImportError as error:
        if error.name == "pyvista":
            raise MissingDependencyError(
                'PyVista is not installed: install it by pip install "pyvista-vdi[plot]"'
            ) from error
        raise explain_import_error(error) from error
    return pv


def camera_to_pyvista(camera: Camera) -> Any:
    """Return a camera as PyVista's; see :meth:`Camera.to_pyvista`."""
    theirs = import_pyvista().Camera()
    from pyvista_vdi.vtk_pipeline.filters.view import aim

    aim(theirs, camera)
    return theirs


def volumes_in(file: Path) -> Any:
    """Return what PyVista's readers find in a file; MissingDependencyError says how to get them."""
    import_pyvista()
    from pyvista_vdi.plotting import files

    return files.volumes_in(file)


def why_no_window() -> str | None:
    """Return why VTK can open no window that somebody sees, or ``None``.

    It would draw off-screen, and return at once from showing what it drew.
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
