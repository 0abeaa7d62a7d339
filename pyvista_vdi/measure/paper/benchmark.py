"""The run: its plan, and what each row of the results holds."""

import json
import math
import os
import statistics
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.measure import harness
from pyvista_vdi.measure.clock import Times, take_turns
from pyvista_vdi.measure.harness import (
    ROOMS,
    Bench,
    Case,
    Image,
    Latest,
    Progress,
    accuracy,
    check_angles,
    check_count,
    enlarged,
    sizes_of,
)
from pyvista_vdi.measure.paper.datasets import DEFAULT_SEED, Dataset, find_dataset, label_of
from pyvista_vdi.measure.paper.report import PACKED, paper_targets
from pyvista_vdi.measure.results import Results
from pyvista_vdi.model.options import check_max_supersegments
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.quality.frame_rate import FrameRateController

#: The paper's windows, supersegments and angles; and angles beyond the paper's.
SIZES = ((1280, 720), (1920, 1080))
LIMITS = (15, 30)
ANGLES = (0.0, 5.0, 15.0, 30.0, 60.0, 90.0, 180.0)

#: Frames of each kind at a view: two runs of five are the fewest that a rank sum can tell apart.
REPEATS = 5

#: Frames in which the controller may find its choice, and those that are measured afterwards.
_SETTLING_FRAMES = 12
_MEASURED_FRAMES = 5

#: Samples of a ray that count as full quality where samples along rays are given up.
_MOST_SAMPLES = 64


@dataclass(frozen=True)
class Plan:
    """What a run measures; numbers out of their range raise InvalidArgumentError.

    ``profile`` is the name of what the rest began as. ``datasets`` are names that
    :func:`pyvista_vdi.measure.paper.find_dataset` knows; ``sizes`` windows, pixels; ``limits``
    longest lists, the paper's N_S; ``angles`` degrees of ``Azimuth`` from V_O. There are so many
    ``repeats`` of frames of each candidate at each view, and ``generations`` of each VDI.
    ``preview`` is data set, window, N_S and angle of Table 2; None leaves it out. ``queued`` frames
    are also enqueued at once and left on the device, and as many of the packed VDI. ``seed`` is
    that of the procedural volumes.
    """

    profile: str
    datasets: tuple[str, ...]
    sizes: tuple[tuple[int, int], ...] = SIZES
    limits: tuple[int, ...] = LIMITS
    angles: tuple[float, ...] = ANGLES
    repeats: int = REPEATS
    generations: int = 3
    interpolation: str = "nearest"
    preview: tuple[str, tuple[int, int], int, float] | None = None
    queued: int = 0
    vtk: bool = True
    seed: int = DEFAULT_SEED

    def __post_init__(self) -> None:
        check_count("repeats", self.repeats)
        check_count("generations", self.generations)
        check_count("queued", self.queued, least=0)
        labels = [label_of(name) for name in self.datasets]
        twice = sorted({name for name in labels if labels.count(name) > 1})
        if twice:
            raise InvalidArgumentError(
                f"{twice[0]!r} is given twice: name files differently, as in kingsnake=FILE"
            )
        check_angles(self.angles)
        for limit in self.limits:
            check_max_supersegments(limit)
        if self.seed < 0:
            raise InvalidArgumentError(f"seed must be 0 or above; got {self.seed!r}")

    def found(self) -> dict[str, Dataset]:
        """Return the data sets by what the results call them; that of Table 2 may be one more."""
        names = [*self.datasets, *([self.preview[0]] if self.preview else [])]
        return {label_of(name): find_dataset(name, self.seed) for name in names}

    def cases(self) -> Iterator[Case]:
        """Yield what the rows are about: volumes, VDIs, views, and Table 2."""

        def case(what: str, size: tuple[int, int], limit: int, angle: float | None = None) -> Case:
            return Case(label, None, size, angle, 1.0, (("max_supersegments", limit),), (), what)

        measured = [label_of(name) for name in self.datasets]
        for label in self.found():
            yield Case(label, what="volume")
            for size, limit in product(self.sizes, self.limits) if label in measured else ():
                yield case("vdi", size, limit)
                yield from (case("view", size, limit, angle) for angle in self.angles)
            if self.preview is not None and label == label_of(self.preview[0]):
                yield case("preview", *self.preview[1:])

    def to_dict(self) -> dict[str, Any]:
        """Return everything in values that JSON can hold; files without their folders."""
        described = asdict(self)
        described["datasets"] = [label_of(name) for name in self.datasets]
        if self.preview is not None:
            names = ("dataset", "window_size", "max_supersegments", "angle")
            described["preview"] = dict(zip(names, self.preview, strict=True))
            described["preview"]["dataset"] = label_of(self.preview[0])
        plain: dict[str, Any] = json.loads(json.dumps(described))
        return plain


