"""The worst error of each test, kept and shown at the end: what docs/numerics.md reports."""

from __future__ import annotations

import pytest

MEASURED = pytest.StashKey[dict[tuple[str, str], list[float]]]()


@pytest.fixture
def worst(request):
    """Keep an error under what it is an error of; the largest of a test's cases is shown."""
    measured = request.config.stash.setdefault(MEASURED, {})
    name = request.node.originalname

    def keep(what, error):
        measured.setdefault((name, what), []).append(float(error))

    return keep


def pytest_terminal_summary(terminalreporter, config):
    measured = config.stash.get(MEASURED, {})
    if measured:
        terminalreporter.section("worst errors at the extremes")
        for (name, what), errors in sorted(measured.items()):
            text = f"{max(errors):8.1e}  of {len(errors):4d}  {name}: {what}"
            terminalreporter.write_line(text)
