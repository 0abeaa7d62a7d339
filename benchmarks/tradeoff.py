"""What each setting of a VDI costs and gives: the measurements behind ``docs/accuracy.md``.

    PYVISTA_VDI_DATA=/where/the/volumes/are python benchmarks/tradeoff.py

Runs ``pyvista-vdi tradeoff`` for three volumes, and two smaller sweeps for one of them: of what is
swept only on request, and with linear sampling. What is there is gone on with; ``--redo`` measures
anew. Results go into ``benchmarks/results/``.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from pyvista_vdi.cli import main as command

RESULTS = Path(__file__).resolve().parent / "results"

#: Options by name of the results.
RUNS = {
    "brain": (),
    "heptane": (),
    "berea": (),
    "brain-on-request": ("--sweep", "criterion", "view-cone", "sample-distance", "--repeats", "3"),
    "brain-linear": (
        *("--interpolation", "linear", "--repeats", "3"),
        *("--sweep", "max-supersegments=10,40", "lists=0.5,2", "precision=8-byte", "--alone"),
    ),
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
    return failed


if __name__ == "__main__":
    sys.exit(main())
