"""The front of time and accuracy: our ways to draw a volume against those of VTK's mappers.

Everybody draws whole frames into an off-screen window of VTK's, with fewer rays (image sample
distance) and longer steps, and is held against the own full picture: every pixel at steps of half a
voxel, by ``render_volume``'s kernel for ours and by the same mapper for VTK's.
"""

import contextlib
import os
import statistics
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial
from itertools import product
from typing import Any

from pyvista_vdi import examples
from pyvista_vdi.errors import DataNotFoundError, DeviceMemoryError
from pyvista_vdi.measure.clock import median, take_turns
from pyvista_vdi.measure.harness import ROOMS, Case, Latest, Progress, check_count, run
from pyvista_vdi.measure.results import ABSENT, Results, closing, table
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

    ``who`` is our "vdi" or "volume" raycaster, or VTK's "gpu" or "fixed_point" mapper; it casts a
    ray for ``distance`` pixels along each edge, in steps of ``step`` voxels, of a VDI those that it
    was generated with. ``seconds`` are the median of a frame.
    """

    who: str
    distance: float
    step: float
    seconds: float
    ssim: float

    @property
    def ours(self) -> bool:
        """Whether it is none of VTK's."""
        return self.who in ("vdi", "volume")


def front_of(points: Iterable[Point]) -> list[Point]:
    """Return the points that none is as fast and as near as, the fastest first."""
    best: list[Point] = []
    for point in sorted(points, key=lambda p: (p.seconds, -p.ssim)):
        if not best or point.ssim > best[-1].ssim:
            best.append(point)
    return best


def over(points: Iterable[Point], others: Sequence[Point]) -> list[float]:
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
class FrontPlan:
    """Which cases are measured: volumes and transfer functions by name, angles and zooms."""

    volumes: tuple[str, ...]
    looks: tuple[str, ...] = tuple(TRANSFER_FUNCTIONS)
    views: tuple[tuple[float, float], ...] = VIEWS
    window_size: tuple[int, int] = WINDOW_SIZE
    repeats: int = 3

    def __post_init__(self) -> None:
        check_count("repeats", self.repeats)

    @classmethod
    def quick(cls, **more: Any) -> "FrontPlan":
        """Return that of a short run."""
        return cls(QUICK_VOLUMES, views=QUICK_VIEWS, **more)

    def cases(self) -> Iterator[Case]:
        """Yield the views of each volume and transfer function."""
        for volume, look, (angle, zoom) in product(self.volumes, self.looks, self.views):
            yield Case(volume, look, self.window_size, angle, zoom)


def points_of(row: Mapping[str, Any]) -> list[Point]:
    """Return the ways of a view."""
    return [Point(*values) for values in row["points"]]


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

        classified = Classification.composited(look, "a front").transfer_function_of(volume)
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
    plan: FrontPlan,
    path: str | os.PathLike[str] | None = None,
    *,
    resume: bool = False,
    device: Any = None,
    progress: Progress | None = None,
) -> Results:
    """Measure, and write what there is to a JSON file after each view: see :func:`points_of`.

    ``resume`` goes on with the file, if it is there, which an earlier run of the same plan has
    left. ``progress`` is called with the finished fraction and what is being done.
    """
    extent = "whole" if set(examples.WHOLE) <= set(plan.volumes) else "sample"
    more = {"rooms": (*ROOMS, "vtk_pipeline"), "extent": extent, "device": device}
    found = Results.begun("front", asdict(plan), path=path, resume=resume, **more)
    there = examples.available()
    missing = f"{DataNotFoundError.__name__}: not in {examples.DATA_VARIABLE}"
    found.data["rows"] = [row for row in found.rows() if row.get("refused") != missing]
    for name in plan.volumes:
        if name not in there:
            found.add(Case(name).to_dict(), refused=missing)
    volumes = Latest(lambda name: examples.load_data(name, as_volume=True))
    with Latest(lambda name, look: _Everybody(volumes(name), look, plan, device)) as everybody:

        def measured(case: Case) -> dict[str, Any]:
            drawn = everybody(case.volume, case.look)
            found.data["system"].setdefault("opengl", drawn.opengl)
            return {"points": [list(asdict(point).values()) for point in drawn.points(case)]}

        cases = (case for case in plan.cases() if case.volume in there)
        run(cases, measured, found, progress, (DeviceMemoryError, MemoryError))
    found.save()
    return found


