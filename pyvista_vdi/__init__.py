"""Volumetric Depth Images for VTK and PyVista.

A VDI is a compact, view-dependent, piecewise constant stand-in for a classified volume: made once,
raycast from new views, saved and opened without the volume. Importing this package loads neither
VTK nor PyVista nor a driver; each name below brings what it needs when it is first used.
"""

from __future__ import annotations

import importlib
from typing import Any

from pyvista_vdi import errors, registry
from pyvista_vdi._version import __version__
from pyvista_vdi.plotting import registration

#: Where each public name lives; loaded when it is first used (PEP 562).
_HOMES = {
    "AmbientOcclusion": "model.ambient_occlusion",
    "Camera": "model.camera",
    "DeferredVDI": "model.vdi",
    "Cropping": "model.cropping",
    "Light": "model.lighting",
    "Lights": "model.lighting",
    "Pick": "raycasting.picking",
    "Shading": "model.lighting",
    "TransferFunction": "model.transfer_function",
    "VDI": "model.vdi",
    "VDIActor": "vtk_pipeline",
    "VDIMapper": "vtk_pipeline",
    "VDISource": "vtk_pipeline",
    "Volume": "model.volume",
    "compare_images": "model.metrics",
    "describe_devices": "device",
    "list_devices": "device",
    "list_volumes": "io.volumes",
    "presets": "model.presets",
    "read_volume": "io.volumes",
    **dict.fromkeys(("Settings", "generate", "pick", "read"), "api"),
    **dict.fromkeys(("render", "render_depth", "render_volume"), "api"),
    **dict.fromkeys(errors.__all__, "errors"),
}

registration.install()
#: What the core itself brings in upper rooms, for lower ones, which may not import them.
registry.core = registry.Extension(
    formats=(
        registry.FileFormat(
            ".vdi",
            "pyvista_vdi.io.vdi_file",
            compressions=("lz4", "zstd", "deflate", "none"),
            values=True,
        ),
    ),
    methods={
        "Camera.to_pyvista": "pyvista_vdi.plotting.imports:camera_to_pyvista",
        "DeferredVDI.classified": "pyvista_vdi.api.vdis:classified",
        "TransferFunction.from_arguments": (
            "pyvista_vdi.plotting.classify:transfer_function_from_arguments"
        ),
        "TransferFunction.from_property": (
            "pyvista_vdi.vtk_pipeline:transfer_function_from_property"
        ),
        "VDI.from_image": "pyvista_vdi.vtk_pipeline:vdi_from_image",
        "VDI.save": "pyvista_vdi.io:write",
        "Volume.read": "pyvista_vdi.io.volumes:read_volume",
        "Volume.from_vtk": "pyvista_vdi.vtk_pipeline:volume_from_vtk",
        "Volume.with_scalars": "pyvista_vdi.plotting.volumes:as_grid",
        "volumes_in": "pyvista_vdi.plotting.imports:volumes_in",
    },
)


def __getattr__(name: str) -> Any:
    if name == "__all__":
        added = (n for each in registry.records() for n in each.names)
        return ["__version__", "errors", "examples", *sorted([*_HOMES, *added])]
    if name == "examples":
        return importlib.import_module(".examples", __name__)
    if name in _HOMES:
        value = getattr(importlib.import_module(f".{_HOMES[name]}", __name__), name)
    elif name.startswith("_") or (value := registry.placed("names", name)) is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value  # also where a submodule of the same name has been imported
    return value


def __dir__() -> list[str]:
    return sorted(__getattr__("__all__"))
