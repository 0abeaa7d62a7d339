"""Name every published figure that is older than the code it measured.

    python tools/figures.py            # those that are; the status is 1 if there are any
    python tools/figures.py --all      # every figure, and what is known of it

A page says above a table or a picture where its figures come from::

    <!-- figures: benchmarks/results/frames_1280x720.json -->
    <!-- measured: 157b0bb77 raycasting volume -->

The first names a file of results, which says what code it measured. The second is for figures that
have no such file: the commit, and the folders of `pyvista_vdi/` and `opencl/` that decide them (by
default those of pictures). ``% figures: ...`` does as well. In `docs/decisions/` figures are what
was found out once, the reasons of a decision, and may be older. Needs the package.
"""

# ruff: noqa: T201
from __future__ import annotations

import argparse
import json
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from pyvista_vdi.measure.clock import outdated

CHECKOUT = Path(__file__).resolve().parents[1]
MARK = re.compile(r"^\s*(?:<!--|%)\s*(figures|measured):\s*(.*?)\s*(?:-->)?\s*$")
#: Folders that decide a figure for which none are named.
PICTURES = ("device", "generation", "lib", "model", "raycasting", "volume")


class Figure(NamedTuple):
    """A published figure: where it stands, where it comes from, and which code is another now."""

    place: str
    source: str
    older_than: tuple[str, ...]
    once: bool  # what was found out once, and is a decision's reason


def figures(checkout: Path = CHECKOUT) -> Iterator[Figure]:
    """Yield every figure that the pages mark, in the order of their places."""
    for page in [checkout / "README.md", *sorted((checkout / "docs").rglob("*.md"))]:
        for line, text in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
            found = MARK.match(text)
            if found is None:
                continue
            place = f"{page.relative_to(checkout)}:{line}"
            kind, source = found.groups()
            if kind == "figures":
                older = results_older_than(checkout / source)
            else:
                commit, *rooms = source.split()
                older = changed_since(checkout, commit, rooms or PICTURES)
            yield Figure(place, source, older, once="decisions" in page.parts)


def results_older_than(path: Path) -> tuple[str, ...]:
    """Return the folders whose code is another than a file of results has measured."""
    path = path.with_suffix(".json")
    if not path.is_file():
        return ("whatever it measured: its results are not kept",)
    measured = json.loads(path.read_text(encoding="utf-8")).get("measured")
    if measured is None:
        return ("whatever it measured: its results do not say",)
    return tuple(outdated(measured))


def changed_since(
    checkout: Path, commit: str, rooms: tuple[str, ...] | list[str]
) -> tuple[str, ...]:
    """Return the folders that have changed since a commit."""
    changed = []
    for room in rooms:
        folders = [f"pyvista_vdi/{room}", f"opencl/{room}"]
        command = ["git", "-C", str(checkout), "diff", "--quiet", commit, "--", *folders]
        if subprocess.run(command, capture_output=True, check=False).returncode:
            changed.append(room)
    return tuple(changed)


def main() -> None:
    """Print what is older, or everything."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--all", action="store_true", help="what is not older, too")
    options = parser.parse_args()
    found = list(figures())
    older = [each for each in found if each.older_than and not each.once]
    for each in found if options.all else older:
        state = f"older than {', '.join(each.older_than)}" if each.older_than else "as of today"
        print(f"{each.place}: {each.source}: {'found out once; ' if each.once else ''}{state}")
    print(f"{len(found)} figures, {len(older)} of them older than what they measured")
    raise SystemExit(bool(older))


if __name__ == "__main__":
    main()
