"""opencl/lib/rays.cl: clipping, and how pixels are dealt to work-items."""

from __future__ import annotations

import numpy as np
import pytest

from pyvista_vdi.device.constants import block_items

EPS = 2.0**-24  # unit roundoff of float32
FILE = "ray_functions.cl"


def random_offsets(rng, n):
    """Pixel offsets as the kernels form them: multiples of one half, exact in float32."""
    return (rng.integers(-4000, 4000, (n, 2)) / 2).astype(np.float32)


def clip_reference(forms, offsets, intervals):
    """An interval cut by half lines in float64, and how far float32 may move its ends."""
    n, planes = forms.shape[:2]
    pixel = np.column_stack([np.ones(n), offsets.astype(np.float64)])
    terms = forms.astype(np.float64).reshape(n, planes, 2, 3)
    value, slope = np.moveaxis(np.einsum("npkc,nc->npk", terms, pixel), 2, 0)
    # Two fused operations, each rounded once, of numbers no larger than the sum of magnitudes
    of_value, of_slope = (
        2 * EPS * np.moveaxis(np.einsum("npkc,nc->npk", np.abs(terms), np.abs(pixel)), 2, 0)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        root = -value / slope
        error = (of_value + np.abs(root) * of_slope) / np.abs(slope) + EPS * np.abs(root)
    error[slope == 0] = 0
    low = np.where(slope > 0, root, -np.inf).max(axis=1)
    high = np.where(slope < 0, root, np.inf).min(axis=1)
    high[((slope == 0) & (value < 0)).any(axis=1)] = -np.inf
    low, high = np.maximum(low, intervals[:, 0]), np.minimum(high, intervals[:, 1])
    return low, high, 2 * error.max(axis=1)


@pytest.mark.parametrize("planes", [1, 6])
def test_clip_to_planes(call, planes):
    rng = np.random.default_rng(planes)
    n = 2048
    forms = rng.normal(size=(n, planes, 6))
    forms[..., 0] += rng.choice([0.0, 4.0], size=(n, 1), p=[0.2, 0.8])  # most rays begin inside
    forms[..., [1, 2, 4, 5]] *= 1e-3
    parallel = rng.random((n, planes)) < 0.1
    forms[parallel, 3:] = 0
    forms = forms.astype(np.float32)
    offsets = random_offsets(rng, n) / np.float32(128)
    intervals = np.sort(rng.normal(size=(n, 2)) * 10, axis=1).astype(np.float32)
    intervals[rng.random(n) < 0.3] = [-np.inf, np.inf]

    found, left = call(
        FILE, "clipped", n, np.pad(forms, ((0, 0), (0, 0), (0, 6))), np.int32(planes),
        offsets, call.out(intervals),
        call.empty(n, dtype=np.int32),
    )  # fmt: skip
    low, high, error = clip_reference(forms, offsets, intervals)
    assert set(left.tolist()) == {0, 1}
    # Where it does not hang on the last digits whether anything is left
    clear = (high > low + error) | (high < low - error)
    assert clear.mean() > 0.99
    np.testing.assert_array_equal(left[clear] == 1, (low < high)[clear])
    kept = clear & (low < high)
    assert kept.sum() > 100
    for ends, exact in zip(found[kept].T.astype(np.float64), (low[kept], high[kept]), strict=True):
        finite = np.isfinite(exact)
        np.testing.assert_array_equal(ends[~finite], exact[~finite])
        assert (np.abs(ends[finite] - exact[finite]) <= error[kept][finite]).all()


def drawn(call, kernel, items, *arguments):
    return call(FILE, kernel, items, *arguments, call.empty(items, 2, dtype=np.int32))


@pytest.mark.parametrize("width", [1, 7, 33])
def test_every_pixel_has_one_work_item(call, width):
    for height in (1, 4, 9):
        items = block_items(width, height)
        pixels = drawn(call, "block_pixels", items, np.int32(width), np.uint32(0))
        assert (pixels >= 0).all()
        assert len(np.unique(pixels, axis=0)) == items  # no pixel twice, outside ones included
        inside = (pixels[:, 0] < width) & (pixels[:, 1] < height)
        assert inside.sum() == width * height
