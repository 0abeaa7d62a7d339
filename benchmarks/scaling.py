"""How cost grows with pixels, N_S, volume size and angle, and what a second core brings.

Writes ``scaling.json`` (all figures), ``.md`` (fitted exponents) and ``.png`` (plot). See README.md
in this folder.

Four scalings share volumes, cameras and one fit: hence more than 500 lines.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import os
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
from common import (  # beside this file
    add_clock,
    add_looks,
    add_redo,
    add_size,
    begun,
    clock_of,
    new_parser,
    save,
)
from tqdm import tqdm

from pyvista_vdi.device import Runtime, get_runtime
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.measure.clock import take_turns
from pyvista_vdi.measure.paper import find_dataset
from pyvista_vdi.measure.paper.procedural import PROCEDURAL
from pyvista_vdi.measure.report import (
    describe_system,
    new_figure,
    save_figure,
    system_line,
    table,
    write_text,
)
from pyvista_vdi.measure.session import VDIRenderer
from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.render import raycast_medium

LEGEND = (
    "Exponents of power laws, fitted by least squares of logarithms, with their 95 % confidence "
    "intervals; medians of turns."
)

#: What is timed.
QUANTITIES = ("VDI frame", "render_volume", "generation")

#: Least ratio of times on one core and on two.
LEAST_SCALING = 1.8

#: Seconds that a process with fewer cores may take for a run before it counts as lost.
_PATIENCE = 300.0

#: 97.5 % quantiles of Student's t by degrees of freedom; above the last, the normal's.
_STUDENT = (12.71, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228)
_NORMAL = 1.96


@dataclass(frozen=True)
class Case:
    """One point of the sweeps.

    Parameters
    ----------
    volume : str
        Name that ``find_dataset`` knows.
    size : (int, int)
        Window, pixels.
    limit : int
        N_S.
    angle : float
        Of the frame from V_O, degrees.
    """

    volume: str
    size: tuple[int, int]
    limit: int
    angle: float


@dataclass(frozen=True)
class Axis:
    """What one sweep changes.

    Parameters
    ----------
    name : str
        What tables call it.
    quantities : tuple of str
        Of :data:`QUANTITIES`, those that it changes.
    excess : bool
        Whether the exponent is that of what comes on top of the first case's cost.
    """

    name: str
    quantities: tuple[str, ...] = QUANTITIES
    excess: bool = False


AXES = {
    "pixels": Axis("pixels"),
    "supersegments": Axis("N_S", ("VDI frame", "generation")),
    "voxels": Axis("voxels along an edge"),
    "angle": Axis("angle, over the cost at V_O", ("VDI frame",), excess=True),
}


def sweeps(options: argparse.Namespace) -> dict[str, list[tuple[float, Case]]]:
    """Return, for each axis, what is changed and the case that this makes."""
    base = Case(options.volume, tuple(options.size), options.max_supersegments, options.angle)
    width, height = base.size

    def changed(**changes: Any) -> Case:
        return Case(**{**vars(base), **changes})

    quarters = (1, 2, 4) if options.quick else (1, 2, 3, 4, 6)
    sizes = [(width * k // 4, height * k // 4) for k in quarters]
    limits = (5, 10, 20) if options.quick else (5, 10, 20, 40)
    factors = (32, 16, 8) if options.quick else (32, 16, 8, 4)
    angles = (0.0, 5.0, 10.0, 20.0) if options.quick else (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 40.0)
    named = [f"{options.procedural}@{factor}" for factor in factors]
    return {
        "pixels": [(float(w * h), changed(size=(w, h))) for w, h in sizes],
        "supersegments": [(float(n), changed(limit=n)) for n in limits],
        "voxels": [(_edge(name), changed(volume=name)) for name in named],
        "angle": [(angle, changed(angle=angle)) for angle in angles],
    }


def _edge(name: str) -> float:
    """Return the mean voxels along the edges of a procedural volume, without making it."""
    kind, _, factor = name.partition("@")
    return float(np.prod(PROCEDURAL[kind].reduced(int(factor)))) ** (1 / 3)


# -- what is timed ---------------------------------------------------------------------------------


class Bench:
    """Makes the work of a case; volumes and VDIs that cases share are made once.

    Parameters
    ----------
    runtime : Runtime
        The device.
    interpolation : str
        Of volumes.
    """

    def __init__(self, runtime: Runtime, interpolation: str) -> None:
        self._runtime, self._interpolation = runtime, interpolation
        self._volumes: dict[str, tuple[Volume, Any]] = {}
        self._vdi: tuple[Any, VDI] | None = None

    def steps(self, case: Case, quantities: Sequence[str]) -> dict[str, Callable[[], object]]:
        """Return what is timed of a case, by quantity."""
        if case.volume not in self._volumes:
            dataset = find_dataset(case.volume)
            volume = dataset.load(None)
            function = dataset.transfer_function(volume, self._interpolation)
            self._volumes[case.volume] = volume, function
        volume, function = self._volumes[case.volume]
        view, voxel = filling_camera(volume.bounds, case.size), min(volume.spacing)
        generate = partial(
            generate_vdi,
            volume,
            view,
            case.size,
            function,
            max_supersegments=case.limit,
            sample_distance=voxel / 2,
            device=self._runtime,
        )
        camera = view.azimuth(case.angle)
        medium = DeviceVolume(self._runtime, volume, function, sample_distance=voxel)
        steps: dict[str, Callable[[], object]] = {
            "VDI frame": partial(self._draw(case, generate).image, camera),
            "render_volume": partial(raycast_medium, medium, FrameRequest(view, case.size)),
            "generation": generate,
        }
        return {name: steps[name] for name in quantities}

    def _draw(self, case: Case, generate: Callable[[], VDI]) -> VDIRenderer:
        made_for = (case.volume, case.size, case.limit)
        if self._vdi is None or self._vdi[0] != made_for:
            vdi = generate()
            self._vdi = made_for, vdi
        return VDIRenderer(self._runtime, self._vdi[1], case.size)


def measured_axis(
    bench: Bench,
    runtime: Runtime,
    points: list[tuple[float, Case]],
    axis: Axis,
    repeats: int,
    clock: Callable[[], float],
) -> list[dict[str, Any]]:
    """Time every point of a sweep: medians in seconds by quantity."""
    rows = []
    for value, case in points:
        steps = bench.steps(case, axis.quantities)
        taken = take_turns(steps, repeats, runtime=runtime, clocks={"clock": clock})
        seconds = {name: statistics.median(found["clock"]) for name, found in taken.items()}
        rows.append({"value": value, "seconds": seconds})
    return rows


# -- fits ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Fit:
    """A power law fitted by least squares of logarithms.

    Attributes
    ----------
    exponent : float
        Of the power law.
    margin : float
        Half of the exponent's 95 % confidence interval; infinite for two points.
    residual : float
        Root of the mean square of what the law leaves, as a share of the cost.
    """

    exponent: float
    margin: float
    residual: float


def fitted(values: Sequence[float], costs: Sequence[float]) -> Fit:
    """Fit ``cost = c value ** exponent``; both positive, two or more points."""
    x, y = np.log(np.asarray(values, float)), np.log(np.asarray(costs, float))
    x0, y0 = x - x.mean(), y - y.mean()
    spread = float(x0 @ x0)
    exponent = float(x0 @ y0) / spread
    left = y0 - exponent * x0
    freedom = len(x) - 2
    squares = float(left @ left)
    margin = math.inf
    if freedom > 0:
        quantile = _STUDENT[freedom - 1] if freedom <= len(_STUDENT) else _NORMAL
        margin = quantile * math.sqrt(squares / freedom / spread)
    return Fit(exponent, margin, math.sqrt(squares / len(x)))


def excess(rows: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return what costs come to on top of the first one's; those that cost no more are left out."""
    base = rows[0][1]
    return [(value, cost - base) for value, cost in rows[1:] if value > 0 and cost > base]


