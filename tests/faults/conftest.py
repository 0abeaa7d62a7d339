from __future__ import annotations

import gc

import pytest
from faulty_driver import Driver


@pytest.fixture
def driver(monkeypatch):
    """The driver of every device in this process, which fails when it is told to."""
    return Driver(monkeypatch)


@pytest.fixture(scope="module", autouse=True)
def _all_objects_afterwards():
    yield
    gc.unfreeze()


@pytest.fixture(autouse=True)
def _only_new_objects(_all_objects_afterwards):
    """Leave what was there before out of garbage collections, of which these tests need many."""
    gc.collect()
    gc.freeze()
