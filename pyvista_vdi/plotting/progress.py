"""A progress bar that appears only where work takes long."""

from __future__ import annotations

import sys
from threading import RLock
from typing import Any

from tqdm import tqdm

#: Work that takes longer than this gets a bar, seconds.
PATIENCE = 1.0


class DelayedBar:
    """Progress on stderr from one second of work on; ``always``: also where it is no terminal."""

    def __init__(self, *, always: bool = False, label: str = "generating a VDI") -> None:
        self._label = label
        self._disable = False if always else None  # None: tqdm asks whether it is a terminal
        self._bar: Any = None
        self._lock = RLock()

    def __call__(self, fraction: float, doing: str | None = None) -> None:
        """Show the fraction done, 0 to 1, and what is being done."""
        with self._lock:
            if self._bar is not None and fraction < self._bar.n:
                self.close()  # the work before was given up
            if self._bar is None:
                self._bar = tqdm(
                    total=1.0,
                    desc=self._label,
                    delay=PATIENCE,
                    disable=self._disable,
                    file=sys.stderr,
                    leave=False,
                    bar_format="{desc}: {percentage:3.0f}%|{bar}| {elapsed}<{remaining}",
                )
            if doing:
                self._bar.set_description_str(f"{self._label}: {doing}", refresh=False)
            self._bar.update(fraction - self._bar.n)
            if fraction >= 1.0:
                self.close()

    def close(self) -> None:
        """Take the bar away."""
        with self._lock:
            if self._bar is not None:
                self._bar.close()
                self._bar = None
