"""The measurement, VDI by VDI and view by view, and what it found."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.measure.clock import take_turns
from pyvista_vdi.measure.harness import (
    ROOMS,
    Bench,
    Case,
    Latest,
    Progress,
    accuracy,
    check_angles,
    check_count,
    enlarged,
    run,
    sizes_of,
)
from pyvista_vdi.measure.results import Results, save_figure
from pyvista_vdi.measure.tradeoff.findings import Point, best, dominated, points_of
from pyvista_vdi.measure.tradeoff.report import describe, draw
from pyvista_vdi.measure.tradeoff.settings import Setting, sweep
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.classification import IN_PLACE, Classification
from pyvista_vdi.model.inputs import as_volume
from pyvista_vdi.model.metrics import SSIM_WINDOW
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.raycasting.prepared import prepared_vdi
from pyvista_vdi.vtk_pipeline.vtk import BACKEND

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Tradeoff:
    """What :func:`measure_tradeoff` found: ``data``, as the JSON holds it, and its ``points``.

    ``docs/results_schema.json`` describes the JSON; the points are the settings that were measured.
    """

    def __init__(self, data: dict[str, Any]) -> None:
        self.data = data
        self.points = points_of(data)

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Tradeoff:
        """Read the JSON of an earlier run; anything else raises InvalidArgumentError."""
        return cls(Results.read(path, "tradeoff").data)

    def point(self, name: str) -> Point:
        """Return a setting's figures; a name that was not measured raises InvalidArgumentError."""
        for one in self.points:
            if one.name == name:
                return one
        known = "; ".join(repr(one.name) for one in self.points)
        raise InvalidArgumentError(f"no setting {name!r} was measured: there are {known}")

    def front(self, kind: str) -> list[str]:
        """Return the settings that no other dominates in SSIM and one kind of cost.

        Of those that cannot be told apart the one with the fewest changes is returned. ``kind`` is
        "frame", "memory", "file" or "generation"; the cheapest is the first.
        """
        return [one.name for one in best(self.points, kind)]

    def dominated(self) -> dict[str, list[str]]:
        """Return the names of settings that nobody should choose, and of those that are better.

        Of each there is another that is nowhere worse by what counts, in the frame time and the
        SSIM at any angle, in memory, file and generation, and somewhere better beyond the measured
        noise: see :func:`dominates`.
        """
        return dominated(self.points)

    def table(self) -> str:
        """Return the tables as Markdown."""
        return describe(self.data, self.points)

    def plot(self) -> Figure:
        """Draw the fronts of frame time, bytes and generation time against SSIM.

        Returns a Matplotlib figure, which notebooks show as it is. Without Matplotlib
        MissingDependencyError is raised, and InvalidArgumentError if nothing was measured.
        """
        return draw(self.data, self.points)

    def save_plot(self, path: str | os.PathLike[str]) -> Path:
        """Write the plot as PNG; the file appears whole or not at all."""
        save_figure(self.plot(), Path(path))
        return Path(path)


