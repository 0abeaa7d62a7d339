"""The paper's criterion of homogeneity, after Frey et al. 2013, in float64 (section 2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.model.compositing import Segment, merge

Array = NDArray[np.float64]


def cut_where_unlike(
    runs: Sequence[Segment],
    limit: int,
    per_reference: float,
    weighting: str = "transmittance",
) -> list[Segment]:
    """Cut where the medium differs too much from its mean so far (Frey et al. 2013).

    The threshold is the least, to a thousandth, that keeps the budget on this ray.

    Parameters
    ----------
    runs : sequence of Segment
        What the ray meets, nearest first; what lies between two of them is empty.
    limit : int
        N_S. Nothing is dropped.
    per_reference : float
        Reference lengths (the smallest spacing) per unit of the segments' depths.
    weighting : {"transmittance", "optical_depth"}
        Of the colours; see :func:`pyvista_vdi.model.compositing.merge`.

    Returns
    -------
    list of Segment
        Nearest first.
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
