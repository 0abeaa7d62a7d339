"""Pictures as PNG files."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from pyvista_vdi import io
from pyvista_vdi.errors import InvalidArgumentError, VDIFileError


def test_pictures_hold_straight_colour_or_lie_over_a_background():
    image = np.zeros((2, 2, 4), np.float32)
    image[0, 0] = (0.25, 0.125, 0.0, 0.5)  # half transparent (0.5, 0.25, 0)
    image[1, 1] = (1.0, 1.0, 1.0, 1.0)
    pixels = io.to_bytes(image)
    assert pixels.dtype == np.uint8
    assert pixels.tolist() == [[[128, 64, 0, 128], [0] * 4], [[0] * 4, [255] * 4]]
    pixels = io.to_bytes(image[:1], (1.0, 1.0, 0.0))
    assert pixels.tolist() == [[[191, 159, 0], [255, 255, 0]]]


def test_a_written_picture_reads_back(tmp_path):
    pixels = np.random.default_rng(0).integers(0, 256, (3, 5, 4), dtype=np.uint8)
    path = io.write_png(pixels, tmp_path / "a.png")
    with Image.open(path) as picture:
        assert np.array_equal(np.asarray(picture), pixels)
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]
    with pytest.raises(VDIFileError, match=r"must end in \.png, for instance 'a\.png'"):
        io.write_png(pixels, tmp_path / "a.jpg")


@pytest.mark.parametrize("background", [(0, 0), (0, 0, 2), (np.nan, 0, 0)])
def test_a_background_is_a_colour(background):
    with pytest.raises(InvalidArgumentError, match="background must be three numbers from 0 to 1"):
        io.to_bytes(np.zeros((1, 1, 4), np.float32), background)
