"""The transfer function's table: what it takes, keeps and refuses."""

from __future__ import annotations

import json

import numpy as np
import pytest

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.transfer_function import TransferFunction

COLORS = [[0, 0, 0], [0.5, 0.25, 1]]
OPACITIES = [0.0, 0.75]


def table(**changes):
    return TransferFunction(
        **{"colors": COLORS, "opacities": OPACITIES, "scalar_range": (-1, 3), **changes}
    )


def test_the_table_is_float32_and_read_only():
    function = table()
    assert function.colors.dtype == function.opacities.dtype == np.float32
    assert function.colors.shape == (2, 3)
    assert function.scalar_range == (-1.0, 3.0)
    assert function.unit_distance is None
    assert function.interpolation == "nearest"  # what add_volume draws by default
    for array in (function.colors, function.opacities):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_the_caller_s_array_is_copied():
    opacities = np.array(OPACITIES, dtype=np.float32)
    function = table(opacities=opacities)
    opacities[0] = 1
    assert function.opacities[0] == 0


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


def test_repr_says_what_matters():
    assert repr(table(unit_distance=2)) == (
        "TransferFunction(2 entries over (-1.0, 3.0), unit_distance=2.0, interpolation='nearest')"
    )


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"opacities": [0.5]}, "as many opacities as colors; got 1 and 2"),
        ({"opacities": []}, r"opacities must have shape \(n,\); got \(0,\)"),
        ({"opacities": [[0, 1]]}, r"opacities must have shape \(n,\); got \(1, 2\)"),
        ({"opacities": [0, 1.5]}, "opacities must lie between 0 and 1; got 0.0 to 1.5"),
        ({"opacities": [-0.5, 1]}, "opacities must lie between 0 and 1; got -0.5"),
        ({"opacities": [np.nan, 1]}, "opacities must lie between 0 and 1; .* and NaN"),
        ({"opacities": ["thick", "thin"]}, "opacities must be numbers"),
        ({"colors": [[0, 0, 0, 1]] * 2}, r"colors must have shape \(n, 3\); got \(2, 4\)"),
        ({"colors": [[0, 0, 255]] * 2}, "colors must lie between 0 and 1; got 0.0 to 255.0"),
        ({"scalar_range": (3, 1)}, r"\(clim\) must be two finite numbers, the smaller first"),
        ({"scalar_range": (0, np.inf)}, "must be two finite numbers"),
        ({"scalar_range": (np.nan, 1)}, "must be two finite numbers"),
        ({"unit_distance": 0}, "unit_distance must be a positive length in model units; got 0"),
        ({"unit_distance": np.inf}, "unit_distance must be a positive length"),
        ({"unit_distance": -1}, "unit_distance .* got -1"),
        ({"interpolation": "cubic"}, "interpolation must be 'nearest' or 'linear'; got 'cubic'"),
        # Found by fuzzing: errors of NumPy and Python came out, or a warning
        ({"scalar_range": 3}, "must be two finite numbers"),
        ({"scalar_range": (1, 2, 3)}, "must be two finite numbers"),
        ({"scalar_range": ("a", "b")}, "must be two finite numbers"),
        ({"unit_distance": "x"}, "unit_distance .* got 'x'"),
        ({"opacities": [0, 1e300]}, "opacities must lie between 0 and 1; got 0.0 to inf"),
    ],
)
def test_impossible_tables_are_refused(changes, message):
    with pytest.raises(InvalidArgumentError, match=message):
        table(**changes)
    with pytest.raises(InvalidArgumentError, match=message):
        table().replace(**changes)


@pytest.mark.parametrize(
    "state", [None, [1], {}, {"colors": [[0, 0, 0]]}, {"shading": 3}, {"shading": {"glow": 1}}]
)
def test_what_is_no_description_is_refused(state):
    with pytest.raises(InvalidArgumentError, match="no description of a transfer function"):
        TransferFunction.from_dict(state)


def test_unknown_parts_are_refused_by_name():
    with pytest.raises(InvalidArgumentError, match="has no gamma"):
        table().replace(gamma=2.2)
