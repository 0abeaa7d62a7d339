"""Which mistakes do the tests notice? A sample of one-place changes, each tried by itself.

    python tools/mutants.py                            # 20 changes, -m fast
    python tools/mutants.py --count 60 --seed 3 --tier default opencl/generation
    python tools/mutants.py --tier device --device portable opencl

Lines of kernels and of Python are drawn, and in each one operator, name or number is changed
(:data:`CHANGES`). Every mutant is made in a copy of the checkout, which the tests of the rooms
concerned import in place of the installed package. It counts as killed if they fail, and only where
they pass on the unchanged copy. Some mutants change nothing that can be seen; those that live are
printed, to be read. Needs an environment in which the tests run; the status is 0 whatever lives.
"""

# ruff: noqa: T201
from __future__ import annotations

import argparse
import io
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import tokenize
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

CHECKOUT = Path(__file__).resolve().parents[1]

#: How pytest is asked for the tests of each tier.
TIERS = {"fast": "fast", "default": "not slow and not paraview", "device": "device"}

#: What is drawn from unless folders or files are named.
FOLDERS = (
    "opencl",
    *(f"pyvista_vdi/{n}" for n in ("model", "generation", "raycasting", "quality")),
)

#: Rooms whose tests are run for a folder of `opencl/`; for others the room of the same name.
ROOMS = {
    "lib": ("raycasting", "generation"),
    "generation": ("generation",),
    "volume": ("volume", "generation"),
    "multi_vdi": ("raycasting",),
}

#: What stands in a line and what stands there in the mutant, either way.
PAIRS = "< <= > >= == != + - * / && || and or min max fmin fmax floor ceil True False true false"
WORDS = (PAIRS + " 0 1 front back break continue").split()
CHANGES = dict(zip(WORDS, (WORDS[k ^ 1] for k in range(len(WORDS))), strict=True))

#: A kernel's words and operators, and what is skipped: remarks, texts, the preprocessor's lines.
TOKEN = re.compile(
    r'//[^\n]*|/\*.*?\*/|"[^"\n]*"|^\s*#[^\n]*|[<>=!]=|&&|\|\||->|<<|>>|[+-]{2}|[\w.]+|[<>+*/-]',
    re.DOTALL | re.MULTILINE,
)


class Mutant(NamedTuple):
    """A piece of a file, by its place, and what stands there instead."""

    file: str
    at: int
    old: str
    new: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.old} to {self.new}"


def tokens_of(path: Path, text: str) -> Iterator[tuple[int, str]]:
    """Yield the places and the texts of words and operators that are neither text nor remark."""
    if path.suffix == ".cl":
        yield from ((found.start(), found[0]) for found in TOKEN.finditer(text))
        return
    begins = [0]
    for line in text.splitlines(keepends=True):
        begins.append(begins[-1] + len(line))
    before = ""
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        # * before names of arguments is none that multiplies
        starred = token.string == "*" and before in ("(", ",", "[", "{", "")
        if token.type in (tokenize.OP, tokenize.NAME, tokenize.NUMBER) and not starred:
            yield begins[token.start[0] - 1] + token.start[1], token.string
        before = token.string


def mutants_of(path: Path) -> list[Mutant]:
    """Return every change that can be made in a file."""
    text, name = path.read_text(encoding="utf-8"), path.relative_to(CHECKOUT).as_posix()
    return [
        Mutant(name, at, old, CHANGES[old], text.count("\n", 0, at) + 1)
        for at, old in tokens_of(path, text)
        if old in CHANGES
    ]


def drawn(places: list[str], count: int, seed: int) -> list[Mutant]:
    """Return so many changes, of lines that are drawn: each line is as likely as another."""
    files: list[Path] = []
    for place in places:
        whole = CHECKOUT / place
        found = [whole] if whole.is_file() else whole.rglob("*")
        files += sorted(path for path in found if path.suffix in (".cl", ".py"))
    lines: dict[tuple[str, int], list[Mutant]] = {}
    for mutant in (mutant for path in files for mutant in mutants_of(path)):
        lines.setdefault((mutant.file, mutant.line), []).append(mutant)
    rng = random.Random(seed)
    chosen = rng.sample(sorted(lines), min(count, len(lines)))
    return [rng.choice(lines[line]) for line in chosen]