class _Everybody:
    """All who draw a volume with a transfer function."""

    def __init__(self, volume: Volume, look: str, plan: FrontPlan, device: Any) -> None:
        self._plan = plan
        self._voxel = voxel = min(volume.spacing)
        self._view = view = filling_camera(volume.bounds, plan.window_size)
        looks, size = TRANSFER_FUNCTIONS[look], plan.window_size
        classified = Classification.composited(looks, "a front").transfer_function_of(volume)
        prop = property_from_transfer_function(volume, classified)
        with contextlib.ExitStack() as stack:

            def own(draw: str, step: float) -> OurVolume:
                drawn = OurVolume(volume, looks, size, draw, step * voxel, view, device)
                return stack.enter_context(contextlib.closing(drawn))

            self._vdi = own("vdi", FULL_STEP)
            self._volumes = {step: own("volume", step) for step in (FULL_STEP, *STEPS)}
            self._theirs = {
                name: stack.enter_context(
                    contextlib.closing(VTKBaseline(volume, prop, size, name, voxel))
                )
                for name in MAPPERS
            }
            self.opengl = self._theirs["gpu"].opengl
            self.close = stack.pop_all().close

    def points(self, case: Case) -> Iterator[Point]:
        """Yield every way to draw a view."""
        camera = case.camera(self._view)
        ways: dict[tuple[str, float, float], tuple[OffScreenVolume, Callable[[], object]]] = {}
        full = {}
        for name, baseline in self._theirs.items():
            _set(baseline, 1.0, FULL_STEP * self._voxel)
            full[name] = baseline.image(camera)
            for distance, step in product(DISTANCES, STEPS):
                put = partial(_set, baseline, distance, step * self._voxel)
                ways[name, distance, step] = baseline, put
        exact = self._volumes[FULL_STEP]
        exact.mapper.SetImageSampleDistance(1)
        full["vdi"] = full["volume"] = exact.image(camera)
        ways["volume", 1.0, FULL_STEP] = exact, lambda: None
        ours = [("vdi", FULL_STEP, self._vdi)]
        ours += [("volume", step, self._volumes[step]) for step in STEPS]
        for distance, (name, step, drawn) in product(_OWN_DISTANCES, ours):
            ways[name, distance, step] = (
                drawn,
                partial(drawn.mapper.SetImageSampleDistance, distance),
            )

        def frame(drawn: OffScreenVolume, put: Callable[[], object]) -> None:
            put()
            drawn.render(camera)

        pictures = {}
        for way, (drawn_by, put_way) in ways.items():
            put_way()
            pictures[way] = drawn_by.image(camera)
        with ThreadPoolExecutor(os.cpu_count()) as pool:  # before anything is timed
            compared = pool.map(compare_images, pictures.values(), (full[w[0]] for w in ways))
            near = [float(found.ssim) for found in compared]
        work = {str(way): partial(frame, *both) for way, both in ways.items()}
        taken = take_turns(work, self._plan.repeats)
        for way, ssim in zip(ways, near, strict=True):
            yield Point(*way, median(taken[str(way)]) or 0.0, ssim)


def _set(baseline: VTKBaseline, distance: float, step: float) -> None:
    baseline.set_image_sample_distance(distance)
    baseline.set_sample_distance(step)


def summary(found: Results) -> list[str]:
    """Return lines of a report in Markdown: gains over VTK by view and by case, and on what."""
    by_view: dict[str, list[list[Point]]] = {}
    by_case: dict[str, list[list[Point]]] = {}
    for row in found.rows():
        if "refused" in row:
            continue
        case = row["case"]
        zoomed = f", zoomed by {case['zoom']:g}" if "zoom" in case else ""
        by_view.setdefault(f"{case['angle']:g} degrees{zoomed}", []).append(points_of(row))
        by_case.setdefault(f"{case['volume']}, {case['look']}", []).append(points_of(row))
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


def left_out(found: Results) -> Iterator[str]:
    """Yield what was not measured, and why."""
    for row in found.rows():
        if "refused" in row:
            names = (str(row["case"][n]) for n in ("volume", "look", "angle") if n in row["case"])
            yield f"{', '.join(names)} ({row['refused']})"


def _mean(ratios: Sequence[float]) -> str:
    return f"{statistics.geometric_mean(ratios):.2f}" if ratios else ABSENT
