"""``render_vdi(out=...)``: the same picture, in memory of the caller's."""

from __future__ import annotations

import numpy as np
import pytest
from drawing import render_vdi

from pyvista_vdi import VDI, Camera
from pyvista_vdi.device import aligned_empty
from pyvista_vdi.errors import InvalidArgumentError

CAMERA = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0))


def small_vdi() -> VDI:
    """Four lists of a window of 2 x 2; one is empty."""
    color = [[1.0, 0.5, 0.0], [0.2, 0.4, 0.6], [0.0, 0.0, 1.0], [0.9, 0.1, 0.3]]
    bounds = (-1, 1, -1, 1, -1, 1)
    depths = [4.0, 4.5, 4.2, 4.0], [4.5, 6.0, 5.0, 6.0]
    return VDI(CAMERA, (2, 2), [0, 2, 2, 3, 4], *depths, color, [2.0, 0.5, 0.1, 0.7], bounds)


@pytest.mark.parametrize("aligned", [True, False])
def test_the_picture_is_the_same(runtime, aligned):
    vdi, view, size = small_vdi(), CAMERA.azimuth(20), (31, 17)
    expected = render_vdi(vdi, view, size, device=runtime)
    out = aligned_empty((17, 31, 4), np.float32)
    if not aligned:
        out = np.empty(17 * 31 * 4 + 1, np.float32)[1:].reshape(17, 31, 4)
    for _ in range(2):
        out[...] = np.nan
        assert render_vdi(vdi, view, size, device=runtime, out=out) is out
        np.testing.assert_array_equal(out, expected)
    assert expected.max() > 0.1


def test_an_image_that_does_not_fit_is_refused(runtime):
    for out in (np.empty((2, 2, 3), np.float32), np.empty((2, 2, 4))):
        with pytest.raises(InvalidArgumentError, match="out must be float32 of the image's shape"):
            render_vdi(small_vdi(), CAMERA, (2, 2), device=runtime, out=out)
    out = np.empty((4, 2, 2), np.float32).T
    with pytest.raises(InvalidArgumentError, match="'image' must be C-contiguous"):
        render_vdi(small_vdi(), CAMERA, (2, 2), device=runtime, out=out)
