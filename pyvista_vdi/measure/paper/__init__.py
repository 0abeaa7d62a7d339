"""The paper's tables, measured again: what ``pyvista-vdi benchmark`` does.

Table 1 holds frame times and accuracy of VDIs against volume rendering, Table 2 previews at target
rates. Everything runs without VTK and PyVista; where VTK is installed its mappers take part.
"""

from __future__ import annotations

from pyvista_vdi.measure.paper.benchmark import PROFILES, Plan, open_results, run
from pyvista_vdi.measure.paper.datasets import DEFAULT_SEED, Dataset, find_dataset
from pyvista_vdi.measure.paper.report import PaperCell, describe, paper_cell
from pyvista_vdi.measure.results import Results

__all__ = [
    "DEFAULT_SEED",
    "PROFILES",
    "Dataset",
    "PaperCell",
    "Plan",
    "Results",
    "describe",
    "find_dataset",
    "open_results",
    "paper_cell",
    "run",
]
