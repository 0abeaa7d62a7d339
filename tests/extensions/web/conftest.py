"""What the tests of this room share."""

import pytest
from browsers import chromium, file_of, open_page, shared_pages
from plugin_scenes import soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.model.standard_cases import filling_camera

__all__ = ["chromium", "data", "open_page", "shared_pages", "vdi"]


@pytest.fixture(scope="module")
def vdi(request, default_runtime):
    """A ball, for the SIZE of the file that asks."""
    volume, size = soft_ball(), request.module.SIZE
    camera = filling_camera(volume.bounds, size)
    return pvdi.generate(volume, camera, size, cmap="viridis", clim=(0, 1))


@pytest.fixture(scope="module")
def data(vdi):
    """The bytes of its file."""
    return file_of(vdi)
