"""``add_vdi`` on every class of plotters, as soon as this package and PyVista's plotters are there.

Data sets get ``vdi`` in the same way: where several threads ask for what an entry point names,
PyVista gives it to one and an error to others.

PyVista imports what its entry points name when a plotter lacks an attribute: in
``BasePlotter.__getattr__``. pyvistaqt's plotters derive from a Qt widget first, whose own
``__getattr__`` answers before it, so that no entry point is looked at. An attribute of
``BasePlotter`` itself is found by all of them.
"""

from __future__ import annotations

import importlib
import sys
import weakref
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError

_PLOTTERS = "pyvista.plotting"

#: What plotters and data sets get, and the modules that register it, as the entry points in
#: ``pyproject.toml``.
COMPONENTS = {
    "add_vdi": "pyvista_vdi.plotting.component",
    "vdi": "pyvista_vdi.plotting.component",
}
ACCESSORS = {"vdi": "pyvista_vdi.plotting.accessor"}


class Component:
    """What a plotter has got from this package.

    Parameters
    ----------
    plotter : pyvista.BasePlotter
        Held weakly.
    """

    def __init__(self, plotter: Any) -> None:
        self._held = weakref.ref(plotter)
        self._made: list[Any] = []  # actors, weakly, or editors

    def __plotter_deep_clean__(self) -> None:
        """Nothing else is held."""

    @property
    def _plotter(self) -> Any:
        plotter = self._held()
        if plotter is None:
            raise InvalidArgumentError("the plotter is gone: make another, and add the VDI to that")
        return plotter


class _Pending:
    """What registers itself in this place, when its module is imported: once it is asked for."""

    def __init__(self, name: str, home: str) -> None:
        self._name = name
        self._home = home

    def __get__(self, thing: Any, kind: Any) -> Any:
        importlib.import_module(self._home)  # other threads wait here
        for owner in kind.__mro__:
            if vars(owner).get(self._name) is self:  # put back by PyVista: it was unregistered
                delattr(owner, self._name)
        return getattr(kind if thing is None else thing, self._name)


class _Watch(MetaPathFinder):
    """Waits for PyVista's plotters to be imported."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Find nothing of its own, and have the plotters' module offer what there is."""
        if name != _PLOTTERS:
            return None
        # It stays in the list: other threads may be walking it. Of a second import is another
        others = (each for each in sys.meta_path if type(each).__qualname__ != "_Watch")
        found = (each.find_spec(name, path, target) for each in others)
        spec = next((each for each in found if each is not None), None)
        loader: Any = None if spec is None else spec.loader
        if loader is not None:
            execute = loader.exec_module

            def exec_module(module: ModuleType) -> None:
                execute(module)
                _offer(module)

            loader.exec_module = exec_module
        return spec


def _offer(plotters: ModuleType) -> None:
    base = getattr(plotters, "BasePlotter", None)
    if base is None:  # it is being imported, by somebody else
        return
    data_set = importlib.import_module("pyvista.core.dataset").DataSet
    for kind, offered in ((base, COMPONENTS), (data_set, ACCESSORS)):
        for name, home in offered.items():
            if home not in sys.modules:
                setattr(kind, name, _Pending(name, home))


def install() -> None:
    """Offer it now, or once PyVista's plotters are imported; import nothing."""
    if _PLOTTERS in sys.modules:
        _offer(importlib.import_module(_PLOTTERS))  # which waits where another thread imports it
    else:
        sys.meta_path.insert(0, _Watch())
