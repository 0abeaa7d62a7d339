"""The results as Markdown: the fronts, all settings, the dominated ones, and where volumes win."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from pyvista_vdi.measure import report
from pyvista_vdi.measure.clock import CHANCE, median
from pyvista_vdi.measure.harness import CANDIDATES
from pyvista_vdi.measure.report import across, number, section, table
from pyvista_vdi.measure.results import Results
from pyvista_vdi.measure.tradeoff.findings import (
    BYTES_TOLERANCE,
    COSTS,
    SSIM_TOLERANCE,
    TIME_TOLERANCE,
    Point,
    best,
    dominated,
    faster_vtk,
    setting_of,
    volume_renderers,
)

#: What tables call the costs.
_FRONT_TITLES = {
    "frame": "frame / render_volume",
    "memory": "MiB on the device",
    "file": "MiB in the file",
    "generation": "generation / frame at half a voxel",
}


def describe(data: dict[str, Any], points: Sequence[Point]) -> str:
    """Return the tables as Markdown, ending with a newline."""
    plan = data["plan"]
    volume, looks = plan["volume"], plan["looks"]
    seen = ", ".join(f"{name} {value}" for name, value in looks.items()) or "add_volume's defaults"
    if "transfer_function" in looks:
        seen = f"transfer function {plan['transfer_function']}"
    size = across(volume["dimensions"], " x ")
    lines = [
        f"# Tradeoff: {volume['name']}, {across(plan['window_size'])}",
        "",
        f"{size} {volume['dtype']}, {seen}, {plan['interpolation']} sampling.",
        "",
        *_fronts(points),
        *_dominated(points),
        *_volumes(data, points),
        *_settings(data, points),
        *_explanation(plan),
        *report.closing(data)[1:],
    ]
    return "\n".join(lines) + "\n"


def summary(points: Sequence[Point]) -> str:
    """Return the fronts and the dominated settings as a few lines for a terminal."""
    lines = []
    for kind, label in COSTS.items():
        shown = (f"{one.name} ({_cost(one, kind)}, {one.ssim:.4f})" for one in best(points, kind))
        lines.append(f"{label} against SSIM: {'; '.join(shown)}")
    lines += [f"dominated: {name} (by {by[0]})" for name, by in dominated(points).items()]
    return "\n".join(lines)


def _fronts(points: Sequence[Point]) -> Iterator[str]:
    yield from section(
        "The fronts",
        "Settings that no other dominates in SSIM (mean over the angles) and one cost, the "
        "cheapest first; of those that cannot be told apart, the one with the fewest changes.",
    )
    for kind, label in COSTS.items():
        yield from (f"**{label[0].upper()}{label[1:]}**", "")
        rows = ([one.name, _cost(one, kind), f"{one.ssim:.4f}"] for one in best(points, kind))
        yield from (*table(("setting", _FRONT_TITLES[kind], "SSIM"), rows), "")


def _dominated(points: Sequence[Point]) -> Iterator[str]:
    found = dominated(points)
    none = "None: every setting is better than each other one in something."
    some = (
        "Another setting is nowhere worse by what counts (frame time and SSIM at any angle, "
        "memory, file, generation) and somewhere better, beyond the noise."
    )
    yield from section("Dominated settings", some if found else none)
    for name, by in found.items():
        yield f"- {name}: by {'; '.join(by[:3])}" + (f" and {len(by) - 3} more" * (len(by) > 3))
    if found:
        yield ""


def _volumes(data: dict[str, Any], points: Sequence[Point]) -> Iterator[str]:
    """Yield what volume renderers take, and which settings are no faster."""
    baselines = list(Results(data).rows(what="volume rendering"))
    others = {
        name: "without skipping" if name == "volume" else label
        for name, label in CANDIDATES.items()
        if name not in ("vdi", "vdi_skipping", "volume_skipping")
        and any(name in row["seconds"] for row in baselines)
    }
    yield from section(
        "Volume rendering",
        "Frames over `render_volume`, which skips empty blocks; *volume* is the same without. All "
        "take steps of one voxel.",
    )
    over, vtk = volume_renderers(data), faster_vtk(data)
    default = next((one for one in points if one.name == "default"), None)

    def slower(angle: float, limit: float | None) -> str:
        if limit is None:
            return report.ABSENT
        return f"{sum(one.frames[angle] > limit for one in points)} of {len(points)}"

    rows = (
        [
            f"{angle:g}",
            report.milliseconds(median(row["seconds"]["volume_skipping"])),
            *(number(over[angle].get(name), ".2f") for name in others),
            number(near and near["ssim"], ".4f"),
            number(default.frames[angle] if default else None, ".2f"),
            slower(angle, 1.0),
            slower(angle, vtk.get(angle)),
        ]
        for row in baselines
        for angle, near in [(row["case"]["angle"], row["volume_to_vtk_gpu"])]
    )
    heads = ("SSIM to VTK GPU", "default VDI", "slower than render_volume")
    last = "slower than VTK's faster"
    yield from table(("angle", "render_volume, ms", *others.values(), *heads, last), rows)
    yield ""
    left_out = {n: reason for row in baselines for n, reason in row["left_out"].items()}
    for name, reason in sorted(left_out.items()):
        yield from (f"- {CANDIDATES[name]} took no part: {reason}", "")


def _settings(data: dict[str, Any], points: Sequence[Point]) -> Iterator[str]:
    angles, vtk = data["plan"]["angles"], faster_vtk(data)
    better = dominated(points)
    fronts = {kind: {one.name for one in best(points, kind)} for kind in COSTS}
    entries = {setting_of(row).name: row for row in Results(data).rows(what="setting")}
    degrees = [f"{angle:g}°" for angle in angles]
    heads = (
        *("setting", "frame / render_volume", *degrees, "/ faster VTK", "SSIM", *degrees),
        *("PSNR", "worst", "per list", "MiB device", "MiB file", "generation", "s"),
        *("front", "dominated by"),
    )
    rows = (
        [
            one.name,
            f"{one.frame:.2f} ±{one.frame_spread:.0%}",
            *(f"{one.frames[angle]:.2f}" for angle in angles),
            _range([one.frames[angle] / theirs for angle, theirs in vtk.items()]),
            f"{one.ssim:.4f}",
            *(f"{one.ssims[angle]:.4f}" for angle in angles),
            f"{one.psnr:.1f}",
            f"{one.worst_pixel:.0f}",
            f"{entries[one.name]['vdi']['mean_length']:.1f}",
            *(_cost(one, kind) for kind in ("memory", "file", "generation")),
            f"{one.generation_seconds:.2f}",
            ", ".join(kind for kind in COSTS if one.name in fronts[kind]) or report.ABSENT,
            better.get(one.name, [report.ABSENT])[0],
        ]
        for one in points
    )
    yield from (*section("All settings"), *table(heads, rows), "")
    refused = {name: row["refused"] for name, row in entries.items() if "refused" in row}
    if refused:
        yield from section("Not measured")
        yield from (*(f"- {name}: {reason}" for name, reason in refused.items()), "")


def _explanation(plan: dict[str, Any]) -> Iterator[str]:
    yield from section(
        "What the columns are",
        f"Frames: medians of {plan['repeats']} repetitions, each over a frame of `render_volume` "
        "in the same round; over all angles the geometric mean, with half of what lies between the "
        "least and the most repetition. They end with the picture on the host. `/ faster VTK`: "
        "over VTK's faster mapper, which took turns with `render_volume` as well. Generation: the "
        f"median of {plan['generations']}, with packing, over a frame of `render_volume` from V_O "
        "at steps of half a voxel in the same round; `s` is by the clock.",
        "SSIM, PSNR (dB, the least of all angles) and worst pixel (in 1/255): against "
        f"{report.METRICS} MiB on the device: offsets and lists; in the file: a `.vdi` in the "
        "default compression. `lists x2`: twice as many lists as pixels along each edge. `preview "
        "x0.5`: half the pixels along each edge, brought to size. `steps 0.25`: steps of "
        "generation of a quarter of a voxel.",
        f"What does not count: {SSIM_TOLERANCE} of SSIM, {TIME_TOLERANCE:.0%} of a time, "
        f"{BYTES_TOLERANCE:.0%} of bytes. Noise: a time is better if chance alone would separate "
        f"the repetitions as much in at most {CHANCE:.0%} of cases (rank sum). A setting that "
        "dominates another must gain more than it loses, in units of what does not count.",
    )


def _cost(one: Point, kind: str) -> str:
    value = one.cost(kind)
    if value is None or kind in ("memory", "file"):
        return report.mebibytes(value)
    return f"{value:.2f}" if value < 10 else f"{value:.1f}"


def _range(ratios: list[float]) -> str:
    """Return the least and the most, once where they are one."""
    shown = dict.fromkeys((f"{min(ratios):.2f}", f"{max(ratios):.2f}")) if ratios else ()
    return " to ".join(shown) or report.ABSENT
