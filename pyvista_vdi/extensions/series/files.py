"""Files of series: ``.vdis``, and pages that play one."""

from __future__ import annotations

import os

from pyvista_vdi.errors import InvalidArgumentError, VDIFileError
from pyvista_vdi.extensions.series.archive import SERIES, Archive
from pyvista_vdi.extensions.series.series import VDISeries, checked_times
from pyvista_vdi.io.progress import Pieces, Progress
from pyvista_vdi.io.vdi_file.reader import FileInfo


def read(path: str | os.PathLike[str], *, progress: Progress | None = None) -> VDISeries:
    """Read a series; its steps are read when they are asked for."""
    steps = Archive(path, SERIES)
    if not len(steps):
        raise VDIFileError(f"{path} has no finished step: none has been written yet")
    Pieces(progress, 1)()
    return VDISeries(steps, times_of(steps))


def times_of(steps: Archive) -> tuple[float, ...]:
    """Return the times of a stored series."""
    try:
        return checked_times(steps.about["times"])
    except InvalidArgumentError as error:
        steps.refuse(f"its times cannot be ({error})")


def read_info(path: str | os.PathLike[str]) -> FileInfo:
    """Read what a series says about itself, without its arrays: errors as for :func:`read`."""
    return Archive(path, SERIES).info()
