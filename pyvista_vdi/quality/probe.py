"""The short measurement of a scene by which settings are chosen for a quality target."""

import hashlib
import math
import threading
import time
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi import registry
from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import Cancelled, InvalidArgumentError, UnsupportedError
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.coverage import bounds_corners
from pyvista_vdi.model.metrics import SSIM_WINDOW, ListEdges, list_edges, list_places
from pyvista_vdi.model.options import GenerationRequest, QualityTarget
from pyvista_vdi.model.render_options import FrameRequest, RenderOptions
from pyvista_vdi.model.types import ClientLike, Progress
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.dial import (
    DENSE,
    LADDER,
    ROUGH,
    SPARSE,
    Choice,
    Measurement,
    Setting,
    bytes_of,
    chosen,
    predictions,
    refuse_settings,
)
from pyvista_vdi.quality.tiles import REACH, TileSample, tiles_ssim, window_pixels
from pyvista_vdi.quality.view_error import ViewErrorEstimator, world_centre
from pyvista_vdi.raycasting.raycast import render_vdi


def generate_anywhere(
    request: GenerationRequest, target: QualityTarget, client: ClientLike | None = None
) -> VDI:
    """Generate a VDI of a volume in memory, or of a chunked one in blocks, here or by workers.

    A target takes of a store the level that the view requires, and loads it. Errors are those of
    :func:`pyvista_vdi.generate`.
    """
    name = request.volume.name
    if request.volume.chunked:
        if target and client is not None:
            raise UnsupportedError(
                "quality, target_ssim, full_fps and max_bytes measure the scene on this "
                f"machine, and {name!r} is left to a client: give max_supersegments, or leave "
                "client out"
            )
        if target:  # which takes many looks at the whole
            view, size = request.camera, request.window_size
            loaded = request.volume.load_in_view(view, window_size=size)
            return generate_anywhere(request.replace(volume=loaded), target)
        return registry.generator("blocks")(request, client)  # type: ignore[no-any-return]
    if client is not None:
        raise InvalidArgumentError(
            f"client is for chunked volumes, and {name!r} is in memory: give a Volume of a "
            "Dask array (dask.array.from_array), or leave client out"
        )
    if not target:
        return generate_vdi(request)
    from pyvista_vdi.quality.probe import generate_to_target

    return generate_to_target(request, target)


#: Tiles that are measured, and their edge in pixels: docs/decisions/dial.md.
TILES = 9
TILE_SIZE = 32

#: What generating and rendering the part of a VDI for one tile costs beyond its lists, in lists.
_PART_OVERHEAD = 8000
#: Frames of the rough VDI that are timed; the shortest counts.
_FRAMES = 2
#: The share of the work that measuring is taken for, and the parts that it reports.
_MEASURING, _PARTS = 0.5, 4
#: Scenes that are remembered.
_REMEMBERED = 32

_measurements: OrderedDict[Any, Measurement] = OrderedDict()
_lock = threading.Lock()


def generate_to_target(request: GenerationRequest, target: QualityTarget) -> VDI:
    """Make a VDI by the settings that are chosen for a target.

    The window of the request is that of the pictures, and the VDI's metadata say what was chosen;
    where it has more bytes than the target allows, by how much more is known then, and another is
    made. Errors are those of :func:`~pyvista_vdi.generation.generate.generate_vdi` and of
    :func:`choose`.
    """
    progress, limit, overrun = request.progress, target.max_bytes or math.inf, 1.0
    while True:
        choice = choose(request.replace(progress=_counted(progress)), target, overrun)
        expected = choice.prediction.nbytes
        vdi = generate_vdi(
            request.replace(
                window_size=choice.prediction.window_size,
                options=choice.prediction.setting.applied_to(request.options),
                progress=_rest(progress),
                metadata={**request.metadata, "dial": choice.to_dict()},
            )
        )
        if bytes_of(vdi) <= limit or expected > limit:  # that is said
            return vdi
        overrun *= bytes_of(vdi) / expected


def _counted(progress: Progress | None) -> Progress | None:
    """Return what reports parts of a measurement as parts of the whole work."""
    if progress is None:
        return None
    parts = count()
    return lambda _: progress(_MEASURING * min(1.0, next(parts) / _PARTS))


def _rest(progress: Progress | None) -> Progress | None:
    """Return what reports a generation as the rest of the work, behind the measurement."""
    if progress is None:
        return None
    return lambda fraction: progress(_MEASURING + (1 - _MEASURING) * fraction)


