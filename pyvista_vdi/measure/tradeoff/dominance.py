"""Which settings are dominated, when what was measured is noisy.

Every figure is smaller for the better. A setting *dominates* another if

- no figure of it is worse by more than what does not count for its kind,
- at least one is better by more than that, and beyond the noise of its repetitions, and
- in sum its gains outweigh its losses, each in units of what does not count.

So noise keeps a setting from being called dominated and never makes it so. Where nothing is
noisy and everything counts this is Pareto's dominance. With differences that do not count, the
first two conditions alone could lead in circles, at whose end everything is dominated; the third
one orders the settings by a sum. They could also lead astray, each setting giving way to a
neighbour, until the last is far from the first. So a setting gives way only to one that stays.
*The front* is what stays, found in the order of the sums.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.measure.clock import CHANCE, rank_sum_chance


@dataclass(frozen=True)
class Figure:
    """One figure of a setting; the smaller, the better.

    ``tolerance``, above 0 and the same in all figures of a kind, are differences that do not count;
    ``repetitions`` what ``value`` is the median of, none where it repeats exactly.
    """

    value: float
    tolerance: float
    repetitions: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not (math.isfinite(self.value) and 0 < self.tolerance < math.inf):
            raise InvalidArgumentError(
                "a figure has a finite value and a tolerance above 0; got "
                f"{self.value!r} and {self.tolerance!r}"
            )

    @classmethod
    def of_times(cls, repetitions: Sequence[float], tolerance: float) -> Figure:
        """Return what repetitions of a positive figure say, as logarithms: ratios count."""
        logs = tuple(math.log(value) for value in repetitions)
        return cls(statistics.median(logs), tolerance, logs)

    def is_worse(self, other: Figure) -> bool:
        """Whether it is larger by more than what does not count."""
        return self.value > other.value + other.tolerance

    def is_better(self, other: Figure) -> bool:
        """Whether it is smaller by more than that, and beyond the noise."""
        if not other.is_worse(self):
            return False
        noisy = self.repetitions and other.repetitions
        return not noisy or rank_sum_chance(self.repetitions, other.repetitions) <= CHANCE


Figures = Sequence[Figure]


def dominates(one: Figures, other: Figures) -> bool:
    """Whether a setting makes another pointless: figures of the same kinds in the same order."""
    pairs = list(zip(one, other, strict=True))
    return (
        not any(ours.is_worse(theirs) for ours, theirs in pairs)
        and _sum(one) < _sum(other)
        and any(ours.is_better(theirs) for ours, theirs in pairs)
    )


def find_dominated(settings: Mapping[str, Figures]) -> dict[str, list[str]]:
    """Return the settings that are dominated, and by which of those on the front.

    ``settings`` are figures by name, in whose order names are returned.
    """
    kept = front(settings)
    found = {n: [one for one in kept if dominates(settings[one], settings[n])] for n in settings}
    return {name: by for name, by in found.items() if by}


def front(settings: Mapping[str, Figures]) -> list[str]:
    """Return the settings that none of them dominates, in the order of `settings`."""
    kept: list[str] = []
    # What dominates a setting has the smaller sum, so that it has been decided on before
    for name in sorted(settings, key=lambda name: _sum(settings[name])):
        if not any(dominates(settings[one], settings[name]) for one in kept):
            kept.append(name)
    return [name for name in settings if name in kept]


def told_apart(names: Sequence[str], settings: Mapping[str, Figures]) -> list[str]:
    """Return `names` without those that are no different from an earlier one that stays.

    Two settings differ where one of them is better, by what counts and beyond the noise, in at
    least one figure.
    """
    kept: list[str] = []
    for name in names:
        pairs = (zip(settings[one], settings[name], strict=True) for one in kept)
        if all(any(a.is_better(b) or b.is_better(a) for a, b in pair) for pair in pairs):
            kept.append(name)
    return kept


def _sum(figures: Figures) -> float:
    return math.fsum(figure.value / figure.tolerance for figure in figures)
