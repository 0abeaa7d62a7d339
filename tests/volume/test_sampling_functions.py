"""opencl/volume/sampling.cl against float64."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from pyvista_vdi.volume.rays import Variant

EPS = 2.0**-24  # unit roundoff of float32
FILE = "sampling_functions.cl"
TYPES = {"uint8": "uchar", "int8": "char", "uint16": "ushort", "int16": "short", "float32": "float"}
#: Types of which others differ in a number, and both kinds of indices.
KINDS = [("int8", "uint"), ("uint16", "ulong"), ("float32", "uint")]


def sampled(call, array, positions, nearest=False, index="uint"):
    positions = np.asarray(positions, np.float32)
    size = np.array([*array.shape[::-1], 0], np.int32)
    defines = Variant(TYPES[array.dtype.name], index).defines
    n = len(positions)
    return call(
        FILE, "samples", n, np.ascontiguousarray(array), size, positions, int(nearest),
        call.empty(n), by_value=(1,), **defines,
    )  # fmt: skip


def check_points_faces_and_a_hair_outside(call, dtype, nearest, index):
    """At each point its own value, the far faces included; beyond a face the face's value."""
    rng = np.random.default_rng(23)
    array = rng.integers(0, 100, (3, 4, 5)).astype(dtype)
    z, y, x = (i.ravel() for i in np.meshgrid(*map(np.arange, array.shape), indexing="ij"))
    points = np.column_stack([x, y, z]).astype(np.float32)
    at_points = sampled(call, array, points, nearest, index)
    np.testing.assert_array_equal(at_points, array.ravel())
    top = np.float32(array.shape[::-1]) - 1
    for axis in range(3):
        for face, beyond in ((0, -np.inf), (top[axis], np.inf)):
            on = points[:, axis] == face
            for distance in (np.nextafter(np.float32(face), np.float32(beyond)) - face, 0.4):
                outside = points[on].copy()
                outside[:, axis] += np.copysign(distance, beyond)
                found = sampled(call, array, outside, nearest, index)
                np.testing.assert_array_equal(found, at_points[on])


@pytest.mark.parametrize(("dtype", "index"), KINDS)
def test_linear(call, dtype, index):
    rng = np.random.default_rng(21)
    # x y z is trilinear, so that interpolation reproduces it
    z, y, x = np.meshgrid(*map(np.arange, (5, 4, 6)), indexing="ij")
    # Multiples of 1/8: differences, products and sums of the interpolation are exact in float32
    positions = rng.integers(0, [41, 25, 33], (2000, 3)) / 8
    found = sampled(call, (x * y * z).astype(dtype), positions, index=index)
    np.testing.assert_array_equal(found, positions.prod(axis=1))

    shape = (7, 5, 2)
    if dtype == "float32":
        array = (rng.normal(size=shape) * 1e3).astype(dtype)
    else:
        info = np.iinfo(dtype)
        array = rng.integers(info.min, info.max, shape, dtype=dtype, endpoint=True)
    positions = (rng.random((3000, 3)) * [1, 4, 6]).astype(np.float32)
    found = sampled(call, array, positions, index=index)
    # Three levels of x + (y - x) a, each rounding a difference of up to twice the largest
    # magnitude, a product and a sum: 5 EPS of it per level
    bound = 15 * EPS * np.abs(array.astype(np.float64)).max()
    exact = RegularGridInterpolator([np.arange(n) for n in shape], array.astype(np.float64))
    assert np.abs(found - exact(positions[:, ::-1].astype(np.float64))).max() <= bound
    check_points_faces_and_a_hair_outside(call, dtype, False, index)


@pytest.mark.parametrize(("dtype", "index"), KINDS)
def test_nearest(call, dtype, index):
    rng = np.random.default_rng(24)
    array = rng.permutation(72).reshape(6, 3, 4).astype(dtype)
    positions = rng.random((3000, 3)) * [3, 2, 5]
    positions = positions[(np.abs(positions % 1 - 0.5) > 1e-5).all(axis=1)].astype(np.float32)
    x, y, z = np.rint(positions).astype(int).T
    found = sampled(call, array, positions, nearest=True, index=index)
    np.testing.assert_array_equal(found, array[z, y, x])
    check_points_faces_and_a_hair_outside(call, dtype, True, index)
    # Half way belongs to the higher point
    half = [[0.5, 0, 0], [1.5, 0, 0], [0, 1.5, 0.5]]
    found = sampled(call, array, half, nearest=True, index=index)
    np.testing.assert_array_equal(found, [array[0, 0, 1], array[0, 0, 2], array[1, 2, 0]])
