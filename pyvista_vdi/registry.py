"""What each folder in ``pyvista_vdi/extensions`` adds to the core, found when it is asked for.

A folder has a record, ``EXTENSION``. It names functions, classes and modules by their place,
``"package.module:name"``: nothing of an extension is loaded before it is used.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from typing import Any

from pyvista_vdi.errors import MissingDependencyError, needing

Places = Mapping[str, str]


@dataclass(frozen=True)
class FileFormat:
    """A kind of file, known by the end of its name."""

    suffix: str  # in small letters, with the dot
    module: str  # has read, read_info and, of single VDIs, write
    holds: str = "VDI"  # or "series", "set": what is read from it
    read_options: tuple[str, ...] = ()
    write_options: tuple[str, ...] = ()  # beside compression, level and precision
    compressions: tuple[str, ...] = ()  # the first by default; without any none is an option
    head: str = ""  # of a folder or ZIP of VDIs its file that is last in a folder, first in a ZIP
    page: bool = False  # may hold another's file: module has begins_with and data_in
    values: bool = False  # holds VDIs that keep values as well
    needs: str = "pyvista-vdi whole"  # to load its module, and the command that installs it

    def load(self) -> Any:
        """Return the module that reads and writes it."""
        with needing(f"{self.suffix} files need {self.needs}"):
            return import_module(self.module)


@dataclass(frozen=True)
class Verb:
    """A verb of the command line."""

    name: str
    summary: str
    example: str
    options: str  # place of its options, as cli.declare.add takes them
    run: str  # place of a function that takes the parsed options and returns the exit status


@dataclass(frozen=True)
class Extension:
    """What an extension adds."""

    names: Places = field(default_factory=dict)  # public names of pyvista_vdi
    formats: tuple[FileFormat, ...] = ()
    verbs: tuple[Verb, ...] = ()
    methods: Places = field(default_factory=dict)  # that lower rooms call, by names for them
    requires: tuple[str, ...] = ()  # extensions without which it is left out


#: The core's own record, set by the package's ``__init__``.
core = Extension()


def load(place: str) -> Any:
    """Return what is at a place, ``"package.module:name"``."""
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)


@cache
def extensions() -> dict[str, Extension]:
    """Return the records of the extensions that are there, by their names."""
    shipped = import_module("pyvista_vdi.extensions")
    folders = sorted(each.name for each in pkgutil.iter_modules(shipped.__path__) if each.ispkg)
    found = {name: import_module(f"{shipped.__name__}.{name}").EXTENSION for name in folders}
    # Leave out what requires something that is not there, until nothing does
    while lacking := [n for n, record in found.items() if not {*record.requires} <= {*found}]:
        for name in lacking:
            del found[name]
    return found


def records() -> Iterator[Extension]:
    """Yield the core's record, and those of the extensions."""
    yield core
    yield from extensions().values()


def formats() -> Iterator[FileFormat]:
    """Yield all formats of files, our own first."""
    for each in records():
        yield from each.formats


def method(name: str, otherwise: Any = None) -> Any:
    """Return the function that a method calls, ``otherwise`` where no extension has it.

    MissingDependencyError is raised where that is ``None``.
    """
    found = placed("methods", name) or otherwise
    if found is None:
        raise MissingDependencyError(
            f"{name} is of an extension that is not installed (there are: "
            f"{', '.join(sorted(extensions())) or 'none'}): install pyvista-vdi whole"
        )
    return found


def placed(what: str, name: str) -> Any:
    """Return what a record places under a name, or None; the core's is looked at first."""
    places = (getattr(each, what).get(name) for each in records())
    return next((load(place) for place in places if place is not None), None)
