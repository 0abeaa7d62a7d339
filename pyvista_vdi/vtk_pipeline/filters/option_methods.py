"""Set and Get, as VTK has them, of each option of how a VDI is made."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.vtk_pipeline.filters.algorithm import named_pair


class OptionMethods:
    """``SetViewCone(60)`` and ``GetViewCone()``, and so on, of an algorithm's options.

    The algorithm has ``SetOptions`` and ``GetOptions``. Lights are set otherwise.
    """


def _pair(name: str, what: str) -> Any:
    def setter(self: Any, value: Any) -> None:
        self.SetOptions(replace(self.GetOptions(), **{name: value}))

    def getter(self: Any) -> Any:
        return getattr(self.GetOptions(), name)

    return named_pair(name, f"`{name}` of :func:`pyvista_vdi.generate`: {what}", setter, getter)


for _told in GenerationOptions.declared.values():
    for _method in _pair(_told.name, _told.what) if _told.name != "lights" else ():
        setattr(OptionMethods, _method.__name__, _method)
