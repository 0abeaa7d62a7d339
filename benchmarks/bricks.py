"""What generating a VDI brick by brick costs, over generating it in one piece.

Takes turns between one piece and each memory limit, checks that every bit is the same, and prints a
table of ratios, by wall clock and by the process's CPU time (on a GPU the latter says nothing).
"""

from __future__ import annotations

import argparse
import sys

from common import (  # beside this file
    add_looks,
    add_size,
    add_volumes,
    at_hand,
    new_parser,
    subject_of,
    timed,
)

from pyvista_vdi import VDI
from pyvista_vdi.generation.estimate import estimate
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.measure.report import table


def main() -> int:
    """Measure, and print what was found; 1 if a bit differs."""
    options = parsed()
    rows = []
    for name in at_hand(options.volumes):
        volume, classified, view = subject_of(name, options)

        def made(limit: str | None) -> VDI:
            return generate_vdi(
                volume,  # noqa: B023 (called before the next turn of the loop)
                view,  # noqa: B023
                options.size,
                classified,  # noqa: B023
                sample_distance=min(volume.spacing),  # noqa: B023
                memory_limit=limit,
                device=options.device,
            )

        whole = made(None)
        if not all(made(limit).equals(whole) for limit in options.limits):
            print(f"{name}: not the same VDI", file=sys.stderr)
            return 1
        times = timed(
            {limit or "": lambda limit=limit: made(limit) for limit in (None, *options.limits)},
            options.repeats,
        )
        for limit in options.limits:
            share = estimate(volume, options.size, memory_limit=limit).volume / volume.array.nbytes
            ratios = (
                f"{times[limit][clock]['median'] / times[''][clock]['median']:.2f}"
                for clock in ("wall", "cpu")
            )
            rows.append([name, limit, f"{share:.2f}", *ratios])
    heads = ("volume", "memory_limit", "bricks / volume, bytes", "wall clock", "CPU time")
    print("\n".join(table(heads, rows)))
    return 0


def parsed() -> argparse.Namespace:
    """Return the options."""
    parser = new_parser(__doc__, repeats=5, repeated="how often each is generated", writes=False)
    add_volumes(parser, ["brain"])
    add_size(parser, (320, 180))
    parser.add_argument("--limits", nargs="+", default=["12 MiB", "14 MiB"], metavar="SIZE")
    add_looks(parser, max_supersegments=None)
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
