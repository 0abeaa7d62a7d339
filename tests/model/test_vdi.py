"""A VDI is valid or cannot be built: its arrays, lists and equality."""

from __future__ import annotations

import numpy as np
import pytest
import strategies
from hypothesis import given
from ray_scenes import rebuilt
from strategies import GENERATORS

from pyvista_vdi import VDI, Camera

CAMERA = Camera((0, 0, 9), (0, 0, 0), (0, 1, 0))


def arguments(**changes):
    """Three lists of 2, 0 and 1 supersegments in a window of 3 x 1."""
    good = {
        "camera": CAMERA,
        "window_size": (3, 1),
        "offsets": [0, 2, 2, 3],
        "front": [1.0, 2.0, 1.5],
        "back": [2.0, 3.0, 1.75],
        "color": [[0, 0, 0], [1, 1, 1], [0.2, 0.4, 0.6]],
        "optical_depth": [0.0, 0.5, 100.0],
        "bounds": (-1, 1, -2, 2, -3, 3),
        "depth_origin": 4.0,
    }
    return {**good, **changes}


@given(GENERATORS)
def test_random_vdis_are_equal_to_themselves_only(rng):
    vdi = strategies.random_vdi(rng, max_window=(4, 4))
    assert rebuilt(vdi).equals(vdi)
    assert not rebuilt(vdi, camera=vdi.camera.azimuth(1)).equals(vdi)
    wider = np.multiply(vdi.bounds, [2, 2, 1, 1, 1, 1])
    assert not rebuilt(vdi, bounds=wider).equals(vdi) or vdi.bounds[:2] == (0, 0)
    if vdi.n_supersegments:
        tau = np.nextafter(vdi.optical_depth, np.float32(np.inf))
        assert not rebuilt(vdi, optical_depth=tau).equals(vdi)


@pytest.mark.parametrize(
    ("changes", "counts"),
    [
        # The next list may begin before the last one ends; those that touch do not overlap
        ({"offsets": [0, 1, 2, 3], "front": [5, 1, 0], "back": [6, 2, 1]}, [1, 1, 1]),
        # Parallel projection may look behind its eye plane; depth zero is a depth
        ({"camera": CAMERA.replace(parallel_projection=True), "front": [-9, 2, 1.5]}, [2, 0, 1]),
        ({"front": [0, 2, 0], "depth_origin": 0.0}, [2, 0, 1]),
        (
            dict.fromkeys(("front", "back", "color", "optical_depth"), ()) | {"offsets": [0] * 4},
            [0, 0, 0],
        ),
    ],
)
def test_what_is_valid(changes, counts):
    vdi = VDI(**arguments(**changes))
    assert vdi.counts.tolist() == [counts]
    assert vdi.color.shape == (sum(counts), 3)
