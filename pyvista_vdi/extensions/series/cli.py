"""The verb ``series``, its options, and what ``info`` and ``convert`` do with files of series."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

from pyvista_vdi import registry
from pyvista_vdi.cli import declare
from pyvista_vdi.cli.files import state_of, text_of
from pyvista_vdi.cli.generate import as_seen, generating_view
from pyvista_vdi.cli.inputs import (
    OF_ANY_VOLUME,
    PLACE,
    classification,
    kept_values,
    measuring,
    of_the_file,
    part,
    refuse,
    say_written,
    settings,
    with_look,
)
from pyvista_vdi.cli.steps import Step, in_order, steps_of_volumes
from pyvista_vdi.cli.text import mebibytes, printable, table
from pyvista_vdi.errors import InvalidArgumentError, naming
from pyvista_vdi.extensions.series import files as of_series
from pyvista_vdi.extensions.series.archive import SERIES, Kind
from pyvista_vdi.extensions.series.generate import StepMaker
from pyvista_vdi.extensions.series.series import Called, VDISeries, check_range, range_of
from pyvista_vdi.io import FileInfo, check_write_options, checked_target, is_vdi_file, read_info
from pyvista_vdi.io import read as read_vdi
from pyvista_vdi.io.files import format_named
from pyvista_vdi.model.checks import as_number
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.options import Deferral, declared
from pyvista_vdi.model.packing import PRECISIONS
from pyvista_vdi.model.standard_cases import WINDOW_SIZE
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.whole_file import check_writable, with_suffix

#: Options of ``convert`` that are for deep images of other programs.
OF_READ_IMAGES = ("camera_json", "thickness")


def series(options: argparse.Namespace) -> int:
    """Write a series of the files that are named: VDIs or volumes."""
    files = in_order(options.files)
    of_vdis = is_vdi_file(files[0])
    if any(is_vdi_file(file) != of_vdis for file in files):
        raise InvalidArgumentError("the files are VDIs or volumes, and not some of each")
    if of_vdis:
        of_volumes = (*OF_ANY_VOLUME, *PLACE, "view_angle", "sample_distance", "memory_limit")
        refuse(options, (*of_volumes, "scheduler", *declared(Deferral)), "volumes")
        steps = [_step_of_vdi(file) for file in files]
    else:
        steps = steps_of_volumes(files, options, in_chunks=True)
    times = _times(steps, options.times)
    looks = classification(options)
    Classification.composited(looks, "series")  # refused before a volume is read
    looks |= kept_values(options)
    check_writable(with_suffix(Path(options.output), (SERIES.suffix,), "a series"))
    address = options.scheduler
    connected = nullcontext() if address is None else registry.generator("clients")(address)
    with connected as client, measuring("writing a series") as bar:
        vdi_of = _reader(steps) if of_vdis else _maker(steps, options, client, looks)
        vdis = VDISeries(Called(vdi_of, range(len(steps))), times)
        target = vdis.save(
            options.output, progress=bar, **{"precision": "8-byte", **of_the_file(options)}
        )
    size = mebibytes(target.stat().st_size)
    print(f"{printable(options.output)}: {len(vdis)} steps, {size}")
    return 0


def _maker(
    steps: Sequence[Step], options: argparse.Namespace, client: Any, looks: dict[str, Any]
) -> Callable[[int], VDI]:
    """Return what makes the VDI of a step's volume, all from the view that the first one has."""
    with naming(steps[0].name):
        first = steps[0].read()
    view = generating_view(options, first)
    chosen = {name: getattr(options, name) for name in ("max_supersegments", "device")}
    chosen["settings"] = settings(options)
    make = StepMaker("series", view, options.size, client=client, **chosen, **looks)

    def vdi_of(i: int) -> VDI:
        with naming(f"{steps[i].name}: step {i}"):
            return make(as_seen(options, steps[i].read() if i else first, view))

    return vdi_of


def _reader(steps: Sequence[Step]) -> Callable[[int], VDI]:
    """Return what reads the VDI of a step, and refuses what is not of the first one's kind."""
    ends = range_of(steps[0].read())

    def vdi_of(i: int) -> VDI:
        vdi: VDI = steps[i].read()
        check_range(vdi, ends, steps[i].name)
        return vdi

    return vdi_of


