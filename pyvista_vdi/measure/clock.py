"""How something is timed: rounds in turn, medians and ratios, and whether chance explains them."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import lru_cache

from pyvista_vdi.device import Profile, Runtime

#: A piece of work; its result is not looked at.
Step = Callable[[], object]

#: Seconds of each repetition by the name of a clock; ``device``, of those in which kernels ran.
Times = dict[str, list[float]]

#: Clocks by the names that the times get.
WALL: Mapping[str, Callable[[], float]] = {"clock": time.perf_counter}

#: Chance of a separation by noise up to which times count as different.
CHANCE = 0.01

#: Samples of either up to which the chance is exact; SciPy's takes long beyond.
EXACT = 40


def take_turns(
    work: Mapping[str, Step],
    repeats: int,
    *,
    runtime: Runtime | None = None,
    warm_up: bool = True,
    clocks: Mapping[str, Callable[[], float]] = WALL,
    done: Callable[[], object] = lambda: None,
) -> dict[str, Times]:
    """Time pieces of work, one after the other in turn, and return the times by name.

    ``runtime``: whose kernels are timed by the driver's events, too. ``warm_up``: do each once
    before, so that nothing is compiled or uploaded while it is timed. ``done`` is called after each
    piece.
    """
    if warm_up:
        for step in work.values():
            step()
            done()
    taken: dict[str, Times] = {n: {clock: [] for clock in clocks} for n in work}
    profile = Profile()
    with ExitStack() as stack:
        if runtime is not None:
            stack.enter_context(runtime.queue_scope(profile))
            for times in taken.values():
                times["device"] = []
        for _ in range(repeats):
            for name, step in work.items():
                before = profile.kernel_seconds()
                begin = {clock: tell() for clock, tell in clocks.items()}
                step()
                for clock, tell in clocks.items():
                    taken[name][clock].append(tell() - begin[clock])
                if (kernels := profile.kernel_seconds() - before) > 0:
                    taken[name]["device"].append(kernels)
                done()
    return taken


def median(taken: Mapping[str, Sequence[float]], clock: str = "clock") -> float | None:
    """Return the median by a clock, seconds; ``None`` where it has no times."""
    return statistics.median(taken[clock]) if taken.get(clock) else None


def spread(values: Sequence[float]) -> float:
    """Return half of what lies between the least and the most, over the median."""
    return (max(values) - min(values)) / 2 / statistics.median(values)


def ratios(ours: Sequence[float], theirs: Sequence[float]) -> list[float]:
    """Return each repetition over the other's in the same round."""
    return [a / b for a, b in zip(ours, theirs, strict=True)]


@lru_cache(maxsize=2**16)  # fronts compare the same samples again and again
def rank_sum_chance(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    """Return the chance, 0 to 1, that samples of one distribution are as separated as these.

    Wilcoxon's rank sum test, two-sided: exact, and by the normal distribution where both have more
    than :data:`EXACT` samples.
    """
    from scipy.stats import mannwhitneyu  # takes a second to load

    method = "exact" if min(len(a), len(b)) <= EXACT else "asymptotic"
    return float(mannwhitneyu(a, b, method=method).pvalue)
