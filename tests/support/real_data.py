"""Real volumes for tests: loaded, or the test is skipped by the volume's name."""

from __future__ import annotations

import pytest

from pyvista_vdi import examples
from pyvista_vdi.errors import DataNotFoundError


def require_data(name, *, as_volume=True):
    """Return ``examples.load_data(name)``; skip the test where its file is not at hand.

    A misspelt name is an error, not a skip.
    """
    try:
        return examples.load_data(name, as_volume=as_volume)
    except DataNotFoundError as error:
        pytest.skip(str(error))
