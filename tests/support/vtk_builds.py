"""What one build of VTK has, and another has not."""

from __future__ import annotations

import pytest

from pyvista_vdi.vtk_pipeline import vtk


def vtk_or_skip(name):
    """Return VTK's class; where the build in use lacks it, skip the test by that name."""
    try:
        return getattr(vtk, name)
    except ImportError:
        pytest.skip(f"{vtk.BACKEND} has no {name}")
