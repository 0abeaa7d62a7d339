"""What the measured figures say: fronts, dominated settings, and where the volume wins."""

from __future__ import annotations

import math
import os
import statistics
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.io import whole_file
from pyvista_vdi.measure.benchmark.candidates import median
from pyvista_vdi.measure.tradeoff.dominance import Figure, find_dominated, front, told_apart
from pyvista_vdi.measure.tradeoff.results import TradeoffFile
from pyvista_vdi.measure.tradeoff.settings import Setting

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Plot

#: What SSIM is traded for, by the keys of the findings, and how tables call it.
COSTS: MappingProxyType[str, str] = MappingProxyType(
    {
        "frame": "frame time",
        "memory": "bytes on the device",
        "file": "bytes in the file",
        "generation": "generation time",
    }
)

#: Differences that do not count: of SSIM, what devices that round differently may differ by; of
#: times and bytes, relative.
SSIM_TOLERANCE = 0.0005
TIME_TOLERANCE = 0.05
BYTES_TOLERANCE = 0.01


@dataclass(frozen=True)
class Point:
    """One setting's figures over all angles.

    Parameters
    ----------
    name : str
        The setting.
    setting : dict
        Its values, see :class:`Setting`.
    frame : float
        Frame time over that of ``render_volume``: the geometric mean over the angles, of
        repetitions in the same round; the median of the repetitions.
    frame_spread : float
        Half of what lies between its least and its most repetition, over the median.
    frames : dict of float to float
        The same by angle.
    ssim : float
        SSIM to ``render_volume``: the mean over the angles.
    ssims : dict of float to float
        By angle.
    psnr : float
        The least of all angles, dB; infinite for equal pictures.
    worst_pixel : float
        Of all angles, in 1/255.
    bytes_memory : int
        Of the lists on the device.
    bytes_file : int or None
        Of the ``.vdi``; ``None`` where there was no room for it.
    generation : float
        Time of generation, with packing, over that of a frame of ``render_volume`` at steps of
        half a voxel; the median.
    generation_seconds : float
        The median by the clock.
    figures : dict of str to Figure
        What settings are judged by: ``"frame"``, ``"memory"``, ``"file"``, ``"generation"`` and
        ``"loss"`` over all angles, ``"frame 5"`` and ``"loss 5"`` at each.
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
        return {
            "frame": self.frame,
            "memory": self.bytes_memory,
            "file": self.bytes_file,
            "generation": self.generation,
        }[kind]


class Tradeoff:
    """What :func:`measure_tradeoff` found.

    Parameters
    ----------
    data : dict
        What the JSON holds, see ``docs/tradeoff_schema.json``.

    Attributes
    ----------
    data : dict
        The same.
    points : list of Point
        Every setting that was measured.
    """

    def __init__(self, data: dict[str, Any]) -> None:
        self.data = data
        self.points = [_point(entry) for entry in data["points"] if entry["refused"] is None]

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Tradeoff:
        """Read the JSON of an earlier run.

        Raises
        ------
        InvalidArgumentError
            If it cannot be read, or is something else.
        """
        return cls(TradeoffFile.read(path).data)

    def point(self, name: str) -> Point:
        """Return a setting's figures by its name.

        Raises
        ------
        InvalidArgumentError
            If no setting of that name was measured.
        """
        for one in self.points:
            if one.name == name:
                return one
        raise InvalidArgumentError(
            f"no setting {name!r} was measured: there are "
            + "; ".join(repr(one.name) for one in self.points)
        )

    def front(self, kind: str) -> list[str]:
        """Return the settings that no other dominates in SSIM and one kind of cost.

        Of those that cannot be told apart the one with the fewest changes is returned.

        Parameters
        ----------
        kind : {"frame", "memory", "file", "generation"}
            The cost.

        Returns
        -------
        list of str
            Names, the cheapest first.
        """
        if kind not in COSTS:
            raise InvalidArgumentError(f"kind must be one of {', '.join(COSTS)}; got {kind!r}")
        judged = {
            one.name: [one.figures[kind], one.figures["loss"]]
            for one in self.points
            if kind in one.figures
        }
        simplest_first = sorted(front(judged), key=lambda name: len(self.point(name).changes))
        kept = told_apart(simplest_first, judged)
        return sorted(kept, key=lambda name: self.point(name).cost(kind) or math.inf)

    def dominated(self) -> dict[str, list[str]]:
        """Return the settings that nobody should choose, and those that are better.

        Of each there is another that is nowhere worse by what counts, in the frame time and the
        SSIM at any angle, in memory, file and generation, and somewhere better beyond the measured
        noise: see :func:`dominates`.

        Returns
        -------
        dict of str to list of str
            Names.
        """
        # At each angle, and not over all: worse at one of them is worse
        kinds = [
            kind
            for kind in (self.points[0].figures if self.points else ())
            if kind not in ("frame", "loss") and all(kind in one.figures for one in self.points)
        ]
        judged = {one.name: [one.figures[kind] for kind in kinds] for one in self.points}
        return find_dominated(judged)

    def table(self) -> str:
        """Return the tables as Markdown."""
        from pyvista_vdi.measure.tradeoff.report import describe

        return describe(self)

    def plot(self) -> Plot:
        """Draw the fronts of frame time, bytes and generation time against SSIM.

        Returns
        -------
        matplotlib.figure.Figure
            Which notebooks show as it is.

        Raises
        ------
        MissingDependencyError
            If Matplotlib is not installed.
        InvalidArgumentError
            If nothing was measured.
        """
        from pyvista_vdi.measure.tradeoff.plot import draw

        return draw(self)

    def save_plot(self, path: str | os.PathLike[str]) -> Path:
        """Write the plot as PNG; the file appears whole or not at all."""
        figure = self.plot()
        with whole_file(path) as stream:
            figure.savefig(stream, dpi=110, format="png")
        return Path(path)


def find(data: dict[str, Any]) -> dict[str, Any]:
    """Return what the JSON's ``findings`` hold."""
    found = Tradeoff(data)
    return {
        "fronts": {kind: found.front(kind) for kind in COSTS},
        "dominated": found.dominated(),
    }


