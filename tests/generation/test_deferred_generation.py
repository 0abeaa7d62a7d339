"""Deferred VDIs: what they keep is what NumPy finds along the rays, whatever can be seen of it."""

from __future__ import annotations

import numpy as np
import pytest
from settings import with_settings

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.generation.deferred import generate_deferred
from pyvista_vdi.model.options import Deferral, GenerationOptions, GenerationRequest

EDGES = NX, NY, NZ = 7, 6, 33
#: Lengths of a column's voxels: the first and the last reach half as far into the grid.
LENGTHS = np.array([0.5, *[1.0] * (NZ - 2), 0.5])


def columns(array):
    """A volume, and the parallel view along -z of which each list is a column of it."""
    volume = pvdi.Volume(array)
    middle = ((NX - 1) / 2, (NY - 1) / 2)
    camera = pvdi.Camera(
        (*middle, 90), (*middle, 0), (0, 1, 0), parallel_projection=True, parallel_scale=NY / 2
    )
    return volume, camera


def kept(runtime, array, value_range=None, interpolation="nearest", **options):
    volume, camera = columns(array)
    looks = pvdi.TransferFunction([[0] * 3], [0], (0, 1), interpolation=interpolation)
    request = GenerationRequest(
        volume, looks, camera, (NX, NY), GenerationOptions(**options), runtime
    )
    return generate_deferred(request, Deferral("deferred", value_range))


def inner(deferred):
    """Yield x, y and the rows of the lists whose rays lie within the grid."""
    for y in range(1, NY - 1):
        for x in range(1, NX - 1):
            yield x, y, deferred.lists.list_at(x, y)


@pytest.mark.parametrize("dtype", [np.uint8, np.float64])
def test_one_supersegment_has_the_mean_and_the_spread_of_its_column(runtime, dtype):
    rng = np.random.default_rng(1)
    array = (rng.random(EDGES[::-1]) * 200 + 20).astype(dtype)
    deferred = kept(runtime, array, (10, 230), max_supersegments=1)
    for x, y, rows in inner(deferred):
        values = (array[:, y, x].astype(float) - 10) / 220
        mean = np.average(values, weights=LENGTHS)
        assert rows.stop - rows.start == 1
        assert deferred.mean[rows] == pytest.approx(mean, abs=2e-6)
        spread = np.sqrt(np.average((values - mean) ** 2, weights=LENGTHS))
        assert deferred.spread[rows] == pytest.approx(spread, abs=2e-5)
        assert deferred.share[rows] == 1


def test_what_is_outside_the_range_ends_a_supersegment_and_is_no_part_of_it(runtime):
    array = np.full(EDGES[::-1], 100, np.uint8)
    array[:, :, ::2] = np.random.default_rng(3).choice([100, 30, 220], (NZ, NY, 4))
    inside = (array >= 50) & (array <= 200)
    deferred = kept(runtime, array, (50, 200), max_supersegments=50)
    assert (deferred.spread == 0).all()
    assert 50 + 150 * deferred.mean == pytest.approx(100, abs=1e-3)
    for x, y, rows in inner(deferred):
        length = (deferred.back[rows] - deferred.front[rows]).sum()
        assert length == pytest.approx((inside[:, y, x] * LENGTHS).sum(), abs=1e-3)
    # A list that is too short for its gaps says which share of each length is held
    one = kept(runtime, array, (50, 200), max_supersegments=1)
    for x, y, rows in inner(one):
        length = one.back[rows] - one.front[rows]
        wanted = (inside[:, y, x] * LENGTHS).sum()
        assert (length * one.share[rows]) == pytest.approx(wanted, rel=1e-3)
        assert one.spread[rows] == 0


def test_generate_returns_one_and_bakes_by_default(runtime):
    volume, camera = columns(np.random.default_rng(8).random(EDGES[::-1]).astype(np.float32))
    asked = {"device": runtime, "max_supersegments": 5}
    deferred = pvdi.generate(
        volume, camera, (NX, NY), classification="deferred", value_range=(0.2, 0.8), **asked
    )
    assert isinstance(deferred, pvdi.DeferredVDI)
    assert deferred.value_range == (0.2, 0.8)
    looks = pvdi.TransferFunction([[0, 0, 0], [1, 1, 1]], [0, 0.5], (0, 1))
    baked = [
        pvdi.generate(volume, camera, (NX, NY), transfer_function=looks, **asked, **more)
        for more in ({}, {"classification": "baked"})
    ]
    assert baked[0].equals(baked[1])


@pytest.mark.parametrize(
    ("asked", "error", "says"),
    [
        ({"cmap": "bone"}, InvalidArgumentError, "give cmap to classified"),
        ({"shade": True}, InvalidArgumentError, "shade"),
        ({"ambient_occlusion": True}, UnsupportedError, "ambient_occlusion"),
        ({"quality": "fast"}, UnsupportedError, "give max_supersegments"),
        ({"blending": "maximum"}, UnsupportedError, "blending"),
        ({"value_range": "all"}, InvalidArgumentError, "value_range must be"),
        ({"classification": "later"}, InvalidArgumentError, "'baked' or 'deferred'"),
        (
            {"classification": "baked", "value_range": (0, 1)},
            InvalidArgumentError,
            "classification='deferred' as well",
        ),
    ],
)
def test_what_cannot_be_deferred_is_refused_by_name(runtime, asked, error, says):
    volume, camera = columns(np.random.default_rng(9).random(EDGES[::-1]).astype(np.float32))
    with pytest.raises(error, match=says):
        pvdi.generate(
            *(volume, camera, (NX, NY)),
            device=runtime,
            **{"classification": "deferred", **with_settings(**asked)},
        )
