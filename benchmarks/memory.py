"""Memory while a VDI is made and drawn, over that of the volume and the VDI.

Each volume has a process of its own, which makes and draws a small VDI of a small volume of the
same type first, so that neither Python nor the driver and its programs count. From then on two
peaks are taken, each while the VDI is generated and while it is drawn: what the process has in
memory (its resident set; on a CPU device that is all), and what the device holds
(``Runtime.peak_allocated``; arrays that a CPU device uses in place count nothing there). Memory
that was freed is handed back to the system before each. Linux with glibc only. Prints a table, or
with ``--json`` the figures.
"""

from __future__ import annotations

import argparse
import ctypes
import gc
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from common import (  # beside this file
    add_looks,
    add_size,
    add_volumes,
    at_hand,
    looks_of,
    new_parser,
)

from pyvista_vdi import Volume, examples
from pyvista_vdi.api import render
from pyvista_vdi.device import get_runtime
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.measure.report import table
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.packing import PRECISIONS
from pyvista_vdi.model.standard_cases import filling_camera

VOLUMES = ("visible_female_head", "heptane", "rayleigh_taylor")


def main() -> int:
    """Measure each volume in a process of its own."""
    options = parsed()
    if options.child:
        print(json.dumps(measured(options.volumes[0], options)))
        return 0
    rows = {}
    for name in at_hand(options.volumes):
        command = [sys.executable, __file__, *sys.argv[1:], "--volumes", name, "--child"]
        rows[name] = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    if options.json:
        print(json.dumps(rows, indent=1))
        return 0
    heads = ("volume", "volume, MiB", "VDI, MiB", "generate", "render", "both", "device, MiB")
    print("\n".join(table(heads, (cells(name, row) for name, row in rows.items()))))
    return 0


def parsed() -> argparse.Namespace:
    """Return the options."""
    parser = new_parser(__doc__, writes=False)
    add_volumes(parser, VOLUMES)
    add_size(parser)
    add_looks(parser, max_supersegments=None)
    parser.add_argument("--precision", choices=PRECISIONS, default="exact")
    parser.add_argument("--memory-limit", metavar="SIZE", help="as of pyvista-vdi generate")
    parser.add_argument("--json", action="store_true", help="print all figures")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    return parser.parse_args()


def measured(name: str, options: argparse.Namespace) -> dict[str, Any]:
    """Return the bytes of a volume, its VDI, and the peaks above what was there before."""
    dtype = examples.load_data(name, as_volume=True).array.dtype
    drawn(Volume(np.indices((40, 40, 40)).sum(axis=0).astype(dtype)), (64, 48), options)
    forget_peak()
    before = resident()
    volume = examples.load_data(name, as_volume=True)
    return {"volume": volume.array.nbytes, **drawn(volume, options.size, options, before)}


def drawn(
    volume: Volume, size: tuple[int, int], options: argparse.Namespace, before: int = 0
) -> dict[str, Any]:
    """Generate a VDI and draw it from another view; return its bytes and the peaks."""
    runtime = get_runtime(options.device)
    classified = Classification(looks_of(options), "a benchmark").transfer_function(volume)
    view = filling_camera(volume.bounds, size)
    forget_peak()
    vdi = generate_vdi(
        volume,
        view,
        size,
        classified,
        precision=options.precision,
        memory_limit=options.memory_limit,
        device=runtime,
    )
    generating = resident("VmHWM") - before
    forget_peak()
    render(vdi, view.azimuth(5), device=runtime)
    return {
        "vdi": vdi.nbytes,
        "generate": generating,
        "render": resident("VmHWM") - before,
        "device": runtime.peak_allocated,
    }


def cells(name: str, row: dict[str, Any]) -> list[str]:
    """Return a row of the table: bytes, and peaks as multiples of the volume and the VDI."""
    whole = row["volume"] + row["vdi"]
    peaks = [row["generate"], row["render"], max(row["generate"], row["render"])]
    sizes = [f"{row[kind] / 2**20:.0f}" for kind in ("volume", "vdi", "device")]
    return [name, *sizes[:2], *(f"{peak / whole:.2f}" for peak in peaks), sizes[2]]


def resident(which: str = "VmRSS") -> int:
    """Return what the process has in memory, or with ``"VmHWM"`` had at most; bytes."""
    lines = Path("/proc/self/status").read_text().splitlines()
    (line,) = (line for line in lines if line.startswith(f"{which}:"))
    return int(line.split()[1]) * 1024


def forget_peak() -> None:
    """Hand back what was freed, and let the peak begin anew."""
    gc.collect()
    ctypes.CDLL("libc.so.6").malloc_trim(0)
    Path("/proc/self/clear_refs").write_text("5")


if __name__ == "__main__":
    sys.exit(main())
