"""Which mistakes the tests of a tier notice: each mutant of `mutant_list.py` is one changed place.

    python tools/mutants.py                          # -m fast
    python tools/mutants.py --tier default --only march --only merge
    python tools/mutants.py --tier device --device portable

Each mutant is made in a copy of the checkout, which the tests of the rooms concerned import in
place of the installed package. It counts as killed if they fail, and only where they pass on the
unchanged copy. Needs an environment in which the tests run; the status is 0 whatever survives.
"""

# ruff: noqa: T201
from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from mutant_list import MUTANTS, Mutant

CHECKOUT = Path(__file__).resolve().parents[1]

#: How pytest is asked for the tests of each tier.
TIERS = {"fast": "fast", "default": "not slow and not paraview", "device": "device"}


def make_copy(folder: Path, mutant: Mutant | None) -> dict[str, str]:
    """Lay the package, as it is installed, and its tests into a folder; return the environment."""
    package = folder / "site" / "pyvista_vdi"
    shutil.copytree(CHECKOUT / "pyvista_vdi", package, ignore=shutil.ignore_patterns("opencl"))
    shutil.copytree(CHECKOUT / "opencl", package / "opencl")
    for name in ("tests", "docs", "examples"):
        shutil.copytree(CHECKOUT / name, folder / name)
    shutil.copy(CHECKOUT / "pyproject.toml", folder)
    if mutant is not None:
        room, _, inside = mutant.file.partition("/")
        path = (package / "opencl" if room == "opencl" else package) / inside
        path.write_text(mutant.changed(path.read_text()))
    return {**os.environ, "PYTHONPATH": str(folder / "site"), "PYTHONDONTWRITEBYTECODE": "1"}


def tests_fail(mutant: Mutant | None, rooms: tuple[str, ...], options: argparse.Namespace) -> bool:
    """Whether the tests of rooms, in a tier, fail with a mutant."""
    with tempfile.TemporaryDirectory() as name:
        environment = make_copy(Path(name), mutant)
        if options.device:
            environment["PYVISTA_VDI_TEST_DEVICES"] = options.device
        command = [sys.executable, "-m", "pytest", "-q", "-n0", "-p", "no:cacheprovider"]
        command += ["-x"] if mutant is not None else []
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
    if done.returncode > 1:  # interrupted, or not a test was run
        raise SystemExit(f"pytest ends with {done.returncode}:\n{done.stdout[-2000:]}{done.stderr}")
    if mutant is None and done.returncode:
        print(done.stdout[-3000:])
    return done.returncode != 0  # a kernel that reads beyond its memory may crash: below 0


def main() -> None:
    """Run the tests on every mutant that was asked for, and print which survive."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--tier", choices=TIERS, default="fast")
    parser.add_argument("--device", help="parts of devices' names, as PYVISTA_VDI_TEST_DEVICES")
    parser.add_argument("--only", action="append", help="mutants with this in their name or file")
    parser.add_argument(
        "--patience", type=float, default=1800, help="seconds after which a mutant hangs: killed"
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="at a time")
    options = parser.parse_args()
    chosen = [
        mutant
        for mutant in MUTANTS
        if any(text in f"{mutant.name} {mutant.file}" for text in options.only or [""])
    ]
    for each in sorted({room for mutant in chosen for room in mutant.rooms}):
        if tests_fail(None, (each,), options):
            raise SystemExit(f"tests/{each} fails without a mutant: nothing can be said")

    def try_out(mutant: Mutant) -> bool:
        began = time.monotonic()
        killed = tests_fail(mutant, mutant.rooms, options)
        word = "killed" if killed else "LIVES"
        print(f"{word:8}{time.monotonic() - began:5.0f} s  {mutant.name}", flush=True)
        return killed

    with ThreadPoolExecutor(options.jobs) as pool:
        killed = list(pool.map(try_out, chosen))
    print(f"tier {options.tier}: {sum(killed)} of {len(killed)} killed; alive:")
    print("\n".join(f"  {m.name}" for m, dead in zip(chosen, killed, strict=True) if not dead))


if __name__ == "__main__":
    main()
