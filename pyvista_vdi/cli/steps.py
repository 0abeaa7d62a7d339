"""The time steps that the files on a command line are, each read when it is asked for."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

from pyvista_vdi.cli.inputs import laid_out, open_store, quietly, read_volume
from pyvista_vdi.cli.text import printable
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.io import read as read_vdi
from pyvista_vdi.io import read_info
from pyvista_vdi.io.files import holds
from pyvista_vdi.io.stores import is_store
from pyvista_vdi.io.time_steps import in_step_order, listed_steps, lists_steps
from pyvista_vdi.io.volumes import needs_pyvista
from pyvista_vdi.model.checks import as_number
from pyvista_vdi.model.volume import Volume


@dataclass(frozen=True)
class Step:
    """A time step: what messages call it, its time where that is known, and what reads it."""

    name: str
    time: float | None
    read: Callable[[], Any]


def in_order(files: Sequence[str]) -> list[str]:
    """Return files in natural order where they are in a shell's, and say so."""
    ordered = in_step_order(files)
    if ordered != list(files):
        places = range(len(files))
        first = next(i for i in places if ordered[i] != files[i])
        print(
            f"The files are taken in the order of their numbers: {printable(ordered[first])} "
            f"before {printable(files[first])}",
            file=sys.stderr,
        )
    return ordered


def steps_of_vdis(files: Sequence[str]) -> list[Step]:
    """Return the steps of files that hold VDIs or series of them."""
    steps = []
    for file in files:
        if holds(file) == "series":
            series = read_vdi(file)
            for i, at in enumerate(series.times):
                steps.append(Step(f"{file}, step {i}", at, partial(series.__getitem__, i)))
        else:
            at = as_number(read_info(file).metadata.get("time"))  # as a simulation's is written
            steps.append(Step(file, None if math.isnan(at) else at, partial(read_vdi, file)))
    return steps


def steps_of_volumes(
    files: Sequence[str], options: argparse.Namespace, *, in_chunks: bool = False
) -> list[Step]:
    """Return the steps of files that hold volumes; see :func:`read_volume` for the options."""
    return [step for file in files for step in _steps_of(file, options, None, in_chunks=in_chunks)]


def _steps_of(
    file: str, options: argparse.Namespace, time: float | None, *, in_chunks: bool
) -> Iterator[Step]:
    given = argparse.Namespace(**{**vars(options), "file": file, "example": None})
    if is_store(file):
        store = open_store(given).store
        if given.time_index is None and len(store.times) > 1:
            for i, at in enumerate(store.times):
                step = argparse.Namespace(**{**vars(given), "time_index": i})
                yield Step(f"{file}, step {i}", at, partial(read_volume, step, in_chunks=in_chunks))
            return
    elif lists_steps(file):
        for listed, at in listed_steps(file):
            yield from _steps_of(str(listed), options, at, in_chunks=in_chunks)
        return
    elif needs_pyvista(Path(file)):
        from pyvista_vdi.plotting.volume_files import steps_of

        with quietly():
            several, times = steps_of(file)
        if len(times) > 1 and time is None:
            for i, at in enumerate(times):
                yield Step(f"{file}, step {i}", at, partial(_read_step, several, i, given))
            return
        time = times[0] if times and time is None else time
    yield Step(file, time, partial(read_volume, given, in_chunks=in_chunks))


def _read_step(several: Sequence[Any], i: int, options: argparse.Namespace) -> Volume:
    with quietly():
        return laid_out(several[i], options)


def timed(steps: Sequence[Step], given: Sequence[float] | None) -> list[Step]:
    """Return steps with the times that are given, else with the files' where these ascend.

    Raises
    ------
    InvalidArgumentError
        If others are given than there are steps.
    """
    if given is not None:
        if len(given) != len(steps):
            raise InvalidArgumentError(
                f"--times gives a time to each step: there are {len(steps)} steps and "
                f"{len(given)} times"
            )
        return [replace(step, time=at) for step, at in zip(steps, given, strict=True)]
    known = [step.time for step in steps if step.time is not None]
    if known and (len(known) < len(steps) or any(b <= a for a, b in pairwise(known))):
        print(
            "The times in the files do not ascend, or some have none: steps are numbered "
            "(--times gives times)",
            file=sys.stderr,
        )
        return [replace(step, time=None) for step in steps]
    return list(steps)
