"""A CPU device marches nearest samples of integers in blocks of rays: the VDI is the same.

``generation/march_lists.cl`` of 16 lanes against one, to the last bit.
"""

from __future__ import annotations

import numpy as np
import pytest

from pyvista_vdi import Camera, TransferFunction, Volume
from pyvista_vdi.device import Runtime
from pyvista_vdi.device.work_order import BLOCK_RAYS, GROUP
from pyvista_vdi.generation import march, slices
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.standard_cases import filling_camera

WINDOW = (53, 39)  # no multiple of a block's edge
CENTER = (24.5, 20.0, 23.0)


def volume_of(dtype, spacing=(1, 1, 1)):
    """Layers, noise, and a corner of nothing, where blocks are passed by."""
    rng = np.random.default_rng(11)
    z, y, x = np.mgrid[:47, :41, :50] / 40
    field = 0.5 + 0.4 * np.sin(9 * x * y) * np.cos(5 * z) + 0.1 * rng.random(x.shape)
    field[(x + y + z > 1.9) | (x < 0.2)] = 0
    low, high = (-100, 100) if np.dtype(dtype).kind == "i" else (0, 200)
    return Volume((low + (high - low) * field).astype(dtype), spacing)


def transfer_for(volume):
    rng = np.random.default_rng(12)
    low, high = float(volume.array.min()), float(volume.array.max())
    opacities = np.clip(np.linspace(-0.1, 0.7, 30), 0, 1)
    opacities[-1] = 1.0  # the highest scalar is opaque
    colors = rng.random((30, 3))
    return TransferFunction(colors, opacities, (low, high), interpolation="nearest")


VIEWS = {
    "all of it": lambda volume: filling_camera(volume.bounds, WINDOW).azimuth(33),
    "parallel": lambda volume: Camera(
        (90, 60, 80), CENTER, (0, 1, 0), parallel_projection=True, parallel_scale=40
    ),
    "along an axis": lambda volume: Camera(
        (*CENTER[:2], 90), CENTER, (0, 1, 0), parallel_projection=True
    ),
    "from inside": lambda volume: Camera(CENTER, (0, 0, 0), (0, 1, 0)),
    "past it": lambda volume: Camera((0, 0, 120), (0, 0, 0), (0, 1, 0)),
}


@pytest.fixture
def ways(monkeypatch, runtime):
    """Make a VDI with each form of the march; how often each was launched, by its groups."""
    if not runtime.is_cpu:
        pytest.skip("only CPU devices march in blocks")
    launches = {GROUP: 0, GROUP // BLOCK_RAYS: 0}
    launch = Runtime.launch

    def counted(self, kernel, size, group, *arguments, **options):
        if kernel.name == "march_lists":
            launches[group] += 1
        launch(self, kernel, size, group, *arguments, **options)

    monkeypatch.setattr(Runtime, "launch", counted)

    def both(volume, camera, **options):
        arguments = (volume, camera, WINDOW, transfer_for(volume))
        found = generate_vdi(*arguments, device=runtime, **options)
        with monkeypatch.context() as patch:
            patch.setattr(march, "_IN_BLOCKS", set())
            expected = generate_vdi(*arguments, device=runtime, **options)
        return found, expected

    return both, launches


def check(ways, volume, camera, **options):
    both, launches = ways
    found, expected = both(volume, camera, **options)
    assert found.equals(expected)
    assert launches[GROUP] == launches[GROUP // BLOCK_RAYS] > 0
    return found


@pytest.mark.parametrize("dtype", [np.uint8, np.int8, np.uint16, np.int16])
@pytest.mark.parametrize("view", VIEWS)
def test_views_and_types(ways, dtype, view):
    volume = volume_of(dtype)
    vdi = check(ways, volume, VIEWS[view](volume))
    assert vdi.n_supersegments > (100 if view == "past it" else 5000)


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
        {"criterion": "length"},
    ],
    ids=str,
)
def test_options(ways, options):
    volume = volume_of(np.uint8, spacing=(1, 0.8, 1.3))
    check(ways, volume, VIEWS["all of it"](volume), **options)


def test_volumes_without_empty_blocks(ways):
    array = volume_of(np.uint8).array
    volume = Volume(np.maximum(array, 120))
    check(ways, volume, VIEWS["all of it"](volume))


def test_a_slice_of_four_rows(ways, monkeypatch):
    monkeypatch.setattr(slices, "_SLICE_BYTES", 1)
    volume = volume_of(np.uint8)
    check(ways, volume, VIEWS["all of it"](volume))
