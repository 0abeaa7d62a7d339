"""The paper's rivals beside ours: time over N_S, lists, angle, emptiness; accuracy, memory, claims.

Writes ``rivals.json`` (all figures), ``.md`` (tables), ``.png`` (plot), ``_views.png`` (what they
draw). See README.md in this folder, and docs/rivals.md.

One case, what is measured of it, and the tables of it: hence more than 500 lines.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from common import add_clock, add_size, begun, clock_of, new_parser, save  # beside this file
from scaling import Fit, _short, fitted
from tqdm import tqdm

from pyvista_vdi import examples, reference
from pyvista_vdi.device import Runtime, get_runtime
from pyvista_vdi.errors import VDIError
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.measure.clock import take_turns
from pyvista_vdi.measure.paper import paper_cell
from pyvista_vdi.measure.report import (
    across,
    describe_system,
    mebibytes,
    milliseconds,
    new_figure,
    number,
    save_figure,
    section,
    system_line,
    table,
    write_text,
)
from pyvista_vdi.measure.rivals.frusta import Frusta
from pyvista_vdi.measure.rivals.two_phase import TwoPhase
from pyvista_vdi.measure.rivals.world_rays import WorldRays
from pyvista_vdi.measure.session import VDIRenderer, accuracy
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.prepared import PreparedVDI
from pyvista_vdi.raycasting.scene import Scene
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.render import raycast_medium

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))

#: Who draws, by the keys of the results, and what tables call them.
WAYS: Mapping[str, str] = {
    "f": "ours, f",
    "f_e": "ours, f_e",
    "rays": "ours, f, ray by ray",
    "world": "world rays, halving",
    "linear": "world rays, linear",
    "levels": "two-phase",
    "frusta": "frusta, OpenCL",
    "opengl": "frusta, OpenGL",
}
#: Those that are not measured at every point, as they take long.
OBJECT_SPACE = ("frusta", "opengl")
#: Turns of the others for each turn of theirs.
QUICK_TURNS = 4
SWEPT = (4, 8, 15, 30, 60)
PAPERS_ANGLES = (5.0, 30.0)
ANGLES = (0.0, 5.0, 15.0, 30.0, 90.0)
#: Axes over which time is fitted by a power.
POWERS = ("limit", "limit_near", "lists", "both")
#: Of the pictures, degrees.
SHOWN_ANGLES = (30.0, 90.0)
#: Scalars, as shares of their range, below which the medium is transparent.
THRESHOLDS = (0.0, 0.7, 0.8, 0.9)
#: Random VDIs for each kind of view.
RANDOM = 3
#: What the pictures of those that claim the same one may differ by.
TOLERANCE = 1e-3
#: Each system's own criterion.
OWN = {"f": "least-error", "world": "transmittance", "frusta": "homogeneity", "levels": "length"}


@dataclass(frozen=True)
class Case:
    """One point of the sweeps: N_S, quarters of the window's edges that lists and pixels have."""

    limit: int = 15
    lists: int = 4
    pixels: int = 4
    angle: float = 30.0
    threshold: float = 0.0


BASE = Case()
AXES: Mapping[str, tuple[str, Sequence[Case]]] = {
    "limit": ("N_S, at 30 degrees", [replace(BASE, limit=n) for n in SWEPT]),
    "limit_near": ("N_S, at 5 degrees", [replace(BASE, limit=n, angle=5.0) for n in SWEPT]),
    "lists": ("lists", [replace(BASE, lists=n) for n in (1, 2, 3, 4)]),
    "both": ("lists and pixels", [replace(BASE, lists=n, pixels=n) for n in (1, 2, 3, 4)]),
    "angle": ("angle, degrees", [replace(BASE, angle=angle) for angle in ANGLES]),
    "filled": ("filled share", [replace(BASE, threshold=share) for share in THRESHOLDS]),
}