def measure_tradeoff(
    volume: Any,
    settings: Sequence[Setting] | None = None,
    *,
    camera: Any = None,
    window_size: Sequence[int] = (640, 360),
    angles: Sequence[float] = (5.0, 30.0, 60.0),
    repeats: int = 5,
    generations: int = 5,
    vtk: bool | None = None,
    name: str = "volume",
    path: str | os.PathLike[str] | None = None,
    resume: bool = False,
    device: Any = None,
    progress: Progress | None = None,
    **classification: Any,
) -> Tradeoff:
    """Measure what settings of a VDI cost and give for one volume.

    Every frame is timed in turn with ``render_volume`` at steps of one voxel, and every generation
    in turn with one of its frames from V_O at steps of half a voxel, so that ratios mean something
    where the machine is now faster and now slower. Pictures are compared with ``render_volume`` at
    steps of half a voxel.

    Parameters
    ----------
    volume : pyvista.ImageData or vtkImageData or Volume
        As for :func:`pyvista_vdi.generate`.
    settings : sequence of Setting, optional
        What is compared; :func:`sweep`'s default unless given.
    camera : pyvista.Camera or vtkCamera or Camera, optional
        The generating view V_O; the view that the volume fills, from 20 degrees above, unless
        given.
    window_size, angles : sequence
        Of all frames, pixels; the new views, degrees of ``Azimuth`` from V_O.
    repeats, generations : int
        Timed frames of each setting at each angle, and timed generations of each VDI.
    vtk : bool, optional
        Whether VTK's mappers are timed beside; by default where VTK is installed.
    name : str
        What the volume is called.
    path, resume : path-like, bool
        A JSON file, written whole after every VDI, and whether to go on with what it holds.
    device : str, int or device, optional
        Where it runs; by default ``PYVISTA_VDI_DEVICE``, else the best device found.
    progress : callable, optional
        Called with the finished fraction, 0 to 1, and what is being done.
    **classification
        As for :func:`pyvista_vdi.generate`.

    Returns
    -------
    Tradeoff
        The figures, with a table, a plot, the fronts and the dominated settings. A setting whose
        own VDI does not fit is marked as refused.

    Raises
    ------
    InvalidArgumentError
        If an argument cannot be used, nothing is to be seen, or the file to go on with is of
        another run.

    Examples
    --------
    >>> import pyvista_vdi as pvdi
    >>> from pyvista_vdi.measure.tradeoff import measure_tradeoff
    >>> brain = pvdi.examples.load_brain(as_volume=True)
    >>> found = measure_tradeoff(brain, cmap="bone")  # doctest: +SKIP
    >>> found.front("frame")  # doctest: +SKIP
    """
    looks = Classification.composited(classification, "measure_tradeoff", _KEYWORDS)
    volume = as_volume(volume, looks.scalars, looks.preference)
    size = check_window_size(window_size)
    view = filling_camera(volume.bounds, size) if camera is None else Camera.from_any(camera)
    check_count("repeats", repeats)
    check_count("generations", generations)
    check_angles(angles)
    if min(size) < SSIM_WINDOW:
        raise InvalidArgumentError(
            f"a window of {size[0]} x {size[1]} has no SSIM: each edge must have {SSIM_WINDOW} "
            "pixels or more"
        )
    settings = sweep() if settings is None else tuple(dict.fromkeys(settings))
    if not settings:
        raise InvalidArgumentError("there are no settings to compare: give one or more")
    table = looks.transfer_function_of(volume)
    # What tells two transfer functions apart: the start of their JSON's SHA-256
    digest = hashlib.sha256(json.dumps(table.to_dict(), sort_keys=True).encode()).hexdigest()
    described = looks.describe()
    plan: dict[str, Any] = {
        "volume": {
            "name": name,
            "dimensions": volume.dimensions,
            "spacing": volume.spacing,
            "dtype": volume.array.dtype.name,
            "bytes": volume.array.nbytes,
        },
        "looks": {n: "given" if n in IN_PLACE else value for n, value in described.items()},
        "transfer_function": digest[:16],
        "interpolation": table.interpolation,
        "camera": view.to_dict(),
        "window_size": size,
        "angles": [float(angle) for angle in angles],
        "repeats": repeats,
        "generations": generations,
        "vtk": find_spec(BACKEND) is not None if vtk is None else vtk,
        "settings": [setting.to_dict() for setting in settings],
    }
    results = Results.begun("tradeoff", plan, path=path, rooms=ROOMS, device=device, resume=resume)
    results.save()
    with Latest(
        lambda: Bench(volume, table, size, device=device, vtk=plan["vtk"], view=view)
    ) as bench:
        rows = _Rows(results, bench, settings)
        for case in rows.baselines:  # without them nothing is worth measuring
            if results.row(case.to_dict()) is None:
                results.add(case.to_dict(), **rows.baseline(case))
        run(rows.cases.values(), rows.figures, results, progress)
    return Tradeoff(results.data)


_KEYWORDS = tuple(measure_tradeoff.__kwdefaults__ or ())


