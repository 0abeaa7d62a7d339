"""The verb ``set`` and its options, and what ``info`` and ``convert`` do with files of sets."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from pyvista_vdi.cli import declare
from pyvista_vdi.cli.generate import generating_view
from pyvista_vdi.cli.inputs import (
    ambient_occlusion,
    classification,
    measuring,
    part,
    read_volume,
    settings,
)
from pyvista_vdi.cli.text import mebibytes, printable
from pyvista_vdi.extensions.series.archive import SET
from pyvista_vdi.extensions.series.cli import convert_several, print_info
from pyvista_vdi.extensions.sets import files
from pyvista_vdi.extensions.sets.generate import generate_set
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.whole_file import check_writable, with_suffix

#: Options that are arguments of ``generate_set`` of the same name, given only if the user did.
_VIEWS = ("views", "half_angle", "lists", "max_supersegments")


def generate(options: argparse.Namespace) -> int:
    """Generate a set of VDIs and write it."""
    target = check_writable(with_suffix(Path(options.output), (SET.suffix,), "a set"))
    looks = classification(options)
    Classification.composited(looks, "set")  # refused before the volume is read
    occlusion = ambient_occlusion(options)
    volume = read_volume(options)
    start = time.perf_counter()
    with measuring("generating a set") as bar:
        vdi_set = generate_set(
            volume,
            window_size=options.size,
            camera=generating_view(options, volume),
            ambient_occlusion=occlusion,
            settings=settings(options),
            device=options.device,
            progress=part(bar, 0.0, 0.9, "generating"),
            **{n: getattr(options, n) for n in _VIEWS if getattr(options, n) is not None},
            **looks,
        )
        vdi_set.save(target, progress=part(bar, 0.9, 1.0, "writing"))
    seconds = time.perf_counter() - start
    print(
        f"{printable(options.output)}: {len(vdi_set)} VDIs, {mebibytes(target.stat().st_size)}, "
        f"{seconds:.1f} s"
    )
    return 0


def info(options: argparse.Namespace) -> int:
    """Print what a file of a set says about itself."""
    about, vdi_set = files.read_info(options.file), files.read(options.file)
    own = {"views": f"{len(vdi_set)}", "pictures": "{} x {}".format(*vdi_set.window_size)}
    views = [camera.to_dict() for camera in vdi_set.cameras]
    return print_info(options, about, own, {"views": views})


def convert(options: argparse.Namespace) -> int:
    """Write a set anew, as a page, or each VDI to a file of its own."""
    return convert_several(options, files.read, SET)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the verb ``set``."""
    declare.volume(parser)
    declare.output(parser, ".vdiset to write")
    declare.size(parser, (640, 360))
    group = parser.add_argument_group("views")
    declare.option(group, "--views", "how many (default: 32)", "N", declare.parse_count)
    text = "degrees from the camera's direction within which they are (default: 180, the sphere)"
    declare.option(group, "--half-angle", text, "DEGREES", declare.parse_number)
    group = parser.add_argument_group("lists")
    text = "lists per pixel along an edge (default: 1)"
    declare.option(group, "--lists", text, "N", declare.parse_number)
    declare.longest(group, None)
    declare.step(group)
    declare.memory_limit(group)
    declare.camera(
        parser, "the view that the volume fills; it tells distance, lens, up and a cone's axis"
    )
    declare.classification(parser)
    declare.occlusion(parser)
    declare.device(parser)
