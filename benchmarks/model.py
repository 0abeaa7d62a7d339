"""The least that every stage could take on this machine, what it takes, and the gap.

Reads ``machine_cpu.json`` or ``machine_gpu.json`` (run ``machine.py`` first), counts what rays meet
(``counting.py``), and writes ``model_WxH.json`` (all figures) and ``.md`` (the tables). See
README.md in this folder.

One stage follows the other, each by the counts of the one before: one file.

Counts, floors and gaps of all stages stand beside each other: hence more than 500 lines.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from common import (  # beside this file
    add_clock,
    add_looks,
    add_redo,
    add_size,
    clock_of,
    measure_missing,
    new_parser,
)
from counting import (
    CountedVDI,
    March,
    Rays,
    Walk,
    busy_lanes,
    march,
    sampled_blocks,
    visible_blocks,
    walk,
)
from machine import Rates, Stopwatch, cache_of

from pyvista_vdi.device import Profile, Runtime, get_runtime
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.measure.paper import find_dataset
from pyvista_vdi.measure.report import system_line, table
from pyvista_vdi.measure.session import VDIRenderer
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.model.standard_cases import ANGLES, filling_camera
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.raycasting.prepared import PreparedVDI, prepared_vdi
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.render import raycast_medium

LEGEND = (
    "`floor`: the slowest of memory, gathers and arithmetic at the rates that `machine.py` has "
    "measured, and launches and transfers. `gap`: measured over floor. `waiting`: the floor if "
    "every gather is waited for, over the floor. Counts are means per ray."
)

#: One volume of each kind: turbulent, mostly empty, with a solid core, and solid throughout.
VOLUMES = ("heptane", "visible_female_head", "bonsai", "berea")

#: One block of 4 x 4 rays is counted in so many pixels both ways.
EVERY = 32

# Bytes on the device: offset of a list, mask of a tile, faces and medium of a supersegment; an
# exact supersegment in a VDI's arrays; RGBA float32; an entry of the transfer function.
OFFSET, MASK, FACES, MEDIUM, SUPERSEGMENT, PIXEL, ENTRY = 4, 8, 8, 16, 24, 16, 16

#: A walk's rays share with their neighbours in a block about as much as this times one ray's bytes.
SHARED_BY_BLOCK = 4


@dataclass(frozen=True)
class Operations:
    """Float32 operations: multiply-adds (and what costs as much), divisions, exponentials."""

    multiply_add: float = 0.0
    divide: float = 0.0
    exponential: float = 0.0

    def times(self, n: float) -> Operations:
        """Return n times as many."""
        return Operations(self.multiply_add * n, self.divide * n, self.exponential * n)

    def __add__(self, other: Operations) -> Operations:
        return Operations(
            self.multiply_add + other.multiply_add,
            self.divide + other.divide,
            self.exponential + other.exponential,
        )


# Counted by reading the kernels as simply as they could be written; address arithmetic, masks and
# what decides where to go are left out.
#: Clipping to eleven planes, both ends in list space, the crossings' coefficients.
OF_LIST_RAY = Operations(130, 20)
#: Two crossings, the nearer one, the depth there, one step.
OF_LIST = Operations(12)
#: Clip to two faces, length, opacity, over.
OF_SUPERSEGMENT = Operations(16, 1, 1)
#: A tile's border and slab ahead.
OF_STACK = Operations(16, 1)
#: Clipping to seven planes, positions and steps.
OF_MARCHED_RAY = Operations(80, 14)
#: Faces of a step, position, place of the nearest voxel.
OF_SAMPLE = Operations(18)
#: Weights and seven interpolations.
OF_LINEAR = Operations(24)
#: Place in the table, two entries mixed; and the optical depth of what is not transparent.
OF_CLASSIFICATION, OF_CLASSIFIED = Operations(12), Operations(0, 0, 1)
#: Opacity of a step, over; only where it is not transparent.
OF_VISIBLE = Operations(8, 0, 1)
#: The block's border ahead.
OF_BLOCK = Operations(18)
#: Feature of a step, its difference from the run, the run grown.
OF_RUN_STEP = Operations(28, 3)
#: Two runs become one, and its errors with both neighbours are known.
OF_MERGE = Operations(60, 5)
#: A supersegment's colour and optical depth from a run; its faces in list space and extinction.
OF_PACKING, OF_PREPARING = Operations(4, 3), Operations(6, 3)


@dataclass(frozen=True)
class Gathers:
    """Elements gathered: how many, of how many bytes, and from how many bytes."""

    elements: float
    size: int
    working_set: float


@dataclass(frozen=True)
class Work:
    """What a stage has to do at least.

    Attributes
    ----------
    read, write : float
        Bytes that memory has to give and take, each once.
    gathers : tuple of Gathers
        Elements at places that differ by lane.
    operations : Operations
        Arithmetic.
    launches : int
        Kernels that are waited for.
    download : float
        Bytes to the host.
    """

    read: float = 0.0
    write: float = 0.0
    gathers: tuple[Gathers, ...] = ()
    operations: Operations = field(default_factory=Operations)
    launches: int = 0
    download: float = 0.0


@dataclass(frozen=True)
class Floor:
    """The least time of some work, seconds.

    Attributes
    ----------
    memory, gathers, arithmetic : float
        Of each resource by itself; they overlap at best.
    around : float
        Launches and transfers, which nothing overlaps.
    waiting : float
        What gathers take where each is waited for before the next.
    gathered_from : str
        The smallest cache that holds what most of the gathers' time goes to, or memory.
    """

    memory: float
    gathers: float
    arithmetic: float
    around: float
    waiting: float
    gathered_from: str

    @property
    def seconds(self) -> float:
        """The floor: the slowest resource, and what nothing overlaps."""
        return max(self.memory, self.gathers, self.arithmetic) + self.around

    @property
    def bound(self) -> str:
        """Which resource decides."""
        times = {
            "memory": self.memory,
            f"gathers ({self.gathered_from})": self.gathers,
            "arithmetic": self.arithmetic,
            "launches and transfers": self.around,
        }
        return max(times, key=lambda name: times[name])

    def to_dict(self) -> dict[str, Any]:
        """Return everything in values that JSON can hold."""
        return {**asdict(self), "seconds": self.seconds, "bound": self.bound}


def floor_of(work: Work, rates: Rates) -> Floor:
    """Return the least time of some work on a machine with these rates."""
    operations = asdict(work.operations)
    gathers = {g: g.elements / rates.gather(g.size, g.working_set) for g in work.gathers}
    longest = max(gathers, key=lambda g: gathers[g], default=Gathers(0.0, 1, 0.0))
    return Floor(
        memory=work.read / rates.read + work.write / rates.write,
        gathers=sum(gathers.values()),
        arithmetic=sum(n / rates.operations[name] for name, n in operations.items()),
        around=work.launches * rates.launch + work.download / rates.download,
        waiting=sum(
            g.elements / rates.gather(g.size, g.working_set, "near, chained") for g in work.gathers
        ),
        gathered_from=cache_of(longest.working_set, rates.caches),
    )


# -- what stages have to do ------------------------------------------------------------------------


def raycast_work(walked: Walk, size: tuple[int, int], n_bytes: float, *, skips: bool) -> Work:
    """Return the work of a VDI frame's raycast.

    Parameters
    ----------
    walked : Walk
        Of some of the rays.
    size : (int, int)
        Window, pixels.
    n_bytes : float
        Of the lists on the device; memory gives each byte once at most.
    skips : bool
        Whether empty cells are passed by.
    """
    rays = size[0] * size[1]
    each = {name: rays * float(np.mean(value)) for name, value in vars(walked).items()}
    hits = rays * float(np.mean(walked.lists > 0))
    visits, filled = (
        (each["occupied"], each["filled_occupied"]) if skips else (each["lists"], each["filled"])
    )
    tiles = each["tiles"] if skips else 0.0
    met = each["met"]
    # Where a ray ends in a list, one face more than is met says so
    gathered = visits * 2 * OFFSET + (met + filled) * FACES + met * MEDIUM
    shared = SHARED_BY_BLOCK * gathered / max(hits, 1.0)
    return Work(
        read=min(gathered, n_bytes),
        write=rays * PIXEL,
        gathers=(
            Gathers(visits, 2 * OFFSET, shared),
            Gathers(met + filled, FACES, shared),
            Gathers(met, MEDIUM, shared),
            Gathers(tiles, MASK, shared),
        ),
        operations=OF_LIST_RAY.times(rays)
        + OF_LIST.times(visits)
        + OF_SUPERSEGMENT.times(met)
        + OF_STACK.times(tiles),
        launches=1,
    )


def march_work(
    marched: March,
    volume: Volume,
    function: TransferFunction,
    size: tuple[int, int],
    visible_share: float,
    *,
    records: bool,
) -> Work:
    """Return the work of a march along the rays of a window.

    Parameters
    ----------
    marched : March
        Of some of the rays.
    volume, function
        What is marched through, and how it looks.
    size : (int, int)
        Window, pixels.
    visible_share : float
        Share of the blocks that are not transparent: memory gives their voxels once.
    records : bool
        Whether runs are recorded for generation, or a picture is made.
    """
    rays = size[0] * size[1]
    each = {name: rays * float(np.mean(value)) for name, value in vars(marched).items()}
    samples, visible = each["looked"], each["visible"]
    linear = function.interpolation == "linear"
    # A whole number has an entry of its own, which says the optical depth as well
    looked_up = not linear and volume.array.dtype.kind in "iu"
    item = min(volume.array.dtype.itemsize, 4)
    table_bytes = len(function.opacities) * ENTRY
    sampled = samples * item * (8 if linear else 1)
    per_ray = sampled / max(rays, 1)
    operations = OF_MARCHED_RAY.times(rays) + OF_SAMPLE.times(samples) + OF_VISIBLE.times(visible)
    operations += OF_BLOCK.times(each["blocks"])
    if linear:
        operations += OF_LINEAR.times(samples)
    if not looked_up:
        operations += OF_CLASSIFICATION.times(samples) + OF_CLASSIFIED.times(visible)
    if records:
        operations += OF_RUN_STEP.times(visible)
    return Work(
        read=min(visible_share * volume.array.size * item, sampled),
        write=0.0 if records else rays * PIXEL,
        gathers=(
            Gathers(samples * (8 if linear else 1), item, SHARED_BY_BLOCK * per_ray),
            Gathers(samples if looked_up else 2 * samples, ENTRY, table_bytes),
            Gathers(each["blocks"] + samples / 8, 1, SHARED_BY_BLOCK * per_ray),
        ),
        operations=operations,
        launches=1,
    )


def shorten_work(marched: March, size: tuple[int, int], supersegments: int) -> Work:
    """Return the work of merging what a march has recorded down to what was kept."""
    recorded = size[0] * size[1] * float(np.mean(marched.runs))
    return Work(operations=OF_MERGE.times(max(recorded - supersegments, 0.0)), launches=1)


def pack_work(vdi: VDI) -> Work:
    """Return the work of writing a VDI's arrays from its records, which a cache can hold."""
    n, lists = vdi.n_supersegments, len(vdi.offsets)
    return Work(
        write=n * SUPERSEGMENT + lists * 8,
        operations=OF_PACKING.times(n),
        launches=1,
    )


