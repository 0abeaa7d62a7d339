"""VDIs of a running simulation: each rank hands in its block, the first one writes."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from pyvista_vdi.registry import Extension

if TYPE_CHECKING:
    from pyvista_vdi.extensions.insitu.writer import InSitu

__all__ = ["InSitu"]

EXTENSION = Extension(requires=("large", "series"))


def __getattr__(name: str) -> Any:
    if name != "InSitu":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return importlib.import_module(f"{__name__}.writer").InSitu