def choose(request: GenerationRequest, target: QualityTarget, overrun: float = 1.0) -> Choice:
    """Choose how a VDI is to be made.

    Parameters
    ----------
    request : GenerationRequest
        What is asked for. Its window is that of the pictures, and max_supersegments, tolerance and
        precision, which are chosen, must have their defaults. Its ``progress`` is called with 0
        between the parts of the measurement.
    target : QualityTarget
        What is to be reached.
    overrun : float
        Bytes that a VDI of this scene has been seen to take, over those predicted.

    Returns
    -------
    Choice
        The first rung of the ladder that reaches the goal, and no rung above the limits. Without
        a goal, the best within the limits.

    Raises
    ------
    InvalidArgumentError
        If the window is too small for an SSIM, or another argument cannot be used.
    Cancelled
        If ``progress`` returned False.
    """
    refuse_settings(target, request.options)
    size = request.window_size
    if min(size) < SSIM_WINDOW:
        raise InvalidArgumentError(
            f"a window of {size[0]} x {size[1]} pixels has no SSIM to choose settings by: it "
            f"takes {SSIM_WINDOW} along each edge; choose max_supersegments and window yourself"
        )
    measured = _measurement(Probe(request, target.target_angle))
    ladder = [
        replace(rung, nbytes=math.ceil(overrun * rung.nbytes))
        for rung in predictions(measured, size)
    ]
    return chosen(target, ladder, size, measured.least)


def forget() -> None:
    """Forget all measurements, so that the next choice measures anew."""
    with _lock:
        _measurements.clear()


def _measurement(probe: "Probe") -> Measurement:
    """Return what was measured of a scene before, or measure it."""
    key = probe.key
    with _lock:
        known = _measurements.get(key)
        if known is not None:
            _measurements.move_to_end(key)
            return known
    measured = probe.measure()
    with _lock:
        _measurements[key] = measured
        while len(_measurements) > _REMEMBERED:
            _measurements.popitem(last=False)
    return measured


