"""VDIs of a running simulation: each rank hands in its block, the first one writes."""

from __future__ import annotations

from pyvista_vdi.extensions.insitu.writer import InSitu

__all__ = ["InSitu"]
