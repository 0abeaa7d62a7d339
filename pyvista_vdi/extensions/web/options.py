"""The options of the verb ``serve``."""

from __future__ import annotations

import argparse

from pyvista_vdi.cli import declare


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the verb ``serve``."""
    declare.volumes(parser)
    group = parser.add_argument_group("server")
    host = "address to listen at (default: 127.0.0.1, this machine alone)"
    declare.option(group, "--host", host, "ADDRESS", default="127.0.0.1")
    port = "(default: 8765; 0: one that is free)"
    declare.option(group, "--port", port, "N", declare.parse_port, default=8765)
    token = "what the URL must carry (default: a random one)"
    declare.option(group, "--token", token, "TEXT")
    names = "another name by which browsers may call this server; may be repeated"
    declare.option(group, "--allow-host", names, "NAME", action="append", default=[])
    text = "most lists of a VDI (default: 1280x720)"
    declare.option(group, "--lists", text, "WxH", declare.parse_size, default=(1280, 720))
    below = "estimated SSIM below which a view gets a VDI of its own (default: 0.95)"
    declare.option(group, "--regenerate-below", below, "SSIM", declare.parse_number, default=0.95)
    declare.classification(parser)
    declare.occlusion(parser)
    group = parser.add_argument_group("limits")
    declare.longest(group, 8)
    declare.step(group)
    declare.memory_limit(group)
    declare.device(parser)
