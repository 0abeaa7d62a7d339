"""Opacity, extinction and transfer functions; rounding that accumulates along a ray."""

from __future__ import annotations

import numpy as np
import pytest
import reference
from drawing import generate_vdi, raycast_volume, render_vdi, render_vdis
from extreme_scenes import BOUND, assert_within, slabs_vdi
from reference.compositing import composite

from pyvista_vdi import Camera, TransferFunction, Volume
from pyvista_vdi.model.float32_limits import MANY_MEDIA, MOST_STEPS, VERY_MANY_MEDIA

pytestmark = pytest.mark.extremes


EYE = Camera((0, 0, 10), (0, 0, 0), (0, 1, 0), view_angle=10)
BOUNDS = (-1, 1, -1, 1, -1, 1)


def crowded(n, optical_depth, camera=EYE, window=(1, 1)):
    """A VDI of lists of n touching supersegments, from depth 9 to 11."""
    ends = np.linspace(0, 2, n + 1, dtype=np.float32)
    faces = np.stack([ends[:-1], ends[1:]], axis=1)
    return slabs_vdi(camera, faces, optical_depth, window=window, bounds=BOUNDS, depth_origin=9.0)


@pytest.mark.parametrize("optical_depth", [2e-8, 1e-6, 2e-4])
@pytest.mark.parametrize("n", [4096, pytest.param(100_000, marks=pytest.mark.slow)])
def test_thousands_of_nearly_transparent_supersegments(runtime, worst, n, optical_depth):
    """Up to 8192, what is faint keeps its digits; beyond, sums are as exact as one addition.

    Each crossing's optical depth has some 10 roundings of its own, which change it by less than
    the opacity is large.
    """
    vdi = crowded(n, optical_depth)
    exact = reference.render(vdi, EYE)[0, 0]
    # Nothing is left out behind what is nearly opaque: of the last, a millionth would be
    image = render_vdi(vdi, EYE, device=runtime, transmittance_cutoff=0)[0, 0]
    error = np.abs(image - exact).max()
    worst(f"{n} supersegments", error)
    # An addition to an opacity A rounds by A 2^-24, and so do transmittance and what it weights
    assert error <= (14 + (2 * n * exact[3] if n <= VERY_MANY_MEDIA else 0)) * 2.0**-24
    assert error <= 2e-6


@pytest.mark.parametrize("border", [MANY_MEDIA, VERY_MANY_MEDIA])
def test_sums_at_the_border_of_their_choice(runtime, worst, border):
    """As many media as are summed up one way, and one more: both are within their bounds."""
    n = border - 2  # and a window of 1 x 1
    for optical_depth in (2e-8, 1e-6, 1e-4):
        errors = []
        for count in (n, n + 1):
            vdi = crowded(count, optical_depth)
            exact = reference.render(vdi, EYE)[0, 0]
            image = render_vdi(vdi, EYE, device=runtime)[0, 0]
            errors.append(np.abs(image - exact).max())
        worst(f"{n} supersegments", errors[0])
        worst(f"{n + 1} supersegments", errors[1])
        assert max(errors) <= BOUND
        # Half a unit in the last place of 1 per supersegment; and what a crossing is rounded by
        assert border != MANY_MEDIA or errors[0] <= (n + 14) * 2.0**-25
        assert errors[1] <= (14 + (2 * n * exact[3] if border == MANY_MEDIA else 0)) * 2.0**-24


@pytest.mark.parametrize("lists", [960, 2048, 8192])
def test_rays_across_thousands_of_lists(runtime, worst, lists):
    """A faint medium seen from the side: as many crossings as the window is wide."""
    camera = EYE.replace(parallel_projection=True, parallel_scale=3 / lists)
    vdi = slabs_vdi(camera, [[0.0, 2.0]], 2e-4, window=(lists, 3), bounds=BOUNDS, depth_origin=9.0)
    beside = Camera(
        (10, 0, 0), (0, 0, 0), (0, 1, 0), parallel_projection=True, parallel_scale=1 / lists
    )
    image = render_vdi(vdi, beside, (1, 1), device=runtime)
    # Two model units of a medium whose optical depth is 2e-4 in two units
    exact = -np.expm1(-2e-4) * np.array([0.2, 0.5, 0.8, 1.0])
    error = np.abs(image[0, 0] - exact).max()
    worst(f"{lists} lists", error)
    assert error <= (lists + 14) * 2.0**-25 if lists < MANY_MEDIA else 20 * 2.0**-24


def test_several_vdis_of_nearly_transparent_supersegments(runtime, worst):
    """Their segments are merged and summed up in another kernel."""
    vdis = [crowded(3000, 2e-8), crowded(2999, 2e-8)]
    image = render_vdis(vdis, EYE, (1, 1), device=runtime)[0, 0]
    exact = -np.expm1(-5999 * np.float64(np.float32(2e-8))) * np.array([0.2, 0.5, 0.8, 1.0])
    # A piece of one may be as short as a rounding of its ends, and its share of tau is as uncertain
    assert_within(worst, "5999 supersegments", image, exact, 2e-6)


@pytest.mark.parametrize(
    ("opacity", "steps"),
    [(0.01, 10_000), pytest.param(0.9, MOST_STEPS, marks=pytest.mark.slow)],
)
def test_very_many_steps_through_a_constant_volume(runtime, worst, steps, opacity):
    """Closed form: the opacity of a slab is what the table says, however it is cut."""
    volume = Volume(np.full((3, 3, 3), 0.5, np.float32))
    camera = Camera((1, 1, 10), (1, 1, 1), (0, 1, 0), view_angle=5)
    color = np.float32(0.7)
    function = TransferFunction(
        [[color] * 3] * 2, [opacity] * 2, (0, 1), unit_distance=2.0, interpolation="linear"
    )
    step = max(2.0 / steps, volume.length / MOST_STEPS)
    exact = float(np.float32(opacity)) * np.array([color, color, color, 1.0])
    image = raycast_volume(volume, camera, (1, 1), function, sample_distance=step, device=runtime)
    assert_within(worst, "volume", image, exact)
    vdi = generate_vdi(volume, camera, (1, 1), function, sample_distance=step, device=runtime)
    assert_within(worst, "VDI", composite(vdi.color, vdi.optical_depth), exact)
