"""The results' file: JSON that is whole after every row, and can be gone on with."""

from __future__ import annotations

import json
import os
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from ..compare.measure import without_infinities
from ..errors import InvalidArgumentError
from ..io import whole_file
from .plan import Plan, cell_name

#: What the file says it is; ``docs/benchmark_schema.json`` describes it.
FORMAT = "pyvista-vdi benchmark"
FORMAT_VERSION = 1


class Results:
    """What was measured, as the JSON has it.

    Parameters
    ----------
    path : path-like
        Its file.
    data : dict
        The JSON's content.

    Attributes
    ----------
    data : dict
        See ``docs/benchmark_schema.json``.
    """

    def __init__(self, path: str | os.PathLike[str], data: dict[str, Any]) -> None:
        self.path = Path(path)
        self.data = data

    @classmethod
    def begun(cls, path: str | os.PathLike[str], plan: Plan, system: dict[str, str]) -> Results:
        """Return what holds nothing yet."""
        data = {
            "format": FORMAT,
            "version": FORMAT_VERSION,
            "plan": plan.to_dict(),
            "system": system,
            "begun": now(),
            "changed": now(),
            "datasets": {},
            "cells": [],
            "previews": [],
        }
        return cls(path, data)

    @classmethod
    def resumed(cls, path: str | os.PathLike[str], plan: Plan, system: dict[str, str]) -> Results:
        """Return what an earlier run of the same plan, on the same device, has left.

        Raises
        ------
        InvalidArgumentError
            If the file is no such results, or holds those of another plan or device.
        """
        results = read_results(path)
        theirs, ours = results.data["plan"], plan.to_dict()
        other = sorted(name for name in ours if theirs.get(name) != ours[name])
        if other:
            name = other[0]
            raise InvalidArgumentError(
                f"{path} holds results for {name} = {theirs.get(name)}, not {ours[name]}: give the "
                "same options to --resume, or choose another --out"
            )
        for name in ("device", "driver", "pyvista-vdi"):
            if results.data["system"].get(name) != system.get(name):
                raise InvalidArgumentError(
                    f"{path} was measured on {name} {results.data['system'].get(name)}, and this "
                    f"is {system.get(name)}: choose another --out"
                )
        return results

    # -- cells -------------------------------------------------------------------------------------

    def cell(self, dataset: str, size: tuple[int, int], limit: int) -> dict[str, Any] | None:
        """Return a cell that is there, or None."""
        name = cell_name(dataset, size, limit)
        return next((cell for cell in self.data["cells"] if cell["name"] == name), None)

    def new_cell(self, dataset: str, size: tuple[int, int], limit: int) -> dict[str, Any]:
        """Return a cell, made anew where it is not there."""
        found = self.cell(dataset, size, limit)
        if found is None:
            found = {
                "name": cell_name(dataset, size, limit),
                "dataset": dataset,
                "window_size": list(size),
                "max_supersegments": limit,
                "refused": None,
                "vdi": None,
                "angles": [],
            }
            self.data["cells"].append(found)
        return found

    def missing_angles(self, plan: Plan, dataset: str, size: tuple[int, int], limit: int) -> int:
        """Return how many angles of a cell are not there yet; none of one that was refused."""
        cell = self.cell(dataset, size, limit)
        if cell is None:
            return len(plan.angles)
        if cell["refused"] is not None:
            return 0
        there = {row["angle"] for row in cell["angles"]}
        return sum(angle not in there for angle in plan.angles)

    def save(self) -> None:
        """Write the file; a run that is stopped meanwhile leaves the old one."""
        self.data["changed"] = now()
        with whole_file(self.path) as stream:
            text = json.dumps(without_infinities(self.data), indent=1, allow_nan=False)
            stream.write(text.encode() + b"\n")


def read_results(path: str | os.PathLike[str]) -> Results:
    """Read a file of results.

    Raises
    ------
    InvalidArgumentError
        If it cannot be read, or is something else.
    """
    try:
        data = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InvalidArgumentError(f"{path} cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise InvalidArgumentError(
            f"{path} is no JSON ({error}): name a file that pyvista-vdi benchmark has written"
        ) from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise InvalidArgumentError(
            f"{path} holds no results: name a file that pyvista-vdi benchmark has written"
        )
    if data.get("version") != FORMAT_VERSION:
        raise InvalidArgumentError(
            f"{path} is of version {data.get('version')!r}; this program reads version "
            f"{FORMAT_VERSION}: measure again, or use the program that wrote it"
        )
    missing = {"plan", "system", "datasets", "cells", "previews"} - data.keys()
    if missing:
        raise InvalidArgumentError(f"{path} lacks {', '.join(sorted(missing))}: measure again")
    return Results(path, data)


def now() -> str:
    """Return the date and time, UTC."""
    return datetime.now(timezone.utc).isoformat(timespec="seconds")
