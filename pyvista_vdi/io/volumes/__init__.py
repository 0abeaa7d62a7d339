"""Volumes in files of many formats: one door, and a thin adapter for each format.

``formats.py`` has the formats; ``in_file.py`` makes a volume of what an adapter finds.
"""

from __future__ import annotations

from pyvista_vdi.io.volumes.read import list_volumes, read_volume

__all__ = ["list_volumes", "read_volume"]
