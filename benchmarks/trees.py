"""Two trees, the one that this file is in and another: frames, generation, bits.

    python benchmarks/trees.py --other ../other-worktree
    python benchmarks/trees.py --switch "no prefetch"    # this tree, with another text of kernels

Each tree runs in a process of its own that does one thing when told to; the two take turns, and the
pictures' bits are compared. A ratio is this tree's time over the other one's, turn by turn; times
are CPU time, which other work on the machine disturbs least, and wall clock. Chance: that noise
separates the two as much (rank sum).
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from scipy.stats import mannwhitneyu
from shared import CHECKOUT, LOOKS, Case, Results, execute, mean_of, parser_of, table

from pyvista_vdi.measure import bench

#: A sample has these, which differ most in what their rays meet.
VOLUMES = ("brain", "heptane", "rayleigh_taylor", "visible_female_head")
ANGLES = (0.0, 5.0, 30.0, 90.0)
CLOCKS = ("cpu", "wall")

#: Regular expressions for texts of kernels, and what may stand in their place.
SWITCHES = {
    "no prefetch": (r"prefetch\(words \+ k, 1\);", ";"),
    "16-byte loads of media": (
        r"two_floats\(lists->media\[2 \* entry\]\),\s*two_floats\(.*\)",
        "vload4(entry, (__global const float *)lists->media))",
    ),
}

#: Reads orders, a JSON a line: what, volume, look, size, angle, options. By public names alone.
WORKER = """
import hashlib, json, sys, time
import pyvista_vdi as pvdi
from pyvista_vdi.model.standard_cases import filling_camera

made, key = {}, None
for line in sys.stdin:
    order = json.loads(line)
    now = order["volume"], order["look"]
    if now != key:
        made.clear()
        key = now
        made["volume"] = pvdi.examples.load_data(order["volume"], as_volume=True)
    size, device = order["size"], order["device"]
    view = filling_camera(made["volume"].bounds, size)
    def generate():
        return pvdi.generate(made["volume"], view, size, device=device, **order["look"])
    if order["what"] == "frame":
        if "vdi" not in made:
            made["vdi"] = generate()
        camera = view.azimuth(order["angle"])
        def work():
            return pvdi.render(made["vdi"], camera, size, device=device)
    elif order["what"] == "render_volume":
        camera = view.azimuth(order["angle"])
        def work():
            return pvdi.render_volume(made["volume"], camera, size, device=device, **order["look"])
    else:
        work = generate
    cpu, wall = time.process_time(), time.perf_counter()
    found = work()
    times = {"cpu": time.process_time() - cpu, "wall": time.perf_counter() - wall}
    arrays = [found] if hasattr(found, "tobytes") else [
        getattr(found, name) for name in ("offsets", "front", "back", "color", "optical_depth")]
    bits = hashlib.sha1(b"".join(array.tobytes() for array in arrays)).hexdigest()
    print(json.dumps({**times, "bits": bits}), flush=True)
