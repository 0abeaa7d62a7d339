"""The measurement: who is compared with whom, at which steps, and how it is timed.

Pictures are compared at the accuracy step (half the smallest spacing unless given), frames are
timed with steps of one voxel in every volume renderer, as the design's section 7 says. Each
timing is a ratio to something measured in the same run: the candidates take turns, after one
frame each that is not counted, and the median is reported.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping
from contextlib import ExitStack, closing
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any

import numpy as np

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.measure.clock import Step, Times, take_turns
from pyvista_vdi.measure.report import describe_system
from pyvista_vdi.measure.results import rounded as without_infinities
from pyvista_vdi.measure.session import (
    WARM_UP_SIZE,
    Image,
    Steps,
    check_angles,
    check_count,
    seen,
)
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.metrics import Comparison, compare_images
from pyvista_vdi.model.options import MediumOptions
from pyvista_vdi.model.render_options import TRANSMITTANCE_CUTOFF, FrameRequest, RenderOptions
from pyvista_vdi.model.standard_cases import ANGLES, WINDOW_SIZE, filling_camera
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.raycasting.prepared import prepared_vdi
from pyvista_vdi.raycasting.raycast import render_vdi
from pyvista_vdi.volume.classified_volume import checked_sample_distance
from pyvista_vdi.volume.render import raycast_volume

#: What takes part, by the keys of :attr:`AngleResult.seconds` and of the pictures.
NAMES = {
    "vdi": "VDI",
    "raycaster": "our volume raycaster",
    "gpu": "VTK GPU mapper",
    "fixed_point": "VTK fixed-point mapper",
}

#: What to do where the volume is not seen.
_TRANSPARENT = (
    ": the transfer function leaves the whole volume transparent; choose another opacity or clim"
)

#: Bytes of a supersegment in the dense, uncompressed form that sizes are compared with.
_DENSE_BYTES = 24

Images = dict[str, Image]


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
    precision : str
        Of the supersegments, see :meth:`VDI.with_precision`.
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
    precision: str = "exact"
    sample_distance: float | None = None
    repeats: int = 3
    vtk: bool = True
    device: Any = None
    name: str = "volume"

    def __post_init__(self) -> None:
        check_count("repeats", self.repeats, least=0)
        check_angles(self.angles)


@dataclass(frozen=True)
class Timing:
    """Seconds of repeated work: the median and the worst."""

    median: float
    worst: float

    @classmethod
    def of(cls, taken: Times) -> Timing:
        """Return what repetitions by the wall's clock come to."""
        return cls(statistics.median(taken["clock"]), max(taken["clock"]))


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
        Supersegments, lists, and bytes: of the volume, of the VDI in the process's memory
        and on the device, of its dense form.
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
    volume: Volume, settings: Settings, progress: Callable[[float], object] | None = None
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
    with ExitStack() as stack:
        return _Bench(volume, settings, looks, progress).everything(stack)


