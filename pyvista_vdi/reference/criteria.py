"""The criteria by which the field cuts a ray into supersegments, in float64 (the paper, section 2).

Each takes what a ray meets, cuts it into at most ``limit`` supersegments, and drops nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.model.compositing import Segment, merge, opacity, split

Array = NDArray[np.float64]


def cut_at_equal_lengths(
    runs: Sequence[Segment], limit: int, weighting: str = "transmittance"
) -> list[Segment]:
    """Cut at equal depths from the first face to the last (Brady et al. 1997).

    ``runs``: what the ray meets, nearest first; what lies between two of them is empty. ``limit``:
    N_S. Stretches that are empty throughout make no supersegment; the others begin and end where
    their medium does. ``weighting`` ("transmittance", "optical_depth"): of the colours; see
    :func:`pyvista_vdi.model.compositing.merge`. Returns: Nearest first.
    """
    if not runs:
        return []
    return _cut_at(runs, np.linspace(runs[0].front, runs[-1].back, limit + 1)[1:-1], weighting)


def cut_at_equal_transmittance(
    runs: Sequence[Segment], limit: int, weighting: str = "transmittance"
) -> list[Segment]:
    """Cut where the light that reaches the eye has fallen by equal steps (Lochmann et al. 2016).

    Of the light 1 - T that the ray loses on its way, each supersegment takes (1 - T) / N_S: the
    paper's "accumulated transmittance" in equal parts. What lies behind what has become opaque is
    all in the last.

    ``runs``, ``limit``, ``weighting``: as for :func:`cut_at_equal_lengths`. Returns: Nearest first.
    """
    if not runs:
        return []
    lost = opacity(sum(run.optical_depth for run in runs)) * np.arange(1, limit) / limit
    return _cut_at(runs, _depths_of(runs, -np.log1p(-lost)), weighting)


def cut_at_equal_optical_depths(
    runs: Sequence[Segment], limit: int, weighting: str = "transmittance"
) -> list[Segment]:
    """Cut at equal steps of optical depth, so that each supersegment lets the same share through.

    ``runs``, ``limit``, ``weighting``: as for :func:`cut_at_equal_lengths`. Returns: Nearest first.
    """
    if not runs:
        return []
    whole = sum(run.optical_depth for run in runs)
    return _cut_at(runs, _depths_of(runs, whole * np.arange(1, limit) / limit), weighting)


def cut_where_unlike(
    runs: Sequence[Segment],
    limit: int,
    per_reference: float,
    weighting: str = "transmittance",
) -> list[Segment]:
    """Cut where the medium differs too much from its mean so far (Frey et al. 2013).

    The threshold is the least, to a thousandth, that keeps the budget on this ray.

    ``runs``, ``limit``, ``weighting``: as for :func:`cut_at_equal_lengths`. ``per_reference``:
    reference lengths (the smallest spacing) per unit of the segments' depths. Returns: Nearest
    first.
    """
    if len(runs) <= limit:
        return list(runs)
    low, high = 0.0, 2 * max(float(np.linalg.norm(feature(run, per_reference))) for run in runs)
    while high - low > 1e-3 * high:
        middle = (low + high) / 2
        if len(merge_alike(runs, middle, per_reference, weighting)) > limit:
            low = middle
        else:
            high = middle
    return merge_alike(runs, high, per_reference, weighting)


def merge_alike(
    runs: Sequence[Segment], threshold: float, per_reference: float, weighting: str
) -> list[Segment]:
    """Merge front to back while the next run differs from the mean so far by at most ``threshold``.

    What is compared is :func:`feature`. An empty stretch is taken in if it differs by no more.
    """
    merged = list(runs[:1])
    for run in runs[1:]:
        last = merged[-1]
        mean = feature(last, per_reference)
        gap = run.front > last.back
        if gap and np.linalg.norm(mean) > threshold:
            merged.append(run)
            continue
        if gap:
            mean = feature(last._replace(back=run.front), per_reference)
        if np.linalg.norm(feature(run, per_reference) - mean) > threshold:
            merged.append(run)
        else:
            merged[-1] = merge(last, run, weighting)
    return merged


def feature(run: Segment, per_reference: float) -> Array:
    """Return opacity-weighted colour and opacity of one reference length of a medium.

    The opacity is taken as s / (s + 1), where s is the optical depth of a reference length.
    """
    length = (run.back - run.front) * per_reference
    return run.optical_depth / (run.optical_depth + length) * np.append(run.color, 1.0)


def _depths_of(runs: Sequence[Segment], optical_depths: Array) -> Array:
    """Return where on the ray so much optical depth has been passed."""
    passed = np.concatenate([[0.0], np.cumsum([run.optical_depth for run in runs])])
    k = np.searchsorted(passed[:-1], optical_depths, side="right") - 1
    front, back, tau = np.array([(r.front, r.back, r.optical_depth) for r in runs]).T
    return np.asarray(front[k] + (optical_depths - passed[k]) / tau[k] * (back[k] - front[k]))


def _cut_at(runs: Sequence[Segment], depths: Array, weighting: str) -> list[Segment]:
    """Merge what lies between the same two of ``depths``, which ascend; split what spans them."""
    ends = [*depths, math.inf]
    cuts: list[Segment] = []
    cut, begun = 0, False
    for run in runs:
        rest = run
        while True:
            while ends[cut] <= rest.front:
                cut, begun = cut + 1, False
            part, rest_of_it = (
                split(rest, ends[cut]) if rest.front < ends[cut] < rest.back else (rest, None)
            )
            if begun:
                cuts[-1] = merge(cuts[-1], part, weighting)
            else:
                cuts.append(part)
                begun = True
            if rest_of_it is None:
                break
            rest = rest_of_it
    return cuts
