"""How far a VDI's picture of a view is from the volume's own, without rendering either whole.

A few small tiles of the picture are rendered both ways, and the SSIM of the whole is inferred
from theirs. A pair of coarse pictures guesses where it is lost: there tiles are likelier (sampling
with unequal probabilities), and what they tell scales the guess for the rest of the picture.
docs/regeneration.md says how well that predicts.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import Cancelled, InvalidArgumentError, InvalidCameraError
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import as_whole
from pyvista_vdi.model.metrics import SSIM_WINDOW, over_background
from pyvista_vdi.model.options import MediumOptions
from pyvista_vdi.model.render_options import FrameRequest, RenderOptions
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.quality.tiles import (
    COARSE,
    REACH,
    Cells,
    Floats,
    Region,
    TileSample,
    contrast_ratio,
    seen_region,
    tiles_ssim,
)
from pyvista_vdi.raycasting.raycast import render_vdi
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.render import picture_room, raycast_medium

Pause: TypeAlias = Callable[[], object]

#: Tiles of an estimate, and their edge in pixels: docs/regeneration.md.
TILES = 16
TILE_SIZE = 24

#: Most pixels of a coarse picture in one launch: a frame may have to wait for its end.
_COARSE_LAUNCH = 8192
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
    contrast : float
        Of the VDI's picture within blocks of 4 x 4 pixels, over the volume's, in those tiles: below
        1 where detail is missing, which SSIM hardly tells.
    """

    ssim: float
    standard_error: float
    angle: float
    magnification: float
    tiles: int
    contrast: float = 1.0


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
    shown = vdi.camera.model_transform[:3, :3]
    old, new = (
        eye_from_centre(view, vdi.bounds, shown)[0]
        for view in (vdi.camera, Camera.from_any(camera))
    )
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


class ViewErrorEstimator:
    """Estimates the error of VDIs of one volume; keeps the volume on the device.

    Parameters
    ----------
    volume : Volume
        What the VDIs stand for.
    transfer_function : TransferFunction
        How it is to look.
    medium : MediumOptions, optional
        How the volume is sampled: as it was when the VDIs were generated, but for the lights,
        which are those of the view that is judged.
    tiles : int
        Tiles of an estimate, at least 2. All there are, if that is fewer.
    tile_size : int
        Edge of a tile in pixels, at least 11. What SSIM compares around a pixel reaches five
        pixels to each side, so a tile of 24 tells the SSIM of 14 x 14 pixels.
    device : optional
        See :func:`pyvista_vdi.list_devices`.
    **changes
        Options by name, in place of those in ``medium``: sample_distance, lights,
        ambient_occlusion, memory_limit; see :class:`~pyvista_vdi.model.options.MediumOptions`.

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
        medium: MediumOptions | None = None,
        *,
        tiles: int = TILES,
        tile_size: int = TILE_SIZE,
        device: Any = None,
        **changes: Any,
    ) -> None:
        options = MediumOptions.of(medium, changes)
        self._tiles = _whole("tiles", tiles, 2)
        self._edge = _whole("tile_size", tile_size, SSIM_WINDOW) - 2 * REACH
        self._runtime = get_runtime(device)
        edge = max(int(tile_size), math.isqrt(2 * _COARSE_LAUNCH))  # of what is rendered at a time
        room = picture_room((edge, edge), options.memory_limit)
        self._medium = DeviceVolume(self._runtime, volume, transfer_function, options, room=room)

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
        shown = RenderOptions(clipping_planes, cropping, opacity_multiplier)
        depth = _of_window("opaque_depth", opaque_depth, size[::-1])
        request = FrameRequest(camera, size, shown, depth, self._runtime)
        picture = _of_window("picture", picture, (*size[::-1], 4))
        pair = _PicturePair(self._medium, vdi, request, picture, background, pause)
        where = (angle_from_generating_view(vdi, camera), magnification(vdi, camera, size))
        if min(size) < SSIM_WINDOW:
            return ViewError(math.nan, math.nan, *where, 0)
        tiles = self._sample(pair)
        if tiles is None:
            return ViewError(1.0, 0.0, *where, 0)
        old, new = pair.tiles(tiles)
        ssim = tiles_ssim(old, new, background)
        contrast = contrast_ratio(old, new, 1 / tiles.chances, background)
        return ViewError(*tiles.infer(ssim), *where, len(ssim), contrast)

    def sample(self, vdi: VDI, camera: Camera, window_size: tuple[int, int]) -> TileSample | None:
        """Choose the tiles of a view, by a VDI that shows roughly where the error is.

        It may have fewer lists than the VDI that is to be judged. Returns None where the volume is
        not in view; both edges of the window have at least 11 pixels.
        """
        request = FrameRequest(camera, window_size, device=self._runtime)
        return self._sample(_PicturePair(self._medium, vdi, request))

    def volume_tile(
        self,
        lens: Camera,
        tile_size: tuple[int, int],
        shown: RenderOptions | None = None,
        *,
        lit_from: Camera | None = None,
    ) -> NDArray[np.float32]:
        """Return the volume's picture through the lens of a tile, lit as seen from a view."""
        frame = FrameRequest(lens, tile_size, shown or RenderOptions())
        return raycast_medium(self._medium, frame, lit_from=lit_from)

    def _sample(self, pair: "_PicturePair") -> TileSample | None:
        camera, size = pair.request.camera, pair.request.size
        region = seen_region(camera, size, (pair.vdi.bounds, self._medium.volume.bounds))
        if region is None:
            return None
        cells = Cells(region, size, self._edge)
        n = len(cells.corners)
        guess = cells.guess(*pair.coarse(region)) if n > self._tiles else np.ones(n)
        return cells.sample(guess, self._tiles)


