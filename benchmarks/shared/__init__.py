"""What the scripts of this folder share: options, cases, a run of a sample or of all, tables."""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import statistics
import subprocess
import sys
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from pyvista_vdi import VDIError, Volume, examples
from pyvista_vdi.cli.declare import size as parse_size
from pyvista_vdi.cli.text import write_text
from pyvista_vdi.measure.bench import Bench, as_json
from pyvista_vdi.model.classification import Classification
from shared.volumes import make

CHECKOUT = Path(__file__).parents[2]

#: Where results go by default.
RESULTS = CHECKOUT / "benchmarks" / "results"

#: Transfer functions of the standard cases by name, as arguments of ``Plotter.add_volume``.
LOOKS: dict[str, dict[str, Any]] = {
    "soft": {"cmap": "bone", "opacity": "linear"},
    "steep": {"cmap": "viridis", "opacity": "sigmoid_10"},
    "nearly-opaque": {"cmap": "inferno", "opacity": (0.0, 0.0, 0.02, 0.9, 1.0)},
}

#: Folders whose code decides the figures of a VDI beside volume rendering.
ROOMS = ("generation", "raycasting", "volume")


@dataclass(frozen=True)
class Case:
    """What a row is about: an angle in degrees of ``Azimuth``, other options by name, ``what``."""

    volume: str
    look: str | None = None
    window_size: tuple[int, int] | None = None
    angle: float | None = None
    options: tuple[tuple[str, Any], ...] = ()
    what: str | None = None

    @property
    def name(self) -> str:
        """Its name for ``--only``: ``"brain, soft, 1280x720, max_supersegments 15, 5 degrees"``."""
        size, angle = self.window_size, self.angle
        parts = [self.volume, self.look, size and "x".join(map(str, size))]
        parts += [f"{name} {value}" for name, value in self.options]
        parts += [None if angle is None else f"{angle:g} degrees", self.what]
        return ", ".join(part for part in parts if part)

    def to_dict(self) -> dict[str, Any]:
        """Return what tells it from others, as results have it: only what was given."""
        found = {"what": self.what, "volume": self.volume, "look": self.look}
        found |= {"window_size": self.window_size, **dict(self.options), "angle": self.angle}
        return {name: value for name, value in found.items() if value is not None}


class Latest:
    """Keeps what was made for the latest arguments; for others it is closed, and made again."""

    def __init__(self, make: Callable[..., Any]) -> None:
        self._make, self._key, self._found = make, None, None

    def __call__(self, *key: Any) -> Any:
        """Return what belongs to the arguments."""
        if key != self._key:
            self.close()
            self._found, self._key = self._make(*key), key
        return self._found

    def close(self) -> None:
        """Drop what is kept, and close it if it can be closed."""
        getattr(self._found, "close", lambda: None)()
        self._key = self._found = None

    def __enter__(self) -> Latest:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


class Results:
    """What was measured: JSON with a row for each case, written whole after every one."""

    def __init__(self, path: Path, kind: str, plan: Any, rooms: Sequence[str], extent: str) -> None:
        self.path, self.plan = path, plan
        measured = {"commit": _commit(), "rooms": list(rooms)}
        self.data: dict[str, Any] = {"format": "pyvista-vdi results", "kind": kind, "plan": plan}
        self.data |= {"measured": measured, "extent": extent, "begun": _now(), "rows": []}

    def add(self, case: Case, figures: Mapping[str, Any]) -> None:
        """Add a row and write the file."""
        row = as_json({"case": case.to_dict(), **figures})
        self.data["rows"].append(row)
        head = {name: value for name, value in self.data.items() if name != "rows"}
        lines = ",\n".join(json.dumps(row, separators=(",", ":")) for row in self.data["rows"])
        write_text(self.path, f'{json.dumps(head)[:-1]},\n"rows": [\n{lines}\n]}}\n')

    def rows(self, **having: Any) -> Iterator[dict[str, Any]]:
        """Yield the rows with figures whose case has these values, ``None`` where it has none."""
        for row in self.data["rows"]:
            here = all(row["case"].get(name) == value for name, value in having.items())
            if here and "refused" not in row:
                yield row