def _point(entry: dict[str, Any]) -> Point:
    rows, generation = entry["angles"], entry["generation"]
    at = {row["angle"]: _ratios(row["seconds"]["clock"], row["volume_seconds"]) for row in rows}
    frames = [math.exp(_mean([math.log(r) for r in one])) for one in zip(*at.values(), strict=True)]
    ssims = {row["angle"]: row["to_volume"]["ssim"] for row in rows}
    made = generation["seconds"]["clock"]
    if generation["packing"] is not None:
        made = [a + b for a, b in zip(made, generation["packing"]["clock"], strict=True)]
    generations = _ratios(made, generation["volume_seconds"])
    vdi = entry["vdi"]
    middle = statistics.median(frames)
    figures = {
        "frame": Figure.of_times(frames, TIME_TOLERANCE),
        "loss": Figure(1 - _mean(list(ssims.values())), SSIM_TOLERANCE),
        "memory": Figure(math.log(vdi["bytes_memory"]), BYTES_TOLERANCE),
        "generation": Figure.of_times(generations, TIME_TOLERANCE),
    }
    if vdi["bytes_file"] is not None:
        figures["file"] = Figure(math.log(vdi["bytes_file"]), BYTES_TOLERANCE)
    for angle, ratios in at.items():
        figures[f"frame {angle:g}"] = Figure.of_times(ratios, TIME_TOLERANCE)
        figures[f"loss {angle:g}"] = Figure(1 - ssims[angle], SSIM_TOLERANCE)
    return Point(
        name=entry["name"],
        setting=entry["setting"],
        frame=middle,
        frame_spread=(max(frames) - min(frames)) / 2 / middle,
        frames={angle: statistics.median(ratios) for angle, ratios in at.items()},
        ssim=_mean(list(ssims.values())),
        ssims=ssims,
        psnr=min(_or_infinite(row["to_volume"]["psnr"]) for row in rows),
        worst_pixel=max(row["to_volume"]["worst_pixel"] for row in rows),
        bytes_memory=vdi["bytes_memory"],
        bytes_file=vdi["bytes_file"],
        generation=statistics.median(generations),
        generation_seconds=statistics.median(made),
        figures=figures,
    )


def _or_infinite(value: float | None) -> float:
    return math.inf if value is None else value


def _ratios(ours: list[float], volume: dict[str, list[float]]) -> list[float]:
    """Return each repetition over the volume's in the same round."""
    return [a / b for a, b in zip(ours, volume["clock"], strict=True)]


def _mean(values: list[float]) -> float:
    return math.fsum(values) / len(values)


def peers(data: dict[str, Any]) -> dict[float, dict[str, float]]:
    """Return by angle what volume renderers take, over ``render_volume``; medians of pairs."""
    found = {}
    for row in data["baselines"]:
        base = row["seconds"]["volume_skipping"]
        found[row["angle"]] = {
            name: statistics.median(_ratios(taken["clock"], base))
            for name, taken in row["seconds"].items()
        }
    return found


def faster_vtk(data: dict[str, Any]) -> dict[float, float]:
    """Return by angle the frame time of VTK's faster mapper over that of ``render_volume``."""
    return {
        angle: min(theirs)
        for angle, ratios in peers(data).items()
        if (theirs := [ratio for name, ratio in ratios.items() if name.startswith("vtk_")])
    }


def volume_milliseconds(data: dict[str, Any]) -> dict[float, float]:
    """Return by angle the median frame of ``render_volume``, milliseconds."""
    return {
        row["angle"]: 1e3 * (median(row["seconds"]["volume_skipping"]) or math.nan)
        for row in data["baselines"]
    }