def preparation_work(vdi: VDI) -> Work:
    """Return the work of bringing a VDI's arrays into the raycaster's form, once per VDI."""
    n, lists = vdi.n_supersegments, len(vdi.offsets)
    return Work(
        read=n * SUPERSEGMENT + lists * 8,
        write=n * (FACES + MEDIUM) + lists * OFFSET,
        operations=OF_PREPARING.times(n),
        launches=3,
    )


def hosted_work(vdi: VDI, runtime: Runtime) -> Work:
    """Return the work of a VDI's arrays on the host: each is looked at once, to be checked.

    A CPU device writes them where they stay.
    """
    n_bytes = vdi.n_supersegments * SUPERSEGMENT
    return Work(read=n_bytes, download=0.0 if runtime.is_cpu else n_bytes)


def around_work(size: tuple[int, int], runtime: Runtime) -> Work:
    """Return the work around a frame whose picture goes to the host: from a GPU, a copy."""
    return Work(launches=1, download=0.0 if runtime.is_cpu else size[0] * size[1] * PIXEL)


def plotted_work(size: tuple[int, int]) -> Work:
    """Return the work around a frame in a plotter: into a texture, over the framebuffer."""
    pixels = size[0] * size[1]
    return Work(read=pixels * (2 * PIXEL + 4), write=pixels * (PIXEL + 4))


