"""VDIs in VTK pipelines: source, mapper, actor and converters; the only importers of vtk."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pyvista_vdi.vtk_pipeline.actor import VDIActor
    from pyvista_vdi.vtk_pipeline.convert import vdi_from_image, vdi_to_image, volume_from_vtk
    from pyvista_vdi.vtk_pipeline.dense import (
        VDIToDenseImage,
        vdi_from_dense_image,
        vdi_to_dense_image,
    )
    from pyvista_vdi.vtk_pipeline.files import VDIReader, VDIWriter
    from pyvista_vdi.vtk_pipeline.image import VDIToImage
    from pyvista_vdi.vtk_pipeline.mapper import VDIMapper
    from pyvista_vdi.vtk_pipeline.properties import transfer_function_from_property
    from pyvista_vdi.vtk_pipeline.source import VDISource
    from pyvista_vdi.vtk_pipeline.status import VDIStatus

#: Public name to module. Loaded when asked for: converters must not load VTK's OpenGL modules.
_MODULES = {
    "VDIActor": "actor",
    "VDIMapper": "mapper",
    "VDIReader": "files",
    "VDISource": "source",
    "VDIStatus": "status",
    "VDIToDenseImage": "dense",
    "VDIToImage": "image",
    "VDIWriter": "files",
    "transfer_function_from_property": "properties",
    "vdi_from_dense_image": "dense",
    "vdi_from_image": "convert",
    "vdi_to_dense_image": "dense",
    "vdi_to_image": "convert",
    "volume_from_vtk": "convert",
}

__all__ = [
    "VDIActor",
    "VDIMapper",
    "VDIReader",
    "VDISource",
    "VDIStatus",
    "VDIToDenseImage",
    "VDIToImage",
    "VDIWriter",
    "transfer_function_from_property",
    "vdi_from_dense_image",
    "vdi_from_image",
    "vdi_to_dense_image",
    "vdi_to_image",
    "volume_from_vtk",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