class _Bench:
    """One volume, one table and one generating view, and everybody who draws them."""

    def __init__(
        self, volume: Volume, settings: Settings, looks: Classification, progress: Any
    ) -> None:
        self._volume, self._settings = volume, settings
        self._table = looks.transfer_function(volume)
        self._looks = looks.describe()
        self.voxel = min(volume.spacing)
        self.step = checked_sample_distance(volume, settings.sample_distance)
        self.view = filling_camera(volume.bounds, settings.window_size)
        self._device = get_runtime(settings.device)
        self._baselines: dict[str, Any] = {}
        repeats = settings.repeats
        a_view = (4 if settings.vtk else 2) * (1 + (1 + repeats if repeats else 0))
        steps = Steps(progress, 2 * repeats + len(settings.angles) * a_view)
        self._done = partial(steps, finished=1)

    def everything(self, stack: ExitStack) -> tuple[Report, VDI, dict[float, Images]]:
        """Generate, draw and time; ``stack`` closes VTK's windows."""
        settings = self._settings
        if settings.vtk:
            self._baselines = _baselines(self._volume, settings, self.step, stack)
        vdi, generation, full_raycast = self._timed_generation()
        images = {angle: self._images(vdi, angle) for angle in settings.angles}
        results = [
            _judged(angle, images[angle], self._frame_times(vdi, angle))
            for angle in settings.angles
        ]
        system = describe_system(settings.device)
        if self._baselines:
            system["opengl"] = self._baselines["gpu"].opengl
        report = Report(self._case(), system, self._sizes(vdi), generation, full_raycast, results)
        return report, vdi, images

    def _timed_generation(self) -> tuple[VDI, Timing | None, Timing | None]:
        """Generate the VDI, in turn with a full raycast at the same step where that is timed."""
        size = self._settings.window_size
        if self._settings.repeats == 0:
            return self._generated(size), None, None
        self._generated(WARM_UP_SIZE)
        self._raycast(self.view, WARM_UP_SIZE, self.step, early_termination=False)
        vdi: list[VDI] = []

        def generate() -> None:
            vdi[:] = [self._generated(size)]

        def raycast() -> None:
            self._raycast(self.view, size, self.step, early_termination=False)

        work = {"generate": generate, "raycast": raycast}
        taken = take_turns(work, self._settings.repeats, warm_up=False, done=self._done)
        return vdi[0], Timing.of(taken["generate"]), Timing.of(taken["raycast"])

    def _images(self, vdi: VDI, angle: float) -> Images:
        """Render the accurate pictures of one view."""
        camera, size = self.view.azimuth(angle), self._settings.window_size
        images: Images = {}
        for name, baseline in self._baselines.items():
            baseline.set_sample_distance(self.step)
            images[name] = baseline.image(camera)
            self._done()
        images["raycaster"] = self._raycast(camera, size, self.step)
        self._done()
        images["vdi"] = render_vdi(vdi, FrameRequest(camera, size, device=self._device))
        self._done()
        seen(images["raycaster"], angle, _TRANSPARENT)
        return images

    def _frame_times(self, vdi: VDI, angle: float) -> dict[str, Timing]:
        """Time frames at steps of one voxel."""
        if self._settings.repeats == 0:
            return {}
        camera, size = self.view.azimuth(angle), self._settings.window_size
        frames: dict[str, Step] = {
            "vdi": lambda: render_vdi(vdi, FrameRequest(camera, size, device=self._device)),
            "raycaster": lambda: self._raycast(camera, size, self.voxel),
        }
        for name, baseline in self._baselines.items():
            baseline.set_sample_distance(self.voxel)
            frames[name] = partial(baseline.render, camera)
        taken = take_turns(frames, self._settings.repeats, done=self._done)
        return {name: Timing.of(times) for name, times in taken.items()}

    def _generated(self, size: tuple[int, int]) -> VDI:
        return generate_vdi(
            self._volume,
            self.view,
            size,
            self._table,
            max_supersegments=self._settings.max_supersegments,
            precision=self._settings.precision,
            sample_distance=self.step,
            device=self._device,
        )

    def _raycast(
        self, camera: Camera, size: tuple[int, int], step: float, *, early_termination: bool = True
    ) -> Image:
        cutoff = TRANSMITTANCE_CUTOFF if early_termination else 0.0
        # Without skipping: the plain baseline that the paper compares with
        options = RenderOptions(skip_empty=False, transmittance_cutoff=cutoff)
        frame = FrameRequest(camera, size, options, device=self._device)
        sampling = MediumOptions(sample_distance=step)
        return raycast_volume(self._volume, self._table, frame, sampling)

    def _case(self) -> dict[str, Any]:
        volume, settings = self._volume, self._settings
        return {
            "name": settings.name,
            "dimensions": list(volume.dimensions),
            "spacing": list(volume.spacing),
            "dtype": str(volume.array.dtype),
            "classification": self._looks,
            "window_size": list(settings.window_size),
            "max_supersegments": settings.max_supersegments,
            "precision": settings.precision,
            "sample_distance": self.step,
            "timing_sample_distance": self.voxel,
            "repeats": settings.repeats,
            "camera": self.view.to_dict(),
        }

    def _sizes(self, vdi: VDI) -> dict[str, int]:
        width, height = self._settings.window_size
        return {
            "volume_bytes": self._volume.array.nbytes,
            "supersegments": vdi.n_supersegments,
            "occupied_lists": int(np.count_nonzero(vdi.counts)),
            "lists": width * height,
            "vdi_bytes": vdi.nbytes,
            "device_bytes": prepared_vdi(self._device, vdi).list_bytes,
            "dense_bytes": width * height * self._settings.max_supersegments * _DENSE_BYTES,
        }


def _baselines(volume: Volume, settings: Settings, step: float, stack: ExitStack) -> dict[str, Any]:
    """Return VTK's mappers, with the property that ``add_volume`` would give them."""
    from pyvista_vdi.measure.vtk_baselines import MAPPERS, VTKBaseline, add_volume_property

    arguments = dict(settings.classification)
    if "transfer_function" in arguments:
        raise InvalidArgumentError(
            "VTK's mappers take no transfer_function: give add_volume's arguments or a "
            "volume_property, or leave VTK out"
        )
    for name in ("scalars", "preference"):  # the array has been chosen
        arguments.pop(name, None)
    prop = arguments.get("volume_property") or add_volume_property(volume, arguments)
    size = settings.window_size
    return {
        name: stack.enter_context(closing(VTKBaseline(volume, prop, size, name, step)))
        for name in MAPPERS
    }


def _judged(angle: float, images: Images, seconds: dict[str, Timing]) -> AngleResult:
    def compared(one: str, other: str) -> Comparison | None:
        both = one in images and other in images
        return compare_images(images[one], images[other]) if both else None

    return AngleResult(
        angle=angle,
        vdi_to_raycaster=compare_images(images["vdi"], images["raycaster"]),
        raycaster_to_gpu=compared("raycaster", "gpu"),
        fixed_point_to_gpu=compared("fixed_point", "gpu"),
        seconds=seconds,
    )
