"""What a VDI's pictures lose, by volume, look, angle and setting; and whether estimates say so.

SSIM to volume rendering at the same steps of every standard case; of other settings; of views that
are zoomed in; of what the presets of the dial choose. Beside the truth stand the estimates from
tiles of the view, and the dial's predictions. Nothing is timed: other work on the machine does not
matter.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from baselines import CRITERIA, RECORDED, cut
from shared import LOOKS, Case, Results, benches, execute, mean_of, parser_of, table

from pyvista_vdi import generate
from pyvista_vdi.measure.bench import accuracy
from pyvista_vdi.model.options import QUALITIES
from pyvista_vdi.quality.targets import TARGET_ANGLE, turned
from pyvista_vdi.quality.view_error import ViewErrorEstimator
from pyvista_vdi.raycasting.prepared import prepared_vdi

ANGLES = (0.0, 5.0, 15.0, 30.0, 60.0, 90.0)

#: Views of the default that no angle tells: degrees and zoom.
ZOOMED = ((0.0, 2.0), (20.0, 2.0), (20.0, 4.0))

#: N_S of the default.
MOST = 20

#: What is changed of the default: arguments of generation, and the lists along an edge per pixel.
SETTINGS: Mapping[str, Mapping[str, Any]] = {
    "default": {},
    "N_S 10": {"max_supersegments": 10},
    "N_S 40": {"max_supersegments": 40},
    "tolerance .01": {"tolerance": 0.01},
    "lists x0.5": {"lists": 0.5},
    "lists x2": {"lists": 2},
    "8-byte": {"precision": "8-byte"},
    "lists x2, N_S 10, 8-byte": {"lists": 2, "max_supersegments": 10, "precision": "8-byte"},
    "view cone 0": {"view_cone": 0.0},
    "homogeneity": {"criterion": "homogeneity"},
    **{name: {"cut": name} for name in CRITERIA},
}

#: Volumes for which one transfer function has to do, because of their size.
SOFT_ONLY = ("allen_mouse_brain",)

#: Qualities that state an SSIM.
PRESETS = tuple(name for name, goal in QUALITIES.items() if goal is not None)


def cases_of(options: Any) -> Iterator[Case]:
    """Yield every case, the default of each look first."""
    size = tuple(options.size)
    for volume in options.volumes:
        for look in LOOKS:
            if look != "soft" and volume in SOFT_ONLY:
                continue
            for setting in SETTINGS:
                yield Case(volume, look, size, what=setting)
            yield Case(volume, look, size, options=(("interpolation", "linear"),), what="default")
            for quality in PRESETS:
                yield Case(volume, look, size, what=f"quality {quality}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, and write what was found."""
    options = parser_of(__doc__).parse_args(arguments)
    with benches(options) as bench_of:

        def measure(case: Case) -> dict[str, Any]:
            interpolation = dict(case.options).get("interpolation", "nearest")
            bench = bench_of(case.volume, case.look, interpolation)
            if case.what in SETTINGS:
                return of_setting(bench, SETTINGS[case.what], estimated=case.what == "default")
            return of_preset(bench, str(case.what).partition(" ")[2])

        execute(
            "accuracy",
            options,
            cases_of(options),
            measure,
            report,
            count=8,
            key=None,
            rooms=("generation", "raycasting", "volume", "quality"),
        )
    return 0


def of_setting(bench: Any, setting: Mapping[str, Any], *, estimated: bool) -> dict[str, Any]:
    """Return how near a VDI's pictures are, by view, how large it is, and what tiles estimate."""
    setting = dict(setting)
    lists = setting.pop("lists", 1)
    shares = setting.pop("cut", None)  # a baseline: cut from all that is recorded
    if shares is not None:
        setting["max_supersegments"] = RECORDED
    vdi = bench.generate(tuple(round(lists * edge) for edge in bench.size), **setting)
    if shares is not None:
        vdi = cut(vdi, shares, MOST)
    views = {f"{angle:g}": bench.view.azimuth(angle) for angle in ANGLES}
    if estimated:
        for angle, zoom in ZOOMED:
            camera = bench.view.azimuth(angle)
            views[f"{angle:g} x{zoom:g}"] = camera.replace(view_angle=camera.view_angle / zoom)
    near: dict[str, Any] = {}
    guesses: dict[str, float] = {}
    estimator = ViewErrorEstimator(bench.volume, bench.table, device=bench.runtime)
    for name, camera in views.items():
        truth, picture = bench.reference(camera), bench.draw(vdi, camera)
        near[name] = accuracy(picture, truth)
        if estimated:
            guesses[name] = estimator.estimate(vdi, camera, bench.size).ssim
    sizes = {
        "supersegments": vdi.n_supersegments,
        "bytes": prepared_vdi(bench.runtime, vdi).list_bytes,
        "longest": int(vdi.counts.max()),
    }
    return {"near": near, "sizes": sizes, **({"estimates": guesses} if estimated else {})}


