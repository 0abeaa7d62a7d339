"""A CPU device marches, and shortens records, in blocks of rays: the VDI is the same.

Kernels of 16 lanes against one, as other devices have them, to the last bit.
"""

from __future__ import annotations

import numpy as np
import pytest
from drawing import generate_vdi
from march_ways import VIEWS, WINDOW, both_ways, transfer_for, volume_of

from pyvista_vdi import Volume


@pytest.fixture
def check(monkeypatch, runtime):
    """Make a VDI by both forms of the march, compare, and return it."""

    def checked(volume, view="all of it", interpolation="nearest", **options):
        arguments = (volume, VIEWS[view](volume), WINDOW, transfer_for(volume, interpolation))
        found, expected, launches = both_ways(
            monkeypatch,
            runtime,
            "march_lists",
            lambda: generate_vdi(*arguments, device=runtime, **options),
        )
        assert found.equals(expected)
        assert launches[0] == launches[1] > 0
        return found

    return checked


@pytest.mark.every(5)
@pytest.mark.parametrize("dtype", [np.uint8, np.int8, np.uint16, np.int16])
@pytest.mark.parametrize("view", VIEWS)
def test_views_and_types(check, dtype, view):
    vdi = check(volume_of(dtype), view)
    assert vdi.n_supersegments > (100 if view == "past it" else 5000)


@pytest.mark.every(3)
@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.float32])
@pytest.mark.parametrize("step", [0.5, 1.0])
def test_linear_samples(check, dtype, step):
    vdi = check(volume_of(dtype), interpolation="linear", sample_distance=step)
    assert vdi.n_supersegments > 5000


@pytest.mark.parametrize("dtype", [np.float32, np.int32])
def test_nearest_samples_that_are_classified(check, dtype):
    check(volume_of(dtype))


@pytest.mark.parametrize(
    "options",
    [
        {"sample_distance": 0.1},  # many steps a voxel, in several chunks
        {"sample_distance": 1.7},
        {"max_supersegments": 1},
        {"max_supersegments": 5, "tolerance": 0.05},
        {"max_supersegments": 200},
        {"view_cone": 0.0},
        {"criterion": "homogeneity"},
        {"memory_limit": "4 MiB"},  # slices of four rows
    ],
    ids=str,
)
def test_options(check, options):
    check(volume_of(np.uint8, spacing=(1, 0.8, 1.3)), **options)


def test_volumes_without_empty_blocks(check):
    check(Volume(np.maximum(volume_of(np.uint8).array, 120)))