class Bench:
    """A volume, its VDIs, and who draws them."""

    def __init__(self, runtime: Runtime, options: argparse.Namespace) -> None:
        self._runtime, self._size, self._vtk = runtime, tuple(options.size), options.vtk
        self._volume = examples.load_data(options.volume, as_volume=True)
        self._view = filling_camera(self._volume.bounds, self._size)
        self._repeats, self._clocks = options.repeats, {"clock": clock_of(options, runtime)}
        self._vdis: dict[Any, VDI] = {}
        self.left_out: dict[str, str] = {}

    def size(self, quarters: int) -> tuple[int, int]:
        """Return a window of so many quarters of the edges."""
        width, height = self._size
        return width * quarters // 4, height * quarters // 4

    def table(self, case: Case) -> Any:
        """Return the transfer function: a ramp above the threshold."""
        ramp = np.clip((np.linspace(0, 1, 65) - case.threshold) / (1.01 - case.threshold), 0, 1)
        arguments = {"cmap": "bone", "opacity": ramp.tolist()}
        return Classification(arguments, "a benchmark").transfer_function(self._volume)

    def vdi(self, case: Case, criterion: str = "least-error") -> VDI:
        """Return a case's VDI, made once."""
        key = (case.limit, case.lists, case.threshold, criterion)
        if key not in self._vdis:
            self._vdis[key] = generate_vdi(
                self._volume,
                self._view,
                self.size(case.lists),
                self.table(case),
                max_supersegments=case.limit,
                criterion=criterion,
                device=self._runtime,
            )
        return self._vdis[key]

    def ways(
        self,
        case: Case,
        stack: ExitStack,
        taken: dict[str, Any],
        criterion: str = "least-error",
        without: Sequence[str] = (),
    ) -> dict[str, Callable[[Any], Any]]:
        """Return who draws a case's VDI; what preparing and keeping it takes goes to ``taken``."""
        vdi, size, runtime = self.vdi(case, criterion), self.size(case.pixels), self._runtime
        ours = VDIRenderer(runtime, vdi, size)

        def one_by_one(camera: Any) -> Any:
            with mock.patch.object(Scene, "in_vectors", False):
                return ours.image(camera, skip_empty=False)

        makers: dict[str, Callable[[], Any]] = {
            "world": lambda: WorldRays(runtime, vdi),
            "linear": lambda: WorldRays(runtime, vdi, binary=False),
            "levels": lambda: TwoPhase(runtime, vdi, case.limit),
            "frusta": lambda: Frusta(runtime, vdi),
            "opengl": lambda: self._opengl(vdi, size, stack),
        }
        ways: dict[str, Callable[[Any], Any]] = {
            "f": partial(ours.image, skip_empty=False),
            "f_e": ours.image,
            "rays": one_by_one,
        }
        for way in without:
            del makers[way]
        begin = time.perf_counter()
        prepared = PreparedVDI(runtime, vdi)
        masks = prepared.occupancy.masks.nbytes
        for way, more in (("f", 0), ("f_e", masks), ("rays", 0)):
            taken[way] = (time.perf_counter() - begin, prepared.list_bytes + more)
        del prepared
        for way, make in makers.items():
            begin = time.perf_counter()
            try:
                rival = make()
            except VDIError as error:
                self.left_out[way] = str(error)
                continue
            taken[way] = (time.perf_counter() - begin, rival.nbytes)
            ways[way] = rival.image if way == "opengl" else partial(rival.image, size=size)
        return ways

    def _opengl(self, vdi: VDI, size: tuple[int, int], stack: ExitStack, **options: Any) -> Any:
        if not self._vtk:
            raise VDIError("left out by --no-vtk")
        from pyvista_vdi.measure.rivals.opengl import OpenGLFrusta

        drawn = OpenGLFrusta(vdi, size, **options)
        stack.callback(drawn.close)
        return drawn

    def measured(self, axis: str) -> list[dict[str, Any]]:
        """Time an axis' cases, all of them in turn; compare the pictures with ours."""
        rows, quick, slow = [], {}, {}
        with ExitStack() as stack:
            for case in AXES[axis][1]:
                taken: dict[str, Any] = {}
                camera, vdi = self._view.azimuth(case.angle), self.vdi(case)
                without = OBJECT_SPACE if axis == "limit_near" else ()
                ways = self.ways(case, stack, taken, without=without)
                images = {way: draw(camera) for way, draw in ways.items()}
                off = {way: np.abs(im - images["f"]).max(axis=-1) for way, im in images.items()}
                for way, draw in ways.items():
                    steps = slow if way in OBJECT_SPACE else quick
                    steps[f"{len(rows)} {way}"] = partial(draw, camera)
                thickness = (vdi.back - vdi.front).astype(np.float64).sum()
                extent = float(vdi.back.max() - vdi.front.min())
                rows.append(
                    {
                        **asdict(case),
                        "supersegments": vdi.n_supersegments,
                        "lists": int(vdi.counts.size),
                        "filled": thickness / (extent * vdi.counts.size),
                        "prepare": {way: seconds for way, (seconds, _) in taken.items()},
                        "bytes": {way: nbytes for way, (_, nbytes) in taken.items()},
                        "off": {way: float((e > TOLERANCE).mean()) for way, e in off.items()},
                        "worst": {way: float(error.max()) for way, error in off.items()},
                        "seconds": {},
                    }
                )
            turns, how = self._repeats, {"warm_up": False, "clocks": self._clocks}
            found = {
                **take_turns(quick, turns * QUICK_TURNS, **how),
                **take_turns(slow, turns, **how),
            }
        for name, times in found.items():
            row, way = name.split()
            rows[int(row)]["seconds"][way] = min(times["clock"])
        return rows

    def against_volume(self) -> dict[str, Any]:
        """Return SSIM to the volume by angle: each with its own lists, and of the base case's."""
        medium = DeviceVolume(
            self._runtime,
            self._volume,
            self.table(BASE),
            sample_distance=min(self._volume.spacing) / 2,
        )
        found: dict[str, Any] = {}
        with ExitStack() as stack:
            drawn = {way: self.ways(BASE, stack, {}, OWN[way])[way] for way in OWN}
            drawn["levels of ours"] = self.ways(BASE, stack, {})["levels"]
            if "opengl" not in self.left_out:
                eight = self._opengl(self.vdi(BASE), self._size, stack, float_buffer=False)
                drawn["frusta of ours, 8 bits"] = eight.image
            for angle in ANGLES:
                camera = self._view.azimuth(angle)
                image = raycast_medium(medium, FrameRequest(camera, self._size))
                for way, draw in drawn.items():
                    ssim = accuracy(draw(camera), image)["ssim"]
                    found.setdefault(way, {})[f"{angle:g}"] = ssim
        return found

    def opengl(self) -> str | None:
        """Return who draws frusta by OpenGL."""
        with ExitStack() as stack:
            if "opengl" in self.left_out:
                return None
            described: str = self._opengl(self.vdi(BASE), self._size, stack).opengl
            return described

    def show(self, target: Path) -> None:
        """Write what the base case's VDI looks like, by angle and by who draws it."""
        figure = new_figure((10.0, 5.0), layout="constrained")
        with ExitStack() as stack:
            ways = self.ways(BASE, stack, {})
            shown = [way for way in ("f", "world", "opengl", "levels") if way in ways]
            rows = figure.subplots(2, len(shown))
            for row, angle in zip(rows, SHOWN_ANGLES, strict=True):
                for panel, way in zip(row, shown, strict=True):
                    image = ways[way](self._view.azimuth(angle))[..., :3]
                    margin = (image.shape[1] - image.shape[0]) // 2
                    panel.imshow(np.clip(image[:, margin : image.shape[1] - margin], 0, 1))
                    panel.set_title(f"{WAYS[way]}, {angle:g}°", fontsize="small")
                    panel.set_axis_off()
        save_figure(figure, target, dpi=90)


