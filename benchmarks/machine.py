"""What an OpenCL device can do at best: bandwidth, gathers, arithmetic, launches, transfers.

Writes ``machine_cpu.json`` or ``machine_gpu.json``, which ``model.py`` turns into floors. See
README.md in this folder.
"""

from __future__ import annotations

import bisect
import json
import math
import os
import statistics
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from common import (  # beside this file
    add_clock,
    clock_of,
    new_parser,
    save,
)
from tqdm import tqdm

from pyvista_vdi.device import Runtime, aligned_empty, get_runtime
from pyvista_vdi.measure.report import describe_system, table

KERNELS = Path(__file__).with_name("machine.cl")

#: OpenCL types of elements, and their components, by their bytes.
ELEMENTS = {1: ("uchar", 1), 4: ("uint", 1), 8: ("uint2", 2), 16: ("uint4", 4)}

#: Logarithms to base 2 of working sets in bytes: 16 KiB to 256 MiB.
WORKING_SETS = (14, 17, 20, 23, 26, 28)
#: The same with ``--quick``.
QUICK_WORKING_SETS = (14, 20, 26)

#: How lanes gather: see ``machine.cl``. ``near, chained`` waits for each element.
PATTERNS = {"near": (1, 0), "random": (0, 0), "near, chained": (1, 1)}

#: Work-items of a group, and neighbours that gather near each other: those of the engine's kernels.
GROUP, LANES = 64, 16

#: Elements between the rows of a block of lanes.
ROW = 64

DEFINES = {"LANES": LANES}

#: Time that one launch is made to take, seconds.
_LAUNCH_SECONDS = 0.02


def main() -> int:
    """Measure, and write what was found."""
    parser = new_parser(__doc__, repeats=5, repeated="timed launches; the fastest counts")
    parser.add_argument("--quick", action="store_true", help="fewer working sets and repeats")
    add_clock(parser)
    options = parser.parse_args()
    runtime = get_runtime(options.device)
    repeats = 2 if options.quick else options.repeats
    results = {
        "system": describe_system(options.device),
        "kind": runtime.info.kind,
        "caches": caches() if runtime.is_cpu else {},
        "clock": options.clock,
        **measured(Stopwatch(runtime, repeats, clock_of(options, runtime)), quick=options.quick),
    }
    target = results_file(options.out, runtime)
    target.parent.mkdir(parents=True, exist_ok=True)
    save(results, target)
    print("\n".join(report(results)))
    print(f"\nWritten: {target}")
    return 0


def results_file(folder: Path, runtime: Runtime) -> Path:
    """Return where a device's figures are."""
    return folder / f"machine_{runtime.info.kind.lower()}.json"


def caches() -> dict[str, str]:
    """Return the sizes of the first core's data caches, where the system tells them."""
    found = {}
    for folder in sorted(Path("/sys/devices/system/cpu/cpu0/cache").glob("index*")):
        level, kind, size = (
            (folder / name).read_text().strip() for name in ("level", "type", "size")
        )
        if kind != "Instruction":
            found[f"L{level}"] = size
    return found


def measured(watch: Stopwatch, *, quick: bool = False) -> dict[str, Any]:
    """Return every figure of a device, SI units."""
    sets = QUICK_WORKING_SETS if quick else WORKING_SETS
    work: list[tuple[str, Callable[[], Any]]] = [
        ("streams", partial(streams, watch, 26 if quick else 29)),
        ("arithmetic", partial(arithmetic, watch)),
        ("launches", partial(launches, watch)),
        ("transfers", partial(transfers, watch, 24 if quick else 26)),
    ]
    found: dict[str, Any] = {}
    gathered: dict[str, Any] = {name: {} for name in PATTERNS}
    bar = tqdm(total=len(work) + len(ELEMENTS) * len(sets), disable=not sys.stderr.isatty())
    for name, measure in work:
        found[name] = measure()
        bar.update()
    for size in ELEMENTS:
        for rates in gathers(watch, size, sets):
            for name, (working_set, rate) in rates.items():
                gathered[name].setdefault(str(size), []).append([working_set, rate])
            bar.update()
    bar.close()
    return {**found, "gathers": gathered}


