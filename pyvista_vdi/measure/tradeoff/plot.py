"""The fronts as a picture: each cost against SSIM, with the settings on the front named."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from pyvista_vdi.errors import InvalidArgumentError, MissingDependencyError
from pyvista_vdi.measure.report import across, new_figure
from pyvista_vdi.measure.tradeoff.findings import Point, best, faster_vtk

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
    from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter

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
    panel.xaxis.set_major_locator(LogLocator(base=10, subs=(1, 2, 5)))
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