class Probe:
    """A short measurement: of what is asked for, seen from a view that is turned by an angle."""

    def __init__(self, request: GenerationRequest, angle: float) -> None:
        self._request = request.replace(device=get_runtime(request.device))
        self._angle = angle
        self._volume, self._camera = request.volume, request.camera
        self._size, self._runtime = request.window_size, get_runtime(request.device)
        self._view = turned(request.camera, request.volume.bounds, angle)

    @property
    def key(self) -> Any:
        """Equal where a measurement would be equal, but for times."""
        volume, request = self._volume, self._request
        return (
            hashlib.blake2b(np.ascontiguousarray(volume.array).data, digest_size=16).digest(),
            (volume.array.shape, volume.array.dtype.str),
            (volume.spacing, volume.origin, np.asarray(volume.direction).tobytes()),
            (self._camera, self._size, request.transfer_function, self._angle),
            request.options,
            self._runtime.info.index,
        )

    def measure(self) -> Measurement:
        """Measure losses, lengths of lists and the time of a frame."""
        self._go_on()
        estimator = ViewErrorEstimator(
            self._volume,
            self._request.transfer_function,
            self._request.options,
            tiles=TILES,
            tile_size=TILE_SIZE,
            device=self._runtime,
        )
        rough = self._whole(ROUGH)
        counts = np.bincount(rough.counts.reshape(-1), minlength=2)
        tiles = estimator.sample(rough, self._view, self._size)
        seconds = self._frame_seconds(rough)
        edges = self._list_edges(estimator, rough)
        if tiles is None:
            return Measurement(0.0, 0.0, 0.0, counts, seconds, list_edges=edges)
        truth = self._volume_tiles(estimator, self._view, tiles)
        losses = []
        for setting in (ROUGH, SPARSE, DENSE):
            self._go_on()
            pictures = self._pictures(tiles, setting, rough if setting == ROUGH else None)
            losses.append(_loss(tiles, pictures, truth))
        losses.append(self._least(estimator, tiles, truth))
        at_rough, sparse, dense, least = (min(1.0, max(0.0, loss)) for loss in losses)
        return Measurement(at_rough, sparse, dense, counts, seconds, least, edges)

    def _list_edges(self, estimator: ViewErrorEstimator, rough: VDI) -> dict[float, float]:
        """Return the edges along lists of pictures from V_O, by lists per pixel below 1.

        A list shows what its centre ray meets, exactly, wherever it is cut: at V_O the volume's
        picture of as many pixels as there are lists is what they show.
        """
        tiles = estimator.sample(rough, self._camera, self._size)
        if tiles is None:
            return {}
        pictures = self._volume_tiles(estimator, self._camera, tiles)
        found = {}
        for setting in LADDER:
            if setting.lists >= 1 or setting.lists in found:
                continue
            self._go_on()
            steps = [
                self._steps(estimator, corner, picture, setting)
                for corner, picture in zip(tiles.corners.tolist(), pictures, strict=True)
            ]
            across, within = np.average(steps, axis=0, weights=1 / tiles.chances).tolist()
            found[setting.lists] = ListEdges(across, within).ratio
        return found

    def _steps(
        self,
        estimator: ViewErrorEstimator,
        corner: Sequence[int],
        picture: NDArray[np.float32],
        setting: Setting,
    ) -> tuple[float, float]:
        """Return the mean steps across and within lists of a tile at V_O, its margin left out."""
        window = setting.window_size(self._size)
        inner = tuple(slice(REACH, edge - REACH) for edge in picture.shape[:2])
        places = list_places(self._camera, self._size, window)
        columns, rows = (
            np.floor(place[first:][part]).astype(int)
            for place, first, part in zip(places, corner, inner[::-1], strict=True)
        )
        first = (int(columns[0]), int(rows[0]))
        size = (int(columns[-1]) - first[0] + 1, int(rows[-1]) - first[1] + 1)
        lists = estimator.volume_tile(self._camera.tile(window, first, size), size)
        squares = lists[np.ix_(rows - first[1], columns - first[0])]
        edges = list_edges(squares, picture[inner], columns, rows)
        return edges.across, edges.within

    def _least(
        self, estimator: ViewErrorEstimator, tiles: TileSample, truth: list[NDArray[np.float32]]
    ) -> float:
        """Return the loss of the volume itself where V_O covers it, lit as V_O has it."""
        sides = viewport_planes(self._camera, self._size)
        world = self._camera.model_transform
        corners = bounds_corners(self._volume.bounds) @ world[:3, :3].T + world[:3, 3]
        covered = all(((corners - side[:3]) @ side[3:]).min() >= 0 for side in sides)
        if covered and self._request.transfer_function.shading is None:
            return 0.0
        shown = RenderOptions(clipping_planes=None if covered else sides)
        pictures = [
            estimator.volume_tile(lens, tiles.size, shown, lit_from=self._camera)
            for lens in self._lenses(self._view, tiles)
        ]
        return _loss(tiles, pictures, truth)

    def _go_on(self) -> None:
        progress = self._request.progress
        if progress is not None and progress(0.0) is False:
            raise Cancelled("choosing the settings of a VDI was cancelled")

    def _lenses(self, view: Camera, tiles: TileSample) -> list[Camera]:
        """Return the view that each tile of a view has."""
        corners = tiles.corners.tolist()
        return [view.tile(self._size, corner, tiles.size) for corner in corners]

    def _volume_tiles(
        self, estimator: ViewErrorEstimator, view: Camera, tiles: TileSample
    ) -> list[NDArray[np.float32]]:
        return [estimator.volume_tile(lens, tiles.size) for lens in self._lenses(view, tiles)]

    def _whole(self, setting: Setting) -> VDI:
        return self._generated(self._camera, setting.window_size(self._size), setting)

    def _generated(self, camera: Camera, size: tuple[int, int], setting: Setting) -> VDI:
        options = setting.applied_to(self._request.options)
        changes = {"camera": camera, "window_size": size, "options": options}
        return generate_vdi(self._request.replace(**changes, progress=None, metadata={}))

    def _pictures(
        self, tiles: TileSample, setting: Setting, whole: VDI | None
    ) -> list[NDArray[np.float32]]:
        """Return the tiles' pictures, by the whole VDI if there is one, or else as is cheaper."""
        window = setting.window_size(self._size)
        lenses = self._lenses(self._view, tiles)
        if whole is not None:
            return [render_vdi(whole, self._frame(lens, tiles.size)) for lens in lenses]
        met = [
            lists_met(lens, tiles.size, self._volume.bounds, self._camera, window)
            for lens in lenses
        ]
        parts = [math.prod(part[1]) + _PART_OVERHEAD for part in met if part is not None]
        # Where the parts together cost more than the whole, the whole is made
        if sum(parts) >= math.prod(window):
            return self._pictures(tiles, setting, self._whole(setting))
        pictures = []
        for lens, part in zip(lenses, met, strict=True):
            if part is None:
                pictures.append(np.zeros((*tiles.size[::-1], 4), np.float32))
                continue
            corner, size = part
            vdi = self._generated(self._camera.tile(window, corner, size), size, setting)
            pictures.append(render_vdi(vdi, self._frame(lens, tiles.size)))
        return pictures

    def _frame(self, camera: Camera, size: tuple[int, int]) -> FrameRequest:
        return FrameRequest(camera, size, device=self._runtime)

    def _frame_seconds(self, vdi: VDI) -> float:
        """Return the shortest time of a few full frames, seconds."""
        seconds = []
        for _ in range(_FRAMES):
            start = time.perf_counter()
            render_vdi(vdi, self._frame(self._view, self._size))
            seconds.append(time.perf_counter() - start)
        return max(min(seconds), 1e-9)


