"""Presets: arguments by name, and the name as a colour map."""

from __future__ import annotations

import numpy as np
import pytest

import pyvista_vdi as pvdi

pytest.importorskip("pyvista")

HOUNSFIELD = np.linspace(-1000, 2000, 3001)


def _alpha(look, values):
    """Return PyVista's own opacity at some values, by ``add_volume``'s lookup table."""
    from pyvista_vdi.plotting.classify import Looks

    look = {name: value for name, value in look.items() if name != "shade"}
    table = Looks(**look).lookup_table(HOUNSFIELD)
    return table.map_value(values)[3]


@pytest.mark.parametrize(
    ("name", "clear", "shown"),
    [
        ("ct-bone", 60, 1000),  # muscle, bone
        ("ct-skin", -900, 30),  # air, skin
        ("ct-muscle", -100, 60),  # fat, muscle
        ("ct-angiography", 40, 350),  # blood without and with contrast medium
    ],
)
def test_ct_shows_what_its_name_says(name, clear, shown):
    look = pvdi.presets[name]
    assert _alpha(look, clear) == 0
    assert _alpha(look, shown) > 0.04
    assert look["clim"][0] < shown < look["clim"][1]
    with pytest.raises(KeyError, match=f"there is no preset '{name}s': did you mean '{name}'"):
        pvdi.presets[f"{name}s"]


@pytest.mark.parametrize("name", list(pvdi.presets))
def test_the_name_is_a_colour_map_of_the_same_look(name):
    from pyvista_vdi.plotting.classify import Looks

    look = {k: v for k, v in pvdi.presets[name].items() if k != "shade"}
    one, other = (each.lookup_table(HOUNSFIELD) for each in (Looks(cmap=name), Looks(**look)))
    assert np.array_equal(one.values, other.values)
    assert one.scalar_range == other.scalar_range
    given = Looks(cmap=name, clim=(0, 5), opacity="sigmoid").lookup_table(HOUNSFIELD)
    assert given.scalar_range == (0, 5)
    assert not np.array_equal(given.values[:, 3], one.values[:, 3])
