"""What each setting of a VDI costs and gives, measured on one volume: ``pyvista-vdi tradeoff``.

Everything runs without VTK and PyVista; where VTK is installed its mappers are timed beside.
"""

from __future__ import annotations

import math
import os
import statistics
import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError, VDIError, needing
from pyvista_vdi.io import whole_file
from pyvista_vdi.measure import bench as measuring
from pyvista_vdi.measure.bench import Bench, Step, ratio, take_turns
from pyvista_vdi.model.arguments import records_of
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.inputs import as_volume
from pyvista_vdi.model.metrics import SSIM_WINDOW, compare_images
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.raycasting.prepared import prepared_vdi
from pyvista_vdi.vtk_pipeline.vtk import BACKEND

#: What settings may change, and the values of a sweep; the last three are swept on request.
#: ``lists`` are those along an edge of the VDI over pixels along that edge of the frame,
#: ``sample_distance`` that of generation over the smallest spacing.
AXES: Mapping[str, tuple[Any, ...]] = {
    "max_supersegments": (5, 10, 15, 30, 40),
    "tolerance": (0.01, 0.1),
    "lists": (0.5, 1.5, 2.0),
    "precision": ("8-byte",),
    "criterion": ("homogeneity",),
    "view_cone": (0.0, 30.0, 90.0),
    "sample_distance": (0.25, 1.0),
}
DEFAULT_AXES = tuple(AXES)[:4]

#: What SSIM is traded for, how tables call it, and differences that do not count.
COSTS = {
    "frame": ("frame time / render_volume", 0.05),
    "memory": ("MiB on the device", 0.01),
    "file": ("MiB in the file", 0.01),
    "generation": ("generation / a frame at half a voxel", 0.05),
}
SSIM_TOLERANCE = 0.0005

#: What differs from the defaults, by the names of AXES.
Setting = Mapping[str, Any]


def sweep(axes: Mapping[str, Sequence[Any]] | None = None) -> list[Setting]:
    """Return settings: the default, and every value of every axis by itself.

    ``axes`` has values by name, by default those of :data:`DEFAULT_AXES`.

    Examples
    --------
    >>> from pyvista_vdi.measure.tradeoff import sweep
    >>> sweep({"lists": (0.5, 2)})
    [{}, {'lists': 0.5}, {'lists': 2}]
    """
    chosen = {name: AXES[name] for name in DEFAULT_AXES} if axes is None else axes
    return [{}, *({name: value} for name, values in chosen.items() for value in values)]


@dataclass(frozen=True)
class Point:
    """One setting's figures over all angles.

    ``costs`` by the keys of :data:`COSTS`: frame time over that of ``render_volume`` (geometric
    mean of the angles), MiB on the device and in the ``.vdi``, and generation with packing over a
    frame of ``render_volume`` from V_O at steps of half a voxel. ``frames`` and ``ssims`` (to
    ``render_volume``) by angle.
    """

    setting: dict[str, Any]
    costs: dict[str, float]
    frames: dict[float, float]
    ssims: dict[float, float]

    @property
    def name(self) -> str:
        """Its setting: ``"max_supersegments 10, lists 2"``, or ``"default"``."""
        return ", ".join(f"{name} {value}" for name, value in self.setting.items()) or "default"

    @property
    def ssim(self) -> float:
        """Mean over the angles."""
        return statistics.fmean(self.ssims.values())


def dominates(one: Point, other: Point, costs: Sequence[str] = tuple(COSTS)) -> bool:
    """Whether a setting is nowhere worse than another in SSIM and some costs, and better in one.

    Differences count above a tolerance, and in units of the tolerances gains must outweigh losses,
    so that no settings give way to each other in turn.
    """
    gains = [(one.ssims[angle] - other.ssims[angle]) / SSIM_TOLERANCE for angle in one.ssims]
    gains += [math.log(other.costs[cost] / one.costs[cost]) / COSTS[cost][1] for cost in costs]
    return min(gains) >= -1 and max(gains) > 1 and sum(gains) > 0


