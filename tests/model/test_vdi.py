"""A VDI is valid or cannot be built: every rule of DESIGN section 2, and the element it names."""

from __future__ import annotations

import numpy as np
import pytest
import strategies
from hypothesis import given
from strategies import GENERATORS

from pyvista_vdi.errors import InvalidArgumentError, InvalidVDIError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI

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
    vdi = VDI(**arguments(metadata={"step": 1}))
    assert vdi.offsets.dtype == np.uint64
    for name in ("front", "back", "color", "optical_depth"):
        array = getattr(vdi, name)
        assert array.dtype == np.float32
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    assert vdi.color.shape == (3, 3)
    assert vdi.bounds == (-1.0, 1.0, -2.0, 2.0, -3.0, 3.0)
    assert vdi.metadata == {"step": 1}
    assert (vdi.window_size, vdi.depth_origin, vdi.n_supersegments) == ((3, 1), 4.0, 3)


def test_a_caller_s_own_array_stays_writable():
    front = np.array([1.0, 2.0, 1.5], dtype=np.float32)
    VDI(**arguments(front=front))
    front[0] = 7


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


def test_what_it_holds_is_counted():
    vdi = VDI(**arguments())
    assert vdi.nbytes == 4 * 8 + 3 * 4 * (1 + 1 + 3 + 1)
    assert "3 x 1 lists, 2 not empty, 3 supersegments" in repr(vdi)


def test_an_empty_vdi_is_valid():
    empty = {"front": [], "back": [], "color": [], "optical_depth": []}
    vdi = VDI(**arguments(offsets=[0, 0, 0, 0], **empty))
    assert vdi.n_supersegments == 0
    assert vdi.color.shape == (0, 3)


@given(GENERATORS)
def test_random_vdis_are_equal_to_themselves_only(rng):
    vdi = strategies.random_vdi(rng, max_window=(4, 4))
    names = (
        "camera",
        "window_size",
        "offsets",
        "front",
        "back",
        "color",
        "optical_depth",
        "bounds",
    )
    same = {name: getattr(vdi, name) for name in (*names, "depth_origin")}
    assert VDI(**same).equals(vdi)
    assert not VDI(**{**same, "camera": vdi.camera.azimuth(1)}).equals(vdi)
    assert not VDI(**{**same, "bounds": np.multiply(vdi.bounds, [2, 2, 1, 1, 1, 1])}).equals(
        vdi
    ) or (vdi.bounds[:2] == (0, 0))
    if vdi.n_supersegments:
        tau = np.nextafter(vdi.optical_depth, np.float32(np.inf))
        assert not VDI(**{**same, "optical_depth": tau}).equals(vdi)


# -- rules -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"offsets": [0, 2, 3]}, r"W \* H \+ 1 = 4 entries for 3 x 1 lists; got 3"),
        ({"offsets": [1, 2, 2, 3]}, r"offsets\[0\] must be 0; got 1"),
        ({"offsets": [0, 2, 1, 3]}, r"must not decrease; offsets\[1\] = 2 is followed by 1"),
        ({"offsets": [0, 1, 2, 2]}, r"offsets\[-1\] = 2 supersegments, but front has 3"),
        ({"offsets": [0, -1, 2, 3]}, "offsets must be whole numbers >= 0"),
        ({"offsets": [0, 1.5, 2, 3]}, "offsets must be whole numbers >= 0"),
        ({"offsets": [[0, 2, 2, 3]]}, r"offsets must have shape \(n,\); got \(1, 4\)"),
        ({"back": [2.0, 3.0]}, "front has 3 and back has 2 entries"),
        ({"color": [0, 0, 0]}, r"color must have shape \(n, 3\); got \(3,\)"),
        ({"front": ["a", "b", "c"]}, "front must be numbers"),
        (
            {"front": [1.0, 3.0, 1.5]},
            r"supersegment 1 \(list 0: pixel x=0, y=0\) breaks the rule 'front < back': front 3.0",
        ),
        ({"front": [1.0, 4.0, 1.5]}, "supersegment 1 .* 'front < back'"),
        (
            {"front": [1.0, 1.5, 1.5]},
            "supersegment 1 .* 'sorted within its list and not overlapping'",
        ),
        ({"back": [2.0, np.inf, 1.75]}, "supersegment 1 .* 'front and back finite'"),
        ({"front": [np.nan, 2.0, 1.5]}, "supersegment 0 .* 'front and back finite'"),
        (
            {"front": [-4.5, 2.0, 1.5]},
            r"supersegment 0 .* 'in front of the eye \(depth >= 0\)'.*depth_origin 4.0",
        ),
        (
            {"color": [[0, 0, 0], [1, 1, 1], [0.2, 1.5, 0.6]]},
            r"supersegment 2 \(list 2: pixel x=2, y=0\) breaks the rule '0 <= color <= 1'",
        ),
        ({"color": [[0, np.nan, 0], [1, 1, 1], [0, 0, 0]]}, "supersegment 0 .* '0 <= color <= 1'"),
        ({"optical_depth": [0, -0.5, 1]}, "supersegment 1 .* 'optical_depth >= 0 and finite'"),
        ({"optical_depth": [0, np.inf, 1]}, "supersegment 1 .* 'optical_depth >= 0 and finite'"),
        ({"optical_depth": [0, 0, np.nan]}, "supersegment 2 .* 'optical_depth >= 0 and finite'"),
        ({"depth_origin": np.inf}, "depth_origin must be finite; got inf"),
        ({"bounds": (1, -1, 0, 1, 0, 1)}, "bounds must be six finite numbers"),
        ({"bounds": (0, 1, 0, 1)}, "bounds must be six finite numbers"),
        ({"bounds": (0, 1, 0, 1, 0, np.nan)}, "bounds must be six finite numbers"),
        # Found by fuzzing: errors of NumPy and Python came out, or a warning
        ({"bounds": [[1, 2], [3]]}, "bounds must be six finite numbers"),
        ({"bounds": {"a": 1}}, "bounds must be six finite numbers"),
        ({"front": [[1, 2], [3]]}, "front must be an array of numbers"),
        ({"back": [2.0, 1e300, 1.75]}, "supersegment 1 .* 'front and back finite'"),
        ({"depth_origin": "x"}, "depth_origin must be finite; got 'x'"),
        ({"depth_origin": []}, r"depth_origin must be finite; got \[\]"),
        ({"metadata": [1]}, "metadata must be a dictionary; got list"),
    ],
)
def test_a_broken_rule_is_named_with_its_element(changes, message):
    with pytest.raises(InvalidVDIError, match=message):
        VDI(**arguments(**changes))


def test_lists_are_sorted_each_for_itself():
    """The next list may begin before the last one ends; touching supersegments do not overlap."""
    vdi = VDI(**arguments(offsets=[0, 1, 2, 3], front=[5, 1, 0], back=[6, 2, 1]))
    assert vdi.counts.tolist() == [[1, 1, 1]]


def test_parallel_projection_may_look_behind_its_eye_plane():
    flat = CAMERA.replace(parallel_projection=True)
    assert VDI(**arguments(camera=flat, front=[-9, 2, 1.5])).front[0] == -9


def test_depth_zero_is_a_depth():
    vdi = VDI(**arguments(front=[0, 2, 0], depth_origin=0.0))
    assert vdi.counts.tolist() == [[2, 0, 1]]


def test_a_window_of_no_size_is_refused():
    with pytest.raises(InvalidArgumentError, match="got 0 x 1"):
        VDI(**arguments(window_size=(0, 1)))
