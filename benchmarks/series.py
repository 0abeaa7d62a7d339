"""What series take in files, over the same VDIs as single files, and what a tolerance loses.

Writes ``series_WxH.json`` (all figures) and ``.md`` (the table). See README.md in this folder.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from common import (  # beside this file
    add_redo,
    add_size,
    marked,
    measure_missing,
    new_parser,
)
from series_data import SERIES, series_at_hand
from tqdm import tqdm

import pyvista_vdi as pvdi
from pyvista_vdi.measure.report import system_line, table
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.series import reader
from pyvista_vdi.series.generate import StepMaker

TOLERANCES = (0.01, 0.02, 0.03)
ANGLES = (0.0, 5.0, 20.0)

#: How each volume looks.
LOOKS: dict[str, dict[str, Any]] = {
    "rayleigh_taylor": {"cmap": "coolwarm", "opacity": "linear", "clim": (0, 255)},
    "plume": {"cmap": "inferno", "opacity": "linear", "clim": (0, 255)},
    "cut": {"cmap": "bone", "opacity": "sigmoid_6"},
    "still": {"cmap": "bone", "opacity": "sigmoid_6"},
}

LEGEND = (
    "Bytes over those of the same VDIs as single files (8-byte, zstd), all steps together, and of "
    "the worst step. SSIM is the least of three steps at 0, 5 and 20 degrees from V_O, against "
    "what was written. Bold: what must be reached is not."
)

#: What must be reached: bytes over single files, exact; with a tolerance; and SSIM then.
MOST_EXACT = {"rayleigh_taylor": 0.5, "still": 0.05}
MOST_EVER, MOST_LOSSY, LEAST_SSIM, MOST_DECODED = 1.02, 0.3, 0.99, 3


def main() -> int:
    """Measure what is missing, and write what was found."""
    parser = new_parser(__doc__)
    add_size(parser, (320, 180))
    parser.add_argument("--series", nargs="+", choices=SERIES, default=list(SERIES))
    add_redo(parser)
    parser.add_argument(
        "--timings", action="store_true", help="time generation, in a series over alone"
    )
    options = parser.parse_args()

    def measured_of(name: str) -> dict[str, Any]:
        with tempfile.TemporaryDirectory() as folder:
            return measured(name, Path(folder), options)

    wanted = series_at_hand(options.series)
    measure_missing("series", options, {}, wanted, measured_of, report, parts="series")
    return 0


def measured(name: str, folder: Path, options: argparse.Namespace) -> dict[str, Any]:
    """Return bytes and losses of a series."""
    data = SERIES[name]
    camera = filling_camera(data.step(0).bounds, options.size)
    make = StepMaker("benchmark", camera, options.size, device=options.device, **LOOKS[name])
    files = {t: folder / f"{t}.vdis" for t in (0.0, *TOLERANCES)}
    writers = {t: pvdi.SeriesWriter(file, tolerance=t) for t, file in files.items()}
    single, kept, supersegments, ratios = [], [], 0, []
    shown = {0, data.steps // 2, data.steps - 1}
    for i in tqdm(range(data.steps), desc=name, leave=False):
        volume = data.step(i)
        vdi = make(volume)
        if options.timings:
            ratios.append(generation_ratio(make, volume, camera, options, LOOKS[name]))
        single.append(vdi.save(folder / "single.vdi", compression="zstd").stat().st_size)
        supersegments += vdi.n_supersegments
        for writer in writers.values():
            writer.append(vdi)
        if i in shown:
            kept.append((i, vdi))
    for writer in writers.values():
        writer.close()
    exact = pvdi.read(files[0.0])
    decoded = []
    for i in np.random.default_rng(0).permutation(data.steps)[:12].tolist():
        steps = reader.StepsReader(files[0.0])
        _ = steps[i]
        decoded.append(steps.n_decoded)
    return {
        "steps": data.steps,
        "supersegments": supersegments,
        "single_bytes": sum(single),
        "bytes": files[0.0].stat().st_size,
        "largest_step": max(
            b / s for b, s in zip(reader.read_info(files[0.0]).step_bytes, single, strict=True)
        ),
        "keys": len(reader.read_info(files[0.0]).keys),
        "identical": all(exact[i].equals(vdi) for i, vdi in kept),
        "most_decoded": max(decoded),
        "tolerances": {
            str(t): {
                "bytes": files[t].stat().st_size,
                "ssim": {f"{a:g}": least_ssim(files[t], kept, a, options) for a in ANGLES},
            }
            for t in TOLERANCES
        },
        "generation": statistics.median(ratios) if ratios else None,
    }


def least_ssim(
    file: Path, kept: list[tuple[int, pvdi.VDI]], angle: float, options: argparse.Namespace
) -> float:
    """Return the least SSIM of a file's steps against the VDIs that were written."""
    series = pvdi.read(file)
    found = []
    for i, vdi in kept:
        view = vdi.camera.azimuth(angle)
        pictures = [pvdi.render(v, view, device=options.device) for v in (vdi, series[i])]
        found.append(compare_images(*pictures).ssim)
    return float(min(found))


def generation_ratio(
    make: StepMaker,
    volume: pvdi.Volume,
    camera: pvdi.Camera,
    options: argparse.Namespace,
    looks: dict[str, Any],
) -> float:
    """Return the time of a step in a series over that of the same VDI alone."""

    def seconds(work: Any) -> float:
        start = time.perf_counter()
        work()
        return time.perf_counter() - start

    alone = {"precision": "8-byte", "device": options.device, **looks}
    turns = [
        (
            seconds(lambda: make(volume)),
            seconds(lambda: pvdi.generate(volume, camera, options.size, **alone)),
        )
        for _ in range(3)
    ]
    return statistics.median(one / other for one, other in turns)


def report(results: dict[str, Any]) -> str:
    """Return the table."""
    width, height = results["window_size"]
    lines = [
        f"# Series, {width}x{height} lists, 20 supersegments",
        "",
        LEGEND,
        "",
    ]
    heads = ["series", "steps", "exact", "worst step", "keys", "decoded for a seek"]
    for tolerance in TOLERANCES:
        heads += [f"tolerance {tolerance}: bytes", "SSIM"]
    rows = []
    for name, found in results["series"].items():
        share = found["bytes"] / found["single_bytes"]
        cells = [
            name,
            str(found["steps"]),
            figure(share, share <= MOST_EXACT.get(name, MOST_EVER)),
            figure(found["largest_step"], found["largest_step"] <= MOST_EVER),
            str(found["keys"]),
            figure(found["most_decoded"], found["most_decoded"] <= MOST_DECODED, "{:d}"),
        ]
        for lost in found["tolerances"].values():
            cells.append(figure(lost["bytes"] / found["single_bytes"], True))
            ssim = min(lost["ssim"].values())
            cells.append(figure(ssim, ssim >= LEAST_SSIM, "{:.4f}"))
        rows.append(cells)
    lines += table(heads, rows)
    timed = {n: f["generation"] for n, f in results["series"].items() if f["generation"]}
    if timed:
        lines += ["", "Generation of a step in a series over alone (median of turns):", ""]
        lines += [f"- {name}: {ratio:.2f}" for name, ratio in timed.items()]
    return "\n".join([*lines, "", system_line(results["system"]), ""])


def figure(value: float, reached: bool, form: str = "{:.3f}") -> str:
    """Return a figure, bold where it is not what must be reached."""
    return marked(form.format(value), reached)


if __name__ == "__main__":
    sys.exit(main())
