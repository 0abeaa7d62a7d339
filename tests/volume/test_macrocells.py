"""opencl/grid: what is known of a volume before it is marched."""

from __future__ import annotations

import numpy as np
import pytest
from drawing import raycast_volume
from scipy.ndimage import distance_transform_cdt
from strategies import camera_around

from pyvista_vdi import TransferFunction, Volume
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.kernels import MACROCELL_DISTANCES
from pyvista_vdi.volume.rays import Variant

MOST = 16


@pytest.mark.parametrize("share", [0.0, 0.001, 0.05, 0.9])
def test_distances_of_blocks_are_chessboard_distances(runtime, share):
    rng = np.random.default_rng(7)
    shape = (23, 9, 40)
    visible = rng.random(shape) < share
    launch = runtime.bind(MACROCELL_DISTANCES, Variant().defines, most=MOST)
    found = np.where(visible, 0, MOST).astype(np.uint8)
    n, apart = found.size, 1
    for along in reversed(shape):
        with runtime.upload(found) as before, runtime.buffer(shape, np.uint8) as after:
            launch.set(before=before, distances=after)
            launch(-(-n // 64) * 64, 64, macrocells=n, apart=apart, along=along)
            found = runtime.download(after)
        apart *= along
    if visible.any():
        expected = np.minimum(distance_transform_cdt(~visible, metric="chessboard"), MOST)
    else:
        expected = np.full(shape, MOST)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(
    ("dtype", "low", "high", "looked_up"),
    [
        ("uint8", 0, 255, True),
        ("int8", -128, 127, True),
        ("uint16", 60000, 64095, True),
        ("int16", -1500, 2500, True),
        ("int16", -1500, 2597, False),  # more scalars than are looked up
    ],
)
def test_integers_look_as_the_same_numbers_in_float32(runtime, dtype, low, high, looked_up):
    """Floats are classified at each sample; what integers look like is known before."""
    rng = np.random.default_rng(5)
    array = rng.integers(low, high, (20, 24, 28), endpoint=True).astype(dtype)
    array.flat[:2] = low, high
    table = rng.random((37, 4))
    table[5:9, 3] = 0
    table[20, 3] = 1
    # The table ends within the scalars, so that both of its ends are extended
    span = high - low
    looks = TransferFunction(
        table[:, :3], table[:, 3] * 0.3, (low + 0.1 * span, high - 0.2 * span), unit_distance=2.0
    )
    camera = camera_around(rng, Volume(array).bounds, np.eye(4))
    medium = DeviceVolume(runtime, Volume(array), looks)
    assert medium.variant.by_scalar == looked_up
    integers, floats = (
        raycast_volume(Volume(values), camera, (40, 30), looks, device=runtime)
        for values in (array, array.astype(np.float32))
    )
    np.testing.assert_array_equal(integers, floats)
