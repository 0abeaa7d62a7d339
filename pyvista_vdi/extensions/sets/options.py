"""The options of the verb ``set``."""

from __future__ import annotations

import argparse

from pyvista_vdi.cli import declare


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
