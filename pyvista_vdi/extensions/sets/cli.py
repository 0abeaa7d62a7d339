"""The verb ``set`` and its options, and what ``info`` and ``convert`` do with files of sets."""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

from pyvista_vdi.cli import declare
from pyvista_vdi.cli.files import of_values
from pyvista_vdi.cli.generate import generating_view
from pyvista_vdi.cli.inputs import (
    ambient_occlusion,
    classification,
    measuring,
    of_the_file,
    part,
    read_volume,
    refuse,
    say_written,
    with_look,
)
from pyvista_vdi.cli.text import LENGTHS, mebibytes, printable, table, vector
from pyvista_vdi.extensions.series.cli import OF_READ_IMAGES, write_each
from pyvista_vdi.extensions.sets import cinema, files
from pyvista_vdi.extensions.sets.generate import generate_set
from pyvista_vdi.io.files import format_named
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.whole_file import check_writable, with_suffix

#: Options that are arguments of ``generate_set`` of the same name, given only if the user did.
_GOAL = ("target_ssim", "max_bytes", "max_views", "lists", "max_supersegments")


def generate(options: argparse.Namespace) -> int:
    """Generate a set of VDIs and write it."""
    target = check_writable(with_suffix(Path(options.output), (files.SUFFIX,), "a set"))
    looks = classification(options)
    Classification.composited(looks, "set")  # refused before the volume is read
    occlusion = ambient_occlusion(options)
    volume = read_volume(options)
    start = time.perf_counter()
    with measuring("generating a set") as bar:
        vdi_set = generate_set(
            volume,
            "sphere",
            options.size,
            camera=generating_view(options, volume),
            sample_distance=options.sample_distance,
            ambient_occlusion=occlusion,
            memory_limit=options.memory_limit,
            device=options.device,
            progress=part(bar, 0.0, 0.9, "generating"),
            **{n: getattr(options, n) for n in _GOAL if getattr(options, n) is not None},
            **looks,
        )
        vdi_set.save(target, progress=part(bar, 0.9, 1.0, "writing"))
    seconds = time.perf_counter() - start
    print(
        f"{printable(options.output)}: {len(vdi_set)} VDIs, {mebibytes(target.stat().st_size)}, "
        f"{seconds:.1f} s; {_reached(vdi_set.about)}"
    )
    return 0


def info(options: argparse.Namespace) -> int:
    """Print what a file of a set says about itself."""
    about, vdi_set = files.read_info(options.file), files.read(options.file)
    made = vdi_set.about
    if options.json:
        state = {**vars(about), "path": str(about.path), "camera": vdi_set.camera.to_dict()}
        del state["times"], state["keys"]
        state["window_size"] = vdi_set.window_size
        state["views"] = [camera.to_dict() for camera in vdi_set.cameras]
        print(json.dumps({**state, "about": made}, indent=1))
        return 0
    width, height = vdi_set.window_size
    chosen = made.get("chosen", {})
    print(
        table(
            {
                "file": f"{about.path}, {mebibytes(about.file_bytes)}, {about.codec}",
                "written by": f"{about.written_by}, format version {about.format_version}",
                "views": f"{len(vdi_set)}",
                **({} if about.value_range is None else of_values(about.value_range)),
                "bytes a view": f"{min(about.step_bytes)} to {max(about.step_bytes)}",
                "precision": about.precision,
                "pictures": f"{width} x {height}",
                "chosen": json.dumps(chosen),
                "reached": _reached(made),
                "eye": vector(vdi_set.camera.position),
                "bounds": vector(vdi_set.bounds),
                **LENGTHS,
            }
        )
    )
    return 0


def convert(options: argparse.Namespace) -> int:
    """Write a set anew, as a page or a Cinema database, or each VDI to a file of its own."""
    refuse(options, OF_READ_IMAGES, "deep images, .exr, and this is a set")
    target = Path(options.output)
    suffix, arguments = target.suffix.lower(), of_the_file(options)
    colors = suffix not in (files.SUFFIX, ".vdi")
    vdi_set = with_look(options, files.read(options.file), options.file, colors=colors)
    found = format_named(target)
    page = found is not None and found.page
    if suffix not in (files.SUFFIX, cinema.SUFFIX) and not page:
        return write_each(vdi_set, target, arguments)
    if suffix == cinema.SUFFIX:
        refuse(options, ("compression", "compression_level", "precision"), "VDIs, not .cdb")
    with measuring("converting") as bar:
        if suffix == cinema.SUFFIX:
            cinema.write(vdi_set, target, progress=part(bar, 0.0, 1.0, "writing"))
        else:
            vdi_set.save(target, progress=part(bar, 0.0, 1.0, "writing"), **arguments)
    say_written([target])
    return 0


def _reached(about: dict[str, Any]) -> str:
    """Return in words what a set was measured to give."""
    try:
        reached = about["reached"]
        return (
            f"SSIM {reached['least']:.4f} or more in {reached['directions']} directions, "
            f"{reached['mean']:.4f} in the mean"
            + (f"; {reached['below_target']} miss the target" if reached["below_target"] else "")
        )
    except (KeyError, TypeError, ValueError):  # VDIs that somebody has put together
        return "not measured"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the verb ``set``."""
    declare.volume(parser)
    declare.output(parser, ".vdiset to write")
    declare.size(parser, (640, 360))
    group = parser.add_argument_group("goal")
    ssim = "SSIM of every direction against volume rendering (default: 0.98)"
    declare.option(group, "--target-ssim", ssim, "S", declare.parse_number)
    most = "most bytes of the file, like 70MB; goes before the SSIM"
    declare.option(group, "--max-bytes", most, "SIZE", declare.parse_bytes)
    most = "most VDIs (default: 400)"
    declare.option(group, "--max-views", most, "N", declare.parse_count)
    group = parser.add_argument_group("lists", "By default a short measurement chooses them.")
    declare.option(group, "--lists", "lists per pixel along an edge", "N", declare.parse_number)
    declare.longest(group, None)
    declare.step(group)
    declare.memory_limit(group)
    declare.camera(parser, "the view that the volume fills; it tells distance, lens and up")
    declare.classification(parser)
    declare.occlusion(parser)
    declare.device(parser)
