"""Set and Get, as VTK has them, of each option of how a VDI is made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from pyvista_vdi.model.options import GenerationOptions, Option


class OptionMethods:
    """``SetViewCone(60)`` and ``GetViewCone()``, and so on, of an algorithm's options.

    The algorithm has ``SetOptions`` and ``GetOptions``. Lights are set otherwise.
    """


def _pair(told: Option) -> tuple[Callable[..., None], Callable[..., Any]]:
    name = told.name

    def setter(self: Any, value: Any) -> None:
        self.SetOptions(replace(self.GetOptions(), **{name: value}))

    def getter(self: Any) -> Any:
        return getattr(self.GetOptions(), name)

    setter.__doc__ = f"Set `{name}` of :func:`pyvista_vdi.generate`: {told.what}.\n\n{told.more}"
    getter.__doc__ = f"Return {told.what}."
    return setter, getter


for _told in GenerationOptions.declared.values():
    if _told.name != "lights":
        for _verb, _method in zip(("Set", "Get"), _pair(_told), strict=True):
            _method.__name__ = f"{_verb}{_told.name.title().replace('_', '')}"
            _method.__qualname__ = f"OptionMethods.{_method.__name__}"
            setattr(OptionMethods, _method.__name__, _method)
