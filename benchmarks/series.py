"""What series take in files and what a tolerance loses; steps a second beside VTK's mappers.

The volumes are made here, but for one that is read.
"""

from __future__ import annotations

import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shared import execute, marked, parser_of, table_of  # beside this file

import pyvista_vdi as pvdi
from pyvista_vdi import Volume, examples
from pyvista_vdi.device import get_runtime
from pyvista_vdi.io.files import read_info
from pyvista_vdi.measure.harness import Bench, Case
from pyvista_vdi.measure.results import Results, table
from pyvista_vdi.raycasting.prepared import prepared_vdi
from pyvista_vdi.vtk_pipeline.filters.convert import volume_to_image

TOLERANCES, ANGLES = (0.01, 0.02, 0.03), (0.0, 5.0, 20.0)

#: Least SSIM with the first tolerance, and most bytes over single files, exact.
LEAST_SSIM, MOST_BYTES = 0.99, 1.02

#: Edge of the volumes that are made, points.
EDGE = 96


def rayleigh_taylor(i: int) -> Volume:
    """Return step i of the mixing layer in the folder of volumes: all of it changes."""
    return Volume(_rayleigh_taylor()[i])


@cache
def _rayleigh_taylor() -> NDArray[np.uint8]:
    folder = Path(os.environ[examples.DATA_VARIABLE])
    with np.load(folder / "rayleigh_taylor_series_25x96x96x96_u8.npz") as archive:
        return np.asarray(archive["density"])


def plume(i: int, edge: int = EDGE) -> Volume:
    """Return step i of a plume that rises in a wind, which grows with height."""
    z, y, x = np.meshgrid(*(np.linspace(-1, 1, edge, dtype=np.float32),) * 3, indexing="ij")
    when, height = 0.04 * i, (z + 1) / 2
    along = x - (0.9 * height**2 - 0.35) * (1 + 0.15 * np.sin(3 * when))
    radius = 0.06 + 0.3 * height
    density = np.exp(-((along**2 + y**2) / radius**2)) * (1 - 0.6 * height)
    # Where the medium came from: risen, and carried along by a wind that grows with height
    texture = _noise(along - 0.5 * when * height, y, z - when)
    values = density * np.clip(0.75 + 0.8 * texture, 0, None) * (z < -1 + 0.3 + 3 * when)
    return Volume(np.clip(255 * values, 0, 255).astype(np.uint8))


def _noise(x: NDArray[Any], y: NDArray[Any], z: NDArray[Any]) -> NDArray[Any]:
    """Return a sum of waves from a third to a fifteenth of the volume long; always the same."""
    random = np.random.default_rng(20)
    found = np.zeros_like(x)
    for k in range(24):
        direction = random.normal(size=3)
        direction *= 2 * np.pi * 1.5 * 1.07**k / np.linalg.norm(direction)
        phase = random.random() * 2 * np.pi
        wave = np.cos(direction[0] * x + direction[1] * y + direction[2] * z + np.float32(phase))
        found += wave.astype(np.float32) / np.float32(5 * 1.03**k)
    return found


def cut(i: int) -> Volume:
    """Return step i of a head that does not change, behind a cut that moves."""
    values = still(0).array.copy()
    values[:, :, : 2 * i] = 0
    return Volume(values, still(0).spacing)


@cache
def still(_: int) -> Volume:
    """Return any step of a head that does not change."""
    whole = examples.load_brain(as_volume=True)
    half = np.ascontiguousarray(whole.array[::2, ::2, ::2])
    return Volume(half, [2 * spacing for spacing in whole.spacing])


