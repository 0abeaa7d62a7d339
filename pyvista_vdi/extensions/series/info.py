"""What a file of a series says about itself."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pyvista_vdi.model.camera import Camera


@dataclass(frozen=True)
class SeriesInfo:
    """What a .vdis file says about itself."""

    path: Path
    format_version: int
    written_by: str  # program and version
    camera: Camera  # the first step's generating view V_O
    window_size: tuple[int, int]  # the first step's lists along each edge of the viewport
    bounds: tuple[float, ...]  # the first step's, in the model frame
    metadata: dict[str, Any]  # what made the first step
    times: tuple[float, ...]  # of the steps
    step_bytes: tuple[int, ...]  # what each step takes
    keys: tuple[int, ...]  # steps that need no other
    precision: str
    codec: str
    tolerance: float
    closed: bool  # whether the writer came to its end: otherwise it is still at work, or was killed
    file_bytes: int
