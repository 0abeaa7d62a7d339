"""The measurement: who is compared with whom, at which steps, and how it is timed.

Pictures are compared at the accuracy step (half the smallest spacing unless given), frames are
timed with steps of one voxel in every volume renderer, as the design's section 7 says. Each
timing is a ratio to something measured in the same run: the candidates take turns, after one
frame each that is not counted, and the median is reported.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.measure.compare.system import describe_system
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.metrics import Comparison, compare_images
from pyvista_vdi.model.standard_cases import ANGLES, WINDOW_SIZE, filling_camera
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.raycasting.raycast import render_vdi
from pyvista_vdi.volume.render import raycast_volume

#: What takes part, by the keys of :attr:`AngleResult.seconds` and of the pictures.
NAMES = {
    "vdi": "VDI",
    "raycaster": "our volume raycaster",
    "gpu": "VTK GPU mapper",
    "fixed_point": "VTK fixed-point mapper",
}

#: Window in which everything is drawn once before anything is timed, pixels.
_WARM_UP_SIZE = (64, 36)

#: Bytes of a supersegment in the dense, uncompressed form that sizes are compared with.
_DENSE_BYTES = 24

Images = dict[str, NDArray[np.float32]]
Progress = Callable[[float], object]


@dataclass(frozen=True)
class Settings:
    """What is measured.

    Parameters
    ----------
    classification : mapping
        Classification arguments, those of :func:`pyvista_vdi.generate`.
    window_size : (int, int)
        Of the VDI and of all frames, pixels.
    angles : tuple of float
        New views, degrees of ``Azimuth`` from V_O.
    max_supersegments : int
        Longest list.
    sample_distance : float, optional
        The accuracy step, model units; half the smallest spacing by default.
    repeats : int
        Timed frames of each candidate and view; 0 compares pictures and times nothing.
    vtk : bool
        Whether VTK's mappers take part.
    device : optional
        OpenCL device of ours.
    name : str
        What the volume and the transfer function are called in the report.
    """

    classification: Mapping[str, Any]
    window_size: tuple[int, int] = WINDOW_SIZE
    angles: tuple[float, ...] = ANGLES
    max_supersegments: int = 20
    sample_distance: float | None = None
    repeats: int = 3
    vtk: bool = True
    device: Any = None
    name: str = "volume"

    def __post_init__(self) -> None:
        if isinstance(self.repeats, bool) or not 0 <= self.repeats <= 1000:
            raise InvalidArgumentError(f"repeats must be from 0 to 1000; got {self.repeats!r}")
        if not self.angles or not all(math.isfinite(a) for a in self.angles):
            raise InvalidArgumentError(
                f"angles must be one or more numbers of degrees; got {self.angles!r}"
            )


@dataclass(frozen=True)
class Timing:
    """Seconds of repeated work: the median and the worst."""

    median: float
    worst: float


@dataclass(frozen=True)
class AngleResult:
    """What was found at one view.

    Parameters
    ----------
    angle : float
        Degrees from V_O.
    vdi_to_raycaster : Comparison
        The VDI against our volume raycaster.
    raycaster_to_gpu : Comparison, optional
        Our volume raycaster against VTK's GPU mapper; ``None`` without VTK.
    fixed_point_to_gpu : Comparison, optional
        VTK's fixed-point mapper against VTK's GPU mapper.
    seconds : dict of str to Timing
        Frame times at steps of one voxel, by the keys of :data:`NAMES`; empty if not timed.
    """

    angle: float
    vdi_to_raycaster: Comparison
    raycaster_to_gpu: Comparison | None
    fixed_point_to_gpu: Comparison | None
    seconds: dict[str, Timing]

    @property
    def ratio_to_vtk(self) -> float | None:
        """VDI's frame time over that of the faster of VTK's mappers."""
        peers = [t.median for name, t in self.seconds.items() if name in ("gpu", "fixed_point")]
        return self.seconds["vdi"].median / min(peers) if peers else None

    @property
    def ratio_to_raycaster(self) -> float | None:
        """VDI's frame time over that of our volume raycaster."""
        if not self.seconds:
            return None
        return self.seconds["vdi"].median / self.seconds["raycaster"].median


@dataclass(frozen=True)
class Report:
    """All that was found, ready for JSON by :meth:`to_dict`.

    Parameters
    ----------
    case : dict
        Volume, classification, window, limits, steps.
    system : dict
        Device, driver, OpenGL, versions.
    sizes : dict of str to int
        Supersegments, lists, and bytes: of the volume, of the VDI in memory, of its dense form.
    generation_seconds, full_raycast_seconds : Timing, optional
        Generation, and our volume raycaster at the same step without early termination; ``None``
        where nothing was timed.
    angles : list of AngleResult
        By view.
    """

    case: dict[str, Any]
    system: dict[str, str]
    sizes: dict[str, int]
    generation_seconds: Timing | None
    full_raycast_seconds: Timing | None
    angles: list[AngleResult] = field(default_factory=list)

    @property
    def generation_ratio(self) -> float | None:
        """Generation time over that of the full raycast at the same step."""
        if self.generation_seconds is None or self.full_raycast_seconds is None:
            return None
        return self.generation_seconds.median / self.full_raycast_seconds.median

    def to_dict(self) -> dict[str, Any]:
        """Return everything in values that JSON can hold; infinite and undefined become null."""
        described = asdict(self)
        described["generation_ratio"] = self.generation_ratio
        for entry, result in zip(described["angles"], self.angles, strict=True):
            entry["ratio_to_vtk"] = result.ratio_to_vtk
            entry["ratio_to_raycaster"] = result.ratio_to_raycaster
        plain: dict[str, Any] = without_infinities(described)
        return plain


