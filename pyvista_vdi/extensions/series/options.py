"""The options of the verb ``series``."""

from __future__ import annotations

import argparse

from pyvista_vdi.cli import declare
from pyvista_vdi.model.packing import PRECISIONS
from pyvista_vdi.model.standard_cases import WINDOW_SIZE


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
    text = (
        "what colours times opacity, and opacities, of a supersegment may differ by, 0 to 1, where "
        "that saves bytes (default: 0, every bit is kept)"
    )
    declare.option(group, "--tolerance", text, "T", declare.parse_number, default=0.0)
    text = "most steps from one that needs no other to the next (default: 16)"
    declare.option(group, "--key-every", text, "N", declare.parse_count, default=16)
    text = "of the supersegments (default: 8-byte, the only one that is written by differences)"
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
    declare.device(parser)
