"""Files: writes and reads VDIs, whole or not at all."""

from __future__ import annotations

from .files import SUFFIXES, check_write_options, checked_target, read, read_info, write
from .layout import FORMAT_VERSION, SUFFIX
from .png import checked_png_target, to_bytes, write_png
from .reader import FileInfo
from .whole_file import check_writable, whole_file

__all__ = [
    "FORMAT_VERSION",
    "SUFFIX",
    "SUFFIXES",
    "FileInfo",
    "check_writable",
    "check_write_options",
    "checked_png_target",
    "checked_target",
    "read",
    "read_info",
    "to_bytes",
    "whole_file",
    "write",
    "write_png",
]