def _step_of_vdi(file: str) -> Step:
    """Return a step of a file, with the time that a simulation has written."""
    at = as_number(read_info(file).metadata.get("time"))
    return Step(file, None if math.isnan(at) else at, partial(read_vdi, file))


def _times(steps: Sequence[Step], given: Sequence[float] | None) -> Sequence[float]:
    """Return the times that are given, else the files' where these ascend, else numbers."""
    if given is not None:
        if len(given) != len(steps):
            raise InvalidArgumentError(
                f"--times gives a time to each step: there are {len(steps)} steps and "
                f"{len(given)} times"
            )
        return given
    known = [step.time for step in steps if step.time is not None]
    if len(known) == len(steps) and all(a < b for a, b in pairwise(known)):
        return known
    if known:
        print(
            "The times in the files do not ascend, or some have none: steps are numbered "
            "(--times gives times)",
            file=sys.stderr,
        )
    return range(len(steps))


def info(options: argparse.Namespace) -> int:
    """Print what a series says about itself."""
    times = of_series.read(options.file).times
    steps = {"steps": f"{len(times)}, times {times[0]:g} to {times[-1]:g}"}
    return print_info(options, of_series.read_info(options.file), steps, {"times": times})


def print_info(
    options: argparse.Namespace, about: FileInfo, own: dict[str, str], listed: dict[str, Any]
) -> int:
    """Print what a series or a set says about itself; what is one VDI's is the first one's."""
    if options.json:
        print(json.dumps({**state_of(about), **listed}, indent=1))
    else:
        print(table(own) + "\n" + text_of(about))
    return 0


def convert(options: argparse.Namespace) -> int:
    """Write a series as one file, as a page, or each of its steps to a file of its own."""
    return convert_several(options, of_series.read, SERIES)


def convert_several(options: argparse.Namespace, read: Callable[[str], Any], kind: Kind) -> int:
    """Write a series or a set as one file, as a page, or each VDI to a file of its own."""
    refuse(options, OF_READ_IMAGES, f"deep images, .exr, and this is a {kind.name}")
    target, arguments = Path(options.output), of_the_file(options)
    found = format_named(target)
    together = found is not None and (found.page or found.suffix == kind.suffix)
    colors = found is not None and found.suffix not in (kind.suffix, ".vdi")
    vdis = with_look(options, read(options.file), options.file, colors=colors)
    if together:
        with measuring("converting") as bar:
            vdis.save(target, progress=part(bar, 0.0, 1.0, "writing"), **arguments)
        say_written([target])
        return 0
    # Name each by a number
    digits = max(4, len(str(len(vdis) - 1)))
    files = [
        target.with_name(f"{target.stem}_{i:0{digits}}{target.suffix}") for i in range(len(vdis))
    ]
    checked_target(files[0])
    check_write_options(files[0], arguments)
    with measuring("converting") as bar:
        for i, file in enumerate(files):
            vdis[i].save(file, **arguments)
            bar((i + 1) / len(files))
    print(f"Written: {printable(files[0])} to {printable(files[-1].name)}, {len(files)} files")
    return 0


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the verb ``series``."""
    text = (
        f"VDIs; or volumes, each {declare.VOLUME_FILE}. Of a store, a "
        ".pvd, a .vti.series and other files with time steps all are taken. Names in a shell's "
        "order are put in that of their numbers, step_2 before step_10"
    )
    declare.option(parser, "files", text, "FILE", nargs="+")
    declare.output(parser, ".vdis to write")
    times = "of the steps, ascending (default: those in the files, else 0,1,2,...)"
    declare.option(parser, "--times", times, "A,B,...", declare.parse_numbers)
    group = parser.add_argument_group("file")
    text = "of the supersegments (default: 8-byte)"
    declare.option(group, "--precision", text, choices=PRECISIONS)
    text = "zstd (default), lz4, deflate or none"
    declare.option(group, "--compression", text, choices=("zstd", "lz4", "deflate", "none"))
    declare.option(group, "--compression-level", "1 (fast) to 9 (small)", "N", declare.parse_whole)
    group = parser.add_argument_group("volumes", "What VDIs are made of them; not for VDIs.")
    declare.grid(group)
    declare.size(group, WINDOW_SIZE)
    declare.longest(group)
    declare.step(group)
    declare.memory_limit(group)
    declare.scheduler(group)
    declare.camera(parser, "the view that the first volume fills")
    declare.classification(parser)
    declare.deferral(parser)
    declare.device(parser)