# -- measuring -------------------------------------------------------------------------------------


class Model:
    """Counts, floors and times of one volume and its VDI.

    Parameters
    ----------
    runtime : Runtime
        The device.
    rates : Rates
        Of that device.
    volume : Volume
        What is drawn.
    function : TransferFunction
        How it looks.
    size : (int, int)
        Window, pixels.
    every : int
        See :func:`counting.sampled_blocks`.
    """

    def __init__(
        self,
        runtime: Runtime,
        rates: Rates,
        volume: Volume,
        function: TransferFunction,
        size: tuple[int, int],
        every: int = EVERY,
    ) -> None:
        self._runtime, self._rates = runtime, rates
        self._volume, self._function, self._size = volume, function, size
        self._pixels = sampled_blocks(size, every)
        self._blocks = visible_blocks(volume, function)
        self._counted: CountedVDI | None = None

    def frame(self, vdi: VDI, camera: Camera, *, n_bytes: float, skips: bool) -> dict[str, Any]:
        """Return counts per ray and the floor of a VDI frame's raycast."""
        if self._counted is None or self._counted.vdi is not vdi:
            self._counted = CountedVDI(vdi)
        walked = walk(
            self._counted,
            Rays.of(camera, self._size, *self._pixels),
            perspective=not camera.parallel_projection,
            skips=skips,
        )
        turns = (walked.occupied if skips else walked.lists) + walked.met
        return {
            "per ray": {
                **{name: float(np.mean(value)) for name, value in vars(walked).items()},
                "lanes busy": busy_lanes(turns),
                "lanes in step": float(turns.sum() / max(walked.in_step.sum(), 1)),
                "skips": skips,
            },
            **self._floor(raycast_work(walked, self._size, n_bytes, skips=skips)),
        }

    def volume_frame(self, camera: Camera, step: float, *, stops: bool = True) -> dict[str, Any]:
        """Return counts per ray and the floor of a volume raycast with steps of ``step``."""
        marched = self._marched(camera, step, stops=stops)
        return {**_counts(marched), **self._floor(self._march_work(marched, records=False))}

    def generation(self, vdi: VDI, camera: Camera, step: float) -> dict[str, dict[str, Any]]:
        """Return counts per ray and the floors of generation's stages."""
        marched = self._marched(camera, step, stops=False, runs=True)
        runs, kept = float(np.mean(marched.runs)), vdi.n_supersegments / np.prod(self._size)
        counts = {"runs": runs, "supersegments": float(kept)}
        shorten = shorten_work(marched, self._size, vdi.n_supersegments)
        return {
            "march": {**_counts(marched), **self._floor(self._march_work(marched, records=True))},
            "shorten": {"per ray": counts, **self._floor(shorten)},
            "pack": {"per ray": counts, **self._floor(pack_work(vdi))},
        }

    def floor(self, work: Work) -> dict[str, Any]:
        """Return the floor of work that needs no counting."""
        return {"per ray": {}, **self._floor(work)}

    def _marched(self, camera: Camera, step: float, *, stops: bool, runs: bool = False) -> March:
        return march(
            self._volume,
            self._function,
            Rays.of(camera, self._size, *self._pixels),
            step,
            blocks=self._blocks,
            stops=stops,
            runs=runs,
            perspective=not camera.parallel_projection,
        )

    def _march_work(self, marched: March, *, records: bool) -> Work:
        share = float(self._blocks.mean())
        return march_work(marched, self._volume, self._function, self._size, share, records=records)

    def _floor(self, work: Work) -> dict[str, Any]:
        return {"floor": floor_of(work, self._rates).to_dict()}