@dataclass(frozen=True)
class Stopwatch:
    """Times work on a device.

    Parameters
    ----------
    runtime : Runtime
        The device.
    repeats : int
        How often; the fastest counts.
    clock : callable
        Seconds.
    """

    runtime: Runtime
    repeats: int
    clock: Callable[[], float]

    def fastest(self, work: Callable[[], object], repeats: int | None = None) -> float:
        """Return the least time of some work, seconds, after one run that is not counted."""
        taken = []
        for _ in range((repeats or self.repeats) + 1):
            self.runtime.finish()
            begin = self.clock()
            work()
            self.runtime.finish()
            taken.append(self.clock() - begin)
        return max(min(taken[1:]), 1e-9)

    def per_turn(self, launch: Callable[[int], object]) -> float:
        """Return seconds per turn of a kernel's loop, so many turns that launching counts little.

        ``launch`` takes the number of turns.
        """
        turns = 16
        while (seconds := self.fastest(partial(launch, turns), 1)) < _LAUNCH_SECONDS / 4:
            turns *= 4
        turns = max(1, round(turns * _LAUNCH_SECONDS / seconds))
        return self.fastest(partial(launch, turns)) / turns


def streams(watch: Stopwatch, bits: int) -> dict[str, float]:
    """Return bytes per second that are read and written, of an array that no cache holds."""
    runtime, per_item = watch.runtime, 256
    items = 2**bits // 16 // per_item
    with (
        runtime.buffer(2**bits, name="stream") as array,
        runtime.buffer((items,), np.uint32, "kept") as kept,
    ):
        read, write = (
            runtime.kernel(KERNELS, name, DEFINES) for name in ("stream_read", "stream_write")
        )
        writing = partial(
            runtime.launch, write, items, GROUP, array, np.uint32(per_item), np.uint32(0)
        )
        reading = partial(runtime.launch, read, items, GROUP, array, np.uint32(per_item), kept)
        return {
            "bytes": 2**bits,
            "write": 2**bits / watch.fastest(writing),
            "read": 2**bits / watch.fastest(reading),
        }


def gathers(
    watch: Stopwatch, size: int, sets: tuple[int, ...]
) -> Iterator[dict[str, tuple[int, float]]]:
    """Yield, for each working set, its bytes and elements gathered per second, by pattern."""
    runtime = watch.runtime
    kind, components = ELEMENTS[size]
    defines = {"ELEMENT": kind, "COMPONENTS": components, **DEFINES}
    kernel = runtime.kernel(KERNELS, "gather", defines)
    items = _items(runtime)
    with (
        runtime.buffer(2 ** max(sets), name="gathered") as array,
        runtime.buffer((items,), np.uint32, "kept") as kept,
    ):
        runtime.fill(array, np.float32(0))
        for bits in sets:
            elements = bits - size.bit_length() + 1
            rates = {}
            for name, flags in PATTERNS.items():

                def launch(turns: int, elements: int = elements, flags: Any = flags) -> None:
                    numbers = np.uint32(elements), np.uint32(turns), *map(np.int32, flags)
                    runtime.launch(kernel, items, GROUP, array, *numbers, np.uint32(ROW), kept)

                seconds = watch.per_turn(launch)
                rates[name] = (2**bits, items / seconds)
            yield rates


def arithmetic(watch: Stopwatch) -> dict[str, float]:
    """Return float32 operations per second; a multiplication with an addition counts as one."""
    runtime = watch.runtime
    items, chains = _items(runtime), 8
    found = {}
    # The iterations' fixed points are neither denormal nor infinite
    for name, a, b in (("multiply_add", 0.5, 0.5), ("divide", 0.9, 0.0), ("exponential", 0.0, 0.0)):
        kernel, factors = runtime.kernel(KERNELS, name, DEFINES), (np.float32(a), np.float32(b))
        with runtime.buffer((items,), name="kept") as kept:

            def launch(
                turns: int, kernel: Any = kernel, factors: Any = factors, kept: Any = kept
            ) -> None:
                runtime.launch(kernel, items, GROUP, np.uint32(turns), *factors, kept)

            found[name] = items * chains / watch.per_turn(launch)
    return found


def launches(watch: Stopwatch) -> dict[str, float]:
    """Return what a launch of next to nothing takes, seconds: waited for, and in a row."""
    runtime, in_a_row = watch.runtime, 200
    kernel = runtime.kernel(KERNELS, "nothing", DEFINES)
    with runtime.buffer((1,), np.uint32, "kept") as kept:
        launch = partial(runtime.launch, kernel, GROUP, GROUP, kept)
        launch()
        waited = statistics.median(watch.fastest(launch, 1) for _ in range(50))

        def many() -> None:
            for _ in range(in_a_row):
                launch()

        return {"waited": waited, "in a row": watch.fastest(many) / in_a_row}


