"""A VDI of every k-th list: the same lists of the same rays."""

from __future__ import annotations

import numpy as np
import pytest
from reference.raycast import render
from strategies import random_vdi

from pyvista_vdi import Camera
from pyvista_vdi.vtk_pipeline.interaction.fewer_lists import lists_crossed, subsampled_lists

STRETCHED = np.diag([1.0, 2.0, 3.0, 1.0])
LENSES = (
    {},
    {"parallel_projection": True, "parallel_scale": 1.4},
    {"window_center": (0.3, -0.2), "model_transform": STRETCHED},
    {"use_horizontal_view_angle": True, "position": (1e6 + 4, 1, 0), "focal_point": (1e6, 0, 0)},
)


def vdi_of(lens, window, precision="exact", seed=3):
    view = {"position": (4, 1, 0), "focal_point": (0, 0, 0), "view_up": (0, 0, 1), **lens}
    far = view["focal_point"][0]
    bounds = (far - 1, far + 1, -1, 1, -1, 1)
    rng = np.random.default_rng(seed)
    vdi = random_vdi(rng, window=window, camera=Camera(**view), bounds=bounds)
    return vdi.with_precision(precision)


@pytest.mark.parametrize("lens", range(len(LENSES)))
@pytest.mark.parametrize("steps", [(1, 1), (2, 1), (1, 3), (3, 2)])
def test_its_picture_is_every_kth_pixel(lens, steps):
    vdi = vdi_of(LENSES[lens], (12, 9))
    few = subsampled_lists(vdi, *steps)
    x, y = (np.arange((k - 1) // 2, n, k) for k, n in zip(steps, vdi.window_size, strict=True))
    assert few.window_size == (len(x), len(y))
    whole = render(vdi, vdi.camera, vdi.window_size)[::-1]
    own = render(few, few.camera, few.window_size)[::-1]
    # A list's own ray: the same but for the rounding of its view, at an eye 1e6 from the origin
    np.testing.assert_allclose(own, whole[np.ix_(y, x)], atol=1e-6)
    assert few.n_supersegments == vdi.counts[np.ix_(y, x)].sum()


@pytest.mark.parametrize("precision", ["8-byte"])
def test_precision_stays(precision):
    vdi = vdi_of({}, (8, 6), precision)
    few = subsampled_lists(vdi, 2, 3)
    assert few.precision == precision
    taken = np.ravel_multi_index(np.ix_(range(1, 6, 3), range(0, 8, 2)), (6, 8)).ravel()
    rows = np.concatenate([np.arange(*vdi.offsets[i : i + 2].astype(int)) for i in taken])
    for name in ("front", "back", "color", "optical_depth"):
        np.testing.assert_array_equal(getattr(few, name), getattr(vdi, name)[rows], err_msg=name)


@pytest.mark.parametrize("lens", range(2))
def test_lists_are_crossed_along_the_edge_that_the_view_turns_along(lens):
    vdi = vdi_of(LENSES[lens], (64, 48))
    camera = vdi.camera
    np.testing.assert_allclose(lists_crossed(vdi, camera), 0, atol=1e-9)
    x, y = lists_crossed(vdi, camera.azimuth(30))
    assert x > 4 * y
    x, y = lists_crossed(vdi, camera.elevation(30))
    assert y > 4 * x
    near, far = (lists_crossed(vdi, camera.azimuth(angle)).sum() for angle in (5, 20))
    assert 2 < far / near < 5  # about as the tangent of the angle: 4.2
    behind = camera.replace(position=tuple(-np.array(camera.position)))
    assert np.isfinite(lists_crossed(vdi, behind)).all()
