"""What generation costs over volume rendering, and volume rendering over VTK's two mappers.

    python benchmarks/generation.py
    python benchmarks/generation.py --volumes brain tooth --repeats 5

At steps of half a voxel from V_O, without stopping at what is opaque: generation, and
``render_volume`` with and without passing by empty blocks. At steps of one voxel, 5 degrees from
V_O: ``render_volume`` as it is by default, and VTK's mappers. Candidates take turns; a ratio is the
median over the turns of two candidates' times in the same turn, by wall clock and by the
process's CPU time, which a machine that does other work distorts less. Writes
``generation_WxH.json`` (all figures) and ``.md`` (the table). See README.md in this folder.
"""

from __future__ import annotations

import argparse
import statistics
import sys
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from typing import Any

from common import (  # beside this file
    BOTH_CLOCKS,
    Subject,
    add_looks,
    add_redo,
    add_size,
    add_volumes,
    at_hand,
    looks_of,
    measure_missing,
    new_parser,
    subject_of,
)

from pyvista_vdi.api import render_volume
from pyvista_vdi.device import get_runtime
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.measure.clock import take_turns
from pyvista_vdi.measure.compare.bounds import FRAME_RATIO_ANGLE
from pyvista_vdi.measure.report import system_line, table
from pyvista_vdi.measure.vtk_baselines import MAPPERS, VTKBaseline, add_volume_property

#: Ratios: title, what is divided, and by which candidate or by the fastest of which.
RATIOS: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "generation": ("generation / render_volume", "generate", ("march",)),
    "generation_plain": ("the same, over all blocks", "generate", ("march_all",)),
    "frame": ("render_volume / faster of VTK's", "frame", MAPPERS),
    "frame_gpu": ("/ GPU mapper", "frame", ("gpu",)),
    "frame_fixed_point": ("/ fixed-point mapper", "frame", ("fixed_point",)),
}

LEGEND = (
    "Ratios of times by wall clock (in brackets by the process's CPU time). The first two at steps "
    "of half a voxel without stopping at what is opaque; the others at steps of one voxel, "
    f"{FRAME_RATIO_ANGLE:g} degrees from V_O."
)

Seconds = dict[str, list[dict[str, float]]]


def main() -> int:
    """Measure what is missing, and write what was found."""
    options = parsed()
    case = {
        "transfer_function": options.tf,
        "interpolation": options.interpolation,
        "max_supersegments": options.max_supersegments,
    }
    measure_missing(
        "generation",
        options,
        case,
        at_hand(options.volumes),
        lambda volume: measured(subject_of(volume, options), options),
        report,
    )
    return 0


def parsed() -> argparse.Namespace:
    """Return the options."""
    parser = new_parser(__doc__, repeats=7, repeated="timed turns")
    add_size(parser)
    add_volumes(parser)
    add_looks(parser)
    add_redo(parser)
    return parser.parse_args()


def measured(subject: Subject, options: argparse.Namespace) -> dict[str, Any]:
    """Measure one volume: seconds of every turn, and the ratios."""
    volume, table, view = subject
    turned = view.azimuth(FRAME_RATIO_ANGLE)
    voxel = min(volume.spacing)
    runtime = get_runtime(options.device)
    march = partial(
        render_volume,
        *(volume, view, options.size),
        transfer_function=table,
        sample_distance=voxel / 2,
        early_termination=False,
        device=runtime,
    )
    generate = partial(
        generate_vdi,
        *(volume, view, options.size, table),
        max_supersegments=options.max_supersegments,
        sample_distance=voxel / 2,
        device=runtime,
    )
    frame = partial(
        render_volume,
        *(volume, turned, options.size),
        transfer_function=table,
        sample_distance=voxel,
        device=runtime,
    )
    candidates: dict[str, Callable[[], object]] = {
        "generate": generate,
        "march": march,
        "march_all": partial(march, skip_empty=False),
        "frame": frame,
    }
    with ExitStack() as stack:
        for mapper in MAPPERS:
            prop = add_volume_property(volume, looks_of(options))
            peer = VTKBaseline(volume, prop, options.size, mapper, voxel)
            stack.callback(peer.close)
            candidates[mapper] = partial(peer.render, turned)
        taken = take_turns(candidates, options.repeats, clocks=BOTH_CLOCKS)
    seconds: Seconds = {
        name: [{"wall": w, "cpu": c} for w, c in zip(t["wall"], t["cpu"], strict=True)]
        for name, t in taken.items()
    }
    return {"seconds": seconds, "ratios": {name: ratio(seconds, name) for name in RATIOS}}


def ratio(seconds: Seconds, name: str) -> dict[str, float]:
    """Median over the turns of one candidate's time over another's, or over the faster one's."""
    _, divided, by = RATIOS[name]
    found = {}
    for clock in ("wall", "cpu"):
        medians = {peer: statistics.median(s[clock] for s in seconds[peer]) for peer in by}
        peer = min(medians, key=lambda p: medians[p])
        pairs = zip(seconds[divided], seconds[peer], strict=True)
        found[clock] = statistics.median(a[clock] / max(b[clock], 1e-9) for a, b in pairs)
    return found


def report(results: dict[str, Any]) -> str:
    """Return the table: a line per volume."""
    width, height = results["window_size"]
    case = ", ".join(
        [
            results["transfer_function"],
            f"{results['interpolation']} sampling",
            f"{results['max_supersegments']} supersegments",
        ]
    )
    lines = [
        f"# Generation and volume rendering, {width}x{height}, {case}",
        "",
        LEGEND,
        "",
    ]
    rows = [
        [name, *(f"{r['wall']:.2f} ({r['cpu']:.2f})" for r in found["ratios"].values())]
        for name, found in sorted(results["volumes"].items())
    ]
    lines += table(("volume", *(title for title, _, _ in RATIOS.values())), rows)
    return "\n".join([*lines, "", system_line(results["system"]), ""])


if __name__ == "__main__":
    sys.exit(main())
