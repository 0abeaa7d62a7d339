"""Windows off-screen, or watched; what VTK writes a failure: ``tests/support`` has the fixtures."""

from off_screen import closed, expected_messages, no_leaks, off_screen, vtk_messages
from watched_windows import coarsest, gate, no_estimates, plotter

__all__ = [
    "closed",
    "coarsest",
    "expected_messages",
    "gate",
    "no_estimates",
    "no_leaks",
    "off_screen",
    "plotter",
    "vtk_messages",
]
