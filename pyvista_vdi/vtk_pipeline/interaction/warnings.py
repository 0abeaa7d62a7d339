"""What a painter has to say to the user: exceptions cannot pass through VTK's renderer."""

from __future__ import annotations

import logging
import warnings

from pyvista_vdi.errors import VDIWarning

_log = logging.getLogger(__name__)


class Voice:
    """Says each thing once, as a :class:`~pyvista_vdi.VDIWarning`."""

    def __init__(self) -> None:
        self._said: set[str] = set()

    def warn(self, message: str, error: BaseException | None = None) -> None:
        """Say it, unless it was said before; the error's traceback goes to the log."""
        if error is not None:
            _log.debug("%s", message, exc_info=error)
        if message in self._said:
            return
        self._said.add(message)
        try:
            warnings.warn(message, VDIWarning, stacklevel=3)
        except VDIWarning:  # warnings are errors: the log is what is left
            _log.error(message)

    def forget(self) -> None:
        """Say everything again if it comes up again."""
        self._said.clear()
