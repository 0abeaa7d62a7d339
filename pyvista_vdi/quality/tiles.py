"""Tiles of a picture: which are chosen, and what their SSIM says of the whole's.

A pair of coarse pictures guesses where SSIM is lost: there tiles are likelier (sampling with
unequal probabilities), and what they tell scales the guess for the rest of the picture.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.coverage import bounds_corners
from pyvista_vdi.model.metrics import SSIM_ARGUMENTS, SSIM_WINDOW, over_background

Floats: TypeAlias = NDArray[np.float64]

#: Pixels that an SSIM window reaches to each side of its centre.
REACH = SSIM_WINDOW // 2
#: Pixels of the picture along the edge of one pixel of the coarse pictures.
COARSE = 5
#: Arguments of ``structural_similarity`` for the coarse pictures: a window of 5 of their pixels.
_COARSE_SSIM = {**SSIM_ARGUMENTS, "sigma": 0.7}
_COARSE_WINDOW = 5
#: Edge in pixels of the blocks within which contrast is compared.
_BLOCK = 4
#: Weight of a difference between the coarse pictures against detail within one.
_DIFFERENCE_WEIGHT = 3.0
#: Share of the tiles that are spread evenly, whatever the coarse pictures show.
_EVEN_SHARE = 0.1


@dataclass(frozen=True)
class TileSample:
    """Tiles of a picture, and how the SSIM of the whole follows from theirs.

    ``corners``: int64 (k, 2): column and row of each tile's first pixel, from the top left.
    ``size``: width and height of a tile, pixels. ``chances``, ``guess``: float64 (k,): probability
    of each tile to be chosen, and its guessed loss. ``guessed``: sum of the guesses for all cells
    of the picture. ``share``: of the picture's pixels that have an SSIM, in one cell.
    """

    corners: NDArray[np.int64]
    size: tuple[int, int]
    chances: Floats
    guess: Floats
    guessed: float
    share: float

    def infer(self, ssim: Floats) -> tuple[float, float]:
        """Return the SSIM of the whole picture, and its standard error, from the tiles'."""
        # Total loss of all cells, and its standard error, from those that were chosen
        losses = 1.0 - ssim
        chances = self.chances
        guess = self.guess
        guessed = self.guessed
        seen, expected = float((losses / chances).sum()), float((guess / chances).sum())
        ratio = seen / expected if expected > 0 else 0.0
        residuals = (losses - ratio * guess) / chances
        n = len(losses)
        variance = n / max(1, n - 1) * float(((1 - chances) * residuals**2).sum())
        total, error = seen + ratio * (guessed - expected), math.sqrt(variance)
        return float(1.0 - self.share * total), float(self.share * error)


def tiles_ssim(
    old: Sequence[NDArray[np.float32]],
    new: Sequence[NDArray[np.float32]],
    background: Sequence[float] = (0.0, 0.0, 0.0),
) -> Floats:
    """Return the mean SSIM of the inner pixels of pairs of tiles of one size, float64 (k,)."""
    from skimage.metrics import structural_similarity  # loads SciPy

    height, width = new[0].shape[:2]
    # One above the other: a call for each would take five times as long
    pair = (over_background(np.concatenate(tiles), background) for tiles in (old, new))
    _, ssim = structural_similarity(*pair, full=True, **SSIM_ARGUMENTS)
    inner = slice(REACH, -REACH)
    by_tile = ssim.reshape(len(new), height, width, 3)[:, inner, inner]
    return np.asarray(by_tile.mean(axis=(1, 2, 3)))


def contrast_ratio(
    old: Sequence[NDArray[np.float32]],
    new: Sequence[NDArray[np.float32]],
    weights: Floats,
    background: Sequence[float] = (0.0, 0.0, 0.0),
) -> float:
    """Return the contrast of tiles within blocks of pixels over that of others, weighted by tile.

    It is the mean standard deviation of a channel within 4 x 4 pixels; 1 where neither has any.
    """
    sums = []
    for tiles in (old, new):
        height, width = tiles[0].shape[:2]
        n, high, wide = len(tiles), height // _BLOCK, width // _BLOCK
        pictures = over_background(np.concatenate(tiles), background)
        blocks = pictures.reshape(n, height, width, 3)[:, : high * _BLOCK, : wide * _BLOCK]
        blocks = blocks.reshape(n, high, _BLOCK, wide, _BLOCK, 3)
        sums.append(float(weights @ blocks.std(axis=(2, 4)).mean(axis=(1, 2, 3))))
    return sums[0] / sums[1] if sums[1] > 0 else 1.0


