"""VDIs in a web page: the viewer's JavaScript, and what brings it there with a VDI."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pyvista_vdi.web.server import Server, serve

__all__ = ["Server", "serve"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from pyvista_vdi.web import server  # needs aiohttp

    return getattr(server, name)