def measure(
    volume: Volume, settings: Settings, progress: Progress | None = None
) -> tuple[Report, VDI, dict[float, Images]]:
    """Render one volume in every way, compare the pictures and time the frames.

    Parameters
    ----------
    volume : Volume
        What is rendered.
    settings : Settings
        How.
    progress : callable, optional
        Called with the finished fraction, 0 to 1.

    Returns
    -------
    report : Report
        The figures.
    vdi : VDI
        What was generated from V_O.
    images : dict of float to dict of str to numpy.ndarray
        By angle and by the keys of :data:`NAMES`: float32 (H, W, 3 or 4) over black.

    Raises
    ------
    MissingDependencyError
        If VTK takes part and cannot be loaded, or finds no OpenGL.
    DeviceError
        If VTK draws nothing, or the OpenCL device fails.
    InvalidArgumentError
        If the transfer function leaves nothing to see.
    """
    looks = Classification(settings.classification, "compare")
    table = looks.transfer_function(volume)
    bench = _Bench(volume, table, settings)
    done = _Counter(progress, bench.n_steps)
    with ExitStack() as stack:
        peers = _peers(volume, settings, bench.step) if settings.vtk else {}
        for peer in peers.values():
            stack.callback(peer.close)
        vdi, generation, full_raycast = bench.generate(done)
        images = {angle: bench.images(vdi, angle, peers, done) for angle in settings.angles}
        results = [
            _judged(angle, images[angle], bench.frame_times(vdi, angle, peers, done))
            for angle in settings.angles
        ]
        system = _system(settings, peers)
    report = Report(
        case=_case(volume, settings, looks, bench),
        system=system,
        sizes=_sizes(volume, vdi, settings),
        generation_seconds=generation,
        full_raycast_seconds=full_raycast,
        angles=results,
    )
    return report, vdi, images


class _Bench:
    """Our side of the comparison: one volume, one table, one generating view."""

    def __init__(self, volume: Volume, table: TransferFunction, settings: Settings) -> None:
        self._volume, self._table, self._settings = volume, table, settings
        self.voxel = min(volume.spacing)
        self.step = settings.sample_distance or self.voxel / 2
        self.view = filling_camera(volume.bounds, settings.window_size)
        self._device = get_runtime(settings.device)

    @property
    def n_steps(self) -> int:
        """How often the progress is reported."""
        n_angles, n_candidates = len(self._settings.angles), 4 if self._settings.vtk else 2
        repeats = self._settings.repeats
        frames = 1 + repeats if repeats else 0
        return 2 * repeats + n_angles * n_candidates * (1 + frames)

    def generate(self, done: Callable[[], None]) -> tuple[VDI, Timing | None, Timing | None]:
        """Generate the VDI, in turn with a full raycast at the same step where that is timed."""
        size = self._settings.window_size
        if self._settings.repeats == 0:
            return self._generated(size), None, None
        self._generated(_WARM_UP_SIZE)
        self._raycast(self.view, _WARM_UP_SIZE, self.step, early_termination=False)
        vdi: list[VDI] = []

        def generate() -> None:
            vdi[:] = [self._generated(size)]

        def raycast() -> None:
            self._raycast(self.view, size, self.step, early_termination=False)

        seconds = _take_turns(
            {"generate": generate, "raycast": raycast}, self._settings.repeats, done
        )
        return vdi[0], seconds["generate"], seconds["raycast"]

    def images(
        self, vdi: VDI, angle: float, peers: Mapping[str, Any], done: Callable[[], None]
    ) -> Images:
        """Render the accurate pictures of one view."""
        camera, size = self.view.azimuth(angle), self._settings.window_size
        images: Images = {}
        for name, peer in peers.items():
            peer.set_sample_distance(self.step)
            images[name] = peer.image(camera)
            done()
        images["raycaster"] = self._raycast(camera, size, self.step)
        done()
        images["vdi"] = render_vdi(vdi, camera, size, device=self._device)
        done()
        if not images["raycaster"].any():
            raise InvalidArgumentError(
                f"nothing is to be seen at {angle:g} degrees: the transfer function leaves the "
                "whole volume transparent; choose another opacity or clim"
            )
        return images

    def frame_times(
        self, vdi: VDI, angle: float, peers: Mapping[str, Any], done: Callable[[], None]
    ) -> dict[str, Timing]:
        """Time frames at steps of one voxel."""
        if self._settings.repeats == 0:
            return {}
        camera, size = self.view.azimuth(angle), self._settings.window_size
        frames: dict[str, Callable[[], Any]] = {
            "vdi": lambda: render_vdi(vdi, camera, size, device=self._device),
            "raycaster": lambda: self._raycast(camera, size, self.voxel),
        }
        for name, peer in peers.items():
            peer.set_sample_distance(self.voxel)
            frames[name] = partial(peer.render, camera)
        for frame in frames.values():  # not counted: kernels and shaders are compiled
            frame()
            done()
        return _take_turns(frames, self._settings.repeats, done)

    def _generated(self, size: tuple[int, int]) -> VDI:
        return generate_vdi(
            self._volume,
            self.view,
            size,
            self._table,
            max_supersegments=self._settings.max_supersegments,
            sample_distance=self.step,
            device=self._device,
        )

    def _raycast(
        self, camera: Camera, size: tuple[int, int], step: float, *, early_termination: bool = True
    ) -> NDArray[np.float32]:
        return raycast_volume(
            self._volume,
            camera,
            size,
            self._table,
            sample_distance=step,
            early_termination=early_termination,
            skip_empty=False,  # the plain baseline that the paper compares with
            device=self._device,
        )


