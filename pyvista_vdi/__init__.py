"""Volumetric Depth Images for VTK and PyVista.

A VDI is a compact, view-dependent, piecewise constant stand-in for a classified volume: made once,
raycast from new views, saved and opened without the volume. Importing this package loads neither
VTK nor PyVista nor a driver; each name below brings what it needs when it is first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from ._version import __version__

if TYPE_CHECKING:
    from . import errors, examples
    from .ambient_occlusion import AmbientOcclusion
    from .api import estimate, generate, pick, read, render, render_depth, render_volume
    from .camera import Camera
    from .cropping import Cropping
    from .errors import (
        Cancelled,
        DeviceError,
        DeviceMemoryError,
        InvalidArgumentError,
        InvalidCameraError,
        InvalidVDIError,
        InvalidVolumeError,
        KernelBuildError,
        MissingDependencyError,
        NoDeviceError,
        UnsupportedError,
        VDIError,
        VDIFileError,
        VDIWarning,
    )
    from .generation import Estimate
    from .lighting import Light, Lights, Shading
    from .metrics import compare_images
    from .opencl_runtime import describe_devices, list_devices
    from .picking import Pick
    from .transfer_function import TransferFunction
    from .vdi import VDI
    from .volume import Volume
    from .vtk_pipeline import VDIActor, VDIMapper, VDISource

_ERRORS = (
    "Cancelled",
    "DeviceError",
    "DeviceMemoryError",
    "InvalidArgumentError",
    "InvalidCameraError",
    "InvalidVDIError",
    "InvalidVolumeError",
    "KernelBuildError",
    "MissingDependencyError",
    "NoDeviceError",
    "UnsupportedError",
    "VDIError",
    "VDIFileError",
    "VDIWarning",
)

#: Where each public name lives; loaded when it is first used (PEP 562).
_HOMES = {
    "AmbientOcclusion": "ambient_occlusion",
    "Camera": "camera",
    "Cropping": "cropping",
    "Estimate": "generation",
    "Light": "lighting",
    "Lights": "lighting",
    "Pick": "picking",
    "Shading": "lighting",
    "TransferFunction": "transfer_function",
    "VDI": "vdi",
    "VDIActor": "vtk_pipeline",
    "VDIMapper": "vtk_pipeline",
    "VDISource": "vtk_pipeline",
    "Volume": "volume",
    "compare_images": "metrics",
    "describe_devices": "opencl_runtime",
    "estimate": "api",
    "generate": "api",
    "list_devices": "opencl_runtime",
    "pick": "api",
    "read": "api",
    "render": "api",
    "render_depth": "api",
    "render_volume": "api",
    **dict.fromkeys(_ERRORS, "errors"),
}

__all__ = ["__version__", "errors", "examples", *sorted(_HOMES)]


def __getattr__(name: str) -> Any:
    if name in ("errors", "examples"):
        return importlib.import_module(f".{name}", __name__)
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f".{_HOMES[name]}", __name__), name)
    globals()[name] = value  # also where a submodule of the same name has been imported
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