def fits(axis: Axis, rows: list[dict[str, Any]]) -> dict[str, Fit]:
    """Return a fit for every quantity of an axis that has points enough."""
    found = {}
    for name in axis.quantities:
        points = [(row["value"], row["seconds"][name]) for row in rows]
        if axis.excess:
            points = excess(points)
        if len(points) > 1:
            found[name] = fitted(*zip(*points, strict=True))
    return found


# -- cores -----------------------------------------------------------------------------------------


def cores_here() -> list[int]:
    """Return the first two cores that this process may use; fewer where there are not so many."""
    if not hasattr(os, "sched_getaffinity"):
        return []
    return sorted(os.sched_getaffinity(0))[:2]


def measured_cores(
    case: Case, interpolation: str, device: Any, repeats: int
) -> dict[str, dict[str, float]] | None:
    """Time one case on one core and on two, in turns.

    Each is a process of its own that is bound to its cores before it looks for devices. Both stay
    alive, and one waits while the other one works.

    Returns
    -------
    dict of str to dict of str to float, or None
        Medians in seconds by number of cores and by quantity, and their ratios; ``None`` where
        processes cannot be bound, there is one core, or the device is no CPU.
    """
    cores = cores_here()
    if len(cores) < 2 or not get_runtime(device).is_cpu:
        return None
    context = multiprocessing.get_context("spawn")
    taken: dict[str, dict[str, list[float]]] = {n: {q: [] for q in QUANTITIES} for n in "12"}
    with ExitStack() as stack:
        ends = {}
        for name, bound in (("1", cores[:1]), ("2", cores)):
            ours, theirs = context.Pipe()
            process = context.Process(
                target=_on_cores, args=(bound, case, interpolation, device, theirs), daemon=True
            )
            process.start()
            theirs.close()
            stack.callback(_end, process, ours)
            ends[name] = ours
            _answer(ours)  # its kernels are compiled
        for _ in range(repeats):
            for quantity in QUANTITIES:
                for name, end in ends.items():
                    end.send(quantity)
                    taken[name][quantity].append(_answer(end))
    medians = {n: {q: statistics.median(s) for q, s in by.items()} for n, by in taken.items()}
    return {**medians, "ratio": {q: medians["1"][q] / medians["2"][q] for q in QUANTITIES}}


