"""The level that a view requires, against widths of lists computed by hand."""

from __future__ import annotations

import numpy as np
import pytest

from pyvista_vdi import Camera
from pyvista_vdi.model.levels import required_level
from pyvista_vdi.model.volume import Grid

#: A cube from -1 to 1 at four levels: voxels of 2/64, 2/32, 2/16 and 2/8.
LEVELS = [Grid((n + 1,) * 3, (2 / n,) * 3, (-1.0,) * 3, np.eye(3)) for n in (64, 32, 16, 8)]
#: tan(45 degrees) = 1: at depth Z the window is 2 Z high.
FROM_TEN = Camera(position=(0, 0, 10), focal_point=(0, 0, 0), view_up=(0, 1, 0), view_angle=90)


# Half a list's width at 9 is 9 / lists; voxels are .03125, .0625, .125, .25
@pytest.mark.parametrize(
    ("lists", "level"),
    [(1000, 0), (145, 0), (143, 1), (73, 1), (71, 2), (37, 2), (35, 3), (9, 3)],
)
def test_level_is_the_coarsest_that_is_no_coarser_than_half_a_list(lists, level):
    for size in ((lists, lists), (2 * lists, lists)):
        assert required_level(LEVELS, FROM_TEN, size) == level


def test_in_the_volume_the_finest_and_past_it_the_coarsest():
    inside = FROM_TEN.replace(position=(0, 0, 0.5), focal_point=(0, 0, -1))
    assert required_level(LEVELS, inside, (9, 9)) == 0
    away = FROM_TEN.replace(focal_point=(0, 0, 20))
    assert required_level(LEVELS, away, (9000, 9000)) == 3
