"""Files: writes and reads VDIs, whole or not at all."""

from __future__ import annotations

from pyvista_vdi.io.files import (
    check_write_options,
    checked_target,
    read,
    read_info,
    write,
)
from pyvista_vdi.io.png import to_bytes, write_png
from pyvista_vdi.model.whole_file import check_writable, whole_file

__all__ = [
    "check_writable",
    "check_write_options",
    "checked_target",
    "read",
    "read_info",
    "to_bytes",
    "whole_file",
    "write",
    "write_png",
]