def against_oracle(runtime: Runtime, vtk: bool) -> dict[str, Any]:
    """Return, by kind of view and way, the worst difference and the share beyond the tolerance."""
    import strategies  # of the tests: beside their oracle

    found: dict[str, Any] = {}
    for number_of_kind, kind in enumerate(strategies.VIEWS):
        errors: dict[str, list[Any]] = {}
        for case in range(RANDOM):
            rng = np.random.default_rng([case, number_of_kind])
            vdi = strategies.random_vdi(rng)
            camera, size = strategies.random_view(rng, vdi, kind)
            exact = reference.render(vdi, camera, size)
            ours = VDIRenderer(runtime, vdi, size)
            images = {
                "f": ours.image(camera),
                "world": WorldRays(runtime, vdi).image(camera, size),
                "frusta": Frusta(runtime, vdi).image(camera, size),
                "levels": TwoPhase(runtime, vdi, 12).image(camera, size),
            }
            if vtk:
                from pyvista_vdi.measure.rivals.opengl import OpenGLFrusta

                drawn = OpenGLFrusta(vdi, size)
                images["opengl"] = drawn.image(camera)
                drawn.close()
            for way, image in images.items():
                errors.setdefault(way, []).append(np.abs(image - exact).max(axis=-1).ravel())
        joined = {way: np.concatenate(parts) for way, parts in errors.items()}
        found[kind] = {
            way: [float(all_.max()), float((~(all_ <= TOLERANCE)).mean())]
            for way, all_ in joined.items()
        }
    return found


