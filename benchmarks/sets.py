"""Sets of VDIs: bytes, seconds, SSIM from random directions, frames beside VTK's mappers."""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from shared import benches, execute, marked, parser_of  # beside this file

import pyvista_vdi as pvdi
from pyvista_vdi.extensions.sets.sphere import orbit
from pyvista_vdi.measure.clock import median, take_turns
from pyvista_vdi.measure.harness import Bench, Case
from pyvista_vdi.measure.results import Results, table
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS

VOLUMES = ("brain", "visible_female_head", "rayleigh_taylor")

#: Light below which rays end where frames are timed, as VTK's mappers do; degrees from V_O.
CUTOFF, TIMED = 0.004, range(30, 91, 10)

#: What must be reached: SSIM at least and its first percentile; bytes; frames over VTK's.
LEAST_SSIM, LEAST_PERCENTILE, MOST_BYTES, MOST_FRAME = 0.97, 0.98, 100e6, 0.25


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and write what was found."""
    parser = parser_of(__doc__, volumes=VOLUMES, repeats=3)
    parser.add_argument("--directions", type=int, help="random ones (60; whole: 500)")
    parser.add_argument("--target-ssim", type=float, default=0.98)
    parser.add_argument("--max-bytes", type=int, help="of a file")
    options = parser.parse_args(arguments)
    with benches(options, vtk=True) as bench_of:
        cases = [Case(name, "soft", tuple(options.size)) for name in options.volumes]
        rooms = ("generation", "raycasting", "volume", "quality", "extensions/sets")
        execute(
            "sets",
            options,
            cases,
            lambda case: measured(bench_of(case.volume, case.look), options),
            report,
            count=1,
            rooms=rooms,
        )
    return 0


def measured(bench: Bench, options: Any) -> dict[str, Any]:
    """Return what a set takes, how near its pictures are, and times of frames."""
    looks = {**TRANSFER_FUNCTIONS["soft"], "device": bench.runtime}
    # What is compiled once is not of the set
    few = {"lists": 1, "max_supersegments": 4, "max_views": 2, "target_ssim": 0.1}
    pvdi.generate_set(bench.volume, "sphere", (32, 18), **few, **looks)
    start = time.perf_counter()
    found = pvdi.generate_set(
        bench.volume,
        "sphere",
        bench.size,
        target_ssim=options.target_ssim,
        max_bytes=options.max_bytes,
        **looks,
    )
    seconds = time.perf_counter() - start
    with tempfile.TemporaryDirectory() as folder:
        n_bytes = found.save(Path(folder) / "a.vdiset").stat().st_size
        found = pvdi.read(Path(folder) / "a.vdiset")
    count = options.directions or (500 if options.whole else 60)
    random = np.random.default_rng(21).normal(size=(count, 3))
    random /= np.linalg.norm(random, axis=1)[:, None]
    views = orbit(bench.view, bench.volume.bounds, random)
    ssim = [
        pvdi.compare_images(
            pvdi.render(found, view, device=bench.runtime), bench.raycast(view)
        ).ssim
        for view in views
    ]
    frames = []
    for angle in TIMED:
        view = bench.view.azimuth(angle)
        draw = partial(pvdi.render, found, view, transmittance_cutoff=CUTOFF, device=bench.runtime)
        theirs = {name: step for name, step in bench.frames(view).items() if name in bench.vtk}
        taken = take_turns({"set": draw, **theirs}, options.repeats)
        frames.append({"angle": angle, **{name: median(times) for name, times in taken.items()}})
    return {
        "views": len(found),
        "chosen": found.about["chosen"],
        "bytes": n_bytes,
        "seconds": seconds,
        "farthest": float(max(found.distances(view).min() for view in views)),
        "directions": count,
        "ssim": [float(np.quantile(ssim, share)) for share in (0, 0.01, 0.5)],
        "frames": frames,
    }


def report(results: Results, every: list[Case]) -> Iterator[str]:
    """Yield the table."""
    yield "SSIM of whole pictures to `render_volume` from random directions. Frame: the median over"
    yield f"{TIMED[0]} to {TIMED[-1]} degrees of its time over that of the faster of VTK's mappers."
    yield ""
    rows = []
    for row in results.rows():
        if "refused" in row:
            continue
        least, percentile, middle = row["ssim"]
        frames = row["frames"]
        ratios = [f["set"] / min(v for k, v in f.items() if k.startswith("vtk")) for f in frames]
        ratio, chosen = statistics.median(ratios), row["chosen"]
        rows.append(
            [
                row["case"]["volume"],
                row["views"],
                f"{row['farthest']:.0f}°",
                f"{chosen['lists']:g}, {chosen['max_supersegments']}",
                marked(f"{row['bytes'] / 1e6:.1f}", row["bytes"] <= MOST_BYTES),
                f"{row['seconds']:.0f}",
                row["directions"],
                marked(f"{least:.4f}", least >= LEAST_SSIM),
                marked(f"{percentile:.4f}", percentile >= LEAST_PERCENTILE),
                f"{middle:.4f}",
                marked(f"{ratio:.2f}", ratio <= MOST_FRAME),
            ]
        )
    heads = ["V_Os", "farthest", "lists, N_S", "MB", "seconds", "directions"]
    yield from table(("volume", *heads, "SSIM least", "1 %", "median", "frame / VTK"), rows)


if __name__ == "__main__":
    sys.exit(main())
