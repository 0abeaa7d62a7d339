"""Every window off-screen: see ``tests/support/off_screen.py``."""

from off_screen import closed, off_screen, vtk_messages

__all__ = ["closed", "off_screen", "vtk_messages"]
