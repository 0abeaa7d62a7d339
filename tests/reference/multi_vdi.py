"""The exact image of several VDIs together, in float64 (docs/dev/conventions.md, "Several VDIs").

Written as the definition reads: a ray is cut at every face of every supersegment that it crosses;
on each piece the extinctions of what covers it add, and the colour is their mean by extinction.
"""

import itertools
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI
from reference.compositing import composite, optical_depth_over_length
from reference.ranges import (
    FACE_ROUNDINGS,
    RAY_ROUNDINGS,
    ROUNDOFF,
    _corners,
    _inside,
    _ListSpace,
    _Move,
    _window_nudges,
)
from reference.raycast import Line, Lists, Rays, crossings

Array = NDArray[np.float64]


class Segments(NamedTuple):
    """What a ray crosses of one VDI, in the order in which it is met.

    ``begin``, ``end``: float64 (n,), view depth of V_N, world units. ``optical_depth``: float64
    (n,), of the whole segment on this ray. ``color``: float64 (n, 3), straight.
    """

    begin: Array
    end: Array
    optical_depth: Array
    color: Array


def segments_of(lists: Lists, line: Line) -> Segments:
    """Return what a line crosses of a medium; t is that of the line."""
    crossed = crossings(lists, line)
    tau = optical_depth_over_length(
        lists.optical_depth[crossed.member], crossed.length, lists.length[crossed.member]
    )
    color = lists.vdi.color[crossed.member].astype(np.float64)
    return Segments(crossed.begin, crossed.end, tau, color)


def composite_segments(streams: Sequence[Segments]) -> Array:
    """Return the colour of a ray through several media at once, premultiplied RGBA (4,).

    With sigma_k the extinction of what covers a piece of length l, its optical depth is
    ``l sum(sigma_k)`` and its colour ``sum(sigma_k c_k) / sum(sigma_k)``.
    """
    if not streams:
        return np.zeros(4)
    begin, end, tau = (np.concatenate([s[part] for s in streams]) for part in range(3))
    color = np.concatenate([s.color for s in streams]).reshape(-1, 3)
    cuts = np.unique(np.concatenate([begin, end]))
    if len(cuts) < 2:
        return np.zeros(4)
    middle = (cuts[:-1] + cuts[1:]) / 2
    covers = (begin <= middle[:, None]) & (middle[:, None] < end)
    share = covers * np.diff(cuts)[:, None] / np.maximum(end - begin, np.finfo(np.float64).tiny)
    part = share * tau
    together = part.sum(axis=1)
    mean = part @ color / np.where(together > 0, together, 1.0)[:, None]
    return composite(mean, together)


def render_joint(
    vdis: Sequence[VDI],
    cameras: Sequence[Camera],
    window_size: tuple[int, int],
    *,
    opaque_depth: ArrayLike | None = None,
    clipping_planes: Sequence[ArrayLike | None] | None = None,
    cropping: Sequence[Any] | None = None,
    opacity_multiplier: Sequence[float] | None = None,
) -> Array:
    """Return the exact image of several VDIs in one scene: float64 (H, W, 4), premultiplied RGBA.

    ``cameras`` are the new view, with each VDI's model transform; clipping planes, cropping and
    opacity multipliers those of each VDI; the rest is as for :func:`reference.render`.
    """
    width, height = window_size
    views = _views(vdis, cameras, window_size, opaque_depth, clipping_planes, cropping)
    media = [
        Lists(vdi, m) for vdi, m in zip(vdis, opacity_multiplier or [1.0] * len(vdis), strict=True)
    ]
    image = np.zeros((height, width, 4))
    for row, x in itertools.product(range(height), range(width)):
        image[row, x] = _seen(media, [view.lines((x, height - 1 - row)) for view in views])
    return image


