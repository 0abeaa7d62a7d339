"""Volumetric Depth Images for VTK and PyVista.

A VDI is a compact, view-dependent, piecewise constant stand-in for a classified volume: made once,
raycast from new views, saved and opened without the volume. Importing this package loads neither
VTK nor PyVista nor a driver; each name below brings what it needs when it is first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from pyvista_vdi import errors
from pyvista_vdi._version import __version__
from pyvista_vdi.model import providers
from pyvista_vdi.plotting import registration

if TYPE_CHECKING:
    from pyvista_vdi import examples
    from pyvista_vdi.api import estimate, generate, pick, read, render, render_depth, render_volume
    from pyvista_vdi.device import describe_devices, list_devices
    from pyvista_vdi.device.report import Report
    from pyvista_vdi.errors import *
    from pyvista_vdi.extensions.series.generate import generate_series
    from pyvista_vdi.extensions.series.series import VDISeries
    from pyvista_vdi.extensions.series.writer import SeriesWriter
    from pyvista_vdi.extensions.sets.generate import generate_set
    from pyvista_vdi.extensions.sets.vdi_set import VDISet
    from pyvista_vdi.generation.estimate import Estimate
    from pyvista_vdi.io.stores import open_volume
    from pyvista_vdi.model.ambient_occlusion import AmbientOcclusion
    from pyvista_vdi.model.camera import Camera
    from pyvista_vdi.model.cropping import Cropping
    from pyvista_vdi.model.lighting import Light, Lights, Shading
    from pyvista_vdi.model.metrics import compare_images
    from pyvista_vdi.model.presets import presets
    from pyvista_vdi.model.transfer_function import TransferFunction
    from pyvista_vdi.model.vdi import VDI
    from pyvista_vdi.model.volume import Volume
    from pyvista_vdi.plotting.plotter import Plotter
    from pyvista_vdi.raycasting.picking import Pick
    from pyvista_vdi.vtk_pipeline import VDIActor, VDIMapper, VDISource

#: Where each public name lives; loaded when it is first used (PEP 562).
_HOMES = {
    "AmbientOcclusion": "model.ambient_occlusion",
    "Camera": "model.camera",
    "Cropping": "model.cropping",
    "Estimate": "generation.estimate",
    "Light": "model.lighting",
    "Lights": "model.lighting",
    "Pick": "raycasting.picking",
    "Plotter": "plotting.plotter",
    "Report": "device.report",
    "SeriesWriter": "extensions.series.writer",
    "Shading": "model.lighting",
    "TransferFunction": "model.transfer_function",
    "VDI": "model.vdi",
    "VDIActor": "vtk_pipeline",
    "VDIMapper": "vtk_pipeline",
    "VDISeries": "extensions.series.series",
    "VDISet": "extensions.sets.vdi_set",
    "VDISource": "vtk_pipeline",
    "Volume": "model.volume",
    "compare_images": "model.metrics",
    "describe_devices": "device",
    "estimate": "api",
    "generate": "api",
    "generate_series": "extensions.series.generate",
    "generate_set": "extensions.sets.generate",
    "list_devices": "device",
    "open_volume": "io.stores",
    "pick": "api",
    "presets": "model.presets",
    "read": "api",
    "render": "api",
    "render_depth": "api",
    "render_volume": "api",
    **dict.fromkeys(errors.__all__, "errors"),
}

__all__ = ["__version__", "errors", "examples", *sorted(_HOMES)]


registration.install()
# The composition root: what lower rooms need of upper ones, by name and loaded when asked for
providers.provide(
    by_absolute_path="pyvista_vdi.io.store_identity:by_absolute_path",
    exr_files="pyvista_vdi.extensions.deep_exr.files",
    html_files="pyvista_vdi.extensions.web.page",
    image_with_scalars="pyvista_vdi.plotting.volumes:as_image",
    range_keeper="pyvista_vdi.io.ranges:keeper_of",
    notebook_bundle="pyvista_vdi.extensions.web.notebook:mime_bundle",
    notebook_html="pyvista_vdi.extensions.web.notebook:html_of",
    plot="pyvista_vdi.plotting.accessor:plot",
    read_by_pyvista="pyvista_vdi.plotting.imports:read_volume",
    read_nrrd="pyvista_vdi.examples:read_nrrd",
    store_identity="pyvista_vdi.io.store_identity:identity_of",
    scene_pages="pyvista_vdi.extensions.web.scenes.export:export_html",
    temporal_volumes="pyvista_vdi.vtk_pipeline.filters.temporal:steps_and_times",
    thinned="pyvista_vdi.model.list_subsampling:subsampled_lists",
    transfer_function_from_arguments="pyvista_vdi.plotting.classify:transfer_function_from_arguments",
    transfer_function_from_property="pyvista_vdi.vtk_pipeline:transfer_function_from_property",
    vdi_from_image="pyvista_vdi.vtk_pipeline:vdi_from_image",
    volume_from_vtk="pyvista_vdi.vtk_pipeline:volume_from_vtk",
    vti_files="pyvista_vdi.vtk_pipeline.filters.vti",
    write_cinema="pyvista_vdi.extensions.sets.cinema:write",
    write_series="pyvista_vdi.extensions.series.writer:write",
    write_set="pyvista_vdi.extensions.sets.files:write",
    write_vdi="pyvista_vdi.io:write",
)


def __getattr__(name: str) -> Any:
    if name == "examples":
        return importlib.import_module(".examples", __name__)
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f".{_HOMES[name]}", __name__), name)
    globals()[name] = value  # also where a submodule of the same name has been imported
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
