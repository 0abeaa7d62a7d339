"""Rays in the world beside ours: time by N_S, lists, angle and emptiness; SSIM and memory.

They (``baselines/``) draw the same VDI as ours; frames end on the host, raycast alone. Tests hold
their pictures to the oracle. docs/decisions/baselines.md has the paper's other baselines as well.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import numpy as np

sys.path.append(str(Path(__file__).parents[1] / "tests"))  # the reference, which baselines take

from baselines.criteria import CRITERIA, RECORDED, cut
from baselines.world_rays import WorldRays
from scaling import fitted
from shared import execute, load, parser_of  # beside this file

from pyvista_vdi.measure.clock import take_turns
from pyvista_vdi.measure.harness import Bench, Case, Latest, accuracy
from pyvista_vdi.measure.results import Results, mebibytes, milliseconds, section, table
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.raycasting.prepared import PreparedVDI

#: Who draws, by the keys of the results, and what tables call them.
WAYS: Mapping[str, str] = {
    "f": "ours, f",
    "f_e": "ours, f_e",
    "rays": "ours, f, ray by ray",
    "world": "world rays, halving",
    "linear": "world rays, linear",
}

#: What is changed of N_S 15, as many lists as pixels, 30 degrees, nothing transparent by a
#: threshold (a share of the scalars' range); for a sample the ends alone.
BASE = {"max_supersegments": 15, "lists": 4, "pixels": 4, "angle": 30.0, "threshold": 0.0}
AXES: Mapping[str, tuple[tuple[str, ...], Sequence[Any]]] = {
    "N_S": (("max_supersegments",), (4, 15, 60, 8, 30)),
    "lists": (("lists",), (1, 4, 2, 3)),
    "lists and pixels": (("lists", "pixels"), (1, 4, 2, 3)),
    "angle": (("angle",), (0.0, 5.0, 90.0, 15.0, 30.0)),
    "threshold": (("threshold",), (0.9, 0.7, 0.8)),
}
#: Points of an axis that a sample has; axes over which time is fitted by a power.
SAMPLED, POWERS = 3, ("N_S", "lists", "lists and pixels")

#: Each system's own criterion for cutting lists.
OWN = {"f": "least-error", "world": "transmittance"}


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and write what was found."""
    parser = parser_of(__doc__, volumes=None, repeats=3)
    parser.add_argument("--volume", default="brain", metavar="NAME")
    options = parser.parse_args(arguments)

    def bench_of(threshold: float) -> Bench:
        volume = load(options.volume)
        ramp = np.clip((np.linspace(0, 1, 65) - threshold) / (1.01 - threshold), 0, 1)
        looks = {"cmap": "bone", "opacity": ramp.tolist()}
        table = Classification.composited(looks, "a benchmark").transfer_function_of(volume)
        return Bench(volume, table, tuple(options.size), device=options.device, vtk=False)

    benches = Latest(bench_of)

    def vdi_of(threshold: float, lists: int, limit: int, criterion: str) -> Any:
        size, bench = scaled(options.size, lists), benches(threshold)
        if criterion in CRITERIA:
            return cut(bench.generate(size, max_supersegments=RECORDED), criterion, limit)
        return bench.generate(size, max_supersegments=limit, criterion=criterion)

    vdis = Latest(vdi_of)

    def measure(case: Case) -> dict[str, Any]:
        at = {**BASE, **case.chosen}
        at["angle"] = at["angle"] if case.angle is None else case.angle
        bench = benches(at["threshold"])
        camera = bench.view.azimuth(at["angle"])
        key = at["threshold"], at["lists"], at["max_supersegments"]
        size = scaled(options.size, at["pixels"])
        if case.what == "ssim":
            truth, found = bench.reference(camera), {}
            for way, criterion in OWN.items():
                drawn = ways_of(bench, vdis(*key, criterion), size, (way,))
                found[way] = accuracy(drawn[way].draw(camera), truth)["ssim"]
            return {"ssim": found}
        vdi = vdis(*key, "least-error")
        ways = ways_of(bench, vdi, size, tuple(WAYS))
        steps = {name: partial(way.draw, camera) for name, way in ways.items()}
        taken = take_turns(steps, options.repeats)
        return {
            "supersegments": vdi.n_supersegments,
            "seconds": {name: min(times["clock"]) for name, times in taken.items()},
            "prepare": {name: way.seconds for name, way in ways.items()},
            "bytes": {name: way.nbytes for name, way in ways.items()},
        }

    drawn = list(cases_of(options, SAMPLED))
    execute("baselines", options, cases_of(options), measure, report, drawn=drawn)
    return 0


