"""The verb ``benchmark``: the paper's tables as JSON and Markdown."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from pyvista_vdi import examples
from pyvista_vdi.cli.inputs import has_vtk, measuring, require_new, say_written
from pyvista_vdi.cli.text import printable
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.io import check_writable
from pyvista_vdi.measure.paper import PROFILES, Plan, describe, find_dataset, open_results, run
from pyvista_vdi.measure.results import write_text


def benchmark(options: argparse.Namespace) -> int:
    """Measure and write."""
    plan, path = _plan(options), Path(options.out)
    # Refuse now what cannot be written later
    if path.suffix.lower() != ".json":
        raise InvalidArgumentError(
            f"--out must name a .json file (the tables go beside it); got {options.out!r}"
        )
    require_new(path, options)
    check_writable(path)
    results = open_results(plan, path, options.device, resume=options.resume)
    results.save()
    try:
        with measuring("benchmark", results.path) as bar:
            run(plan, results, options.device, bar)
    finally:
        tables = results.path.with_suffix(".md")
        write_text(tables, describe(results.data))
    for row in results.rows(what="volume"):
        if "refused" in row:
            left_out = printable(f"{row['case']['volume']} ({row['refused']})")
            print(f"left out: {left_out}", file=sys.stderr)
    say_written([results.path, tables])
    return 0


def _plan(options: argparse.Namespace) -> Plan:
    """Return the profile with what the options change."""
    chosen: dict[str, Any] = dict(PROFILES[options.profile])
    if options.profile == "full":
        whole = (name for name in examples.available() if name in examples.WHOLE)
        chosen["datasets"] = (*whole, *chosen["datasets"])
    if options.datasets or options.volume:
        chosen["datasets"] = (*(options.datasets or ()), *(options.volume or ()))
    changes = {
        "sizes": options.sizes,
        "limits": options.max_supersegments,
        "angles": options.angles,
        "repeats": options.repeats,
        "interpolation": options.interpolation,
        "seed": options.seed,
    }
    chosen |= {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in changes.items()
        if value is not None
    }
    # Take the profile's case of Table 2, or the one nearest to it that was chosen
    dataset, size, limit, angle = chosen["preview"]
    datasets, sizes = chosen["datasets"], chosen.get("sizes", (size,))
    limits = chosen.get("limits", (limit,))
    if dataset not in datasets:
        seed = chosen.get("seed", 0)
        stands = [name for name in datasets if find_dataset(name, seed).paper == "beechnut"]
        dataset = [*stands, *datasets][0]
    size, limit = (x if x in xs else xs[k] for x, xs, k in ((size, sizes, -1), (limit, limits, 0)))
    chosen["preview"] = (dataset, size, limit, angle)
    if options.tables is not None:
        if 2 not in options.tables:
            chosen["preview"] = None
        if 1 not in options.tables:
            chosen["datasets"] = ()
    return Plan(profile=options.profile, vtk=has_vtk(options), **chosen)
