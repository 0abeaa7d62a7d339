"""How far a VDI's picture of a view is from the volume's own, without rendering either whole.

A few small tiles of the picture are rendered both ways, and the SSIM of the whole is inferred
from theirs. A pair of coarse pictures guesses where it is lost: there tiles are likelier (sampling
with unequal probabilities), and what they tell scales the guess for the rest of the picture.
docs/regeneration.md says how well that predicts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import rays
from .ambient_occlusion import AmbientOcclusion
from .camera import Camera, check_window_size
from .checks import as_float, memory_limit_bytes
from .cropping import Cropping, checked_opacity_multiplier
from .device_volume import DeviceVolume
from .errors import Cancelled, InvalidArgumentError
from .lighting import Lights
from .metrics import SSIM_ARGUMENTS, SSIM_WINDOW, over_background
from .opencl_runtime import get_runtime
from .raycast import render_vdi
from .raycast_volume import picture_room, raycast_medium
from .transfer_function import TransferFunction
from .vdi import VDI
from .volume import Volume

Floats: TypeAlias = NDArray[np.float64]
Pause: TypeAlias = Callable[[], object]

#: Tiles of an estimate, and their edge in pixels: benchmarks/view_error.py.
TILES = 16
TILE_SIZE = 24

#: Pixels that an SSIM window reaches to each side of its centre.
_REACH = SSIM_WINDOW // 2
#: Pixels of the picture along the edge of one pixel of the coarse pictures.
_COARSE = 5
#: Most pixels of a coarse picture in one launch, so that a frame does not wait long for its end.
_COARSE_LAUNCH = 2048
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
    """What is known of a VDI's error in a view.

    Parameters
    ----------
    ssim : float
        Predicted SSIM of the VDI's picture against the volume's, 1 for equal pictures; NaN where
        an edge of the window is below 11 pixels.
    standard_error : float
        Of ``ssim``, from how much the tiles differ from what was guessed.
    angle : float
        Degrees from V_O, see :func:`angle_from_generating_view`.
    magnification : float
        Pixels per list, see :func:`magnification`.
    tiles : int
        Tiles that were rendered; 0 where the volume is not in view.
    """

    ssim: float
    standard_error: float
    angle: float
    magnification: float
    tiles: int


def angle_from_generating_view(vdi: VDI, camera: Any) -> float:
    """Return by how much a view has turned about the VDI's model since it was generated.

    It is the angle between the directions from the centre of the bounds to the two eyes. Moving
    the eye towards the centre, turning it about its own place and moving the model along with the
    camera are no turn.

    Parameters
    ----------
    vdi : VDI
        Its camera is V_O, with the model transform of then.
    camera : Camera or vtkCamera or pyvista.Camera
        The new view V_N, with the model transform of now.

    Returns
    -------
    float
        Degrees, 0 to 180.

    Notes
    -----
    Both directions are taken to the model frame, each by its own camera's model transform, and
    compared as V_O's transform shows them: an actor that was scaled when the VDI was generated
    gives the angle that one sees. In parallel projection the eye is infinitely far against the
    direction of projection; that direction also stands in for an eye at the very centre.
    """
    old, new = (
        vdi.camera.model_transform[:3, :3] @ _towards_eye(view, vdi.bounds)
        for view in (vdi.camera, Camera.from_any(camera))
    )
    old, new = old / np.linalg.norm(old), new / np.linalg.norm(new)
    sine, cosine = np.linalg.norm(np.cross(old, new)), old @ new
    return math.degrees(math.atan2(sine, cosine))


def magnification(vdi: VDI, camera: Any, window_size: Sequence[int] | None = None) -> float:
    """Return how many pixels of a view's picture are as wide as one list.

    It grows as one zooms in. Above 1 the picture asks for more detail than the lists have across
    V_O's rays.

    Parameters
    ----------
    vdi : VDI
        Its camera and window give the lists' width.
    camera : Camera or vtkCamera or pyvista.Camera
        The new view V_N.
    window_size : (int, int), optional
        Width and height of its picture in pixels; by default the VDI's own.

    Returns
    -------
    float
        1 at V_O and the VDI's own window; 0 where the bounds lie behind the eye of V_N, infinite
        where they lay behind that of V_O.

    Notes
    -----
    The widths are square roots of what a pixel and a list cover, in the model frame, at the middle
    of the view depths that the bounds have in front of the eye.
    """
    size = check_window_size(vdi.window_size if window_size is None else window_size)
    pixel = _pixel_width(Camera.from_any(camera), size, vdi.bounds)
    width = _pixel_width(vdi.camera, vdi.window_size, vdi.bounds)
    if pixel == math.inf:
        return 0.0
    return width / pixel


def estimate_view_error(
    vdi: VDI,
    volume: Volume,
    transfer_function: TransferFunction,
    camera: Any,
    window_size: Sequence[int] | None = None,
    *,
    sample_distance: float | None = None,
    tiles: int = TILES,
    tile_size: int = TILE_SIZE,
    lights: Any = None,
    ambient_occlusion: Any = None,
    memory_limit: Any = None,
    device: Any = None,
    **options: Any,
) -> ViewError:
    """Estimate a VDI's error in one view; see :class:`ViewErrorEstimator` for several.

    Parameters
    ----------
    vdi : VDI
        What is judged.
    volume, transfer_function, sample_distance, tiles, tile_size
        As for :class:`ViewErrorEstimator`.
    lights, ambient_occlusion, memory_limit, device
        As for :class:`ViewErrorEstimator`.
    camera, window_size, **options
        As for :meth:`ViewErrorEstimator.estimate`.

    Returns
    -------
    ViewError
        The predicted SSIM, and where the view stands.
    """
    estimator = ViewErrorEstimator(
        volume,
        transfer_function,
        sample_distance=sample_distance,
        tiles=tiles,
        tile_size=tile_size,
        lights=lights,
        ambient_occlusion=ambient_occlusion,
        memory_limit=memory_limit,
        device=device,
    )
    return estimator.estimate(vdi, camera, window_size, **options)


class ViewErrorEstimator:
    """Estimates the error of VDIs of one volume; keeps the volume on the device.

    Parameters
    ----------
    volume : Volume
        What the VDIs stand for.
    transfer_function : TransferFunction
        How it is to look.
    sample_distance : float, optional
        Length of a step through the volume, model units; half the smallest spacing by default.
    tiles : int
        Tiles of an estimate, at least 2. All there are, if that is fewer.
    tile_size : int
        Edge of a tile in pixels, at least 11. What SSIM compares around a pixel reaches five
        pixels to each side, so a tile of 24 tells the SSIM of 14 x 14 pixels.
    lights : optional
        What a shaded volume is lit by in the view that is judged; see :meth:`Lights.from_any`.
    ambient_occlusion : optional
        What the VDIs were generated with; see :meth:`AmbientOcclusion.from_any`.
    memory_limit : int, float or str, optional
        Most bytes to take on the device, see :func:`~pyvista_vdi.generation.generate_vdi`.
    device : optional
        See :func:`pyvista_vdi.list_devices`.

    Raises
    ------
    InvalidArgumentError
        If a number is out of range.
    DeviceMemoryError
        If the volume does not fit.

    Notes
    -----
    The picture is cut into cells as large as what a tile tells, inside the rectangle around the
    bounds (elsewhere both pictures are empty, and SSIM is 1). Both pictures are rendered at a
    fifth of the pixels along each edge to guess each cell's loss, 1 - SSIM, up to a factor. A
    systematic sample with probabilities in proportion to the guess is taken along a space-filling
    curve through the cells [1]_. The factor is the ratio of what the tiles lost to what was
    guessed for them, each weighted by one over its probability (the ratio estimator, [2]_). The
    choice depends on the arguments alone, so that equal arguments give equal estimates.

    References
    ----------
    .. [1] W. G. Madow, "On the theory of systematic sampling, II", Annals of Mathematical
       Statistics 20(3), 1949.
    .. [2] C.-E. Särndal, B. Swensson, J. Wretman, "Model Assisted Survey Sampling", Springer 1992,
       section 5.6.
    """

    def __init__(
        self,
        volume: Volume,
        transfer_function: TransferFunction,
        *,
        sample_distance: float | None = None,
        tiles: int = TILES,
        tile_size: int = TILE_SIZE,
        lights: Any = None,
        ambient_occlusion: Any = None,
        memory_limit: Any = None,
        device: Any = None,
    ) -> None:
        self._tiles = _whole("tiles", tiles, 2)
        self._edge = _whole("tile_size", tile_size, SSIM_WINDOW) - 2 * _REACH
        self._runtime = get_runtime(device)
        edge = max(int(tile_size), math.isqrt(2 * _COARSE_LAUNCH))  # of what is rendered at a time
        self._medium = DeviceVolume(
            self._runtime,
            volume,
            transfer_function,
            sample_distance,
            lights=Lights.from_any(lights),
            ambient_occlusion=AmbientOcclusion.from_any(ambient_occlusion),
            room=picture_room((edge, edge), memory_limit_bytes(memory_limit)),
        )

    def estimate(
        self,
        vdi: VDI,
        camera: Any,
        window_size: Sequence[int] | None = None,
        *,
        picture: ArrayLike | None = None,
        opaque_depth: ArrayLike | None = None,
        clipping_planes: ArrayLike | None = None,
        cropping: Any = None,
        opacity_multiplier: float = 1.0,
        background: Sequence[float] = (0.0, 0.0, 0.0),
        pause: Pause | None = None,
    ) -> ViewError:
        """Estimate how similar the VDI's picture of a view is to the volume's.

        Parameters
        ----------
        vdi : VDI
            Of the same volume and look, or of former ones.
        camera : Camera or vtkCamera or pyvista.Camera
            The new view V_N; its ``model_transform`` says where volume and VDI are now.
        window_size : (int, int), optional
            Width and height of the whole picture in pixels; by default the VDI's own.
        picture : array_like of float32, shape (height, width, 4), optional
            What :func:`pyvista_vdi.render` returned for the same arguments, if it is at hand:
            then only the volume is rendered.
        opaque_depth : array_like of float, shape (height, width), optional
            As for :func:`pyvista_vdi.render`; both pictures end there.
        clipping_planes : array_like of float, shape (k, 6), optional
            As for :func:`pyvista_vdi.render`; both pictures are clipped.
        cropping, opacity_multiplier
            As for :func:`pyvista_vdi.render`; both pictures are cropped, and as dense.
        background : (float, float, float)
            RGB that both pictures are blended over before they are compared.
        pause : callable, optional
            Called before each launch, which is a tile or a few thousand pixels of a coarse
            picture. It may wait, to let frames pass; if it returns ``False`` the estimate ends.

        Returns
        -------
        ViewError
            The predicted SSIM, and where the view stands.

        Raises
        ------
        InvalidArgumentError
            If an argument cannot be used.
        Cancelled
            If ``pause`` returned ``False``.
        """
        camera = Camera.from_any(camera)
        size = check_window_size(vdi.window_size if window_size is None else window_size)
        scene = _Scene(
            self,
            vdi,
            camera,
            size,
            _of_window("picture", picture, (*size[::-1], 4)),
            _of_window("opaque_depth", opaque_depth, size[::-1]),
            {
                "clipping_planes": clipping_planes,
                "cropping": Cropping.from_any(cropping),
                "opacity_multiplier": checked_opacity_multiplier(opacity_multiplier),
            },
            background,
            pause,
        )
        where = (angle_from_generating_view(vdi, camera), magnification(vdi, camera, size))
        if min(size) < SSIM_WINDOW:
            return ViewError(math.nan, math.nan, *where, 0)
        tiles = self._sample(scene, vdi, camera, size)
        if tiles is None:
            return ViewError(1.0, 0.0, *where, 0)
        ssim = scene.tiles_ssim(tiles.corners, tiles.size)
        return ViewError(*tiles.infer(ssim), *where, len(ssim))

    def sample(self, vdi: VDI, camera: Camera, window_size: tuple[int, int]) -> TileSample | None:
        """Choose the tiles of a view, by a VDI that shows roughly where the error is.

        Parameters
        ----------
        vdi : VDI
            It may have fewer lists than the VDI that is to be judged.
        camera : Camera
            The new view V_N.
        window_size : (int, int)
            Width and height of the whole picture in pixels, at least 11 each.

        Returns
        -------
        TileSample or None
            ``None`` where the volume is not in view.
        """
        scene = _Scene(self, vdi, camera, window_size, None, None, {}, (0.0, 0.0, 0.0), None)
        return self._sample(scene, vdi, camera, window_size)

    def volume_tile(
        self, lens: Camera, tile_size: tuple[int, int], **options: Any
    ) -> NDArray[np.float32]:
        """Return the volume's picture through the lens of a tile.

        The options are those of :func:`~pyvista_vdi.raycast_volume.raycast_medium`.
        """
        return raycast_medium(self._runtime, self._medium, lens, tile_size, **options)

    def _sample(
        self, scene: _Scene, vdi: VDI, camera: Camera, size: tuple[int, int]
    ) -> TileSample | None:
        region = _region(camera, size, (vdi.bounds, self._medium.volume.bounds))
        if region is None:
            return None
        cells = _Cells(region, size, self._edge)
        n = len(cells.corners)
        guess = cells.guess(*scene.coarse(region)) if n > self._tiles else np.ones(n)
        chances = _chances(guess, min(self._tiles, n))
        chosen = _systematic(chances)
        return TileSample(
            cells.corners[chosen],
            cells.tile_size,
            chances[chosen],
            guess[chosen],
            float(guess.sum()),
            cells.area / n / math.prod(edge - 2 * _REACH for edge in size),
        )


@dataclass(frozen=True)
class TileSample:
    """Tiles of a picture, and how the SSIM of the whole follows from theirs.

    Attributes
    ----------
    corners : numpy.ndarray
        int64 (k, 2): column and row of each tile's first pixel, from the top left.
    size : (int, int)
        Width and height of a tile, pixels.
    chances, guess : numpy.ndarray
        float64 (k,): probability of each tile to be chosen, and its guessed loss.
    guessed : float
        Sum of the guesses for all cells of the picture.
    share : float
        Of the picture's pixels that have an SSIM, in one cell.
    """

    corners: NDArray[np.int64]
    size: tuple[int, int]
    chances: Floats
    guess: Floats
    guessed: float
    share: float

    def infer(self, ssim: Floats) -> tuple[float, float]:
        """Return the SSIM of the whole picture, and its standard error, from the tiles'."""
        total, error = _ratio_estimate(1.0 - ssim, self.chances, self.guess, self.guessed)
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
    inner = slice(_REACH, -_REACH)
    by_tile = ssim.reshape(len(new), height, width, 3)[:, inner, inner]
    return np.asarray(by_tile.mean(axis=(1, 2, 3)))


