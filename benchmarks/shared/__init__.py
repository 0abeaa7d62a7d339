"""What the scripts of this folder share: options, volumes at hand, a run of a sample or of all."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from tqdm import tqdm

from pyvista_vdi import Volume, examples
from pyvista_vdi.cli.declare import parse_size
from pyvista_vdi.measure.harness import ROOMS, Bench, Case, Latest, run
from pyvista_vdi.measure.paper import find_dataset
from pyvista_vdi.measure.results import Results, closing, write_text
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS
from shared.sampling import SampledMean, estimate, sample

#: Where results go by default.
RESULTS = Path(__file__).parents[1] / "results"

#: Helpers of the tests: browsers, a slow line, random VDIs.
SUPPORT = Path(__file__).parents[2] / "tests" / "support"


def parser_of(
    doc: str | None,
    *,
    size: tuple[int, int] = (640, 360),
    volumes: Sequence[str] | None = examples.WHOLE,
    repeats: int | None = None,
) -> argparse.ArgumentParser:
    """Return a parser with the options that every script has.

    ``doc`` is the script's docstring; the window, volumes and timed turns are those by default.
    Without ``volumes`` or ``repeats`` there is no such option.
    """
    parser = argparse.ArgumentParser(description=doc.splitlines()[0] if doc else None)
    extent = parser.add_mutually_exclusive_group()
    extent.add_argument(
        "--sample",
        dest="whole",
        action="store_false",
        help="cases that speak for all, in five minutes at most on two cores (default)",
    )
    extent.add_argument("--whole", action="store_true", help="every case")
    help_of_only = "every case with this in its name (may be repeated), as a sample"
    extent.add_argument("--only", action="append", default=[], metavar="TEXT", help=help_of_only)
    parser.set_defaults(whole=False)
    parser.add_argument("--out", type=Path, default=RESULTS, metavar="FOLDER")
    parser.add_argument("--redo", action="store_true", help="measure what is there as well")
    parser.add_argument("--device", help="OpenCL device, see: pyvista-vdi devices")
    parser.add_argument("--size", type=parse_size, default=size, metavar="WxH")
    if volumes is not None:
        parser.add_argument("--volumes", nargs="+", default=list(volumes), metavar="NAME")
    if repeats is not None:
        parser.add_argument("--repeats", type=int, default=repeats, help="timed turns")
    return parser


def execute(
    kind: str,
    options: argparse.Namespace,
    cases: Iterable[Case],
    measure: Callable[[Case], Mapping[str, Any]],
    report: Callable[[Results, list[Case]], Iterable[str]],
    *,
    count: int = 0,
    drawn: Sequence[Case] = (),
    key: Callable[[Case], Hashable] | None = lambda case: case.volume,
    rooms: Sequence[str] = ROOMS,
) -> Results:
    """Measure a sample of the cases, or all, and write ``KIND.json`` and ``.md`` (``_sample``).

    Cases whose volume is not at hand are left out and named. A sample is of those that ``--only``
    names, or ``drawn``, or has ``count`` of them by the strata of ``key``, or without a key all
    cases of so many scenes (volume and look), which can be compared. ``rooms`` are those whose code
    decides the figures; ``report`` yields the lines of the tables, of the results and of all cases.
    """
    every = at_hand(cases)
    if options.only:
        chosen = [case for case in every if any(text in case.name for text in options.only)]
        if not chosen:
            names = ", ".join(repr(case.name) for case in every[:3])
            raise SystemExit(f"No case has any of {options.only} in its name: they are {names} ...")
    elif options.whole or drawn:
        chosen = every if options.whole else list(drawn)
    elif key is not None:
        chosen = sample(every, count, key)
    else:
        scenes = sample(dict.fromkeys(Case(case.volume, case.look) for case in every), count)
        chosen = [case for case in every if Case(case.volume, case.look) in scenes]
    name = kind + ("" if options.whole else "_sample")
    given = {k: v for k, v in vars(options).items() if k not in ("out", "redo", "device", "whole")}
    options.out.mkdir(parents=True, exist_ok=True)
    results = Results.begun(
        kind,
        {k: str(v) if isinstance(v, Path) else v for k, v in given.items()},
        path=options.out / f"{name}.json",
        rooms=rooms,
        extent="whole" if options.whole else "sample",
        device=options.device,
        resume=not options.redo,
    )
    with tqdm(total=1.0, disable=not sys.stderr.isatty(), bar_format="{l_bar}{bar}") as bar:

        def progress(done: float, doing: str = "") -> None:
            bar.set_description(doing, refresh=False)
            bar.update(done - bar.n)

        run(chosen, measure, results, progress)
    lines = [f"# {kind}", "", f"{len(chosen)} of {len(every)} cases.", "", *report(results, every)]
    refused = [row for row in results.rows() if "refused" in row]
    lines += ["", *(f"- {row['case']}: {row['refused']}" for row in refused)] if refused else []
    text = "\n".join([*lines, *closing(results.data), ""])
    write_text(results.path.with_suffix(".md"), text)
    print(text)
    print(f"Written: {results.path}, and .md beside it")
    return results


def at_hand(cases: Iterable[Case]) -> list[Case]:
    """Return the cases whose volume can be loaded or made; name the volumes of the others."""
    cases, there = list(cases), examples.available()
    absent = {case.volume for case in cases if case.volume in examples.VOLUMES} - set(there)
    if absent:
        print(f"Left out, not in {examples.DATA_VARIABLE}: {', '.join(sorted(absent))}")
    return [case for case in cases if case.volume not in absent]


def load(name: str) -> Volume:
    """Return a volume by its name: an example, or one that is made (``beechnut_like@8``)."""
    if name in examples.VOLUMES:
        return examples.load_data(name, as_volume=True)
    return find_dataset(name).load()


def table_of(volume: Volume, look: str | None, **more: Any) -> Any:
    """Return a standard transfer function of a volume, *soft* unless it says otherwise."""
    arguments = {**TRANSFER_FUNCTIONS[look or "soft"], **more}
    return Classification.composited(arguments, "a benchmark").transfer_function_of(volume)


def benches(options: argparse.Namespace, *, vtk: bool = False) -> Latest[Bench]:
    """Return what keeps the latest bench, by (volume, look, interpolation)."""
    volumes = Latest(load)

    def bench_of(volume: str, look: str | None, interpolation: str = "nearest") -> Bench:
        found = volumes(volume)
        table = table_of(found, look, interpolation=interpolation)
        return Bench(found, table, tuple(options.size), device=options.device, vtk=vtk)

    return Latest(bench_of)


def mean_of(
    results: Results, every: Sequence[Case], figure: Callable[[Any], float | None], **having: Any
) -> SampledMean | None:
    """Return the mean of a figure over all cases with these values, and its error."""
    found = [figure(row) for row in results.rows(**having) if "refused" not in row]
    values = [value for value in found if value is not None]
    of = [
        case
        for case in every
        if all(case.to_dict().get(name) == value for name, value in having.items())
    ]
    return estimate({"": values}, {"": len(of)}) if values else None


def marked(text: str, reached: bool) -> str:
    """Return a figure, bold where it is not what must be reached."""
    return text if reached else f"**{text}**"
