"""From a classified volume to a VDI: march, merge and pack."""

from __future__ import annotations

from typing import Any

from pyvista_vdi._moved import moved_name


def __getattr__(name: str) -> Any:
    return moved_name("generation", name)
