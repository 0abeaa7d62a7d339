"""Every window off-screen: see ``tests/support/off_screen.py``."""

from off_screen import off_screen

__all__ = ["off_screen"]
