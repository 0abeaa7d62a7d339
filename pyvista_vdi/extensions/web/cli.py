"""The verb ``serve``: web pages in which a volume is turned that stays on this machine."""

from __future__ import annotations

import argparse
import math
from typing import Any

from pyvista_vdi.cli.inputs import classification, given, read_volume
from pyvista_vdi.cli.steps import Step, in_order, steps_of_volumes
from pyvista_vdi.errors import naming
from pyvista_vdi.extensions.series.archive import Called
from pyvista_vdi.model.options import GenerationOptions


def serve(options: argparse.Namespace) -> int:
    """Serve until Ctrl-C."""
    from pyvista_vdi.extensions.web.server import serve as serve_volumes  # needs aiohttp

    steps = [Step(options.example, None, lambda: read_volume(options))]
    if options.files:
        steps = steps_of_volumes(in_order(options.files), options)

    def volume_of(step: Step) -> Any:
        with naming(step.name):
            return step.read()

    serve_volumes(
        Called(volume_of, steps),  # read when somebody wants to see it
        host=options.host,
        port=options.port,
        token=options.token,
        hosts=options.allow_host or (),
        lists=math.prod(options.lists),
        **given(options, GenerationOptions, flat=True),
        device=options.device,
        **classification(options),
    )
    print("The server has ended")
    return 0


OPTIONS = """
VOLUMES device
[server]
host=127.0.0.1  ADDRESS   to listen at, by default this machine's alone
port=8765       PORT      0: one that is free
token           TEXT      what the URL must carry (default: a random one)
allow_host      NAME +    another name by which browsers may call this server
lists=1280x720  WxH       most lists of a VDI
table: ambient_occlusion
[limits]
max_supersegments=8 sample_distance memory_limit
"""
