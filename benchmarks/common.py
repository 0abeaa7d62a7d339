"""What the scripts of this folder share: options, volumes at hand, VDIs, clocks, results' files."""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tqdm import tqdm

from pyvista_vdi import examples
from pyvista_vdi.cli.declare import parse_size
from pyvista_vdi.device import Runtime
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.io import read, whole_file
from pyvista_vdi.measure.clock import take_turns
from pyvista_vdi.measure.report import across, describe_system, without_infinities, write_text
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS, WINDOW_SIZE, filling_camera
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume

INTERPOLATIONS = ("nearest", "linear")

#: Wall clock, and the process's CPU time, which a machine that does other work distorts less.
BOTH_CLOCKS = {"wall": time.perf_counter, "cpu": time.process_time}

#: Where results go by default.
RESULTS = Path(__file__).parent / "results"


class Subject(NamedTuple):
    """A volume as the options of a script want it seen."""

    volume: Volume
    classified: TransferFunction
    view: Camera  # V_O, whose window it fills


def new_parser(
    doc: str | None, *, repeats: int | None = None, repeated: str = "", writes: bool = True
) -> argparse.ArgumentParser:
    """Return a parser with the options that every script has.

    Parameters
    ----------
    doc : str, optional
        The script's docstring; its first line is the description.
    repeats : int, optional
        How often things are timed by default, if they are.
    repeated : str
        What is.
    writes : bool
        Whether results go into a folder.
    """
    parser = argparse.ArgumentParser(description=doc.splitlines()[0] if doc else None)
    if writes:
        parser.add_argument("--out", type=Path, default=RESULTS, metavar="FOLDER")
    if repeats is not None:
        parser.add_argument("--repeats", type=int, default=repeats, help=repeated)
    parser.add_argument("--device", help="OpenCL device, see: pyvista-vdi devices")
    return parser


def add_size(parser: argparse.ArgumentParser, size: tuple[int, int] = WINDOW_SIZE) -> None:
    """Add ``--size``, V_O's window in pixels."""
    parser.add_argument("--size", type=parse_size, default=size, metavar="WxH")


def add_volumes(parser: argparse.ArgumentParser, volumes: Sequence[str] | None = None) -> None:
    """Add ``--volumes``: those by default, or every known one."""
    parser.add_argument(
        "--volumes",
        nargs="+",
        choices=sorted(examples.VOLUMES),
        default=volumes or examples.WHOLE,
        metavar="NAME",
    )


def add_looks(
    parser: argparse.ArgumentParser,
    *,
    tf: str | None = "soft",
    interpolation: str | None = "nearest",
    max_supersegments: int | None = 20,
) -> None:
    """Add the options of how volumes look and what their VDIs hold, but for those that are None."""
    if tf is not None:
        parser.add_argument("--tf", choices=TRANSFER_FUNCTIONS, default=tf)
    if interpolation is not None:
        parser.add_argument("--interpolation", choices=INTERPOLATIONS, default=interpolation)
    if max_supersegments is not None:
        parser.add_argument("--max-supersegments", type=int, default=max_supersegments, metavar="N")


def add_vdi_cache(parser: argparse.ArgumentParser) -> None:
    """Add ``--vdi-cache``, see :func:`vdi_of`."""
    parser.add_argument(
        "--vdi-cache",
        type=Path,
        metavar="FOLDER",
        help="read VDIs from there that an earlier run has written, and write those it lacks",
    )


def add_vdi_options(
    parser: argparse.ArgumentParser,
    *,
    size: tuple[int, int] = WINDOW_SIZE,
    volumes: Sequence[str] | None = None,
) -> None:
    """Add the options of scripts that measure VDIs of many volumes, one after the other.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Of :func:`new_parser`.
    size : (int, int)
        V_O's window by default, pixels.
    volumes : sequence of str, optional
        Names by default; every known volume if there are none.
    """
    add_size(parser, size)
    add_volumes(parser, volumes)
    add_looks(parser, interpolation=None)
    add_vdi_cache(parser)
    add_redo(parser)


def add_redo(parser: argparse.ArgumentParser) -> None:
    """Add ``--redo`` for scripts that go on where an earlier run has stopped."""
    parser.add_argument("--redo", action="store_true", help="measure what is there as well")


def at_hand(names: Iterable[str]) -> list[str]:
    """Return the names whose volume can be loaded; say which are left out."""
    names, there = list(names), examples.available()
    absent = [name for name in names if name not in there]
    if absent:
        print(f"Left out, not in {examples.DATA_VARIABLE}: {', '.join(absent)}", file=sys.stderr)
    return [name for name in names if name in there]


def results_file(name: str, options: argparse.Namespace) -> Path:
    """Return where results of a window's size go; tables and plots go beside it."""
    return options.out / f"{name}_{across(options.size)}.json"


