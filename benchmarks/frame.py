"""What a frame costs around its raycast, and the first picture of a process.

    python benchmarks/frame.py
    python benchmarks/frame.py --vdi-cache FOLDER --repeats 21

Writes ``frame_WxH.json`` (all figures) and ``.md`` (the tables). See README.md in this folder.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyvista as pv
from common import (  # beside this file
    add_looks,
    add_size,
    add_vdi_cache,
    new_parser,
    save,
    vdi_of,
)

from pyvista_vdi.cli.declare import parse_size
from pyvista_vdi.device import Runtime, get_runtime
from pyvista_vdi.measure.report import describe_system, table, write_text
from pyvista_vdi.model.vdi import VDI

#: Degrees by which the camera turns from frame to frame where it moves.
TURN = 0.01

#: Scenes: whether the VDI is in it, and an opaque sphere in the VDI's middle.
SCENES = {
    "empty": (False, False),
    "VDI": (True, False),
    "sphere": (False, True),
    "VDI and sphere": (True, True),
}

#: What each process of the second table draws, after PyVista has been imported.
FIRST_PICTURES = {
    "empty": "plotter = pv.Plotter(off_screen=True)",
    "add_volume, brain": """
import pyvista_vdi
plotter = pv.Plotter(off_screen=True)
plotter.add_volume(pyvista_vdi.examples.load_brain(), cmap="bone")
""",
    "add_vdi, brain": """
import pyvista_vdi
plotter = pv.Plotter(off_screen=True)
plotter.add_vdi(pyvista_vdi.examples.load_brain(), cmap="bone")
""",
    "add_vdi, examples/plotter.py": """
import sys
sys.path.insert(0, {examples!r})
import plotter as example
plotter = pv.Plotter(off_screen=True, window_size=(640, 480))
plotter.add_vdi(example.soft_ball(), cmap="viridis", opacity=[0, 0.02, 0.1, 0.4, 0.8])
plotter.add_mesh(pv.Sphere(radius=0.35, center=(-0.5, 0.35, -0.1)), color="white")
""",
    "add_vdi, a saved VDI": """
import pyvista_vdi
plotter = pv.Plotter(off_screen=True)
plotter.add_vdi(pyvista_vdi.read({saved!r}), regenerate="never")
""",
}

_BEFORE = """
import time
began = time.perf_counter()
import pyvista as pv
"""

_AFTER = """
image = plotter.screenshot(return_img=True)
import json
print(json.dumps([time.process_time(), time.perf_counter() - began, float(image.std())]))
"""

LEGEND = (
    "Over the frame of the same scene without the VDI (of the empty scene, in `whole`), in turns, "
    "by the process's CPU time (in brackets by the wall clock). `around`: the frame less the time "
    "from the raycast's launch to its end. `at rest`: nothing has changed since the last frame."
)


def main() -> None:
    """Measure, and write what was found."""
    options = parsed()
    vdi = vdi_of(options.volume, options)
    frames = {str(samples): frame_costs(vdi, options, samples) for samples in options.multi_samples}
    width, height = options.frame
    saved = options.out / f"frame_{width}x{height}.vdi"
    options.out.mkdir(parents=True, exist_ok=True)
    try:
        vdi.save(saved)
        first = {} if options.no_first else first_pictures(saved, options.first_repeats)
    finally:
        saved.unlink(missing_ok=True)
    results = {
        "frame": list(options.frame),
        "volume": options.volume,
        "repeats": options.repeats,
        "system": describe_system(options.device),
        "frames": frames,
        "first_pictures": first,
    }
    target = options.out / f"frame_{width}x{height}.json"
    save(results, target)
    text = tables(results)
    write_text(target.with_suffix(".md"), text)
    print(text)


# -- frames ----------------------------------------------------------------------------------------


class Raycasts:
    """CPU and wall time from a launch to the end of the wait that follows it."""

    def __init__(self) -> None:
        self.cpu = self.wall = 0.0
        self._began: tuple[float, float] | None = None
        launch, finish = Runtime.launch, Runtime.finish

        def launched(runtime: Runtime, *args: Any, **options: Any) -> None:
            self._began = self._began or (time.process_time(), time.perf_counter())
            launch(runtime, *args, **options)

        def finished(runtime: Runtime) -> None:
            finish(runtime)
            if self._began is not None:
                self.cpu += time.process_time() - self._began[0]
                self.wall += time.perf_counter() - self._began[1]
                self._began = None

        Runtime.launch, Runtime.finish = launched, finished  # type: ignore[method-assign]

    def taken(self) -> tuple[float, float]:
        """Return what was measured since the last call."""
        found, self.cpu, self.wall = (self.cpu, self.wall), 0.0, 0.0
        return found


def frame_costs(vdi: VDI, options: argparse.Namespace, samples: int) -> dict[str, Any]:
    """Return medians in milliseconds of each scene's frames, at rest and moving."""
    plotters = {name: scene(vdi, options, samples, *what) for name, what in SCENES.items()}
    raycasts = Raycasts()
    taken: dict[tuple[str, str], list[tuple[float, float, float, float]]] = {}
    for repeat in range(options.repeats + 1):
        for name, plotter in plotters.items():
            for mode, turn in (("move", TURN), ("rest", 0.0)):
                if turn:
                    plotter.camera.azimuth += turn
                raycasts.taken()
                cpu, wall = time.process_time(), time.perf_counter()
                plotter.render_window.Render()
                plotter.render_window.WaitForCompletion()
                times = time.process_time() - cpu, time.perf_counter() - wall
                if repeat:
                    taken.setdefault((name, mode), []).append((*times, *raycasts.taken()))
    effective = plotters["empty"].render_window.GetMultiSamples()
    for plotter in plotters.values():
        plotter.close()
    columns = ("cpu_ms", "wall_ms", "raycast_cpu_ms", "raycast_wall_ms")
    return {
        "samples": effective,
        **{
            f"{name}, {mode}": {
                column: 1e3 * statistics.median(values)
                for column, values in zip(columns, zip(*runs, strict=True), strict=True)
            }
            for (name, mode), runs in taken.items()
        },
    }


