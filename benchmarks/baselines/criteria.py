"""Criteria of the field that cut a ray at equal shares, in float64: what the paper compares with.

Each takes what a ray meets, cuts it into at most ``limit`` supersegments, and drops nothing.
``cut`` does so with all lists of a VDI.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from reference.generate import vdi_of_lists

from pyvista_vdi.model.compositing import Segment, merge, opacity, split
from pyvista_vdi.model.vdi import VDI

Array = NDArray[np.float64]

#: Supersegments of a list from which cuts are made: more than a ray through most data has.
RECORDED = 512


def cut_at_equal_lengths(runs: Sequence[Segment], limit: int) -> list[Segment]:
    """Cut at equal depths from the first face to the last (Brady et al. 1997).

    Parameters
    ----------
    runs : sequence of Segment
        What the ray meets, nearest first; what lies between two of them is empty.
    limit : int
        N_S. Stretches that are empty throughout make no supersegment; the others begin and end
        where their medium does.

    Returns
    -------
    list of Segment
        Nearest first.
    """
    if not runs:
        return []
    return _cut_at(runs, np.linspace(runs[0].front, runs[-1].back, limit + 1)[1:-1])


def cut_at_equal_transmittance(runs: Sequence[Segment], limit: int) -> list[Segment]:
    """Cut where the light that reaches the eye has fallen by equal steps (Lochmann et al. 2016).

    Of the light 1 - T that the ray loses on its way, each supersegment takes (1 - T) / N_S: the
    paper's "accumulated transmittance" in equal parts. What lies behind what has become opaque is
    all in the last.

    Parameters
    ----------
    runs, limit
        As for :func:`cut_at_equal_lengths`.

    Returns
    -------
    list of Segment
        Nearest first.
    """
    if not runs:
        return []
    lost = opacity(sum(run.optical_depth for run in runs)) * np.arange(1, limit) / limit
    return _cut_at(runs, _depths_of(runs, -np.log1p(-lost)))


def cut_at_equal_optical_depths(runs: Sequence[Segment], limit: int) -> list[Segment]:
    """Cut at equal steps of optical depth, so that each supersegment lets the same share through.

    Parameters
    ----------
    runs, limit
        As for :func:`cut_at_equal_lengths`.

    Returns
    -------
    list of Segment
        Nearest first.
    """
    if not runs:
        return []
    whole = sum(run.optical_depth for run in runs)
    return _cut_at(runs, _depths_of(runs, whole * np.arange(1, limit) / limit))


def _depths_of(runs: Sequence[Segment], optical_depths: Array) -> Array:
    """Return where on the ray so much optical depth has been passed."""
    passed = np.concatenate([[0.0], np.cumsum([run.optical_depth for run in runs])])
    k = np.searchsorted(passed[:-1], optical_depths, side="right") - 1
    front, back, tau = np.array([(r.front, r.back, r.optical_depth) for r in runs]).T
    return np.asarray(front[k] + (optical_depths - passed[k]) / tau[k] * (back[k] - front[k]))


def _cut_at(runs: Sequence[Segment], depths: Array) -> list[Segment]:
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
                cuts[-1] = merge(cuts[-1], part)
            else:
                cuts.append(part)
                begun = True
            if rest_of_it is None:
                break
            rest = rest_of_it
    return cuts


#: The criteria by name.
CRITERIA: Mapping[str, Callable[[Sequence[Segment], int], list[Segment]]] = {
    "length": cut_at_equal_lengths,
    "transmittance": cut_at_equal_transmittance,
    "optical-depth": cut_at_equal_optical_depths,
}


def cut(vdi: VDI, criterion: str, limit: int) -> VDI:
    """Return a VDI whose lists are cut by one of ``CRITERIA``.

    ``vdi`` holds what the rays meet: lists of up to ``RECORDED`` supersegments.
    """
    origin = vdi.depth_origin
    runs = [
        Segment(front + origin, back + origin, color, tau)
        for front, back, color, tau in zip(
            vdi.front.astype(np.float64),
            vdi.back.astype(np.float64),
            vdi.color.astype(np.float64),
            vdi.optical_depth.astype(np.float64),
            strict=True,
        )
    ]
    lists = [
        CRITERIA[criterion](runs[begin:end], limit)
        for begin, end in itertools.pairwise(vdi.offsets.tolist())
    ]
    return vdi_of_lists(lists, vdi.camera, vdi.window_size, vdi.bounds, origin, criterion)
