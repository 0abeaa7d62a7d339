"""The measurement: VDI by VDI, form by form, and view by view."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from pyvista_vdi.device import Runtime, get_runtime
from pyvista_vdi.errors import InvalidArgumentError, VDIError
from pyvista_vdi.measure.clock import Step, take_turns
from pyvista_vdi.measure.report import describe_system
from pyvista_vdi.measure.session import (
    Bench,
    Image,
    Progress,
    Steps,
    VDIRenderer,
    accuracy,
    check_angles,
    check_count,
    enlarged,
    refusal,
    sizes_of,
)
from pyvista_vdi.measure.tradeoff.results import Tradeoff, TradeoffFile
from pyvista_vdi.measure.tradeoff.settings import Setting, sweep
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.classification import IN_PLACE, Classification
from pyvista_vdi.model.inputs import as_volume
from pyvista_vdi.model.metrics import SSIM_WINDOW
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.raycasting.prepared import prepared_vdi

#: What frames are ratios to, by the keys of the results: what ``render_volume`` does by default.
_BASELINE = "volume_skipping"


@dataclass(frozen=True)
class Plan:
    """What a run measures: arguments of :func:`measure_tradeoff`, checked.

    ``looks`` are the classification arguments, for people; ``table`` is what counts.
    """

    name: str
    volume: Volume
    looks: dict[str, Any]
    table: TransferFunction
    camera: Camera
    settings: tuple[Setting, ...]
    window_size: tuple[int, int]
    angles: tuple[float, ...]
    repeats: int
    generations: int
    vtk: bool

    def __post_init__(self) -> None:
        check_count("repeats", self.repeats)
        check_count("generations", self.generations)
        check_angles(self.angles)
        if min(self.window_size) < SSIM_WINDOW:
            raise InvalidArgumentError(
                f"a window of {self.window_size[0]} x {self.window_size[1]} has no SSIM: each edge "
                f"must have {SSIM_WINDOW} pixels or more"
            )
        if not self.settings:
            raise InvalidArgumentError("there are no settings to compare: give one or more")

    def to_dict(self) -> dict[str, Any]:
        """Return everything in values that JSON can hold, the volume by its description."""
        volume = self.volume
        # What tells two transfer functions apart: the start of their JSON's SHA-256
        table = json.dumps(self.table.to_dict(), sort_keys=True).encode()
        own = [name for name in self.looks if name in IN_PLACE]
        described = {
            "volume": {
                "name": self.name,
                "dimensions": volume.dimensions,
                "spacing": volume.spacing,
                "dtype": volume.array.dtype.name,
                "bytes": volume.array.nbytes,
            },
            "looks": {**self.looks, **dict.fromkeys(own, "given")},
            "transfer_function": hashlib.sha256(table).hexdigest()[:16],
            "interpolation": self.table.interpolation,
            "camera": self.camera.to_dict(),
            "window_size": self.window_size,
            "angles": self.angles,
            "repeats": self.repeats,
            "generations": self.generations,
            "vtk": self.vtk,
            "settings": [setting.to_dict() for setting in self.settings],
        }
        plain: dict[str, Any] = json.loads(json.dumps(described))
        return plain


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
    window_size : (int, int)
        Of all frames, pixels.
    angles : sequence of float
        The new views, degrees of ``Azimuth`` from V_O.
    repeats : int
        Timed frames of each setting at each angle.
    generations : int
        Timed generations of each VDI.
    vtk : bool, optional
        Whether VTK's mappers are timed beside; by default where VTK is installed.
    name : str
        What the volume is called.
    path : path-like, optional
        A JSON file, written whole after every VDI; without one nothing is written.
    resume : bool
        Go on with what the file holds, if it is there, instead of replacing it.
    device : str, int or device, optional
        Where it runs; by default ``PYVISTA_VDI_DEVICE``, else the best device found.
    progress : callable, optional
        Called with the finished fraction, 0 to 1, and what is being done.
    **classification
        As for :func:`pyvista_vdi.generate`.

    Returns
    -------
    Tradeoff
        The figures, with a table, a plot, the fronts and the dominated settings.

    Raises
    ------
    TypeError
        If a keyword is unknown.
    InvalidArgumentError
        If an argument cannot be used, nothing is to be seen, or the file to go on with is of
        another run.
    MissingDependencyError
        If a colour map or an opacity is named and PyVista is not installed.
    NoDeviceError, DeviceMemoryError, DeviceError, KernelBuildError
        If there is no device, or it fails. A setting whose own VDI does not fit is marked as
        refused, with the reason.

    Examples
    --------
    >>> import pyvista_vdi as pvdi
    >>> from pyvista_vdi.measure.tradeoff import measure_tradeoff
    >>> brain = pvdi.examples.load_brain(as_volume=True)
    >>> found = measure_tradeoff(brain, cmap="bone")  # doctest: +SKIP
    >>> found.front("frame")  # doctest: +SKIP
    """
    looks = Classification(classification, "measure_tradeoff", _KEYWORDS)
    volume = as_volume(volume, looks.scalars, looks.preference)
    size = check_window_size(window_size)
    view = filling_camera(volume.bounds, size) if camera is None else Camera.from_any(camera)
    plan = Plan(
        name=name,
        volume=volume,
        looks=looks.describe(),
        table=looks.transfer_function(volume),
        camera=view,
        settings=sweep() if settings is None else tuple(dict.fromkeys(settings)),
        window_size=size,
        angles=tuple(float(angle) for angle in angles),
        repeats=repeats,
        generations=generations,
        vtk=find_spec("vtkmodules") is not None if vtk is None else vtk,
    )
    system = describe_system(device)
    if resume and path is not None and Path(path).exists():
        results = TradeoffFile.resumed(path, plan, system)
    else:
        results = TradeoffFile.begun(path, plan, system)
        results.save()
    there = {point["name"] for point in results.data["points"]}
    missing = [setting for setting in plan.settings if setting.name not in there]
    if missing or not results.data["baselines"]:
        _Run(plan, results, missing, get_runtime(device), progress).everything()
    results.find()
    results.save()
    return Tradeoff(results.data)


