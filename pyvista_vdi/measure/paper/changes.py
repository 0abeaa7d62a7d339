"""What changed between two runs, beyond noise.

A time has changed if chance alone would separate its repetitions as much in at most one case of a
hundred (Wilcoxon's rank sum, exact and two-sided), and its median by more than a twentieth. Times
are compared as they are, which says something where the machine was the same and did nothing
else, and in pairs: each repetition over that of ``render_volume`` beside it, which machines that
are now faster and now slower leave alone. What repeats exactly is held to fixed limits.
"""

from __future__ import annotations

import json
import math
import statistics
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from pyvista_vdi.measure.clock import CHANCE, rank_sum_chance, ratios
from pyvista_vdi.measure.harness import CANDIDATES
from pyvista_vdi.measure.paper.report import measured, name_of
from pyvista_vdi.measure.results import Results

#: Relative change of a median below which nothing counts as changed.
LEAST_CHANGE = 0.05

#: What a figure may differ by between devices that round differently. PSNR and the worst pixel
#: follow SSIM's pictures, and single pixels more than the picture.
_SSIM_LIMIT = 0.0005
_SIZE_LIMIT = 0.001  # relative


@dataclass(frozen=True)
class Change:
    """A figure in two runs.

    ``cell`` says which row, ``figure`` which of its figures, a median or what repeats exactly;
    ``chance`` of the former is that of noise alone to separate the repetitions as much.
    """

    cell: str
    figure: str
    before: float
    after: float
    chance: float | None
    changed: bool

    @property
    def ratio(self) -> float:
        """After over before; infinite where before is 0."""
        return self.after / self.before if self.before else math.inf


def compare_results(before: dict[str, Any], after: dict[str, Any]) -> list[Change]:
    """Return every figure that is in both runs, in the order of `before`.

    They are what two files hold, see :func:`pyvista_vdi.measure.paper.read_results`.
    """
    return list(_changes(before, after))


def describe_changes(before: dict[str, Any], after: dict[str, Any]) -> str:
    """Return what changed as lines of text, with the rule and what could not be compared."""
    found = compare_results(before, after)
    changed = [change for change in found if change.changed]
    rule = (
        f"A time changed where its median did by more than {LEAST_CHANGE:.0%}, and noise alone "
        f"separates the repetitions as much in at most {CHANCE:.0%} of cases (rank sum)."
    )
    tested = sum(change.chance is not None for change in found)
    lines = [
        f"Figures in both: {len(found)}; changed beyond noise: {len(changed)}.",
        rule,
        f"Of {tested} times, about {CHANCE * tested:.1f} pass the second test by chance.",
    ]
    n, m = before["plan"]["repeats"], after["plan"]["repeats"]
    if 2 / math.comb(n + m, n) > CHANCE:
        lines.append(
            "The runs have too few repetitions for any time to count as changed: 5 and 5 are enough"
        )
    for part, names, what in (
        ("system", ("device", "driver", "opengl"), "Look at times in pairs only."),
        ("plan", ("interpolation", "seed"), "Other pictures were drawn."),
    ):
        for name in names:
            ours, theirs = (run[part].get(name) for run in (before, after))
            if ours != theirs:
                lines.append(f"The {name} differs: {ours}; {theirs}. {what}")
    lines.append("")
    for change in changed:
        chance = "" if change.chance is None else f"  (chance {change.chance:.2g})"
        lines.append(
            f"{change.cell}: {change.figure} {change.before:.5g} -> {change.after:.5g}, "
            f"{change.ratio:.3f} times{chance}"
        )
    lines += _only_in_one(before, after)
    return "\n".join(lines).rstrip() + "\n"


def _changes(before: dict[str, Any], after: dict[str, Any]) -> Iterator[Change]:
    others = {json.dumps(row["case"]): row for row in after["rows"] if "refused" not in row}
    for what, changes in (("vdi", _vdi_changes), ("view", _row_changes)):
        for row in measured(before, what):
            if (other := others.get(json.dumps(row["case"]))) is not None:
                yield from changes(name_of(row["case"]), row, other)


def _vdi_changes(name: str, before: dict[str, Any], after: dict[str, Any]) -> Iterator[Change]:
    for figure in ("supersegments", "bytes_raw", "bytes_saved"):
        if None not in (both := (before[figure], after[figure])):
            yield _exact(name, figure, *both, _SIZE_LIMIT * both[0])
    yield _timed(
        name, "generation, s", *(v["generation_seconds"]["clock"] for v in (before, after))
    )


def _row_changes(at: str, before: dict[str, Any], after: dict[str, Any]) -> Iterator[Change]:
    ssim = [row["vdi_to_volume"]["ssim"] for row in (before, after)]
    if None not in ssim:  # windows below 11 pixels have none
        yield _exact(at, "SSIM", ssim[0], ssim[1], _SSIM_LIMIT)
    for name, label in CANDIDATES.items():
        if name in before["seconds"] and name in after["seconds"]:
            taken = [row["seconds"][name]["clock"] for row in (before, after)]
            yield _timed(at, f"{label}, s", *taken)
            if name != "volume":
                # Each repetition over that of render_volume beside it
                beside = [row["seconds"]["volume"]["clock"] for row in (before, after)]
                yield _timed(at, f"{label} / render_volume", *map(ratios, taken, beside))


def _timed(cell: str, figure: str, before: list[float], after: list[float]) -> Change:
    chance = rank_sum_chance(before, after)
    old, new = statistics.median(before), statistics.median(after)
    moved = abs(new - old) > LEAST_CHANGE * old
    return Change(cell, figure, old, new, chance, chance <= CHANCE and moved)


def _exact(cell: str, figure: str, before: float, after: float, limit: float) -> Change:
    return Change(cell, figure, before, after, None, abs(after - before) > limit)


def _only_in_one(before: dict[str, Any], after: dict[str, Any]) -> Iterator[str]:
    """Name VDIs that one run lacks, or has refused."""
    runs = [
        {name_of(row["case"]): row.get("refused") for row in Results(run).rows(what="vdi")}
        for run in (before, after)
    ]
    for name in dict.fromkeys([*runs[0], *runs[1]]):
        states = [_state(run[name]) if name in run else "missing" for run in runs]
        if states[0] != states[1]:
            yield f"{name}: {states[0]} -> {states[1]}"


def _state(refused: str | None) -> str:
    return "measured" if refused is None else f"refused ({refused})"