@dataclass(frozen=True, eq=False)
class _PicturePair:
    """One view of VDI and volume, of which parts are rendered."""

    medium: DeviceVolume
    vdi: VDI
    request: FrameRequest  # of the whole view
    picture: NDArray[Any] | None = None
    background: Sequence[float] = (0.0, 0.0, 0.0)
    pause: Pause | None = None

    def coarse(self, region: Region) -> tuple[Floats, Floats]:
        """Return coarse pictures of a region by VDI and volume, float64 (rows, columns, 3)."""
        columns, rows = (-(-extent // COARSE) for extent in region.extent)
        left, top = region.first
        # The last may lie beyond the window, which has no depth and no picture there
        across, down = (
            np.minimum(first + COARSE * np.arange(n) + COARSE // 2, edge - 1)
            for first, n, edge in zip(region.first, (columns, rows), self.request.size, strict=True)
        )
        bands = []
        band = max(1, _COARSE_LAUNCH // columns)
        for row in range(0, rows, band):
            n = min(band, rows - row)
            corner = (left, top + row * COARSE)
            lens = self.request.camera.tile(
                self.request.size, corner, (columns * COARSE, n * COARSE)
            )
            part = np.ix_(down[row : row + n], across)
            bands.append(self._both(lens, (columns, n), part))
        old, new = (
            over_background(np.concatenate(band), self.background)
            for band in zip(*bands, strict=True)
        )
        return old, new

    def tiles(self, sample: TileSample) -> tuple[list[Any], list[Any]]:
        """Return each tile's pictures by VDI and volume, float32 (height, width, 4)."""
        width, height = sample.size
        pairs = []
        for column, row in sample.corners.tolist():
            lens = self.request.camera.tile(self.request.size, (column, row), sample.size)
            part = np.s_[row : row + height, column : column + width]
            pairs.append(self._both(lens, sample.size, part))
        old, new = zip(*pairs, strict=True)
        return list(old), list(new)

    def _both(
        self, lens: Camera, size: tuple[int, int], part: Any
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """The pixels ``part`` of the window, seen through ``lens``, by VDI and volume."""
        depth: Any = self.request.opaque_depth
        request = self.request.replace(
            camera=lens, size=size, opaque_depth=None if depth is None else depth[part]
        )
        if self.picture is not None:
            of_vdi = self.picture[part]
        else:
            self._wait()
            of_vdi = render_vdi(self.vdi, request)
        self._wait()
        return of_vdi, raycast_medium(self.medium, request)

    def _wait(self) -> None:
        if self.pause is not None and self.pause() is False:
            raise Cancelled("the estimate of a view's error was cancelled")


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
    near, far = rays.depth_range(camera, bounds)
    if not camera.parallel_projection:
        near = max(near, 0.0)
        if far <= 0:
            return math.inf
    pixel_rays = rays.pixel_rays(camera, size, bounds)
    t = (near + far) / 2 - pixel_rays.reference_depth
    _, across, up = pixel_rays.origin + t * pixel_rays.direction
    return math.sqrt(float(np.linalg.norm(np.cross(across, up))))


def _of_window(name: str, values: ArrayLike | None, shape: tuple[int, ...]) -> NDArray[Any] | None:
    if values is None:
        return None
    array = np.asarray(values)
    if array.shape != shape:
        raise InvalidArgumentError(f"{name} must have shape {shape}; got {array.shape}")
    return array


def _whole(name: str, value: Any, least: int) -> int:
    number = as_whole(value)
    if not number >= least:
        raise InvalidArgumentError(f"{name} must be a whole number from {least} on; got {value!r}")
    return int(number)
