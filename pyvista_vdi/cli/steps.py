"""The time steps that the files on a command line are, each read when it is asked for."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from pyvista_vdi.cli.inputs import open_store, read_volume
from pyvista_vdi.io.stores import is_store


@dataclass(frozen=True)
class Step:
    """A time step: what messages call it, its time where that is known, and what reads it."""

    name: str
    time: float | None
    read: Callable[[], Any]


def in_order(files: Sequence[str]) -> list[str]:
    """Return files in natural order where they are in a shell's."""
    case = next((c for c in (str, str.casefold) if [*files] == sorted(files, key=c)), None)
    if case is None:
        return [*files]
    return sorted(files, key=lambda name: re.sub(r"\d+", lambda n: n[0].zfill(24), case(name)))


def steps_of_volumes(
    files: Sequence[str], options: argparse.Namespace, *, in_chunks: bool = False
) -> list[Step]:
    """Return the steps of files that hold volumes; see :func:`read_volume` for the options."""
    steps = []
    for file in files:
        given: dict[str, Any] = {**vars(options), "file": file, "example": None}
        times: Sequence[float] = ()
        if is_store(file) and options.time_index is None:
            times = open_store(argparse.Namespace(**given)).store.times
        for i, time in enumerate(times if len(times) > 1 else (None,)):
            one = {} if time is None else {"time_index": i}
            read = partial(read_volume, argparse.Namespace(**given | one), in_chunks=in_chunks)
            steps.append(Step(file if time is None else f"{file}, step {i}", time, read))
    return steps
