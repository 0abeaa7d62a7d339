"""A CPU device marches in blocks of rays: VDIs and pictures are the same, to the last bit.

Kernels of 16 lanes against one, as other devices have them.
"""

from __future__ import annotations

import numpy as np
import pytest
from drawing import generate_vdi
from march_ways import CENTER, VIEWS, WINDOW, both_ways, transfer_for, volume_of
from settings import with_settings

from pyvista_vdi import Volume, render_volume

FULL = Volume(np.maximum(volume_of(np.uint8).array, 120))
ENDS = np.random.default_rng(3).uniform(60, 160, WINDOW[::-1]).astype(np.float32)
ENDS[:5] = np.inf
PARTS = [
    {"clipping_planes": [(*CENTER, 1, 0.5, 0.2)]},
    {"cropping": ((10, 30, 10, 30, 10, 30), "fence")},
    {"opaque_depth": ENDS},
]


@pytest.fixture
def check(monkeypatch, runtime):
    """Make something of a volume by both forms of a kernel, and compare the bits."""

    def checked(make, kernel, volume, interpolation="nearest", view="all of it", **options):
        arguments = (volume, VIEWS[view](volume), WINDOW)
        function = transfer_for(volume, interpolation)
        if make is generate_vdi:
            arguments += (function,)
        else:
            options = with_settings(transfer_function=function, **options)
        found, expected, launches = both_ways(
            monkeypatch, runtime, kernel, lambda: make(*arguments, device=runtime, **options)
        )
        assert launches[0] == launches[1] > 0
        if make is generate_vdi:
            assert found.equals(expected)
            assert found.n_supersegments > (100 if view == "past it" else 1500)
        else:
            assert found.tobytes() == expected.tobytes()
            assert found[..., 3].max() > 0.1

    return checked


MAKERS = [(generate_vdi, "march_lists"), (render_volume, "render_volume")]


@pytest.mark.every(3)
@pytest.mark.parametrize(("make", "kernel"), MAKERS)
@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
@pytest.mark.parametrize("dtype", [np.uint8, np.int8, np.uint16, np.int16, np.float32, np.int32])
def test_types(check, make, kernel, dtype, interpolation):
    check(make, kernel, volume_of(dtype), interpolation)


@pytest.mark.parametrize(("make", "kernel"), MAKERS)
@pytest.mark.parametrize("view", VIEWS)
def test_views(check, make, kernel, view):
    check(make, kernel, volume_of(np.uint8), view=view)
    check(make, kernel, FULL, view=view)  # without empty blocks


@pytest.mark.parametrize(
    "options",
    [
        {"sample_distance": 0.1},  # many steps a voxel, in several chunks
        {"sample_distance": 1.7},
        {"max_supersegments": 5, "tolerance": 0.05},
        {"max_supersegments": 200},
        {"view_cone": 0.0},
        {"criterion": "homogeneity"},
        {"memory_limit": "4 MiB"},  # slices of four rows
    ],
    ids=str,
)
@pytest.mark.parametrize("kernel", ["march_lists", "shorten_lists"])
def test_vdis(check, kernel, options):
    if kernel == "march_lists" or "criterion" not in options:  # which shortens nothing here
        check(generate_vdi, kernel, volume_of(np.uint8, spacing=(1, 0.8, 1.3)), **options)


@pytest.mark.parametrize(
    "options",
    [
        *PARTS,
        {"sample_distance": 0.03},  # opacity is summed up from 0
        {"early_termination": False},
        {"opacity_multiplier": 0.3},
    ],
    ids=lambda options: next(iter(options)),
)
def test_pictures(check, options):
    check(render_volume, "render_volume", volume_of(np.uint8), "linear", **options)


@pytest.mark.every(3)
@pytest.mark.parametrize("blending", ["maximum", "minimum", "average", "additive"])
@pytest.mark.parametrize("options", [{}, *PARTS], ids=lambda options: next(iter(options), "all"))
def test_projections(check, blending, options):
    volume = volume_of(np.uint8 if options else np.float32)
    check(render_volume, "project", volume, "linear", blending=blending, **options)
