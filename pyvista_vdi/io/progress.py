"""How much of a file is read or written, for whoever waits."""

from __future__ import annotations

from pyvista_vdi.errors import Cancelled
from pyvista_vdi.model.checks import check_callback
from pyvista_vdi.model.types import Progress as Progress


class Pieces:
    """Counts pieces of work and reports their share."""

    def __init__(self, progress: Progress | None, total: int) -> None:
        check_callback(progress)
        self._progress, self._total, self._done = progress, max(1, total), 0

    def __call__(self) -> None:
        """Report that one more is done; raise Cancelled where the callback returns False."""
        self._done += 1
        if self._progress is not None and self._progress(self._done / self._total) is False:
            raise Cancelled("reading or writing the file was cancelled")
