"""How well the dial predicts: SSIM, bytes and frames per second of every rung, over all datasets.

The truth of a rung is made whole: its VDI is generated, rendered at the promised angle and compared
with our volume raycaster's picture. What the dial predicts for it comes from its short measurement.
What is calibrated is fitted to all volumes but one and tested on that one, for each in turn; the
tables show these predictions. Edges along lists are those of pictures from V_O. Writes
``dial_WxH.json`` and ``.md``; a run that is stopped goes on where it was.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import sys
import time
from collections.abc import Iterator
from functools import partial
from itertools import product
from typing import Any, TypeAlias

import numpy as np
from common import (  # beside this file
    add_size,
    add_volumes,
    at_hand,
    new_parser,
    results_file,
    save,
)
from numpy.typing import NDArray
from standard_table import SOFT_ONLY
from tqdm import tqdm

from pyvista_vdi import examples
from pyvista_vdi.api import render, render_volume
from pyvista_vdi.device import get_runtime
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.measure.clock import median, take_turns
from pyvista_vdi.measure.report import table, write_text
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.metrics import compare_images, list_edges, list_places
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.model.standard_cases import TRANSFER_FUNCTIONS, filling_camera
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.quality.dial import (
    EXPONENT,
    FRAME_COST,
    LADDER,
    QUALITIES,
    ROUGH,
    TARGET_ANGLE,
    Dial,
    Measurement,
    Prediction,
    Setting,
    chosen,
    predictions,
)
from pyvista_vdi.quality.probe import Scene, turned
from pyvista_vdi.raycasting.prepared import prepared_vdi

#: Timed frames of each rung, in turns; and of how many rungs: the larger VDIs take too long.
FRAMES, TIMED_RUNGS = 6, 8

#: What the issue asks of a prediction: error in 90 % of the cases, and most that is too hopeful.
WITHIN, TOO_HOPEFUL = 0.01, 0.03

#: Exponents that the calibration tries: the first and the second number of dial.EXPONENT.
GRID = tuple(product(np.arange(0.4, 1.41, 0.05), np.arange(0.0, 1.01, 0.05)))

Case: TypeAlias = dict[str, Any]


def main() -> int:
    """Measure what is missing, and write what was found."""
    options = parsed()
    target = results_file("dial", options)
    cases: dict[str, Case] = json.loads(target.read_text()) if target.exists() else {}
    for name, look in tqdm(cases_of(options), unit="case"):
        entry = cases.setdefault(f"{name}/{look}", {})
        parts = ("frames",) if options.frames else ("truth", "measured", "edges")
        if all(part in entry for part in parts) and not options.redo:
            continue
        volume = examples.load_data(name, as_volume=True)
        table = Classification(dict(TRANSFER_FUNCTIONS[look]), "dial").transfer_function(volume)
        camera = filling_camera(volume.bounds, options.size)
        if options.frames:
            entry["frames"] = frames(volume, table, camera, options)
        elif "measured" not in entry or "edges" not in entry or options.redo:
            entry["measured"] = measured(volume, table, camera, options)
        if not options.frames and "truth" not in entry:
            entry["truth"] = list(truth(volume, table, camera, options))
        if not options.frames and "edges" not in entry:
            entry["edges"] = edges(volume, table, camera, options)
        save(cases, target)
    complete = {k: case for k, case in cases.items() if "measured" in case and "truth" in case}
    write_text(target.with_suffix(".md"), "\n".join([*tables(complete, options.size), ""]))
    print(f"Written: {target} and .md beside it")
    return 0


def parsed() -> argparse.Namespace:
    """Return the options."""
    parser = new_parser(__doc__)
    add_size(parser, (640, 360))
    add_volumes(parser)
    parser.add_argument(
        "--frames",
        action="store_true",
        help="measure what frames of the rungs cost instead, by the process's CPU time: on a CPU",
    )
    parser.add_argument(
        "--redo", action="store_true", help="measure for the dial again; what is true stays"
    )
    return parser.parse_args()


def cases_of(options: argparse.Namespace) -> list[tuple[str, str]]:
    """Return volumes and transfer functions that are at hand; name the volumes that are not."""
    return [
        (name, look)
        for name, look in product(at_hand(options.volumes), TRANSFER_FUNCTIONS)
        if look == "soft" or name not in SOFT_ONLY
    ]


# -- measuring -------------------------------------------------------------------------------------


def measured(
    volume: Volume, table: TransferFunction, camera: Camera, options: argparse.Namespace
) -> Case:
    """Return what the dial measures, and what that costs in time of the process."""
    start = time.process_time()
    scene = Scene(
        volume, camera, options.size, table, TARGET_ANGLE, options.device, GenerationOptions()
    )
    found = scene.measure()
    measuring = time.process_time() - start
    start = time.process_time()
    generate_vdi(volume, camera, options.size, table, device=options.device)
    generating = time.process_time() - start
    return {
        "rough": found.rough,
        "sparse": found.sparse,
        "dense": found.dense,
        "least": found.least,
        "list_edges": [[lists, ratio] for lists, ratio in found.list_edges.items()],
        "counts": found.counts.tolist(),
        "measuring_over_generating": measuring / generating,
    }


def truth(
    volume: Volume, table: TransferFunction, camera: Camera, options: argparse.Namespace
) -> Iterator[Case]:
    """Yield what each rung gives."""
    view = turned(camera, volume.bounds, TARGET_ANGLE)
    runtime = get_runtime(options.device)
    picture = render_volume(volume, view, options.size, transfer_function=table, device=runtime)
    for setting in LADDER:
        vdi = made_by(setting, volume, table, camera, options)
        seen = render(vdi, view, options.size, device=runtime)
        yield {
            "lists": setting.lists,
            "max_supersegments": setting.max_supersegments,
            "ssim": compare_images(seen, picture).ssim,
            "supersegments": vdi.n_supersegments,
            "bytes": prepared_vdi(runtime, vdi).list_bytes,
        }


def made_by(
    setting: Setting,
    volume: Volume,
    table: TransferFunction,
    camera: Camera,
    options: argparse.Namespace,
) -> VDI:
    """Return the VDI of a rung."""
    return generate_vdi(
        volume,
        camera,
        setting.window_size(options.size),
        table,
        max_supersegments=setting.max_supersegments,
        precision=setting.precision,
        device=options.device,
    )


def edges(
    volume: Volume, table: TransferFunction, camera: Camera, options: argparse.Namespace
) -> list[float]:
    """Return the edges along lists that each rung shows from V_O."""
    runtime = get_runtime(options.device)
    picture = render_volume(volume, camera, options.size, transfer_function=table, device=runtime)
    found = []
    for setting in LADDER:
        if setting.lists >= 1:
            found.append(0.0)
            continue
        vdi = made_by(setting, volume, table, camera, options)
        seen = render(vdi, camera, options.size, device=runtime)
        places = list_places(camera, options.size, vdi.window_size)
        found.append(list_edges(seen, picture, *places).ratio)
    return found


def frames(
    volume: Volume, table: TransferFunction, camera: Camera, options: argparse.Namespace
) -> list[float]:
    """Return what a frame of each of the first rungs takes, over one of the rough VDI."""
    view = turned(camera, volume.bounds, TARGET_ANGLE)
    work = {}
    for k, setting in enumerate((ROUGH, *LADDER[:TIMED_RUNGS])):
        vdi = made_by(setting, volume, table, camera, options)
        work[str(k)] = partial(render, vdi, view, options.size, device=options.device)
    taken = take_turns(work, FRAMES, warm_up=False, clocks={"clock": time.process_time})
    rough, *others = map(median, taken.values())
    return [other / rough for other in others]


# -- what was found --------------------------------------------------------------------------------


def tables(cases: dict[str, Case], size: tuple[int, int]) -> list[str]:
    """Return the report in Markdown."""
    rows = predicted(cases, size)
    errors = [row["error"] for row in rows]
    kept = [row["error"] for row in rows if row["chosen_by"]]
    width, height = size
    looks, volumes = len(cases), len({key.split("/")[0] for key in cases})
    return [
        f"# The dial's predictions, {width}x{height}, {TARGET_ANGLE:g} degrees",
        "",
        f"{looks} cases (volume and transfer function) of {volumes} volumes, {len(LADDER)} rungs",
        "each. Error: predicted less true SSIM, so that positive ones are too hopeful. What is",
        "calibrated is fitted to the other volumes.",
        "",
        *table(
            ("predictions of", "n", "mean", "90 %", "most hopeful", "least", "bias"),
            [
                ("all rungs", *_summary(errors)),
                ("rungs that a quality chooses", *_summary(kept)),
                *(
                    (
                        f"{s.lists:.3g} lists per pixel, {s.max_supersegments}",
                        *_summary([r["error"] for r in rows if r["setting"] == s]),
                    )
                    for s in LADDER
                ),
            ],
        ),
        "",
        f"Asked: 90 % within {WITHIN}, none more than {TOO_HOPEFUL} too hopeful: "
        + ("reached." if _reached(errors) else "**missed**."),
        "",
        "**The worst predictions**",
        "",
        *table(
            ("case", "lists", "N_S", "true", "predicted", "error"),
            [
                (
                    row["case"],
                    f"{row['setting'].lists:.3g}",
                    row["setting"].max_supersegments,
                    f"{row['true']:.4f}",
                    f"{row['true'] + row['error']:.4f}",
                    f"{row['error']:+.4f}",
                )
                for row in sorted(rows, key=lambda r: -abs(r["error"]))[:8]
            ],
        ),
        "",
        "**What a quality gives**: the true SSIM of the rung that is chosen",
        "",
        *table(
            (
                "quality",
                "asked",
                "cases",
                "true: mean",
                "least",
                "short of it by most",
                "reached",
                "edges along lists, at most",
            ),
            [
                _of_quality(name, goal, rows, size)
                for name, goal in QUALITIES.items()
                if goal is not None
            ],
        ),
        "",
        "**Edges along lists** at V_O, of rungs of fewer than a list per pixel; error: predicted",
        "over true",
        "",
        *table(
            ("lists per pixel, N_S", "median", "least", "most", "error: median", "5 %", "95 %"),
            [_of_edges(s, rows) for s in LADDER if s.lists < 1],
        ),
        "",
        "**Bytes and frames**, predicted over true. A frame's time is over one of the rough VDI,",
        f"in the process's CPU time, for {len(_timed(cases, size))} rungs of some cases.",
        "",
        *table(
            ("of", "median", "5 %", "95 %"),
            [
                ("bytes on the device", *_spread([row["bytes"] for row in rows])),
                ("time of a full frame", *_spread(_timed(cases, size))),
            ],
        ),
        "",
        "Measuring takes, over generating one list per pixel of 20 supersegments, in the process's",
        f"CPU time: median {_measuring(cases):.2f}.",
        "",
        *_fitted(cases, size),
    ]


def predicted(cases: dict[str, Case], size: tuple[int, int]) -> list[Case]:
    """Return each rung of each case, predicted by what the other volumes calibrate."""
    rows = []
    missed = {key: misses(case, size) for key, case in cases.items()}
    for volume in sorted({key.split("/")[0] for key in cases}):
        others = {k: c for k, c in cases.items() if k.split("/")[0] != volume} or cases
        calibrated = fitted(others, missed)
        for key, case in cases.items():
            if key.split("/")[0] != volume:
                continue
            ladder = _ladder(case, size, **calibrated)
            reaching = {
                ladder.index(chosen(Dial.of(name), ladder, size).prediction): name
                for name, goal in QUALITIES.items()
                if goal is not None
            }
            true_edges = case.get("edges", [0.0] * len(ladder))
            of_rungs = zip(ladder, case["truth"], true_edges, strict=True)
            for i, (rung, true, edges_seen) in enumerate(of_rungs):
                rows.append(
                    {
                        "case": key,
                        "setting": rung.setting,
                        "ladder": ladder,
                        "edges": edges_seen,
                        "true": true["ssim"],
                        "error": rung.ssim - true["ssim"],
                        "bytes": rung.nbytes / true["bytes"],
                        "chosen_by": reaching.get(i),
                    }
                )
    return rows


def misses(case: Case, size: tuple[int, int]) -> NDArray[np.float64]:
    """Return how far the rungs' predictions are off together, for each exponent of GRID."""
    true = np.array([one["ssim"] for one in case["truth"]])
    ladders = (_ladder(case, size, exponent=exponent) for exponent in GRID)
    return np.array([np.abs([rung.ssim for rung in ladder] - true).sum() for ladder in ladders])


