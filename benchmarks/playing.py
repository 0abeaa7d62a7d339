"""What playing a series costs: decoding and upload over frames, and steps a second beside VTK.

Each step is decoded as it is while a series plays, one after the other. VTK's mappers load each
step's volume from a .npy file, with steps of one voxel. Writes ``playing_WxH.json`` and ``.md``.
See README.md in this folder.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from common import (  # beside this file
    add_redo,
    add_size,
    marked,
    measure_missing,
    new_parser,
)
from series import LOOKS
from series_data import SERIES, series_at_hand
from tqdm import tqdm

import pyvista_vdi as pvdi
from pyvista_vdi.device import get_runtime
from pyvista_vdi.measure.report import system_line, table
from pyvista_vdi.measure.vtk_baselines import (
    MAPPERS,
    VTKBaseline,
    property_from_transfer_function,
)
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.raycasting.prepared import prepared_vdi
from pyvista_vdi.vtk_pipeline.filters.convert import volume_to_image
from pyvista_vdi.vtk_pipeline.filters.view import aim

ANGLES = (0.0, 5.0)

#: What must be reached.
MOST_READY, LEAST_RATE, LEAST_SSIM = 1.0, 24.0, 0.97
#: Steps a second that are asked for.
ASKED = 48.0
LEAST_OVER_VTK = {0.0: 8.0, 5.0: 2.5}

LEGEND = (
    "Ready: decoding and upload of a step over one of its frames at that angle, the median of all "
    "steps. Played: steps a second that a plotter shows of 48; the others are left out. "
    "Over VTK: that over the steps a second of VTK's faster mapper, which loads, uploads and draws "
    "each step's volume. SSIM: the least of three steps against volume rendering. Bold: what must "
    "be reached is not."
)


def main() -> int:
    """Measure what is missing, and write what was found."""
    parser = new_parser(__doc__)
    add_size(parser, (640, 360))
    add_redo(parser)
    names = [name for name in SERIES if name != "still"]
    parser.add_argument("--series", nargs="+", choices=names, default=names)
    parser.add_argument("--seconds", type=float, default=10.0, help="that a series is played for")
    options = parser.parse_args()

    def measured_of(name: str) -> dict[str, Any]:
        with tempfile.TemporaryDirectory() as folder:
            return measured(name, Path(folder), options)

    wanted = series_at_hand(options.series)
    measure_missing("playing", options, {}, wanted, measured_of, report, parts="series")
    return 0


def measured(name: str, folder: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Return the times and rates of a series."""
    data, size = SERIES[name], options.size
    camera = filling_camera(data.step(0).bounds, size)
    looks = {**LOOKS[name], "device": options.device}
    file = folder / "a.vdis"
    with pvdi.SeriesWriter(file, camera, size, **looks) as out:
        for i in tqdm(range(data.steps), desc=name, leave=False):
            out.append(data.step(i))
            np.save(folder / f"{i}.npy", data.step(i).array)
    classified = Classification(LOOKS[name], "a benchmark").transfer_function(data.step(0))
    found: dict[str, Any] = {"steps": data.steps, "bytes": file.stat().st_size, "angles": {}}
    for angle in ANGLES:
        view = camera.azimuth(angle)
        ready, frames = step_times(file, view, options)
        volumes = [folder / f"{i}.npy" for i in range(data.steps)]
        losses = []
        for i in (0, data.steps // 2, data.steps - 1):
            truth = pvdi.render_volume(
                data.step(i), view, size, transfer_function=classified, device=options.device
            )
            picture = pvdi.render(pvdi.read(file)[i], view, size, device=options.device)
            losses.append(pvdi.compare_images(picture, truth).ssim)
        found["angles"][f"{angle:g}"] = {
            "ready": ready,
            "frame": frames,
            "played": played(file, view, options),
            "vtk": {m: vtk_rate(m, data.step(0), volumes, view, classified, size) for m in MAPPERS},
            "ssim": min(losses),
        }
    return found


def step_times(
    file: Path, view: pvdi.Camera, options: argparse.Namespace
) -> tuple[list[float], list[float]]:
    """Return the seconds until each step is on the device, and those of one of its frames."""
    runtime = get_runtime(options.device)
    series, ready, frames = pvdi.read(file), [], []
    for i in range(-1, len(series)):
        began = time.perf_counter()
        vdi = series[max(i, 0)]
        prepared_vdi(runtime, vdi)
        taken = time.perf_counter() - began
        turned = [view.azimuth(0.01 * k) for k in range(4)]
        times = [
            seconds(lambda s=vdi, v=v: pvdi.render(s, v, options.size, device=runtime))
            for v in turned
        ]
        if i >= 0:  # kernels have been compiled
            ready.append(taken)
            frames.append(statistics.median(times[1:]))
        else:
            series = pvdi.read(file)
    return ready, frames


def seconds(work: Callable[[], object]) -> float:
    """Return how long something takes."""
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def played(file: Path, view: pvdi.Camera, options: argparse.Namespace) -> float:
    """Return the steps a second that an off-screen plotter shows of ASKED ones."""
    plotter = pv.Plotter(off_screen=True, window_size=list(options.size))
    actor = plotter.add_vdi(
        pvdi.read(file), show_scalar_bar=False, regenerate="never", device=options.device
    )
    aim(plotter.camera, view)
    plotter.camera_set = True
    plotter.show(auto_close=False)
    actor.play(rate=ASKED)
    player = actor._player()
    shown, began = 0, time.perf_counter()
    while time.perf_counter() - began < options.seconds:
        if player.advance():  # as the event loop asks
            plotter.render()
            shown += 1
        else:
            time.sleep(0.002)
    rate = shown / (time.perf_counter() - began)
    plotter.close()
    return rate


def vtk_rate(
    mapper: str,
    first: pvdi.Volume,
    files: list[Path],
    view: pvdi.Camera,
    classified: pvdi.TransferFunction,
    size: tuple[int, int],
) -> float:
    """Return the steps a second that one of VTK's mappers loads and draws."""
    prop = property_from_transfer_function(first, classified)
    theirs = VTKBaseline(first, prop, size, mapper, min(first.spacing))
    theirs.render(view)

    def step(file: Path) -> None:
        volume = pvdi.Volume(np.load(file), first.spacing, first.origin)
        theirs._mapper.SetInputData(volume_to_image(volume))
        theirs.render(view)

    taken = [seconds(lambda file=file: step(file)) for file in files]
    theirs.close()
    return 1 / statistics.mean(taken)


def report(results: dict[str, Any]) -> str:
    """Return the table."""
    width, height = results["window_size"]
    heads = ["series", "degrees", "ready", "worst step", "played", "VTK", "over VTK", "SSIM"]
    rows = []
    for name, found in results["series"].items():
        for angle, at in found["angles"].items():
            shares = [r / f for r, f in zip(at["ready"], at["frame"], strict=True)]
            ready, vtk = statistics.median(shares), max(at["vtk"].values())
            over = at["played"] / vtk
            small = width <= 640
            rows.append(
                [
                    name,
                    angle,
                    figure(ready, float(angle) == 0 or ready <= MOST_READY),
                    f"{max(shares):.2f}",
                    figure(at["played"], not small or at["played"] >= LEAST_RATE, 1),
                    f"{vtk:.1f}",
                    figure(over, over >= LEAST_OVER_VTK[float(angle)], 1),
                    figure(at["ssim"], at["ssim"] >= LEAST_SSIM, 3),
                ]
            )
    text = [f"# Playing series, {width}x{height}", "", LEGEND, "", *table(heads, rows)]
    return "\n".join([*text, "", system_line(results["system"]), ""])


def figure(value: float, reached: bool, digits: int = 2) -> str:
    """Return a figure, bold where it is not what must be reached."""
    return marked(f"{value:.{digits}f}", reached)


if __name__ == "__main__":
    sys.exit(main())
