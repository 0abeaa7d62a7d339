"""Warnings point at the line of the program that led to them, whatever is called in between."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np

import pyvista_vdi as pvdi


def test_a_warning_points_at_the_caller_s_line(default_runtime):
    volume = pvdi.Volume(np.zeros((5, 5, 5), np.float32))
    table = pvdi.TransferFunction(np.eye(3), [0.0, 0.3, 0.6], (0, 1))
    away = pvdi.Camera((50, 2, 2), (90, 2, 2), (0, 0, 1))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        pvdi.generate(volume, away, (8, 8), transfer_function=table)
    ours = [each for each in caught if issubclass(each.category, pvdi.VDIWarning)]
    assert ours, "nothing was said"
    assert {Path(each.filename) for each in ours} == {Path(__file__)}


def test_no_module_warns_by_itself_or_changes_the_filters():
    """Filters are the whole process's; only the command line has that to itself."""
    package = Path(pvdi.__file__).parent
    forbidden = re.compile(r"(?<![\w.])warnings\.(warn|catch_warnings|(simple)?filter\w*)\(")
    found = [path for path in package.rglob("*.py") if forbidden.search(path.read_text("utf-8"))]
    assert {path.relative_to(package).parts[0] for path in found} <= {"cli"}, found