def fitted(
    cases: dict[str, Case], missed: dict[str, NDArray[np.float64]]
) -> dict[str, tuple[float, float]]:
    """Return the calibration that fits cases best; ``missed`` is what :func:`misses` gives."""
    # Times: least squares of logarithms
    equations, values = [[1.0, 0.0], [0.0, 1.0]], list(FRAME_COST)
    for case in cases.values():
        for setting, ratio in zip(LADDER, case.get("frames", ()), strict=False):
            denser = math.log(setting.lists / ROUGH.lists)
            longer = math.log(setting.max_supersegments / ROUGH.max_supersegments)
            equations.append([denser, longer])
            values.append(math.log(ratio))
    cost = np.linalg.lstsq(np.array(equations[2:] or equations), np.array(values[2:] or values))[0]
    first, second = GRID[int(np.sum([missed[key] for key in cases], axis=0).argmin())]
    return {
        "exponent": (float(first), float(second)),
        "frame_cost": (float(cost[0]), float(cost[1])),
    }


def _ladder(case: Case, size: tuple[int, int], **calibrated: Any) -> tuple[Prediction, ...]:
    found = case["measured"]
    losses = (found[name] for name in ("rough", "sparse", "dense"))
    edges_by_lists = dict(found.get("list_edges", ()))
    measurement = Measurement(
        *losses, np.array(found["counts"]), 1.0, found["least"], edges_by_lists
    )
    return predictions(measurement, size, **calibrated)