def rooms_of(mutant: Mutant) -> tuple[str, ...]:
    """Return the folders of tests that must notice."""
    parts = mutant.file.split("/")
    room = "/".join(parts[1:3]) if parts[1] == "extensions" else parts[1]
    rooms = ROOMS.get(room, (room,)) if parts[0] == "opencl" else (room,)
    there = [each for each in rooms if (CHECKOUT / "tests" / each).is_dir()]
    return tuple(there) or tuple(f"extensions/{each}" for each in rooms)


def make_copy(folder: Path, mutant: Mutant | None) -> dict[str, str]:
    """Lay the package, as it is installed, and its tests into a folder; return the environment."""
    package = folder / "site" / "pyvista_vdi"
    shutil.copytree(CHECKOUT / "pyvista_vdi", package, ignore=shutil.ignore_patterns("opencl"))
    shutil.copytree(CHECKOUT / "opencl", package / "opencl")
    for name in ("tests", "docs", "examples"):
        shutil.copytree(CHECKOUT / name, folder / name)
    shutil.copy(CHECKOUT / "pyproject.toml", folder)
    if mutant is not None:
        root, _, inside = mutant.file.partition("/")
        path = (package / "opencl" if root == "opencl" else package) / inside
        text = path.read_text(encoding="utf-8")
        changed = text[: mutant.at] + mutant.new + text[mutant.at + len(mutant.old) :]
        path.write_text(changed, encoding="utf-8")
    return {**os.environ, "PYTHONPATH": str(folder / "site"), "PYTHONDONTWRITEBYTECODE": "1"}


def tests_fail(mutant: Mutant | None, rooms: tuple[str, ...], options: argparse.Namespace) -> bool:
    """Whether the tests of rooms, in a tier, fail with a mutant."""
    with tempfile.TemporaryDirectory() as name:
        environment = make_copy(Path(name), mutant)
        if options.device:
            environment["PYVISTA_VDI_TEST_DEVICES"] = options.device
        command = [sys.executable, "-m", "pytest", "-q", "-x", "-n0", "-p", "no:cacheprovider"]
        try:
            done = subprocess.run(
                [*command, "-m", TIERS[options.tier], *(f"tests/{room}" for room in rooms)],
                cwd=name,
                env=environment,
                capture_output=True,
                text=True,
                check=False,
                timeout=None if mutant is None else options.patience,
            )
        except subprocess.TimeoutExpired:  # a kernel that never ends
            return True
    if mutant is None and done.returncode:
        print(done.stdout[-3000:], done.stderr[-2000:])
    # A kernel that reads beyond its memory may crash: below 0. Of a module that many import, 4
    return done.returncode != 0


def main() -> None:
    """Run the tests on every mutant that is drawn, and print which live."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("places", nargs="*", help="folders or files, of the checkout")
    parser.add_argument("--count", type=int, default=20, help="how many changes (20)")
    parser.add_argument("--seed", type=int, default=0, help="of the draw (0)")
    parser.add_argument("--tier", choices=TIERS, default="fast")
    parser.add_argument("--device", help="parts of devices' names, as PYVISTA_VDI_TEST_DEVICES")
    parser.add_argument("--patience", type=float, default=1800, help="seconds until one hangs")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="at a time")
    parser.add_argument("--list", action="store_true", help="print what is drawn, and run nothing")
    options = parser.parse_args()
    chosen = drawn(options.places or list(FOLDERS), options.count, options.seed)
    if options.list:
        print(*chosen, sep="\n")
        return
    for room in sorted({room for mutant in chosen for room in rooms_of(mutant)}):
        if tests_fail(None, (room,), options):
            raise SystemExit(f"tests/{room} fails without a mutant: nothing can be said")

    def try_out(mutant: Mutant) -> bool:
        killed = tests_fail(mutant, rooms_of(mutant), options)
        print(f"{'killed' if killed else 'LIVES':8}{mutant}", flush=True)
        return killed

    with ThreadPoolExecutor(options.jobs) as pool:
        killed = list(pool.map(try_out, chosen))
    print(f"tier {options.tier}: {sum(killed)} of {len(killed)} killed")


if __name__ == "__main__":
    main()
