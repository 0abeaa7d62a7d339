"""What is asked of a picture: two requests that look alike are known to."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.cropping import Cropping
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


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("clipping_planes", [[0, 0, 0, 0, 0, 0]]),
        ("cropping", (1, 2, 3)),
        ("opacity_multiplier", -1),
        ("preview_samples", "8"),
        ("preview_samples", 0),
        ("transmittance_cutoff", 1),
    ],
)
def test_each_option_is_checked_where_it_is_made(name, wrong):
    with pytest.raises(InvalidArgumentError, match="plane" if "plane" in name else name):
        RenderOptions(**{name: wrong})
    with pytest.raises(InvalidArgumentError):
        RenderOptions().replace(**{name: wrong})


def test_requests_are_checked_and_cannot_be_changed():
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0))
    request = FrameRequest(camera, np.array([4, 3]), RenderOptions(PLANES))
    assert request.size == (4, 3)
    assert request.replace(size=(8, 6)).options is request.options
    with pytest.raises(dataclasses.FrozenInstanceError):
        request.size = (1, 1)
    with pytest.raises(InvalidArgumentError, match="window_size"):
        request.replace(size=(0, 3))
    with pytest.raises(InvalidArgumentError, match="out must be float32"):
        request.replace(out=np.empty((4, 3, 4), np.float32))
