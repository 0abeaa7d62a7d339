"""Volumes whose lists are known by hand."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from drawing import generate_vdi

from pyvista_vdi import Camera, TransferFunction, Volume


def test_generated_slabs_are_the_slabs(runtime):
    """Planes of points, nearest neighbour: each list's supersegments are the voxels' own layers.

    A step of half a spacing fits the layers, whose outer ones are half as thick. A gap ends a
    supersegment where the medium behind it is the same, too.
    """
    values = np.array([3, 3, 1, 0, 1, 2], dtype=np.uint8)
    volume = Volume(np.broadcast_to(values[:, None, None], (6, 4, 4)).copy())
    opacities = np.array([0.0, 0.2, 0.6, 0.9])
    colors = np.eye(4)[:, :3]
    transfer_function = TransferFunction(colors, opacities, (0, 3), unit_distance=1.0)
    camera = Camera(
        (1.5, 1.5, 9), (1.5, 1.5, 2), (0, 1, 0), parallel_projection=True, parallel_scale=1.4
    )
    vdi = generate_vdi(volume, camera, (3, 3), transfer_function, device=runtime)
    # From z = 5 down: value 2 to 4.5, 1 to 3.5, nothing to 2.5, value 1 to 1.5, value 3 to 0
    front, back = [4, 4.5, 6.5, 7.5], [4.5, 5.5, 7.5, 9]
    sigma = -np.log1p(-opacities[[2, 1, 1, 3]])
    for x, y in itertools.product(range(3), repeat=2):
        part = vdi.list_at(x, y)
        np.testing.assert_allclose(vdi.front[part] + vdi.depth_origin, front, atol=2e-6)
        np.testing.assert_allclose(vdi.back[part] + vdi.depth_origin, back, atol=2e-6)
        np.testing.assert_allclose(
            vdi.optical_depth[part], sigma * np.subtract(back, front), rtol=2e-6
        )
        np.testing.assert_allclose(vdi.color[part], colors[[2, 1, 1, 3]], atol=1e-6)


@pytest.mark.parametrize(("view_cone", "expected"), [(90.0, 3), (0.0, 2)])
def test_what_v_o_hardly_sees_differs_by_as_little(runtime, view_cone, expected):
    """Green and blue behind dense red: unlike by far, but hardly any of their light is seen.

    Half a voxel of blue behind a voxel of green, each of density ln 2 / (ln 2 + 1) = 0.41: the sum
    of squares grows by (1 x 0.5 / 1.5) x 2 x 0.41^2 = 0.11, above the tolerance's 0.1^2. Weighted
    by the transmittance of 1.5 voxels of red, 3e-5, it lies below.
    """
    values = np.array([2, 2, 1, 0, 0], dtype=np.uint8)
    volume = Volume(np.broadcast_to(values[:, None, None], (5, 4, 4)).copy())
    looks = TransferFunction(np.eye(3)[::-1], (0.5, 0.5, 0.999), (0, 2), unit_distance=1.0)
    camera = Camera(
        (1.5, 1.5, 9), (1.5, 1.5, 2), (0, 1, 0), parallel_projection=True, parallel_scale=1.4
    )
    vdi = generate_vdi(
        volume, camera.azimuth(180), (3, 3), looks, tolerance=0.1, view_cone=view_cone,
        device=runtime,
    )  # fmt: skip
    np.testing.assert_array_equal(vdi.counts, expected)
