"""The worst error of each test, kept and shown at the end: what docs/dev/numerics.md reports."""

from __future__ import annotations

import itertools

import pytest

#: Names the errors among what a report carries, as it does from the process of pytest-xdist, too.
WORST = "worst error"


@pytest.fixture
def worst(request):
    """Keep an error under what it is an error of; the largest of a test's cases is shown."""
    node = request.node

    def keep(what, error):
        node.user_properties.append((WORST, (node.originalname, what, float(error))))

    return keep


def pytest_terminal_summary(terminalreporter):
    measured: dict[tuple[str, str], list[float]] = {}
    for report in itertools.chain(*terminalreporter.stats.values()):
        if getattr(report, "when", None) == "call":
            for key, value in report.user_properties:
                if key == WORST:
                    name, what, error = value
                    measured.setdefault((name, what), []).append(error)
    if measured:
        terminalreporter.section("worst errors at the extremes")
        for (name, what), errors in sorted(measured.items()):
            text = f"{max(errors):8.1e}  of {len(errors):4d}  {name}: {what}"
            terminalreporter.write_line(text)
