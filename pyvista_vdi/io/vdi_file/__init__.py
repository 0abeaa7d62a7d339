"""The file format ``.vdi``: layout, chunks, checksums."""

from __future__ import annotations

from pyvista_vdi.io.vdi_file.reader import read, read_info
from pyvista_vdi.io.vdi_file.writer import write

__all__ = ["read", "read_info", "write"]
