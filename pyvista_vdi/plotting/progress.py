"""A progress bar that appears only where work takes long."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from threading import RLock, Timer
from typing import Any

from tqdm import tqdm

from pyvista_vdi.device.programs import on_compiling

#: Work that takes longer than this gets a bar, seconds.
PATIENCE = 1.0


class DelayedBar:
    """Progress on stderr from one second of work on; ``always``: also where it is no terminal."""

    def __init__(self, *, always: bool = False, label: str = "generating a VDI") -> None:
        self._label = label
        self._doing: str | None = None
        self._disable = False if always else None  # None: tqdm asks whether it is a terminal
        self._bar: Any = None
        self._began = 0.0
        self._lock = RLock()

    def __call__(self, fraction: float, doing: str | None = None) -> None:
        """Show the fraction done, 0 to 1, and what is being done."""
        with self._lock:
            if self._bar is not None and fraction < self._bar.n:
                self.close()  # the work before was given up
            if self._bar is None:
                self._began = time.monotonic()
                self._bar = tqdm(
                    total=1.0,
                    desc=self._label,
                    delay=PATIENCE,
                    disable=self._disable,
                    file=sys.stderr,
                    leave=False,
                    bar_format="{desc}: {percentage:3.0f}%|{bar}| {elapsed}<{remaining}",
                )
                on_compiling.add(self._compiling)
            self._doing = doing or self._doing
            self._describe(self._doing)
            self._bar.update(fraction - self._bar.n)
            if fraction >= 1.0:
                self.close()

    def _describe(self, doing: str | None) -> None:
        text = f"{self._label}: {doing}" if doing else self._label
        self._bar.set_description_str(text, refresh=False)

    def _compiling(self) -> None:
        """Show why nothing goes on: the first use of a kernel may take seconds."""
        with self._lock:
            if self._bar is not None:
                self._describe("compiling kernels")
        later = Timer(PATIENCE, self.pulse)
        later.daemon = True
        later.start()

    def pulse(self) -> None:
        """Show the time that has passed, where work does not say how far it is; from any thread."""
        with self._lock:
            if self._bar is not None and time.monotonic() - self._began >= PATIENCE:
                self._bar.refresh()

    def close(self) -> None:
        """Take the bar away."""
        with self._lock:
            if self._bar is not None:
                on_compiling.discard(self._compiling)
                self._bar.close()
                self._bar = self._doing = None


def progress_callback(
    progress_bar: bool | Callable[[float], object] | None, label: str = "generating a VDI"
) -> Callable[[float], object] | None:
    """Return what to call with the fraction done.

    ``None``: a bar on a terminal if the work takes over a second; ``True``: also elsewhere;
    ``False``: none; a callable: that.
    """
    if callable(progress_bar):
        return progress_bar
    if progress_bar is False:
        return None
    return DelayedBar(always=bool(progress_bar), label=label)
