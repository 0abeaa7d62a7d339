"""The results' file: JSON that is whole after every row, and can be gone on with."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, ClassVar

from pyvista_vdi.measure.paper.plan import Plan
from pyvista_vdi.measure.report import across
from pyvista_vdi.measure.results_file import ResultsFile


def _cell_name(dataset: str, size: tuple[int, int], limit: int) -> str:
    """Return a cell's name in the results: ``brain/1280x720/15``."""
    return f"{dataset}/{across(size)}/{limit}"


class Results(ResultsFile):
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

    form, version = "pyvista-vdi benchmark", 1
    empty: ClassVar[Mapping[str, Any]] = {"datasets": {}, "cells": [], "previews": []}

    def cell(self, dataset: str, size: tuple[int, int], limit: int) -> dict[str, Any] | None:
        """Return a cell that is there, or None."""
        name = _cell_name(dataset, size, limit)
        return next((cell for cell in self.data["cells"] if cell["name"] == name), None)

    def new_cell(self, dataset: str, size: tuple[int, int], limit: int) -> dict[str, Any]:
        """Return a cell, made anew where it is not there."""
        found = self.cell(dataset, size, limit)
        if found is None:
            found = {
                "name": _cell_name(dataset, size, limit),
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


def read_results(path: str | os.PathLike[str]) -> Results:
    """Read a file of results.

    Raises
    ------
    InvalidArgumentError
        If it cannot be read, or is something else.
    """
    return Results.read(path)
