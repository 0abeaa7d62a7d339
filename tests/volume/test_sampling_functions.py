"""opencl/volume/sampling.cl against float64."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

EPS = 2.0**-24  # unit roundoff of float32
FILE = "sampling_functions.cl"
TYPES = {
    "uint8": "uchar",
    "int8": "char",
    "uint16": "ushort",
    "int16": "short",
    "float32": "float",
}


def sampled(call, array, positions, nearest=False, index="uint"):
    positions = np.asarray(positions, np.float32)
    size = np.array([*array.shape[::-1], 0], np.int32)
    defines = {"VOXEL_T": TYPES[array.dtype.name], "INDEX_T": index}
    if nearest:
        defines["NEAREST"] = 1
    n = len(positions)
    return call(
        FILE, "samples", n, np.ascontiguousarray(array), size, positions, call.empty(n),
        by_value=(1,), **defines,
    )  # fmt: skip


def product_grid(shape, dtype):
    """x·y·z at the points of a grid [z, y, x]: trilinear, so that interpolation reproduces it."""
    z, y, x = np.meshgrid(*map(np.arange, shape), indexing="ij")
    return (x * y * z).astype(dtype)


@pytest.mark.parametrize("index", ["uint", "ulong"])
@pytest.mark.parametrize("dtype", TYPES)
def test_linear_reproduces_a_trilinear_function(call, dtype, index):
    array = product_grid((5, 4, 6), dtype)
    rng = np.random.default_rng(21)
    # Multiples of 1/8: differences, products and sums of the interpolation are exact in float32
    positions = rng.integers(0, [41, 25, 33], (2000, 3)) / 8
    found = sampled(call, array, positions, index=index)
    np.testing.assert_array_equal(found, positions.prod(axis=1))


@pytest.mark.parametrize("dtype", TYPES)
def test_linear_on_random_voxels(call, dtype):
    rng = np.random.default_rng(22)
    shape = (7, 5, 2)
    if dtype == "float32":
        array = (rng.normal(size=shape) * 1e3).astype(dtype)
    else:
        info = np.iinfo(dtype)
        array = rng.integers(info.min, info.max, shape, dtype=dtype, endpoint=True)
    positions = (rng.random((3000, 3)) * [1, 4, 6]).astype(np.float32)
    found = sampled(call, array, positions)
    # Three levels of x + (y - x) a, each rounding a difference of up to twice the largest
    # magnitude, a product and a sum: 5 EPS of it per level
    bound = 15 * EPS * np.abs(array.astype(np.float64)).max()
    exact = RegularGridInterpolator([np.arange(n) for n in shape], array.astype(np.float64))
    assert np.abs(found - exact(positions[:, ::-1].astype(np.float64))).max() <= bound


@pytest.mark.parametrize("nearest", [False, True])
@pytest.mark.parametrize("dtype", TYPES)
def test_points_faces_and_a_hair_outside(call, dtype, nearest):
    """At each point its own value, the far faces included; beyond a face the face's value."""
    rng = np.random.default_rng(23)
    array = rng.integers(0, 100, (3, 4, 5)).astype(dtype)
    z, y, x = (i.ravel() for i in np.meshgrid(*map(np.arange, array.shape), indexing="ij"))
    points = np.column_stack([x, y, z]).astype(np.float32)
    np.testing.assert_array_equal(sampled(call, array, points, nearest), array.ravel())

    top = np.float32(array.shape[::-1]) - 1
    for axis in range(3):
        for face, beyond in ((0, -np.inf), (top[axis], np.inf)):
            on = points[points[:, axis] == face]
            for distance in (np.nextafter(np.float32(face), np.float32(beyond)) - face, 0.4):
                outside = on.copy()
                outside[:, axis] += np.copysign(distance, beyond)
                np.testing.assert_array_equal(
                    sampled(call, array, outside, nearest), sampled(call, array, on, nearest)
                )


@pytest.mark.parametrize("index", ["uint", "ulong"])
@pytest.mark.parametrize("dtype", TYPES)
def test_nearest_takes_the_nearest_point(call, dtype, index):
    rng = np.random.default_rng(24)
    shape = (6, 3, 4)
    array = rng.permutation(72).reshape(shape).astype(dtype)
    positions = rng.random((3000, 3)) * [3, 2, 5]
    positions = positions[(np.abs(positions % 1 - 0.5) > 1e-5).all(axis=1)].astype(np.float32)
    x, y, z = np.rint(positions).astype(int).T
    found = sampled(call, array, positions, nearest=True, index=index)
    np.testing.assert_array_equal(found, array[z, y, x])


def test_half_way_belongs_to_the_higher_point(call):
    array = np.arange(27, dtype=np.uint8).reshape(3, 3, 3)
    found = sampled(call, array, [[0.5, 0, 0], [1.5, 0, 0], [0, 1.5, 0.5]], nearest=True)
    np.testing.assert_array_equal(found, [1, 2, array[1, 2, 0]])
