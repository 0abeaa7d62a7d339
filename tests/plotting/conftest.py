"""Every window off-screen, what VTK writes a failure: see ``tests/support/off_screen.py``."""

from off_screen import closed, expected_messages, no_leaks, off_screen, plotter, vtk_messages

__all__ = ["closed", "expected_messages", "no_leaks", "off_screen", "plotter", "vtk_messages"]