# -- what is said of it ----------------------------------------------------------------------------


def rows_of(results: Mapping[str, Any], axis: str) -> list[tuple[float, dict[str, Any]]]:
    """Return an axis' points: what is changed, and what was measured."""
    field = {"both": "lists"}.get(axis, axis.partition("_")[0])
    return [(row[field], row) for row in results["axes"][axis]]


def fits(results: Mapping[str, Any], axis: str) -> dict[str, Fit]:
    """Return the exponents of time over an axis of which power laws are expected."""
    rows = [(value, row["seconds"]) for value, row in rows_of(results, axis)]
    ways = [way for way in WAYS if all(way in seconds for _, seconds in rows)]
    if axis not in POWERS:
        return {}
    return {w: fitted([v for v, _ in rows], [s[w] for _, s in rows]) for w in ways}


def base_of(results: Mapping[str, Any]) -> dict[str, Any]:
    """Return what was measured of the base case, among other N_S."""
    return next(row for value, row in rows_of(results, "limit") if value == BASE.limit)


def doubling(results: Mapping[str, Any], axis: str, way: str) -> float:
    """Return the share of the rate that is lost from N_S 15 to 30."""
    seconds = {value: p["seconds"][way] for value, p in rows_of(results, axis)}
    return float(1 - seconds[15] / seconds[30])


def papers_doubling() -> list[float]:
    """Return the same of the paper's Table 1, cell by cell."""
    lost = []
    for name in ("kingsnake", "beechnut", "richtmyer_meshkov"):
        for size in ((1280, 720), (1920, 1080)):
            for angle in PAPERS_ANGLES:
                few, many = (paper_cell(name, size, limit, angle) for limit in (15, 30))
                if few is None or many is None:
                    continue
                lost += [1 - many.fps / few.fps, 1 - many.fps_skipping / few.fps_skipping]
    return lost


