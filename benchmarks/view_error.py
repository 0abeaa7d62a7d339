"""How well a view's estimated error predicts the true one, and what the estimate costs.

The truth is the SSIM of the VDI's whole picture against our volume raycaster's. Views are turned
about the volume by growing angles, and moved in ways that no angle tells: closer, beyond what V_O's
viewport showed, with fewer lists than pixels. Two predictors that need no volume are fitted for
comparison, each tested on volumes that it was not fitted to. Writes ``view_error_WxH.json``,
``.md`` and ``.png``.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from common import (  # beside this file
    add_looks,
    add_redo,
    add_size,
    add_volumes,
    at_hand,
    new_parser,
    results_file,
    save,
    subject_of,
)
from numpy.typing import NDArray
from tqdm import tqdm

from pyvista_vdi.api import render, render_volume
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.measure.clock import median, take_turns
from pyvista_vdi.measure.report import new_figure, save_figure, table, write_text
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.quality.view_error import TILE_SIZE, TILES, ViewErrorEstimator

VOLUMES = ("aneurism", "bonsai", "brain", "heptane", "rayleigh_taylor", "tooth")
LOOKS = ("soft", "steep")

#: Tiles and their edges in pixels that are tried.
VARIANTS = ((4, 24), (9, 24), (16, 24), (32, 24), (32, 16), (9, 32), (16, 32))
DEFAULT = (TILES, TILE_SIZE)

#: What a VDI may be required to reach before it is made anew.
BOUNDS = (0.99, 0.98, 0.97, 0.95, 0.9)

#: 1 - SSIM below which pictures are called equal: such views tell predictors nothing.
EQUAL = 1e-5


@dataclass(frozen=True)
class View:
    """A new view, and the VDI that it is seen by."""

    kind: str  # "turned" or "moved"
    azimuth: float  # degrees from V_O
    zoom: float = 1.0  # of the new view
    own_zoom: float = 1.0  # of V_O: above 1, its viewport cuts the volume off
    lists: float = 1.0  # along an edge of the VDI's window, over the frame's pixels

    @property
    def name(self) -> str:
        """What the tables call it."""
        changes = [f"{self.azimuth:g}°"]
        changes += [f"zoom {self.zoom:g}"] if self.zoom != 1 else []
        changes += [f"V_O zoomed {self.own_zoom:g}"] if self.own_zoom != 1 else []
        changes += [f"{self.lists:g} lists a pixel"] if self.lists != 1 else []
        return ", ".join(changes)


VIEWS = (
    *(View("turned", angle) for angle in (0, 5, 10, 20, 30, 45, 60, 90)),
    View("moved", 0, zoom=2),
    View("moved", 20, zoom=2),
    View("moved", 20, zoom=4),
    View("moved", 0, own_zoom=2.3),
    View("moved", 20, own_zoom=2.3),
    View("moved", 0, lists=0.5),
    View("moved", 20, lists=0.5),
)


def main() -> int:
    """Measure what is missing, and write what was found."""
    parser = new_parser(__doc__)
    add_size(parser, (640, 360))
    add_volumes(parser, VOLUMES)
    add_looks(parser, tf=None, max_supersegments=None)
    add_redo(parser)
    options = parser.parse_args()
    target = results_file("view_error", options)
    cases: dict[str, Any] = json.loads(target.read_text()) if target.exists() else {}
    for volume, look in tqdm(list(product(at_hand(options.volumes), LOOKS)), unit="case"):
        key = "/".join((volume, look, options.interpolation))
        if key not in cases or options.redo:
            cases[key] = list(measured(volume, look, options))
            save(cases, target)
    rows = [{"case": key, "volume": key.split("/")[0], **r} for key in cases for r in cases[key]]
    write_text(target.with_suffix(".md"), "\n".join([*tables(rows, options.size), ""]))
    plot(rows, target.with_suffix(".png"))
    print(f"Written: {target}, and .md and .png beside it")
    return 0


# -- measuring -------------------------------------------------------------------------------------


def measured(name: str, look: str, options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Yield what was found in each view of one volume."""
    volume, classified, _ = subject_of(name, options, look)
    estimators = {
        (tiles, edge): ViewErrorEstimator(
            volume, classified, tiles=tiles, tile_size=edge, device=options.device
        )
        for tiles, edge in {*VARIANTS, DEFAULT}
    }
    vdis: dict[Any, VDI] = {}
    for view in VIEWS:
        camera = zoomed(filling_camera(volume.bounds, options.size), view.own_zoom)
        lists = tuple(round(edge * view.lists) for edge in options.size)
        if (camera, lists) not in vdis:
            vdis[camera, lists] = generate_vdi(
                volume, camera, lists, classified, device=options.device
            )
        vdi = vdis[camera, lists]
        camera = zoomed(camera, view.zoom / view.own_zoom).azimuth(view.azimuth)
        yield found(view, vdi, volume, classified, camera, estimators, options)