def _counts(marched: March) -> dict[str, Any]:
    means = {name: float(np.mean(value)) for name, value in vars(marched).items()}
    return {"per ray": {**means, "lanes busy": busy_lanes(marched.looked + marched.blocks)}}


def stage_of(kernel: str) -> str:
    """Return which of generation's stages a kernel belongs to, by its name."""
    if "march" in kernel or "record" in kernel:
        return "march"
    return "pack" if any(word in kernel for word in ("pack", "lengths", "offsets")) else "shorten"


def profiled(watch: Stopwatch, work: Callable[[], Any]) -> list[dict[str, float]]:
    """Return, for each run of some work, seconds of its kernels by name, and of the rest as "".

    Kernels are timed by the driver's events; where the clock is not the wall's, in proportion. One
    run before is not counted.
    """
    work()
    found = []
    for _ in range(watch.repeats):
        profile = Profile()
        with watch.runtime.queue_scope(profile):
            begin, began = watch.clock(), time.perf_counter()
            work()
            taken = time.perf_counter() - began
            share = (watch.clock() - begin) / taken
        kernels = {
            row.name: share * row.total_ms * 1e-3
            for row in profile.figures()
            if not row.name.startswith("[")
        }
        found.append({**kernels, "": share * taken - sum(kernels.values())})
    return found


