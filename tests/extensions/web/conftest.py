"""What the tests of this room share."""

import pytest
from browsers import chromium, open_page, shared_pages

__all__ = ["chromium", "open_page", "settled_at_once", "shared_pages"]


@pytest.fixture(scope="module")
def settled_at_once():
    """Have servers make full VDIs of views as soon as these rest."""
    from pyvista_vdi.extensions.web import session

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(session, "SETTLED", 0.0)
        yield