@dataclass(frozen=True)
class Tradeoff:
    """What :func:`measure_tradeoff` found: the ``plan``, ``points``, and reasons of ``refused``."""

    plan: dict[str, Any]
    points: list[Point]
    refused: dict[str, str]

    def front(self, kind: str) -> list[str]:
        """Return the settings that none dominates in SSIM and one of COSTS, the cheapest first."""
        ordered = sorted(self.points, key=lambda one: one.costs[kind])
        return [a.name for a in ordered if not any(dominates(b, a, (kind,)) for b in ordered)]

    def dominated(self) -> dict[str, list[str]]:
        """Return settings that nobody should choose, and those that are better in everything."""
        by = {a.name: [b.name for b in self.points if dominates(b, a)] for a in self.points}
        return {name: better for name, better in by.items() if better}

    def table(self) -> str:
        """Return every setting as Markdown: figures, the fronts that it is on, what is better."""
        plan, better = self.plan, self.dominated()
        fronts = {kind: self.front(kind) for kind in COSTS}
        heads = ["setting", *(label for label, _ in COSTS.values()), "SSIM"]
        heads += [f"{angle:g} degrees" for angle in plan["angles"]] + ["front of", "dominated by"]
        rows = []
        for one in self.points:
            cells = [one.name, *(f"{one.costs[kind]:.2f}" for kind in COSTS), f"{one.ssim:.4f}"]
            cells += [f"{ssim:.4f}" for ssim in one.ssims.values()]
            cells += [", ".join(kind for kind in COSTS if one.name in fronts[kind])]
            rows.append([*cells, "; ".join(better.get(one.name, [])[:1])])
        lines = [f"# Tradeoff: {plan['name']}, {' x '.join(map(str, plan['window_size']))}", ""]
        lines += [f"| {' | '.join(cells)} |" for cells in (heads, ["---"] * len(heads), *rows)]
        lines += ["", *(f"- {name} was refused: {why}" for name, why in self.refused.items())]
        lines += [
            f"- VTK's {name} mapper / `render_volume`: {x:.2f}" for name, x in plan["vtk"].items()
        ]
        system = ", ".join(f"{name} {value}" for name, value in plan["system"].items())
        return "\n".join([*lines, "", system, ""])

    def save_plot(self, path: str | os.PathLike[str]) -> Path:
        """Write SSIM over each cost as a PNG by Matplotlib; it appears whole or not at all."""
        with needing('plots are drawn by Matplotlib: pip install "pyvista-vdi[plot]"'):
            from matplotlib.figure import Figure

        figure = Figure(figsize=(14.0, 10.0), layout="constrained")
        figure.suptitle(f"{self.plan['name']}: what settings cost and give (better: up and left)")
        for panel, kind in zip(figure.subplots(2, 2).flat, COSTS, strict=True):
            panel.scatter(*zip(*((one.costs[kind], one.ssim) for one in self.points), strict=True))
            for name in self.front(kind):
                one = next(each for each in self.points if each.name == name)
                panel.scatter(one.costs[kind], one.ssim, label=name)
            panel.legend(loc="lower right", fontsize=8)
            panel.set(xlabel=COSTS[kind][0], ylabel="SSIM, mean of the angles")
        with whole_file(path) as stream:
            figure.savefig(stream, dpi=110, format="png")
        return Path(path)


