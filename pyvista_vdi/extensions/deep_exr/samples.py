"""Samples of foreign deep images become lists: sorted, disjoint, with optical depths.

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
from pyvista_vdi.model.compositing import opacity
from pyvista_vdi.model.compositing import optical_depth as optical_depth_of
from pyvista_vdi.model.transfer_function import OPAQUE_OPTICAL_DEPTH

#: Longest list with overlaps that is taken apart: the work grows with its square.
_MAX_MESSY = 4096

#: Colours this far outside 0..1 are rounding, of float16 premultiplied colours for instance.
_COLOR_ROUNDING = 2.0**-8


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


def media(
    lists: NDArray[np.int64], channels: dict[str, NDArray[Any]], thickness: float | None, name: str
) -> Samples:
    """Return the media that a foreign file's channels stand for, sorted and disjoint.

    ``lists``: which list each sample belongs to, never falling. ``thickness``: world units,
    given to samples without one. Samples of opacity 0, which show nothing, are left out.
    """
    alpha = channels["A"].astype(np.float64)
    front = channels["Z"].astype(np.float32)
    back = channels.get("ZBack", channels["Z"]).astype(np.float32)
    color = np.stack([channels[c] for c in "RGB"], axis=1).astype(np.float64)
    _require(np.isfinite(front) & np.isfinite(back), "Z and ZBack finite", name, channels)
    _require(np.isfinite(color).all(axis=1), "R, G and B finite", name, channels)
    _require((alpha >= 0) & (alpha <= 1), "A from 0 to 1", name, channels)
    _require(front >= 0, "Z not negative", name, channels)
    with np.errstate(divide="ignore", invalid="ignore"):
        straight = color / alpha[:, None]
    seen = Samples(lists, front, back, straight, _optical_depth(alpha, channels))
    half = channels["Z"].dtype == np.float16
    seen = _with_thickness(seen.take(alpha > 0), thickness, name, half)
    _warn_of_colors(color[alpha == 0], seen.color, name)
    seen = seen._replace(color=seen.color.clip(0, 1))
    return _tidy(seen.take(np.lexsort((seen.back, seen.front, seen.lists))), name)


def agree(alpha: NDArray[Any], tau: NDArray[Any]) -> NDArray[np.bool_]:
    """Return where optical depths and opacities say the same, up to the rounding of float32."""
    good = (tau >= 0) & (tau < np.inf)
    of_tau = opacity(np.where(good, tau, 0))
    # float16 opacities would differ by 2**-12 and then say less than tau does, so they count;
    # the second term is the rounding of denormal opacities
    same: NDArray[np.bool_] = np.abs(of_tau - alpha) <= 2.0**-22 * alpha + 2.0**-148
    return good & same


def _optical_depth(alpha: NDArray[np.float64], channels: dict[str, NDArray[Any]]) -> Any:
    """Return tau where it agrees with A: programs that split or fade samples leave it as it was."""
    of_alpha = np.where(alpha == 1, OPAQUE_OPTICAL_DEPTH, optical_depth_of(alpha))
    tau = channels.get("tau")
    if tau is None:
        return of_alpha
    return np.where(agree(alpha, tau), tau.astype(np.float64), of_alpha)


def _with_thickness(samples: Samples, thickness: float | None, name: str, half: bool) -> Samples:
    flat = samples.back <= samples.front
    if not flat.any():
        return samples
    if thickness is None:
        k = int(np.argmax(flat))
        why = "they are surfaces, and a VDI holds media; give"
        if half:
            why = "depths are half floats, too coarse for thin samples; write Z as float, or give"
        raise VDIFileError(
            f"{name} has {int(flat.sum())} samples without a thickness, the first at depth "
            f"{samples.front[k]:g}: {why} them a thickness in world units: read(..., thickness=...)"
        )
    if not 0 < as_float(thickness) < np.inf:
        raise InvalidArgumentError(f"thickness must be a positive length; got {thickness!r}")
    front = samples.front
    thick = np.maximum(front + np.float32(thickness), np.nextafter(front, np.float32(np.inf)))
    return samples._replace(back=np.where(flat, thick, samples.back))


def _warn_of_colors(of_nothing: Any, straight: Any, name: str) -> None:
    outside = (straight < -_COLOR_ROUNDING) | (straight > 1 + _COLOR_ROUNDING)
    n_clamped, n_lost = int(outside.any(axis=1).sum()), int((of_nothing != 0).any(axis=1).sum())
    if n_clamped or n_lost:
        warn_external(
            f"{name}: a VDI's colours lie between 0 and 1; those of {n_clamped} samples were "
            f"clamped, and {n_lost} samples that shine without opacity were left out"
        )


def _tidy(samples: Samples, name: str) -> Samples:
    """Take lists apart in which samples overlap; the others stay as they are."""
    lists = samples.lists
    touch = (lists[1:] == lists[:-1]) & (samples.front[1:] < samples.back[:-1])
    messy = np.unique(lists[1:][touch])
    if len(messy) == 0:
        return samples
    pieces = [samples.take(~np.isin(lists, messy))]
    for i in messy.tolist():
        first, last = np.searchsorted(lists, (i, i + 1))
        if last - first > _MAX_MESSY:
            raise VDIFileError(
                f"{name} has {last - first} overlapping samples in one pixel; at most "
                f"{_MAX_MESSY} are taken apart: tidy the image where it was made"
            )
        pieces.append(_taken_apart(samples.take(np.arange(first, last))))
    joined = Samples(*(np.concatenate(arrays) for arrays in zip(*pieces, strict=True)))
    return joined.take(np.lexsort((joined.front, joined.lists)))


def _taken_apart(samples: Samples) -> Samples:
    """Split overlapping media at every face, and add up what lies in one place.

    Optical depths add; the colour is their mean weighted by optical depth, which is what the
    standard's rule for merging samples of one range says.
    """
    front, back = samples.front.astype(np.float64), samples.back.astype(np.float64)
    faces = np.unique(np.concatenate([front, back]))
    low, high = faces[:-1], faces[1:]
    covers = (front <= low[:, None]) & (back >= high[:, None])
    density = samples.optical_depth / (back - front)
    part = covers * density * (high - low)[:, None]
    filled = covers.any(axis=1)
    part, low, high = part[filled], low[filled], high[filled]
    tau = part.sum(axis=1)
    return Samples(
        np.full(len(low), samples.lists[0]),
        low.astype(np.float32),
        high.astype(np.float32),
        part @ samples.color / tau[:, None],
        tau,
    )


def _require(good: Any, rule: str, name: str, channels: dict[str, NDArray[Any]]) -> None:
    if good.all():
        return
    k = int(np.argmin(good))
    values = ", ".join(f"{channel} {array[k]:g}" for channel, array in channels.items())
    raise VDIFileError(f"{name} breaks the rule '{rule}' of deep images: sample {k} has {values}")