def _timed(cases: dict[str, Case], size: tuple[int, int]) -> list[float]:
    """Return predicted over true times, in frames of the rough VDI."""
    return [
        1 / rung.fps / true
        for case in cases.values()
        for rung, true in zip(_ladder(case, size), case.get("frames", ()), strict=False)
    ]


def _of_quality(name: str, goal: float, rows: list[Case], size: tuple[int, int]) -> tuple[Any, ...]:
    true, seen = [], []
    for case in sorted({row["case"] for row in rows}):
        of_case = [row for row in rows if row["case"] == case]
        ladder = of_case[0]["ladder"]
        row = of_case[ladder.index(chosen(Dial.of(name), ladder, size).prediction)]
        true.append(row["true"])
        seen.append(row["edges"])
    reached = sum(ssim >= goal for ssim in true)
    return (
        name,
        goal,
        len(true),
        f"{statistics.fmean(true):.4f}",
        f"{min(true):.4f}",
        f"{max(0.0, goal - min(true)):.4f}",
        f"{reached / len(true):.0%}",
        f"{max(seen):.2f}",
    )


def _of_edges(setting: Setting, rows: list[Case]) -> tuple[Any, ...]:
    of_setting = [
        (row["edges"], rung.list_edges)
        for row in rows
        for rung in row["ladder"]
        if row["setting"] == rung.setting == setting and row["edges"] > 0
    ]
    true = [seen for seen, _ in of_setting] or [math.nan]
    return (
        f"{setting.lists:.3g}, {setting.max_supersegments}",
        *(f"{n:.2f}" for n in (statistics.median(true), min(true), max(true))),
        *_spread([said / seen for seen, said in of_setting]),
    )


