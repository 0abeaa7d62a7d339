"""What extensions add to the core, found when it is asked for.

An extension is a package with a record, ``EXTENSION``, of what it adds. Those that are shipped are
found by their folders in ``pyvista_vdi/extensions``, others by entry points of the group
``pyvista_vdi.extensions``, whose values are records. A record names functions, classes and modules
by their place, ``"package.module:name"``: nothing of an extension is loaded before it is used. See
docs/extending.md.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from typing import Any

from pyvista_vdi.errors import MissingDependencyError, warn_external

#: The group of entry points by which other packages add extensions.
GROUP = "pyvista_vdi.extensions"

Places = Mapping[str, str]


@dataclass(frozen=True)
class FileFormat:
    """A kind of file, known by the end of its name.

    Parameters
    ----------
    suffix : str
        The end of its name, in small letters, with the dot.
    module : str
        Has ``read(path, *, progress=None, **options)`` and ``read_info(path)``; where it holds a
        VDI ``write(vdi, path, *, progress=None, **options)``, and where it holds steps
        ``write_steps(vdis, times, path, **options)``.
    holds : {"VDI", "series", "set"}
        What is read from it.
    read_options, write_options : tuple of str
        Options of the module's functions, beside ``compression`` and ``level``.
    compressions : tuple of str
        Values of ``compression``, the first by default. Without any, ``compression`` and ``level``
        are no options.
    head : str
        Of what is a folder or a ZIP of VDIs: its file that is written last in a folder, and first
        in a ZIP, by which it is found in a page.
    page : bool
        Whether it is a page, which may hold a file of another format: its module has
        ``begins_with(path, head)`` and ``data_in(path)``.
    values : bool
        Whether it holds deferred VDIs as well.
    shared : bool
        Whether other files have that suffix, too: its module has ``holds_vdi(path)``.
    reports_progress : bool
        Whether the module's functions take ``progress``.
    needs : str
        What its module cannot be loaded without, if that is optional.
    install : str
        The command that installs this.
    verbs : str
        Module whose ``info(options)`` and ``convert(options)`` the command line runs, in place of
        those for VDIs.
    """

    suffix: str
    module: str
    holds: str = "VDI"
    read_options: tuple[str, ...] = ()
    write_options: tuple[str, ...] = ()
    compressions: tuple[str, ...] = ()
    head: str = ""
    page: bool = False
    values: bool = False
    shared: bool = False
    reports_progress: bool = True
    needs: str = ""
    install: str = ""
    verbs: str = ""

    def load(self) -> Any:
        """Return the module that reads and writes it."""
        try:
            return import_module(self.module)
        except ImportError as error:
            if not self.needs:
                raise
            by = f" by {self.install}" if self.install else ""
            raise MissingDependencyError(
                f"{self.suffix} files need {self.needs}, which cannot be loaded ({error}): install "
                f"it{by}, or use .vdi files"
            ) from error


@dataclass(frozen=True)
class Verb:
    """A verb of the command line.

    Parameters
    ----------
    name, summary, example : str
        What ``--help`` says.
    options : str
        Place of a function that declares the verb's options to an ``argparse.ArgumentParser``.
    run : str
        Place of a function that takes the parsed options and returns the exit status.
    """

    name: str
    summary: str
    example: str
    options: str
    run: str


@dataclass(frozen=True)
class Extension:
    """What an extension adds.

    Parameters
    ----------
    names : mapping of str to str
        Public names of ``pyvista_vdi``, and their places.
    formats : sequence of FileFormat
        Files that are read and written.
    readers : mapping of str to str
        Ends of names, as ``".nrrd"``, and functions that read a volume from such a file.
    volumes : mapping of str to str
        Classes of data, and functions ``(data, scalars, preference)`` that make a
        :class:`pyvista_vdi.Volume` of them.
    shown : mapping of str to str
        Classes of data, and functions that make of them what a mapper draws: a
        :class:`pyvista_vdi.vtk_pipeline.filters.inputs.Input`.
    generators : mapping of str to str
        Ways of generating a VDI: ``"blocks"`` of chunked volumes, ``"ranks"`` of an MPI program;
        and ``"clients"``, which connects to the scheduler of a cluster.
    verbs : sequence of Verb
        Verbs of the command line.
    methods : mapping of str to str
        Methods, ``"VDI.plot"`` or ``"plotter.vdi.export_html"``, and functions whose first argument
        is the VDI or the plotter.
    requires : sequence of str
        Extensions without which this one is left out, and what requires this one.
    """

    names: Places = field(default_factory=dict)
    formats: tuple[FileFormat, ...] = ()
    readers: Places = field(default_factory=dict)
    volumes: Places = field(default_factory=dict)
    shown: Places = field(default_factory=dict)
    generators: Places = field(default_factory=dict)
    verbs: tuple[Verb, ...] = ()
    methods: Places = field(default_factory=dict)
    requires: tuple[str, ...] = ()


#: The core's own record, set by the package's ``__init__``.
core = Extension()


def load(place: str) -> Any:
    """Return what is at a place, ``"package.module:name"``."""
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)


@cache
def extensions() -> dict[str, Extension]:
    """Return the records of all extensions that are there, by their names; the shipped ones first.

    One that cannot be loaded is left out, and a warning says why.
    """
    from importlib.metadata import entry_points  # slow to import

    shipped = import_module("pyvista_vdi.extensions")
    folders = sorted(each.name for each in pkgutil.iter_modules(shipped.__path__) if each.ispkg)
    found: dict[str, Extension] = {}
    for name in folders:
        found[name] = import_module(f"{shipped.__name__}.{name}").EXTENSION
    for point in entry_points(group=GROUP):
        try:
            record = point.load()
            if not isinstance(record, Extension):
                raise TypeError(f"{point.value} is no pyvista_vdi.registry.Extension")
            found[point.name] = record
        except Exception as error:
            warn_external(
                f"the extension {point.name!r} is left out: {type(error).__name__}: {error}"
            )
    # Leave out what requires something that is not there, until nothing does
    while lacking := [n for n, record in found.items() if not {*record.requires} <= {*found}]:
        for name in lacking:
            del found[name]
    return found


def records() -> Iterator[Extension]:
    """Yield the core's record, and those of the extensions."""
    yield core
    yield from extensions().values()


