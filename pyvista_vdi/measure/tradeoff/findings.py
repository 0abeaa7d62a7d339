"""What the measured figures say: fronts, dominated settings, and where the volume wins.

Figures are noisy. Every figure is smaller for the better. A setting *dominates* another if

- no figure of it is worse by more than what does not count for its kind,
- at least one is better by more than that, and beyond the noise of its repetitions, and
- in sum its gains outweigh its losses, each in units of what does not count.

So noise keeps a setting from being called dominated and never makes it so. Where nothing is
noisy and everything counts this is Pareto's dominance. With differences that do not count, the
first two conditions alone could lead in circles, at whose end everything is dominated; the third
one orders the settings by a sum. They could also lead astray, each setting giving way to a
neighbour, until the last is far from the first. So a setting gives way only to one that stays.
*The front* is what stays, found in the order of the sums.
"""

import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.measure.clock import CHANCE, rank_sum_chance, ratios, spread
from pyvista_vdi.measure.results import Results
from pyvista_vdi.measure.tradeoff.settings import AXES, Setting

#: What SSIM is traded for, by the keys of the findings, and how tables call it.
COSTS: Mapping[str, str] = {
    "frame": "frame time",
    "memory": "bytes on the device",
    "file": "bytes in the file",
    "generation": "generation time",
}

#: Differences that do not count: of SSIM, what devices that round differently may differ by; of
#: times and bytes, relative.
SSIM_TOLERANCE, TIME_TOLERANCE, BYTES_TOLERANCE = 0.0005, 0.05, 0.01


@dataclass(frozen=True)
class Figure:
    """One figure of a setting; the smaller, the better.

    ``tolerance``, above 0 and the same in all figures of a kind, are differences that do not count;
    ``repetitions`` what ``value`` is the median of, none where it repeats exactly.
    """

    value: float
    tolerance: float
    repetitions: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not (math.isfinite(self.value) and 0 < self.tolerance < math.inf):
            raise InvalidArgumentError(
                "a figure has a finite value and a tolerance above 0; got "
                f"{self.value!r} and {self.tolerance!r}"
            )

    @classmethod
    def of_times(cls, repetitions: Sequence[float], tolerance: float) -> "Figure":
        """Return what repetitions of a positive figure say, as logarithms: ratios count."""
        logs = tuple(math.log(value) for value in repetitions)
        return cls(statistics.median(logs), tolerance, logs)

    def is_worse(self, other: "Figure") -> bool:
        """Whether it is larger by more than what does not count."""
        return self.value > other.value + other.tolerance

    def is_better(self, other: "Figure") -> bool:
        """Whether it is smaller by more than that, and beyond the noise."""
        if not other.is_worse(self):
            return False
        noisy = self.repetitions and other.repetitions
        return not noisy or rank_sum_chance(self.repetitions, other.repetitions) <= CHANCE


Figures = Sequence[Figure]


def dominates(one: Figures, other: Figures) -> bool:
    """Whether a setting makes another pointless: figures of the same kinds in the same order."""
    pairs = list(zip(one, other, strict=True))
    return (
        not any(ours.is_worse(theirs) for ours, theirs in pairs)
        and _sum(one) < _sum(other)
        and any(ours.is_better(theirs) for ours, theirs in pairs)
    )


def find_dominated(settings: Mapping[str, Figures]) -> dict[str, list[str]]:
    """Return the settings that are dominated, and by which of those on the front.

    ``settings`` are figures by name, in whose order names are returned.
    """
    kept = front(settings)
    found = {n: [one for one in kept if dominates(settings[one], settings[n])] for n in settings}
    return {name: by for name, by in found.items() if by}


def front(settings: Mapping[str, Figures]) -> list[str]:
    """Return the settings that none of them dominates, in the order of `settings`."""
    kept: list[str] = []
    # What dominates a setting has the smaller sum, so that it has been decided on before
    for name in sorted(settings, key=lambda name: _sum(settings[name])):
        if not any(dominates(settings[one], settings[name]) for one in kept):
            kept.append(name)
    return [name for name in settings if name in kept]


def told_apart(names: Sequence[str], settings: Mapping[str, Figures]) -> list[str]:
    """Return `names` without those that are no different from an earlier one that stays.

    Two settings differ where one of them is better, by what counts and beyond the noise, in at
    least one figure.
    """
    kept: list[str] = []
    for name in names:
        pairs = (zip(settings[one], settings[name], strict=True) for one in kept)
        if all(any(a.is_better(b) or b.is_better(a) for a, b in pair) for pair in pairs):
            kept.append(name)
    return kept


def _sum(figures: Figures) -> float:
    return math.fsum(figure.value / figure.tolerance for figure in figures)


@dataclass(frozen=True)
class Point:
    """One setting's figures over all angles.

    ``frame`` is its frame time over that of ``render_volume``: the median of repetitions, each the
    geometric mean over the angles, with half of what lies between the least and the most as
    ``frame_spread``; ``frames`` has the medians by angle. ``ssim`` to ``render_volume`` is the mean
    over the angles, ``ssims`` by angle; ``psnr`` (dB, infinite for equal pictures) and
    ``worst_pixel`` (in 1/255) are the worst of all. ``bytes_memory`` are those of the lists on the
    device, ``bytes_file`` of the ``.vdi``, ``None`` where there was no room for it. ``generation``,
    with packing, is over the time of a frame of ``render_volume`` at steps of half a voxel.
    ``figures`` are what settings are judged by: "frame", "memory", "file", "generation" and "loss"
    over all angles, "frame 5" and "loss 5" at each.
    """

    name: str
    setting: dict[str, Any]
    frame: float
    frame_spread: float
    frames: dict[float, float]
    ssim: float
    ssims: dict[float, float]
    psnr: float
    worst_pixel: float
    bytes_memory: int
    bytes_file: int | None
    generation: float
    generation_seconds: float
    figures: dict[str, Figure]

    @property
    def changes(self) -> dict[str, Any]:
        """Values that differ from the defaults, by name."""
        return Setting(**self.setting).changes

    def cost(self, kind: str) -> float | None:
        """Return what tables and plots have for a key of :data:`COSTS`."""
        value: float | None = getattr(self, f"bytes_{kind}", getattr(self, kind, None))
        return value