def medians(runs: list[dict[str, float]], key: Callable[[str], str]) -> dict[str, float]:
    """Return the median over runs of the sums of what ``key`` puts together."""
    sums: list[dict[str, float]] = []
    for run in runs:
        total: dict[str, float] = {}
        for name, seconds in run.items():
            total[key(name)] = total.get(key(name), 0.0) + seconds
        sums.append(total)
    return {name: float(np.median([total[name] for total in sums])) for name in sums[0]}


def measured(name: str, options: argparse.Namespace, rates: Rates) -> dict[str, Any]:
    """Return counts, floor and time of every stage for one volume."""
    runtime, size = get_runtime(options.device), tuple(options.size)
    dataset = find_dataset(name)
    volume = dataset.load(None)
    function = dataset.transfer_function(volume, options.interpolation)
    view, voxel = filling_camera(volume.bounds, size), min(volume.spacing)
    model = Model(runtime, rates, volume, function, size, options.every)
    watch = Stopwatch(runtime, options.repeats, clock_of(options, runtime))
    stages: dict[str, Any] = {}
    made: list[VDI] = []

    def generate() -> None:
        made[:] = [
            generate_vdi(
                volume,
                view,
                size,
                function,
                max_supersegments=options.max_supersegments,
                sample_distance=voxel / 2,
                device=runtime,
            )
        ]

    taken = medians(profiled(watch, generate), lambda k: stage_of(k) if k else "")
    vdi = made[0]
    for stage, entry in model.generation(vdi, view, voxel / 2).items():
        stages[f"generation: {stage}"] = {**entry, "seconds": taken.get(stage)}
    stages["generation: on the host"] = {
        **model.floor(hosted_work(vdi, runtime)),
        "seconds": taken[""],
    }
    medium = DeviceVolume(runtime, volume, function, sample_distance=voxel)
    taken = _kernels_and_rest(watch, lambda: raycast_medium(medium, FrameRequest(view, size)))
    stages["render_volume"] = {**model.volume_frame(view, voxel), "seconds": taken["kernels"]}

    taken = _kernels_and_rest(watch, lambda: PreparedVDI(runtime, vdi))
    stages["upload and preparation"] = {
        **model.floor(preparation_work(vdi)),
        "seconds": sum(taken.values()),
    }
    prepared = prepared_vdi(runtime, vdi)
    draw = VDIRenderer(runtime, vdi, size)
    for angle in options.angles:
        camera = view.azimuth(angle)
        taken = _kernels_and_rest(watch, lambda camera=camera: draw.image(camera))
        stages[f"VDI raycast, {angle:g} degrees"] = {
            **model.frame(
                vdi, camera, n_bytes=prepared.list_bytes, skips=prepared.occupancy.worthwhile
            ),
            "seconds": taken["kernels"],
        }
    stages["around a frame to the host"] = {
        **model.floor(around_work(size, runtime)),
        "seconds": taken["rest"],
    }
    if find_spec("pyvista") is not None:
        stages["around a frame in a plotter"] = {
            **model.floor(plotted_work(size)),
            "seconds": plotted(watch, vdi, size),
        }
    return {"supersegments": vdi.n_supersegments, "stages": stages}


def _kernels_and_rest(watch: Stopwatch, work: Callable[[], Any]) -> dict[str, float]:
    return medians(profiled(watch, work), lambda name: "kernels" if name else "rest")


def plotted(watch: Stopwatch, vdi: VDI, size: tuple[int, int]) -> float:
    """Return what a plotter's frame takes around the raycast, seconds; the camera moves."""
    import pyvista as pv

    plotter = pv.Plotter(off_screen=True, window_size=list(size))
    try:
        plotter.add_vdi(vdi, device=watch.runtime)
        camera = vdi.camera
        plotter.camera.position = camera.position
        plotter.camera.focal_point = camera.focal_point
        plotter.camera.up = camera.view_up
        plotter.camera.view_angle = camera.view_angle
        plotter.show(auto_close=False)

        def frame() -> None:
            plotter.camera.Azimuth(0.01)
            plotter.render()

        return _kernels_and_rest(watch, frame)["rest"]
    finally:
        plotter.close()


# -- the script ------------------------------------------------------------------------------------


