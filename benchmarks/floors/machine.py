"""What an OpenCL device can do at best: bandwidth, gathers, arithmetic, launches."""

from __future__ import annotations

import math
import os
import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pyvista_vdi.device import Runtime

KERNELS = Path(__file__).with_name("machine.cl")

#: OpenCL types of elements, and their components, by their bytes.
ELEMENTS = {1: ("uchar", 1), 4: ("uint", 1), 8: ("uint2", 2), 16: ("uint4", 4)}

#: How lanes gather: see ``machine.cl``. ``near, chained`` waits for each element.
PATTERNS = {"near": (1, 0), "near, chained": (1, 1)}

#: Work-items of a group, and elements between the rows of a block of lanes.
GROUP, ROW = 64, 64

DEFINES = {"LANES": 16}

#: Time that one launch is made to take, seconds.
_LAUNCH_SECONDS = 0.02


@dataclass(frozen=True)
class Stopwatch:
    """Times work on a device: the fastest of some repeats counts."""

    runtime: Runtime
    repeats: int = 3

    def fastest(self, work: Callable[[], object], repeats: int | None = None) -> float:
        """Return the least time of some work, seconds, after one run that is not counted."""
        self.once(work)
        return max(min(self.once(work) for _ in range(repeats or self.repeats)), 1e-9)

    def once(self, work: Callable[[], object]) -> float:
        """Return the time of some work, seconds."""
        self.runtime.finish()
        begin = time.perf_counter()
        work()
        self.runtime.finish()
        return time.perf_counter() - begin

    def per_turn(self, launch: Callable[[int], object]) -> float:
        """Return seconds per turn of a kernel's loop, so many turns that launching counts little.

        ``launch`` takes the number of turns.
        """
        turns = 16
        while (seconds := self.fastest(partial(launch, turns), 1)) < _LAUNCH_SECONDS / 4:
            turns *= 4
        turns = max(1, round(turns * _LAUNCH_SECONDS / seconds))
        return self.fastest(partial(launch, turns)) / turns

    @property
    def items(self) -> int:
        """Work-items that keep every lane of the device busy, and no more on a CPU."""
        units = self.runtime.info.compute_units or os.cpu_count() or 1
        return GROUP * units * (16 if self.runtime.is_cpu else 128)


def measured(watch: Stopwatch, *, whole: bool) -> dict[str, Any]:
    """Return every figure of a device, SI units; fewer and smaller working sets if not whole."""
    sets = (14, 17, 20, 23, 26, 28) if whole else (14, 20, 26)
    gathered: dict[str, Any] = {name: {} for name in PATTERNS}
    for size in ELEMENTS:
        for name, points in gathers(watch, size, sets).items():
            gathered[name][str(size)] = points
    return {
        "streams": streams(watch, 29 if whole else 26),
        "arithmetic": arithmetic(watch),
        "launches": {"waited": launch(watch)},
        "gathers": gathered,
    }


def streams(watch: Stopwatch, bits: int) -> dict[str, float]:
    """Return bytes per second that are read and written, of an array that no cache holds."""
    runtime, per_item = watch.runtime, 256
    items = 2**bits // 16 // per_item
    with (
        runtime.buffer(2**bits, name="stream") as array,
        runtime.buffer((items,), np.uint32, "kept") as kept,
    ):
        found = {}
        for way, last in (("write", np.uint32(0)), ("read", kept)):
            kernel = runtime.kernel(KERNELS, f"stream_{way}", DEFINES)
            work = partial(runtime.launch, kernel, items, GROUP, array, np.uint32(per_item), last)
            found[way] = 2**bits / watch.fastest(work)
        return found


def gathers(watch: Stopwatch, size: int, sets: tuple[int, ...]) -> dict[str, list[list[float]]]:
    """Return, by pattern, bytes of each working set and elements gathered from it per second."""
    runtime = watch.runtime
    kind, components = ELEMENTS[size]
    kernel = runtime.kernel(
        KERNELS, "gather", {"ELEMENT": kind, "COMPONENTS": components, **DEFINES}
    )
    found: dict[str, list[list[float]]] = {name: [] for name in PATTERNS}
    with (
        runtime.buffer(2 ** max(sets), name="gathered") as array,
        runtime.buffer((watch.items,), np.uint32, "kept") as kept,
    ):
        runtime.fill(array, np.float32(0))
        for bits in sets:
            elements = np.uint32(bits - size.bit_length() + 1)
            for name, flags in PATTERNS.items():

                def launch(turns: int, elements: Any = elements, flags: Any = flags) -> None:
                    numbers = elements, np.uint32(turns), *map(np.int32, flags), np.uint32(ROW)
                    runtime.launch(kernel, watch.items, GROUP, array, *numbers, kept)

                found[name].append([2**bits, watch.items / watch.per_turn(launch)])
    return found


def arithmetic(watch: Stopwatch) -> dict[str, float]:
    """Return float32 operations per second; a multiplication with an addition counts as one."""
    runtime, chains, found = watch.runtime, 8, {}
    # The iterations' fixed points are neither denormal nor infinite
    for name, a, b in (("multiply_add", 0.5, 0.5), ("divide", 0.9, 0.0), ("exponential", 0.0, 0.0)):
        kernel, factors = runtime.kernel(KERNELS, name, DEFINES), (np.float32(a), np.float32(b))
        with runtime.buffer((watch.items,), name="kept") as kept:

            def launch(turns: int, of: Any = (kernel, factors, kept)) -> None:
                runtime.launch(of[0], watch.items, GROUP, np.uint32(turns), *of[1], of[2])

            found[name] = watch.items * chains / watch.per_turn(launch)
    return found


def launch(watch: Stopwatch) -> float:
    """Return what a launch of next to nothing takes that is waited for, seconds."""
    runtime = watch.runtime
    kernel = runtime.kernel(KERNELS, "nothing", DEFINES)
    with runtime.buffer((1,), np.uint32, "kept") as kept:
        work = partial(runtime.launch, kernel, GROUP, GROUP, kept)
        return statistics.median(watch.fastest(work, 1) for _ in range(50))


class Rates:
    """A device's measured rates, as models ask for them: of what :func:`measured` returned."""

    def __init__(self, results: Mapping[str, Any]) -> None:
        self._gathers = results["gathers"]
        self.read = float(results["streams"]["read"])
        self.write = float(results["streams"]["write"])
        self.launch = float(results["launches"]["waited"])
        #: Of a multiply-add, a division and an exponential
        self.seconds_of_operations = 1 / np.array([*results["arithmetic"].values()])

    def gather(self, size: float, working_set: float, pattern: str = "near") -> float:
        """Return elements of ``size`` bytes per second that are gathered from a working set.

        Between two measured working sets it is interpolated by logarithms; an element counts as
        the next larger one that was measured.
        """
        measured_sizes = sorted(int(n) for n in self._gathers[pattern])
        fitting = [n for n in measured_sizes if n >= size] or measured_sizes[-1:]
        at, rates = np.log(self._gathers[pattern][str(fitting[0])]).T
        return math.exp(float(np.interp(math.log(max(working_set, 1.0)), at, rates)))