def _answer(end: Connection) -> float:
    if not end.poll(_PATIENCE):
        sys.exit(f"a process that is bound to fewer cores has not answered for {_PATIENCE:g} s")
    try:
        return float(end.recv())
    except EOFError:
        sys.exit("a process that is bound to fewer cores has ended before it answered")


def _end(process: Any, end: Connection) -> None:
    end.close()  # which is what it waits for
    process.join(10)
    if process.is_alive():
        process.terminate()


def _on_cores(
    cores: list[int], case: Case, interpolation: str, device: Any, end: Connection
) -> None:
    """Time quantities as they are asked for, bound to some cores, until nobody asks any more."""
    os.sched_setaffinity(0, cores)
    steps = Bench(get_runtime(device), interpolation).steps(case, QUANTITIES)
    for step in steps.values():
        step()
    end.send(0.0)
    while True:
        try:
            step = steps[end.recv()]
        except EOFError:
            return
        begin = time.perf_counter()
        step()
        end.send(time.perf_counter() - begin)


# -- the script ------------------------------------------------------------------------------------


def main() -> int:
    """Measure what is missing, and write what was found."""
    options = parsed()
    runtime = get_runtime(options.device)
    target = options.out / "scaling.json"
    case = {
        "volume": options.volume,
        "procedural": options.procedural,
        "window_size": list(options.size),
        "max_supersegments": options.max_supersegments,
        "angle": options.angle,
        "interpolation": options.interpolation,
        "quick": options.quick,
        "clock": options.clock,
        "system": describe_system(options.device),
    }
    results = begun(target, case, "axes")
    points = sweeps(options)
    bench = Bench(runtime, options.interpolation)
    base = Case(options.volume, tuple(options.size), options.max_supersegments, options.angle)
    clock = clock_of(options, runtime)
    for name in tqdm([*AXES, "cores"], unit="axis", disable=not sys.stderr.isatty()):
        if name in results["axes"] and not options.redo:
            continue
        if name == "cores" and options.clock == "wall":
            results["axes"][name] = measured_cores(
                base, options.interpolation, options.device, options.repeats
            )
        elif name == "cores":  # CPU time is the same on any number of them
            results["axes"][name] = None
        else:
            results["axes"][name] = measured_axis(
                bench, runtime, points[name], AXES[name], options.repeats, clock
            )
        save(results, target)
    text = report(results)
    write_text(target.with_suffix(".md"), text)
    write_plot(results, target.with_suffix(".png"))
    print(text)
    print(f"Written: {target}, and .md and .png beside it")
    return 0


def parsed() -> argparse.Namespace:
    """Return the options."""
    parser = new_parser(__doc__, repeats=5, repeated="timed runs at each point, in turns")
    parser.add_argument("--volume", default="heptane", metavar="NAME", help="of all axes but one")
    parser.add_argument(
        "--procedural",
        default="beechnut_like",
        metavar="NAME",
        help="volume that is made at several sizes",
    )
    add_size(parser, (640, 360))
    add_looks(parser, tf=None)
    parser.add_argument("--angle", type=float, default=10.0, help="of frames, from V_O")
    parser.add_argument("--quick", action="store_true", help="fewer points on each axis")
    add_clock(parser)
    add_redo(parser)
    return parser.parse_args()


