"""What a file of a series says about itself."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pyvista_vdi.model.camera import Camera


@dataclass(frozen=True)
class SeriesInfo:
    """What a .vdis file says about itself.

    Parameters
    ----------
    path : pathlib.Path
        The file.
    format_version : int
        Version of the format.
    written_by : str
        Program and version.
    camera : Camera
        The first step's generating view V_O.
    window_size : (int, int)
        The first step's lists along each edge of the viewport.
    bounds : tuple of float
        The first step's, in the model frame.
    metadata : dict
        What made the first step.
    times : tuple of float
        Of the steps.
    step_bytes : tuple of int
        What each step takes.
    keys : tuple of int
        Steps that need no other.
    precision, codec : str
        As written.
    tolerance : float
        As written.
    closed : bool
        Whether the writer came to its end: otherwise it is still at work, or was killed.
    file_bytes : int
        Size of the file.
    """

    path: Path
    format_version: int
    written_by: str
    camera: Camera
    window_size: tuple[int, int]
    bounds: tuple[float, ...]
    metadata: dict[str, Any]
    times: tuple[float, ...]
    step_bytes: tuple[int, ...]
    keys: tuple[int, ...]
    precision: str
    codec: str
    tolerance: float
    closed: bool
    file_bytes: int
