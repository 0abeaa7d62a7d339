"""The subcommand ``set`` and its options."""

from __future__ import annotations

import argparse
from contextlib import closing
from pathlib import Path

from pyvista_vdi.cli.generate import generating_view, say_vdi
from pyvista_vdi.cli.inputs import classification, given, read_volume
from pyvista_vdi.extensions.sets.generate import generate_set
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.model.whole_file import check_writable, with_suffix
from pyvista_vdi.plotting.progress import DelayedBar


def generate(options: argparse.Namespace) -> int:
    """Generate a set of VDIs and write it."""
    target = check_writable(with_suffix(Path(options.output), (".vdiset",), "a set"))
    look, how = classification(options), given(options, GenerationOptions)
    volume = read_volume(options)
    asked = {n: getattr(options, n) for n in ("views", "half_angle", "lists", "device")}
    how |= {name: value for name, value in asked.items() if value is not None}
    how |= {"window_size": options.size, "camera": generating_view(options, volume), **look}
    with closing(DelayedBar(label="generating a set")) as bar:
        vdi_set = generate_set(volume, progress=bar, **how)
        vdi_set.save(target, progress=bar)
    say_vdi(options, f"{len(vdi_set)} VDIs")
    return 0


OPTIONS = """
VOLUME
output  FILE  .vdiset to write
size=640x360 device
[views]
views       COUNT    how many (default: 32)
half_angle  DEGREES  from the camera's direction within which they are (default: 180)
[lists]
lists       X        lists per pixel along an edge (default: 1)
max_supersegments sample_distance memory_limit
camera: the view that the volume fills; it tells distance, lens, up and a cone's axis
table: ambient_occlusion
"""
