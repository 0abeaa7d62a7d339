"""The paper's tables, measured again: what ``pyvista-vdi benchmark`` does.

Table 1 holds frame times and accuracy of VDIs against volume rendering, Table 2 previews at target
rates. Everything runs without VTK and PyVista; where VTK is installed its mappers take part.
"""

from __future__ import annotations

from pyvista_vdi.measure.benchmark.changes import Change, compare_results, describe_changes
from pyvista_vdi.measure.benchmark.datasets import DEFAULT_SEED, Dataset, find_dataset
from pyvista_vdi.measure.benchmark.paper import PaperCell, paper_cell
from pyvista_vdi.measure.benchmark.plan import PROFILES, Plan
from pyvista_vdi.measure.benchmark.report import describe
from pyvista_vdi.measure.benchmark.results import Results, read_results
from pyvista_vdi.measure.benchmark.session import run

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
    "paper_cell",
    "read_results",
    "run",
]
