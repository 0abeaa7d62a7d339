"""Draws of cases that speak for all, and means over all from those that were measured."""

from __future__ import annotations

import hashlib
import math
import statistics
from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from pyvista_vdi.measure.harness import Case


def sample(
    cases: Iterable[Case], count: int, key: Callable[[Case], Hashable] = lambda case: case.volume
) -> list[Case]:
    """Draw cases so that they speak for all: the same ones in every run, in their order.

    Every stratum, a volume's cases unless ``key`` says otherwise, has one case drawn while there
    are enough, and then as many as its share. Which ones, a hash of their names decides.
    """
    cases = list(cases)
    strata: dict[Hashable, list[Case]] = defaultdict(list)
    for case in sorted(cases, key=lambda case: hashlib.sha256(case.name.encode()).digest()):
        strata[key(case)].append(case)
    order = [
        (rank > 0, (rank + 0.5) / len(members), case)
        for members in strata.values()
        for rank, case in enumerate(members)
    ]
    drawn = {case for *_, case in sorted(order, key=lambda entry: entry[:2])[:count]}
    return [case for case in cases if case in drawn]


@dataclass(frozen=True)
class SampledMean:
    """A mean over all cases from those that were measured, ``count`` of ``of``.

    Its standard ``error`` is 0 where all were.
    """

    mean: float
    error: float
    count: int
    of: int

    def __str__(self) -> str:
        if self.count == self.of:
            return f"{self.mean:.3g}"
        return f"{self.mean:.3g} ± {self.error:.1g} ({self.count} of {self.of} cases)"


def estimate(
    values: Mapping[Hashable, Sequence[float]], sizes: Mapping[Hashable, int]
) -> SampledMean:
    """Return the mean of all cases by a stratified sample of them, with its standard error.

    ``values`` holds what was measured by stratum, ``sizes`` how many cases a stratum has; one of
    which nothing was measured is left out. Where a single case was, it is taken that its stratum
    varies as all that was measured does.
    """
    measured = {stratum: list(found) for stratum, found in values.items() if len(found)}
    every = [value for found in measured.values() for value in found]
    everywhere = statistics.variance(every) if len(every) > 1 else math.nan
    total = sum(sizes[stratum] for stratum in measured)
    mean = variance = 0.0
    for stratum, found in measured.items():
        n, size = len(found), sizes[stratum]
        mean += size / total * statistics.fmean(found)
        if n < size:
            within = statistics.variance(found) if n > 1 else everywhere
            variance += (size / total) ** 2 * (1 - n / size) * within / n
    return SampledMean(mean, math.sqrt(variance), len(every), sum(sizes.values()))
