"""The verb ``series``, and what ``info`` and ``convert`` do with files of series."""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pyvista_vdi.cli.inputs import (
    OF_ANY_VOLUME,
    PLACE,
    classification,
    measuring,
    of_the_file,
    part,
    read_volume,
    refuse,
    say_written,
)
from pyvista_vdi.cli.text import LENGTHS, mebibytes, printable, table, vector
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.io import check_write_options, checked_target
from pyvista_vdi.io import read as read_vdi
from pyvista_vdi.io.files import HTML_SUFFIX
from pyvista_vdi.io.whole_file import check_writable, with_suffix
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.series import reader
from pyvista_vdi.series.layout import SUFFIX
from pyvista_vdi.series.series import VDISeries
from pyvista_vdi.series.writer import SeriesWriter

#: Options of ``convert`` that are for deep images of other programs, and for those that it writes.
OF_READ_IMAGES = ("camera_json", "thickness", "from_linear")
OF_WRITTEN_IMAGES = ("standard_channels", "linear")


def series(options: argparse.Namespace) -> int:
    """Write a series of the files that are named: VDIs, series of them, or volumes."""
    kinds = [_kind(file) for file in options.files]
    if len(set(kinds)) > 1:
        raise InvalidArgumentError("the files are VDIs or volumes, and not some of each")
    if kinds[0] != "volume":
        of_volumes = (*OF_ANY_VOLUME, *PLACE, "view_angle", "sample_distance", "memory_limit")
        refuse(options, of_volumes, "volumes")
    times = options.times
    if times is not None and (kinds[0] == "series" or len(times) != len(options.files)):
        raise InvalidArgumentError(
            f"--times gives a time to each file: there are {len(options.files)} files and "
            f"{len(times)} times"
            if kinds[0] != "series"
            else "the series have their own times: leave out --times"
        )
    arguments = of_the_file(options)
    arguments |= {"tolerance": options.tolerance, "key_every": options.key_every}
    steps = _vdis(options.files) if kinds[0] != "volume" else None
    looks = classification(options)
    Classification(looks, "series")  # refused before a volume is read
    target = check_writable(with_suffix(Path(options.output), (SUFFIX,), "a series")).resolve()
    # A writer's file grows step by step: it gets its name when it is whole, and all have been read
    with (
        tempfile.TemporaryDirectory(prefix=".pyvista-vdi-", dir=target.parent) as folder,
        measuring("writing a series") as bar,
    ):
        part = Path(folder) / target.name
        if steps is not None:
            with SeriesWriter(part, **arguments) as out:
                for i, (time, vdi) in enumerate(steps):
                    out.append(vdi, time if times is None else times[i])
                    bar((i + 1) / max(i + 2, len(options.files)))
        else:
            _write_volumes(part, options, looks, arguments, bar)
        part.replace(target)
    about = reader.read_info(options.output)
    print(f"{printable(options.output)}: {len(about.times)} steps, {mebibytes(about.file_bytes)}")
    return 0


def _write_volumes(
    target: Path,
    options: argparse.Namespace,
    looks: dict[str, Any],
    arguments: dict[str, Any],
    bar: Any,
) -> None:
    from pyvista_vdi.cli.generate import generating_view

    out: SeriesWriter | None = None
    try:
        for i, file in enumerate(options.files):
            volume = read_volume(
                argparse.Namespace(**{**vars(options), "file": file, "example": None})
            )
            if out is None:
                out = SeriesWriter(
                    target,
                    generating_view(options, volume),
                    options.size,
                    max_supersegments=options.max_supersegments,
                    sample_distance=options.sample_distance,
                    memory_limit=options.memory_limit,
                    device=options.device,
                    **arguments,
                    **looks,
                )
            out.append(volume, None if options.times is None else options.times[i])
            bar((i + 1) / len(options.files))
    finally:
        if out is not None:
            out.close()


def _kind(file: str) -> str:
    from pyvista_vdi.io import is_vdi_file

    if reader.is_series_file(file):
        return "series"
    return "VDI" if is_vdi_file(file) else "volume"


def _vdis(files: Sequence[str]) -> Iterator[tuple[float | None, VDI]]:
    """Yield the times, where the files have any, and the VDIs of all files."""
    for file in files:
        if reader.is_series_file(file):
            steps = reader.read(file)
            yield from zip(steps.times, steps, strict=True)
        else:
            yield None, read_vdi(file)


def info(options: argparse.Namespace) -> int:
    """Print what a file of a series says about itself."""
    about = reader.read_info(options.file)
    if options.json:
        state = {**vars(about), "path": str(about.path), "camera": about.camera.to_dict()}
        print(json.dumps(state, indent=1))
        return 0
    width, height = about.window_size
    state_of = "" if about.closed else ", not closed: still being written, or cut off"
    print(
        table(
            {
                "file": f"{about.path}, {mebibytes(about.file_bytes)}, {about.codec}{state_of}",
                "written by": f"{about.written_by}, format version {about.format_version}",
                "steps": f"{len(about.times)}, times {about.times[0]:g} to {about.times[-1]:g}",
                "keys": f"{len(about.keys)} steps need no other",
                "bytes a step": f"{min(about.step_bytes)} to {max(about.step_bytes)}",
                "precision": about.precision
                + (f", within a tolerance of {about.tolerance:g}" if about.tolerance else ""),
                "lists": f"{width} x {height}",
                "eye": vector(about.camera.position),
                "bounds": vector(about.bounds),
                **LENGTHS,
            }
        )
    )
    return 0


def convert(options: argparse.Namespace) -> int:
    """Write a series anew, as a page, or each of its steps to a file of its own."""
    refuse(options, OF_READ_IMAGES, "deep images, .exr, and this is a series")
    steps: VDISeries = reader.read(options.file)
    target, arguments = Path(options.output), of_the_file(options)
    if target.suffix.lower() in (SUFFIX, HTML_SUFFIX):
        refuse(options, OF_WRITTEN_IMAGES, f"writing .exr, and not {target.suffix}")
        with measuring("converting") as bar:
            steps.save(target, progress=part(bar, 0.0, 1.0, "writing"), **arguments)
        say_written([target])
        return 0
    return write_each(steps, target, arguments)


def write_each(vdis: Sequence[VDI], target: Path, arguments: dict[str, Any]) -> int:
    """Write each of several VDIs to a file of its own, named by a number."""
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
