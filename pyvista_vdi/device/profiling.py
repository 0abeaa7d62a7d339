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
        with self._lock:
            self._drain()
            kernels = [ns for name, (_, ns) in self._sums.items() if not name.startswith("[")]
        return sum(kernels) * 1e-9

    def figures(self) -> list[KernelTime]:
        """Waits for what is pending; rows, longest total first."""
        with self._lock:
            self._drain()
            sums = dict(self._sums)
        whole = sum(nanoseconds for _, nanoseconds in sums.values())
        rows = [
            KernelTime(
                name=name,
                calls=calls,
                total_ms=nanoseconds * 1e-6,
                mean_ms=nanoseconds * 1e-6 / calls,
                share=nanoseconds / whole if whole else 0.0,
            )
            for name, (calls, nanoseconds) in sums.items()
        ]
        return sorted(rows, key=lambda row: row.total_ms, reverse=True)


def table(title: str, rows: list[KernelTime]) -> str:
    """The figures as fixed-width text.

    Parameters
    ----------
    title : str
        First line, the device's name.
    rows : list of KernelTime
        As :meth:`Profile.figures` gives them.

    Returns
    -------
    str
        Several lines without a newline at the end.
    """
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
