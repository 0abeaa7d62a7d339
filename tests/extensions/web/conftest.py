"""What the tests of this room share."""

import pytest
from browsers import chromium, file_of, open_page, shared_pages
from plugin_scenes import soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.model.standard_cases import filling_camera

__all__ = ["chromium", "data", "open_page", "settled_at_once", "shared_pages", "vdi"]


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


@pytest.fixture(scope="module")
def settled_at_once():
    """Have servers make full VDIs of views as soon as these rest."""
    from pyvista_vdi.extensions.web import session

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(session, "SETTLED", 0.0)
        yield
