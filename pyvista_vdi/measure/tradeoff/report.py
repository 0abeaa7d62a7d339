"""The results as Markdown: the fronts, all settings, the dominated ones, and where volumes win."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from pyvista_vdi.errors import InvalidArgumentError, MissingDependencyError
from pyvista_vdi.measure.clock import CHANCE, median
from pyvista_vdi.measure.harness import CANDIDATES
from pyvista_vdi.measure.results import (
    ABSENT,
    METRICS,
    Results,
    across,
    closing,
    mebibytes,
    milliseconds,
    new_figure,
    number,
    section,
    table,
)
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

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: What is drawn, by the keys of :data:`.findings.COSTS`, and the axis that it gets.
_PANELS: Mapping[str, str] = {
    "frame": "frame time / render_volume",
    "memory": "MiB on the device",
    "generation": "generation time / a frame of render_volume at half a voxel",
}

#: Label and colour of settings by the one axis on which they differ from the default; by "" of the
#: default, and of those that differ on several.
_STYLES: Mapping[str, tuple[str, str]] = {
    "": ("default", "black"),
    "max_supersegments": ("N_S", "#0072b2"),
    "tolerance": ("tolerance", "#56b4e9"),
    "lists": ("number of lists", "#d55e00"),
    "precision": ("precision", "#009e73"),
    "skip_empty": ("no skipping", "#8c6d31"),
    "preview": ("preview", "#cc79a7"),
    "criterion": ("criterion", "#e69f00"),
    "view_cone": ("view cone", "#7b4fa3"),
    "sample_distance": ("steps of generation", "#3b3b98"),
    "several": ("several changes", "#777777"),
}

#: SSIM at which the axis may have ticks; it is logarithmic in 1 - SSIM.
_TICKS = (
    *(0.5, 0.7, 0.8, 0.9, 0.95, 0.96, 0.97, 0.98, 0.985, 0.99),
    *(0.995, 0.997, 0.998, 0.999, 0.9995, 0.9999),
)
#: 1 - SSIM below which all is drawn as the same: from V_O it may be 0.
_LEAST_LOSS = 1e-5


def draw(data: dict[str, Any], points: Sequence[Point]) -> Figure:
    """Return the plot: a panel for each cost; see :meth:`.Tradeoff.plot`."""
    if find_spec("matplotlib") is None:
        raise MissingDependencyError(
            "plots are drawn by Matplotlib, which is not installed: install it by pip install "
            '"pyvista-vdi[plot]"'
        )
    if not points:
        raise InvalidArgumentError("nothing was measured, so there is nothing to draw")
    figure = new_figure((19.0, 6.4))
    panels = figure.subplots(1, len(_PANELS), sharey=True)
    fronts = [best(points, kind) for kind in _PANELS]
    for panel, (kind, label), front in zip(panels, _PANELS.items(), fronts, strict=True):
        _draw_panel(panel, points, front, kind)
        panel.set_xlabel(label)
        _draw_limits(panel, data, kind)
    least, most = sorted(panels[0].get_ylim())
    room = (most / least) ** 0.08
    panels[0].set_ylim(most * room, least / room)  # SSIM goes upwards
    angles = ", ".join(f"{angle:g}" for angle in data["plan"]["angles"])
    panels[0].set_ylabel(f"SSIM to render_volume, mean of {angles} degrees")
    figure.suptitle(
        f"{data['plan']['volume']['name']}, {across(data['plan']['window_size'], ' x ')}: what a "
        "VDI's settings cost and give (better: up and left)"
    )
    there = {_style(one) for one in points}
    labels = [(*style, True) for style in _STYLES.values() if style in there]
    handles = [_marker(*label) for label in (*labels, ("not on the front", "#777777", False))]
    figure.legend(handles=handles, loc="lower center", ncols=len(handles), fontsize="small")
    figure.subplots_adjust(left=0.05, right=0.9, top=0.92, bottom=0.15, wspace=0.42)
    for panel, kind, front in zip(panels, _PANELS, fronts, strict=True):
        _name_front(panel, front, kind)
    return figure


def _draw_panel(panel: Axes, points: Sequence[Point], front: Sequence[Point], kind: str) -> None:
    from matplotlib.ticker import (
        AutoLocator,
        FixedLocator,
        FuncFormatter,
        LogLocator,
        NullFormatter,
    )

    for one in points:
        x, y = _place(one, kind)
        marker = _marker(*_style(one), one in front)
        marker.set(data=([x], [y]), zorder=3 if one in front else 2)
        panel.add_line(marker)
    panel.autoscale_view()
    line = [_place(one, kind) for one in front]
    panel.plot(*zip(*line, strict=True), drawstyle="steps-post", color="#aaaaaa", lw=1, zorder=1)
    panel.set(xscale="log", yscale="log")
    panel.grid(alpha=0.25, which="major")
    least, most = panel.get_xlim()  # over less than 5 there may be one of 1, 2, 5, or none
    locator = LogLocator(base=10, subs=(1, 2, 5)) if most / least > 5 else AutoLocator()
    panel.xaxis.set_major_locator(locator)
    panel.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    panel.xaxis.set_minor_formatter(NullFormatter())
    panel.yaxis.set_major_locator(FixedLocator([1 - ssim for ssim in _TICKS]))
    panel.yaxis.set_major_formatter(FuncFormatter(lambda loss, _: f"{1 - loss:.4g}"))
    panel.yaxis.set_minor_locator(FixedLocator([]))


def _draw_limits(panel: Axes, data: dict[str, Any], kind: str) -> None:
    """Draw what a VDI competes with, where that lies within the panel."""
    limits: dict[str, float] = {}
    if kind == "frame":
        limits["render_volume"] = 1.0
        if vtk := sorted(faster_vtk(data).values()):
            limits["VTK, faster mapper"] = vtk[len(vtk) // 2]
    if kind == "memory":
        limits["the volume"] = data["plan"]["volume"]["bytes"] / 2**20
    low, high = panel.get_xlim()
    style = {"rotation": 90, "fontsize": 7, "color": "#777777", "va": "bottom"}
    style["transform"] = panel.get_xaxis_transform()
    for label, x in limits.items():
        if low < x < high:
            panel.axvline(x, color="#bbbbbb", lw=1, ls="--", zorder=0)
            # Outwards of the two, which may be close together
            outwards = "right" if x == min(limits.values()) else "left"
            panel.text(x, 0.01, f" {label}", ha=outwards, **style)


def _place(one: Point, kind: str) -> tuple[float, float]:
    cost = one.cost(kind) or 0.0
    return cost / 2**20 if kind == "memory" else cost, max(_LEAST_LOSS, 1 - one.ssim)


def _style(one: Point) -> tuple[str, str]:
    changed = list(one.changes)
    return _STYLES["several" if len(changed) > 1 else "".join(changed)]


def _marker(label: str, color: str, on_front: bool) -> Any:
    """Return the mark of a setting, hollow and smaller where it is not on the front."""
    from matplotlib.lines import Line2D

    return Line2D(
        [],
        [],
        linestyle="none",
        marker="D" if label == "default" else "o",
        markersize=7 if on_front else 5,
        color=color,
        markerfacecolor=color if on_front else "white",
        alpha=1.0 if on_front else 0.75,
        label=label,
    )


def _name_front(panel: Axes, front: Sequence[Point], kind: str) -> None:
    """Write the names of the front's settings beside the panel, the cheapest lowest, with lines."""
    line = {"arrowstyle": "-", "color": "#bbbbbb", "lw": 0.6, "relpos": (0, 0.5), "shrinkB": 3}
    for i, one in enumerate(front):
        panel.annotate(
            one.name,
            _place(one, kind),
            (1.02, (i + 0.5) / len(front)),
            textcoords="axes fraction",
            fontsize=8,
            va="center",
            annotation_clip=False,
            arrowprops=line,
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
        *closing(data)[1:],
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
            return ABSENT
        return f"{sum(one.frames[angle] > limit for one in points)} of {len(points)}"

    rows = (
        [
            f"{angle:g}",
            milliseconds(median(row["seconds"]["volume_skipping"])),
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
            ", ".join(kind for kind in COSTS if one.name in fronts[kind]) or ABSENT,
            better.get(one.name, [ABSENT])[0],
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
        f"{METRICS} MiB on the device: offsets and lists; in the file: a `.vdi` in the "
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
        return mebibytes(value)
    return f"{value:.2f}" if value < 10 else f"{value:.1f}"


def _range(ratios: list[float]) -> str:
    """Return the least and the most, once where they are one."""
    shown = dict.fromkeys((f"{min(ratios):.2f}", f"{max(ratios):.2f}")) if ratios else ()
    return " to ".join(shown) or ABSENT
