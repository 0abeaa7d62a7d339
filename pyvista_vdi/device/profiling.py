"""Device time per kernel, from the driver's event timestamps (``PYVISTA_VDI_PROFILE=1``)."""

from __future__ import annotations

import os
import threading
from dataclasses import dataclass
from typing import Any

PROFILE_VARIABLE = "PYVISTA_VDI_PROFILE"
PENDING_LIMIT = 512  # events kept before finished ones are turned into sums


def profiling_wanted() -> bool:
    """Whether ``PYVISTA_VDI_PROFILE`` asks for profiling; empty, "0", "false", "no", "off": no."""
    value = os.environ.get(PROFILE_VARIABLE, "").strip().lower()
    return value not in ("", "0", "false", "no", "off")


@dataclass(frozen=True)
class KernelTime:
    """Device time of one kernel.

    Attributes
    ----------
    name : str
        Kernel, or ``[write]``, ``[read]``, ``[fill]`` for transfers; ``[map]`` where what was
        written in place is read.
    calls : int
        How often it ran.
    total_ms, mean_ms : float
        Milliseconds from start to end on the device, waiting in the queue left out.
    share : float
        Part of the total of all rows, 0 to 1.
    """

    name: str
    calls: int
    total_ms: float
    mean_ms: float
    share: float


class Profile:
    """Collects events of any thread and sums their device times."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._pending: list[tuple[str, Any]] = []
        self._sums: dict[str, tuple[int, int]] = {}  # name -> calls, nanoseconds

    def record(self, name: str, event: Any) -> None:
        """Note an enqueued command's event; its times are read once it has finished."""
        with self._lock:
            self._pending.append((name, event))
            if len(self._pending) >= PENDING_LIMIT:
                self._drain()

    def _drain(self) -> None:
        for name, event in self._pending:
            event.wait()
            calls, nanoseconds = self._sums.get(name, (0, 0))
            elapsed = event.profile.end - event.profile.start
            self._sums[name] = (calls + 1, nanoseconds + elapsed)
        self._pending.clear()

    def kernel_seconds(self) -> float:
        """Wait for what is pending; device time of all kernels so far, without transfers."""
        kernels = [row for row in self.figures() if not row.name.startswith("[")]
        return sum(row.total_ms for row in kernels) * 1e-3

    def figures(self) -> list[KernelTime]:
        """Wait for what is pending, and return rows, longest total first."""
        with self._lock:
            self._drain()
            sums = sorted(self._sums.items(), key=lambda item: item[1][1], reverse=True)
        whole = sum(elapsed for _, (_, elapsed) in sums) or 1
        return [
            KernelTime(name, calls, elapsed * 1e-6, elapsed * 1e-6 / calls, elapsed / whole)
            for name, (calls, elapsed) in sums
        ]


def table(title: str, rows: list[KernelTime]) -> str:
    """Return the figures as fixed-width text under a title, without a newline at the end."""
    width = max([len("kernel"), *(len(row.name) for row in rows)])
    lines = [
        f"OpenCL profile: {title}",
        f"{'kernel':<{width}}  {'calls':>7}  {'total ms':>11}  {'mean ms':>10}  {'share':>6}",
    ]
    lines += [
        f"{row.name:<{width}}  {row.calls:>7d}  {row.total_ms:>11.3f}  {row.mean_ms:>10.4f}"
        f"  {row.share:>6.1%}"
        for row in rows
    ]
    return "\n".join(lines)