_AT_THE_PAPERS_SIZES: Mapping[str, Any] = {
    "datasets": ("kingsnake_like", "beechnut_like", "richtmyer_meshkov_like"),
    "preview": ("beechnut_like", SIZES[1], 15, 30.0),
}

#: Arguments of :class:`Plan` by the name of a profile. ``full`` also takes every volume in the
#: folder that ``PYVISTA_VDI_DATA`` names.
PROFILES: Mapping[str, Mapping[str, Any]] = {
    # Sized for ten minutes on two cores
    "quick": {
        "datasets": (
            *("brain", "rayleigh_taylor"),
            *("kingsnake_like@4", "beechnut_like@4", "richtmyer_meshkov_like@8"),
        ),
        "sizes": SIZES[:1],
        "angles": (0.0, 5.0, 30.0),
        "generations": 1,
        "preview": ("beechnut_like@4", SIZES[0], 15, 30.0),
    },
    "full": _AT_THE_PAPERS_SIZES,
    # The paper's cells, sized for five minutes on a data centre's GPU
    "gpu": {**_AT_THE_PAPERS_SIZES, "angles": (0.0, 5.0, 30.0), "queued": 200},
}


def open_results(
    plan: Plan, path: str | os.PathLike[str], device: Any = None, *, resume: bool = False
) -> Results:
    """Return results that hold nothing yet, or those of an earlier run of the same plan."""
    extent = "sample" if plan.profile == "quick" else "whole"
    more = {"rooms": (*ROOMS, "quality"), "extent": extent, "device": device, "resume": resume}
    return Results.begun("benchmark", plan.to_dict(), path=path, **more)


def run(plan: Plan, results: Results, device: Any = None, progress: Progress | None = None) -> None:
    """Measure what is missing, and write the file after every row.

    A volume or VDI that the host or the device cannot hold gives rows that are marked as refused,
    with the reason.

    ``progress`` is called with the finished fraction and what is being done.
    """
    rows = _Rows(plan, results, device)
    try:
        harness.run(plan.cases(), rows.figures, results, progress)
        results.save()
    finally:
        rows.close()