def begun(target: Path, case: Mapping[str, Any], parts: str = "volumes") -> dict[str, Any]:
    """Return the results that an earlier run of the same case has left, or new ones.

    Parameters
    ----------
    target : pathlib.Path
        Their file; its folder is made.
    case : mapping
        What must be the same for results to stand in one file.
    parts : str
        Name of the dictionary that is filled, one entry at a time.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    fresh = {**case, parts: {}}
    results: dict[str, Any] = json.loads(target.read_text()) if target.exists() else fresh
    if any(results.get(name) != value for name, value in case.items()):
        sys.exit(f"{target} was measured otherwise or elsewhere: choose another --out")
    return results


def save(results: Mapping[str, Any], target: Path) -> None:
    """Write a file of results; a run that is stopped meanwhile leaves the old one."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(target) as stream:
        stream.write(json.dumps(without_infinities(dict(results)), indent=1).encode() + b"\n")


def measure_missing(
    name: str,
    options: argparse.Namespace,
    case: Mapping[str, Any],
    wanted: Iterable[str],
    measured: Callable[[str], Any],
    report: Callable[[dict[str, Any]], str],
    *,
    parts: str = "volumes",
) -> dict[str, Any]:
    """Measure the parts that an earlier run of the same case has not, and write all results.

    Parameters
    ----------
    name : str
        Of the files in ``options.out``, before the window's size.
    options : argparse.Namespace
        With ``size``, ``device`` and ``redo``.
    case : mapping
        As for :func:`begun`, beside the window's size and the system.
    wanted : iterable of str
        Names of the parts.
    measured, report : callable
        What makes one of them, and the text of all.
    parts : str
        As for :func:`begun`.
    """
    target = results_file(name, options)
    head = {"window_size": list(options.size), "system": describe_system(options.device), **case}
    results = begun(target, head, parts)
    for part in tqdm(list(wanted), unit="part", disable=not sys.stderr.isatty()):
        if part not in results[parts] or options.redo:
            results[parts][part] = measured(part)
            save(results, target)
    write_text(target.with_suffix(".md"), report(results))
    print(f"Written: {target}, and .md beside it")
    return results


def looks_of(options: argparse.Namespace, look: str | None = None) -> dict[str, Any]:
    """Return the arguments of ``add_volume`` that the options stand for, or another look's."""
    chosen = TRANSFER_FUNCTIONS[options.tf if look is None else look]
    return {**chosen, "interpolation": options.interpolation}


def subject_of(name: str, options: argparse.Namespace, look: str | None = None) -> Subject:
    """Return a volume with the options' transfer function, or another, and interpolation."""
    volume = examples.load_data(name, as_volume=True)
    looks = looks_of(options, look)
    classified = Classification(looks, "a benchmark").transfer_function(volume)
    return Subject(volume, classified, filling_camera(volume.bounds, options.size))


def vdi_of(name: str, options: argparse.Namespace) -> VDI:
    """Return the volume's VDI: from the cache, or generated and written there."""
    path = None
    if options.vdi_cache is not None:
        width = options.size[0]
        file = f"{name}_{options.tf}_{width}_{options.max_supersegments}.vdi"
        path = options.vdi_cache / file
        if path.exists():
            vdi = read(path)
            if vdi.window_size == tuple(options.size):
                return vdi
    volume = examples.load_data(name, as_volume=True)
    classification = Classification(TRANSFER_FUNCTIONS[options.tf], "a benchmark")
    vdi = generate_vdi(
        volume,
        filling_camera(volume.bounds, options.size),
        options.size,
        classification.transfer_function(volume),
        max_supersegments=options.max_supersegments,
        device=options.device,
    )
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        vdi.save(path)
    return vdi


def marked(text: str, reached: bool) -> str:
    """Return a figure, bold where it is not what must be reached."""
    return text if reached else f"**{text}**"


def add_clock(parser: argparse.ArgumentParser) -> None:
    """Add ``--clock``: how a CPU is timed on a machine that others use as well."""
    parser.add_argument(
        "--clock",
        choices=("wall", "cpu"),
        default="wall",
        help="cpu: the process's CPU time over the device's cores, for a CPU device on a machine "
        "that does other work as well; what one core does alone then counts too little",
    )


def clock_of(options: argparse.Namespace, runtime: Runtime) -> Callable[[], float]:
    """Return the clock that was chosen, seconds."""
    if options.clock == "wall":
        return time.perf_counter
    if not runtime.is_cpu:
        sys.exit("--clock cpu says nothing of a device that is no CPU: leave it out")
    return lambda: time.process_time() / runtime.info.compute_units


def timed(ways: Mapping[str, Callable[[], object]], repeats: int) -> dict[str, dict[str, Any]]:
    """Time several ways in turns: seconds by wall clock and by CPU, with the spread."""
    return {
        name: {
            clock: {"median": statistics.median(s), "least": min(s), "most": max(s)}
            for clock, s in taken.items()
        }
        for name, taken in take_turns(ways, repeats, warm_up=False, clocks=BOTH_CLOCKS).items()
    }
