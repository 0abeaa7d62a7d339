"""What each setting of a VDI costs and gives: the measurements behind ``docs/accuracy.md``.

    PYVISTA_VDI_DATA=/where/the/volumes/are python benchmarks/tradeoff.py

Runs ``pyvista-vdi tradeoff`` for three volumes; two smaller sweeps for one of them, of what is
swept only on request and with linear sampling; and the default VDI from many angles for six. What
is there is gone on with; ``--redo`` measures anew. Results go into ``benchmarks/results/``, and so
do two tables over all volumes: ``tradeoff_settings.md`` and ``tradeoff_angles.md``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

from pyvista_vdi.cli import main as command
from pyvista_vdi.measure.report import across, table, write_text
from pyvista_vdi.measure.tradeoff import Point, Tradeoff
from pyvista_vdi.measure.tradeoff.findings import faster_vtk

RESULTS = Path(__file__).resolve().parent / "results"

#: Volumes of the whole sweep.
SWEPT = ("brain", "heptane", "berea")
#: Volumes with much and with little empty space, large and small.
FROM_MANY_ANGLES = ("brain", "heptane", "berea", "rayleigh_taylor", "tooth", "isabel_wind")

#: Options by name of the results, which begins with the volume's.
RUNS = {
    **dict.fromkeys(SWEPT, ()),
    "brain-on-request": (
        *("--sweep", "criterion", "view-cone", "sample-distance"),
        *("--repeats", "3", "--generations", "3", "--no-vtk"),
    ),
    "brain-linear": (
        *("--interpolation", "linear", "--repeats", "3", "--generations", "3", "--no-vtk"),
        *("--sweep", "max-supersegments=10,40", "lists=0.5,2", "precision=8-byte", "--alone"),
    ),
    **{
        f"{volume}-angles": (
            *("--angles", "0,5,15,30,60,90,180", "--generations", "1"),
            *("--sweep", "precision=8-byte", "skip-empty"),
        )
        for volume in FROM_MANY_ANGLES
    },
}


def main() -> int:
    """Run them all, or those that are named."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", nargs="+", choices=tuple(RUNS), default=tuple(RUNS))
    parser.add_argument("--redo", action="store_true", help="measure anew")
    parser.add_argument("--out", type=Path, default=RESULTS, metavar="FOLDER")
    options = parser.parse_args()
    failed = 0
    for name in options.runs:
        if options.redo:
            (options.out / f"tradeoff-{name}.json").unlink(missing_ok=True)
        volume = name.partition("-")[0]
        where = ("--example", volume, "--name", name, "--out", str(options.out), "--resume")
        failed |= command(["tradeoff", *where, *RUNS[name]])
    there = {name: options.out / f"tradeoff-{name}.json" for name in RUNS}
    found = {name: Tradeoff.read(path) for name, path in there.items() if path.exists()}
    found = {name: one for name, one in found.items() if one.data["findings"] is not None}
    swept = {name: one for name, one in found.items() if name in SWEPT}
    angles = {
        name.partition("-")[0]: one for name, one in found.items() if name.endswith("-angles")
    }
    for stem, lines in (
        ("tradeoff_settings", beside_the_default(swept)),
        ("tradeoff_angles", by_angle(angles)),
    ):
        write_text(options.out / f"{stem}.md", "\n".join(lines) + "\n")
    return failed


def beside_the_default(found: dict[str, Tradeoff]) -> Iterator[str]:
    """Yield a table of what each setting changes, with a figure for each volume in every cell."""
    names = ", ".join(found)
    first = next(iter(found.values()), None)
    if first is None:
        return
    angles = first.data["plan"]["angles"]
    yield f"Each cell: {names}. SSIM: the change in thousandths; the others: over the default's."
    yield ""
    kinds = {
        "frame": "frame",
        "memory": "bytes on the device",
        "file": "in the file",
        "generation": "generation",
    }
    rows = []
    for name in (one.name for one in first.points if one.name != "default"):
        pairs = [
            (one.point(name), one.point("default"))
            for one in found.values()
            if name in {point.name for point in one.points}
        ]
        changes = (
            ", ".join(
                f"{round(1e3 * (a.ssims[angle] - b.ssims[angle]), 1) + 0.0:+.1f}" for a, b in pairs
            )
            for angle in angles
        )
        costs = (", ".join(_ratio(a, b, kind) for a, b in pairs) for kind in kinds)
        rows.append([name, *changes, *costs])
    titles = [f"SSIM {angle:g}°" for angle in angles]
    yield from table(("setting", *titles, *kinds.values()), rows)


def by_angle(found: dict[str, Tradeoff]) -> Iterator[str]:
    """Yield tables of the default VDI's frames beside volume rendering."""
    if not found:
        return
    angles = next(iter(found.values())).data["plan"]["angles"]
    degrees = [f"{angle:g}°" for angle in angles]
    for title, with_vtk in (("`render_volume`", False), ("the faster of VTK's mappers", True)):
        yield f"**Frames of the default VDI over {title}**"
        yield ""
        rows = []
        for name, one in found.items():
            others = faster_vtk(one.data) if with_vtk else dict.fromkeys(angles, 1.0)
            frames = one.point("default").frames
            size = across(one.data["plan"]["volume"]["dimensions"], " x ")
            rows.append([name, size, *(f"{frames[a] / others[a]:.2f}" for a in angles)])
        yield from table(("volume", "size", *degrees), rows)
        yield ""
    yield "**SSIM of the default VDI to `render_volume`**"
    yield ""
    ssims = {name: one.point("default").ssims for name, one in found.items()}
    rows = [[name, *(f"{of_one[a]:.4f}" for a in angles)] for name, of_one in ssims.items()]
    yield from table(("volume", *degrees), rows)


def _ratio(one: Point, default: Point, kind: str) -> str:
    a, b = one.cost(kind), default.cost(kind)
    return "-" if a is None or b is None else f"{a / b:.2f}"


if __name__ == "__main__":
    sys.exit(main())
