"""What each setting of a VDI costs and gives, measured on one volume: ``pyvista-vdi tradeoff``.

Everything runs without VTK and PyVista; where VTK is installed its mappers are timed beside.
"""

from __future__ import annotations

from pyvista_vdi.measure.tradeoff.findings import Figure, Point, dominates, find_dominated, front
from pyvista_vdi.measure.tradeoff.settings import AXES, Setting, sweep
from pyvista_vdi.measure.tradeoff.tradeoff import Tradeoff, measure_tradeoff

__all__ = [
    "AXES",
    "Figure",
    "Point",
    "Setting",
    "Tradeoff",
    "dominates",
    "find_dominated",
    "front",
    "measure_tradeoff",
    "sweep",
]
