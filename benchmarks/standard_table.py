"""Every standard case: volumes x transfer functions x interpolation, measured and judged.

What is measured is ``pyvista_vdi.measure.compare``'s; what must be reached,
``pyvista_vdi.measure.compare.bounds``. See README.md in this folder for how to run it.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict, dataclass
from itertools import product
from typing import Any

from common import (  # beside this file
    INTERPOLATIONS,
    add_looks,
    add_redo,
    add_size,
    add_volumes,
    at_hand,
    new_parser,
    results_file,
    save,
)
from standard_report import write_plot, write_tables
from tqdm import tqdm

from pyvista_vdi import examples
from pyvista_vdi.errors import VDIError
from pyvista_vdi.measure.compare import Report, Settings, judge_times, judge_vdi, judge_vtk, measure
from pyvista_vdi.measure.compare.bounds import CONVERGED_STEPS, FRAME_RATIO_ANGLE
from pyvista_vdi.model.standard_cases import ANGLES, TRANSFER_FUNCTIONS

#: Volumes for which one transfer function has to do, because of their size.
SOFT_ONLY = ("allen_mouse_brain",)


@dataclass(frozen=True, order=True)
class Case:
    """One volume, how it looks and how it is sampled."""

    interpolation: str
    volume: str
    transfer_function: str

    @property
    def key(self) -> str:
        """The case's name in the results."""
        return "/".join((self.volume, self.transfer_function, self.interpolation))


def main(arguments: list[str] | None = None) -> int:
    """Measure what is missing, and write the tables and the plot anew."""
    options = parsed(arguments)
    target = results_file("standard", options)
    results = json.loads(target.read_text()) if target.exists() else new_results(options)
    if results["max_supersegments"] != options.max_supersegments:
        sys.exit(
            f"{target} holds results for {results['max_supersegments']} supersegments, not "
            f"{options.max_supersegments}: choose another --out"
        )
    part = options.part
    for case in tqdm(chosen(options), unit="case", disable=options.tables_only):
        entry = results["cases"].setdefault(case.key, {"case": vars(case)})
        if options.tables_only or (part in entry and not options.redo):
            continue
        if part == "converged" and not missed_to_vtk(entry):
            continue
        try:
            entry[part] = measured(case, options)
        except VDIError as error:  # such as a volume too large for the device: named in the table
            entry[part] = {"error": f"{type(error).__name__}: {error}"}
        save(results, target)
    results["cases"] = {k: v for k, v in results["cases"].items() if len(v) > 1}
    write_tables(results, target.with_suffix(".md"))
    write_plot(results, target.with_suffix(".png"))
    print(f"Written: {target}, and .md and .png beside it")
    return 0


def parsed(arguments: list[str] | None) -> argparse.Namespace:
    """Return the options."""
    parser = new_parser(__doc__, repeats=5, repeated="timed runs of each kind")
    add_size(parser)
    add_volumes(parser)
    parser.add_argument("--tf", nargs="+", choices=TRANSFER_FUNCTIONS, default=TRANSFER_FUNCTIONS)
    parser.add_argument(
        "--interpolation", nargs="+", choices=INTERPOLATIONS, default=INTERPOLATIONS
    )
    add_looks(parser, tf=None, interpolation=None)
    parts = parser.add_mutually_exclusive_group()
    parts.add_argument(
        "--timings",
        dest="part",
        action="store_const",
        const="timings",
        help="measure times, not pictures",
    )
    parts.add_argument(
        "--converged",
        dest="part",
        action="store_const",
        const="converged",
        help=f"where a bound against VTK was missed: compare at {CONVERGED_STEPS} steps a voxel",
    )
    parser.set_defaults(part="accuracy")
    add_redo(parser)
    parser.add_argument("--tables-only", action="store_true", help="write tables and plot anew")
    return parser.parse_args(arguments)


def chosen(options: argparse.Namespace) -> list[Case]:
    """Return the cases to be measured whose volume is at hand; name those that are not."""
    volumes = at_hand(options.volumes)
    combinations = product(options.interpolation, volumes, options.tf)
    return [
        Case(interpolation, volume, look)
        for interpolation, volume, look in combinations
        if look == "soft" or volume not in SOFT_ONLY
    ]


def new_results(options: argparse.Namespace) -> dict[str, Any]:
    """Return the file's contents before anything was measured."""
    return {
        "window_size": list(options.size),
        "max_supersegments": options.max_supersegments,
        "cases": {},
    }


def measured(case: Case, options: argparse.Namespace) -> dict[str, Any]:
    """Measure one case, and hold it against its bounds."""
    looks = {**TRANSFER_FUNCTIONS[case.transfer_function], "interpolation": case.interpolation}
    volume = examples.load_data(case.volume, as_volume=True)
    timings, converged = (options.part == part for part in ("timings", "converged"))
    settings = Settings(
        classification=looks,
        window_size=tuple(options.size),
        angles=(FRAME_RATIO_ANGLE,) if timings else ANGLES,
        max_supersegments=options.max_supersegments,
        sample_distance=min(volume.spacing) / CONVERGED_STEPS if converged else None,
        repeats=options.repeats if timings else 0,
        device=options.device,
        name=case.key,
    )
    report, _, _ = measure(volume, settings)
    if timings:
        held = judge_times(report, case.volume)
    else:
        held = judge_vtk(report, case.transfer_function)
        if not converged:
            held += judge_vdi(report, case.volume, case.transfer_function)
    checks = [{**asdict(check), "passed": check.passed} for check in held]
    return {**condensed(report), "checks": checks}


def missed_to_vtk(entry: dict[str, Any]) -> bool:
    """Whether the pictures at half a voxel's step missed a bound against VTK."""
    checks = entry.get("accuracy", {}).get("checks", ())
    return any("to VTK" in check["name"] and not check["passed"] for check in checks)


def condensed(report: Report) -> dict[str, Any]:
    """Return a report without what the case and the file's head already say."""
    described = report.to_dict()
    kept = ("dimensions", "spacing", "dtype", "sample_distance", "timing_sample_distance")
    return {
        "volume": {name: described["case"][name] for name in kept},
        "system": described["system"],
        "sizes": described["sizes"],
        "generation_seconds": described["generation_seconds"],
        "full_raycast_seconds": described["full_raycast_seconds"],
        "generation_ratio": described["generation_ratio"],
        "angles": described["angles"],
    }


if __name__ == "__main__":
    sys.exit(main())