def found(
    view: View,
    vdi: VDI,
    volume: Volume,
    classified: TransferFunction,
    camera: Camera,
    estimators: dict[tuple[int, int], ViewErrorEstimator],
    options: argparse.Namespace,
) -> dict[str, Any]:
    """Compare the whole pictures, and estimate the same from tiles."""
    size, device = options.size, options.device
    frame, reference = (
        lambda: render(vdi, camera, size, device=device),
        lambda: render_volume(volume, camera, size, transfer_function=classified, device=device),
    )
    picture = frame()
    estimates = {
        variant: estimator.estimate(vdi, camera, size, picture=picture)
        for variant, estimator in estimators.items()
    }
    alone = estimators[DEFAULT]
    candidates: dict[str, Callable[[], object]] = {
        "vdi": frame,
        "volume": reference,
        "estimate": lambda: alone.estimate(vdi, camera, size),
        "estimate with picture": lambda: alone.estimate(vdi, camera, size, picture=picture),
    }
    taken = take_turns(candidates, 5, warm_up=False)
    guess = alone.estimate(vdi, camera, size)
    return {
        "view": view.name,
        "kind": view.kind,
        "ssim": compare_images(picture, reference()).ssim,
        "angle": guess.angle,
        "magnification": guess.magnification,
        "anisotropy": anisotropy(vdi),
        "estimates": {
            variant_name(variant): [e.ssim, e.standard_error] for variant, e in estimates.items()
        },
        "without_picture": guess.ssim,
        "seconds": {name: median(times) for name, times in taken.items()},
    }


def zoomed(camera: Camera, factor: float) -> Camera:
    """Return the camera with a longer lens: things look ``factor`` times as large."""
    tangent = math.tan(math.radians(camera.view_angle) / 2) / factor
    return camera.replace(view_angle=2 * math.degrees(math.atan(tangent)))


def anisotropy(vdi: VDI) -> float:
    """Length of a supersegment over the width of its list, on average by visible opacity."""
    visible = -np.expm1(-vdi.optical_depth.astype(np.float64))
    _, half_height = vdi.camera.half_extent(vdi.window_size)
    middle = vdi.depth_origin + (vdi.front.astype(np.float64) + vdi.back) / 2
    widths = middle * 2 * half_height / vdi.window_size[1]
    return float(np.average((vdi.back.astype(np.float64) - vdi.front) / widths, weights=visible))


# -- predictors without the volume -----------------------------------------------------------------


def predicted(rows: list[dict[str, Any]], features: Callable[[Any], list[float]]) -> NDArray[Any]:
    """Return 1 - SSIM as a product of powers of features, fitted to the other volumes' rows."""
    table = np.array([[1.0, *features(row)] for row in rows])
    losses = np.log(np.maximum([1 - row["ssim"] for row in rows], EQUAL))
    volumes = np.array([row["volume"] for row in rows])
    result = np.empty(len(rows))
    for volume in set(volumes):
        others = volumes != volume
        fit, *_ = np.linalg.lstsq(table[others], losses[others], rcond=None)
        result[~others] = np.exp(table[~others] @ fit)
    return result


def from_nothing(_: Any) -> list[float]:
    """The same for every view."""
    return []


def from_angle(row: dict[str, Any]) -> list[float]:
    """Power of the angle."""
    return [math.log(1 + row["angle"])]


def from_view(row: dict[str, Any]) -> list[float]:
    """Powers of the angle, the magnification and the lists' anisotropy."""
    return [*from_angle(row), math.log(row["magnification"]), math.log(row["anisotropy"])]


PREDICTORS = {
    "the same for all views": from_nothing,
    "angle": from_angle,
    "angle, magnification, anisotropy of lists": from_view,
}


PREDICTOR_HEADS = (
    *("predictor", "mean", "90 %", "worst", "bias", "relative"),
    "within 2 standard errors",
)


# -- tables and plot -------------------------------------------------------------------------------