def _place(what: str, name: str) -> str | None:
    """Return the place that a record gives a name; the core's is looked at first."""
    return next(
        (getattr(each, what)[name] for each in records() if name in getattr(each, what)), None
    )


def names() -> dict[str, str]:
    """Return the public names that extensions add, and their places."""
    return {name: place for each in extensions().values() for name, place in each.names.items()}


def formats() -> Iterator[FileFormat]:
    """Yield all formats of files, our own first."""
    for each in records():
        yield from each.formats


def method(name: str, otherwise: Any = None) -> Any:
    """Return the function that a method calls.

    Without an extension that has it, that is ``otherwise``; MissingDependencyError is raised where
    that is ``None``.
    """
    place = core.methods.get(name) or _place("methods", name)
    if place is None and otherwise is None:
        raise _missing(name)
    return otherwise if place is None else load(place)


def methods(of: str) -> dict[str, str]:
    """Return the places of all methods whose names begin so, by what follows."""
    found = {name: place for each in records() for name, place in each.methods.items()}
    return {n.removeprefix(of): place for n, place in found.items() if n.startswith(of)}


def reader(suffix: str) -> Any:
    """Return the function that reads volumes from files of that suffix; ``None`` if there is none.

    ``""`` is the suffix of all others.
    """
    place = _place("readers", suffix)
    return None if place is None else load(place)


def generator(name: str) -> Any:
    """Return a way of generating VDIs."""
    place = _place("generators", name)
    if place is None:
        raise _missing(f"generating by {name}")
    return load(place)


def made_of(what: str, data: Any) -> Any:
    """Return the function that makes something of data, by the classes that these are of.

    ``what`` is the record's field, ``"volumes"`` or ``"shown"``; ``None`` if there is none.
    """
    for kind in type(data).__mro__[:-1]:
        place = _place(what, f"{kind.__module__}:{kind.__qualname__}")
        if place is not None:
            return load(place)
    return None


def verbs() -> dict[str, Verb]:
    """Return the verbs that extensions add, by their names."""
    return {verb.name: verb for each in extensions().values() for verb in each.verbs}


def _missing(what: str) -> MissingDependencyError:
    return MissingDependencyError(
        f"{what} is of an extension that is not installed (there are: "
        f"{', '.join(sorted(extensions())) or 'none'}): install pyvista-vdi whole, or the package "
        "that has it"
    )
