"""The time steps that the files on a command line are, each read when it is asked for."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from pyvista_vdi.cli.inputs import laid_out, open_store, quietly, read_volume
from pyvista_vdi.cli.text import printable
from pyvista_vdi.io.stores import is_store
from pyvista_vdi.io.volumes.formats import natural_key
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.plotting.imports import vtk_steps


@dataclass(frozen=True)
class Step:
    """A time step: what messages call it, its time where that is known, and what reads it."""

    name: str
    time: float | None
    read: Callable[[], Any]


def in_order(files: Sequence[str]) -> list[str]:
    """Return files in natural order where they are in a shell's, and say so."""
    cases = (case for case in (str, str.casefold) if [*files] == sorted(files, key=case))
    ordered = [*files]
    if (case := next(cases, None)) is not None:
        ordered = sorted(files, key=lambda name: natural_key(case(name)))
    if ordered != list(files):
        places = range(len(files))
        first = next(i for i in places if ordered[i] != files[i])
        print(
            f"The files are taken in the order of their numbers: {printable(ordered[first])} "
            f"before {printable(files[first])}",
            file=sys.stderr,
        )
    return ordered


def steps_of_volumes(
    files: Sequence[str], options: argparse.Namespace, *, in_chunks: bool = False
) -> list[Step]:
    """Return the steps of files that hold volumes; see :func:`read_volume` for the options."""
    return [step for file in files for step in _steps_of(file, options, in_chunks=in_chunks)]


def _steps_of(file: str, options: argparse.Namespace, *, in_chunks: bool) -> Iterator[Step]:
    time = None
    given = argparse.Namespace(**{**vars(options), "file": file, "example": None})
    if is_store(file):
        store = open_store(given).store
        if given.time_index is None and len(store.times) > 1:
            for i, at in enumerate(store.times):
                step = argparse.Namespace(**{**vars(given), "time_index": i})
                yield Step(f"{file}, step {i}", at, partial(read_volume, step, in_chunks=in_chunks))
            return
    elif file.lower().endswith((".vti", ".pvti", ".vtkhdf")):  # others announce none, or others
        with quietly():
            several, times = vtk_steps(file)
        if len(times) > 1:
            for i, at in enumerate(times):
                yield Step(f"{file}, step {i}", at, partial(_read_step, several, i, given))
            return
        time = times[0] if times else None
    yield Step(file, time, partial(read_volume, given, in_chunks=in_chunks))


def _read_step(several: Sequence[Any], i: int, options: argparse.Namespace) -> Volume:
    with quietly():
        return laid_out(several[i], options)
