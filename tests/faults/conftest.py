from __future__ import annotations

import pytest
from faulty_driver import Driver


@pytest.fixture
def driver(monkeypatch):
    """The driver of every device in this process, which fails when it is told to."""
    return Driver(monkeypatch)
