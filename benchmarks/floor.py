"""How far every stage is from the least that this machine could take for it.

The device's rates are measured first, by kernels of their own. What a view's rays meet is counted
along the float64 reference's. The floor is the slowest of memory, gathers and arithmetic; it is
held against the kernels' times by the driver's events.
"""

from __future__ import annotations

import statistics
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from floors.machine import Rates, Stopwatch, measured
from floors.work import Work, floor_of, march_work, marched, raycast_work, shorten_work, walked
from shared import benches, execute, parser_of  # beside this file

from pyvista_vdi.device import Profile, get_runtime
from pyvista_vdi.measure.harness import Bench, Case
from pyvista_vdi.measure.report import section, table
from pyvista_vdi.measure.results import Results
from pyvista_vdi.raycasting.prepared import prepared_vdi

#: One volume of each kind: turbulent, mostly empty, with a solid core, and solid throughout.
VOLUMES = ("heptane", "visible_female_head", "bonsai", "berea")

#: Degrees from V_O; one ray is counted in so many pixels both ways.
ANGLES, EVERY = (0.0, 5.0, 30.0), 32

#: Longest list of a VDI that keeps all that a march records.
UNLIMITED = 500

#: The device's own row in the results.
DEVICE = Case("device", what="rates")


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and write what was found."""
    parser = parser_of(__doc__, size=(1280, 720), volumes=VOLUMES, repeats=3)
    parser.add_argument("--max-supersegments", type=int, default=20, metavar="N")
    options = parser.parse_args(arguments)
    runtime = get_runtime(options.device)
    rates: list[Rates] = []
    with benches(options) as bench_of:

        def measure(case: Case) -> Mapping[str, Any]:
            if not rates:
                found = measured(Stopwatch(runtime, options.repeats), whole=options.whole)
                rates.append(Rates(found))
                if case == DEVICE:
                    return found
            limit = options.max_supersegments
            return {"stages": stages(bench_of(case.volume, case.look), rates[0], limit, options)}

        cases = [Case(name, "soft", tuple(options.size), what="stages") for name in options.volumes]
        key = lambda case: case.what  # noqa: E731
        execute("floor", options, [DEVICE, *cases], measure, report, count=5, key=key)
    return 0


def stages(bench: Bench, rates: Rates, limit: int, options: Any) -> dict[str, Any]:
    """Return counts per ray, floor and time of every stage."""
    runtime, size, view = bench.runtime, bench.size, bench.view
    rays, few = size[0] * size[1], tuple(max(n // EVERY, 4) for n in size)
    found: dict[str, Any] = {}

    def put(stage: str, work: Work, seconds: float | None, **counts: float) -> None:
        floor = floor_of(work, rates)
        found[stage] = {"counts": counts, **floor._asdict(), "measured": seconds}

    made = []
    taken = profiled(
        runtime,
        lambda: made.append(bench.generate(max_supersegments=limit)),
        stage_of,
        options.repeats,
    )
    vdi = made[-1]
    steps = partial(marched, bench.volume, view, few, bench.table)
    each = steps(bench.step, stops=False)
    work = march_work(each, rays, bench.volume, bench.table, records=True)
    put("generation: march", work, taken.get("march"), **each._asdict())
    runs = bench.generate(few, max_supersegments=UNLIMITED).counts.mean()
    kept = vdi.n_supersegments
    counts = {"runs": float(runs), "kept": kept / rays}
    put("generation: shorten", shorten_work(runs * rays, kept), taken.get("shorten"), **counts)

    frames = bench.frames(view)
    taken = profiled(runtime, frames["volume_skipping"], kernels, options.repeats)
    each = steps(bench.voxel, stops=True)
    work = march_work(each, rays, bench.volume, bench.table, records=False)
    put("render_volume", work, taken["kernels"], **each._asdict())
    prepared = prepared_vdi(runtime, vdi)
    for angle in ANGLES:
        camera = view.azimuth(angle)
        taken = profiled(runtime, partial(bench.draw, vdi, camera), kernels, options.repeats)
        seen = walked(vdi, camera, few)
        skips = prepared.occupancy.worthwhile
        work = raycast_work(seen, rays, prepared.list_bytes, skips=skips)
        put(f"VDI raycast, {angle:g} degrees", work, taken["kernels"], **seen._asdict())
    return found


def kernels(name: str) -> str:
    """Return what all kernels are put together by, and what remains."""
    return "kernels" if name else ""


def stage_of(kernel: str) -> str:
    """Return which of generation's stages a kernel belongs to, by its name."""
    if not kernel:
        return ""
    if "march" in kernel or "record" in kernel:
        return "march"
    return "pack" if any(word in kernel for word in ("pack", "lengths", "offsets")) else "shorten"


