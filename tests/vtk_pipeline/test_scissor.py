"""The pixels that a preview may show something in."""

import numpy as np
import pytest

from pyvista_vdi.vtk_pipeline.drawing.screen import shown_box


def interpolated(image, size):
    """The image by OpenGL's linear filter, edges clamped, at the centres of a viewport's pixels."""
    for axis, pixels in ((1, size[0]), (0, size[1])):
        n = image.shape[axis]
        at = (np.arange(pixels) + 0.5) * n / pixels - 0.5
        low = np.floor(at).astype(int)
        share = (at - low).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
        below, above = (image.take(np.clip(low + k, 0, n - 1), axis) for k in (0, 1))
        image = below * (1 - share) + above * share
    return image


@pytest.mark.parametrize("seed", range(40))
def test_nothing_is_shown_outside_and_little_is_empty(seed):
    rng = np.random.default_rng(seed)
    size = tuple(rng.integers(1, 90, 2).tolist())
    width, height = (int(rng.integers(1, n + 1)) for n in size)
    image = np.zeros((height, width, 4), np.float32)
    for _ in range(rng.integers(1, 4)):
        image[rng.integers(height), rng.integers(width)] = rng.random(4) + 0.1
    left, bottom, wide, high = shown_box(image, (7, 11), size)
    there = interpolated(image, size).any(axis=2)[::-1]
    rows, columns = np.nonzero(there.any(axis=1))[0], np.nonzero(there.any(axis=0))[0]
    assert left - 7 <= columns[0]
    assert left - 7 + wide > columns[-1]
    assert bottom - 11 <= rows[0]
    assert bottom - 11 + high > rows[-1]
    # Rounding outwards, by less than two pixels on each side
    assert wide <= columns[-1] - columns[0] + 1 + 4
    assert high <= rows[-1] - rows[0] + 1 + 4
    assert left >= 7
    assert left + wide <= 7 + size[0]
    assert bottom >= 11
    assert bottom + high <= 11 + size[1]


def test_nothing_shown_is_no_pixel():
    assert shown_box(np.zeros((3, 4, 4), np.float32), (5, 6), (8, 9)) == (0, 0, 0, 0)
