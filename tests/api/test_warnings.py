"""Warnings point at the line of the program that led to them, whatever is called in between."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

import pyvista_vdi as pvdi

pytestmark = pytest.mark.gl

VALUES = np.random.default_rng(0).random((12, 12, 12), dtype=np.float32)


@pytest.fixture
def plotter():
    plotter = pv.Plotter(off_screen=True, window_size=(48, 32))
    yield plotter
    plotter.close()


def an_effect_that_does_not_see_it(plotter, tmp_path):
    plotter.add_vdi(VALUES, show_scalar_bar=False)
    plotter.enable_ssao()
    plotter.screenshot(return_img=True)


def a_camera_that_looks_away(plotter, tmp_path):
    away = ((50, 5, 5), (90, 5, 5), (0, 0, 1))  # as PyVista's camera_position
    pvdi.generate(pvdi.Volume(VALUES), away, (8, 8))


CASES = [
    a_camera_that_looks_away,
    an_effect_that_does_not_see_it,
]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.__name__)
def test_a_warning_points_at_the_caller_s_line(case, plotter, tmp_path):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        case(plotter, tmp_path)
    ours = [each for each in caught if issubclass(each.category, pvdi.VDIWarning)]
    assert ours, "nothing was said"
    for each in ours:
        lines = {line for *_, line in case.__code__.co_lines()}
        assert (Path(each.filename), each.lineno in lines) == (Path(__file__), True), each


def test_no_module_warns_by_itself_or_changes_the_filters():
    """Filters are the whole process's; only the command line has that to itself."""
    package = Path(pvdi.__file__).parent
    forbidden = re.compile(r"(?<![\w.])warnings\.(warn|catch_warnings|(simple)?filter\w*)\(")
    found = [path for path in package.rglob("*.py") if forbidden.search(path.read_text("utf-8"))]
    assert {path.relative_to(package).parts[0] for path in found} <= {"cli"}, found
