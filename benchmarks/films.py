"""What a script pays for pictures that are kept, beside `add_volume`.

Off-screen plotters with equal arguments: one screenshot of a new plotter, in a process that has
drawn before, beside `add_volume` at PyVista's defaults; a film once around, beside each of VTK's
mappers; and a film of pictures within 5 degrees, beside `add_vdi(draw="volume")`. Films are without
multisampling, and what is made for them, VDIs and estimates, counts. How alike a film's pictures
are says an SSIM against VTK's GPU mapper at steps of half a voxel.
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
from shared import LOOKS, ROOMS, Case, Latest, Results, execute, load, mean_of, parser_of, table

from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.plotting.volumes import to_image_data
from pyvista_vdi.vtk_pipeline.filters.view import aim

#: Five of 256^3 voxels or about as many, and one that is solid.
VOLUMES = ("brain", "aneurism", "bonsai", "embryo", "heptane", "berea")
SCREENSHOT, AROUND, ARC = "one screenshot", "once around", "within 5 degrees"
PARTS = (SCREENSHOT, AROUND, ARC)
MAPPERS = ("gpu", "fixed_point")
#: Degrees of a film's pictures.
FILMS = {AROUND: np.arange(0, 360, 9.0), ARC: np.linspace(0, 5, 120)}
#: Every how-manieth picture of a film is compared.
COMPARED = 5


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and write what was found."""
    options = parser_of(__doc__, size=(1280, 720), volumes=VOLUMES, repeats=5).parse_args(arguments)
    volumes = Latest(load)

    def measure(case: Case) -> dict[str, Any]:
        grid = to_image_data(volumes(case.volume))
        if case.what == SCREENSHOT:
            return screenshots(grid, case, options.repeats, options.device)
        return film(grid, case, options.device)

    cases = [
        Case(name, "soft", tuple(options.size), what=what)
        for name in options.volumes
        for what in PARTS
    ]
    rooms = (*ROOMS, "vtk_pipeline", "plotting")
    execute("films", options, cases, measure, report, count=2, key=None, rooms=rooms)
    return 0


def adders(device: Any) -> dict[str, Any]:
    """Return what adds a volume, by name: plotter, grid and look to an actor."""

    def ours(draw: str) -> Any:
        return lambda plotter, grid, look: plotter.add_vdi(grid, draw=draw, device=device, **look)

    def theirs(mapper: str | None) -> Any:
        return lambda plotter, grid, look: plotter.add_volume(grid, mapper=mapper, **look)

    return {
        **{f"vdi_{draw}": ours(draw) for draw in ("auto", "volume")},
        **{f"vtk_{mapper}": theirs(mapper) for mapper in MAPPERS},
        "add_volume": theirs(None),
    }


def screenshots(grid: Any, case: Case, repeats: int, device: Any) -> dict[str, Any]:
    """Return seconds of a whole script each time: plotter, volume, picture, close; in turns."""
    look = {**LOOKS[case.look or ""], "show_scalar_bar": False}
    view, add = filling_camera(grid.bounds, case.window_size), adders(device)
    seconds: dict[str, list[float]] = {"vdi_auto": [], "add_volume": []}
    for repeat in range(repeats + 1):
        for name, taken in seconds.items():
            begun = time.perf_counter()
            plotter = pv.Plotter(off_screen=True, window_size=case.window_size)
            add[name](plotter, grid, look)
            aim(plotter.camera, view)
            plotter.camera_set = True
            plotter.screenshot(None, return_img=True)
            plotter.close()
            if repeat:
                taken.append(time.perf_counter() - begun)
    return {"seconds": seconds}


def film(grid: Any, case: Case, device: Any) -> dict[str, Any]:
    """Return seconds of a film's pictures by who draws it, in turns; what drew ours, and SSIM."""
    look = {**LOOKS[case.look or ""], "show_scalar_bar": False}
    view, add = filling_camera(grid.bounds, case.window_size), adders(device)
    peers = ("vdi_volume",) if case.what == ARC else tuple(f"vtk_{mapper}" for mapper in MAPPERS)
    with ExitStack() as stack:
        plotters, actors = {}, {}
        for name in ("vdi_auto", *peers, "judge"):
            plotter = plotters[name] = pv.Plotter(off_screen=True, window_size=case.window_size)
            stack.callback(plotter.close)
            plotter.render_window.SetMultiSamples(0)
            actors[name] = add["vtk_gpu" if name == "judge" else name](plotter, grid, look)
            plotter.camera_set = True
        mapper = actors["judge"].mapper
        mapper.SetAutoAdjustSampleDistances(0)
        mapper.SetSampleDistance(min(grid.spacing) / 2)
        # Kernels are compiled, and voxels are on the device: a film of a process that has drawn
        for plotter in plotters.values():
            picture(plotter, view.azimuth(180))
        seconds: dict[str, list[float]] = {name: [] for name in plotters if name != "judge"}
        drawn, alike = [], []
        for number, angle in enumerate(FILMS[case.what or ""]):
            shown = {}
            for name in seconds:
                begun = time.perf_counter()
                shown[name] = picture(plotters[name], view.azimuth(float(angle)))
                seconds[name].append(time.perf_counter() - begun)
            drawn.append(actors["vdi_auto"].status.drawn)
            if number % COMPARED == 0:
                judge = picture(plotters["judge"], view.azimuth(float(angle)))
                alike.append(compare_images(shown["vdi_auto"] / 255, judge / 255).ssim)
    by_vdi = drawn.count("vdi") / len(drawn)
    return {"seconds": seconds, "by_vdi": by_vdi, "ssim": {"least": min(alike)}}


def picture(plotter: pv.Plotter, camera: Camera) -> Any:
    """Return the picture of a view, float32 RGB (H, W, 3), 0 to 255."""
    aim(plotter.camera, camera)
    plotter.renderer.ResetCameraClippingRange()
    plotter.render()
    return np.float32(plotter.screenshot(None, return_img=True)[..., :3])


def times_as_fast(row: dict[str, Any]) -> float:
    """Return the fastest peer's time for all pictures over ours; medians of single screenshots."""
    whole = statistics.median if row["case"]["what"] == SCREENSHOT else sum
    taken = {name: whole(times) for name, times in row["seconds"].items()}
    ours = taken.pop("vdi_auto")
    return min(taken.values()) / ours


def report(results: Results, every: list[Case]) -> Iterator[str]:
    """Yield a table for each part: how many times as fast as the fastest peer."""
    for what in PARTS:
        rows = []
        for row in results.rows(what=what):
            each = {name: statistics.median(times) for name, times in row["seconds"].items()}
            ours = each.pop("vdi_auto")
            peers = ", ".join(f"{name} {1e3 * taken:.3g}" for name, taken in each.items())
            ssim, by_vdi = row.get("ssim"), row.get("by_vdi")
            rows.append(
                [
                    row["case"]["volume"],
                    f"{times_as_fast(row):.2f}",
                    f"{1e3 * ours:.3g}",
                    peers,
                    "-" if by_vdi is None else f"{by_vdi:.0%}",
                    "-" if ssim is None else f"{ssim['least']:.3f}",
                ]
            )
        mean = mean_of(results, every, times_as_fast, what=what)
        yield from (f"## {what[0].upper()}{what[1:]}", "")
        yield from table(
            ["volume", "times as fast", "ms, median", "peers, ms", "by VDIs", "least SSIM"],
            [*rows, ["mean of all", str(mean), *["-"] * 4]],
        )
        yield ""


if __name__ == "__main__":
    sys.exit(main())
