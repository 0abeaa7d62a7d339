"""The front of time and accuracy: our ways to draw a volume against those of VTK's mappers.

Everybody draws whole frames into an off-screen window of VTK's, with fewer rays (image sample
distance) and longer steps, and is held against the own full picture: every pixel at steps of half a
voxel, by ``render_volume``'s kernel for ours and by the same mapper for VTK's.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from contextlib import closing as closed_at_end
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np

from pyvista_vdi import examples
from pyvista_vdi.measure.clock import median, take_turns
from pyvista_vdi.measure.report import ABSENT, closing, describe_system, table
from pyvista_vdi.measure.results_file import ResultsFile
from pyvista_vdi.measure.session import Steps, check_count
from pyvista_vdi.measure.vtk_baselines import (
    MAPPERS,
    OffScreenVolume,
    VTKBaseline,
    property_from_transfer_function,
)
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.render_options import TRANSMITTANCE_CUTOFF
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS, WINDOW_SIZE, filling_camera
from pyvista_vdi.model.volume import Volume

#: Degrees from V_O, and how far the view is zoomed in.
VIEWS = (*((float(a), 1.0) for a in (0, 5, 15, 30, 60, 90, 180)), (0.0, 2.0))
#: The volumes and views of a short run: 24 cases with the three transfer functions.
QUICK_VOLUMES, QUICK_VIEWS = ("brain", "rayleigh_taylor"), tuple(VIEWS[k] for k in (0, 2, 3, 4))

#: Pixels along each edge for a ray.
DISTANCES = (1.0, 2.0, 3.0, 4.0)
#: Those of ours beside them: any number does, and pictures lose most between 1 and 2.
_OWN_DISTANCES = (1.0, 1.5, *DISTANCES[1:])
#: Steps along the ray, voxels: of everybody, and of the full pictures.
STEPS, FULL_STEP = (1.0, 2.0), 0.5
#: SSIM that ours may be below VTK's at a point of its front.
SLACK = 0.002


@dataclass(frozen=True)
class Point:
    """A way to draw, what it takes and how near it comes to the own full picture.

    Parameters
    ----------
    who : {"vdi", "volume", "gpu", "fixed_point"}
        Our VDI, our volume raycaster, or one of VTK's mappers.
    distance : float
        Pixels along each edge for a ray.
    step : float
        Voxels along the ray; of a VDI what it was generated with.
    seconds : float
        Of a frame, the median.
    ssim : float
        To the own full picture.
    """

    who: str
    distance: float
    step: float
    seconds: float
    ssim: float

    @property
    def ours(self) -> bool:
        """Whether it is ours."""
        return self.who in ("vdi", "volume")


def front_of(points: Sequence[Point]) -> list[Point]:
    """Return the points that none is as fast and as near as, the fastest first."""
    best: list[Point] = []
    for point in sorted(points, key=lambda p: (p.seconds, -p.ssim)):
        if not best or point.ssim > best[-1].ssim:
            best.append(point)
    return best


def over(points: Sequence[Point], others: Sequence[Point]) -> list[float]:
    """Return each time of the front of ``points`` over the least of ``others`` that are as near.

    As near is an SSIM that is less by :data:`SLACK` at most. Points that none comes as near as are
    left out.
    """
    found = []
    for point in front_of(points):
        as_near = [p.seconds for p in others if p.ssim >= point.ssim - SLACK]
        if as_near:
            found.append(point.seconds / min(as_near))
    return found


def gains(points: Sequence[Point]) -> list[float]:
    """Return VTK's time over ours for each point of VTK's front."""
    return over([p for p in points if not p.ours], [p for p in points if p.ours])


def full_gain(points: Sequence[Point]) -> float:
    """Return that of the full picture of VTK's faster mapper: a ray a pixel, steps of a voxel."""
    full = [p for p in points if not p.ours and (p.distance, p.step) == (1.0, STEPS[0])]
    return over([min(full, key=lambda p: p.seconds)], [p for p in points if p.ours])[0]


def cost_alone(points: Sequence[Point]) -> list[float]:
    """Return the time over VTK's for each point of the front of the VDI alone."""
    return over([p for p in points if p.who == "vdi"], [p for p in points if not p.ours])


@dataclass(frozen=True)
class Plan:
    """Which cases are measured, and how.

    Parameters
    ----------
    volumes, looks : tuple of str
        Names of volumes (:data:`pyvista_vdi.examples.VOLUMES`) and transfer functions.
    views : tuple of (float, float)
        Degrees from V_O and zoom.
    window_size : (int, int)
        Pixels.
    repeats : int
        Timed frames of each way and view.
    """

    volumes: tuple[str, ...]
    looks: tuple[str, ...] = tuple(TRANSFER_FUNCTIONS)
    views: tuple[tuple[float, float], ...] = VIEWS
    window_size: tuple[int, int] = WINDOW_SIZE
    repeats: int = 3

    def __post_init__(self) -> None:
        check_count("repeats", self.repeats)

    @classmethod
    def quick(cls, **more: Any) -> Plan:
        """Return that of a short run."""
        return cls(QUICK_VOLUMES, views=QUICK_VIEWS, **more)

    def to_dict(self) -> dict[str, Any]:
        """Return it in values that JSON can hold."""
        lists: Callable[[Any], Any] = lambda v: [*map(lists, v)] if isinstance(v, tuple) else v  # noqa: E731
        return {name: lists(value) for name, value in asdict(self).items()}