@dataclass(frozen=True)
class Region:
    """A rectangle of pixels: first column and row from the top left, and how many."""

    first: tuple[int, int]
    extent: tuple[int, int]


class Cells:
    """A region of a window cut into cells, each the part of a tile whose SSIM the tile tells.

    ``corners``: int64 (n, 2), column and row of each **tile's** first pixel, along a space-filling
    curve. ``tile_size``: width and height of a tile, pixels.
    """

    def __init__(self, region: Region, size: tuple[int, int], edge: int) -> None:
        self._region = region
        self._size = size
        self._edges = [min(edge, s - 2 * REACH) for s in size]
        self._starts = [
            _cell_starts(first, extent, e, s - REACH)
            for first, extent, e, s in zip(
                region.first, region.extent, self._edges, size, strict=True
            )
        ]
        columns, rows = self._starts
        self._order = _along_curve(len(columns), len(rows))
        column, row = self._order.T
        self.corners = np.stack([columns[column], rows[row]], axis=1) - REACH
        self.tile_size = (self._edges[0] + 2 * REACH, self._edges[1] + 2 * REACH)
        self.area = math.prod(max(n, e) for n, e in zip(region.extent, self._edges, strict=True))

    def guess(self, old: Floats, new: Floats) -> Floats:
        """Guess each cell's loss, up to a factor, from coarse pictures of the region.

        The loss of the coarse pictures' own SSIM, and the root of the detail that is to be seen:
        contrast between neighbours in either picture, and the pictures' difference.
        """
        from skimage.metrics import structural_similarity  # loads SciPy

        contrast = np.maximum(_contrast(old), _contrast(new))
        detail = contrast + _DIFFERENCE_WEIGHT * np.abs(old - new).max(axis=2)
        loss = np.zeros(old.shape[:2])
        if min(loss.shape) >= _COARSE_WINDOW:
            _, ssim = structural_similarity(old, new, full=True, **_COARSE_SSIM)
            loss = np.maximum(1.0 - ssim.mean(axis=2), 0.0)  # never below 0, but for rounding
        return np.asarray(self._averages(loss) + np.sqrt(self._averages(detail)))

    def sample(self, guess: Floats, tiles: int) -> TileSample:
        """Return ``tiles`` of them, or all, the likelier the more of the loss a cell is guessed."""
        n, mean = len(self.corners), guess.mean()
        # Give each cell a chance in proportion to its weight; what is beyond 1 is certain
        weight = _EVEN_SHARE + (1 - _EVEN_SHARE) * guess / mean if mean > 0 else np.ones(n)
        chances, certain = np.ones(n), np.zeros(n, dtype=bool)
        while not certain.all():
            left = min(tiles, n) - np.count_nonzero(certain)
            chances[~certain] = left * weight[~certain] / weight[~certain].sum()
            beyond = ~certain & (chances >= 1)
            if not beyond.any():
                break
            chances[beyond] = 1.0
            certain |= beyond
        # Sample systematically along the curve
        turns = np.floor(np.concatenate([[0.0], np.cumsum(chances)]) + 0.5)
        chosen = np.flatnonzero(np.diff(turns) > 0)
        return TileSample(
            self.corners[chosen],
            self.tile_size,
            chances[chosen],
            guess[chosen],
            float(guess.sum()),
            self.area / n / math.prod(edge - 2 * REACH for edge in self._size),
        )

    def _averages(self, coarse: Floats) -> Floats:
        """Mean over each cell of values at coarse pixels of the region, float64 (n,)."""
        # Find the shares of coarse pixels in cells along each axis; those of a cell add up to 1
        shares = []
        axes = zip(self._starts, self._edges, self._region.first, coarse.shape[::-1], strict=True)
        for starts, edge, first, count in axes:
            begin = first + COARSE * np.arange(count)
            low = np.maximum(begin[None], starts[:, None])
            high = np.minimum(begin[None] + COARSE, starts[:, None] + edge)
            share = np.maximum(high - low, 0.0)
            shares.append(share / share.sum(axis=1, keepdims=True))
        (across, down), (column, row) = shares, self._order.T
        return np.asarray((down @ coarse @ across.T)[row, column])