def claims(results: Mapping[str, Any]) -> Iterator[Sequence[str]]:
    """Yield a row for each claim: what it says, what was found, and the verdict."""

    def exponents(axis: str, low: float, high: float, *ways: str) -> tuple[str, str]:
        found = {way: fit for way, fit in fits(results, axis).items() if way in ways}
        verdict = "confirmed"
        if not all(low <= fit.exponent <= high for fit in found.values()):
            verdict = "not settled: within the margins"
        if any(f.exponent + f.margin < low for f in found.values()):
            verdict = "not so: it is less"
        if any(f.exponent - f.margin > high for f in found.values()):
            verdict = "not so: it is more"
        return "; ".join(f"{WAYS[way]} {_power(fit)}" for way, fit in found.items()), verdict

    for axis, what in (("limit", "N_S"), ("lists", "N_L"), ("both", "N_L, with the pixels")):
        text, verdict = exponents(axis, 0.8, 1.2, *OBJECT_SPACE)
        yield f"object-space cost is proportional to {what}: exponent .8 to 1.2", text, verdict
    for axis in ("limit", "limit_near"):
        text, verdict = exponents(axis, -1.0, 0.3, "f", "f_e", "rays")
        yield f"ours hardly depends on N_S ({AXES[axis][0]}): exponent .3 at most", text, verdict
    lost = {
        (axis, way): doubling(results, axis, way)
        for axis in ("limit_near", "limit")
        for way in ("f", "f_e")
    }
    text = ", ".join(f"{WAYS[w]} {AXES[a][0][5:]} {x:.0%}" for (a, w), x in lost.items())
    verdict = "confirmed" if all(x <= 0.25 for x in lost.values()) else "not so"
    yield "doubling N_S from 15 to 30 costs about a fifth of the rate: .25 at most", text, verdict
    there = [way for way in OBJECT_SPACE if way in base_of(results)["seconds"]]
    text = ", ".join(f"{WAYS[way]} {doubling(results, 'limit', way):.0%}" for way in there)
    yield "object space loses half of the rate", text, ""
    theirs = papers_doubling()
    text = (
        f"{len(theirs)} cells of Table 1: median {statistics.median(theirs):.0%}, "
        f"from {min(theirs):.0%} to {max(theirs):.0%}; "
        f"{sum(x >= 0.15 for x in theirs)} at 15 % or more"
    )
    yield "the same by the paper's own figures", text, "rather a seventh than a fifth"
    seconds = base_of(results)["seconds"]
    text = ", ".join(
        f"over {WAYS[way]} {seconds['world'] / seconds[way]:.1f}" for way in ("rays", "f", "f_e")
    )
    good = seconds["world"] > 1.05 * seconds["rays"]
    yield (
        "stepping in clip space is simpler than in the world: time of world rays",
        text,
        "confirmed" if good else "not so",
    )
    at = {value: p["seconds"] for value, p in rows_of(results, "angle")}
    text = ", ".join(
        f"{WAYS[way]} {at[90.0][way] / at[5.0][way]:.1f}"
        for way in WAYS
        if way in at[90.0] and way in at[5.0]
    )
    good = all(at[90.0][way] > 2 * at[5.0][way] for way in ("f", "world"))
    yield (
        "rates fall with the angle: time at 90 over 5 degrees, 2 at least",
        text,
        "confirmed" if good else "not so",
    )