def parser_of(
    doc: str | None,
    *,
    size: tuple[int, int] = (640, 360),
    volumes: Sequence[str] | None = tuple(sorted({*examples.VOLUMES} - {"ct"})),
    repeats: int | None = None,
) -> argparse.ArgumentParser:
    """Return a parser with the options that every script has; without ``volumes`` not that one."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0] if doc else None)
    extent = parser.add_mutually_exclusive_group()
    extent.add_argument("--whole", action="store_true", help="every case, not a sample")
    help_of_only = "every case with this in its name (may be repeated), as a sample"
    extent.add_argument("--only", action="append", default=[], metavar="TEXT", help=help_of_only)
    parser.add_argument("--out", type=Path, default=RESULTS, metavar="FOLDER")
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
    key: Callable[[Case], Hashable] | None = lambda case: case.volume,
    rooms: Sequence[str] = ROOMS,
) -> Results:
    """Measure a sample of the cases, or all, and write ``KIND.json`` and ``.md`` (``_sample``).

    Errors become rows with the reason. A sample is of those that ``--only`` names, or has ``count``
    of them by the strata of ``key``, or without a key all cases of so many scenes (volume and
    look). ``rooms`` are the folders whose code decides the figures; ``report`` yields the lines of
    the tables, of the results and of all cases.
    """
    every = at_hand(cases)
    if options.only:
        chosen = [case for case in every if any(text in case.name for text in options.only)]
    elif options.whole:
        chosen = every
    elif key is not None:
        chosen = sample(every, count, key)
    else:
        scenes = sample(dict.fromkeys(Case(case.volume, case.look) for case in every), count)
        chosen = [case for case in every if Case(case.volume, case.look) in scenes]
    if not chosen:
        names = ", ".join(repr(case.name) for case in every[:3])
        raise SystemExit(f"No case has any of {options.only} in its name: they are {names} ...")
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / (kind + ("" if options.whole else "_sample") + ".json")
    plan = {k: str(v) if isinstance(v, Path) else v for k, v in vars(options).items() if k != "out"}
    results = Results(path, kind, plan, rooms, "whole" if options.whole else "sample")
    refused = []
    for number, case in enumerate(chosen, 1):
        if sys.stderr.isatty():
            print(f"{number} of {len(chosen)}: {case.name}", file=sys.stderr)
        try:
            results.add(case, measure(case))
        except (VDIError, MemoryError) as error:
            results.add(case, {"refused": f"{type(error).__name__}: {error}"})
            refused.append(f"- {case.name}: {error}")
    commit = results.data["measured"]["commit"]
    lines = [f"# {kind}", "", f"{len(chosen)} of {len(every)} cases.", "", *report(results, every)]
    lines += ["", *refused, f"Measured from {results.data['begun']} to {_now()}, commit {commit}."]
    text = "\n".join([*lines, ""])
    write_text(path.with_suffix(".md"), text)
    print(text)
    print(f"Written: {path}, and .md beside it")
    return results


def _commit() -> str | None:
    """Return the checkout's commit, with ``+`` where files differ from it."""
    command = ["git", "describe", "--always", "--abbrev=9", "--dirty=+", "--exclude=*"]
    done = subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, check=False)
    return done.stdout.strip() or None


def _now() -> str:
    return datetime.now(timezone.utc).isoformat(timespec="seconds")


def at_hand(cases: Iterable[Case]) -> list[Case]:
    """Return the cases whose volume can be loaded or made; name the volumes of the others."""
    cases, there = list(cases), examples.available()
    absent = {case.volume for case in cases if case.volume in examples.VOLUMES} - set(there)
    if absent:
        print(f"Left out, not in {examples.DATA_VARIABLE}: {', '.join(sorted(absent))}")
    return [case for case in cases if case.volume not in absent]


def load(name: str) -> Volume:
    """Return a volume by its name: an example, or one that is made (``beechnut_like@8``)."""
    return examples.load_data(name, as_volume=True) if name in examples.VOLUMES else make(name)


def table_of(volume: Volume, look: str | None, **more: Any) -> Any:
    """Return a standard transfer function of a volume, *soft* unless it says otherwise."""
    return Classification(**LOOKS[look or "soft"], **more).transfer_function_of(volume)


def benches(options: argparse.Namespace, *, vtk: bool = False) -> Latest:
    """Return what keeps the latest :class:`Bench`, by (volume, look, interpolation)."""
    volumes = Latest(load)

    def bench_of(volume: str, look: str | None, interpolation: str = "nearest") -> Bench:
        found = volumes(volume)
        table = table_of(found, look, interpolation=interpolation)
        return Bench(found, table, tuple(options.size), device=options.device, vtk=vtk)

    return Latest(bench_of)


def sample(
    cases: Iterable[Case], count: int, key: Callable[[Case], Hashable] = lambda case: case.volume
) -> list[Case]:
    """Draw cases so that they speak for all: the same ones in every run, in their order.

    Every stratum, a volume's cases unless ``key`` says otherwise, has one case drawn while there
    are enough, and then as many as its share. Which ones, a hash of their names decides.
    """
    cases = list(cases)
    strata: dict[Hashable, list[Case]] = {}
    for case in sorted(cases, key=lambda case: hashlib.sha256(case.name.encode()).digest()):
        strata.setdefault(key(case), []).append(case)
    order = [
        (rank > 0, (rank + 0.5) / len(members), case)
        for members in strata.values()
        for rank, case in enumerate(members)
    ]
    drawn = {case for *_, case in sorted(order, key=lambda entry: entry[:2])[:count]}
    return [case for case in cases if case in drawn]


def mean_of(
    results: Results, every: Sequence[Case], figure: Callable[[Any], float | None], **having: Any
) -> str:
    """Return the mean of a figure over all cases with these values, ± its standard error."""
    values = [value for row in results.rows(**having) if (value := figure(row)) is not None]
    count = sum(all(case.to_dict().get(n) == v for n, v in having.items()) for case in every)
    mean = f"{statistics.fmean(values):.3g}" if values else "-"
    if not 1 < len(values) < count:
        return mean
    error = math.sqrt(statistics.variance(values) * (1 - len(values) / count) / len(values))
    return f"{mean} ± {error:.1g} ({len(values)} of {count} cases)"


def table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """Return the lines of a Markdown table; ``None`` is shown as a dash."""
    lines = [["-" if cell is None else str(cell) for cell in cells] for cells in (heads, *rows)]
    lines.insert(1, ["---"] * len(heads))
    return [f"| {' | '.join(cells)} |" for cells in lines]


def milliseconds(seconds: float | None) -> str:
    """Return a time in milliseconds, to three digits."""
    return "-" if seconds is None else f"{seconds * 1e3:.3g}"