class _Rows:
    """Measures what rows hold: volume rendering at each view, and each setting."""

    def __init__(
        self, results: Results, bench: Latest[Bench], settings: tuple[Setting, ...]
    ) -> None:
        self._results, self._bench, self._plan = results, bench, results.plan
        self._groups = Latest(self._group)
        name, angles = results.plan["volume"]["name"], results.plan["angles"]
        self.baselines = [Case(name, angle=angle, what="volume rendering") for angle in angles]
        # Those that differ in what is chosen after generation follow each other
        first = {setting.generated: i for i, setting in reversed([*enumerate(settings)])}
        settings = tuple(sorted(settings, key=lambda setting: first[setting.generated]))
        self.cases = {
            setting: Case(name, options=tuple(setting.changes.items()), what="setting")
            for setting in settings
        }

    def baseline(self, case: Case) -> dict[str, Any]:
        """Time the volume renderers, and compare ours with VTK's."""
        bench = self._bench()
        if bench.opengl is not None:
            self._results.data["system"]["opengl"] = bench.opengl
        camera = case.camera(bench.view)
        bench.reference(camera)  # refused where nothing is seen
        near, steps = bench.near_vtk(camera), bench.frames(camera)
        return {
            "volume_to_vtk_gpu": near,
            "seconds": take_turns(steps, self._plan["repeats"], runtime=bench.runtime),
            "left_out": {name: str(error) for name, error in bench.left_out.items()},
        }

    def figures(self, case: Case) -> dict[str, Any]:
        """Return the figures of a setting, which come with those that share its VDI."""
        setting = Setting(**case.chosen)
        return self._groups(setting.generated)[setting]

    def _group(self, generated: Setting) -> dict[Setting, dict[str, Any]]:
        """Measure the settings of a VDI that the results lack."""
        bench = self._bench()
        settings = [
            setting
            for setting, case in self.cases.items()
            if setting.generated == generated and self._results.row(case.to_dict()) is None
        ]
        precisions = tuple(dict.fromkeys(setting.precision for setting in settings))
        made, seconds = bench.timed_generation(
            self._plan["generations"],
            _share(bench.size, generated.lists),
            before={"volume": partial(bench.image, bench.view)},
            precisions=precisions,
            max_supersegments=generated.max_supersegments,
            criterion=generated.criterion,
            sample_distance=generated.sample_distance * bench.voxel,
            tolerance=generated.tolerance,
            view_cone=generated.view_cone,
        )
        sizes: dict[str, dict[str, Any]] = {}
        for precision in precisions:
            vdi, told = made[precision], sizes_of(made[precision])
            names = ("supersegments", "mean_length", "longest_list", "bytes_saved")
            memory = prepared_vdi(bench.runtime, vdi).list_bytes
            sizes[precision] = {"window_size": vdi.window_size, "bytes_memory": memory}
            sizes[precision] |= {name: told[name] for name in names}
        found: dict[Setting, dict[str, Any]] = {
            setting: {
                "vdi": sizes[setting.precision],
                "generation": {
                    "seconds": seconds["generate"],
                    "packing": seconds.get(setting.precision),
                    "volume_seconds": seconds["volume"],
                },
                "angles": [],
            }
            for setting in settings
        }
        for angle in self._plan["angles"]:
            camera = bench.view.azimuth(angle)
            drawn: dict[str, Callable[[], Any]] = {
                setting.name: partial(
                    bench.draw,
                    made[setting.precision],
                    camera,
                    _share(bench.size, setting.preview),
                    skip_empty=setting.skip_empty,
                )
                for setting in settings
            }
            pictures = {name: enlarged(draw(), bench.size) for name, draw in drawn.items()}
            volume = {"volume": bench.frames(camera)["volume_skipping"]}
            taken = take_turns({**volume, **drawn}, self._plan["repeats"], runtime=bench.runtime)
            for setting, row in found.items():
                row["angles"].append(
                    {
                        "angle": angle,
                        "to_volume": accuracy(pictures[setting.name], bench.reference(camera)),
                        "seconds": taken[setting.name],
                        "volume_seconds": taken["volume"],
                    }
                )
        return found


def _share(size: tuple[int, int], edge: float) -> tuple[int, int]:
    """Return a window whose edges are a share of another's."""
    width, height = size
    return max(1, round(width * edge)), max(1, round(height * edge))
