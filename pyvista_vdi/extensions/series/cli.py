"""The verb ``series``, its options, and what ``info`` and ``convert`` do with files of series."""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

from pyvista_vdi import registry
from pyvista_vdi.cli import declare
from pyvista_vdi.cli.files import of_values
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
    with_look,
)
from pyvista_vdi.cli.steps import Step, in_order, steps_of_volumes
from pyvista_vdi.cli.text import LENGTHS, mebibytes, printable, table, vector
from pyvista_vdi.errors import InvalidArgumentError, VDIFileError, naming
from pyvista_vdi.extensions.series import files as of_series
from pyvista_vdi.extensions.series.archive import SERIES, Kind, StoredInfo
from pyvista_vdi.extensions.series.writer import SeriesWriter
from pyvista_vdi.io import check_write_options, checked_target, read_info
from pyvista_vdi.io import read as read_vdi
from pyvista_vdi.io.files import format_named, holds
from pyvista_vdi.model.checks import as_number
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.options import Deferral, declared
from pyvista_vdi.model.packing import PRECISIONS
from pyvista_vdi.model.standard_cases import WINDOW_SIZE
from pyvista_vdi.model.whole_file import check_writable, with_suffix

#: Options of ``convert`` that are for deep images of other programs, and for those that it writes.
OF_READ_IMAGES = ("camera_json", "thickness", "from_linear")
OF_WRITTEN_IMAGES = ("standard_channels", "linear")


def series(options: argparse.Namespace) -> int:
    """Write a series of the files that are named: VDIs, series of them, or volumes."""
    files = in_order(options.files)
    kinds = [_kind(file) for file in files]
    if len(set(kinds)) > 1:
        raise InvalidArgumentError("the files are VDIs or volumes, and not some of each")
    if kinds[0] != "volume":
        of_volumes = (*OF_ANY_VOLUME, *PLACE, "view_angle", "sample_distance", "memory_limit")
        refuse(options, (*of_volumes, "scheduler", *declared(Deferral)), "volumes")
    if options.times is not None and kinds[0] == "series":
        raise InvalidArgumentError("the series have their own times: leave out --times")
    if kinds[0] == "volume":
        steps = steps_of_volumes(files, options, in_chunks=True)
    else:
        steps = _steps_of_vdis(files)
    if kinds[0] != "series":
        steps = _timed(steps, options.times)
    looks = classification(options)
    Classification.composited(looks, "series")  # refused before a volume is read
    looks |= kept_values(options)
    target = with_suffix(Path(options.output), (SERIES.suffix,), "a series").resolve()
    if target.exists():
        raise VDIFileError(f"{target} is there already: choose another name, or remove it first")
    check_writable(target)
    # A folder grows step by step: it gets its name when it is whole
    with (
        tempfile.TemporaryDirectory(prefix=".pyvista-vdi-", dir=target.parent) as folder,
        _connected(options.scheduler) as client,
        measuring("writing a series") as bar,
    ):
        part = Path(folder) / target.name
        if kinds[0] == "volume":
            _write_volumes(part, steps, options, {"client": client, **looks}, bar)
        else:
            with SeriesWriter(part, **of_the_file(options)) as out:
                for i, step in enumerate(steps):
                    out.append(step.read(), step.time)
                    bar((i + 1) / len(steps))
        part.rename(target)
    about = of_series.read_info(options.output)
    print(f"{printable(options.output)}: {len(about.times)} steps, {mebibytes(about.file_bytes)}")
    return 0


def _write_volumes(
    target: Path, steps: list[Step], options: argparse.Namespace, more: dict[str, Any], bar: Any
) -> None:
    """Write VDIs of volumes, all from the view that the first one has."""
    with naming(steps[0].name):
        volume = steps[0].read()
    view = generating_view(options, volume)
    with SeriesWriter(
        target,
        view,
        options.size,
        max_supersegments=options.max_supersegments,
        sample_distance=options.sample_distance,
        memory_limit=options.memory_limit,
        device=options.device,
        **of_the_file(options),
        **more,
    ) as out:
        for i, step in enumerate(steps):
            with naming(step.name):
                volume = step.read() if i else volume
                out.append(as_seen(options, volume, view), step.time)
            bar((i + 1) / len(steps))


def _connected(address: str | None) -> Any:
    """Connect to a Dask scheduler, if one is given."""
    return nullcontext() if address is None else registry.generator("clients")(address)


def _steps_of_vdis(files: Sequence[str]) -> list[Step]:
    """Return the steps of files that hold VDIs or series of them."""
    steps = []
    for file in files:
        if holds(file) == "series":
            series = read_vdi(file)
            for i, at in enumerate(series.times):
                steps.append(Step(f"{file}, step {i}", at, partial(series.__getitem__, i)))
        else:
            at = as_number(read_info(file).metadata.get("time"))  # as a simulation's is written
            steps.append(Step(file, None if math.isnan(at) else at, partial(read_vdi, file)))
    return steps


def _timed(steps: Sequence[Step], given: Sequence[float] | None) -> list[Step]:
    """Return steps with the times that are given, else with the files' where these ascend."""
    if given is not None:
        if len(given) != len(steps):
            raise InvalidArgumentError(
                f"--times gives a time to each step: there are {len(steps)} steps and "
                f"{len(given)} times"
            )
        return [replace(step, time=at) for step, at in zip(steps, given, strict=True)]
    known = [step.time for step in steps if step.time is not None]
    if known and (len(known) < len(steps) or any(b <= a for a, b in pairwise(known))):
        print(
            "The times in the files do not ascend, or some have none: steps are numbered "
            "(--times gives times)",
            file=sys.stderr,
        )
        return [replace(step, time=None) for step in steps]
    return list(steps)


def _kind(file: str) -> str:
    from pyvista_vdi.io import is_vdi_file

    if holds(file) == "series":
        return "series"
    return "VDI" if is_vdi_file(file) else "volume"


def info(options: argparse.Namespace) -> int:
    """Print what a series says about itself."""
    about = of_series.read_info(options.file)
    times = about.times
    steps = {"steps": f"{len(times)}, times {times[0]:g} to {times[-1]:g}"}
    print_info(options, about, steps, {})
    return 0


def print_info(
    options: argparse.Namespace, about: StoredInfo, own: dict[str, str], listed: dict[str, Any]
) -> None:
    """Print what a series or a set says about itself, with what is its own."""
    if options.json:
        state = {**vars(about), "path": str(about.path), "camera": about.camera.to_dict()}
        print(json.dumps({**state, **listed}, indent=1))
        return
    width, height = about.window_size
    kept = about.deferred
    print(
        table(
            {
                "file": f"{about.path}, {mebibytes(about.file_bytes)}, {about.codec}",
                "written by": f"{about.written_by}, format version {about.format_version}",
                **own,
                **({} if kept is None else of_values(kept["value_range"])),
                "bytes a VDI": f"{min(about.vdi_bytes)} to {max(about.vdi_bytes)}",
                "precision": about.precision,
                "lists": f"{width} x {height}",
                "eye": vector(about.camera.position),
                "bounds": vector(about.bounds),
                **LENGTHS,
            }
        )
    )


def convert(options: argparse.Namespace) -> int:
    """Write a series anew, as a page, or each of its steps to a file of its own."""
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
        refuse(options, OF_WRITTEN_IMAGES, f"writing .exr, and not {target.suffix}")
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
        f"VDIs, or other series, .vdis; or volumes, each {declare.VOLUME_FILE}. Of a store, a "
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