_KEYWORDS = tuple(measure_tradeoff.__kwdefaults__ or ())


class _Run:
    def __init__(
        self,
        plan: Plan,
        results: TradeoffFile,
        missing: list[Setting],
        runtime: Runtime,
        progress: Progress | None,
    ) -> None:
        self._plan, self._results, self._runtime = plan, results, runtime
        # Settings that differ only in what is chosen after generation share a VDI
        self._groups: dict[Setting, list[Setting]] = {}
        for setting in missing:
            self._groups.setdefault(setting.generated, []).append(setting)
        self._bench = Bench(runtime, plan.volume, plan.table, plan.window_size, plan.vtk)
        steps = Steps(progress, (1 + len(missing)) * len(plan.angles) + len(self._groups))
        self._step = steps.begin

    def everything(self) -> None:
        """Measure what is missing."""
        data = self._results.data
        with closing(self._bench):
            if self._bench.opengl is not None:
                data["system"]["opengl"] = self._bench.opengl
            if not data["baselines"]:
                data["baselines"] = [self._baseline(angle) for angle in self._plan.angles]
                data["left_out"] = dict(self._bench.left_out)
                self._results.save()
            for generated, settings in self._groups.items():
                try:
                    points = self._group(generated, settings)
                except (VDIError, MemoryError) as error:
                    points = [_point(setting, refused=refusal(error)) for setting in settings]
                data["points"] += points
                order = {setting.name: i for i, setting in enumerate(self._plan.settings)}
                data["points"].sort(key=lambda point: order[point["name"]])
                self._results.save()

    def _baseline(self, angle: float) -> dict[str, Any]:
        """Time the volume renderers, and compare ours with VTK's."""
        self._step(f"volume rendering at {angle:g} degrees")
        camera = self._plan.camera.azimuth(angle)
        _, near = self._bench.reference(camera, angle)
        steps = self._bench.frames(camera)
        return {
            "angle": angle,
            "volume_to_vtk_gpu": near,
            "seconds": take_turns(steps, self._plan.repeats, runtime=self._runtime),
        }

    def _group(self, generated: Setting, settings: list[Setting]) -> list[dict[str, Any]]:
        self._step(f"{generated.name}: generating")
        precisions = tuple(dict.fromkeys(setting.precision for setting in settings))
        forms, seconds = self._bench.generate(
            self._plan.camera,
            self._share(generated.lists),
            self._plan.generations,
            before={"volume": partial(self._bench.image, self._plan.camera)},
            forms=precisions,
            max_supersegments=generated.max_supersegments,
            criterion=generated.criterion,
            sample_distance=generated.sample_distance * self._bench.voxel,
            tolerance=generated.tolerance,
            view_cone=generated.view_cone,
        )
        sizes: dict[str, dict[str, Any]] = {}
        renderers: dict[str, VDIRenderer] = {}
        for precision in precisions:
            vdi = forms[precision]
            found = sizes_of(vdi)
            sizes[precision] = {
                "window_size": list(vdi.window_size),
                **{n: found[n] for n in ("supersegments", "mean_length", "longest_list")},
                "bytes_file": found["bytes_saved"],
                "bytes_memory": prepared_vdi(self._runtime, vdi).list_bytes,
            }
            renderers[precision] = VDIRenderer(self._runtime, vdi, self._plan.window_size)
        points = [
            _point(
                setting,
                vdi=sizes[setting.precision],
                generation={
                    "seconds": seconds["generate"],
                    "packing": seconds.get(setting.precision),
                    "volume_seconds": seconds["volume"],
                },
            )
            for setting in settings
        ]
        for angle in self._plan.angles:
            rows = self._rows(angle, settings, renderers)
            for point, row in zip(points, rows, strict=True):
                point["angles"].append(row)
        return points

    def _rows(
        self, angle: float, settings: list[Setting], renderers: dict[str, VDIRenderer]
    ) -> list[dict[str, Any]]:
        """Compare and time a group's settings at one view, in turn with the volume."""
        camera = self._plan.camera.azimuth(angle)
        reference, _ = self._bench.reference(camera, angle)
        frames: dict[str, Step] = {"volume": self._bench.frames(camera)[_BASELINE]}
        near = []
        for setting in settings:
            self._step(f"{setting.name}: {angle:g} degrees")
            frame = partial(
                renderers[setting.precision].image,
                camera,
                self._share(setting.preview),
                skip_empty=setting.skip_empty,
            )
            image: Image = frame()
            near.append(accuracy(enlarged(image, self._plan.window_size), reference))
            frames[setting.name] = frame
        seconds = take_turns(frames, self._plan.repeats, runtime=self._runtime)
        return [
            {
                "angle": angle,
                "to_volume": one,
                "seconds": seconds[setting.name],
                "volume_seconds": seconds["volume"],
            }
            for setting, one in zip(settings, near, strict=True)
        ]

    def _share(self, edge: float) -> tuple[int, int]:
        """Return a window whose edges are a share of the frame's."""
        width, height = self._plan.window_size
        return max(1, round(width * edge)), max(1, round(height * edge))


def _point(setting: Setting, **found: Any) -> dict[str, Any]:
    """Return what the results have of a setting that is measured or refused."""
    empty: dict[str, Any] = {"refused": None, "vdi": None, "generation": None, "angles": []}
    return {"name": setting.name, "setting": setting.to_dict(), **empty, **found}
