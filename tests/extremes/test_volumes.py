"""Volumes: the smallest, the largest, every voxel type's extremes, scalars far from zero."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import reference
from drawing import generate_vdi, raycast_volume, render_vdi
from extreme_scenes import BOUND, WINDOW, assert_within, check_views, transfer, view

from pyvista_vdi import Camera, DeviceMemoryError, TransferFunction, Volume

pytestmark = pytest.mark.extremes


@pytest.mark.slow
@pytest.mark.parametrize("planes", [2**11 + 8, 2**12 + 8], ids=["over 2^31", "over 2^32"])
@pytest.mark.parametrize("interpolation", ["nearest", "linear"])
def test_very_many_voxels(runtime, worst, planes, interpolation):
    """Addresses beyond 31 and 32 bits: what is there must be seen, and nothing else."""
    array = np.zeros((planes, 1024, 1024), np.uint8)
    array[-2:, 400:600, 400:600] = 200
    volume = Volume(array)
    function = TransferFunction(
        [[0.2, 0.5, 0.8]] * 2, [0, 0.6], (0, 200), unit_distance=2.0, interpolation=interpolation
    )
    centre = np.array([500.3, 500.2, planes - 1.5])
    camera = Camera(centre + np.array([900, 700, 3000]), centre, (0, 1, 0), view_angle=4)
    try:
        image = raycast_volume(volume, camera, WINDOW, function, device=runtime)
    except DeviceMemoryError as error:
        pytest.skip(str(error))
    # The same corner alone, with the planes before it left out
    start = planes - 8
    part = Volume(volume.array[start:], origin=(0, 0, start))
    exact = reference.volume_image(part, camera, WINDOW, function)
    assert exact[..., 3].max() > 0.3
    # A grid coordinate is rounded by half a unit in its last place, 2^-24 of `planes` of a voxel,
    # and in one voxel the opacity changes by up to a half
    bound = max(BOUND, 2.0**-24 * planes / 2)
    assert_within(worst, f"{planes} planes", image, exact, bound)
    vdi = generate_vdi(volume, camera, WINDOW, function, device=runtime)
    check_views(runtime, worst, vdi, [camera, camera.azimuth(3)])
    # Two voxels of medium up to 4096 from where depths are counted
    seen = render_vdi(vdi, camera, device=runtime)
    assert_within(worst, f"{planes} planes, VDI at V_O", seen, image)


@pytest.mark.parametrize("axis", range(3), ids="xyz")
def test_an_axis_longer_than_a_3d_texture_s(runtime, worst, axis):
    """The end of 20000 voxels along an axis, where many drivers' textures have 2048."""
    n, size = 20000, [4, 4, 4]
    size[2 - axis] = n
    array = np.moveaxis(np.zeros(size, np.float32), 2 - axis, 0)
    array[-6:] = np.random.default_rng(axis).integers(50, 200, array[-6:].shape)
    volume = Volume(np.ascontiguousarray(np.moveaxis(array, 0, 2 - axis)))
    start = [0, 0, 0]
    start[axis] = n - 8
    part = Volume(volume.array[start[2] :, start[1] :, start[0] :].copy(), origin=start)
    function = TransferFunction(
        [[0.2, 0.5, 0.8]] * 2, [0, 0.3], (0, 200), unit_distance=2.0, interpolation="linear"
    )
    centre = np.add(start, [1.5 + 3 * (a == axis) for a in range(3)])
    camera = Camera(centre + np.array([14.0, 9, 11]), centre, (0.1, 0.2, 1))
    exact = reference.volume_image(part, camera, WINDOW, function)
    assert exact[..., 3].max() > 0.3
    image = raycast_volume(volume, camera, WINDOW, function, device=runtime)
    # As above: a coordinate is rounded by 2^-24 of n, and a channel changes by half in a voxel
    bound = max(BOUND, 2.0**-24 * n)
    assert_within(worst, f"{n} along {'xyz'[axis]}", image, exact, bound)
    vdi = generate_vdi(volume, camera, WINDOW, function, device=runtime)
    assert_within(worst, f"{n}, VDI", render_vdi(vdi, camera, device=runtime), image)


def test_what_one_allocation_does_not_hold_goes_brick_by_brick(runtime, monkeypatch):
    rng = np.random.default_rng(5)
    volume = Volume(255 * rng.random((96, 96, 300), np.float32))
    camera, function = view(volume), transfer(0, 255)
    image = raycast_volume(volume, camera, WINDOW, function, device=runtime)
    vdi = generate_vdi(volume, camera, WINDOW, function, device=runtime)
    same = Volume(volume.array)  # nothing of it is on the device
    monkeypatch.setattr(runtime, "info", replace(runtime.info, max_allocation=2**21))
    assert volume.array.nbytes > 2**21
    assert np.array_equal(raycast_volume(same, camera, WINDOW, function, device=runtime), image)
    assert generate_vdi(same, camera, WINDOW, function, device=runtime).equals(vdi)
