"""The raycaster of this tree against that of another one: CPU time of frames, in turns.

    python benchmarks/trees.py --other ../other-worktree --vdis brain.vdi heptane.vdi

Each tree runs in a process of its own, which loads every VDI and then draws one frame at a time
when told to; the two take turns. Frames stay on the device, in one image, as a plotter's do.
Compared are the medians of CPU time, which other work on the machine disturbs least on a CPU
device, and the pictures' bits. Ratios are the other tree's over this one's, those of preparation
time and device bytes too.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

WORKER = """
import hashlib, sys, time
import pyvista_vdi
from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.raycasting.raycast import draw
from pyvista_vdi.device import get_runtime
from pyvista_vdi.raycasting.prepared import PreparedVDI

runtime = get_runtime(sys.argv[1] or None)
size = None
for line in sys.stdin:
    order, _, rest = line.strip().partition(" ")
    if order == "load":
        precision, _, path = rest.partition(" ")
        vdi = pyvista_vdi.read(path).with_precision(precision)
        size = vdi.window_size
        prepared = PreparedVDI(runtime, vdi)  # builds the kernels, too
        began = time.process_time()
        prepared = PreparedVDI(runtime, vdi)
        print(time.process_time() - began, prepared.list_bytes, flush=True)
        image = runtime.buffer((size[1], size[0], 4), name="image")
        continue
    camera = vdi.camera.azimuth(float(rest))
    began = time.process_time()
    draw(prepared, FrameRequest(camera, size), image)
    took = time.process_time() - began
    bits = ""
    if order == "bits":
        bits = hashlib.sha1(runtime.download(image).tobytes()).hexdigest()
    print(took, bits, flush=True)
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the benchmark and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--other", type=Path, required=True, help="root of the other tree")
    parser.add_argument("--vdis", type=Path, nargs="+", required=True)
    parser.add_argument("--angles", type=float, nargs="+", default=[0, 5, 30, 90])
    parser.add_argument("--precision", default="exact")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--device", default="")
    options = parser.parse_args(arguments)
    trees = {
        "other": Worker(options.other, options.device),
        "this": Worker(Path(__file__).resolve().parent.parent, options.device),
    }
    angles = " | ".join(f"{angle:g}°" for angle in options.angles)
    print(f"| VDI | {angles} | bits | preparation | bytes |")
    print("|---" * (len(options.angles) + 4) + "|")
    for path in options.vdis:
        loads = {
            name: [float(x) for x in tree.ask(f"load {options.precision} {path.resolve()}")]
            for name, tree in trees.items()
        }
        cells, same = [], True
        for angle in options.angles:
            bits = {name: tree.ask(f"bits {angle}")[1] for name, tree in trees.items()}
            same = same and bits["this"] == bits["other"]
            times: dict[str, list[float]] = {name: [] for name in trees}
            for _ in range(options.repeats):
                for name, tree in trees.items():
                    times[name].append(float(tree.ask(f"time {angle}")[0]))
            medians = {name: statistics.median(taken) for name, taken in times.items()}
            cells.append(f"{medians['other'] / medians['this']:.2f}")
        cells.append("the same" if same else "**differ**")
        cells += [f"{loads['other'][k] / loads['this'][k]:.2f}" for k in (0, 1)]
        print(f"| {path.stem} | {' | '.join(cells)} |", flush=True)
    return 0


class Worker:
    """A process that draws with the package of a tree.

    Parameters
    ----------
    tree : pathlib.Path
        Root of the tree.
    device : str
        As for :func:`pyvista_vdi.list_devices`; empty for the default.
    """

    def __init__(self, tree: Path, device: str) -> None:
        environment = {**os.environ, "PYTHONPATH": str(tree.resolve())}
        self._process = subprocess.Popen(
            [sys.executable, "-c", WORKER, device],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
            cwd=tree.resolve(),
        )

    def ask(self, order: str) -> list[str]:
        """Give an order and return the words of the answer, a missing one as an empty string."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(order, file=self._process.stdin, flush=True)
        answer = self._process.stdout.readline()
        if not answer:
            raise RuntimeError(f"the process ended at {order!r}")
        first, _, second = answer.rstrip("\n").partition(" ")
        return [first, second]


if __name__ == "__main__":
    sys.exit(main())
