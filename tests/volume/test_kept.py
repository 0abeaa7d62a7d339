"""What is known of a volume is kept with it: calls that repeat copy no voxels to the device."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv

import pyvista_vdi as pvdi
from pyvista_vdi.device import Runtime

CAMERA = pvdi.Camera((30, 25, 20), (5.5, 4.5, 3.5), (0, 0, 1))


@pytest.fixture
def uploads(monkeypatch):
    """The names of what is uploaded."""
    names, upload = [], Runtime.upload

    def noted(self, array, name="", **more):
        names.append(name)
        return upload(self, array, name, **more)

    monkeypatch.setattr(Runtime, "upload", noted)
    return names


def changed(grid, what):
    """Change a grid in one of the ways that VTK notes."""
    if what == "values":
        grid["s"][:] = grid["s"][::-1].copy()
    elif what == "memory":
        np.asarray(grid["s"])[:] = 0.5
        grid.Modified()
    elif what == "spacing":
        grid.spacing = (2, 1, 1)
    else:
        grid["t"] = 1 - grid["s"]
        grid.set_active_scalars("t")


def picture(volume, runtime):
    look = {"cmap": "bone", "opacity": "linear", "clim": (0, 1)}
    return pvdi.render_volume(volume, CAMERA, (40, 30), **look, device=runtime)


@pytest.mark.parametrize("what", ["values", "memory", "spacing", "active scalars"])
def test_a_grid_is_read_again_when_it_has_changed(runtime, uploads, what):
    grid = pv.ImageData(dimensions=(12, 10, 8))
    grid["s"] = np.linspace(0, 1, 960, dtype=np.float32) ** 2
    first = picture(grid, runtime)
    uploads.clear()
    np.testing.assert_array_equal(picture(grid, runtime), first)
    assert set(uploads) == {"rays"}  # neither voxels nor tables
    changed(grid, what)
    found = picture(grid, runtime)
    assert np.abs(found - first).max() > 0.05
    np.testing.assert_array_equal(found, picture(grid.copy(), runtime))
