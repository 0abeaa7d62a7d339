"""The transfer function's table: what it takes, keeps and refuses."""

from __future__ import annotations

import json

import pytest

from pyvista_vdi import TransferFunction

COLORS = [[0, 0, 0], [0.5, 0.25, 1]]
OPACITIES = [0.0, 0.75]


def table(**changes):
    return TransferFunction(
        **{"colors": COLORS, "opacities": OPACITIES, "scalar_range": (-1, 3), **changes}
    )


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
