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


def test_arrays_have_the_contract_s_types_and_are_read_only():
    front = np.array([1.0, 2.0, 1.5], dtype=np.float32)
    vdi = VDI(**arguments(front=front, metadata={"step": 1}))
    assert vdi.offsets.dtype == np.uint64
    for name in ("front", "back", "color", "optical_depth"):
        array = getattr(vdi, name)
        assert array.dtype == np.float32
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    front[0] = 7  # a caller's own array stays writable
    assert vdi.color.shape == (3, 3)
    assert vdi.bounds == (-1.0, 1.0, -2.0, 2.0, -3.0, 3.0)
    assert vdi.metadata == {"step": 1}
    assert (vdi.window_size, vdi.depth_origin, vdi.n_supersegments) == ((3, 1), 4.0, 3)
    assert vdi.nbytes == 4 * 8 + 3 * 4 * (1 + 1 + 3 + 1)
    assert "3 x 1 lists, 2 not empty, 3 supersegments" in repr(vdi)


def test_lists_are_found_by_pixel_from_the_bottom():
    rng = np.random.default_rng(1)
    vdi = strategies.random_vdi(rng)
    width, height = vdi.window_size
    for y in range(height):
        for x in range(width):
            part = vdi.list_at(x, y)
            i = y * width + x
            assert (part.start, part.stop) == (vdi.offsets[i], vdi.offsets[i + 1])
            assert vdi.counts[y, x] == part.stop - part.start
    with pytest.raises(IndexError, match="pixel \\(-1, 0\\) is outside the window of"):
        vdi.list_at(-1, 0)
    with pytest.raises(IndexError, match=f"pixel \\(0, {height}\\)"):
        vdi.list_at(0, height)


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
