"""opencl/lib/rays.cl: forms, clipping, and how pixels are dealt to work-items."""

from __future__ import annotations

import numpy as np
import pytest

from pyvista_vdi.device.constants import CELL, CELL_ITEMS, GROUP, block_items, part_columns
from pyvista_vdi.model.ray_forms import Rectangle

EPS = 2.0**-24  # unit roundoff of float32
FILE = "ray_functions.cl"


def random_offsets(rng, n):
    """Pixel offsets as the kernels form them: multiples of one half, exact in float32."""
    return (rng.integers(-4000, 4000, (n, 2)) / 2).astype(np.float32)


def test_form_value_and_slope(call):
    rng = np.random.default_rng(1)
    n = 4096
    forms = (rng.normal(size=(n, 6)) * 10.0 ** rng.uniform(-6, 6, (n, 6))).astype(np.float32)
    offsets = random_offsets(rng, n)
    found = call(FILE, "values_and_slopes", n, forms, offsets, call.empty(n, 2))

    terms = forms.astype(np.float64).reshape(n, 2, 3)
    pixel = np.column_stack([np.ones(n), offsets.astype(np.float64)])
    exact = np.einsum("nkc,nc->nk", terms, pixel)
    # Two fused operations, each rounded once, of numbers no larger than the sum of magnitudes
    bound = 2 * EPS * np.einsum("nkc,nc->nk", np.abs(terms), np.abs(pixel)) * (1 + EPS)
    assert (np.abs(found - exact) <= bound).all()


def clip_reference(forms, offsets, intervals):
    """An interval cut by half lines in float64, and how far float32 may move its ends."""
    n, planes = forms.shape[:2]
    pixel = np.column_stack([np.ones(n), offsets.astype(np.float64)])
    terms = forms.astype(np.float64).reshape(n, planes, 2, 3)
    value, slope = np.moveaxis(np.einsum("npkc,nc->npk", terms, pixel), 2, 0)
    # Two fused operations each: see test_form_value_and_slope
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


@pytest.mark.parametrize("planes", [1, 2, 6, 17])
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
        FILE, "clipped", n, forms, np.int32(planes), offsets, call.out(intervals),
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


@pytest.mark.parametrize(
    ("planes", "interval", "expected"),
    [
        ([], (0, 1), (0, 1)),
        ([], (1, 0), None),
        ([], (2, 2), None),  # no length
        ([(1, 0, 0, 0, 0, 0)], (0, 5), (0, 5)),  # parallel, inside
        ([(0, 0, 0, 0, 0, 0)], (0, 5), (0, 5)),  # parallel, in the plane: kept
        ([(-1, 0, 0, 0, 0, 0)], (0, 5), None),  # parallel, outside
        ([(-1, 0, 0, 0, 0, 0)], (-np.inf, np.inf), None),
        ([(-2, 0, 0, 1, 0, 0)], (-np.inf, np.inf), (2, np.inf)),
        ([(3, 0, 0, -1, 0, 0)], (-np.inf, np.inf), (-np.inf, 3)),
        ([(-2, 0, 0, 1, 0, 0), (3, 0, 0, -1, 0, 0)], (-np.inf, np.inf), (2, 3)),
        ([(-3, 0, 0, 1, 0, 0), (2, 0, 0, -1, 0, 0)], (-np.inf, np.inf), None),
        ([(-2, 0, 0, 1, 0, 0), (2, 0, 0, -1, 0, 0)], (-np.inf, np.inf), None),  # a point
        # The outside parallel plane empties whatever follows it
        ([(-1, 0, 0, 0, 0, 0), (-2, 0, 0, 1, 0, 0)], (-np.inf, np.inf), None),
        # Values and slopes that cancel in a and b: parallel although no coefficient is zero
        ([(1, -2, 0, 2, -4, 0)], (0, 5), (0, 5)),
        ([(1, -4, 0, 2, -4, 0)], (0, 5), None),
    ],
)
def test_clip_by_hand(call, planes, interval, expected):
    forms = np.reshape(np.asarray(planes or [(0,) * 6], np.float32), (1, -1, 6))
    found, left = call(
        FILE, "clipped", 1, forms, np.int32(len(planes)), np.float32([[0.5, 0.0]]),
        call.out(np.float32([interval])), call.empty(1, dtype=np.int32),
    )  # fmt: skip
    assert bool(left[0]) == (expected is not None)
    if expected is not None:
        np.testing.assert_array_equal(found[0], np.float32(expected))


