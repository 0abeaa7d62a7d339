"""Samples of deep images become lists: sorted, disjoint, with optical depths.

The rules are those of https://openexr.com/en/latest/InterpretingDeepPixels.html: a sample is a
homogeneous medium, splitting one shares out its optical depth by length, and media in one place
add theirs.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError, VDIFileError, warn_external
from pyvista_vdi.model.checks import as_float
from pyvista_vdi.model.transfer_function import OPAQUE_OPTICAL_DEPTH


class Samples(NamedTuple):
    """Media of all lists."""

    lists: NDArray[np.int64]  # int64 (n,), which list each belongs to; never falls
    front: NDArray[np.float32]  # float32 (n,), absolute view depth
    back: NDArray[np.float32]  # float32 (n,), absolute view depth
    color: NDArray[np.float64]  # float64 (n, 3), straight
    optical_depth: NDArray[np.float64]

    def take(self, which: NDArray[Any]) -> Samples:
        """Return those that an index or a mask chooses."""
        return Samples(*(array[which] for array in self))


@np.errstate(invalid="ignore")  # a signalling NaN is refused as any other
def media(
    lists: NDArray[np.int64], channels: dict[str, NDArray[Any]], thickness: float | None, name: str
) -> Samples:
    """Return the media that a file's channels stand for, sorted and disjoint.

    ``lists``: which list each sample belongs to, never falling. ``thickness``: world units,
    given to samples without one. Samples of opacity 0, which show nothing, are left out.
    """
    alpha = channels["A"].astype(np.float64)
    front = channels["Z"].astype(np.float32)
    back = channels.get("ZBack", channels["Z"]).astype(np.float32)
    color = np.stack([channels[c] for c in "RGB"], axis=1).astype(np.float64)
    for rule, good in (
        (
            "Z and ZBack finite, Z not negative",
            np.isfinite([front, back]).all(axis=0) & (front >= 0),
        ),
        ("R, G and B finite", np.isfinite(color).all(axis=1)),
        ("A from 0 to 1", (alpha >= 0) & (alpha <= 1)),
    ):
        if not good.all():
            k = int(np.argmin(good))
            values = ", ".join(f"{channel} {array[k]:g}" for channel, array in channels.items())
            raise VDIFileError(f"{name} breaks the rule '{rule}': sample {k} has {values}")
    # Give samples a thickness
    flat = (back <= front) & (alpha > 0)
    if thickness is None and flat.any():
        raise VDIFileError(
            f"{name} has {int(flat.sum())} samples without a thickness, the first at depth "
            f"{front[flat][0]:g}: they are surfaces, or too thin for half floats, and a VDI holds "
            "media; give them a thickness in world units: read(..., thickness=...)"
        )
    if thickness is not None:
        if not 0 < as_float(thickness) < np.inf:
            raise InvalidArgumentError(f"thickness must be a positive length; got {thickness!r}")
        thick = np.maximum(front + np.float32(thickness), np.nextafter(front, np.float32(np.inf)))
        back = np.where(flat, thick, back)
    # Take straight colours of what is seen
    seen = alpha > 0
    straight = color[seen] / alpha[seen, None]
    outside = np.abs(straight - 0.5) > 0.5 + 2.0**-8  # which float16 rounds by
    if outside.any() or color[~seen].any():
        warn_external(
            f"{name}: a VDI's colours lie between 0 and 1, and what shines has an opacity: other "
            "samples were clamped, or left out"
        )
    tau = _optical_depth(alpha, channels)[seen]
    found = Samples(lists[seen], front[seen], back[seen], straight.clip(0, 1), tau)
    found = found.take(np.lexsort((found.back, found.front, found.lists)))
    # Take lists apart in which samples overlap
    overlap = (found.lists[1:] == found.lists[:-1]) & (found.front[1:] < found.back[:-1])
    messy = np.unique(found.lists[1:][overlap])
    pieces = [found.take(~np.isin(found.lists, messy))]
    for each in messy:
        first, last = np.searchsorted(found.lists, (each, each + 1))
        pieces.append(_taken_apart(found.take(np.arange(first, last))))
    joined = Samples(*(np.concatenate(arrays) for arrays in zip(*pieces, strict=True)))
    return joined.take(np.lexsort((joined.front, joined.lists)))


def _optical_depth(alpha: NDArray[np.float64], channels: dict[str, NDArray[Any]]) -> Any:
    """Return tau where it agrees with A: programs that split or fade samples leave it as it was."""
    with np.errstate(divide="ignore"):  # log1p(-1), which is not taken
        of_alpha = np.where(alpha == 1, OPAQUE_OPTICAL_DEPTH, np.abs(np.log1p(-alpha)))
    tau = channels.get("tau", of_alpha).astype(np.float64)
    tau = np.where((tau >= 0) & (tau < np.inf), tau, 0)
    # float16 opacities would differ by 2**-12 and then say less than tau does, so they count;
    # the second term is the rounding of denormal opacities
    same = np.abs(-np.expm1(-tau) - alpha) <= 2.0**-22 * alpha + 2.0**-148
    return np.where(same, tau, of_alpha)


def _taken_apart(samples: Samples) -> Samples:
    """Split overlapping media of one list at every face, and add up what lies in one place.

    Optical depths add; the colour is their mean weighted by optical depth, which is what the
    standard's rule for merging samples of one range says.
    """
    front, back = samples.front.astype(np.float64), samples.back.astype(np.float64)
    faces = np.unique(np.concatenate([front, back]))
    low, high = faces[:-1], faces[1:]
    covers = (front <= low[:, None]) & (back >= high[:, None])
    part = covers * (samples.optical_depth / (back - front)) * (high - low)[:, None]
    filled = covers.any(axis=1)
    part, low, high = part[filled], low[filled].astype("f4"), high[filled].astype("f4")
    tau = part.sum(axis=1)
    lists = np.full(len(low), samples.lists[0])
    return Samples(lists, low, high, part @ samples.color / tau[:, None], tau)
