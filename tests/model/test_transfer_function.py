"""The transfer function's table: what it takes, keeps and refuses."""

from __future__ import annotations

import json

import numpy as np
import pytest

from pyvista_vdi import TransferFunction

COLORS = [[0, 0, 0], [0.5, 0.25, 1]]
OPACITIES = [0.0, 0.75]


def table(**changes):
    return TransferFunction(
        **{"colors": COLORS, "opacities": OPACITIES, "scalar_range": (-1, 3), **changes}
    )


def test_the_table_is_float32_and_read_only():
    opacities = np.array(OPACITIES, dtype=np.float32)
    function = table(opacities=opacities)
    opacities[0] = 1  # the caller's array is copied
    assert function.opacities[0] == 0
    assert repr(function.replace(unit_distance=2)) == (
        "TransferFunction(2 entries over (-1.0, 3.0), unit_distance=2.0, interpolation='nearest')"
    )
    assert function.colors.dtype == function.opacities.dtype == np.float32
    assert function.colors.shape == (2, 3)
    assert function.scalar_range == (-1.0, 3.0)
    assert function.unit_distance is None
    assert function.interpolation == "nearest"  # what add_volume draws by default
    for array in (function.colors, function.opacities):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


@pytest.mark.parametrize(
    "changes",
    [
        {"unit_distance": 0.3},
        {"interpolation": "linear"},
        {"scalar_range": (5, 5)},
        {"opacities": [0.1, 0.2]},
        {"colors": [[1, 1, 1], [0, 0, 0]]},
    ],
)
def test_equality_and_descriptions_see_every_part(changes):
    function, other = table(), table(**changes)
    assert function == table()
    assert hash(function) == hash(table())
    assert function != other
    assert function.replace(**changes) == other
    described = TransferFunction.from_dict(json.loads(json.dumps(other.to_dict())))
    assert described == other  # float32 survives JSON: its decimals are float64's
    assert function != "table"
