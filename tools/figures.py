"""Name every published figure whose code has changed since it was measured.

    python tools/figures.py            # those; the status is 1 if there are any
    python tools/figures.py --all      # every figure

A page says above a table or a picture where its figures come from::

    <!-- figures: benchmarks/results/frames.json -->
    <!-- measured: 157b0bb77 raycasting volume (a sample at aa638d8b: SSIM within .0003) -->

The first names a file of results, which has the commit and the folders of `pyvista_vdi/` and
`opencl/` that decide the figures. The second says them itself (by default those of pictures).
``% figures: ...`` does as well. Brackets may say that some of the cases were measured again at a
later commit, which then counts, or "(needs a GPU)": then it is no reason for status 1. In
`docs/decisions/` figures are what was found out once, and may be older.
"""

# ruff: noqa: T201
from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[1]
MARK = re.compile(r"^\s*(?:<!--|%)\s*(figures|measured):\s*(.*?)\s*(?:-->)?\s*$", re.MULTILINE)
PICTURES = ("device", "generation", "lib", "model", "raycasting", "volume")


def commits_since(commit: str, rooms: tuple[str, ...]) -> int | None:
    """Return how many commits have touched the folders since one, ``None`` if it is unknown."""
    folders = [f"{root}/{room}" for room in rooms for root in ("pyvista_vdi", "opencl")]
    command = ["git", "rev-list", "--count", f"{commit.rstrip('+')}..HEAD", "--", *folders]
    done = subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, check=False)
    return int(done.stdout) if done.returncode == 0 else None


def since(kind: str, source: str) -> int | None:
    """Return how many commits have touched what a mark's figures measure."""
    before, _, brackets = source.partition("(")
    if kind == "figures":
        path = CHECKOUT / before.strip()
        measured = (
            json.loads(path.read_text(encoding="utf-8"))["measured"] if path.is_file() else {}
        )
        commit, rooms = measured.get("commit"), measured.get("rooms", measured.get("sources", ()))
    else:
        commit, *rooms = before.split()
    again = re.match(r"a sample at ([0-9a-f]{7,40}):", brackets)
    commit = again[1] if again else commit
    return commits_since(commit, tuple(rooms) or PICTURES) if commit else None


def main() -> int:
    """Print what is older, or everything; return the exit status."""
    older = 0
    for page in [CHECKOUT / "README.md", *sorted((CHECKOUT / "docs").rglob("*.md"))]:
        text = page.read_text(encoding="utf-8")
        for mark in MARK.finditer(text):
            kind, source = mark.groups()
            count = since(kind, source)
            once = "decisions" in page.parts
            older += count != 0 and not once and "(needs a GPU)" not in source
            state = "of an unknown commit" if count is None else f"{count} commits since"
            if "--all" in sys.argv[1:] or (count != 0 and not once):
                line = text.count("\n", 0, mark.start(1)) + 1
                print(f"{page.relative_to(CHECKOUT)}:{line}: {source}: {state}")
    print(f"{older} figures are older than the code that they measured")
    return int(older > 0)


if __name__ == "__main__":
    sys.exit(main())
