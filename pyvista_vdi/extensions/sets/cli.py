"""The subcommand ``set`` and its options."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from pyvista_vdi.cli import declare
from pyvista_vdi.cli.generate import generating_view
from pyvista_vdi.cli.inputs import classification, given, measuring, part, read_volume
from pyvista_vdi.cli.text import mebibytes, printable
from pyvista_vdi.extensions.sets.generate import generate_set
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.model.whole_file import check_writable, with_suffix


def generate(options: argparse.Namespace) -> int:
    """Generate a set of VDIs and write it."""
    target = check_writable(with_suffix(Path(options.output), (".vdiset",), "a set"))
    look, how = classification(options), given(options, GenerationOptions)
    Classification.composited(look, "set")  # refused before the volume is read
    volume = read_volume(options)
    asked = {n: getattr(options, n) for n in ("views", "half_angle", "lists", "device")}
    how |= {name: value for name, value in asked.items() if value is not None}
    how |= {"window_size": options.size, "camera": generating_view(options, volume), **look}
    start = time.perf_counter()
    with measuring("generating a set") as bar:
        vdi_set = generate_set(volume, progress=part(bar, 0.0, 0.9, "generating"), **how)
        vdi_set.save(target, progress=part(bar, 0.9, 1.0, "writing"))
    seconds, n_bytes = time.perf_counter() - start, mebibytes(target.stat().st_size)
    print(f"{printable(options.output)}: {len(vdi_set)} VDIs, {n_bytes}, {seconds:.1f} s")
    return 0


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the subcommand."""
    declare.add(parser, "volume output size", output=".vdiset to write", size=(640, 360))
    text = "degrees from the camera's direction within which they are"
    half_angle = declare.Option(text, "DEGREES", declare.NUMBER, usual=180)
    views = declare.Option("how many", "N", declare.COUNT, usual=32)
    group = parser.add_argument_group("views")
    declare.add(group, "views half_angle", views=views, half_angle=half_angle)
    lists = declare.Option("lists per pixel along an edge", "N", declare.NUMBER, usual=1)
    group = parser.add_argument_group("lists")
    declare.add(group, "lists max_supersegments sample_distance memory_limit", lists=lists)
    view = "the view that the volume fills; it tells distance, lens, up and a cone's axis"
    declare.add(parser, "camera: look: occlusion: device", camera=view)