def _loss(
    tiles: TileSample, pictures: list[NDArray[np.float32]], truth: list[NDArray[np.float32]]
) -> float:
    """Return 1 - SSIM of the whole picture, inferred from tiles."""
    return 1.0 - tiles.infer(tiles_ssim(pictures, truth))[0]


def viewport_planes(camera: Camera, window_size: tuple[int, int]) -> NDArray[np.float64]:
    """Return the four sides of what a view covers, as clipping planes that keep it.

    float64 (4, 6): origin and inward normal of each, world coordinates.
    """
    # 1 - u, 1 + u, 1 - v and 1 + v, times the homogeneous denominator, of world points
    matrix = camera.viewport_matrix(window_size) @ camera.view_matrix
    planes = np.stack([matrix[3] + sign * matrix[row] for row in (0, 1) for sign in (-1, 1)])
    planes /= np.linalg.norm(planes[:, :3], axis=1)[:, np.newaxis]
    origins = -planes[:, 3:] * planes[:, :3]
    return np.concatenate([origins, planes[:, :3]], axis=1)


def turned(camera: Camera, bounds: Sequence[float], degrees: float) -> Camera:
    """Return a view turned about ``view_up`` through the centre of bounds in the model frame.

    The view of :meth:`Camera.azimuth` where the camera looks at that centre.
    """
    centre = world_centre(camera, bounds)
    axis = np.asarray(camera.view_up) / np.linalg.norm(camera.view_up)
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))

    def around(point: Sequence[float]) -> NDArray[np.float64]:  # Rodrigues' formula
        v = np.asarray(point) - centre
        along = axis * (axis @ v)
        return np.asarray(centre + along + (v - along) * cosine + np.cross(axis, v) * sine)

    return camera.replace(position=around(camera.position), focal_point=around(camera.focal_point))


def lists_met(
    lens: Camera,
    size: tuple[int, int],
    bounds: Sequence[float],
    camera: Camera,
    window: tuple[int, int],
) -> tuple[tuple[int, int], tuple[int, int]] | None:
    """Return the rectangle of V_O's lists that the rays of a picture meet within bounds.

    ``lens`` is the view of the picture and ``size`` its pixels; ``camera`` is V_O and ``window``
    its lists. The first column and row from the top left, and how many; None if there are none.
    """
    pixel_rays = rays.pixel_rays(lens, size, bounds)
    width, height = size
    b, a = np.meshgrid(
        (height - 1) / 2 - np.arange(height), np.arange(width) - (width - 1) / 2, indexing="ij"
    )
    pixels = np.stack([np.ones(a.size), a.ravel(), b.ravel()], axis=1)
    origin, direction = pixels @ pixel_rays.origin, pixels @ pixel_rays.direction
    # Where each ray enters and leaves the box
    low, high = np.asarray(bounds)[::2], np.asarray(bounds)[1::2]
    with np.errstate(divide="ignore", invalid="ignore"):
        faces = np.stack([(low - origin) / direction, (high - origin) / direction])
    enter = np.nanmax(faces.min(axis=0), axis=1)
    leave = np.nanmin(faces.max(axis=0), axis=1)
    if not lens.parallel_projection:
        enter = np.maximum(enter, -pixel_rays.reference_depth)
    inside = enter < leave
    if not inside.any():
        return None
    ends = np.concatenate(
        [origin[inside] + t[inside, None] * direction[inside] for t in (enter, leave)]
    )
    points = np.column_stack([ends, np.ones(len(ends))]) @ camera.model_to_view.T
    if not camera.parallel_projection and points[:, 2].min() <= 0:
        return (0, 0), window  # they pass V_O's eye
    place = window_pixels(points, camera, window)
    # One more on each side, for the ends' rounding
    first = np.clip(np.floor(place.min(axis=0)) - 1, 0, window).astype(int)
    last = np.clip(np.ceil(place.max(axis=0)) + 1, 0, window).astype(int)
    if (last <= first).any():
        return None
    column, row = first.tolist()
    across, down = (last - first).tolist()
    return (column, row), (across, down)
