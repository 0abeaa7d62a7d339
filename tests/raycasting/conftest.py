"""Rays followed in each of the ways that there are."""

from __future__ import annotations

import pytest
import strategies


@pytest.fixture(params=strategies.DEALT)
def dealt(request, runtime, monkeypatch):
    """How rays are followed, wherever they can be: one of ``strategies.DEALT``."""
    strategies.deal_rays(monkeypatch, runtime, request.param)
    return request.param