def seen_region(
    camera: Camera, size: tuple[int, int], boxes: Sequence[Sequence[float]]
) -> Region | None:
    """Pixels whose SSIM the boxes can change; None if there are none.

    The whole picture where a box reaches behind the eye. SSIM is not told within five pixels of
    the picture's border.
    """
    corners = np.concatenate([bounds_corners(box) for box in boxes])
    points = np.column_stack([corners, np.ones(len(corners))]) @ camera.model_to_view.T
    depth = points[:, 2]
    if not camera.parallel_projection and depth.max() <= 0:
        return None
    edges = np.asarray(size)
    first, last = np.zeros(2), edges.astype(np.float64)
    if camera.parallel_projection or depth.min() > rays.NEAREST_DEPTH * depth.max():
        pixels = window_pixels(points, camera, size)
        first, last = np.floor(pixels.min(axis=0)), np.ceil(pixels.max(axis=0))
    low = np.clip(first - REACH, REACH, edges - REACH).astype(int)
    high = np.clip(last + REACH, REACH, edges - REACH).astype(int)
    if (high <= low).any():
        return None
    width, height = (high - low).tolist()
    left, top = low.tolist()
    return Region((left, top), (width, height))


def window_pixels(points: Floats, camera: Camera, size: tuple[int, int]) -> Floats:
    """Return where homogeneous points in view space lie in a window: pixels from the top left."""
    viewport = points @ camera.viewport_matrix(size).T
    u, v = viewport[:, :2].T / viewport[:, 3]
    return np.asarray((np.stack([u, -v], axis=1) + 1) / 2 * size)


def _cell_starts(first: int, extent: int, edge: int, end: int) -> NDArray[np.int64]:
    """Where cells begin that cover ``extent`` pixels evenly and end before ``end``."""
    if extent <= edge:
        return np.array([min(first, end - edge)])
    count = -(-extent // edge)
    return np.rint(np.linspace(first, first + extent - edge, count)).astype(np.int64)


def _along_curve(columns: int, rows: int) -> NDArray[np.int64]:
    """All (column, row) of a grid along Hilbert's curve, int64 (columns * rows, 2).

    Neighbours along the curve are neighbours in the grid, so that a sample evenly spaced along it
    is spread over the grid.
    """
    row, column = np.divmod(np.arange(columns * rows), columns)
    cells = np.stack([column, row], axis=1)
    x, y = cells.T.copy()
    place = np.zeros_like(x)
    for bit in reversed(range(max(columns, rows).bit_length())):
        right, up = x >> bit & 1, y >> bit & 1
        place = place << 2 | (3 * right ^ up)
        # Turn the quadrant so that its curve runs as the whole does
        low = (1 << bit) - 1
        x, y = x & low, y & low
        flipped = (up == 0) & (right == 1)
        x, y = np.where(flipped, low - x, x), np.where(flipped, low - y, y)
        x, y = np.where(up == 0, y, x), np.where(up == 0, x, y)
    return np.asarray(cells[np.argsort(place)])


def _contrast(picture: Floats) -> Floats:
    """Largest difference of a channel from the four neighbours, float64 (rows, columns)."""
    contrast = np.zeros(picture.shape[:2])
    across = np.abs(np.diff(picture, axis=1)).max(axis=2)
    down = np.abs(np.diff(picture, axis=0)).max(axis=2)
    for part, difference in (
        (contrast[:, 1:], across),
        (contrast[:, :-1], across),
        (contrast[1:], down),
        (contrast[:-1], down),
    ):
        np.maximum(part, difference, out=part)
    return contrast