"""


def importable(tree: Path, folder: Path) -> dict[str, Any]:
    """Return where and with what a process runs the package of a tree, kernels in their place."""
    package = folder / "pyvista_vdi"
    package.mkdir(parents=True)
    for path in (*(tree / "pyvista_vdi").resolve().iterdir(), (tree / "opencl").resolve()):
        if not (package / path.name).exists():
            (package / path.name).symlink_to(path)
    first = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    return {"cwd": folder, "env": {**os.environ, "PYTHONPATH": first}, "text": True}


def switched(tree: Path, folder: Path, old: str, new: str) -> Path:
    """Return a tree with another text in its kernels."""
    shutil.copytree(tree / "opencl", folder / "opencl")
    (folder / "pyvista_vdi").symlink_to((tree / "pyvista_vdi").resolve())
    changed = 0
    for path in folder.rglob("*.cl"):
        text, count = re.subn(old, new, path.read_text())
        path.write_text(text)
        changed += count
    if not changed:
        raise SystemExit(f"no kernel has {old!r} any more: change SWITCHES")
    return folder


class Worker:
    """A process that works with the package of a tree."""

    def __init__(self, where: dict[str, Any]) -> None:
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        self._process = subprocess.Popen([sys.executable, "-c", WORKER], **pipes, **where)

    def ask(self, **order: Any) -> dict[str, Any]:
        """Give an order and return the answer."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(json.dumps(order), file=self._process.stdin, flush=True)
        answer = self._process.stdout.readline()
        if not answer:
            raise RuntimeError(f"the process ended at {order}")
        return dict(json.loads(answer))

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and write what was found."""
    parser = parser_of(__doc__, size=(1280, 720), volumes=VOLUMES, repeats=5)
    parser.add_argument("--other", type=Path, default=CHECKOUT, help="root of the other tree")
    parser.add_argument("--switch", choices=SWITCHES, help="change the text of its kernels")
    options = parser.parse_args(arguments)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        roots = {"this": CHECKOUT, "other": options.other}
        if options.switch is not None:
            roots["other"] = switched(options.other, folder / "switched", *SWITCHES[options.switch])
        where = {name: importable(root, folder / name) for name, root in roots.items()}
        trees = {name: Worker(of) for name, of in where.items()}
        for worker in trees.values():
            stack.callback(worker.close)

        def once(name: str, case: Case) -> dict[str, Any]:
            given = {"size": list(options.size), "device": options.device}
            given |= {"volume": case.volume, "look": LOOKS[case.look or ""], "what": case.what}
            return trees[name].ask(angle=case.angle, **given)

        def measure(case: Case) -> dict[str, Any]:
            bits = {name: once(name, case)["bits"] for name in roots}  # caches are filled
            times: dict[str, dict[str, list[float]]] = {n: {c: [] for c in CLOCKS} for n in roots}
            for _ in range(options.repeats):
                for name in roots:
                    found = once(name, case)
                    for clock in CLOCKS:
                        times[name][clock].append(found[clock])
            return {"times": times, "same": bits["this"] == bits["other"]}

        execute("trees", options, cases_of(options), measure, report, count=16)
    return 0


def cases_of(options: Any) -> Iterator[Case]:
    """Yield every case."""
    size = tuple(options.size)
    for volume in options.volumes:
        for look in ("soft", "steep"):
            yield Case(volume, look, size, what="generation")
            yield Case(volume, look, size, 5.0, what="render_volume")
            for angle in ANGLES:
                yield Case(volume, look, size, angle, what="frame")


def ratio(row: dict[str, Any], clock: str = "cpu") -> float:
    """Return the median over the turns of this tree's time over the other's."""
    times = row["times"]
    return bench.ratio(times["this"][clock], times["other"][clock])


def report(results: Results, every: list[Case]) -> Iterator[str]:
    """Yield a line for each case, and the means."""
    yield f"This tree's time over that of {results.plan['other']}, medians of turns."
    yield ""
    rows = []
    for row in results.rows():
        case, times = row["case"], row["times"]
        chance = mannwhitneyu(*(times[who]["cpu"] for who in ("this", "other"))).pvalue
        cells = [case["what"], case["volume"], case["look"], case.get("angle", "")]
        cells += [f"{ratio(row, clock):.3f}" for clock in CLOCKS]
        rows.append([*cells, f"{chance:.1%}", "the same" if row["same"] else "**differ**"])
    heads = ("what", "volume", "look", "degrees", "CPU time", "wall clock", "chance", "bits")
    yield from table(heads, rows)
    yield ""
    kinds = dict.fromkeys(case.what for case in every)
    means = [[what, mean_of(results, every, ratio, what=what)] for what in kinds]
    yield from table(("mean of all cases", "CPU time"), means)


if __name__ == "__main__":
    sys.exit(main())
