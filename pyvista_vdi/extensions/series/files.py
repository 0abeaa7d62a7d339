"""Files of series: ``.vdis``, and pages that play one."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pyvista_vdi.extensions.series.reader import SeriesInfo, StepsReader
from pyvista_vdi.extensions.series.series import VDISeries, refuse_look
from pyvista_vdi.extensions.series.steps_writer import write
from pyvista_vdi.io.files import format_named
from pyvista_vdi.io.progress import Pieces, Progress
from pyvista_vdi.model.inputs import as_vdi
from pyvista_vdi.model.vdi import VDI


def save(series: VDISeries, path: str | os.PathLike[str], **options: Any) -> Path:
    """Write a file of a series, or a page that plays it: see :meth:`VDISeries.save`."""
    refuse_look(series, options)
    found = format_named(path)
    if found is not None and found.page:
        as_vdi(series[0])  # refuses what has no colours
        return found.load().write_series(series, path, **options)  # type: ignore[no-any-return]
    return write(series, series.times, path, **options)


def write_steps(
    vdis: Sequence[VDI], times: Sequence[float], path: str | os.PathLike[str], **options: Any
) -> Path:
    """Write the VDIs of several times as a series."""
    return save(VDISeries(vdis, times), path, **options)


def read(path: str | os.PathLike[str], *, progress: Progress | None = None) -> VDISeries:
    """Read a series from a .vdis file; steps are decoded when they are asked for."""
    steps = StepsReader(path)
    Pieces(progress, 1)()
    return VDISeries(steps, steps.times)


def read_info(path: str | os.PathLike[str]) -> SeriesInfo:
    """Read what a .vdis file says about itself, without its steps: errors as for :func:`read`."""
    return StepsReader(path).info()
