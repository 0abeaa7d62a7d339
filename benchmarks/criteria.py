"""What the criterion decides: SSIM by angle for each, at the same budget and at the same bytes.

Writes ``criteria_WxH.json`` (all figures) and ``.md`` (tables). See README.md in this folder.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Iterator
from statistics import mean
from typing import Any

from common import (  # beside this file
    add_looks,
    add_redo,
    add_size,
    add_volumes,
    at_hand,
    begun,
    marked,
    new_parser,
    results_file,
    save,
    subject_of,
)
from tqdm import tqdm

from pyvista_vdi.api import render, render_volume
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.measure.report import describe_system, system_line, table, write_text
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.options import CRITERIA
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS
from pyvista_vdi.model.vdi import VDI

ANGLES = (0.0, 5.0, 15.0, 30.0, 60.0, 90.0)
BUDGETS = (15, 30)
VOLUMES = ("aneurism", "brain", "rayleigh_taylor")
#: The criterion that gives the number of supersegments which the others are brought to.
GIVES = CRITERIA[0]
#: By how much that number may be missed; and how near the search in a small window comes.
SLACK, SMALL_SLACK = 0.02, 0.005
#: No budget above this is tried to reach it.
MOST = 128

EQUALLY_MANY = "same bytes"
EQUAL_BUDGET = "same N_S"


def main() -> int:
    """Measure what is missing, and write what was found."""
    options = parsed()
    target = results_file("criteria", options)
    case = {
        "window_size": list(options.size),
        "interpolation": options.interpolation,
        "angles": list(ANGLES),
        "system": describe_system(options.device),
    }
    results = begun(target, case, parts="cases")
    wanted = [
        (name, look)
        for name in at_hand(options.volumes)
        for look in options.tf
        if options.redo or f"{name}, {look}" not in results["cases"]
    ]
    with tqdm(total=len(wanted) * len(BUDGETS) * len(CRITERIA), unit="criterion") as bar:
        for name, look in wanted:
            rows = []
            for row in Case(name, look, options).rows():
                rows.append(row)
                bar.update(row["way"] != EQUAL_BUDGET)
            results["cases"][f"{name}, {look}"] = rows
            save(results, target)
    write_text(target.with_suffix(".md"), "\n".join([*report(results), ""]))
    print(f"Written: {target}, and .md beside it")
    return 0


def parsed() -> argparse.Namespace:
    """Return the options."""
    parser = new_parser(__doc__)
    add_size(parser, (480, 270))
    add_volumes(parser, VOLUMES)
    looks = tuple(TRANSFER_FUNCTIONS)
    parser.add_argument("--tf", nargs="+", choices=looks, default=looks, metavar="NAME")
    add_looks(parser, tf=None, max_supersegments=None)
    add_redo(parser)
    return parser.parse_args()


class Case:
    """One volume with one transfer function: the references, and how its VDIs are made.

    Parameters
    ----------
    name, look : str
        Volume and transfer function.
    options : argparse.Namespace
        As :func:`parsed` returns them.
    """

    def __init__(self, name: str, look: str, options: argparse.Namespace) -> None:
        self._volume, self._classified, self._view = subject_of(name, options, look)
        self._size = tuple(options.size)
        self._device = options.device
        self._references = [
            render_volume(
                self._volume,
                self._view.azimuth(a),
                self._size,
                transfer_function=self._classified,
                device=self._device,
            )
            for a in ANGLES
        ]

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield what each criterion gives at each budget, and what at the bytes of the first."""
        for budget in BUDGETS:
            given = self._made(self._size, GIVES, budget)
            for criterion in CRITERIA:
                vdi = given if criterion == GIVES else self._made(self._size, criterion, budget)
                row = self._row(EQUAL_BUDGET, budget, criterion, vdi, given)
                yield row
                if criterion == GIVES:
                    yield {**row, "way": EQUALLY_MANY}
                else:
                    vdi = self._matched(criterion, budget, given)
                    yield self._row(EQUALLY_MANY, budget, criterion, vdi, given)

    def _made(
        self, size: tuple[int, int], criterion: str, budget: int, tolerance: float = 0.0
    ) -> VDI:
        return generate_vdi(
            self._volume,
            self._view,
            size,
            self._classified,
            max_supersegments=budget,
            criterion=criterion,
            tolerance=tolerance,
            device=self._device,
        )

    def _row(self, way: str, budget: int, criterion: str, vdi: VDI, given: VDI) -> dict[str, Any]:
        found = [
            compare_images(
                render(vdi, self._view.azimuth(angle), self._size, device=self._device), image
            )
            for angle, image in zip(ANGLES, self._references, strict=True)
        ]
        return {
            "way": way,
            "budget": budget,
            "criterion": criterion,
            "max_supersegments": vdi.metadata["max_supersegments"],
            "tolerance": vdi.metadata["tolerance"],
            "supersegments": vdi.n_supersegments,
            "share": vdi.n_supersegments / given.n_supersegments,
            "bytes": vdi.nbytes,
            "ssim": [f.ssim for f in found],
            "psnr": [min(f.psnr, 999.0) for f in found],
            "brightness": [f.mean_brightness_ratio for f in found],
        }

    def _matched(self, criterion: str, budget: int, given: VDI) -> VDI:
        """Return the criterion's VDI with as many supersegments as ``given`` has.

        The budget is the least that has no fewer, and tolerance takes the rest. Both are sought in
        a window of a third the size, and then set right in the whole.
        """
        small = (self._size[0] // 3, self._size[1] // 3)
        aim = self._made(small, GIVES, budget).n_supersegments

        def in_small(limit: int, tolerance: float = 0.0) -> int:
            return self._made(small, criterion, limit, tolerance).n_supersegments

        limit = least_budget(in_small, aim, budget)
        tolerance = settled(lambda t: in_small(limit, t), aim, 0.0, SMALL_SLACK)
        whole: dict[float, VDI] = {}

        def in_whole(tolerance: float) -> int:
            whole.clear()
            whole[tolerance] = self._made(self._size, criterion, limit, tolerance)
            return whole[tolerance].n_supersegments

        settled(in_whole, given.n_supersegments, tolerance, SLACK)
        return next(iter(whole.values()))


def least_budget(count: Callable[[int], int], aim: int, start: int) -> int:
    """Return the least budget that gives no fewer than ``aim``, or :data:`MOST`."""
    limit = start
    while (found := count(limit)) < aim and limit < MOST:
        limit = min(MOST, max(limit + 1, math.ceil(limit * aim / max(found, 1))))
    while limit > 1 and count(limit - 1) >= aim:
        limit -= 1
    return limit


def settled(count: Callable[[float], int], aim: int, tolerance: float, slack: float) -> float:
    """Return the tolerance that gives ``aim`` but for ``slack``; the last that was tried."""
    low, high = None, None
    for _ in range(16):
        share = count(tolerance) / aim
        if abs(share - 1) <= slack or (share < 1 and tolerance == 0):
            break
        if share > 1:
            low = tolerance
        else:
            high = tolerance
        if low is None:
            tolerance = high / 1.5
        elif high is None:
            tolerance = max(1.5 * low, 2e-3)  # below a thousandth it does nothing
        else:
            tolerance = (low + high) / 2
    return tolerance


def report(results: dict[str, Any]) -> Iterator[str]:
    """Yield the tables as Markdown: the means, who is best, and every case at the same bytes."""
    width, height = results["window_size"]
    angles = results["angles"]
    heads = [f"{angle:g}°" for angle in angles]
    rows = [{**r, "case": case} for case, found in results["cases"].items() for r in found]
    n = len(results["cases"])
    yield (
        f"{width} x {height} lists and pixels, `{results['interpolation']}`, steps of half the "
        f"smallest spacing, {n} cases (volume and transfer function). *{EQUALLY_MANY}*: as many "
        f"supersegments as `{GIVES}` has with that budget, within {SLACK:.0%}, by another N_S and "
        f"tolerance, or as many as N_S {MOST} gives where that is fewer; *supersegments*: over "
        "those, the mean. *best*: in how many cases no other criterion has a higher SSIM, by angle."
    )
    for way in (EQUALLY_MANY, EQUAL_BUDGET):
        yield from ("", f"**Mean SSIM, {way}**", "")
        means = []
        for budget in BUDGETS:
            for criterion in CRITERIA:
                mine = chosen(rows, way, budget, criterion)
                ssim = [f"{mean(r['ssim'][i] for r in mine):.4f}" for i in range(len(angles))]
                best = "/".join(
                    str(wins(rows, way, budget, criterion, a)) for a in range(len(angles))
                )
                least = min(r["ssim"][-1] for r in mine)
                share = mean(r["share"] for r in mine)
                means.append([budget, criterion, f"{share:.2f}", *ssim, best, f"{least:.4f}"])
        titles = ("N_S", "criterion", "supersegments", *heads, "best", "least, 90°")
        yield from table(titles, means)
    yield from ("", f"**SSIM, {EQUALLY_MANY}**; bold: the best", "")
    found = []
    for case in results["cases"]:
        for budget in BUDGETS:
            for criterion in CRITERIA:
                (row,) = (
                    r for r in chosen(rows, EQUALLY_MANY, budget, criterion) if r["case"] == case
                )
                ssim = [
                    marked(f"{row['ssim'][a]:.4f}", not is_best(rows, row, a))
                    for a in range(len(angles))
                ]
                found.append(
                    [case, budget, criterion, settings(row), f"{row['bytes'] / 2**20:.1f}", *ssim]
                )
    yield from table(("case", "N_S", "criterion", "with N_S, tolerance", "MiB", *heads), found)
    yield from ("", system_line(results["system"]))


def settings(row: dict[str, Any]) -> str:
    """Return what gave the row its supersegments, and how many where they are not as many."""
    text = str(row["max_supersegments"])
    if row["tolerance"] > 0:
        text += f", {row['tolerance']:.2g}"
    return text if abs(row["share"] - 1) <= SLACK else f"{text} ({row['share']:.0%})"


def chosen(
    rows: list[dict[str, Any]], way: str, budget: int, criterion: str
) -> list[dict[str, Any]]:
    """Return one criterion's rows: one per case."""
    mine = (way, budget, criterion)
    return [r for r in rows if (r["way"], r["budget"], r["criterion"]) == mine]


def wins(rows: list[dict[str, Any]], way: str, budget: int, criterion: str, angle: int) -> int:
    """Return in how many cases a criterion is the best."""
    return sum(is_best(rows, row, angle) for row in chosen(rows, way, budget, criterion))


def is_best(rows: list[dict[str, Any]], row: dict[str, Any], angle: int) -> bool:
    """Whether no other criterion has a higher SSIM, at the four decimals that are shown."""
    rivals = [
        r["ssim"][angle]
        for r in rows
        if all(r[key] == row[key] for key in ("case", "way", "budget"))
    ]
    return round(row["ssim"][angle], 4) == round(max(rivals), 4)


if __name__ == "__main__":
    sys.exit(main())
