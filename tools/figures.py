"""Name every published figure that is older than the code it measured.

    python tools/figures.py            # those that are; the status is 1 if there are any
    python tools/figures.py --all      # every figure, and what is known of it

A page says above a table or a picture where its figures come from::

    <!-- figures: benchmarks/results/frames_1280x720.json -->
    <!-- measured: 157b0bb77 raycasting volume -->

The first names a file of results, which says what code it measured. The second is for figures that
have no such file: the commit, and the folders of `pyvista_vdi/` and `opencl/` that decide them (by
default those of pictures). ``% figures: ...`` does as well. Brackets add to either::

    <!-- measured: 6e012d2 (a sample at aa638d8b: SSIM within .0003) -->
    <!-- figures: benchmarks/results/gpu.json (needs a GPU) -->

The first: some of the cases were measured again at the later commit, and the largest difference is
said; the figure is as old as that. The second is named, but is no reason for status 1 where no
usable OpenCL device is one. In `docs/decisions/` figures are what was found out once, the reasons
of a decision, and may be older. Needs the package, and git.
"""

# ruff: noqa: T201
from __future__ import annotations

import argparse
import json
import re
import subprocess
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from pyvista_vdi import list_devices
from pyvista_vdi.measure.clock import outdated, sources_hash

CHECKOUT = Path(__file__).resolve().parents[1]
MARK = re.compile(r"^\s*(?:<!--|%)\s*(figures|measured):\s*(.*?)\s*(?:-->)?\s*$")
#: What a mark's brackets may say.
SAMPLE, NEEDS_GPU = re.compile(r"a sample at ([0-9a-f]{7,40}): (\S.*)"), "needs a GPU"
#: Folders that decide a figure for which none are named.
PICTURES = ("device", "generation", "lib", "model", "raycasting", "volume")


class Figure(NamedTuple):
    """A published figure: where it stands, where it comes from, and which code is another now."""

    place: str
    source: str
    older_than: tuple[str, ...]
    once: bool  # what was found out once, and is a decision's reason
    needs_gpu: bool = False


def figures(checkout: Path = CHECKOUT) -> Iterator[Figure]:
    """Yield every figure that the pages mark, in the order of their places."""
    for page in [checkout / "README.md", *sorted((checkout / "docs").rglob("*.md"))]:
        for line, text in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
            found = MARK.match(text)
            if found is None:
                continue
            kind, source = found.groups()
            before, _, more = source.partition("(")
            more = more.removesuffix(")")
            again = SAMPLE.fullmatch(more)
            if more and not again and more != NEEDS_GPU:
                older = (f"whatever it measured: ({more}) is neither a sample nor {NEEDS_GPU!r}",)
            elif kind == "figures":
                older = results_older_than(checkout, before.strip(), again and again[1])
            else:
                commit, *rooms = before.split()
                commit = again[1] if again else commit
                older = changed_since(checkout, commit, tuple(rooms) or PICTURES)
            place = f"{page.relative_to(checkout)}:{line}"
            yield Figure(place, source, older, "decisions" in page.parts, more == NEEDS_GPU)


def results_older_than(checkout: Path, source: str, again: str | None) -> tuple[str, ...]:
    """Return the folders whose code is another than a file of results, or its sample, measured."""
    path = (checkout / source).with_suffix(".json")
    if not path.is_file():
        return ("whatever it measured: its results are not kept",)
    measured = json.loads(path.read_text(encoding="utf-8")).get("measured")
    if measured is None:
        return ("whatever it measured: its results do not say",)
    if again is not None:
        return changed_since(checkout, again, tuple(measured["sources"]))
    return tuple(outdated(measured))


def changed_since(checkout: Path, commit: str, rooms: tuple[str, ...]) -> tuple[str, ...]:
    """Return the folders whose code is another now than in a commit."""
    return tuple(outdated({"sources": {room: room_then(checkout, commit, room) for room in rooms}}))


@cache
def room_then(checkout: Path, commit: str, room: str) -> str | None:
    """Return the hash of a commit's folder, as results have it; ``None`` without the commit."""

    def git(*command: str) -> bytes:
        return subprocess.run(["git", "-C", checkout, *command], capture_output=True).stdout

    folders = {f"pyvista_vdi/{room}/": "", f"opencl/{room}/": "opencl/"}
    sources = {}
    for entry in git("ls-tree", "-r", "-z", "--full-tree", commit, *folders).decode().split("\0"):
        about, _, path = entry.partition("\t")
        if path.endswith((".py", ".cl", ".js")):
            (folder,) = (folder for folder in folders if path.startswith(folder))
            name = folders[folder] + path.removeprefix(folder)
            sources[name] = git("cat-file", "blob", about.split()[2]).decode()
    return sources_hash(sources) if sources else None


def main() -> None:
    """Print what is older, or everything."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--all", action="store_true", help="what is not older, too")
    options = parser.parse_args()
    found = list(figures())
    older = [each for each in found if each.older_than and not each.once]
    gpu = any(device.kind == "GPU" and device.usable for device in list_devices())
    beyond = [each for each in older if each.needs_gpu and not gpu]
    for each in found if options.all else older:
        state = f"older than {', '.join(each.older_than)}" if each.older_than else "as of today"
        state += "; cannot be measured here" if each in beyond else ""
        print(f"{each.place}: {each.source}: {'found out once; ' if each.once else ''}{state}")
    print(f"{len(found)} figures, {len(older)} of them older than what they measured")
    raise SystemExit(len(older) > len(beyond))


if __name__ == "__main__":
    main()