class FrontFile(ResultsFile):
    """What was measured: ``cases`` by "volume, look", a list of views with their points."""

    form, version = "pyvista-vdi front", 1
    empty: ClassVar[Mapping[str, Any]] = {"cases": {}, "left_out": {}}

    def views(self) -> Iterator[tuple[str, float, float, list[Point]]]:
        """Yield each case's name, degrees, zoom and points."""
        for name, views in self.data["cases"].items():
            for view in views:
                points = [Point(**point) for point in view["points"]]
                yield name, view["angle"], view["zoom"], points


class OurVolume(OffScreenVolume):
    """A VDI, or the volume itself, drawn by our actor in an off-screen window of VTK's."""

    def __init__(
        self,
        volume: Volume,
        look: Mapping[str, Any],
        window_size: tuple[int, int],
        draw: str,
        sample_distance: float,
        view: Camera,
        device: Any = None,
    ) -> None:
        from pyvista_vdi.vtk_pipeline.drawing.actor import VDIActor
        from pyvista_vdi.vtk_pipeline.drawing.mapper import VDIMapper
        from pyvista_vdi.vtk_pipeline.filters.convert import volume_to_image
        from pyvista_vdi.vtk_pipeline.filters.source import VDISource

        classified = Classification(look, "a front").transfer_function(volume)
        source, self.mapper, actor = VDISource(), VDIMapper(), VDIActor()
        source.SetInputDataObject(volume_to_image(volume))
        source.SetVolumeProperty(property_from_transfer_function(volume, classified))
        source.SetSampleDistance(sample_distance)
        source.SetDevice(device)
        source.SetCamera(view)
        source.SetWindowSize(*window_size)
        self.mapper.SetDevice(device)
        self.mapper.SetRegenerate("never")
        self.mapper.SetDraw(draw)
        self.mapper.SetInputConnection(source.GetOutputPort())
        actor.SetMapper(self.mapper)
        super().__init__(f"our {draw}", actor, window_size)
        self._frames = 0

    def render(self, camera: Camera) -> None:
        """Draw a frame and wait until it is finished: raycast anew, though nothing has changed."""
        self._frames += 1
        # Images are kept by what they depend on; this is less than any channel's last bit
        self.mapper.SetTransmittanceCutoff(TRANSMITTANCE_CUTOFF * (1 + self._frames * 1e-6))
        super().render(camera)


def measure_front(
    plan: Plan,
    path: str | os.PathLike[str] | None = None,
    *,
    resume: bool = False,
    device: Any = None,
    progress: Callable[..., object] | None = None,
) -> FrontFile:
    """Measure, and write what there is after each pair of volume and transfer function.

    Parameters
    ----------
    plan : Plan
        The cases.
    path : path-like, optional
        A JSON file to write.
    resume : bool
        Go on with that file, which an earlier run of the same plan has left.
    device : optional
        OpenCL device of ours.
    progress : callable, optional
        Called with the finished fraction, 0 to 1, and what is being done.

    Returns
    -------
    FrontFile
        What was found.

    Raises
    ------
    InvalidArgumentError
        If there is nothing to go on with, or it is of another plan or device.
    MissingDependencyError
        If VTK cannot be loaded, or finds no OpenGL.
    """
    system = describe_system(device)
    if resume and path is not None:
        found = FrontFile.resumed(path, plan, system)
    else:
        found = FrontFile.begun(path, plan, system)
    steps = Steps(progress, len(plan.volumes) * len(plan.looks) * len(plan.views))
    there = examples.available()
    for name in plan.volumes:
        if name not in there:
            found.data["left_out"][name] = f"not in {examples.DATA_VARIABLE}"
            steps(finished=len(plan.looks) * len(plan.views))
            continue
        found.data["left_out"].pop(name, None)  # of an earlier run, which had no such file
        volume = examples.load_data(name, as_volume=True)
        for look in plan.looks:
            case = f"{name}, {look}"
            if case in found.data["cases"]:
                steps(finished=len(plan.views))
                continue
            views = []
            with ExitStack() as stack:
                everybody = _Everybody(volume, look, plan, device, stack)
                found.data["system"].setdefault("opengl", everybody.opengl)
                for angle, zoom in plan.views:
                    steps.begin(f"{case}, {angle:g} degrees" + (f" x {zoom:g}" * (zoom != 1)))
                    points = [asdict(point) for point in everybody.points(angle, zoom)]
                    views.append({"angle": angle, "zoom": zoom, "points": points})
            found.data["cases"][case] = views
            found.save()
    found.save()  # what was left out, too
    return found