def scene(
    vdi: VDI, options: argparse.Namespace, samples: int, shown: bool, sphere: bool
) -> pv.Plotter:
    """Return a plotter that has drawn its first frames, from the VDI's own view."""
    plotter = pv.Plotter(window_size=options.frame, off_screen=True)
    if samples >= 0:
        plotter.render_window.SetMultiSamples(samples)
    low, high = vdi.bounds[::2], vdi.bounds[1::2]
    if shown:
        plotter.add_vdi(vdi, show_scalar_bar=False, regenerate="never", device=options.device)
    if sphere:
        centre = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
        plotter.add_mesh(pv.Sphere(radius=(high[0] - low[0]) / 5, center=centre), color="w")
    camera = vdi.camera
    plotter.camera_position = (camera.position, camera.focal_point, camera.view_up)
    plotter.camera.view_angle = camera.view_angle
    plotter.renderer.ResetCameraClippingRange(vdi.bounds)
    plotter.show(auto_close=False)
    return plotter


# -- first pictures --------------------------------------------------------------------------------


def first_pictures(saved: Path, repeats: int) -> dict[str, Any]:
    """Return medians in seconds of processes that draw one picture, in turns, caches warm."""
    folder = str(Path(__file__).resolve().parent.parent / "examples")
    programs = {
        name: _BEFORE + text.format(examples=folder, saved=str(saved)) + _AFTER
        for name, text in FIRST_PICTURES.items()
    }
    # Python's own cache of byte code is a part of what is warm, as after an installation by pip
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    runs: dict[str, list[tuple[float, float]]] = {name: [] for name in programs}
    for repeat in range(repeats + 1):
        for name, program in programs.items():
            done = subprocess.run(
                [sys.executable, "-c", program],
                env=environment,
                capture_output=True,
                text=True,
                check=True,
            )
            cpu, wall, contrast = json.loads(done.stdout.splitlines()[-1])
            if (contrast > 0) == (name == "empty"):
                sys.exit(f"the picture of {name!r} is not what it should be")
            if repeat:
                runs[name].append((cpu, wall))
    return {
        name: {
            "cpu_s": statistics.median(cpu for cpu, _ in taken),
            "wall_s": statistics.median(wall for _, wall in taken),
        }
        for name, taken in runs.items()
    }


# -- tables ----------------------------------------------------------------------------------------


def tables(results: dict[str, Any]) -> str:
    """Return the figures as Markdown: ratios."""
    width, height = results["frame"]
    lines = [f"# Around the raycast, {width} x {height}", "", LEGEND, ""]
    rows = []
    for found in results["frames"].values():
        for name, peer in (("VDI", "empty"), ("VDI and sphere", "sphere")):
            for mode, said in (("rest", "at rest"), ("move", "moving")):
                row, other = found[f"{name}, {mode}"], found[f"{peer}, {mode}"]
                empty = found[f"empty, {mode}"]
                cells = [ratio(around, row, base) for base in (other, empty)]
                whole = ratio(lambda x, key: x[key], row, empty)
                rows.append([found["samples"], name, said, *cells, whole])
    heads = ("samples", "scene", "", "around", "around / empty", "whole / empty")
    lines += table(heads, rows)
    if results["first_pictures"]:
        lines += ["", "First picture of a process, over PyVista's import and an empty one:", ""]
        empty = results["first_pictures"]["empty"]
        rows = [
            [name, *(f"{row[key] / empty[key]:.2f}" for key in ("cpu_s", "wall_s"))]
            for name, row in results["first_pictures"].items()
        ]
        lines += table(("what", "CPU time", "wall clock"), rows)
    return "\n".join(lines) + "\n"


def around(row: dict[str, float], key: str) -> float:
    """Return a frame's time without its raycast."""
    return row[key] - row[f"raycast_{key}"]


def ratio(
    value: Callable[[dict[str, float], str], float], row: dict[str, float], base: dict[str, float]
) -> str:
    """Return a value over that of another frame, by CPU time and by the wall clock."""
    cpu, wall = (value(row, key) / base[key] for key in ("cpu_ms", "wall_ms"))
    return f"{cpu:.2f} ({wall:.2f})"


def parsed() -> argparse.Namespace:
    """Return the options."""
    parser = new_parser(__doc__, repeats=15, repeated="frames of each kind")
    parser.add_argument("--frame", type=parse_size, default=(1920, 1080), metavar="WxH")
    parser.add_argument("--volume", default="rayleigh_taylor")
    add_looks(parser, interpolation=None)
    add_size(parser)
    parser.add_argument(
        "--multi-samples", type=int, nargs="+", default=(-1, 0), help="-1: PyVista's default"
    )
    parser.add_argument("--first-repeats", type=int, default=5, help="processes of each kind")
    parser.add_argument("--no-first", action="store_true", help="leave the processes out")
    add_vdi_cache(parser)
    options = parser.parse_args()
    get_runtime(options.device)  # a missing device is said at once
    return options


if __name__ == "__main__":
    main()
