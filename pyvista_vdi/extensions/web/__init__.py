"""VDIs in a web page: the viewer's JavaScript, and what brings it there with a VDI."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pyvista_vdi.extensions.web.server import Server, serve
    from pyvista_vdi.extensions.web.widget import VDIWidget

#: Where each name lives: what needs aiohttp, and what needs anywidget, is loaded when it is used.
_HOMES = {"Server": "server", "VDIWidget": "widget", "serve": "server"}

__all__ = ["Server", "VDIWidget", "serve"]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f".{_HOMES[name]}", __name__), name)
