"""Classified volumes on a device: upload, bricks, light, ambient occlusion, volume rendering."""

from __future__ import annotations

from typing import Any

from pyvista_vdi._moved import moved_name


def __getattr__(name: str) -> Any:
    return moved_name("volume", name)
