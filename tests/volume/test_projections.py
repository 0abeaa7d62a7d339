"""Projections of a volume by ``render_volume(blending=)``: NumPy's, and VTK's pictures."""

from __future__ import annotations

import numpy as np
import pytest
from settings import with_settings

import pyvista_vdi as pvdi
from pyvista_vdi import Camera, TransferFunction, Volume

BLENDINGS = ("maximum", "minimum", "average", "additive")

#: float32 against float64, of values to 1 added over few steps.
TOLERANCE = 1e-5

NX, NY, NZ = 6, 5, 7
#: Opacity unit distances per unit of length: a ray through all slices stays below white.
UNIT = 9.0


def random_volume(seed, dtype=np.float64):
    """Values that no table's entry is, the scalars' range apart from the table's."""
    values = np.random.default_rng(seed).uniform(-40, 160, (NZ, NY, NX))
    return Volume(values.astype(dtype))


def from_above():
    """A parallel view along -z whose pixels are the volume's points."""
    centre = ((NX - 1) / 2, (NY - 1) / 2, 0)
    return Camera(
        (*centre[:2], 20.0), centre, (0, 1, 0), parallel_scale=NY / 2, parallel_projection=True
    )


def table(interpolation="nearest"):
    ramp = np.linspace(0, 1, 11)
    colors = np.stack([ramp, 1 - ramp, ramp**2], axis=1)
    return TransferFunction(
        colors, 0.1 + 0.8 * ramp, (0, 100), interpolation=interpolation, unit_distance=UNIT
    )


def classified(scalar):
    at = np.clip(np.asarray(scalar, float), 0, 100) / 10
    of = table()
    rgba = np.column_stack([of.colors, of.opacities]).astype(float)
    return np.stack([np.interp(at, np.arange(11), channel) for channel in rgba.T], axis=-1)


def expected(columns, weights, blending, ends):
    """What VTK's blend modes make of scalars (..., n) with so much length around each."""
    if blending in ("maximum", "minimum"):
        rgba = classified(getattr(np, f"nan{blending[:3]}")(columns, axis=-1))
        return np.concatenate([rgba[..., :3] * rgba[..., 3:], rgba[..., 3:]], axis=-1)
    low, high = ends
    values = classified(columns)[..., 3] * (columns - low) / (high - low)
    total = np.nansum(values * weights, axis=-1)
    if blending == "average":
        total /= np.sum(np.where(np.isnan(columns), 0, weights), axis=-1)
    else:
        total /= UNIT
    grey = np.clip(total, 0, 1)
    return np.stack([grey, grey, grey, np.ones_like(grey)], axis=-1)


def shown(volume, blending, device, **options):
    """By four steps a slice, of the table above."""
    options = {"transfer_function": table(), "sample_distance": 0.25, **options}
    return pvdi.render_volume(
        volume, from_above(), (NX, NY), blending=blending, device=device, **with_settings(**options)
    )


def image_of(columns, weights, blending, volume):
    """The picture of scalars [z, y, x]: top row first."""
    at = np.moveaxis(columns.astype(float), 0, -1)
    return expected(at, weights, blending, volume.finite_range())[::-1]


#: Around the first and the last slice half a voxel is inside.
ENDS_HALVED = np.array([0.5, *[1.0] * (NZ - 2), 0.5])


@pytest.mark.parametrize("blending", BLENDINGS)
def test_columns_of_voxels_are_numpy_s(runtime, blending):
    """NaN has no part."""
    volume = random_volume(1, np.float32)
    volume.array[2:4, 1, :] = np.nan
    want = image_of(volume.array, ENDS_HALVED, blending, volume)
    got = shown(volume, blending, runtime)
    np.testing.assert_allclose(got, want, atol=TOLERANCE)
    assert np.ptp(got[..., :3]) > 0.1


#: Slices 2 to 4 are left, 0 to 4 where rays end; cuts lie between points.
CUT = (-1.0, NX + 1.0, -1.0, NY + 1.0, 1.5, 4.5)
WAYS = {
    "cropping": (slice(2, 5), {"cropping": pvdi.Cropping(CUT)}),
    # The middle along z is kept, and what is below: no box
    "regions": (slice(0, 5), {"cropping": pvdi.Cropping(CUT, 1 << 4 | 1 << 13 | 1)}),
    "planes": (slice(2, 5), {"clipping_planes": [[0, 0, 1.5, 0, 0, 1], [0, 0, 4.5, 0, 0, -1]]}),
    "depth": (slice(2, NZ), {"opaque_depth": np.full((NY, NX), 20 - 1.5, np.float32)}),
}


@pytest.mark.parametrize(("blending", "way"), [*zip(BLENDINGS, WAYS, strict=True)])
def test_what_is_cut_off_has_no_part(runtime, blending, way):
    volume = random_volume(3, np.float32)
    left, options = WAYS[way]
    weights = np.array([0.5, *[1.0] * (NZ - 2), 0.5])[left]
    want = image_of(volume.array[left], weights, blending, volume)
    np.testing.assert_allclose(shown(volume, blending, runtime, **options), want, atol=TOLERANCE)
