"""The results as Markdown: the fronts, all settings, the dominated ones, and where volumes win."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pyvista_vdi.measure.benchmark.candidates import CANDIDATES
from pyvista_vdi.measure.benchmark.changes import CHANCE
from pyvista_vdi.measure.tradeoff.findings import (
    BYTES_TOLERANCE,
    COSTS,
    SSIM_TOLERANCE,
    TIME_TOLERANCE,
    Point,
    Tradeoff,
    faster_vtk,
    peers,
    volume_milliseconds,
)
from pyvista_vdi.model.metrics import SSIM_ARGUMENTS, SSIM_WINDOW

_ABSENT = "-"

#: What tables call the costs.
_FRONT_TITLES = {
    "frame": "frame / render_volume",
    "memory": "MiB on the device",
    "file": "MiB in the file",
    "generation": "generation / frame at half a voxel",
}


def describe(found: Tradeoff) -> str:
    """Return the tables as Markdown, ending with a newline."""
    data = found.data
    volume, (width, height) = data["plan"]["volume"], data["plan"]["window_size"]
    size = " x ".join(str(n) for n in volume["dimensions"])
    lines = [
        f"# Tradeoff: {volume['name']}, {width}x{height}",
        "",
        f"{size} {volume['dtype']}, {_looks(data)}, {data['plan']['interpolation']} sampling.",
        "",
        *_fronts(found),
        *_dominated(found),
        *_volumes(found),
        *_settings(found),
        *_refused(data),
        *_explanation(data),
        "",
        f"Measured from {data['begun']} to {data['changed']} on: "
        + ", ".join(f"{name} {value}" for name, value in data["system"].items())
        + ".",
    ]
    return "\n".join(lines) + "\n"


def summary(found: Tradeoff) -> str:
    """Return the fronts and the dominated settings as a few lines for a terminal."""
    lines = []
    for kind, label in COSTS.items():
        best = [found.point(name) for name in found.front(kind)]
        shown = "; ".join(f"{one.name} ({_cost(one, kind)}, {one.ssim:.4f})" for one in best)
        lines.append(f"{label} against SSIM: {shown}")
    for name, by in found.dominated().items():
        lines.append(f"dominated: {name} (by {by[0]})")
    return "\n".join(lines)


def _looks(data: dict[str, Any]) -> str:
    looks = data["plan"]["looks"]
    if "transfer_function" in looks:
        return f"transfer function {data['plan']['transfer_function']}"
    return ", ".join(f"{name} {value}" for name, value in looks.items()) or "add_volume's defaults"


def _fronts(found: Tradeoff) -> Iterator[str]:
    yield "## The fronts"
    yield ""
    yield (
        "Settings that no other dominates in SSIM (mean over the angles) and one cost, the "
        "cheapest first; of those that cannot be told apart, the one with the fewest changes."
    )
    yield ""
    for kind, label in COSTS.items():
        yield f"**{label[0].upper()}{label[1:]}**"
        yield ""
        yield _row("setting", _FRONT_TITLES[kind], "SSIM")
        yield "|" + "---|" * 3
        for name in found.front(kind):
            one = found.point(name)
            yield _row(name, _cost(one, kind), f"{one.ssim:.4f}")
        yield ""


def _dominated(found: Tradeoff) -> Iterator[str]:
    yield "## Dominated settings"
    yield ""
    dominated = found.dominated()
    if not dominated:
        yield "None: every setting is better than each other one in something."
        yield ""
        return
    yield (
        "Another setting is nowhere worse by what counts (frame time and SSIM at any angle, "
        "memory, file, generation) and somewhere better, beyond the noise."
    )
    yield ""
    for name, by in dominated.items():
        yield f"- {name}: by {'; '.join(by[:3])}" + (f" and {len(by) - 3} more" * (len(by) > 3))
    yield ""


def _volumes(found: Tradeoff) -> Iterator[str]:
    """Say what volume renderers take, and which settings are no faster."""
    data = found.data
    others = {
        name: label
        for name, label in CANDIDATES.items()
        if name not in ("vdi", "vdi_skipping", "volume_skipping")
        and any(name in row["seconds"] for row in data["baselines"])
    }
    yield "## Volume rendering"
    yield ""
    yield (
        "Frames over `render_volume`, which skips empty blocks; *volume* is the same without. All "
        "take steps of one voxel."
    )
    yield ""
    yield _row(
        "angle",
        "render_volume, ms",
        *(label if name != "volume" else "without skipping" for name, label in others.items()),
        "SSIM to VTK GPU",
        "default VDI",
        "slower than render_volume",
        "slower than VTK's faster",
    )
    yield "|" + "---|" * (6 + len(others))
    ratios, milliseconds, vtk = peers(data), volume_milliseconds(data), faster_vtk(data)
    for row in data["baselines"]:
        angle, near = row["angle"], row["volume_to_vtk_gpu"]
        default = next((one for one in found.points if one.name == "default"), None)
        yield _row(
            f"{angle:g}",
            f"{milliseconds[angle]:.3g}",
            *(f"{ratios[angle][n]:.2f}" if n in ratios[angle] else _ABSENT for n in others),
            f"{near['ssim']:.4f}" if near else _ABSENT,
            f"{default.frames[angle]:.2f}" if default else _ABSENT,
            _share(found.points, angle, 1.0),
            _share(found.points, angle, vtk.get(angle)),
        )
    yield ""
    for name, reason in sorted(data["left_out"].items()):
        yield f"- {CANDIDATES[name]} took no part: {reason}"
        yield ""


def _settings(found: Tradeoff) -> Iterator[str]:
    data = found.data
    angles, vtk = data["plan"]["angles"], faster_vtk(data)
    dominated = found.dominated()
    fronts = {kind: set(found.front(kind)) for kind in COSTS}
    yield "## All settings"
    yield ""
    yield _row(
        "setting",
        "frame / render_volume",
        *(f"{angle:g}°" for angle in angles),
        "/ faster VTK",
        "SSIM",
        *(f"{angle:g}°" for angle in angles),
        "PSNR",
        "worst",
        "per list",
        "MiB device",
        "MiB file",
        "generation",
        "s",
        "front",
        "dominated by",
    )
    yield "|" + "---|" * (13 + 2 * len(angles))
    entries = {entry["name"]: entry for entry in data["points"]}
    for one in found.points:
        on = [kind for kind in COSTS if one.name in fronts[kind]]
        yield _row(
            one.name,
            f"{one.frame:.2f} ±{one.frame_spread:.0%}",
            *(f"{one.frames[angle]:.2f}" for angle in angles),
            _to_vtk(one, vtk),
            f"{one.ssim:.4f}",
            *(f"{one.ssims[angle]:.4f}" for angle in angles),
            f"{one.psnr:.1f}",
            f"{one.worst_pixel:.0f}",
            f"{entries[one.name]['vdi']['mean_length']:.1f}",
            _cost(one, "memory"),
            _cost(one, "file"),
            _cost(one, "generation"),
            f"{one.generation_seconds:.2f}",
            ", ".join(on) or _ABSENT,
            (dominated.get(one.name) or [_ABSENT])[0],
        )
    yield ""


def _refused(data: dict[str, Any]) -> Iterator[str]:
    refused = [entry for entry in data["points"] if entry["refused"] is not None]
    if not refused:
        return
    yield "## Not measured"
    yield ""
    for entry in refused:
        yield f"- {entry['name']}: {entry['refused']}"
    yield ""


def _explanation(data: dict[str, Any]) -> Iterator[str]:
    plan = data["plan"]
    ssim = ", ".join(f"{name}={value}" for name, value in SSIM_ARGUMENTS.items())
    yield "## What the columns are"
    yield ""
    yield (
        f"Frames: medians of {plan['repeats']} repetitions, each over a frame of `render_volume` "
        "in the same round; over all angles the geometric mean, with half of what lies between the "
        "least and the most repetition. They end with the picture on the host. `/ faster VTK`: "
        "over VTK's faster mapper, which took turns with `render_volume` as well. Generation: the "
        f"median of {plan['generations']}, with packing, over a frame of `render_volume` from V_O "
        "at steps of half a voxel in the same round; `s` is by the clock."
    )
    yield ""
    yield (
        "SSIM, PSNR (dB, the least of all angles) and worst pixel (in 1/255): against "
        "`render_volume` at steps of half a voxel, RGB over black, not quantised. "
        f"SSIM: scikit-image, {ssim}, window of {SSIM_WINDOW}. MiB on "
        "the device: offsets and lists; in the file: a `.vdi` in the default compression. "
        "`lists x2`: twice as many lists as pixels along each edge. `preview x0.5`: half the "
        "pixels along each edge, brought to size. `steps 0.25`: steps of generation of a quarter "
        "of a voxel."
    )
    yield ""
    yield (
        f"What does not count: {SSIM_TOLERANCE} of SSIM, {TIME_TOLERANCE:.0%} of a time, "
        f"{BYTES_TOLERANCE:.0%} of bytes. Noise: a time is better if chance alone would separate "
        f"the repetitions as much in at most {CHANCE:.0%} of cases (rank sum). A setting that "
        "dominates another must gain more than it loses, in units of what does not count."
    )


def _cost(one: Point, kind: str) -> str:
    value = one.cost(kind)
    if value is None:
        return _ABSENT
    if kind in ("memory", "file"):
        return f"{value / 2**20:.2f}"
    return f"{value:.2f}" if value < 10 else f"{value:.1f}"


def _to_vtk(one: Point, vtk: dict[float, float]) -> str:
    """Return the range over the angles of a setting's frame over VTK's faster mapper's."""
    ratios = sorted(one.frames[angle] / theirs for angle, theirs in vtk.items())
    if not ratios:
        return _ABSENT
    return f"{ratios[0]:.2f}" if len(ratios) == 1 else f"{ratios[0]:.2f} to {ratios[-1]:.2f}"


def _share(points: list[Point], angle: float, limit: float | None) -> str:
    if limit is None:
        return _ABSENT
    return f"{sum(one.frames[angle] > limit for one in points)} of {len(points)}"


def _row(*cells: str) -> str:
    return "| " + " | ".join(cells) + " |"
