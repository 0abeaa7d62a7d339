"""How far a VDI's picture of a view is from the volume's own, without rendering either whole.

A few small tiles of the picture are rendered both ways, and the SSIM of the whole is inferred
from theirs. A pair of coarse pictures guesses where it is lost: there tiles are likelier (sampling
with unequal probabilities), and what they tell scales the guess for the rest of the picture.
docs/regeneration.md says how well that predicts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import InvalidCameraError
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.metrics import SSIM_ARGUMENTS, SSIM_WINDOW, over_background
from pyvista_vdi.model.options import FrameRequest, MediumOptions, RenderOptions
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.view import bounds_corners
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.raycasting.raycast import render_vdi
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.render import picture_room, raycast_medium

Floats: TypeAlias = NDArray[np.float64]
#: Along x and y.
Pair: TypeAlias = tuple[int, int]
#: Premultiplied RGBA, float32 (height, width, 4).
Picture: TypeAlias = NDArray[np.float32]

#: Tiles of an estimate, and their edge in pixels: docs/regeneration.md.
TILES, TILE_SIZE = 16, 24
#: Pixels that an SSIM window reaches to each side of its centre.
REACH = SSIM_WINDOW // 2
#: Pixels of the picture along the edge of one pixel of the coarse pictures.
COARSE = 5
#: Most pixels of a coarse picture in one launch: a frame may have to wait for its end.
_COARSE_LAUNCH = 8192
#: Arguments of ``structural_similarity`` for the coarse pictures: a window of 5 of their pixels.
_COARSE_SSIM = {**SSIM_ARGUMENTS, "sigma": 0.7}
_COARSE_WINDOW = 5
#: Weight of a difference between the coarse pictures against detail within one.
_DIFFERENCE_WEIGHT = 3.0
#: Share of the tiles that are spread evenly, whatever the coarse pictures show.
_EVEN_SHARE = 0.1
#: Distance of an eye from the centre, in diagonals of the bounds, below which it has no direction.
_AT_CENTRE = 1e-6


@dataclass(frozen=True)
class ViewError:
    """What is known of a VDI's error in a view."""

    ssim: float  # predicted, of the VDI's picture against the volume's; NaN below 11 pixels
    tiles: int  # that were rendered; 0 where the volume is not in view


