"""Pictures as PNG files."""

from __future__ import annotations

import numpy as np

from pyvista_vdi import io


def test_pictures_hold_straight_colour_or_lie_over_a_background():
    image = np.zeros((2, 2, 4), np.float32)
    image[0, 0] = (0.25, 0.125, 0.0, 0.5)  # half transparent (0.5, 0.25, 0)
    image[1, 1] = (1.0, 1.0, 1.0, 1.0)
    pixels = io.to_bytes(image)
    assert pixels.dtype == np.uint8
    assert pixels.tolist() == [[[128, 64, 0, 128], [0] * 4], [[0] * 4, [255] * 4]]
    pixels = io.to_bytes(image[:1], (1.0, 1.0, 0.0))
    assert pixels.tolist() == [[[191, 159, 0], [255, 255, 0]]]