def report(results: Mapping[str, Any]) -> str:
    """Return the exponents, the points, and what a second core brings."""
    width, height = results["window_size"]
    case = (
        f"{results['volume']} ({results['procedural']} for voxels), {width}x{height}, N_S "
        f"{results['max_supersegments']}, frames at {results['angle']:g} degrees, "
        f"{results['interpolation']}"
    )
    if results["clock"] == "cpu":
        case += ", by CPU time over cores"
    lines = [
        "# How cost grows",
        "",
        f"{case}, unless changed. {LEGEND}",
        "",
        "## Exponents",
        "",
        *table(("cost grows with", *QUANTITIES), exponent_rows(results)),
        "",
        *table(("cores", *QUANTITIES), core_rows(results)),
    ]
    for name, axis in AXES.items():
        if name in results["axes"]:
            lines += ["", f"## {axis.name}, ms", ""]
            rows = results["axes"][name]
            lines += table(
                (axis.name.partition(",")[0], *axis.quantities),
                [
                    [f"{row['value']:.6g}", *(f"{1e3 * s:.3g}" for s in row["seconds"].values())]
                    for row in rows
                ],
            )
    return "\n".join([*lines, "", system_line(results["system"]), ""])


def exponent_rows(results: Mapping[str, Any]) -> Iterator[list[str]]:
    """Yield a row of exponents for every axis that was measured."""
    for name, axis in AXES.items():
        if name in results["axes"]:
            found = fits(axis, results["axes"][name])
            yield [axis.name, *(_exponent(found.get(quantity)) for quantity in QUANTITIES)]


def core_rows(results: Mapping[str, Any]) -> Iterator[list[str]]:
    """Yield what two cores bring, and whether it is enough."""
    found = results["axes"].get("cores")
    if found is None:
        yield ["1 to 2 (not measured here)", *("-" for _ in QUANTITIES)]
        return
    yield [
        f"time on 1 / on 2, at least {LEAST_SCALING}",
        *(f"{ratio:.2f}, {verdict(ratio)}" for ratio in found["ratio"].values()),
    ]


def verdict(ratio: float) -> str:
    """Return whether a second core brings enough."""
    return "met" if ratio >= LEAST_SCALING else "missed"


def _exponent(fit: Fit | None) -> str:
    if fit is None:
        return "-"
    return f"{fit.exponent:.2f} ± {fit.margin:.2f}"


def write_plot(results: Mapping[str, Any], target: Path) -> None:
    """Write a panel per axis, cost by what is changed, both logarithmic, with the fits."""
    names = [name for name in AXES if name in results["axes"]]
    figure = new_figure((3.4 * len(names), 3.6), layout="constrained")
    panels = figure.subplots(1, len(names), squeeze=False)[0]
    for panel, name in zip(panels, names, strict=True):
        axis, rows = AXES[name], results["axes"][name]
        found = fits(axis, rows)
        for quantity in axis.quantities:
            points = [(row["value"], row["seconds"][quantity]) for row in rows]
            points = excess(points) if axis.excess else points
            if not points:
                continue
            x, y = (np.array(side) for side in zip(*points, strict=True))
            (dots,) = panel.plot(x, 1e3 * y, "o", color=f"C{QUANTITIES.index(quantity)}")
            if quantity in found:
                law = x ** found[quantity].exponent
                line = law * np.exp(np.mean(np.log(1e3 * y / law)))
                label = f"{quantity}: {found[quantity].exponent:.2f}"
                panel.plot(x, line, color=dots.get_color(), label=label)
        panel.set(xscale="log", yscale="log", xlabel=axis.name)
        values = [row["value"] for row in rows if row["value"] > 0]
        panel.set_xticks(values, [_short(value) for value in values])
        panel.tick_params(axis="x", which="minor", bottom=False, labelbottom=False)
        panel.grid(alpha=0.3, which="both")
        if found:
            panel.legend(fontsize="small")
    panels[0].set_ylabel("ms")
    save_figure(figure, target)


def _short(value: float) -> str:
    """Return a number for an axis: ``32k`` for 32 400."""
    return f"{value / 1e3:.0f}k" if value >= 1e3 else f"{value:.0f}"


if __name__ == "__main__":
    sys.exit(main())
