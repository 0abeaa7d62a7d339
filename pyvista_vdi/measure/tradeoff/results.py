"""What was measured: its file, and what that says."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.measure.report import save_figure
from pyvista_vdi.measure.results_file import ResultsFile
from pyvista_vdi.measure.tradeoff.findings import COSTS, Point, best, dominated, points_of
from pyvista_vdi.measure.tradeoff.plot import draw
from pyvista_vdi.measure.tradeoff.report import describe

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_NOTHING: Mapping[str, Any] = {"baselines": [], "left_out": {}, "points": [], "findings": None}


class TradeoffFile(ResultsFile):
    """What was measured, as the JSON has it: see ``docs/tradeoff_schema.json``."""

    form, version = "pyvista-vdi tradeoff", 1
    empty = _NOTHING

    def find(self) -> None:
        """Add what the figures say."""
        points = points_of(self.data)
        fronts = {kind: [one.name for one in best(points, kind)] for kind in COSTS}
        self.data["findings"] = {"fronts": fronts, "dominated": dominated(points)}


class Tradeoff:
    """What :func:`measure_tradeoff` found.

    Parameters
    ----------
    data : dict
        What the JSON holds, see ``docs/tradeoff_schema.json``.

    Attributes
    ----------
    data : dict
        The same.
    points : list of Point
        Every setting that was measured.
    """

    def __init__(self, data: dict[str, Any]) -> None:
        self.data = data
        self.points = points_of(data)

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Tradeoff:
        """Read the JSON of an earlier run.

        Raises
        ------
        InvalidArgumentError
            If it cannot be read, or is something else.
        """
        return cls(TradeoffFile.read(path).data)

    def point(self, name: str) -> Point:
        """Return a setting's figures by its name.

        Raises
        ------
        InvalidArgumentError
            If no setting of that name was measured.
        """
        for one in self.points:
            if one.name == name:
                return one
        raise InvalidArgumentError(
            f"no setting {name!r} was measured: there are "
            + "; ".join(repr(one.name) for one in self.points)
        )

    def front(self, kind: str) -> list[str]:
        """Return the settings that no other dominates in SSIM and one kind of cost.

        Of those that cannot be told apart the one with the fewest changes is returned.

        Parameters
        ----------
        kind : {"frame", "memory", "file", "generation"}
            The cost.

        Returns
        -------
        list of str
            Names, the cheapest first.
        """
        return [one.name for one in best(self.points, kind)]

    def dominated(self) -> dict[str, list[str]]:
        """Return the settings that nobody should choose, and those that are better.

        Of each there is another that is nowhere worse by what counts, in the frame time and the
        SSIM at any angle, in memory, file and generation, and somewhere better beyond the measured
        noise: see :func:`dominates`.

        Returns
        -------
        dict of str to list of str
            Names.
        """
        return dominated(self.points)

    def table(self) -> str:
        """Return the tables as Markdown."""
        return describe(self.data, self.points)

    def plot(self) -> Figure:
        """Draw the fronts of frame time, bytes and generation time against SSIM.

        Returns
        -------
        matplotlib.figure.Figure
            Which notebooks show as it is.

        Raises
        ------
        MissingDependencyError
            If Matplotlib is not installed.
        InvalidArgumentError
            If nothing was measured.
        """
        return draw(self.data, self.points)

    def save_plot(self, path: str | os.PathLike[str]) -> Path:
        """Write the plot as PNG; the file appears whole or not at all."""
        save_figure(self.plot(), Path(path))
        return Path(path)
