"""A CPU device draws volumes in blocks of rays: the picture is the same.

``volume/render_volume.cl`` and ``project.cl`` of 16 lanes against one, to the last bit.
"""

from __future__ import annotations

import numpy as np
import pytest
from march_ways import CENTER, VIEWS, WINDOW, both_ways, transfer_for, volume_of

from pyvista_vdi import Volume, render_volume


@pytest.fixture
def check(monkeypatch, runtime):
    """Draw a volume by both forms of the march, and compare the bits."""

    def checked(
        volume, interpolation="nearest", view="all of it", kernel="render_volume", **options
    ):
        function = transfer_for(volume, interpolation)
        scene = (volume, VIEWS[view](volume), WINDOW)
        options = {"transfer_function": function, "device": runtime, **options}
        found, expected, launches = both_ways(
            monkeypatch, runtime, kernel, lambda: render_volume(*scene, **options)
        )
        assert launches == (1, 1)
        assert found.tobytes() == expected.tobytes()
        assert found[..., 3].max() > 0.1

    return checked


@pytest.mark.every(4)
@pytest.mark.parametrize("dtype", [np.uint8, np.int8, np.uint16, np.int16, np.float32, np.float64])
@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
def test_types(check, dtype, interpolation):
    check(volume_of(dtype), interpolation)


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
def test_views(check, view, interpolation):
    check(volume_of(np.uint8), interpolation, view)


def opaque_depth():
    """Ends of rays before, in and behind the volume of the view of all of it."""
    depth = np.random.default_rng(3).uniform(60, 160, WINDOW[::-1]).astype(np.float32)
    depth[:5] = np.inf
    return depth


PARTS = [
    {"clipping_planes": [(*CENTER, 1, 0.5, 0.2)]},
    {"cropping": ((10, 30, 10, 30, 10, 30), "fence")},
    {"opaque_depth": opaque_depth()},
]


@pytest.mark.every(3)
@pytest.mark.parametrize(
    "options",
    [
        *PARTS,
        {"cropping": (10, 30, 10, 30, 10, 30)},
        {"sample_distance": 0.1},
        {"sample_distance": 1.7},
        {"sample_distance": 0.03},  # opacity is summed up from 0
        {"early_termination": False},
        {"skip_empty": False},
        {"opacity_multiplier": 0.3},
    ],
    ids=lambda options: next(iter(options)),
)
def test_options(check, options):
    check(volume_of(np.uint8, spacing=(1, 0.8, 1.3)), "linear", **options)


@pytest.mark.every(4)
@pytest.mark.parametrize("dtype", [np.uint8, np.float32])
@pytest.mark.parametrize("blending", ["maximum", "minimum", "average", "additive"])
@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
def test_projections(check, dtype, blending, interpolation):
    check(volume_of(dtype), interpolation, kernel="project", blending=blending)


@pytest.mark.parametrize("options", PARTS, ids=lambda options: next(iter(options)))
def test_projections_of_a_part(check, options):
    check(volume_of(np.uint8), kernel="project", blending="average", **options)


def test_volumes_without_empty_blocks(check):
    check(Volume(np.maximum(volume_of(np.uint8).array, 120)))
