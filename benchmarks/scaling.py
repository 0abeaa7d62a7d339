"""How cost grows with pixels, N_S, volume size and angle: one thing changes at a time.

Power laws are fitted by least squares of logarithms; of the angle, to what comes on top of the cost
at V_O.
"""

from __future__ import annotations

import math
import statistics
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from shared import Case, Latest, Results, execute, load, parser_of, table, table_of
from shared.volumes import KINDS

from pyvista_vdi.measure.bench import Bench, take_turns

#: What is timed, and on which axes.
QUANTITIES = ("VDI frame", "render_volume", "generation")
AXES = {
    "pixels": QUANTITIES,
    "N_S": ("VDI frame", "generation"),
    "voxels along an edge": QUANTITIES,
    "angle": ("VDI frame",),
}

#: Degrees of frames from V_O where the angle does not change.
ANGLE = 10.0


def cases_of(options: Any, whole: bool) -> Iterator[tuple[Case, float]]:
    """Yield the points of every axis, and what is changed there; some of them for a sample."""
    width, height = options.size
    base = {"volume": options.volume, "look": "soft", "angle": ANGLE}

    def case(axis: str, size: Any = (width, height), limit: int = 20, **changes: Any) -> Case:
        chosen = (("max_supersegments", limit),)
        return Case(**{**base, **changes}, window_size=size, options=chosen, what=axis)

    for k in (1, 2, 3, 4, 6) if whole else (1, 2, 4):
        size = (width * k // 4, height * k // 4)
        yield case("pixels", size), float(size[0] * size[1])
    for limit in (5, 10, 20, 40) if whole else (5, 10, 20):
        yield case("N_S", limit=limit), float(limit)
    for factor in (32, 16, 8, 4) if whole else (32, 16, 8):
        points = [-(-n // factor) for n in KINDS[options.procedural][0]]
        name = f"{options.procedural}@{factor}"
        yield case("voxels along an edge", volume=name), float(np.prod(points)) ** (1 / 3)
    for angle in (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 40.0) if whole else (0.0, 5.0, 10.0, 20.0):
        yield case("angle", angle=angle), angle


class Fit(NamedTuple):
    """The exponent of a power law, and half of its 95 % confidence interval."""

    exponent: float
    margin: float


def fitted(values: Sequence[float], costs: Sequence[float]) -> Fit:
    """Fit ``cost = c value ** exponent``; both positive. Two points have no interval."""
    from scipy import stats

    found = stats.linregress(np.log(values), np.log(costs))
    freedom = len(values) - 2
    quantile = stats.t.ppf(0.975, freedom) if freedom else math.inf
    return Fit(float(found.slope), float(quantile * found.stderr) if freedom else math.inf)


def points_of(results: Results, axis: str, quantity: str) -> list[tuple[float, float]]:
    """Return what was changed and what it cost; of the angle, over the cost at V_O."""
    rows = [row for row in results.rows(what=axis) if quantity in row.get("seconds", {})]
    points = sorted((row["value"], row["seconds"][quantity]) for row in rows)
    if axis == "angle":
        points = [(value, cost - points[0][1]) for value, cost in points[1:]]
    return [(value, cost) for value, cost in points if cost > 0]


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and write what was found."""
    parser = parser_of(__doc__, volumes=None, repeats=5)
    parser.add_argument("--volume", default="heptane", metavar="NAME", help="of all axes but one")
    parser.add_argument("--procedural", default="beechnut_like", metavar="NAME")
    options = parser.parse_args(arguments)
    points, drawn = dict(cases_of(options, True)), list(dict(cases_of(options, False)))
    volumes = Latest(load)

    def bench_of(volume: str, size: tuple[int, int]) -> Bench:
        found = volumes(volume)
        return Bench(found, table_of(found, "soft"), size, device=options.device, vtk=False)

    with Latest(bench_of) as kept:

        def measure(case: Case) -> dict[str, Any]:
            bench = kept(case.volume, case.window_size)
            chosen = dict(case.options)
            frames = bench.frames(bench.view.azimuth(case.angle), bench.generate(**chosen))
            steps = {
                "VDI frame": frames["vdi"],
                "render_volume": frames["volume"],
                "generation": partial(bench.generate, **chosen),
            }
            wanted = {name: steps[name] for name in AXES[str(case.what)]}
            taken = take_turns(wanted, options.repeats)
            seconds = {name: statistics.median(times) for name, times in taken.items()}
            return {"value": points[case], "seconds": seconds}

        cases = points if options.whole else drawn
        execute("scaling", options, cases, measure, report, count=len(points))
    return 0


def report(results: Results, every: list[Case]) -> Iterator[str]:
    """Yield the exponents, and the points that they are fitted to."""
    yield "Exponents of power laws with their 95 % confidence intervals; medians of turns."
    yield ""
    rows = []
    for axis, quantities in AXES.items():
        cells = []
        for quantity in QUANTITIES:
            points = points_of(results, axis, quantity) if quantity in quantities else []
            fit = fitted(*zip(*points, strict=True)) if len(points) > 1 else None
            cells.append("-" if fit is None else f"{fit.exponent:.2f} ± {fit.margin:.2f}")
        rows.append([axis + (", over the cost at V_O" * (axis == "angle")), *cells])
    yield from table(("grows with", *QUANTITIES), rows)
    yield from ("", "Milliseconds:", "")
    rows = [
        [
            row["case"]["what"],
            f"{row['value']:.4g}",
            *(f"{1e3 * s:.3g}" if (s := row["seconds"].get(q)) else "-" for q in QUANTITIES),
        ]
        for row in results.rows()
    ]
    yield from table(("axis", "value", *QUANTITIES), rows)


if __name__ == "__main__":
    sys.exit(main())
