"""What picks refuse, and the value that a pick of a deferred VDI says."""

from __future__ import annotations

import numpy as np
import pytest
from extreme_scenes import slabs_vdi
from strategies import kept_values

import pyvista_vdi as pvdi
from pyvista_vdi import InvalidArgumentError

#: The bounds of the slabs below, and the planes of their faces.
BOUNDS = (-1.0, 1.0, -1.0, 1.0, -1.0, 1.0)
THIN = (-0.75, -0.5)  # z of the haze; float32 holds all of these depths
SOLID = (0.25, 0.75)


#: A parallel view along z, from below, of which +x lies on the left.
FACING = pvdi.Camera((0, 0, -5), (0, 0, 0), (0, 1, 0), parallel_projection=True, parallel_scale=1.0)


def slabs(thin=0.02, solid=30.0, edge=8, camera=FACING):
    """Two slabs across the cube, a haze and something solid."""
    return slabs_vdi(
        camera,
        np.add([THIN, SOLID], 5),
        [thin, solid],
        window=(edge, edge),
        bounds=BOUNDS,
        color=[[1, 0.5, 0], [0, 0.5, 1]],
    )


@pytest.mark.parametrize(
    ("pixel", "options", "message"),
    [
        ((0, 0), {"opacity_threshold": 1}, "opacity_threshold must be .* from 0 to below 1"),
        ((8, 0), {}, "pixel must be .* inside the window of 8 x 8"),
        ((1, 2, 3), {}, "pixel must be .* inside the window of 8 x 8"),
        ((0, 0), {"opaque_depth": [1.0, 2.0]}, "opaque_depth must be a view depth"),
        ((0, 0), {"clipping_planes": [[1, 2]]}, "clipping_planes"),
    ],
)
def test_impossible_arguments_are_refused_by_name(pixel, options, message):
    with pytest.raises(InvalidArgumentError, match=message):
        pvdi.pick(slabs(), FACING, pixel, **options)


def test_a_deferred_vdi_says_the_value_that_is_hit():
    slabs_of_values = slabs()
    n = slabs_of_values.n_supersegments
    rng = np.random.default_rng(3)
    values = rng.uniform(0, 1, n), np.zeros(n), np.ones(n)
    kept = kept_values(slabs_of_values, *values, unit_distance=1.0, sample_distance=0.01)
    # What is below 200 is transparent, and left out: the lists that are shown have other numbers
    look = pvdi.TransferFunction([[1, 1, 1]] * 3, [0, 0, 1], (100, 300))
    values, (low, high) = set(), kept.value_range
    for x, y in np.ndindex(8, 8):
        hit = pvdi.pick(kept, FACING, (x, y), opacity_threshold=0, transfer_function=look)
        opaque = low + (high - low) * kept.mean[kept.lists.list_at(x, y)].astype(np.float64)
        opaque = opaque[opaque > 200]  # nearest to the eye first
        assert (hit is None) == (len(opaque) == 0)
        if hit is not None:
            assert hit.value == pytest.approx(opaque[0])
            values.add(hit.value)
            seen = (x, y)
    assert len(values) > 8
    assert pvdi.pick(kept.classified(transfer_function=look), FACING, seen).value is None