def report(results: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of the tables."""
    base = base_of(results)
    there = [way for way in WAYS if way in base["seconds"]]
    case = f"{results['volume']}, {across(results['window_size'])}, N_S {BASE.limit}"
    turns = results["repeats"]
    least = (
        f"least of {turns * QUICK_TURNS} turns, of {turns} of frusta, by {results['clock']} time"
    )
    yield from ("# The paper's rivals", "")
    yield from (f"{case}, {BASE.angle:g} degrees, unless changed; {least}.", "")
    yield from section("Claims")
    yield from table(("claim", "found", "verdict"), claims(results))
    yield ""
    yield from section("Exponents", "Of time; with 95 % confidence intervals.")
    yield from table(
        ("grows with", *(WAYS[way] for way in there)),
        [[AXES[axis][0], *(_power(fits(results, axis).get(w)) for w in there)] for axis in POWERS],
    )
    yield from ("", "<!-- figures -->")  # where pages may cut this
    for axis, (name, _) in AXES.items():
        yield from ("", f"## Milliseconds by {name}", "")
        shown = [
            [
                f"{value:.4g}",
                f"{p['supersegments']}",
                *(milliseconds(p["seconds"].get(w)) for w in there),
            ]
            for value, p in rows_of(results, axis)
        ]
        yield from table((name, "supersegments", *(WAYS[way] for way in there)), shown)
    yield from ("", "## Memory and preparation", "")
    yield from table(
        ("", *(WAYS[way] for way in there)),
        [
            ["MiB", *(mebibytes(base["bytes"][way]) for way in there)],
            ["ms before the first frame", *(milliseconds(base["prepare"][way]) for way in there)],
            ["pixels off by more than 1e-3", *(f"{base['off'][way]:.1e}" for way in there)],
            ["worst difference from ours", *(f"{base['worst'][way]:.1e}" for way in there)],
        ],
    )
    what = "worst difference, and share of pixels beyond"
    of = f"{RANDOM} random VDIs for each kind of view: {what} {TOLERANCE:g}."
    yield from ("", "<!-- pictures -->", "", "## Against the oracle", "", of, "")
    ways = list(next(iter(results["oracle"].values())))
    yield from table(
        ("view", *(WAYS[way] for way in ways)),
        [
            [kind, *(f"{found[w][0]:.0e}, {found[w][1]:.2%}" for w in ways)]
            for kind, found in results["oracle"].items()
        ],
    )
    yield from (
        "",
        "## SSIM to the volume",
        "",
        "Each with lists by its own criterion, and of ours.",
        "",
    )
    rows = [
        [WAYS.get(w, w), OWN.get(w, "least-error"), *(number(by[f"{a:g}"], ".4f") for a in ANGLES)]
        for w, by in results["ssim"].items()
    ]
    yield from table(("", "criterion", *(f"{angle:g} degrees" for angle in ANGLES)), rows)
    if results["left_out"]:
        yield from ("", f"Left out: {results['left_out']}")
    yield from ("", f"{system_line(results['system'])}; OpenGL: {results['opengl']}")


def _power(fit: Fit | None) -> str:
    return "-" if fit is None else f"{fit.exponent:.2f} ± {fit.margin:.2f}"


def write_plot(results: Mapping[str, Any], target: Path) -> None:
    """Write a panel per axis, time by what is changed, with the fitted exponents."""
    figure = new_figure((12.0, 7.0), layout="constrained")
    panels = figure.subplots(2, 3).ravel()
    for panel, axis in zip(panels, AXES, strict=True):
        found = fits(results, axis)
        for n, way in enumerate(WAYS):
            points = [
                (v, p["seconds"][way]) for v, p in rows_of(results, axis) if way in p["seconds"]
            ]
            if not points:
                continue
            x, y = (np.array(side) for side in zip(*points, strict=True))
            label = WAYS[way] + (f": {found[way].exponent:.2f}" if way in found else "")
            panel.plot(
                x,
                1e3 * y,
                "o-" if way in ("f", "f_e", "rays") else "s--",
                color=f"C{n}",
                label=label,
                markersize=4,
            )
        panel.set(xscale="log" if axis in POWERS else "linear", yscale="log", xlabel=AXES[axis][0])
        if axis in POWERS:
            values = [value for value, _ in rows_of(results, axis)]
            panel.set_xticks(values, [_short(value) for value in values])
            panel.tick_params(axis="x", which="minor", bottom=False, labelbottom=False)
        panel.grid(alpha=0.3, which="both")
        panel.legend(fontsize=6)
    for panel in panels[::3]:
        panel.set_ylabel("ms")
    save_figure(figure, target)


def main() -> int:
    """Measure, and write what was found."""
    parser = new_parser(
        __doc__,
        repeats=2,
        repeated="turns of what is slow at each point; the others have four times as many",
    )
    add_size(parser, (640, 360))
    add_clock(parser)
    parser.add_argument("--volume", choices=sorted(examples.VOLUMES), default="brain")
    parser.add_argument("--no-vtk", dest="vtk", action="store_false", help="leave OpenGL out")
    parser.add_argument(
        "--axes",
        nargs="+",
        choices=list(AXES),
        help="measure these alone, where all have been measured before",
    )
    options = parser.parse_args()
    runtime, target = get_runtime(options.device), options.out / "rivals.json"
    bench = Bench(runtime, options)
    options.out.mkdir(parents=True, exist_ok=True)
    case = {
        "volume": options.volume,
        "window_size": list(options.size),
        "repeats": options.repeats,
        "clock": options.clock,
        "system": describe_system(options.device),
    }
    results = begun(target, case, "axes") if options.axes else {**case, "axes": {}}
    for axis in tqdm(options.axes or AXES, unit="axis"):
        results["axes"][axis] = bench.measured(axis)
        save(results, target)
    if not options.axes:
        results["ssim"] = bench.against_volume()
        results["oracle"] = against_oracle(runtime, "opengl" not in bench.left_out)
        results["opengl"] = bench.opengl()
        results["left_out"] = bench.left_out
        bench.show(options.out / "rivals_views.png")
    save(results, target)
    write_text(target.with_suffix(".md"), "\n".join([*report(results), ""]))
    write_plot(results, target.with_suffix(".png"))
    print(f"Written: {target}, and .md and .png beside it")
    return 0


if __name__ == "__main__":
    sys.exit(main())