def measure_tradeoff(
    volume: Any,
    settings: Sequence[Setting] | None = None,
    *,
    camera: Any = None,
    window_size: Sequence[int] = (640, 360),
    angles: Sequence[float] = (5.0, 30.0, 60.0),
    repeats: int = 5,
    generations: int = 3,
    vtk: bool | None = None,
    name: str = "volume",
    device: Any = None,
    progress: Callable[..., object] | None = None,
    **classification: Any,
) -> Tradeoff:
    """Measure what settings of a VDI cost and give for one volume.

    Every frame is timed in turn with ``render_volume`` at steps of one voxel, and every generation
    in turn with one of its frames from V_O at steps of half a voxel, so that ratios mean something
    where the machine is now faster and now slower. Pictures are compared with ``render_volume`` at
    steps of half a voxel.

    ``volume``, ``camera``, ``device`` and the classification are as for
    :func:`pyvista_vdi.generate`; by default the view is the one that the volume fills. ``settings``
    are :func:`sweep`'s default unless given, ``name`` is what the volume is called, ``window_size``
    that of all frames, ``angles`` are new views, degrees of ``Azimuth`` from V_O, ``repeats`` timed
    frames of each setting at each angle, ``generations`` timed generations. ``vtk``: whether VTK's
    mappers are timed beside, by default where VTK is installed. ``progress`` is called with the
    finished fraction, 0 to 1, and what is being done.
    """
    others = measure_tradeoff.__kwdefaults__
    (looks,) = records_of(classification, "measure_tradeoff", Classification, others=others)
    volume = as_volume(volume, looks.scalars, looks.preference)
    size = check_window_size(window_size)
    view = None if camera is None else Camera.from_any(camera)
    measuring.check_plan(angles, repeats=repeats, generations=generations)
    if min(size) < SSIM_WINDOW:
        raise InvalidArgumentError(
            f"{size[0]} x {size[1]} pixels have no SSIM: {SSIM_WINDOW} or more are needed each way"
        )
    settings = sweep() if settings is None else settings
    for setting in settings:  # refuse an unknown name, or a value out of its range
        if not 0.05 <= (lists := setting.get("lists", 1.0)) <= 8:
            raise InvalidArgumentError(f"lists must be from 0.05 to 8; got {lists!r}")
        GenerationOptions(**{name: value for name, value in setting.items() if name != "lists"})
    table = looks.transfer_function_of(volume)
    vtk = find_spec(BACKEND) is not None if vtk is None else vtk
    plan: dict[str, Any] = {"name": name, "window_size": size, "angles": list(angles)}
    plan |= {"repeats": repeats, "generations": generations, "looks": looks.describe()}
    points, refused = [], {}
    with closing(Bench(volume, table, size, device=device, vtk=vtk, view=view)) as bench:
        plan |= {"vtk": _vtk_times(bench, plan), "system": measuring.describe_system(bench)}
        for done, setting in enumerate(settings):
            if progress is not None:
                progress(done / len(settings), f"setting {done + 1}")
            try:
                points.append(_point(bench, setting, plan))
            except (VDIError, MemoryError) as error:
                refused[str(setting)] = f"{type(error).__name__}: {error}"
    return Tradeoff(plan, points, refused)


def _vtk_times(bench: Bench, plan: Mapping[str, Any]) -> dict[str, float]:
    """Time VTK's mappers in turn with ``render_volume``, over this; see that something is seen."""
    found: list[dict[str, float]] = []
    for angle in plan["angles"]:
        camera = bench.view.azimuth(angle)
        bench.reference(camera)
        taken = take_turns(bench.frames(camera), plan["repeats"])
        found.append({name: ratio(taken[name], taken["volume"]) for name in bench.vtk})
    return {name: statistics.median(each[name] for each in found) for name in bench.vtk}


def _point(bench: Bench, setting: Setting, plan: Mapping[str, Any]) -> Point:
    """Return the figures of a setting."""
    options = {"sample_distance": 0.5, "lists": 1.0, **setting}
    options["sample_distance"] *= bench.voxel
    share = options.pop("lists")
    width, height = (max(1, round(edge * share)) for edge in bench.size)
    generate = partial(bench.generate, (width, height), **options)
    vdi = generate()
    work: dict[str, Step] = {"volume": partial(bench.raycast, bench.view), "vdi": generate}
    generation = take_turns(work, plan["generations"])
    with tempfile.TemporaryDirectory() as folder:
        size = vdi.save(Path(folder) / "vdi.vdi").stat().st_size
    frames, ssims = {}, {}
    for angle in plan["angles"]:
        camera = bench.view.azimuth(angle)
        draw = partial(bench.draw, vdi, camera)
        ssims[angle] = compare_images(draw(), bench.reference(camera)).ssim
        volume = partial(bench.raycast, camera, bench.voxel)
        taken = take_turns({"volume": volume, "vdi": draw}, plan["repeats"])
        frames[angle] = ratio(taken["vdi"], taken["volume"])
    costs = {
        "frame": statistics.geometric_mean(frames.values()),
        "memory": prepared_vdi(bench.runtime, vdi).list_bytes / 2**20,
        "file": size / 2**20,
        "generation": ratio(generation["vdi"], generation["volume"]),
    }
    return Point(dict(setting), costs, frames, ssims)
