"""A device's picture against the float64 oracle's range over the moved ray.

Every channel of every pixel lies within 2e-5 of the range over the ray moved by the roundings of
list coordinates (docs/dev/conventions.md; the number of roundings is derived in
``reference.ranges``). 2e-5 is 336 unit roundoffs of float32: a ray in these tests
composites up to about 100 supersegments, each with three roundings that reach the image, and the
raycaster may drop what lies behind a transmittance of 1e-6.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import reference

#: Largest difference per channel; see above.
TOLERANCE = 2e-5

#: Moved rays tried in turn for a pixel beyond the fixed set: where a ray runs along a border in
#: two directions at once, what it meets depends on where it crosses each of them.
ESCALATION = (0, 600, 20_000)

#: Pixels of one image tried at each stage. A handful need the later ones; where more do, the
#: raycaster is wrong, and more tries would only hide it for minutes.
MAX_PIXELS = (10**6, 40, 4)


class Comparison(NamedTuple):
    pixels: int
    drawn: int  # where the oracle sees something
    moved: int  # beyond TOLERANCE of the unmoved ray
    failures: list[str]
    worst: float  # largest difference from the oracle, or from its range where a ray was moved


def explain(
    vdi,
    camera,
    size,
    image,
    *,
    name,
    escalation=ESCALATION,
    most_pixels=MAX_PIXELS,
    tolerance=TOLERANCE,
    render=reference.render,
    render_range=reference.render_range,
    **ends,
):
    """Compare an image with the oracle; say which pixels no ray within rounding explains."""
    exact = render(vdi, camera, size, **ends)
    assert image.shape == exact.shape
    assert image.dtype == np.float32
    # Written so that NaN is a difference
    error = np.abs(image - exact).max(axis=-1)
    differs = ~(error <= tolerance)
    worst = float(error[~differs].max(initial=0.0))
    rows, columns = np.nonzero(differs)
    pixels = [(int(x), size[1] - 1 - int(row)) for row, x in zip(rows, columns, strict=True)]
    low = high = drawn = image[differs].astype(np.float64)
    for n_random, most in zip(escalation, most_pixels, strict=False):
        if not pixels or len(pixels) > most:
            break
        low, high = render_range(vdi, camera, size, pixels, n_random=n_random, **ends)
        beyond = np.maximum(low - drawn, drawn - high).max(axis=1)
        outside = ~(beyond <= tolerance)
        worst = max(worst, float(beyond[~outside].max(initial=0.0)))
        pixels = [p for p, out in zip(pixels, outside, strict=True) if out]
        drawn, low, high = drawn[outside], low[outside], high[outside]
    failures = [
        f"{name}: pixel {p} drawn {d}, oracle between {a} and {b}"
        for p, d, a, b in zip(pixels, drawn, low, high, strict=True)
    ]
    drawn_pixels = int((exact[..., 3] > tolerance).sum())
    return Comparison(differs.size, drawn_pixels, int(differs.sum()), failures, worst)


def total(comparisons):
    parts = list(comparisons)
    return Comparison(
        sum(part.pixels for part in parts),
        sum(part.drawn for part in parts),
        sum(part.moved for part in parts),
        [failure for part in parts for failure in part.failures],
        max((part.worst for part in parts), default=0.0),
    )


def assert_explained(vdi, camera, size, image, **options):
    """Fail with the first pixels that no ray within rounding explains; else the comparison."""
    result = explain(vdi, camera, size, image, **options)
    assert not result.failures, "\n".join(result.failures[:5])
    return result
