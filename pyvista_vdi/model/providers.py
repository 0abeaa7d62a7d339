"""What the lower rooms need of upper ones, handed in by the package's ``__init__``.

A role is a name for a function or a module; who plays it is told once, as a dotted place, and
loaded when it is first asked for. So nothing here knows an upper room, and ``import pyvista_vdi``
loads none.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

_places: dict[str, str] = {}


def provide(**places: str) -> None:
    """Tell who plays some roles: ``"package.module"``, or ``"package.module:name"``."""
    _places.update(places)


def provider(role: str) -> Any:
    """Return the module or the function that plays a role."""
    module, _, name = _places[role].partition(":")
    found = import_module(module)
    return getattr(found, name) if name else found
