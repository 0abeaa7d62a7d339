"""The verb ``serve``: web pages in which a volume is turned that stays on this machine."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from typing import Any

from pyvista_vdi.cli import declare
from pyvista_vdi.cli.inputs import ambient_occlusion, classification, read_volume
from pyvista_vdi.cli.steps import Step, in_order, steps_of_volumes
from pyvista_vdi.errors import naming
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.volume import Volume


class _Steps(Sequence[Volume]):
    """The volumes that the options name, read when they are asked for."""

    def __init__(self, options: argparse.Namespace) -> None:
        if options.files:
            self._steps = steps_of_volumes(in_order(options.files), options)
        else:
            self._steps = [Step(options.example, None, lambda: read_volume(options))]

    def __len__(self) -> int:
        return len(self._steps)

    def __getitem__(self, step: Any) -> Any:
        with naming(self._steps[step].name):
            return self._steps[step].read()


def serve(options: argparse.Namespace) -> int:
    """Serve until Ctrl-C."""
    from pyvista_vdi.extensions.web.server import serve as serve_volumes  # needs aiohttp

    arguments = classification(options)
    Classification.composited(arguments, "serve")  # refused before the volume is read
    serve_volumes(
        _Steps(options),
        host=options.host,
        port=options.port,
        token=options.token,
        hosts=options.allow_host,
        lists=math.prod(options.lists),
        max_supersegments=options.max_supersegments,
        sample_distance=options.sample_distance,
        ambient_occlusion=ambient_occlusion(options),
        memory_limit=options.memory_limit,
        device=options.device,
        announce=lambda line: print(line, flush=True),
        **arguments,
    )
    print("The server has ended")
    return 0


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
    declare.classification(parser)
    declare.occlusion(parser)
    group = parser.add_argument_group("limits")
    declare.longest(group, 8)
    declare.step(group)
    declare.memory_limit(group)
    declare.device(parser)
