"""The volume: which arrays it takes, its grid, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest
import strategies
from hypothesis import given
from strategies import GENERATORS

from pyvista_vdi.model.volume import Volume


@pytest.mark.parametrize(
    ("given_type", "held"),
    [("bool", "uint8"), ("float16", "float32"), ("int64", "float64"), ("uint64", "float64"),
     (">i2", "int16"), (">f8", "float64"), ("<f4", "float32")],
)  # fmt: skip
def test_other_types_are_widened_without_loss(given_type, held):
    array = (np.arange(27).reshape(3, 3, 3) % 2).astype(given_type)
    volume = Volume(array)
    assert volume.array.dtype == np.dtype(held)
    assert volume.array.dtype.isnative
    np.testing.assert_array_equal(volume.array, array)
    turned = Volume(array.T)  # is copied
    assert turned.array.flags.c_contiguous
    np.testing.assert_array_equal(turned.array, array.T)


@given(GENERATORS)
def test_the_grid_s_points_are_where_vtk_puts_them(rng):
    """origin + direction @ (spacing * index), and bounds that just hold all of them."""
    volume = strategies.random_volume(rng, "uint8", direction=strategies.random_rotation(rng))
    index = np.stack(np.meshgrid(*(np.arange(n) for n in volume.dimensions)), axis=-1).reshape(
        -1, 3
    )
    points = volume.origin + (volume.direction @ (np.array(volume.spacing) * index).T).T
    matrix = volume.index_to_model
    np.testing.assert_allclose(index @ matrix[:3, :3].T + matrix[:3, 3], points, atol=1e-12)
    low, high = np.reshape(volume.bounds, (3, 2)).T
    np.testing.assert_allclose(points.min(axis=0), low, atol=1e-12)
    np.testing.assert_allclose(points.max(axis=0), high, atol=1e-12)
    assert volume.length == pytest.approx(np.linalg.norm(high - low))