#: By name: each step, how many, and how they look.
SERIES: dict[str, tuple[Callable[[int], Volume], int, dict[str, Any]]] = {
    "rayleigh_taylor": (rayleigh_taylor, 25, {"cmap": "coolwarm", "clim": (0, 255)}),
    "plume": (plume, 25, {"cmap": "inferno", "clim": (0, 255)}),
    "cut": (cut, 25, {"cmap": "bone", "opacity": "sigmoid_6"}),
    "still": (still, 100, {"cmap": "bone", "opacity": "sigmoid_6"}),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and write what was found."""
    parser = parser_of(__doc__, size=(320, 180), volumes=None)
    parser.add_argument("--series", nargs="+", choices=SERIES, default=list(SERIES))
    options = parser.parse_args(arguments)
    if "rayleigh_taylor" in options.series and not os.environ.get(examples.DATA_VARIABLE):
        print(f"Left out, {examples.DATA_VARIABLE} is not set: rayleigh_taylor")
        options.series.remove("rayleigh_taylor")

    def measure(case: Case) -> dict[str, Any]:
        step, count, looks = SERIES[case.chosen["series"]]
        # Neighbours, since steps are written by what they differ in
        few = range(count) if options.whole else range(count // 2 - 4, count // 2 + 4)
        with tempfile.TemporaryDirectory() as folder:
            return measured([step(i) for i in few], looks, Path(folder), options)

    cases = [Case("series", options=(("series", name),)) for name in options.series]
    rooms = ("generation", "raycasting", "volume", "extensions/series", "io")
    execute("series", options, cases, measure, report, count=len(cases), rooms=rooms)
    return 0


def measured(volumes: list[Volume], looks: Any, folder: Path, options: Any) -> dict[str, Any]:
    """Return bytes, losses and rates of a series."""
    first = volumes[0]
    function = table_of(first, "soft", **{"cmap": "bone", "opacity": "linear", **looks})
    files = {t: folder / f"{t}.vdis" for t in (0.0, *TOLERANCES)}
    with Bench(first, function, tuple(options.size), device=options.device) as bench:
        writers = {t: pvdi.SeriesWriter(file, tolerance=t) for t, file in files.items()}
        single, vdis = [], []
        for volume in volumes:
            vdi = pvdi.generate(
                volume,
                bench.view,
                bench.size,
                transfer_function=function,
                precision="8-byte",
                device=bench.runtime,
            )
            single.append(vdi.save(folder / "single.vdi", compression="zstd").stat().st_size)
            vdis.append(vdi)
            for writer in writers.values():
                writer.append(vdi)
        for writer in writers.values():
            writer.close()
        info = read_info(files[0.0])
        shown = sorted({0, len(vdis) // 2, len(vdis) - 1})
        exact = pvdi.read(files[0.0])
        return {
            "steps": len(vdis),
            "bytes": {str(t): file.stat().st_size / sum(single) for t, file in files.items()},
            "worst_step": max(b / s for b, s in zip(info.step_bytes, single, strict=True)),
            "keys": len(info.keys),
            "identical": all(exact[i].equals(vdis[i]) for i in shown),
            "ssim": {
                str(t): min(
                    pvdi.compare_images(bench.draw(vdis[i], view), bench.draw(series[i], view)).ssim
                    for i in shown
                    for view in map(bench.view.azimuth, ANGLES)
                )
                for t in TOLERANCES
                for series in [pvdi.read(files[t])]
            },
            "playing": {
                f"{angle:g}": playing(bench, files[0.0], volumes, angle) for angle in ANGLES
            },
        }


def playing(bench: Bench, file: Path, volumes: list[Volume], angle: float) -> dict[str, Any]:
    """Return a step's decoding and upload over a frame, and steps a second: ours, and VTK's.

    VTK's mappers load each step's volume from a file, upload and draw it.
    """
    view, runtime = bench.view.azimuth(angle), get_runtime(bench.runtime)
    series, ready, frames = pvdi.read(file), [], []
    bench.draw(series[0], view)  # kernels are compiled
    series = pvdi.read(file)
    for i in range(len(series)):
        vdi, taken = timed(lambda i=i: series[i])
        ready.append(taken + timed(lambda vdi=vdi: prepared_vdi(runtime, vdi))[1])
        frames.append(timed(lambda vdi=vdi: bench.draw(vdi, view))[1])
    rates = {"vdi": len(ready) / (sum(ready) + sum(frames))}
    saved = file.with_suffix(".npy")
    for name, baseline in bench.vtk.items():
        baseline.render(view)
        seconds = 0.0
        for volume in volumes:
            np.save(saved, volume.array)

            def step(first: Volume = volumes[0], baseline: Any = baseline) -> None:
                loaded = Volume(np.load(saved), first.spacing, first.origin)
                baseline._mapper.SetInputData(volume_to_image(loaded))
                baseline.render(view)

            seconds += timed(step)[1]
        rates[name] = len(volumes) / seconds
    shares = [r / f for r, f in zip(ready, frames, strict=True)]
    return {"ready": statistics.median(shares), "rates": rates}


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """Return what something gives, and the seconds that it takes."""
    began = time.perf_counter()
    found = work()
    return found, time.perf_counter() - began


def report(results: Results, every: list[Case]) -> Iterator[str]:
    """Yield the tables."""
    yield "Bytes over those of the same VDIs as single files (8-byte, zstd), and of the worst step."
    yield "SSIM: the least of three steps at all angles, against what was written."
    yield ""
    rows, played = [], []
    for row in results.rows():
        if "refused" in row:
            continue
        name = row["case"]["series"]
        cells = [name, row["steps"], marked(f"{row['bytes']['0.0']:.3f}", row["identical"])]
        cells.append(marked(f"{row['worst_step']:.3f}", row["worst_step"] <= MOST_BYTES))
        for tolerance, ssim in row["ssim"].items():
            good = ssim >= LEAST_SSIM
            cells += [f"{row['bytes'][tolerance]:.3f}", marked(f"{ssim:.4f}", good)]
        rows.append([*cells, row["keys"]])
        for angle, at in row["playing"].items():
            rates = [f"{rate:.0f}" for rate in at["rates"].values()]
            played.append([name, angle, f"{at['ready']:.2f}", *rates])
    heads = [head for t in TOLERANCES for head in (f"tolerance {t}", "SSIM")]
    yield from table(("series", "steps", "exact", "worst step", *heads, "keys"), rows)
    yield from ("", "Decoding and upload of a step over one of its frames; steps a second:", "")
    heads = ["ready / frame", "VDI", "VTK GPU", "VTK fixed point"]
    yield from table(("series", "degrees", *heads), played)


if __name__ == "__main__":
    sys.exit(main())
