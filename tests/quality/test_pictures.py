"""What a view shows of a VDI, and of its detail."""

from __future__ import annotations

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi.model.coverage import coverage
from pyvista_vdi.quality.view_error import contrast_ratio

SIZE = (64, 64)
BOUNDS = (-1.0, 1.0) * 3


def vdi_of(camera, size=SIZE):
    """A VDI of nothing, with a view and bounds."""
    empty = np.zeros(size[0] * size[1] + 1, dtype=np.int64)
    return pvdi.VDI(camera, size, empty, [], [], np.zeros((0, 3)), [], BOUNDS)


def along_z(scale=1.0, center=(0.0, 0.0), **changes):
    view = ((0, 0, 5), (0, 0, 0), (0, 1, 0))
    how = {"parallel_projection": True, "parallel_scale": scale, "window_center": center}
    return pvdi.Camera(*view, **{**how, **changes})


@pytest.mark.parametrize(
    ("v_o", "v_n", "share"),
    [
        (along_z(), along_z(), 1.0),
        (along_z(2.0), along_z(), 1.0),
        (along_z(), along_z(2.0), 1.0),  # what is around the volume is not asked for
        (along_z(center=(1.0, 0.0)), along_z(), 0.5),  # its left half lies outside
        (along_z(0.5), along_z(), 0.25),
        (along_z(), pvdi.Camera((0, 0, -5), (0, 0, 0), (0, 1, 0)), 1.0),  # from behind
        (along_z(), pvdi.Camera((0, 0, 5), (0, 0, 9), (0, 1, 0)), 1.0),  # nothing in view
    ],
)
def test_coverage_is_the_share_of_the_rays_that_the_vdi_has(v_o, v_n, share):
    # Of 33 rays along an edge, those at the border may be in or out
    assert coverage(vdi_of(v_o), v_n, SIZE) == pytest.approx(share, abs=0.06)


@pytest.mark.parametrize("eye", [(0.0, 0.0, 0.0), (0.9, 0.9, 0.9), (0.0, 0.0, 3.0)])
def test_an_eye_that_turns_leaves_what_was_covered(eye):
    """An eye within the volume has its own view, and not all of one that it has turned to."""
    inside = max(eye) < 1
    v_o = pvdi.Camera(eye, (0.0, 0.1, -9.0), (0, 1, 0), view_angle=40)
    aside = v_o.replace(focal_point=(9.0, 0.1, 9.0))
    assert coverage(vdi_of(v_o), v_o, SIZE) == 1.0
    turned = coverage(vdi_of(v_o), aside, SIZE)
    assert (turned < 0.6) if inside else (turned == 1.0)  # from outside nothing is seen there
    # Something of what lies behind V_O's eye is not covered, though it is in V_O's direction
    assert coverage(vdi_of(v_o), v_o.replace(position=(0, 0, 9.0)), SIZE) < 1 or not inside


def test_contrast_is_of_detail_within_blocks_and_weighted():
    rng = np.random.default_rng(1)
    sharp = np.float32(rng.random((2, 24, 24, 4)))
    sharp[..., 3] = 1
    coarse = sharp[:, ::4, ::4].repeat(4, axis=1).repeat(4, axis=2)
    assert contrast_ratio(list(coarse), list(sharp), np.ones(2)) == 0
    half = [0.5 * sharp[0] + 0.5 * coarse[0], sharp[1]]
    assert contrast_ratio(half, list(sharp), np.ones(2)) == pytest.approx(0.75, abs=0.01)
    assert contrast_ratio(half, list(sharp), np.array([1.0, 3.0])) == pytest.approx(0.875, abs=0.01)
    assert contrast_ratio(list(coarse), list(coarse), np.ones(2)) == 1
