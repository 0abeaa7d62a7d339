"""Documented modules under their former names: importable for one release, with a warning.

One table says where each has gone. A finder behind Python's own answers imports of the old names;
the module that it returns looks its names up in the module of today.
"""

from __future__ import annotations

import importlib
import sys
import warnings
from collections.abc import Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

_PACKAGE = "pyvista_vdi"

#: Former module to that of today, both without the package's name.
MODULES = {
    "ambient_occlusion": "model.ambient_occlusion",
    "background": "quality.background",
    "benchmark": "measure.paper",
    "camera": "model.camera",
    "compare": "measure.compare",
    "cropping": "model.cropping",
    "dial": "quality.dial",
    "dial_measurement": "quality.probe",
    "frame_rate": "quality.frame_rate",
    "lighting": "model.lighting",
    "metrics": "model.metrics",
    "opencl_runtime": "device",
    "picking": "raycasting.picking",
    "standard_cases": "model.standard_cases",
    "tradeoff": "measure.tradeoff",
    "transfer_function": "model.transfer_function",
    "vdi": "model.vdi",
    "view_error": "quality.view_error",
    "vtk_pipeline.actor": "vtk_pipeline.drawing.actor",
    "vtk_pipeline.convert": "vtk_pipeline.filters.convert",
    "vtk_pipeline.dense": "vtk_pipeline.filters.dense",
    "vtk_pipeline.files": "vtk_pipeline.filters.files",
    "vtk_pipeline.image": "vtk_pipeline.filters.image",
    "vtk_pipeline.mapper": "vtk_pipeline.drawing.mapper",
    "vtk_pipeline.properties": "vtk_pipeline.filters.properties",
    "vtk_pipeline.source": "vtk_pipeline.filters.source",
    "vtk_pipeline.status": "vtk_pipeline.interaction.status",
}

#: Names of modules whose former name is a package's today.
NAMES = {
    "generation": {
        "Estimate": "generation.estimate",
        "generate_vdi": "generation.generate",
    },
    "volume": {"Volume": "model.volume"},
}


class _Finder(MetaPathFinder, Loader):
    """Finds modules by their old names; asked only for what Python itself does not find."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        package, _, name = fullname.partition(".")
        if package != _PACKAGE or name not in MODULES:
            return None
        return ModuleSpec(fullname, self, is_package=True)

    def exec_module(self, module: ModuleType) -> None:
        old = module.__name__
        new = f"{_PACKAGE}.{MODULES[old.partition('.')[2]]}"
        _warn(old, new)
        module.__doc__ = f"Today: :mod:`{new}`."
        module.__getattr__ = lambda name: getattr(importlib.import_module(new), name)  # type: ignore[method-assign]
        module.__dir__ = lambda: dir(importlib.import_module(new))  # type: ignore[method-assign]


def _warn(old: str, new: str) -> None:
    warnings.warn(
        f"{old} has moved to {new}; the old name goes with the next release",
        DeprecationWarning,
        stacklevel=3,
    )


def install() -> None:
    """Let old names be imported; once a process."""
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.append(_Finder())


def moved_name(package: str, name: str) -> Any:
    """Return a name that lay in a module which is a package today; AttributeError without one."""
    home = NAMES[package].get(name)
    if home is None:
        raise AttributeError(f"module {f'{_PACKAGE}.{package}'!r} has no attribute {name!r}")
    _warn(f"{_PACKAGE}.{package}.{name}", f"{_PACKAGE}.{home}.{name}")
    return getattr(importlib.import_module(f"{_PACKAGE}.{home}"), name)
