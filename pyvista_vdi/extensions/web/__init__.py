"""VDIs in a web page: the viewer's JavaScript, and what brings it there with a VDI."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from pyvista_vdi.registry import Extension, FileFormat, Verb

if TYPE_CHECKING:
    from pyvista_vdi.extensions.web.server import Server, serve
    from pyvista_vdi.extensions.web.widget import VDIWidget

#: Where each name lives: what needs aiohttp, and what needs anywidget, is loaded when it is used.
_HOMES = {"Server": "server", "VDIWidget": "widget", "serve": "server"}

__all__ = ["Server", "VDIWidget", "serve"]

#: What the transfer function of a page that keeps values begins with: words of ``classified``.
_LOOK = (
    *("cmap", "opacity", "clim", "n_colors", "flip_scalars", "log_scale"),
    *("opacity_unit_distance", "transfer_function", "volume_property"),
)

EXTENSION = Extension(
    formats=(
        FileFormat(
            ".html",
            "pyvista_vdi.extensions.web.page",
            write_options=("title", "background", *_LOOK),
            compressions=("deflate",),
            page=True,
            values=True,
        ),
    ),
    verbs=(
        Verb(
            "serve",
            "serve VDIs of a volume to web pages that turn it",
            "pyvista-vdi serve knee.nrrd --cmap bone --opacity sigmoid_6",
            "pyvista_vdi.extensions.web.cli:OPTIONS",
            "pyvista_vdi.extensions.web.cli:serve",
        ),
    ),
    methods={
        "VDI._repr_mimebundle_": "pyvista_vdi.extensions.web.notebook:mime_bundle",
        "plotter.vdi.export_html": "pyvista_vdi.extensions.web.scene:export_html",
    },
    requires=("series", "sets"),  # which pages show as well
)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f".{_HOMES[name]}", __name__), name)