def drawn(call, kernel, items, *arguments):
    return call(FILE, kernel, items, *arguments, call.empty(items, 2, dtype=np.int32))


@pytest.mark.parametrize("width", [1, 2, 3, 4, 5, 7, 8, 15, 16, 17, 33, 100])
def test_every_pixel_has_one_work_item(call, width):
    for height in (1, 2, 3, 4, 5, 9, 31):
        items = block_items(width, height)
        pixels = drawn(call, "block_pixels", items, np.int32(width), np.uint32(0))
        assert (pixels >= 0).all()
        assert len(np.unique(pixels, axis=0)) == items  # no pixel twice, outside ones included
        inside = (pixels[:, 0] < width) & (pixels[:, 1] < height)
        assert inside.sum() == width * height


def test_blocks_are_four_by_four(call):
    blocks = drawn(call, "block_pixels", 64, np.int32(9), np.uint32(0)).reshape(4, 16, 2)
    for block, corner in zip(blocks, [(0, 0), (4, 0), (8, 0), (0, 4)], strict=True):
        assert {tuple(p) for p in block - corner} == {(x, y) for x in range(4) for y in range(4)}


def test_pixels_of_cells(call):
    cells = np.int32([[3, 0], [0, 2], [7, 5]])
    pixels = drawn(call, "cell_pixels", len(cells) * CELL_ITEMS, cells)
    assert len(np.unique(pixels, axis=0)) == len(pixels)  # no pixel twice
    np.testing.assert_array_equal(pixels // CELL, np.repeat(cells, CELL_ITEMS, axis=0))


@pytest.mark.parametrize(
    "part", [(0, 33, 0, 47), (5, 6, 17, 18), (4, 12, 16, 32), (3, 9, 15, 33), (31, 33, 0, 47)]
)
def test_every_pixel_of_a_part_has_one_work_item(call, part):
    part = Rectangle(*part)
    columns = part_columns(part)
    items = GROUP * int(columns[2] * columns[3])
    pixels = drawn(call, "part_pixels", items, columns)
    assert len(np.unique(pixels, axis=0)) == items  # no pixel twice
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    # Whole columns of strips, 4 x 16 pixels, and no more of them than hold the part
    np.testing.assert_array_equal(low, [part.x0 // 4 * 4, part.y0 // 16 * 16])
    np.testing.assert_array_equal(high, [-(-part.x1 // 4) * 4 - 1, -(-part.y1 // 16) * 16 - 1])
    assert items == np.prod(high + 1 - low)
    assert (np.ptp(pixels.reshape(-1, 16, 2), axis=1) == 3).all()


def test_columns_of_strips_are_four_blocks_high(call):
    pixels = drawn(call, "part_pixels", 512, part_columns(Rectangle(0, 16, 0, 32)))
    corners = pixels.reshape(32, 16, 2).min(axis=1)
    expected = [[4 * (k // 4 % 4), 4 * (k % 4) + 16 * (k // 16)] for k in range(32)]
    assert corners.tolist() == expected
    of_cells = drawn(call, "cell_pixels", 512, np.int32([[0, 0], [0, 1]]))
    np.testing.assert_array_equal(of_cells, pixels)


def test_the_largest_window_does_not_overflow(call):
    """65536 x 65536 has 2^32 pixels: the last work-item's index is the largest uint."""
    last = 2**32 - 64
    pixels = drawn(call, "block_pixels", 64, np.int32(65536), np.uint32(last))
    item = last + np.arange(64, dtype=np.int64)
    block, lane = item // 16, item % 16
    expected = np.column_stack([block % 16384 * 4 + lane % 4, block // 16384 * 4 + lane // 4])
    np.testing.assert_array_equal(pixels, expected)
    np.testing.assert_array_equal(pixels[-1], [65535, 65535])