class _Everybody:
    """All who draw a volume with a transfer function."""

    def __init__(
        self, volume: Volume, look: str, plan: Plan, device: Any, stack: ExitStack
    ) -> None:
        self._plan = plan
        self._voxel = voxel = min(volume.spacing)
        self._view = view = filling_camera(volume.bounds, plan.window_size)
        looks, size = TRANSFER_FUNCTIONS[look], plan.window_size
        classified = Classification(looks, "a front").transfer_function(volume)

        def own(draw: str, step: float) -> OurVolume:
            drawn = OurVolume(volume, looks, size, draw, step * voxel, view, device)
            return stack.enter_context(closed_at_end(drawn))

        self._vdi = own("vdi", FULL_STEP)
        self._volumes = {step: own("volume", step) for step in (FULL_STEP, *STEPS)}
        prop = property_from_transfer_function(volume, classified)
        self._theirs = {
            name: stack.enter_context(closed_at_end(VTKBaseline(volume, prop, size, name, voxel)))
            for name in MAPPERS
        }

    @property
    def opengl(self) -> str:
        """What VTK draws by."""
        return self._theirs["gpu"].opengl

    def points(self, angle: float, zoom: float) -> Iterator[Point]:
        """Yield every way to draw a view."""
        camera = self._view.azimuth(angle)
        camera = camera.replace(view_angle=camera.view_angle / zoom)
        ways: dict[tuple[str, float, float], tuple[OffScreenVolume, Callable[[], object]]] = {}
        put: Callable[[], object]
        full = {}
        for name, baseline in self._theirs.items():
            _set(baseline, 1.0, FULL_STEP * self._voxel)
            full[name] = baseline.image(camera)
            for distance in DISTANCES:
                for step in STEPS:
                    put = partial(_set, baseline, distance, step * self._voxel)
                    ways[name, distance, step] = baseline, put
        exact = self._volumes[FULL_STEP]
        exact.mapper.SetImageSampleDistance(1)
        full["vdi"] = full["volume"] = exact.image(camera)
        ways["volume", 1.0, FULL_STEP] = exact, lambda: None
        for distance in _OWN_DISTANCES:
            put = partial(self._vdi.mapper.SetImageSampleDistance, distance)
            ways["vdi", distance, FULL_STEP] = self._vdi, put
            for step in STEPS:
                drawn = self._volumes[step]
                put = partial(drawn.mapper.SetImageSampleDistance, distance)
                ways["volume", distance, step] = drawn, put
        pictures = {}
        for way, (drawn_by, put) in ways.items():
            put()
            pictures[way] = drawn_by.image(camera)
        with ThreadPoolExecutor(os.cpu_count()) as pool:  # before anything is timed
            compared = pool.map(compare_images, pictures.values(), (full[w[0]] for w in ways))
            ssim = {way: float(found.ssim) for way, found in zip(ways, compared, strict=True)}

        def frame(drawn_by: OffScreenVolume, put: Callable[[], object]) -> None:
            put()
            drawn_by.render(camera)

        work = {way: partial(frame, *both) for way, both in ways.items()}
        named = {str(way): step for way, step in work.items()}
        taken = take_turns(named, self._plan.repeats)
        for way in ways:
            seconds = median(taken[str(way)])
            assert seconds is not None
            yield Point(*way, round(seconds, 6), round(ssim[way], 6))


def _set(baseline: VTKBaseline, distance: float, step: float) -> None:
    baseline.set_image_sample_distance(distance)
    baseline.set_sample_distance(step)


def summary(found: FrontFile) -> list[str]:
    """Return lines of a report in Markdown: gains over VTK by view and by case, and on what."""
    by_view: dict[str, list[list[Point]]] = {}
    by_case: dict[str, list[list[Point]]] = {}
    for case, angle, zoom, points in found.views():
        title = f"{angle:g} degrees" + (f", zoomed by {zoom:g}" if zoom != 1 else "")
        by_view.setdefault(title, []).append(points)
        by_case.setdefault(case, []).append(points)
    by_view["all"] = [points for views in by_case.values() for points in views]
    lines = []
    for first, groups in (("view", by_view), ("volume, transfer function", by_case)):
        rows = []
        for title, views in groups.items():
            gained = [gain for points in views for gain in gains(points)]
            if gained:
                full = _mean([full_gain(points) for points in views])
                alone = _mean([cost for points in views for cost in cost_alone(points)])
                least = f"{min(gained):.2f}"
                rows.append([title, str(len(gained)), _mean(gained), least, full, alone])
        head = [first, "points of VTK's front", "VTK's time / ours, geometric mean", "worst"]
        more = ["of VTK's full picture", "a VDI's alone / VTK's"]
        lines += [*table([*head, *more], rows), ""]
    return lines[:-1] + closing(found.data)


def _mean(ratios: Sequence[float]) -> str:
    """Return the geometric mean."""
    return f"{math.exp(float(np.mean(np.log(ratios)))):.2f}" if ratios else ABSENT
