"""What generation costs over volume rendering, and that over VTK's mappers, by turns.

Raycast alone: without a plotter's frame around it, see frames.py.
"""

from __future__ import annotations

import statistics
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

from shared import Case, Results, benches, execute, mean_of, parser_of, table  # beside this file

from pyvista_vdi import Settings, render_volume
from pyvista_vdi.measure.bench import ratio, take_turns

#: Degrees from V_O at which VTK's mappers and ours draw the volume.
ANGLE = 5.0

#: What each column divides.
RATIOS = {
    "march": "generation / the same march as a picture",
    "vtk": "render_volume / the faster of VTK's mappers",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and write what was found."""
    parser = parser_of(__doc__, size=(1280, 720), repeats=5)
    parser.add_argument("--max-supersegments", type=int, default=20, metavar="N")
    options = parser.parse_args(arguments)
    with benches(options, vtk=True) as bench_of:

        def measure(case: Case) -> dict[str, Any]:
            bench = bench_of(case.volume, case.look)
            march = partial(
                render_volume,
                *(bench.volume, bench.view, bench.size),
                transfer_function=bench.table,
                settings=Settings(sample_distance=bench.step),
                early_termination=False,
                device=bench.runtime,
            )
            work = {
                "generation": partial(bench.generate, max_supersegments=options.max_supersegments),
                "march": march,
                **bench.frames(bench.view.azimuth(ANGLE)),
            }
            taken = take_turns(work, options.repeats)
            seconds = {name: statistics.median(times) for name, times in taken.items()}
            faster = min(bench.vtk, key=seconds.__getitem__)
            over = {"march": ratio(taken["generation"], taken["march"])}
            over["vtk"] = ratio(taken["volume"], taken[faster])
            return {"seconds": seconds, "ratios": over}

        cases = [Case(name, "soft", tuple(options.size)) for name in options.volumes]
        execute("generation", options, cases, measure, report, count=5)
    return 0


def report(results: Results, every: list[Case]) -> Iterator[str]:
    """Yield the table: a line per volume, and the mean of all."""
    yield "Medians of the ratios turn by turn; generation and marches at steps of half a voxel, to"
    yield f"the end; `render_volume` and VTK at steps of a voxel, {ANGLE:g} degrees from V_O."
    yield ""
    rows = [
        [row["case"]["volume"], *(f"{row['ratios'][name]:.2f}" for name in RATIOS)]
        for row in results.rows()
    ]
    means = [mean_of(results, every, lambda row, n=n: row["ratios"].get(n)) for n in RATIOS]
    yield from table(("volume", *RATIOS.values()), [*rows, ["mean of all", *map(str, means)]])


if __name__ == "__main__":
    sys.exit(main())