def render_joint_range(
    vdis: Sequence[VDI],
    cameras: Sequence[Camera],
    window_size: tuple[int, int],
    pixels: Sequence[tuple[int, int]],
    k: float = RAY_ROUNDINGS,
    *,
    n_random: int = 0,
    seed: int = 0,
    opaque_depth: ArrayLike | None = None,
    clipping_planes: Sequence[ArrayLike | None] | None = None,
    cropping: Sequence[Any] | None = None,
    opacity_multiplier: Sequence[float] | None = None,
) -> tuple[Array, Array]:
    """Return the smallest and largest colour over rays moved by their arithmetic's roundings.

    As :func:`reference.render_range`, which derives how far and has the other
    parameters; each VDI's ray is moved on its own, because each is computed in its own list space.
    In addition each VDI's segments are moved along the ray, by ``k`` roundings of the depths
    between which all of them lie.
    """
    rng = np.random.default_rng(seed)
    views = _views(vdis, cameras, window_size, opaque_depth, clipping_planes, cropping)
    movers = [
        _Mover(Lists(vdi, m), k * ROUNDOFF)
        for vdi, m in zip(vdis, opacity_multiplier or [1.0] * len(vdis), strict=True)
    ]
    media = [mover.media[0] for mover in movers]
    nudges = _window_nudges(window_size, k)
    low = np.empty((len(pixels), 4))
    high = np.empty((len(pixels), 4))
    for n, pixel in enumerate(pixels):
        rays = [view.lines(pixel) for view in views]
        seen = [_seen(media, rays)]
        seen += [_seen(media, [view.lines(pixel, nudge) for view in views]) for nudge in nudges]
        depths = [depth for ray in rays for line in ray for depth in line[2:4]]
        reach = k * ROUNDOFF * float(np.ptp(depths)) if depths else 0.0
        for moves in _moves(rng, n_random, movers, rays):
            shift = reach * rng.uniform(-1, 1, size=len(vdis))
            moved = [
                mover.moved(line, move, along)
                for mover, ray, move, along in zip(movers, rays, moves, shift, strict=True)
                for line in ray
            ]
            seen.append(composite_segments(moved))
        low[n], high[n] = np.min(seen, axis=0), np.max(seen, axis=0)
    return low, high


def _views(
    vdis: Sequence[VDI],
    cameras: Sequence[Camera],
    window_size: tuple[int, int],
    opaque_depth: ArrayLike | None,
    clipping_planes: Sequence[ArrayLike | None] | None,
    cropping: Sequence[Any] | None,
) -> list[Rays]:
    """Return the rays that may meet each VDI, cut by its own clipping planes and cropping."""
    none = [None] * len(vdis)
    each = zip(vdis, cameras, clipping_planes or none, cropping or none, strict=True)
    return [Rays(v, seen, window_size, opaque_depth, cut, crop) for v, seen, cut, crop in each]


def _seen(media: Sequence[Lists], rays: Sequence[Sequence[Line]]) -> Array:
    """Return the colour of a ray, given the parts of it that may meet each medium."""
    return composite_segments(
        [segments_of(m, line) for m, ray in zip(media, rays, strict=True) for line in ray]
    )


class _Mover:
    """Moves the rays of one VDI by what rounding allows."""

    def __init__(self, lists: Lists, size: float) -> None:
        self.space = _ListSpace(lists.vdi)
        self.size = size
        shift = FACE_ROUNDINGS * ROUNDOFF * self.space.face_sensitivity(lists)
        self.media = {0: lists, 1: lists.displaced(shift), -1: lists.displaced(-shift)}

    def moved(self, line: Line, move: _Move, along: float) -> Segments:
        """Return what a moved line crosses, shifted along the ray."""
        segments = segments_of(
            self.media[move.faces], self.space.moved(line, move, self.size)
        )  # t from 0 to 1
        begin, end = (line.t0 + t * (line.t1 - line.t0) + along for t in segments[:2])
        return segments._replace(begin=begin, end=end)


def _moves(
    rng: np.random.Generator,
    count: int,
    movers: Sequence[_Mover],
    rays: Sequence[Sequence[Line]],
) -> Iterator[list[_Move]]:
    """Yield a move for each VDI: the fixed ones together, then every one at random."""
    for move in _corners():
        yield [move] * len(movers)
    for _ in range(count):
        yield [
            next(_inside(rng, 1, mover.space, ray[0], mover.size))
            if ray
            else _Move(np.zeros((2, 3)), 0)
            for mover, ray in zip(movers, rays, strict=True)
        ]