class _Scene:
    """One view of both, of which parts are rendered."""

    def __init__(
        self,
        estimator: ViewErrorEstimator,
        vdi: VDI,
        camera: Camera,
        size: tuple[int, int],
        picture: NDArray[Any] | None,
        opaque_depth: NDArray[Any] | None,
        shown: dict[str, Any],
        background: Sequence[float],
        pause: Pause | None,
    ) -> None:
        self._runtime = estimator._runtime
        self._medium = estimator._medium
        self._vdi = vdi
        self._camera = camera
        self._size = size
        self._picture = picture
        self._opaque_depth = opaque_depth
        self._shown = shown  # what both pictures leave out, or show otherwise
        self._background = background
        self._pause = pause

    def coarse(self, region: _Region) -> tuple[Floats, Floats]:
        """Return coarse pictures of a region by VDI and volume, float64 (rows, columns, 3)."""
        columns, rows = (-(-extent // _COARSE) for extent in region.extent)
        left, top = region.first
        # The last may lie beyond the window, which has no depth and no picture there
        across, down = (
            np.minimum(first + _COARSE * np.arange(n) + _COARSE // 2, edge - 1)
            for first, n, edge in zip(region.first, (columns, rows), self._size, strict=True)
        )
        bands = []
        band = max(1, _COARSE_LAUNCH // columns)
        for row in range(0, rows, band):
            n = min(band, rows - row)
            corner = (left, top + row * _COARSE)
            lens = self._camera.tile(self._size, corner, (columns * _COARSE, n * _COARSE))
            part = np.ix_(down[row : row + n], across)
            bands.append(self._both(lens, (columns, n), part))
        old, new = (self._blended(np.concatenate(b)) for b in zip(*bands, strict=True))
        return old, new

    def tiles_ssim(self, corners: NDArray[np.int64], tile_size: tuple[int, int]) -> Floats:
        """Return the mean SSIM of each tile's inner pixels, float64 (n,)."""
        width, height = tile_size
        pairs = []
        for column, row in corners.tolist():
            lens = self._camera.tile(self._size, (column, row), tile_size)
            part = np.s_[row : row + height, column : column + width]
            pairs.append(self._both(lens, tile_size, part))
        old, new = zip(*pairs, strict=True)
        return tiles_ssim(old, new, self._background)

    def _both(
        self, lens: Camera, size: tuple[int, int], part: Any
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """The pixels ``part`` of the window, seen through ``lens``, by VDI and volume."""
        depth = None if self._opaque_depth is None else self._opaque_depth[part]
        if self._picture is not None:
            of_vdi = self._picture[part]
        else:
            self._wait()
            of_vdi = render_vdi(
                self._vdi,
                lens,
                size,
                opaque_depth=depth,
                device=self._runtime,
                **self._shown,
            )
        self._wait()
        of_volume = raycast_medium(
            self._runtime,
            self._medium,
            lens,
            size,
            opaque_depth=depth,
            **self._shown,
        )
        return of_vdi, of_volume

    def _wait(self) -> None:
        if self._pause is not None and self._pause() is False:
            raise Cancelled("the estimate of a view's error was cancelled")

    def _blended(self, picture: NDArray[np.float32]) -> Floats:
        return over_background(picture, self._background)


@dataclass(frozen=True)
class _Region:
    """A rectangle of pixels: first column and row from the top left, and how many."""

    first: tuple[int, int]
    extent: tuple[int, int]


class _Cells:
    """A region cut into cells, each the part of a tile whose SSIM the tile tells.

    Parameters
    ----------
    region : _Region
        What they cover.
    size : (int, int)
        The window, pixels.
    edge : int
        Of a cell, pixels; less where the window has fewer.

    Attributes
    ----------
    corners : numpy.ndarray
        int64 (n, 2), column and row of each **tile's** first pixel, along a space-filling curve.
    tile_size : (int, int)
        Width and height of a tile, pixels.
    area : int
        Pixels that the cells cover together.
    """

    def __init__(self, region: _Region, size: tuple[int, int], edge: int) -> None:
        self._region = region
        self._edges = [min(edge, s - 2 * _REACH) for s in size]
        self._starts = [
            _cell_starts(first, extent, e, s - _REACH)
            for first, extent, e, s in zip(
                region.first, region.extent, self._edges, size, strict=True
            )
        ]
        columns, rows = self._starts
        self._order = _along_curve(len(columns), len(rows))
        column, row = self._order.T
        self.corners = np.stack([columns[column], rows[row]], axis=1) - _REACH
        self.tile_size = (self._edges[0] + 2 * _REACH, self._edges[1] + 2 * _REACH)
        self.area = math.prod(max(n, e) for n, e in zip(region.extent, self._edges, strict=True))

    def guess(self, old: Floats, new: Floats) -> Floats:
        """Guess each cell's loss, up to a factor, from coarse pictures of the region.

        The loss of the coarse pictures' own SSIM, and the root of the detail that is to be seen:
        contrast between neighbours in either picture, and the pictures' difference.
        """
        contrast = np.maximum(_contrast(old), _contrast(new))
        detail = contrast + _DIFFERENCE_WEIGHT * np.abs(old - new).max(axis=2)
        return np.asarray(self._averages(_coarse_loss(old, new)) + np.sqrt(self._averages(detail)))

    def _averages(self, coarse: Floats) -> Floats:
        """Mean over each cell of values at coarse pixels of the region, float64 (n,)."""
        across, down = (
            _overlaps(*along)
            for along in zip(
                self._starts, self._edges, self._region.first, coarse.shape[::-1], strict=True
            )
        )
        column, row = self._order.T
        return np.asarray((down @ coarse @ across.T)[row, column])


def _towards_eye(camera: Camera, bounds: Sequence[float]) -> Floats:
    """Direction in which the eye stands, seen from the centre of the bounds; model frame."""
    matrix = camera.model_transform
    low, high = np.asarray(bounds)[::2], np.asarray(bounds)[1::2]
    centre = matrix[:3, :3] @ ((low + high) / 2) + matrix[:3, 3]
    direction = np.linalg.solve(matrix[:3, :3], np.asarray(camera.position) - centre)
    at_centre = np.linalg.norm(direction) <= _AT_CENTRE * np.linalg.norm(high - low)
    if camera.parallel_projection or at_centre:
        direction = np.linalg.solve(matrix[:3, :3], -camera.axes[2])
    return np.asarray(direction)


def _pixel_width(camera: Camera, size: tuple[int, int], bounds: Sequence[float]) -> float:
    """Root of what a pixel covers at mid-depth, model units; infinite behind the eye."""
    near, far = rays.depth_range(camera, bounds)
    if not camera.parallel_projection:
        near = max(near, 0.0)
        if far <= 0:
            return math.inf
    pixel_rays = rays.pixel_rays(camera, size, bounds)
    t = (near + far) / 2 - pixel_rays.reference_depth
    _, across, up = pixel_rays.origin + t * pixel_rays.direction
    return math.sqrt(float(np.linalg.norm(np.cross(across, up))))


def _region(
    camera: Camera, size: tuple[int, int], boxes: Sequence[Sequence[float]]
) -> _Region | None:
    """Pixels whose SSIM the boxes can change; None if there are none.

    The whole picture where a box reaches behind the eye. SSIM is not told within five pixels of
    the picture's border.
    """
    corners = np.concatenate([rays.corners(box) for box in boxes])
    points = np.column_stack([corners, np.ones(len(corners))]) @ camera.model_to_view.T
    depth = points[:, 2]
    if not camera.parallel_projection and depth.max() <= 0:
        return None
    edges = np.asarray(size)
    first, last = np.zeros(2), edges.astype(np.float64)
    if camera.parallel_projection or depth.min() > rays.NEAREST_DEPTH * depth.max():
        viewport = points @ camera.viewport_matrix(size).T
        u, v = viewport[:, :2].T / viewport[:, 3]
        pixels = (np.stack([u, -v], axis=1) + 1) / 2 * edges
        first, last = np.floor(pixels.min(axis=0)), np.ceil(pixels.max(axis=0))
    low = np.clip(first - _REACH, _REACH, edges - _REACH).astype(int)
    high = np.clip(last + _REACH, _REACH, edges - _REACH).astype(int)
    if (high <= low).any():
        return None
    width, height = (high - low).tolist()
    left, top = low.tolist()
    return _Region((left, top), (width, height))


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


def _overlaps(starts: NDArray[np.int64], edge: int, first: int, count: int) -> Floats:
    """Shares of coarse pixels in cells along one axis, float64 (cells, count), rows sum to 1."""
    begin = first + _COARSE * np.arange(count)
    low = np.maximum(begin[None], starts[:, None])
    high = np.minimum(begin[None] + _COARSE, starts[:, None] + edge)
    share = np.maximum(high - low, 0.0)
    return np.asarray(share / share.sum(axis=1, keepdims=True))


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


def _coarse_loss(old: Floats, new: Floats) -> Floats:
    """1 - SSIM around each coarse pixel, float64 (rows, columns); 0 where there are too few."""
    from skimage.metrics import structural_similarity  # loads SciPy

    if min(old.shape[:2]) < _COARSE_WINDOW:
        return np.zeros(old.shape[:2])
    _, ssim = structural_similarity(old, new, full=True, **_COARSE_SSIM)
    # SSIM is never above 1, but for rounding
    return np.asarray(np.maximum(1.0 - ssim.mean(axis=2), 0.0))


def _chances(guess: Floats, tiles: int) -> Floats:
    """Probability of each cell to be chosen, float64 (n,), that add up to ``tiles``."""
    mean = guess.mean()
    weight = _EVEN_SHARE + (1 - _EVEN_SHARE) * guess / mean if mean > 0 else np.ones(len(guess))
    chances = np.ones(len(guess))
    certain = np.zeros(len(guess), dtype=bool)  # to be chosen
    while not certain.all():
        left = tiles - np.count_nonzero(certain)
        chances[~certain] = left * weight[~certain] / weight[~certain].sum()
        beyond = ~certain & (chances >= 1)
        if not beyond.any():
            break
        chances[beyond] = 1.0
        certain |= beyond
    return chances


def _systematic(chances: Floats) -> NDArray[np.int64]:
    """Indices of a systematic sample, as many as the chances add up to (Madow 1949)."""
    turns = np.floor(np.concatenate([[0.0], np.cumsum(chances)]) + 0.5)
    return np.flatnonzero(np.diff(turns) > 0)


def _ratio_estimate(
    losses: Floats, chances: Floats, guess: Floats, guessed: float
) -> tuple[float, float]:
    """Total loss of all cells, and its standard error, from those that were chosen.

    Parameters
    ----------
    losses, chances, guess : numpy.ndarray
        Of the chosen cells, float64 (k,).
    guessed : float
        Sum of the guesses for all cells.
    """
    seen, expected = float((losses / chances).sum()), float((guess / chances).sum())
    ratio = seen / expected if expected > 0 else 0.0
    residuals = (losses - ratio * guess) / chances
    n = len(losses)
    variance = n / max(1, n - 1) * float(((1 - chances) * residuals**2).sum())
    return seen + ratio * (guessed - expected), math.sqrt(variance)


def _of_window(name: str, values: ArrayLike | None, shape: tuple[int, ...]) -> NDArray[Any] | None:
    if values is None:
        return None
    array = np.asarray(values)
    if array.shape != shape:
        raise InvalidArgumentError(f"{name} must have shape {shape}; got {array.shape}")
    return array


def _whole(name: str, value: Any, least: int) -> int:
    number = as_float(value)
    if not (number >= least and number % 1 == 0):
        raise InvalidArgumentError(f"{name} must be a whole number from {least} on; got {value!r}")
    return int(number)
