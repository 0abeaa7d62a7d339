"""One volume rendered by VTK's mappers, our volume raycaster and a VDI, side by side."""

from __future__ import annotations

from pyvista_vdi.measure.compare.bounds import Check, judge_times, judge_vdi, judge_vtk
from pyvista_vdi.measure.compare.measure import AngleResult, Report, Settings, Timing, measure
from pyvista_vdi.measure.compare.sheet import contact_sheet, table
from pyvista_vdi.measure.report import describe_system

__all__ = [
    "AngleResult",
    "Check",
    "Report",
    "Settings",
    "Timing",
    "contact_sheet",
    "describe_system",
    "judge_times",
    "judge_vdi",
    "judge_vtk",
    "measure",
    "table",
]