class _Counter:
    """Counts finished pieces of work and reports their share."""

    def __init__(self, progress: Progress | None, total: int) -> None:
        self._progress, self._total, self._done = progress, total, 0

    def __call__(self) -> None:
        self._done += 1
        if self._progress is not None:
            self._progress(min(1.0, self._done / self._total))


def _take_turns(
    work: Mapping[str, Callable[[], Any]], repeats: int, done: Callable[[], None]
) -> dict[str, Timing]:
    """Time each piece of work ``repeats`` times, one after the other in turn."""
    seconds: dict[str, list[float]] = {name: [] for name in work}
    for _ in range(repeats):
        for name, run in work.items():
            start = time.perf_counter()
            run()
            seconds[name].append(time.perf_counter() - start)
            done()
    return {name: Timing(statistics.median(s), max(s)) for name, s in seconds.items()}


def _peers(volume: Volume, settings: Settings, step: float) -> dict[str, Any]:
    """Return VTK's mappers, with the property that ``add_volume`` would give them."""
    from pyvista_vdi.measure.vtk_baselines import MAPPERS, PeerRenderer
    from pyvista_vdi.plotting.cli_support import add_volume_property

    arguments = dict(settings.classification)
    if "transfer_function" in arguments:
        raise InvalidArgumentError(
            "VTK's mappers take no transfer_function: give add_volume's arguments or a "
            "volume_property, or leave VTK out"
        )
    for name in ("scalars", "preference"):  # the array has been chosen
        arguments.pop(name, None)
    prop = arguments.get("volume_property") or add_volume_property(volume, arguments)
    return {name: PeerRenderer(volume, prop, settings.window_size, name, step) for name in MAPPERS}


def _judged(angle: float, images: Images, seconds: dict[str, Timing]) -> AngleResult:
    with_vtk = "gpu" in images
    return AngleResult(
        angle=angle,
        vdi_to_raycaster=compare_images(images["vdi"], images["raycaster"]),
        raycaster_to_gpu=compare_images(images["raycaster"], images["gpu"]) if with_vtk else None,
        fixed_point_to_gpu=(
            compare_images(images["fixed_point"], images["gpu"]) if with_vtk else None
        ),
        seconds=seconds,
    )


def _case(
    volume: Volume, settings: Settings, looks: Classification, bench: _Bench
) -> dict[str, Any]:
    return {
        "name": settings.name,
        "dimensions": list(volume.dimensions),
        "spacing": list(volume.spacing),
        "dtype": str(volume.array.dtype),
        "classification": looks.describe(),
        "window_size": list(settings.window_size),
        "max_supersegments": settings.max_supersegments,
        "sample_distance": bench.step,
        "timing_sample_distance": bench.voxel,
        "repeats": settings.repeats,
        "camera": bench.view.to_dict(),
    }


def _system(settings: Settings, peers: Mapping[str, Any]) -> dict[str, str]:
    described = describe_system(settings.device)
    return {**described, "opengl": peers["gpu"].opengl} if peers else described


def _sizes(volume: Volume, vdi: VDI, settings: Settings) -> dict[str, int]:
    width, height = settings.window_size
    return {
        "volume_bytes": volume.array.nbytes,
        "supersegments": vdi.n_supersegments,
        "occupied_lists": int(np.count_nonzero(np.diff(vdi.offsets))),
        "lists": width * height,
        "vdi_bytes": vdi.nbytes,
        "dense_bytes": width * height * settings.max_supersegments * _DENSE_BYTES,
    }


def without_infinities(value: Any) -> Any:
    """Return a value with null for numbers that JSON does not have."""
    if isinstance(value, dict):
        return {key: without_infinities(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [without_infinities(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