def _summary(errors: list[float]) -> tuple[Any, ...]:
    sizes = np.abs(errors)
    numbers = (np.mean(sizes), np.quantile(sizes, 0.9), max(errors), min(errors), np.mean(errors))
    mean, most, hopeful, least, bias = (float(n) for n in numbers)
    return (
        len(errors),
        f"{mean:.4f}",
        f"{most:.4f}",
        f"{hopeful:+.4f}",
        f"{least:+.4f}",
        f"{bias:+.4f}",
    )


def _reached(errors: list[float]) -> bool:
    within = float(np.quantile(np.abs(errors), 0.9)) <= WITHIN
    return within and max(errors) <= TOO_HOPEFUL


def _spread(ratios: list[float]) -> tuple[str, ...]:
    return tuple(f"{np.quantile(ratios, q):.3f}" if ratios else "-" for q in (0.5, 0.05, 0.95))


def _measuring(cases: dict[str, Case]) -> float:
    return statistics.median(c["measured"]["measuring_over_generating"] for c in cases.values())


def _fitted(cases: dict[str, Case], size: tuple[int, int]) -> list[str]:
    best = fitted(cases, {key: misses(case, size) for key, case in cases.items()})
    (a, b), (c, d) = best["exponent"], best["frame_cost"]
    return [
        f"Fitted to all volumes: EXPONENT ({a:.2f}, {b:.2f}), FRAME_COST ({c:.2f}, {d:.2f});",
        f"in use: {EXPONENT} and {FRAME_COST}.",
    ]


if __name__ == "__main__":
    sys.exit(main())