class ViewErrorEstimator:
    """Estimates the error of VDIs of one volume; keeps the volume on the device.

    The volume is sampled as ``medium`` says: as it was when the VDIs were generated, but for the
    lights, which are those of the view that is judged. An estimate takes 16 tiles of 24 pixels
    along each edge; what SSIM compares around a pixel reaches five pixels to each side, so a tile
    tells the SSIM of 14 x 14 pixels.

    The picture is cut into cells as large as what a tile tells, inside the rectangle around the
    bounds (elsewhere both pictures are empty, and SSIM is 1). Both pictures are rendered at a
    fifth of the pixels along each edge to guess each cell's loss, 1 - SSIM, up to a factor. A
    systematic sample with probabilities in proportion to the guess is taken along a space-filling
    curve through the cells (Madow 1949). The factor is the ratio of what the tiles lost to what was
    guessed for them, each weighted by one over its probability (the ratio estimator: Särndal,
    Swensson and Wretman 1992, section 5.6). Equal arguments give equal estimates.
    """

    def __init__(
        self,
        volume: Volume,
        transfer_function: TransferFunction,
        medium: MediumOptions | None = None,
        *,
        device: Any = None,
    ) -> None:
        options = medium or MediumOptions()
        self._runtime = get_runtime(device)
        edge = max(TILE_SIZE, math.isqrt(2 * _COARSE_LAUNCH))  # of what is rendered at a time
        room = picture_room((edge, edge), options.memory_limit)
        self._medium = DeviceVolume(self._runtime, volume, transfer_function, options, room=room)

    def estimate(
        self,
        vdi: VDI,
        camera: Any,
        window_size: Sequence[int] | None = None,
        options: RenderOptions | None = None,
        background: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> ViewError:
        """Estimate how similar the VDI's picture of a view is to the volume's.

        The view's ``model_transform`` says where volume and VDI are now, ``window_size`` (width,
        height) is that of the whole picture, by default the VDI's own, ``options`` are those that
        both are drawn with, and ``background`` is the RGB that both are blended over before they
        are compared. InvalidArgumentError if an argument cannot be used.
        """
        camera = Camera.from_any(camera)
        size = check_window_size(vdi.window_size if window_size is None else window_size)
        request = FrameRequest(camera, size, options or RenderOptions(), device=self._runtime)
        if min(size) < SSIM_WINDOW:
            return ViewError(math.nan, 0)
        sample = self.sample(vdi, request, background)
        if sample is None:
            return ViewError(1.0, 0)
        old, new = self.tiles(sample, request, vdi), self.tiles(sample, request)
        ssim = sample.infer(tiles_ssim(old, new, background))
        return ViewError(ssim, len(new))

    def sample(
        self, vdi: VDI, request: FrameRequest, background: Sequence[float] = (0.0, 0.0, 0.0)
    ) -> TileSample | None:
        """Choose the tiles of a view, by a VDI that shows roughly where the error is.

        It may have fewer lists than the VDI that is to be judged. Returns None where the volume is
        not in view; both edges of the window have at least 11 pixels.
        """
        camera, size = request.camera, request.window_size
        region = seen_region(camera, size, (vdi.bounds, self._medium.volume.bounds))
        if region is None:
            return None
        cells = Cells(*region, size, TILE_SIZE - 2 * REACH)
        n = len(cells.corners)
        if n <= TILES:
            return cells.sample(np.ones(n), TILES)
        # Draw coarse pictures of the region both ways, in bands
        (left, top), extents = region
        columns, rows = (-(-extent // COARSE) for extent in extents)
        band = max(1, _COARSE_LAUNCH // columns)
        pictures: tuple[list[Picture], list[Picture]] = ([], [])
        for row in range(0, rows, band):
            high = min(band, rows - row)
            corner = (left, top + row * COARSE)
            lens = camera.tile(size, corner, (columns * COARSE, high * COARSE))
            part = request.replace(camera=lens, window_size=(columns, high))
            pictures[0].append(render_vdi(vdi, part))
            pictures[1].append(raycast_medium(self._medium, part))
        old, new = (over_background(np.concatenate(each), background) for each in pictures)
        return cells.sample(cells.guess(old, new), TILES)

    def tiles(
        self, sample: TileSample, request: FrameRequest, vdi: VDI | None = None
    ) -> list[Picture]:
        """Return the pictures of a view's tiles, by a VDI or, without one, by the volume."""
        pictures = []
        for column, row in sample.corners.tolist():
            lens = request.camera.tile(request.window_size, (column, row), sample.size)
            tile = request.replace(camera=lens, window_size=sample.size)
            drawn = raycast_medium(self._medium, tile) if vdi is None else render_vdi(vdi, tile)
            pictures.append(drawn)
        return pictures


# Where a view stands


def angle_from_generating_view(vdi: VDI, camera: Any) -> float:
    """Return by how much a view has turned about the VDI's model, degrees from 0 to 180.

    It is the angle between the directions from the centre of the bounds to the two eyes, each taken
    to the model frame by its own camera's model transform, and compared as that of the VDI's
    ``camera`` shows them. In parallel projection the eye is infinitely far against the direction of
    projection; that also stands in for an eye at the very centre.
    """
    shown = vdi.camera.model_transform[:3, :3]
    old, new = (
        eye_from_centre(view, vdi.bounds, shown)[0]
        for view in (vdi.camera, Camera.from_any(camera))
    )
    sine, cosine = np.linalg.norm(np.cross(old, new)), old @ new
    return math.degrees(math.atan2(sine, cosine))


def magnification(vdi: VDI, camera: Any, window_size: Sequence[int] | None = None) -> float:
    """Return how many pixels of a view's picture are as wide as one list.

    It grows as one zooms in: above 1 the picture asks for more detail than the lists have across
    the rays of the generating view. ``window_size`` is the picture's, by default the VDI's own. The
    widths are square roots of what a pixel and a list cover, in the model frame, at the middle of
    the view depths that the bounds have in front of the eye; 0 where they lie behind that of the
    view, infinite where they lay behind that of the generating view.
    """
    size = check_window_size(vdi.window_size if window_size is None else window_size)
    pixel = _pixel_width(Camera.from_any(camera), size, vdi.bounds)
    width = _pixel_width(vdi.camera, vdi.window_size, vdi.bounds)
    return 0.0 if pixel == math.inf else width / pixel


def world_centre(camera: Camera, bounds: Sequence[float]) -> Floats:
    """Return the centre of bounds in the model frame, world coordinates."""
    matrix = camera.model_transform
    low, high = np.asarray(bounds)[::2], np.asarray(bounds)[1::2]
    return np.asarray(matrix[:3, :3] @ (low / 2 + high / 2) + matrix[:3, 3])


def eye_from_centre(
    camera: Camera, bounds: Sequence[float], shown: ArrayLike
) -> tuple[Floats, float]:
    """Return in which direction the eye stands from the centre of the bounds, and how far.

    A unit vector and a length, of the model frame as the matrix ``shown`` (3, 3) shows it. In
    parallel projection, and of an eye at the centre, they are of the vector against the view.

    Raises InvalidCameraError if float64 cannot hold the vector.
    """
    to_world = camera.model_transform[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):
        offset = np.asarray(camera.position) - world_centre(camera, bounds)
        vector = np.linalg.solve(to_world, offset)
        diagonal = math.hypot(*np.diff(np.reshape(bounds, (3, 2))).ravel())
        if camera.parallel_projection or math.hypot(*vector) <= _AT_CENTRE * diagonal:
            vector = np.linalg.solve(to_world, -camera.axes[2])
        vector = np.asarray(shown) @ vector
    length = math.hypot(*vector)  # squares may overflow
    if not 0 < length < math.inf:
        raise InvalidCameraError(
            f"an eye at {camera.position} is {length} from the centre of the bounds "
            f"{tuple(bounds)}, which has no direction in float64: move it"
        )
    return vector / length, length


def _pixel_width(camera: Camera, size: tuple[int, int], bounds: Sequence[float]) -> float:
    """Root of what a pixel covers at mid-depth, model units; infinite behind the eye."""
    pixel_rays = rays.pixel_rays(camera, size, bounds)
    near, far = pixel_rays.reference_depth, pixel_rays.depths[1]
    if not camera.parallel_projection and far <= 0:
        return math.inf
    t = (near + far) / 2 - near
    _, across, up = pixel_rays.origin + t * pixel_rays.direction
    return math.sqrt(float(np.linalg.norm(np.cross(across, up))))


# Tiles of a picture, and what their SSIM says of the whole's


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

    def infer(self, ssim: Floats) -> float:
        """Return the SSIM of the whole picture from the tiles'."""
        losses, guess = (1.0 - ssim) / self.chances, self.guess / self.chances
        ratio = losses.sum() / guess.sum() if guess.any() else 0.0
        total = losses.sum() + ratio * (self.guessed - guess.sum())
        return float(1.0 - self.share * total)


def tiles_ssim(
    old: Sequence[Picture], new: Sequence[Picture], background: Sequence[float] = (0.0, 0.0, 0.0)
) -> Floats:
    """Return the mean SSIM of the inner pixels of pairs of tiles of one size, float64 (k,)."""
    from skimage.metrics import structural_similarity  # loads SciPy

    # One above the other: a call for each would take five times as long
    pair = (over_background(np.concatenate(tiles), background) for tiles in (old, new))
    _, ssim = structural_similarity(*pair, full=True, **SSIM_ARGUMENTS)
    inner = slice(REACH, -REACH)
    by_tile = ssim.reshape(len(new), *new[0].shape[:2], 3)[:, inner, inner]
    return np.asarray(by_tile.mean(axis=(1, 2, 3)))


class Cells:
    """A rectangle of a window cut into cells, each the part of a tile whose SSIM the tile tells.

    ``corners``: int64 (n, 2), column and row of each **tile's** first pixel, along a space-filling
    curve. ``tile_size``: width and height of a tile, pixels.
    """

    def __init__(self, first: Pair, extent: Pair, size: Pair, edge: int) -> None:
        self._first, self._size = first, size
        self._edges = [min(edge, s - 2 * REACH) for s in size]
        axes = zip(first, extent, self._edges, size, strict=True)
        columns, rows = self._starts = [_cell_starts(f, n, e, s - REACH) for f, n, e, s in axes]
        self._order = _along_curve(len(columns), len(rows))
        column, row = self._order.T
        self.corners = np.stack([columns[column], rows[row]], axis=1) - REACH
        self.tile_size = (self._edges[0] + 2 * REACH, self._edges[1] + 2 * REACH)
        self.area = math.prod(max(n, e) for n, e in zip(extent, self._edges, strict=True))

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
        share = self.area / n / math.prod(edge - 2 * REACH for edge in self._size)
        of = (chances[chosen], guess[chosen], float(guess.sum()))
        return TileSample(self.corners[chosen], self.tile_size, *of, share)

    def _averages(self, coarse: Floats) -> Floats:
        """Mean over each cell of values at coarse pixels of the region, float64 (n,)."""
        # Find the shares of coarse pixels in cells along each axis; those of a cell add up to 1
        shares = []
        axes = zip(self._starts, self._edges, self._first, coarse.shape[::-1], strict=True)
        for starts, edge, first, count in axes:
            begin = first + COARSE * np.arange(count)
            low = np.maximum(begin[None], starts[:, None])
            high = np.minimum(begin[None] + COARSE, starts[:, None] + edge)
            share = np.maximum(high - low, 0.0)
            shares.append(share / share.sum(axis=1, keepdims=True))
        (across, down), (column, row) = shares, self._order.T
        return np.asarray((down @ coarse @ across.T)[row, column])


def seen_region(
    camera: Camera, size: Pair, boxes: Sequence[Sequence[float]]
) -> tuple[Pair, Pair] | None:
    """Return the rectangle of pixels whose SSIM the boxes can change: its first, and how many.

    The whole picture where a box reaches behind the eye, but for the five pixels along its border,
    of which no SSIM is told; ``None`` if there are none.
    """
    corners = np.concatenate([bounds_corners(box) for box in boxes])
    points = np.column_stack([corners, np.ones(len(corners))]) @ camera.model_to_view.T
    depth = points[:, 2]
    if not camera.parallel_projection and depth.max() <= 0:
        return None
    first, last = np.zeros(2), np.array(size, np.float64)
    if camera.parallel_projection or depth.min() > rays.NEAREST_DEPTH * depth.max():
        viewport = points @ camera.viewport_matrix(size).T
        pixels = (viewport[:, :2] / viewport[:, 3:] * (1, -1) + 1) / 2 * size
        first, last = np.floor(pixels.min(axis=0)), np.ceil(pixels.max(axis=0))
    low = np.clip(first - REACH, REACH, np.subtract(size, REACH)).astype(int)
    high = np.clip(last + REACH, REACH, np.subtract(size, REACH)).astype(int)
    if (high <= low).any():
        return None
    (left, top), (width, height) = low.tolist(), (high - low).tolist()
    return (left, top), (width, height)


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
    across = np.abs(np.diff(picture, axis=1)).max(axis=2)
    down = np.abs(np.diff(picture, axis=0)).max(axis=2)
    beside = (across, ((0, 0), (0, 1))), (across, ((0, 0), (1, 0)))
    above = (down, ((0, 1), (0, 0))), (down, ((1, 0), (0, 0)))
    return np.asarray(np.max([np.pad(step, by) for step, by in (*beside, *above)], axis=0))
