"""The verb ``serve``: web pages in which a volume is turned that stays on this machine."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from typing import Any

from pyvista_vdi.cli.inputs import ambient_occlusion, classification, read_volume
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.volume import Volume


class _Steps(Sequence[Volume]):
    """The volumes that the options name, read when they are asked for."""

    def __init__(self, options: argparse.Namespace) -> None:
        self._options = options
        self._files = options.files or [None]

    def __len__(self) -> int:
        return len(self._files)

    def __getitem__(self, step: Any) -> Any:
        options = argparse.Namespace(**{**vars(self._options), "file": self._files[step]})
        return read_volume(options)


def serve(options: argparse.Namespace) -> int:
    """Serve until Ctrl-C."""
    from pyvista_vdi.web.server import serve as serve_volumes  # needs aiohttp

    arguments = classification(options)
    Classification(arguments, "serve")  # refused before the volume is read
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
        regenerate_below=options.regenerate_below,
        device=options.device,
        announce=lambda line: print(line, flush=True),
        **arguments,
    )
    print("The server has ended")
    return 0
