"""The fronts as a picture: each cost against SSIM, with the settings on the front named."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
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

#: Colour of a setting by the one axis on which it differs from the default.
_COLORS: Mapping[str, str] = {
    "max_supersegments": "#0072b2",
    "tolerance": "#56b4e9",
    "lists": "#d55e00",
    "precision": "#009e73",
    "skip_empty": "#8c6d31",
    "preview": "#cc79a7",
    "criterion": "#e69f00",
    "view_cone": "#7b4fa3",
    "sample_distance": "#3b3b98",
}
_LABELS: Mapping[str, str] = {
    "max_supersegments": "N_S",
    "lists": "number of lists",
    "skip_empty": "no skipping",
    "view_cone": "view cone",
    "sample_distance": "steps of generation",
}
_DEFAULT_COLOR, _SEVERAL_COLOR = "black", "#777777"

#: SSIM at which the axis may have ticks; it is logarithmic in 1 - SSIM.
_TICKS = (
    *(0.5, 0.7, 0.8, 0.9, 0.95, 0.96, 0.97, 0.98, 0.985, 0.99),
    *(0.995, 0.997, 0.998, 0.999, 0.9995, 0.9999),
)
#: 1 - SSIM below which all is drawn as the same: from V_O it may be 0.
_LEAST_LOSS = 1e-5

_LABEL_SIZE = 8
#: Distances of a label from its point, points of 1/72 inch, in the order in which they are tried.
_DISTANCES = (7, 14, 22, 32, 44, 58, 74, 92, 112)
#: Directions in which a label may stand, and how it is aligned there.
_DIRECTIONS = (
    (1, 1, "left", "bottom"),
    (1, -1, "left", "top"),
    (-1, 1, "right", "bottom"),
    (-1, -1, "right", "top"),
    (0, 1, "center", "bottom"),
    (0, -1, "center", "top"),
    (1, 0, "left", "center"),
    (-1, 0, "right", "center"),
)

#: Where a label's line begins, shares of its box, by how it is aligned.
_SIDES = {"left": 0.0, "center": 0.5, "right": 1.0, "bottom": 0.0, "top": 1.0}


def draw(data: dict[str, Any], points: Sequence[Point]) -> Figure:
    """Return the plot: a panel for each cost; see :meth:`.Tradeoff.plot`."""
    if find_spec("matplotlib") is None:
        raise MissingDependencyError(
            "plots are drawn by Matplotlib, which is not installed: install it by pip install "
            '"pyvista-vdi[plot]"'
        )
    if not points:
        raise InvalidArgumentError("nothing was measured, so there is nothing to draw")
    figure = new_figure((15.5, 6.4))
    panels = figure.subplots(1, len(_PANELS), sharey=True)
    fronts = [best(points, kind) for kind in _PANELS]
    for panel, (kind, label), front in zip(panels, _PANELS.items(), fronts, strict=True):
        _draw_panel(panel, points, front, kind)
        panel.set_xlabel(label)
    _set_room(panels)
    for panel, kind in zip(panels, _PANELS, strict=True):
        _draw_limits(panel, data, kind)
    angles = ", ".join(f"{angle:g}" for angle in data["plan"]["angles"])
    panels[0].set_ylabel(f"SSIM to render_volume, mean of {angles} degrees")
    figure.suptitle(
        f"{data['plan']['volume']['name']}, {across(data['plan']['window_size'], ' x ')}: what a "
        "VDI's settings cost and give (better: up and left)"
    )
    handles = [_marker(color, label) for label, color in _legend(points)]
    handles.append(_marker("none", "not on the front"))
    figure.legend(handles=handles, loc="lower center", ncols=len(handles), fontsize="small")
    figure.subplots_adjust(left=0.062, right=0.99, top=0.92, bottom=0.15, wspace=0.06)
    for panel, kind, front in zip(panels, _PANELS, fronts, strict=True):
        _name_front(figure, panel, points, front, kind)
    return figure


def _draw_panel(panel: Axes, points: Sequence[Point], front: Sequence[Point], kind: str) -> None:
    for one in points:
        x, y = _place(one, kind)
        color = _color(one)
        on = one in front
        panel.plot(
            [x],
            [y],
            linestyle="none",
            marker="D" if one.name == "default" else "o",
            markersize=7 if on else 5,
            color=color,
            markerfacecolor=color if on else "white",
            alpha=1.0 if on else 0.75,
            zorder=3 if on else 2,
        )
    line = [_place(one, kind) for one in front]
    panel.plot(*zip(*line, strict=True), drawstyle="steps-post", color="#aaaaaa", lw=1, zorder=1)
    panel.set(xscale="log", yscale="log")
    panel.grid(alpha=0.25, which="major")
    _set_ticks(panel)


def _draw_limits(panel: Axes, data: dict[str, Any], kind: str) -> None:
    """Draw what a VDI competes with, where that lies within the panel."""
    limits: dict[str, float] = {}
    if kind == "frame":
        limits["render_volume"] = 1.0
        vtk = faster_vtk(data)
        if vtk:
            limits["VTK, faster mapper"] = sorted(vtk.values())[len(vtk) // 2]
    if kind == "memory":
        limits["the volume"] = data["plan"]["volume"]["bytes"] / 2**20
    low, high = panel.get_xlim()
    for label, x in limits.items():
        if low < x < high:
            panel.axvline(x, color="#bbbbbb", lw=1, ls="--", zorder=0)
            panel.text(
                x,
                0.01,
                f" {label}",
                transform=panel.get_xaxis_transform(),
                rotation=90,
                fontsize=7,
                color="#777777",
                # Outwards of the two, which may be close together
                ha="right" if x == min(limits.values()) else "left",
                va="bottom",
            )


def _place(one: Point, kind: str) -> tuple[float, float]:
    cost = one.cost(kind) or 0.0
    return cost / 2**20 if kind == "memory" else cost, max(_LEAST_LOSS, 1 - one.ssim)


def _set_room(panels: Sequence[Axes]) -> None:
    """Leave room for names at the borders; SSIM, which all panels share, goes upwards."""
    for panel in panels:
        low, high = panel.get_xlim()
        panel.set_xlim(low / (high / low) ** 0.12, high * (high / low) ** 0.12)
    least, most = sorted(panels[0].get_ylim())
    room = (most / least) ** 0.08
    panels[0].set_ylim(most * room, least / room)


def _set_ticks(panel: Axes) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter

    panel.xaxis.set_major_locator(LogLocator(base=10, subs=(1, 2, 5)))
    panel.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    panel.xaxis.set_minor_formatter(NullFormatter())
    panel.yaxis.set_major_locator(FixedLocator([1 - ssim for ssim in _TICKS]))
    panel.yaxis.set_major_formatter(FuncFormatter(lambda loss, _: f"{1 - loss:.4g}"))
    panel.yaxis.set_minor_locator(FixedLocator([]))


def _color(one: Point) -> str:
    changed = list(one.changes)
    if not changed:
        return _DEFAULT_COLOR
    return _COLORS[changed[0]] if len(changed) == 1 else _SEVERAL_COLOR


def _legend(points: Sequence[Point]) -> Iterator[tuple[str, str]]:
    """Yield labels and colours of what there is, the default first and several changes last."""
    there = {_color(one) for one in points}
    names = [("default", _DEFAULT_COLOR)]
    names += [(_LABELS.get(axis, axis), color) for axis, color in _COLORS.items()]
    names.append(("several changes", _SEVERAL_COLOR))
    yield from ((label, color) for label, color in names if color in there)


def _marker(color: str, label: str) -> Any:
    from matplotlib.lines import Line2D

    hollow = color == "none"
    return Line2D(
        [],
        [],
        linestyle="none",
        marker="D" if label == "default" else "o",
        color=_SEVERAL_COLOR if hollow else color,
        markerfacecolor="white" if hollow else color,
        label=label,
    )


def _name_front(
    figure: Figure, panel: Axes, points: Sequence[Point], front: Sequence[Point], kind: str
) -> None:
    """Write the names of the front's settings where they cover neither points nor each other."""
    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    border = panel.get_window_extent(renderer)
    places = [panel.transData.transform(_place(one, kind)) for one in points]
    radius = 4.5 * figure.dpi / 72
    taken = [(x - radius, y - radius, x + radius, y + radius) for x, y in places]
    taken += [_corners(text.get_window_extent(renderer)) for text in panel.texts]
    for one in front:
        style = {
            "text": one.name,
            "xy": _place(one, kind),
            "textcoords": "offset points",
            "fontsize": _LABEL_SIZE,
            "zorder": 4,
        }
        trial = panel.annotate(xytext=(0, 0), **style)
        best = None
        for distance, (dx, dy, ha, va) in itertools.product(_DISTANCES, _DIRECTIONS):
            trial.set(position=(dx * distance, dy * distance), ha=ha, va=va)
            box = _corners(trial.get_window_extent(renderer))
            cost = sum(_overlap(box, other) for other in taken) + _outside(box, border)
            if best is None or cost < best[0]:
                best = cost, (dx * distance, dy * distance), ha, va, box
            if cost == 0:
                break
        trial.remove()
        assert best is not None
        _, position, ha, va, box = best
        line = {"arrowstyle": "-", "color": "#999999", "lw": 0.6, "shrinkA": 1, "shrinkB": 3}
        line["relpos"] = _SIDES[ha], _SIDES[va]
        panel.annotate(xytext=position, ha=ha, va=va, arrowprops=line, **style)
        taken.append(box)


_Box = tuple[float, float, float, float]


def _corners(box: Any) -> _Box:
    return box.x0, box.y0, box.x1, box.y1


def _overlap(a: _Box, b: _Box) -> float:
    """Return the area that two boxes share, pixels squared."""
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    return max(0.0, width) * max(0.0, height)


def _outside(box: _Box, border: Any) -> float:
    """Return the area of a box that lies beyond a border, pixels squared."""
    whole = (box[2] - box[0]) * (box[3] - box[1])
    return whole - _overlap(box, _corners(border))