def cases_of(options: Any, points: int | None = None) -> Iterator[Case]:
    """Yield the points of every axis, or so many of them, and SSIM by angle."""
    size = tuple(options.size)
    for axis, (names, values) in AXES.items():
        for value in values[:points]:
            if axis == "angle":
                yield Case(options.volume, None, size, value, what=axis)
                continue
            changed = tuple((name, value) for name in names)
            yield Case(options.volume, None, size, options=changed, what=axis)
    for angle in sorted(AXES["angle"][1]):
        yield Case(options.volume, None, size, angle, what="ssim")


def scaled(size: tuple[int, int], quarters: int) -> tuple[int, int]:
    """Return a window of so many quarters of the edges."""
    return size[0] * quarters // 4, size[1] * quarters // 4


class Way(NamedTuple):
    """Who draws, what preparing it took and what it keeps."""

    draw: Callable[[Any], Any]
    seconds: float
    nbytes: int


def ways_of(bench: Bench, vdi: Any, size: tuple[int, int], wanted: Sequence[str]) -> dict[str, Way]:
    """Return who draws a VDI."""
    runtime, found = bench.runtime, {}

    def one_by_one(camera: Any) -> Any:
        with mock.patch.object(runtime, "is_cpu", False):
            return bench.draw(vdi, camera, size, skip_empty=False)

    begin = time.perf_counter()
    prepared = PreparedVDI(runtime, vdi)
    own = time.perf_counter() - begin, prepared.list_bytes
    found["f"] = Way(lambda camera: bench.draw(vdi, camera, size, skip_empty=False), *own)
    with_masks = own[1] + prepared.occupancy.masks.nbytes
    found["f_e"] = Way(lambda camera: bench.draw(vdi, camera, size), own[0], with_masks)
    found["rays"] = Way(one_by_one, *own)
    del prepared
    makers: dict[str, Callable[[], Any]] = {
        "world": lambda: WorldRays(runtime, vdi),
        "linear": lambda: WorldRays(runtime, vdi, binary=False),
    }
    for name in [name for name in makers if name in wanted]:
        begin = time.perf_counter()
        made = makers[name]()
        seconds = time.perf_counter() - begin
        found[name] = Way(partial(made.image, size=size), seconds, made.nbytes)
    return found


def report(results: Results, every: list[Case]) -> Iterator[str]:
    """Yield exponents, milliseconds by axis, memory, SSIM and differences."""
    base = BASE["max_supersegments"]
    rows = {axis: [row for row in results.rows(what=axis) if "seconds" in row] for axis in AXES}
    at_base = [row for row in rows["N_S"] if row["case"]["max_supersegments"] == base]
    there = [way for way in WAYS if any(way in row["seconds"] for row in at_base)]
    titles = [WAYS[way] for way in there]

    def value(axis: str, row: Mapping[str, Any]) -> Any:
        return row["case"][AXES[axis][0][0]]

    yield f"N_S {base}, {BASE['angle']:g} degrees, unless changed; least of the turns."
    yield ""
    yield from section("Exponents", "Of time, with 95 % confidence intervals.")
    found = []
    for axis in POWERS:
        x = [value(axis, row) for row in rows[axis]]
        fits = [fitted(x, [row["seconds"][way] for row in rows[axis]]) for way in there]
        found.append([axis, *(f"{fit.exponent:.2f} ± {fit.margin:.2f}" for fit in fits)])
    yield from table(("grows with", *titles), found)
    for axis, points in rows.items():
        yield from ("", f"## Milliseconds by {axis}", "")
        shown = [
            [
                f"{value(axis, row):g}",
                row["supersegments"],
                *(milliseconds(row["seconds"].get(way)) for way in there),
            ]
            for row in sorted(points, key=partial(value, axis))
        ]
        yield from table((axis, "supersegments", *titles), shown)
    for row in at_base:
        yield from ("", "## Memory and preparation", "")
        lines = [
            ["MiB", *(mebibytes(row["bytes"][way]) for way in there)],
            ["ms before the first frame", *(milliseconds(row["prepare"][way]) for way in there)],
        ]
        yield from table(("", *titles), lines)
    yield from ("", "## SSIM to the volume, each with lists by its own criterion", "")
    found = [row for row in results.rows(what="ssim") if "ssim" in row]
    by_way = [[WAYS[way], *(f"{row['ssim'][way]:.4f}" for row in found)] for way in OWN]
    yield from table(("", *(f"{row['case']['angle']:g} degrees" for row in found)), by_way)


if __name__ == "__main__":
    sys.exit(main())