def profiled(
    runtime: Any, work: Callable[[], Any], key: Callable[[str], str], repeats: int
) -> dict[str, float]:
    """Return median seconds of the kernels of some work, put together by key, the rest as ``""``.

    Kernels are timed by the driver's events. One run before is not counted.
    """
    work()
    watch, runs = Stopwatch(runtime, 1), []
    for _ in range(repeats):
        profile = Profile()
        with runtime.queue_scope(profile):
            seconds = watch.once(work)
        sums: dict[str, float] = {"": seconds}
        for row in profile.figures():
            if not row.name.startswith("["):
                sums[key(row.name)] = sums.get(key(row.name), 0.0) + row.total_ms * 1e-3
        sums[""] -= sum(value for name, value in sums.items() if name)
        runs.append(sums)
    return {name: statistics.median(run.get(name, 0.0) for run in runs) for name in runs[0]}


def report(results: Results, every: list[Case]) -> Iterator[str]:
    """Yield the rates, the gaps of all volumes, and a table for each."""
    for row in results.rows(what="rates"):
        yield from table(("what", "rate, 10^9 a second"), rate_rows(row))
        yield ""
    rows = [row for row in results.rows(what="stages") if "stages" in row]
    found = {row["case"]["volume"]: row["stages"] for row in rows}
    names = dict.fromkeys(name for stages in found.values() for name in stages)
    yield from section("Gaps", "Measured over floor, and what bounds the floor.")
    yield from table(
        ("stage", *found),
        [[name, *(gap(stages.get(name)) for stages in found.values())] for name in names],
    )
    for volume, stages in found.items():
        yield ""
        yield from section(volume, "*Waiting*: the floor if every gather is waited for, over it.")
        rows = []
        for name, at in stages.items():
            counts = ", ".join(f"{key} {value:.1f}" for key, value in at["counts"].items())
            waiting = f"{at['waiting'] / at['seconds']:.1f}"
            times = [f"{1e3 * (at[key] or 0):.3g}" for key in ("seconds", "measured")]
            rows.append([name, counts, *times, gap(at), waiting])
        heads = ("stage", "a ray", "floor, ms", "measured, ms", "gap", "waiting")
        yield from table(heads, rows)


def rate_rows(rates: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield the device's rates."""
    for group in ("streams", "arithmetic"):
        for name, rate in rates[group].items():
            yield f"{group}: {name}", f"{rate / 1e9:.2f}"
    for pattern, by_size in rates["gathers"].items():
        for size, points in by_size.items():
            shown = ", ".join(f"{rate / 1e9:.2f} of {int(n) >> 10} KiB" for n, rate in points)
            yield f"gathers: {size} bytes, {pattern}", shown


def gap(stage: Mapping[str, Any] | None) -> str:
    """Return how many times its floor a stage takes, and what bounds that."""
    if stage is None or not stage["measured"]:
        return "-"
    return f"{stage['measured'] / stage['seconds']:.1f} ({stage['bound']})"


if __name__ == "__main__":
    sys.exit(main())