def tables(rows: list[dict[str, Any]], size: tuple[int, int]) -> Iterator[str]:
    """Yield the findings as Markdown."""
    yield f"{size[0]} x {size[1]}; {len({row['case'] for row in rows})} cases, {len(rows)} views."
    yield "Errors are estimated SSIM less true SSIM, without their sign except for the bias;"
    yield "*relative* is the mean error over the mean of 1 - SSIM."
    for kind in ("turned", "moved"):
        some = telling(rows, kind)
        true = np.array([row["ssim"] for row in some])
        spread = f"true SSIM {true.min():.3f} to {true.max():.3f}"
        yield f"\n**{kind.capitalize()} views** ({len(some)}; {spread})\n"
        found = [
            row_of(name, 1 - predicted(some, features) - true, 1 - true, None)
            for name, features in PREDICTORS.items()
        ]
        for variant in sorted({*VARIANTS, DEFAULT}):
            pairs = np.array([row["estimates"][variant_name(variant)] for row in some])
            held = np.abs(pairs[:, 0] - true) <= 2 * pairs[:, 1]
            tiles = f"{variant_name(variant)} tiles"
            found.append(row_of(tiles, pairs[:, 0] - true, 1 - true, held))
        yield from table(PREDICTOR_HEADS, found)
    yield "\n**Decisions**: views on the wrong side of a bound, of all whose pictures differ\n"
    yield from decisions(telling(rows, "turned") + telling(rows, "moved"))
    yield "\n**Truth and estimate by view** (mean over the cases)\n"
    found = []
    some = telling(rows, "turned") + telling(rows, "moved")
    by_angle = dict(zip(map(id, some), 1 - predicted(some, from_angle), strict=True))
    for view in dict.fromkeys(row["view"] for row in rows):
        some = [row for row in rows if row["view"] == view]
        true = [row["ssim"] for row in some]
        estimates = [row["estimates"][variant_name(DEFAULT)][0] for row in some]
        angles = [by_angle.get(id(row), 1.0) for row in some]
        ssim = (np.mean(true), min(true), np.mean(estimates), np.mean(angles))
        found.append([view, *(f"{value:.4f}" for value in ssim)])
    yield from table(("view", "true SSIM", "least", "estimate", "from the angle"), found)
    yield "\n**Cost** (median over all views; ratios within one run)\n"
    found = []
    for name in ("estimate", "estimate with picture"):
        seconds = [row["seconds"] for row in rows]
        ratios = [
            f"{statistics.median(s[name] / s[peer] for s in seconds):.2f}"
            for peer in ("volume", "vdi")
        ]
        milliseconds = 1e3 * statistics.median(s[name] for s in seconds)
        found.append([name, *ratios, f"{milliseconds:.0f}"])
    yield from table(("", "over a volume frame", "over a VDI frame", "milliseconds"), found)


def decisions(rows: list[dict[str, Any]]) -> Iterator[str]:
    """Yield how often a predictor would regenerate in vain, or not although it is needed."""
    true = np.array([row["ssim"] for row in rows])
    predictions = {name: 1 - predicted(rows, features) for name, features in PREDICTORS.items()}
    tiles = variant_name(DEFAULT)
    predictions[f"{tiles} tiles"] = np.array([row["estimates"][tiles][0] for row in rows])
    rows_below = []
    for bound in BOUNDS:
        wrong = [np.mean((guess < bound) != (true < bound)) for guess in predictions.values()]
        rows_below.append(
            [f"{bound:g}", f"{np.mean(true < bound):.0%}", *(f"{w:.0%}" for w in wrong)]
        )
    yield from table(("SSIM at least", "truly below", *predictions), rows_below)


def row_of(name: str, errors: NDArray[Any], losses: NDArray[Any], held: Any) -> list[str]:
    """Return one predictor's row."""
    size = np.abs(errors)
    share = "" if held is None else f"{np.mean(held):.0%}"
    cells = [f"{value:.4f}" for value in (size.mean(), np.quantile(size, 0.9), size.max())]
    return [name, *cells, f"{errors.mean():+.4f}", f"{size.mean() / losses.mean():.0%}", share]


def telling(rows: list[dict[str, Any]], kind: str) -> list[dict[str, Any]]:
    """Return the views of a kind whose pictures differ."""
    return [row for row in rows if row["kind"] == kind and 1 - row["ssim"] > EQUAL]


def variant_name(variant: tuple[int, int]) -> str:
    """Name tiles and their edge."""
    return f"{variant[0]} x {variant[1]}²"


def plot(rows: list[dict[str, Any]], target: Path) -> None:
    """Plot estimated over true 1 - SSIM: from tiles, and from the angle."""
    figure = new_figure((9, 4.4))
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    some = telling(rows, "turned") + telling(rows, "moved")
    losses = np.array([1 - row["ssim"] for row in some])
    tiles = np.array([1 - row["estimates"][variant_name(DEFAULT)][0] for row in some])
    titles = (f"from {variant_name(DEFAULT)} tiles", "from the angle alone")
    for axes, guess, title in zip(
        panels, (tiles, predicted(some, from_angle)), titles, strict=True
    ):
        for kind, marker in (("turned", "o"), ("moved", "^")):
            chosen = np.array([row["kind"] == kind for row in some])
            axes.scatter(
                losses[chosen], np.maximum(guess[chosen], EQUAL), 14, marker=marker, label=kind
            )
        ends = [losses.min(), losses.max()]
        axes.plot(ends, ends, color="0.5", linewidth=1)
        axes.set(xscale="log", yscale="log", title=title, xlabel="true 1 - SSIM")
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("predicted 1 - SSIM")
    panels[0].legend(fontsize=8)
    figure.tight_layout()
    save_figure(figure, target, 80)


if __name__ == "__main__":
    sys.exit(main())