def of_preset(bench: Any, quality: str) -> dict[str, Any]:
    """Return what is predicted of the goal that a preset names, and the truth."""
    vdi = generate(
        bench.volume,
        bench.view,
        bench.size,
        transfer_function=bench.table,
        target_ssim=QUALITIES[quality],
        device=bench.runtime,
    )
    view = turned(bench.view, bench.volume.bounds, TARGET_ANGLE)
    near = accuracy(bench.draw(vdi, view), bench.reference(view))
    dial = vdi.metadata["dial"]
    truth = {
        "ssim": near["ssim"],
        "bytes": prepared_vdi(bench.runtime, vdi).list_bytes,
    }
    return {"predicted": dial["predicted"], "chosen": dial["chosen"], "truth": truth}


def report(results: Results, every: list[Case]) -> Iterator[str]:
    """Yield SSIM by setting and angle, by volume; estimates; presets."""
    measured = list(results.rows())
    yield "1 - SSIM to volume rendering in thousandths: means over volumes and looks, and their"
    yield "standard errors."
    yield ""
    loss = {f"{a:g}": lambda row, a=f"{a:g}": 1e3 * (1 - row["near"][a]["ssim"]) for a in ANGLES}
    kinds = [(setting, None) for setting in SETTINGS] + [("default", "linear")]
    rows = [
        [
            setting + (f", {interpolation}" if interpolation else ""),
            *(
                mean_of(results, every, of, what=setting, interpolation=interpolation)
                for of in loss.values()
            ),
        ]
        for setting, interpolation in kinds
    ]
    yield from table(("setting", *(f"{angle} degrees" for angle in loss)), rows)
    yield from ("", "The default's SSIM by case:", "")
    views = [f"{angle:g}" for angle in ANGLES]
    rows = [
        [
            *(row["case"][key] for key in ("volume", "look")),
            row["case"].get("interpolation", "nearest"),
            *(f"{row['near'][view]['ssim']:.4f}" for view in views),
            f"{row['near']['30']['brightness']:.4f}",
            f"{row['sizes']['bytes'] / 2**20:.1f}",
        ]
        for row in measured
        if row["case"]["what"] == "default"
    ]
    heads = ["volume", "look", "sampling", *views, "brightness at 30", "MiB"]
    yield from table(heads, rows)
    yield from ("", "Estimates from tiles less the truth, over all cases of a view:", "")
    yield from table(
        ("view", "true SSIM", "error, mean", "without sign", "worst"), errors(measured)
    )
    yield from ("", f"Presets at {TARGET_ANGLE:g} degrees, predicted less the truth:", "")
    rows = []
    for quality in PRESETS:
        found = [row for row in measured if row["case"]["what"] == f"quality {quality}"]
        off = [row["predicted"]["ssim"] - row["truth"]["ssim"] for row in found]
        if found:
            truth = [row["truth"] for row in found]
            least = min(one["ssim"] for one in truth)
            cells = [quality, QUALITIES[quality], len(found), f"{least:.4f}"]
            sizes = [row["predicted"]["bytes"] / row["truth"]["bytes"] for row in found]
            rows.append([*cells, *spread(off), f"{min(sizes):.2f} to {max(sizes):.2f}"])
    heads = ["quality", "asked", "cases", "least SSIM"]
    yield from table(
        (*heads, "error, mean", "without sign", "worst", "bytes, predicted / true"), rows
    )


def errors(measured: list[dict[str, Any]]) -> Iterator[list[str]]:
    """Yield, by view, the truth and how far estimates are from it."""
    found: dict[str, list[tuple[float, float]]] = {}
    for row in measured:
        for view, guess in row.get("estimates", {}).items():
            found.setdefault(view, []).append((row["near"][view]["ssim"], guess))
    for view, pairs in found.items():
        truth = sum(ssim for ssim, _ in pairs) / len(pairs)
        yield [view, f"{truth:.4f}", *spread([guess - ssim for ssim, guess in pairs])]


def spread(off: Sequence[float]) -> list[str]:
    """Return the mean of errors, of their magnitude, and the worst one."""
    magnitudes = [abs(value) for value in off]
    worst = max(off, key=abs)
    return [f"{sum(off) / len(off):+.4f}", f"{sum(magnitudes) / len(off):.4f}", f"{worst:+.4f}"]


if __name__ == "__main__":
    sys.exit(main())