def main() -> int:
    """Measure what is missing, and write what was found."""
    options = parsed()
    rates = Rates.read_for(get_runtime(options.device), options.machine or options.out)
    case = {
        "max_supersegments": options.max_supersegments,
        "interpolation": options.interpolation,
        "every": options.every,
        "clock": options.clock,
    }
    results = measure_missing(
        "model",
        options,
        case,
        options.volumes,
        lambda volume: measured(volume, options, rates),
        report,
    )
    print(report(results))
    return 0


def parsed() -> argparse.Namespace:
    """Return the options."""
    parser = new_parser(__doc__, repeats=3, repeated="timed runs of each stage")
    add_size(parser)
    parser.add_argument(
        "--volumes",
        nargs="+",
        default=list(VOLUMES),
        metavar="NAME",
        help="as for pyvista-vdi benchmark --datasets",
    )
    add_looks(parser, tf=None)
    parser.add_argument("--angles", nargs="+", type=float, default=list(ANGLES), metavar="DEGREES")
    parser.add_argument(
        "--every", type=int, default=EVERY, help="count one block of rays in so many pixels"
    )
    parser.add_argument(
        "--machine", type=Path, metavar="FOLDER", help="of machine.py, if not --out"
    )
    add_clock(parser)
    add_redo(parser)
    return parser.parse_args()


def report(results: Mapping[str, Any]) -> str:
    """Return the tables: the gaps of all volumes, then one per volume, a line per stage."""
    width, height = results["window_size"]
    case = f"N_S {results['max_supersegments']}, {results['interpolation']}"
    if results["clock"] == "cpu":
        case += ", by CPU time over cores"
    lines = [f"# A model, {width}x{height}, {case}", "", LEGEND, "", "## Gaps", ""]
    lines += table(("stage", *results["volumes"]), _gap_rows(results["volumes"]))
    for name, found in results["volumes"].items():
        lines += ["", f"## {name}: {found['supersegments']} supersegments", ""]
        heads = ("stage", "per ray", "bound by", "floor, ms", "measured, ms", "gap", "waiting")
        lines += table(heads, _rows(found["stages"]))
    return "\n".join([*lines, "", system_line(results["system"]), ""])


def _gap_rows(volumes: Mapping[str, Any]) -> Iterator[list[str]]:
    """Yield how many times its floor each stage takes, and what bounds the floor."""
    for stage in dict.fromkeys(name for found in volumes.values() for name in found["stages"]):
        entries = [found["stages"].get(stage) for found in volumes.values()]
        yield [stage, *("-" if entry is None else _gap(entry) for entry in entries)]


def _gap(entry: Mapping[str, Any]) -> str:
    floor = entry["floor"]
    if entry["seconds"] is None:
        return f"- ({floor['bound']})"
    return f"{entry['seconds'] / floor['seconds']:.1f} ({floor['bound']})"


def _rows(stages: Mapping[str, Any]) -> Iterator[list[str]]:
    for stage, entry in stages.items():
        floor, seconds = entry["floor"], entry["seconds"]
        waiting = max(floor["seconds"], floor["waiting"] + floor["around"])
        yield [
            stage,
            _described(entry["per ray"]),
            floor["bound"],
            f"{1e3 * floor['seconds']:.3g}",
            "-" if seconds is None else f"{1e3 * seconds:.3g}",
            "-" if seconds is None else f"{seconds / floor['seconds']:.1f}",
            f"{waiting / floor['seconds']:.1f}",
        ]


def _described(counts: Mapping[str, Any]) -> str:
    """Return the counts that say most about a stage."""
    if "lists" in counts:
        visits = counts["occupied" if counts["skips"] else "lists"]
        tiles = f", {counts['tiles']:.1f} tiles" if counts["skips"] else ""
        return (
            f"{visits:.1f} of {counts['lists']:.1f} lists, {counts['met']:.1f} met{tiles}; "
            f"{counts['lanes busy']:.0%} of the lanes, {counts['lanes in step']:.0%} list by list"
        )
    if "looked" in counts:
        return (
            f"{counts['looked']:.0f} of {counts['steps']:.0f} samples, {counts['visible']:.0f} "
            f"visible; {counts['lanes busy']:.0%} of the lanes"
        )
    if "runs" in counts:
        return f"{counts['runs']:.1f} runs to {counts['supersegments']:.1f}"
    return ""


if __name__ == "__main__":
    sys.exit(main())