def points_of(data: dict[str, Any]) -> list[Point]:
    """Return every setting that was measured, in the order of the plan."""
    order = {Setting(**values).name: i for i, values in enumerate(data["plan"]["settings"])}
    rows = (row for row in Results(data).rows(what="setting") if "refused" not in row)
    return sorted((_point(row) for row in rows), key=lambda one: order[one.name])


def setting_of(row: dict[str, Any]) -> Setting:
    """Return the setting that a row is about."""
    return Setting(**{n: value for n, value in row["case"].items() if n in AXES})


def best(points: Sequence[Point], kind: str) -> list[Point]:
    """Return the front of SSIM and a kind of cost, see :meth:`.Tradeoff.front`."""
    if kind not in COSTS:
        raise InvalidArgumentError(f"kind must be one of {', '.join(COSTS)}; got {kind!r}")
    judged = {p.name: [p.figures[kind], p.figures["loss"]] for p in points if kind in p.figures}
    on_front = front(judged)
    simplest_first = sorted(
        (one for one in points if one.name in on_front), key=lambda one: len(one.changes)
    )
    kept = told_apart([one.name for one in simplest_first], judged)
    found = (one for one in simplest_first if one.name in kept)
    return sorted(found, key=lambda one: one.cost(kind) or math.inf)


def dominated(points: Sequence[Point]) -> dict[str, list[str]]:
    """Return settings that nobody should choose, see :meth:`.Tradeoff.dominated`."""
    # At each angle, and not over all: worse at one of them is worse
    kinds = [
        kind
        for kind in (points[0].figures if points else ())
        if kind not in ("frame", "loss") and all(kind in one.figures for one in points)
    ]
    return find_dominated({one.name: [one.figures[kind] for kind in kinds] for one in points})


def _point(row: dict[str, Any]) -> Point:
    views, generation, vdi = row["angles"], row["generation"], row["vdi"]
    setting = setting_of(row)
    at = {v["angle"]: ratios(v["seconds"]["clock"], v["volume_seconds"]["clock"]) for v in views}
    frames = [statistics.geometric_mean(one) for one in zip(*at.values(), strict=True)]
    ssims = {view["angle"]: view["to_volume"]["ssim"] for view in views}
    ssim = statistics.fmean(ssims.values())
    made = generation["seconds"]["clock"]
    if generation["packing"] is not None:
        made = [a + b for a, b in zip(made, generation["packing"]["clock"], strict=True)]
    generations = ratios(made, generation["volume_seconds"]["clock"])
    figures = {
        "frame": Figure.of_times(frames, TIME_TOLERANCE),
        "loss": Figure(1 - ssim, SSIM_TOLERANCE),
        "memory": Figure(math.log(vdi["bytes_memory"]), BYTES_TOLERANCE),
        "generation": Figure.of_times(generations, TIME_TOLERANCE),
    }
    if vdi["bytes_saved"] is not None:
        figures["file"] = Figure(math.log(vdi["bytes_saved"]), BYTES_TOLERANCE)
    for angle, paired in at.items():
        figures[f"frame {angle:g}"] = Figure.of_times(paired, TIME_TOLERANCE)
        figures[f"loss {angle:g}"] = Figure(1 - ssims[angle], SSIM_TOLERANCE)
    return Point(
        name=setting.name,
        setting=setting.to_dict(),
        frame=statistics.median(frames),
        frame_spread=spread(frames),
        frames={angle: statistics.median(paired) for angle, paired in at.items()},
        ssim=ssim,
        ssims=ssims,
        # Equal pictures: JSON has no infinity
        psnr=min(math.inf if (p := v["to_volume"]["psnr"]) is None else p for v in views),
        worst_pixel=max(view["to_volume"]["worst_pixel"] for view in views),
        bytes_memory=vdi["bytes_memory"],
        bytes_file=vdi["bytes_saved"],
        generation=statistics.median(generations),
        generation_seconds=statistics.median(made),
        figures=figures,
    )


def volume_renderers(data: dict[str, Any]) -> dict[float, dict[str, float]]:
    """Return by angle what volume renderers take, over ``render_volume``; medians of pairs."""
    found: dict[float, dict[str, float]] = {}
    for row in Results(data).rows(what="volume rendering"):
        base = row["seconds"]["volume_skipping"]["clock"]
        taken = {name: ratios(times["clock"], base) for name, times in row["seconds"].items()}
        found[row["case"]["angle"]] = {n: statistics.median(r) for n, r in taken.items()}
    return found


def faster_vtk(data: dict[str, Any]) -> dict[float, float]:
    """Return by angle the frame time of VTK's faster mapper over that of ``render_volume``."""
    return {
        angle: min(theirs)
        for angle, taken in volume_renderers(data).items()
        if (theirs := [over for name, over in taken.items() if name.startswith("vtk_")])
    }
