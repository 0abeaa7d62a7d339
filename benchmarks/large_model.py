"""A model of scale: the tasks of one VDI on up to 10,000 workers, simulated one by one.

Costs per point, per ray and per run are those that ``large.py`` measured on one core
(``large.json``); networks and the scheduler's cost per task are stated. Writes ``large_model.md``.
"""

from __future__ import annotations

import heapq
import json
import math
import sys
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from common import add_size, new_parser  # beside this file

from pyvista_vdi.large.on_dask import RANGES_PER_WORKER
from pyvista_vdi.large.rows import ROWS
from pyvista_vdi.measure.report import table, write_text

WORKERS = (1, 2, 4, 16, 64, 256, 1000, 4000, 10_000)
PHASES = ("first pass", "light", "second pass", "exchange", "merging")
#: Bytes of a run, of a ray's optical depth, and of the light that enters a block along a ray.
RUN_BYTES, DEPTH_BYTES, LIGHT_BYTES = 32, 2, 2
#: Blocks that a ray meets, over those along an edge of the grid: from a corner's view.
CROSSED = 1.5
#: How tasks of one kind differ: standard deviation of the logarithm of their time.
SPREAD = 0.2


@dataclass(frozen=True)
class System:
    """What work costs. Seconds are one core's.

    Attributes
    ----------
    name : str
        Of the row in the table.
    first, second : float
        Seconds per point of the two passes.
    merge : float
        Seconds per run that is merged.
    runs : float
        Runs of a ray in a block.
    link : float
        Bytes per second between two workers, and to the client.
    storage : float
        Bytes per second of the store for all readers together.
    task : float
        Seconds of the scheduler per task: Dask states about a millisecond.
    edge : int
        Points along the edge of a block.
    """

    name: str
    first: float
    second: float
    merge: float
    runs: float
    link: float = 1.25e9
    storage: float = 100e9
    task: float = 1e-3
    edge: int = 256


def main() -> int:
    """Simulate, and write the table."""
    parser = new_parser(__doc__)
    add_size(parser)
    parser.add_argument("--points", type=float, default=1e13)
    options = parser.parse_args()
    found = json.loads((options.out / "large.json").read_text())["parts"]["large"]
    shares, points = found["shares"], found["edge"] ** 3 * found["visible"]
    blocks = found["blocks"]
    rays = found["rays"] * CROSSED * max(blocks)
    base = System(
        "10 Gb/s Ethernet, blocks of 256^3",
        first=shares["first"] / points,
        second=shares["second"] / points,
        merge=shares["merge"] / found["runs_merged"],
        runs=found["runs_merged"] / rays,
    )
    systems = [
        base,
        replace(base, name="100 Gb/s, store 1 TB/s", link=12.5e9, storage=1e12),
        replace(base, name="blocks of 1024^3", edge=1024),
        replace(base, name="blocks of 1024^3, 100 Gb/s, store 1 TB/s", edge=1024, link=12.5e9,
                storage=1e12),
    ]  # fmt: skip
    write_text(options.out / "large_model.md", report(systems, options))
    print(f"Written: {options.out / 'large_model.md'}")
    return 0


def simulated(system: System, points: float, size: tuple[int, int], workers: int) -> dict[str, Any]:
    """Return the seconds of each phase, one behind the other as the client waits for all of it."""
    rng = np.random.default_rng(workers)
    along = math.ceil(points ** (1 / 3) / system.edge)
    n, rays = along**3, size[0] * size[1]
    block = system.edge**3
    meetings = rays * CROSSED * along  # of a ray and a block
    reading = block / min(system.link, system.storage / min(workers, n))
    ranges = min(RANGES_PER_WORKER * workers, -(-size[1] // ROWS))
    of_a_block = math.ceil(ranges / along) + (ranges > 1)  # ranges that its rows lie in
    runs = meetings * scaled_runs(system)
    exchanged = runs * RUN_BYTES / min(workers, ranges) / system.link * (1 - 1 / workers)
    return {
        "first pass": scheduled(n, workers, reading + block * system.first, system, rng)
        + n * system.task,  # what the client asks of each
        "light": meetings * (DEPTH_BYTES + LIGHT_BYTES) / system.link,
        "second pass": scheduled(
            n, workers, reading + block * system.second + 3 * system.edge**2 / system.link,
            system, rng,
        ) + n * system.task,
        "exchange": n * of_a_block * system.task + exchanged,
        "merging": scheduled(ranges, workers, runs / ranges * system.merge, system, rng),
    }  # fmt: skip


def scaled_runs(system: System) -> float:
    """Runs of a ray in a block: they grow with the root of its edge, and are at most 20."""
    return min(system.runs * math.sqrt(system.edge / 256), 20.0)


def scheduled(
    n: int, workers: int, seconds: float, system: System, rng: np.random.Generator
) -> float:
    """Return when the last of n tasks ends: one at a time is given to whoever is free first."""
    if n > 3_000_000:
        raise ValueError(f"{n} tasks are too many to simulate: take larger blocks")
    lasting = seconds * rng.lognormal(-(SPREAD**2) / 2, SPREAD, n)
    free = [0.0] * min(workers, n)
    given = 0.0
    for one in lasting.tolist():
        given = max(given + system.task, free[0])
        heapq.heapreplace(free, given + one)
    return max(free)


def report(systems: list[System], options: Any) -> str:
    """Return the tables."""
    width, height = options.size
    one = systems[0]
    costs = (
        f"Simulated: {options.points:.0e} points of a byte, {width} x {height} lists. One core: "
        f"{1 / one.first:.2e} points a second in the first pass, {1 / one.second:.2e} in the "
        f"second, {1 / one.merge:.2e} runs merged; {one.runs:.1f} runs of a ray in a block of "
        f"256^3; the scheduler {one.task * 1e3:g} ms a task."
    )
    lines = [costs]
    for system in systems:
        alone, rows = None, []
        for workers in WORKERS:
            phases = simulated(system, options.points, options.size, workers)
            seconds = sum(phases.values())
            alone = seconds if alone is None else alone
            cells = [f"{workers}", text(seconds), f"{alone / seconds / workers:.0%}"]
            rows.append([*cells, *map(text, phases.values())])
        lines += [
            "",
            f"**{system.name}**",
            "",
            *table(("workers", "time", "efficiency", *PHASES), rows),
        ]
    return "\n".join([*lines, ""])


def text(seconds: float) -> str:
    """Return a time that can be read."""
    for unit, length in (("d", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * length:
            return f"{seconds / length:.3g} {unit}"
    return f"{seconds:.2g} s"


if __name__ == "__main__":
    sys.exit(main())
