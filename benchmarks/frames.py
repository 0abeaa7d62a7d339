"""What a frame of a VDI costs in a plotter, beside VTK's mappers.

Whole frames of off-screen plotters at PyVista's defaults, `add_vdi(draw="vdi")` beside
`add_volume` with each of VTK's mappers and the same arguments, from V_O, 5 and 30 degrees; the same
without multisampling; and the raycast alone: ours until the picture is on the host, VTK's mappers
in windows of their own without multisampling, at steps of one voxel. How alike the pictures of
whole frames are says an SSIM of their 8-bit pixels: the mappers choose their steps themselves.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from typing import Any

import numpy as np
import pyvista as pv
from shared import (  # beside this file
    LOOKS,
    ROOMS,
    Case,
    Latest,
    Results,
    benches,
    execute,
    load,
    mean_of,
    parser_of,
    table,
)

from pyvista_vdi.measure.bench import ratio, take_turns
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.plotting.volumes import to_image_data
from pyvista_vdi.vtk_pipeline.filters.view import aim

#: Three that are large, four of 256^3 to 302^3 voxels, and one that is solid.
VOLUMES = (
    *("visible_female_head", "allen_mouse_brain", "kingsnake_like"),
    *("aneurism", "bonsai", "embryo", "heptane", "berea"),
)
ANGLES = (0.0, 5.0, 30.0)
#: What is measured, and the plotter's samples per pixel; ``None`` is PyVista's default.
PARTS: dict[str, int | None] = {
    "whole frames at PyVista's defaults": None,
    "whole frames without multisampling": 0,
    "raycast alone": None,
}
ALONE = "raycast alone"
MAPPERS = ("gpu", "fixed_point")
#: Degrees by which a view differs from that of the turn before.
TURN = 0.01


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and write what was found."""
    options = parser_of(__doc__, size=(1280, 720), volumes=VOLUMES, repeats=5).parse_args(arguments)
    with benches(options, vtk=True) as bench_of, Latest(load) as volumes:

        def measure(case: Case) -> dict[str, Any]:
            if case.what != ALONE:
                volume = volumes(case.volume)
                return whole_frames(volume, case, options.repeats, options.device)
            bench = bench_of(case.volume, case.look)
            vdi, seconds = bench.generate(), {}
            for angle in ANGLES:
                work = bench.frames(bench.view.azimuth(angle), vdi)
                del work["volume"]
                for name, times in take_turns(work, options.repeats).items():
                    seconds.setdefault(name, {})[f"{angle:g}"] = times
            return {"seconds": seconds}

        cases = [
            Case(name, "soft", tuple(options.size), what=what)
            for name in options.volumes
            for what in PARTS
        ]
        rooms = (*ROOMS, "vtk_pipeline", "plotting")
        execute("frames", options, cases, measure, report, count=3, key=None, rooms=rooms)
    return 0


def whole_frames(volume: Any, case: Case, repeats: int, device: Any) -> dict[str, Any]:
    """Return seconds of plotters' frames, by who draws the volume and by angle, in turns.

    And the SSIM, by angle, of what `add_vdi` and `add_volume` with VTK's GPU mapper show.
    """
    grid, view = to_image_data(volume), filling_camera(volume.bounds, case.window_size)
    look = {**LOOKS[case.look or ""], "show_scalar_bar": False}
    # All rays, and this VDI alone, however long a frame takes
    ours = {"draw": "vdi", "regenerate": "never", "target_fps": None, "device": device}
    with ExitStack() as stack:
        plotters: dict[str, pv.Plotter] = {}
        for name in ("empty", "vdi", *MAPPERS):
            plotter = pv.Plotter(off_screen=True, window_size=case.window_size)
            plotters[name] = plotter
            stack.callback(plotter.close)
            if (samples := PARTS[case.what or ""]) is not None:
                plotter.render_window.SetMultiSamples(samples)
            if name == "vdi":
                plotter.add_vdi(grid, **ours, **look)
            elif name != "empty":
                plotter.add_volume(grid, mapper=name, **look)
            aim(plotter.camera, view)
            plotter.camera_set = True
            plotter.show(auto_close=False)  # makes the VDI, of V_O
        seconds: dict[str, Any] = {
            name: {f"{angle:g}": [] for angle in ANGLES} for name in plotters
        }
        for repeat in range(repeats + 1):
            for angle in ANGLES:
                for name, plotter in plotters.items():
                    # Always a view that was not drawn before: a picture that is kept costs nothing
                    taken = frame(plotter, view.azimuth(angle + TURN * repeat))
                    if repeat:
                        seconds[name][f"{angle:g}"].append(taken)
        alike = {}
        for angle in ANGLES:
            pictures = [shown(plotters[name], view.azimuth(angle)) for name in ("vdi", "gpu")]
            alike[f"{angle:g}"] = compare_images(*pictures).ssim
    return {"seconds": seconds, "ssim": alike}


def shown(plotter: pv.Plotter, camera: Camera) -> Any:
    """Return what a plotter shows from a view, RGB (H, W, 3), 0 to 1."""
    frame(plotter, camera)
    return np.float32(plotter.screenshot(return_img=True)[..., :3]) / 255


def frame(plotter: pv.Plotter, camera: Camera) -> float:
    """Draw a frame of a view and wait until it is finished; return the seconds."""
    aim(plotter.camera, camera)
    plotter.renderer.ResetCameraClippingRange()
    begun = time.perf_counter()
    plotter.render_window.Render()
    plotter.render_window.WaitForCompletion()
    return time.perf_counter() - begun


def times_as_fast(row: dict[str, Any], angle: str) -> float:
    """Return the median, over turns, of the faster VTK mapper's time over the VDI's."""
    theirs = [row["seconds"][name][angle] for name in MAPPERS]
    peer = min(theirs, key=statistics.median)
    return ratio(peer, row["seconds"]["vdi"][angle])


def report(results: Results, every: list[Case]) -> Iterator[str]:
    """Yield a table for each part: how many times as fast as the faster of VTK's mappers."""
    angles = [f"{angle:g}" for angle in ANGLES]
    for what in PARTS:
        rows = []
        for row in results.rows(what=what):
            named = {name: row["seconds"].get(name) for name in ("vdi", *MAPPERS, "empty")}
            times = [
                "-" if taken is None else f"{1e3 * statistics.median(taken['0']):.3g}"
                for taken in named.values()
            ]
            speeds = [f"{times_as_fast(row, angle):.2g}" for angle in angles]
            alike = row.get("ssim")
            alike = [f"{alike[angle]:.3f}" if alike else "-" for angle in angles]
            rows.append([row["case"]["volume"], *speeds, *times, *alike])
        means = [
            mean_of(results, every, lambda row, a=angle: times_as_fast(row, a), what=what)
            for angle in angles
        ]
        yield from (f"## {what[0].upper()}{what[1:]}", "")
        heads = ["V_O", *(f"{angle} degrees" for angle in angles[1:])]
        at_v_o = [
            f"{who}, ms at V_O" for who in ("VDI", "VTK GPU", "VTK fixed point", "empty scene")
        ]
        last = [f"SSIM, {head}" for head in heads]
        yield from table(
            ["volume", *heads, *at_v_o, *last],
            [*rows, ["mean of all", *map(str, means), *["-"] * 7]],
        )
        yield ""


if __name__ == "__main__":
    sys.exit(main())
