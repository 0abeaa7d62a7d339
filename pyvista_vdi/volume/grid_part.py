"""A part of a grid whose points alone are on a device (``GRID_PART`` of ``volume/medium.cl``)."""

from __future__ import annotations

from dataclasses import dataclass

from pyvista_vdi.model.grid import Grid

Ends = tuple[float, float, float]


@dataclass(frozen=True)
class GridPart:
    """Where points that are at hand lie in their grid, and which of its cells belong to them.

    ``first``: index x, y, z of the first point at hand; ``lower``, ``upper``: index positions
    between which the part's own cells lie, the upper ones excluded, infinite at the ends of the
    grid, where rounding may put a midpoint outside; ``scalar_range``: of the whole grid's values.
    """

    grid: Grid
    first: tuple[int, int, int]
    lower: Ends
    upper: Ends
    scalar_range: tuple[float, float]
