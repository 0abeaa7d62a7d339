"""Files: writes and reads VDIs, whole or not at all."""

from __future__ import annotations

from .layout import FORMAT_VERSION, SUFFIX
from .png import checked_png_target, to_bytes, write_png
from .reader import FileInfo, read, read_info
from .whole_file import check_writable, whole_file
from .writer import checked_target, write

__all__ = [
    "FORMAT_VERSION",
    "SUFFIX",
    "FileInfo",
    "check_writable",
    "checked_png_target",
    "checked_target",
    "read",
    "read_info",
    "to_bytes",
    "whole_file",
    "write",
    "write_png",
]