class _Rows:
    """Measures cases; a volume, a window with its VTK mappers and a VDI at a time."""

    def __init__(self, plan: Plan, results: Results, device: Any) -> None:
        self._plan, self._results, self._runtime = plan, results, get_runtime(device)
        self._datasets = plan.found()
        self._volumes = Latest(self._load)
        self._benches = Latest(self._bench)
        self._vdis = Latest(self._vdi)

    def figures(self, case: Case) -> dict[str, Any]:
        """Return the figures of a case."""
        figures: dict[str, Any] = getattr(self, f"_{case.what}_row")(case)
        return figures

    def close(self) -> None:
        """Release VTK's windows, and what lies on the device."""
        for kept in (self._vdis, self._benches, self._volumes):
            kept.close()

    def _load(self, name: str) -> tuple[Volume, float]:
        self._vdis.close()
        self._benches.close()  # two volumes at a time may be too many
        dataset = self._datasets[name]
        if dataset.nbytes is not None:
            # Refuse a volume that no buffer of the device can hold, before it is made
            with self._runtime.buffer((dataset.nbytes,), np.uint8, f"volume {name!r}"):
                pass
        begin = time.perf_counter()
        return dataset.load(), time.perf_counter() - begin

    def _bench(self, name: str, size: tuple[int, int]) -> Bench:
        volume, _ = self._volumes(name)
        table = self._datasets[name].transfer_function(volume, self._plan.interpolation)
        bench = Bench(volume, table, size, device=self._runtime, vtk=self._plan.vtk)
        if bench.opengl is not None:
            self._results.data["system"]["opengl"] = bench.opengl
        return bench

    def _vdi(self, name: str, size: tuple[int, int], limit: int) -> tuple[dict[str, VDI], Times]:
        bench = self._benches(name, size)
        made, seconds = bench.timed_generation(self._plan.generations, max_supersegments=limit)
        if self._plan.queued:
            made |= {precision: made["exact"].with_precision(precision) for precision in PACKED}
        return made, seconds["generate"]

    def _made(self, case: Case) -> tuple[Bench, dict[str, VDI], Times]:
        key = (case.volume, case.window_size)
        self._volumes(case.volume)  # before what is made of it: loading closes what was
        return self._benches(*key), *self._vdis(*key, case.chosen["max_supersegments"])

    def _volume_row(self, case: Case) -> dict[str, Any]:
        volume, seconds = self._volumes(case.volume)
        return {**self._datasets[case.volume].describe(volume), "load_seconds": seconds}

    def _vdi_row(self, case: Case) -> dict[str, Any]:
        _, made, seconds = self._made(case)
        return {"generation_seconds": seconds, **sizes_of(made["exact"])}

    def _view_row(self, case: Case) -> dict[str, Any]:
        """Compare the pictures of one view, and time everybody's frames."""
        bench, made, _ = self._made(case)
        camera, vdi = case.camera(bench.view), made["exact"]
        reference, near_vtk = bench.reference(camera), bench.near_vtk(camera)
        frames, count = bench.frames(camera, vdi), self._plan.queued
        return {
            "vdi_to_volume": accuracy(bench.draw(vdi, camera), reference),
            "volume_to_vtk_gpu": near_vtk,
            "seconds": take_turns(frames, self._plan.repeats, runtime=self._runtime),
            **({"queued_seconds": bench.queued(made, camera, count)} if count else {}),
            "left_out": {name: str(error) for name, error in bench.left_out.items()},
        }

    def _preview_row(self, case: Case) -> dict[str, Any]:
        """Keep each target rate of the paper's Table 2 in both ways, and look at the pictures."""
        bench, made, _ = self._made(case)
        camera, vdi = case.camera(bench.view), made["exact"]
        reference, whole = bench.reference(camera), bench.draw(vdi, camera)
        frame = {"full": partial(bench.draw, vdi, camera)}
        full = take_turns(frame, self._plan.repeats, runtime=self._runtime)["full"]
        width, height = bench.size

        def fewer_pixels(pixels: int) -> Image:
            edge = math.sqrt(pixels / (width * height))
            size = max(1, round(width * edge)), max(1, round(height * edge))
            return bench.draw(vdi, camera, size)

        def fewer_samples(samples: int) -> Image:
            return bench.draw(vdi, camera, preview_samples=samples)

        ways = {
            "fewer pixels": (fewer_pixels, width * height),
            "samples per ray": (fewer_samples, _MOST_SAMPLES),
        }
        rows = []
        for (speed_up, ssim), (name, (way, most)) in product(paper_targets(), ways.items()):
            # Multiples of the full frame's rate ask the same of every device
            target = speed_up / statistics.median(full["clock"])
            samples, taken, image = _kept(way, most, target)
            shown = enlarged(image, bench.size)
            rows.append(
                {
                    "way": name,
                    "target_speed_up": speed_up,
                    "paper_ssim": ssim,
                    "samples": samples,
                    "share": samples / most,
                    "seconds": {"clock": taken, "device": []},
                    "to_full": accuracy(shown, whole),
                    "to_volume": accuracy(shown, reference),
                }
            )
        return {"seconds": full, "to_volume": accuracy(whole, reference), "ways": rows}


def _kept(
    way: Callable[[int], Image], most: int, target_fps: float
) -> tuple[int, list[float], Image]:
    """Return the controller's settled choice, the frames' times and the last picture."""
    way(most)  # not counted: its kernel may have to be compiled
    controller = FrameRateController(target_fps, floor=1 / most)
    image: list[Image] = []

    def frames(samples: int, repeats: int) -> list[float]:
        def frame() -> None:
            image[:] = [way(samples)]

        return take_turns({"way": frame}, repeats, warm_up=False)["way"]["clock"]

    for _ in range(_SETTLING_FRAMES):
        samples = controller.choose(most)
        (seconds,) = frames(samples, 1)
        controller.record(samples, seconds, seconds)
    samples = controller.choose(most)
    return samples, frames(samples, _MEASURED_FRAMES), image[0]