def transfers(watch: Stopwatch, bits: int) -> dict[str, float]:
    """Return bytes per second to and from the device, and how long using aligned memory takes."""
    runtime = watch.runtime
    aligned = aligned_empty((2**bits + 64,), np.uint8)
    aligned[:] = 1
    beside = aligned[1 : 2**bits + 1]  # a CPU device cannot use it in place
    whole = aligned[: 2**bits]
    out = np.ones(2**bits, np.uint8)

    def upload(array: Any) -> None:
        with runtime.upload(array):
            runtime.finish()

    with runtime.buffer((2**bits,), np.uint8, "transferred") as buffer:
        runtime.write(buffer, whole)
        return {
            "upload": 2**bits / watch.fastest(partial(upload, beside)),
            "aligned upload": 2**bits / watch.fastest(partial(upload, whole)),
            "write": 2**bits / watch.fastest(partial(runtime.write, buffer, whole)),
            "download": 2**bits / watch.fastest(partial(runtime.download, buffer, out)),
        }


class Rates:
    """A device's measured rates, as models ask for them.

    Parameters
    ----------
    results : mapping
        What :func:`main` has written.
    """

    def __init__(self, results: Mapping[str, Any]) -> None:
        self._results = results
        self.caches: dict[str, str] = results["caches"]
        self.read = float(results["streams"]["read"])
        self.write = float(results["streams"]["write"])
        self.launch = float(results["launches"]["waited"])
        self.download = float(results["transfers"]["download"])
        self.operations: dict[str, float] = results["arithmetic"]

    @classmethod
    def read_for(cls, runtime: Runtime, folder: Path) -> Rates:
        """Read what a run has written of a device; end with what to run where there is nothing."""
        file = results_file(folder, runtime)
        results = json.loads(file.read_text()) if file.exists() else None
        if results is None or results["system"]["device"] != runtime.info.full_name:
            sys.exit(
                f"{file} holds nothing of {runtime.info.full_name}: run machine.py with the same "
                "--device and --out first"
            )
        return cls(results)

    def gather(self, size: float, working_set: float, pattern: str = "near") -> float:
        """Return elements of ``size`` bytes per second that are gathered from a working set.

        Between two measured working sets it is interpolated by logarithms; an element counts as
        the next larger one that was measured.
        """
        measured_sizes = sorted(int(n) for n in self._results["gathers"][pattern])
        fitting = [n for n in measured_sizes if n >= size] or measured_sizes[-1:]
        points = self._results["gathers"][pattern][str(fitting[0])]
        at = [math.log(bytes_) for bytes_, _ in points]
        rates = [math.log(rate) for _, rate in points]
        return math.exp(float(np.interp(math.log(max(working_set, 1.0)), at, rates)))


def cache_of(working_set: float, known: Mapping[str, str]) -> str:
    """Return which of the caches holds so many bytes: ``L1`` ... or ``memory``.

    A GPU does not tell the sizes of its caches.
    """
    if not known:
        return "caches of unknown size"
    sizes = sorted((_bytes_of(text), name) for name, text in known.items())
    place = bisect.bisect_left([n for n, _ in sizes], working_set)
    return sizes[place][1] if place < len(sizes) else "memory"


def report(results: Mapping[str, Any]) -> list[str]:
    """Return the figures as tables."""
    lines = table(
        ("what", "rate"),
        [
            *(
                (f"stream, {k}", f"{results['streams'][k] / 1e9:.1f} GB/s")
                for k in ("read", "write")
            ),
            *((k, f"{rate / 1e9:.2f} G/s") for k, rate in results["arithmetic"].items()),
            *((f"launch, {k}", f"{t * 1e6:.1f} us") for k, t in results["launches"].items()),
            *((k, f"{rate / 1e9:.1f} GB/s") for k, rate in results["transfers"].items()),
        ],
    )
    patterns = results["gathers"]
    sets = [n for n, _ in next(iter(patterns["near"].values()))]
    heads = ["gathers, 10^9 elements/s", *(_size_text(n) for n in sets)]
    rows = [
        [f"{size} bytes, {pattern}", *(f"{rate / 1e9:.2f}" for _, rate in points)]
        for pattern, by_size in patterns.items()
        for size, points in by_size.items()
    ]
    return [*lines, "", *table(heads, rows)]


def _items(runtime: Runtime) -> int:
    """Return work-items that keep every lane of the device busy, and no more on a CPU."""
    units = runtime.info.compute_units or os.cpu_count() or 1
    return GROUP * units * (16 if runtime.is_cpu else 128)


def _bytes_of(text: str) -> int:
    factor = {"K": 2**10, "M": 2**20, "G": 2**30}.get(text[-1].upper(), 1)
    return int(text.rstrip("KMGkmg")) * factor


def _size_text(n: int) -> str:
    return f"{n // 2**20} MiB" if n >= 2**20 else f"{n // 2**10} KiB"


if __name__ == "__main__":
    sys.exit(main())
