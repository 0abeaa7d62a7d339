"""Measure what a frame of a VDI costs in a plotter, beside VTK's mappers.

Whole frames of off-screen plotters at PyVista's defaults, `add_vdi(draw="vdi")` beside
`add_volume` with each of VTK's mappers and the same arguments, from V_O, 5 and 30 degrees; the same
without multisampling; and the raycast alone: ours until the picture is on the host, VTK's mappers
in a window of their own without multisampling, at steps of one voxel.

    python benchmarks/frames.py              # five volumes: a sample, below five minutes
    python benchmarks/frames.py --whole

Writes ``frames_WxH.json`` and ``.md`` (``frames_WxH_sample`` for a sample).
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from tqdm import tqdm

from pyvista_vdi.cli.declare import parse_size
from pyvista_vdi.measure.clock import ratios, take_turns
from pyvista_vdi.measure.harness import ROOMS, Bench, Case, Latest, estimate, run, sample
from pyvista_vdi.measure.paper import find_dataset
from pyvista_vdi.measure.report import across, closing, table, write_text
from pyvista_vdi.measure.results import Results
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.standard_cases import (
    ANGLES,
    TRANSFER_FUNCTIONS,
    WINDOW_SIZE,
    filling_camera,
)
from pyvista_vdi.plotting.convert import to_image_data
from pyvista_vdi.vtk_pipeline.filters.view import aim

#: Volumes by what they stand for.
GROUPS = {
    "large": ("visible_female_head", "allen_mouse_brain", "kingsnake_like"),
    "medium": ("aneurism", "bonsai", "embryo", "heptane"),
    "solid": ("berea",),
}
#: What is measured of each; the value is the plotter's multisampling, None for PyVista's default.
WHOLE_FRAMES = {"plotter": None, "plotter without multisampling": 0}
ALONE = "raycast alone"
TITLES = {
    "plotter": "Whole frames of a plotter at PyVista's defaults",
    "plotter without multisampling": "Whole frames without multisampling",
    ALONE: "Raycast alone (ours until the picture is on the host; VTK without multisampling)",
}
MAPPERS = ("gpu", "fixed_point")


def main() -> None:
    """Measure, and write what was found."""
    options = parsed()
    groups = {volume: group for group, names in GROUPS.items() for volume in names}
    cases = [Case(volume, options.look, options.size) for volume in options.volumes or groups]
    if not options.whole and not options.volumes:
        cases = sample(cases, 5, key=lambda case: groups[case.volume])
    extent = "whole" if len(cases) == len(groups) else "sample"
    plan = {"look": options.look, "window_size": options.size, "repeats": options.repeats}
    suffix = "" if extent == "whole" else "_sample"
    path = options.out / f"frames_{across(options.size)}{suffix}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    results = Results.begun(
        "frames",
        plan,
        path=path,
        rooms=(*ROOMS, "vtk_pipeline", "plotting"),
        extent=extent,
        device=options.device,
        resume=options.resume,
    )
    volumes = Latest(lambda name: find_dataset(name).load(None))

    def measure(case: Case) -> dict[str, Any]:
        volume = volumes(case.volume)
        if case.what == ALONE:
            return {"seconds": raycast_alone(volume, case, options)}
        return {"seconds": whole_frames(volume, case, options, WHOLE_FRAMES[case.what or ""])}

    parts = [
        Case(case.volume, case.look, case.window_size, what=what)
        for case in cases
        for what in TITLES
    ]
    with tqdm(total=1.0, disable=not sys.stderr.isatty()) as bar:
        run(parts, measure, results, lambda done, *doing: bar.update(done - bar.n))
    text = "\n".join(report(results, groups))
    write_text(path.with_suffix(".md"), text + "\n")
    print(text)


def whole_frames(
    volume: Any, case: Case, options: argparse.Namespace, samples: int | None
) -> dict[str, Any]:
    """Return seconds of whole frames, by candidate and angle, in turns."""
    grid, size = to_image_data(volume), case.window_size
    look = {**TRANSFER_FUNCTIONS[case.look or ""], "show_scalar_bar": False}
    view = filling_camera(volume.bounds, size)
    fill: dict[str, Callable[[pv.Plotter], object]] = {
        "empty scene": lambda plotter: None,
        "vdi": lambda plotter: plotter.add_vdi(
            grid, draw="vdi", regenerate="never", device=options.device, **look
        ),
        **{f"vtk_{name}": partial(pv.Plotter.add_volume, volume=grid, mapper=name, **look)
           for name in MAPPERS},
    }  # fmt: skip
    with ExitStack() as stack:
        plotters = {}
        for name, add in fill.items():
            plotters[name] = plotter = pv.Plotter(off_screen=True, window_size=size)
            stack.callback(plotter.close)
            if samples is not None:
                plotter.render_window.SetMultiSamples(samples)
            add(plotter)
            aim(plotter.camera, view)
            plotter.camera_set = True
            plotter.show(auto_close=False)  # makes the VDI, of V_O
        # Each view after another one, so that no frame shows again what the last one has drawn
        seconds: dict[str, Any] = {name: {f"{angle:g}": [] for angle in ANGLES} for name in fill}
        for repeat in range(options.repeats + 1):
            for angle in ANGLES:
                for name, plotter in plotters.items():
                    taken = frame(plotter, view.azimuth(angle))
                    if repeat:
                        seconds[name][f"{angle:g}"].append(taken)
    return seconds


def frame(plotter: pv.Plotter, camera: Camera) -> float:
    """Draw a frame of a view and wait until it is finished; return the seconds."""
    aim(plotter.camera, camera)
    plotter.renderer.ResetCameraClippingRange()
    begun = time.perf_counter()
    plotter.render_window.Render()
    plotter.render_window.WaitForCompletion()
    return time.perf_counter() - begun


def raycast_alone(volume: Any, case: Case, options: argparse.Namespace) -> dict[str, Any]:
    """Return seconds of the raycasts, by candidate and angle, in turns."""
    looks = Classification(TRANSFER_FUNCTIONS[case.look or ""], "frames").transfer_function(volume)
    seconds: dict[str, Any] = {}
    with Bench(volume, looks, case.window_size, device=options.device) as bench:
        vdi = bench.generate()
        for angle in ANGLES:
            steps = bench.frames(bench.view.azimuth(angle), vdi)
            wanted = {"vdi": steps["vdi_skipping"], "render_volume": steps["volume_skipping"]}
            wanted |= {f"vtk_{name}": steps[f"vtk_{name}"] for name in MAPPERS}
            for name, times in take_turns(wanted, options.repeats).items():
                seconds.setdefault(name, {})[f"{angle:g}"] = times["clock"]
    return seconds


def times_as_fast(row: dict[str, Any], angle: str) -> float:
    """Return the median, over turns, of the faster VTK mapper's time over the VDI's."""
    theirs = [row["seconds"][f"vtk_{name}"][angle] for name in MAPPERS]
    peer = min(theirs, key=np.median)
    return float(np.median(ratios(peer, row["seconds"]["vdi"][angle])))


def report(results: Results, groups: dict[str, str]) -> Iterator[str]:
    """Yield the lines of the tables: how many times as fast as the faster of VTK's mappers."""
    size, look = results.plan["window_size"], results.plan["look"]
    yield f"# Frames of a VDI beside VTK's, {across(size)}, *{look}*"
    angles = [f"{angle:g}" for angle in ANGLES]
    for what, title in TITLES.items():
        yield from ("", f"## {title}", "")
        rows, found = [], {angle: {} for angle in angles}
        for row in results.rows(what=what):
            name = row["case"]["volume"]
            if "refused" in row:
                rows.append([name, row["refused"], *["-"] * (len(angles) + 1)])
                continue
            milliseconds = [
                f"{1e3 * float(np.median(row['seconds'][key][angles[0]])):.0f}"
                for key in ("vdi", *(f"vtk_{name}" for name in MAPPERS))
            ]
            speeds = {angle: times_as_fast(row, angle) for angle in angles}
            for angle, speed in speeds.items():
                found[angle].setdefault(groups.get(name, name), []).append(speed)
            empty = row["seconds"].get("empty scene")
            alone = f"{1e3 * float(np.median(empty[angles[0]])):.0f}" if empty else "-"
            times = f"{' / '.join(milliseconds)} / {alone}"
            rows.append([name, times, *(f"{speeds[angle]:.2g}" for angle in angles)])
        heads = ["volume", "ms: VDI / GPU / fixed point / empty scene, at V_O", "V_O"]
        yield from table([*heads, *(f"{angle} degrees" for angle in angles[1:])], rows)
        if results.data["extent"] == "sample" and set(found[angles[0]]) == set(GROUPS):
            whole = {group: len(names) for group, names in GROUPS.items()}
            said = ", ".join(
                f"{a} degrees: {estimate(found[a], whole)}" for a in angles if found[a]
            )
            yield from ("", f"Mean of all volumes, from this sample: {said}.")
    yield from closing(results.data)


def parsed() -> argparse.Namespace:
    """Return the options."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--whole", action="store_true", help="every volume, not a sample")
    parser.add_argument("--volumes", nargs="+", metavar="NAME", help="these alone")
    parser.add_argument("--look", choices=TRANSFER_FUNCTIONS, default="soft")
    parser.add_argument("--size", type=parse_size, default=WINDOW_SIZE, metavar="WxH")
    parser.add_argument("--repeats", type=int, help="turns: 5, or 3 of a sample")
    parser.add_argument("--device", help="OpenCL device, see: pyvista-vdi devices")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results")
    parser.add_argument("--resume", action="store_true", help="go on with what is there")
    options = parser.parse_args()
    options.repeats = options.repeats or (5 if options.whole else 3)
    return options


if __name__ == "__main__":
    main()
