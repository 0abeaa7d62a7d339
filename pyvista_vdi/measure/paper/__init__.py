"""The paper's tables, measured again: what ``pyvista-vdi benchmark`` does.

Table 1 holds frame times and accuracy of VDIs against volume rendering, Table 2 previews at target
rates. Everything runs without VTK and PyVista; where VTK is installed its mappers take part.
"""

from __future__ import annotations

from pyvista_vdi.measure.paper.benchmark import PROFILES, Plan, open_results, read_results, run
from pyvista_vdi.measure.paper.changes import Change, compare_results, describe_changes
from pyvista_vdi.measure.paper.datasets import DEFAULT_SEED, Dataset, find_dataset
from pyvista_vdi.measure.paper.published import PaperCell, paper_cell
from pyvista_vdi.measure.paper.report import describe
from pyvista_vdi.measure.results import Results

__all__ = [
    "DEFAULT_SEED",
    "PROFILES",
    "Change",
    "Dataset",
    "PaperCell",
    "Plan",
    "Results",
    "compare_results",
    "describe",
    "describe_changes",
    "find_dataset",
    "open_results",
    "paper_cell",
    "read_results",
    "run",
]
