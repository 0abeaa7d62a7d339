"""What is asked of a picture: two requests that look alike are known to."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pyvista_vdi import Camera, Cropping
from pyvista_vdi.model.render_options import FrameRequest, RenderOptions

PLANES = np.array([[0, 0, 1, 0, 0, 1.0], [0, 0, 2, 0, 0, -1.0]])
BOX = (-1, 1, -1, 1, -1, 1)


def test_what_looks_the_same_is_equal():
    options = RenderOptions(PLANES, BOX, 2)
    assert options == RenderOptions(PLANES.tolist(), Cropping(BOX), 2.0)
    assert hash(options) == hash(RenderOptions(PLANES.copy(), BOX, 2))
    assert options != options.replace(clipping_planes=PLANES[:1])
    assert options.replace(clipping_planes=None) == RenderOptions(
        cropping=BOX, opacity_multiplier=2
    )
    assert len({RenderOptions(), RenderOptions(None), RenderOptions([]), options}) == 2


def test_requests_are_checked_and_cannot_be_changed():
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0))
    request = FrameRequest(camera, np.array([4, 3]), RenderOptions(PLANES))
    assert request.size == (4, 3)
    assert request.replace(size=(8, 6)).options is request.options
    with pytest.raises(dataclasses.FrozenInstanceError):
        request.size = (1, 1)
