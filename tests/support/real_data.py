"""Real volumes for tests: loaded, or the test is skipped by the volume's name."""

from __future__ import annotations

import os

import pytest

from pyvista_vdi import examples
from pyvista_vdi.errors import DataNotFoundError

#: Whether an hour is taken for all cases of the standard table in place of a sample.
TEST_WHOLE = os.environ.get("PYVISTA_VDI_TEST_WHOLE") == "1"


def require_data(name, *, as_volume=True):
    """Return ``examples.load_data(name)``; skip the test where its file is not at hand.

    A misspelt name is an error, not a skip.
    """
    try:
        return examples.load_data(name, as_volume=as_volume)
    except DataNotFoundError as error:
        pytest.skip(str(error))
