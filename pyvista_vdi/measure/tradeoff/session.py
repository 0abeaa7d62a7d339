"""The measurement: VDI by VDI, form by form, and view by view."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from pyvista_vdi.api import as_volume
from pyvista_vdi.device import Runtime, get_runtime
from pyvista_vdi.errors import VDIError
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.measure.benchmark.candidates import (
    Image,
    Step,
    VDIRenderer,
    VolumeRenderers,
    accuracy,
    take_turns,
)
from pyvista_vdi.measure.benchmark.preview import enlarged
from pyvista_vdi.measure.compare import describe_system
from pyvista_vdi.measure.tradeoff.findings import Tradeoff, find
from pyvista_vdi.measure.tradeoff.results import Plan, TradeoffFile
from pyvista_vdi.measure.tradeoff.settings import Setting, sweep
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.raycasting.raycast import PreparedVDI

#: Window in which a VDI is generated once before generation is timed, pixels.
_WARM_UP_SIZE = (64, 36)

#: What frames are ratios to, by the benchmark's keys: what ``render_volume`` does by default.
_BASELINE = "volume_skipping"

#: Called with the finished fraction, 0 to 1, and what is being done.
Progress = Callable[[float, str], object]


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
    width, height = window_size
    view = Camera.from_any(camera) if camera is not None else None
    plan = Plan(
        name=name,
        looks=looks.describe(),
        table=looks.transfer_function(volume),
        camera=view or filling_camera(volume.bounds, (width, height)),
        settings=sweep() if settings is None else tuple(dict.fromkeys(settings)),
        window_size=(int(width), int(height)),
        angles=tuple(float(angle) for angle in angles),
        repeats=repeats,
        generations=generations,
        vtk=find_spec("vtkmodules") is not None if vtk is None else vtk,
    )
    system, described = describe_system(device), plan.to_dict(volume)
    if resume and path is not None and Path(path).exists():
        results = TradeoffFile.read(path)
        results.require_same(described, system)
    else:
        results = TradeoffFile.begun(path, described, system)
        results.save()
    run(plan, volume, results, device, progress)
    return Tradeoff(results.data)


_KEYWORDS = tuple(measure_tradeoff.__kwdefaults__ or ())


def run(
    plan: Plan,
    volume: Volume,
    results: TradeoffFile,
    device: Any = None,
    progress: Progress | None = None,
) -> None:
    """Measure what is missing, and write the file after every VDI.

    Parameters
    ----------
    plan : Plan
        What is measured.
    volume : Volume
        Of what.
    results : TradeoffFile
        Where it goes; settings that are there are not measured again.
    device : optional
        See :func:`pyvista_vdi.list_devices`.
    progress : callable, optional
        Called with the finished fraction and what is being done.
    """
    missing = [setting for setting in plan.settings if not results.has(setting)]
    if missing or not results.data["baselines"]:
        _Run(plan, volume, results, missing, get_runtime(device), progress).everything()
    results.data["findings"] = find(results.data)
    results.save()


class _Run:
    def __init__(
        self,
        plan: Plan,
        volume: Volume,
        results: TradeoffFile,
        missing: list[Setting],
        runtime: Runtime,
        progress: Progress | None,
    ) -> None:
        self._plan, self._volume, self._results = plan, volume, results
        self._runtime, self._progress = runtime, progress
        # Settings that differ only in what is chosen after generation share a VDI
        self._groups: dict[Setting, list[Setting]] = {}
        for setting in missing:
            self._groups.setdefault(setting.generated, []).append(setting)
        self._renderers = VolumeRenderers(runtime, volume, plan.table, plan.window_size, plan.vtk)
        self._done, self._total = 0, (1 + len(missing)) * len(plan.angles) + len(self._groups)

    def everything(self) -> None:
        """Measure what is missing."""
        data = self._results.data
        try:
            if self._renderers.opengl is not None:
                data["system"]["opengl"] = self._renderers.opengl
            if not data["baselines"]:
                data["baselines"] = [self._baseline(angle) for angle in self._plan.angles]
                data["left_out"] = dict(self._renderers.left_out)
                self._results.save()
            for generated, settings in self._groups.items():
                try:
                    points = self._group(generated, settings)
                except (VDIError, MemoryError) as error:
                    points = [_refused(setting, error) for setting in settings]
                data["points"] += points
                order = {setting.name: i for i, setting in enumerate(self._plan.settings)}
                data["points"].sort(key=lambda point: order[point["name"]])
                self._results.save()
        finally:
            self._renderers.close()

    def _step(self, doing: str) -> None:
        if self._progress is not None:
            self._progress(min(1.0, self._done / self._total), doing)
        self._done += 1

    # -- what all is compared with -----------------------------------------------------------------

    def _baseline(self, angle: float) -> dict[str, Any]:
        """Time the volume renderers, and compare ours with VTK's."""
        self._step(f"volume rendering at {angle:g} degrees")
        camera = self._plan.camera.azimuth(angle)
        _, near = self._renderers.reference(camera, angle)
        steps = self._renderers.frames(camera)
        return {
            "angle": angle,
            "volume_to_vtk_gpu": near,
            "seconds": take_turns(self._runtime, steps, self._plan.repeats),
        }

    # -- a VDI, and the settings that share it -----------------------------------------------------

    def _group(self, generated: Setting, settings: list[Setting]) -> list[dict[str, Any]]:
        self._step(f"{generated.name}: generating")
        precisions = tuple(dict.fromkeys(setting.precision for setting in settings))
        forms, seconds = self._forms(generated, precisions)
        sizes = {precision: _sizes(vdi) for precision, vdi in forms.items()}
        renderers: dict[str, VDIRenderer] = {}
        for precision, vdi in forms.items():
            prepared = PreparedVDI(self._runtime, vdi)
            sizes[precision]["bytes_memory"] = prepared.list_bytes
            renderers[precision] = VDIRenderer(self._runtime, prepared, self._plan.window_size)
        points: list[dict[str, Any]] = [
            {
                "name": setting.name,
                "setting": setting.to_dict(),
                "refused": None,
                "vdi": sizes[setting.precision],
                "generation": {
                    "seconds": seconds["generate"],
                    "packing": seconds.get(setting.precision),
                    "volume_seconds": seconds["volume"],
                },
                "angles": [],
            }
            for setting in settings
        ]
        for angle in self._plan.angles:
            rows = self._rows(angle, settings, renderers)
            for point, row in zip(points, rows, strict=True):
                point["angles"].append(row)
        return points

    def _forms(
        self, setting: Setting, precisions: tuple[str, ...]
    ) -> tuple[dict[str, VDI], dict[str, dict[str, list[float]]]]:
        """Generate the VDI and pack it, as often as is timed; kernels are compiled before."""
        width, height = self._plan.window_size
        size = (max(1, round(width * setting.lists)), max(1, round(height * setting.lists)))
        forms: dict[str, VDI] = {}

        def generate(size: tuple[int, int]) -> VDI:
            return generate_vdi(
                self._volume,
                self._plan.camera,
                size,
                self._plan.table,
                max_supersegments=setting.max_supersegments,
                criterion=setting.criterion,
                sample_distance=setting.sample_distance * min(self._volume.spacing),
                tolerance=setting.tolerance,
                view_cone=setting.view_cone,
                device=self._runtime,
            )

        def timed() -> None:
            forms.clear()
            forms["exact"] = generate(size)

        def pack(precision: str) -> None:
            forms[precision] = forms["exact"].with_precision(precision)

        generate(_WARM_UP_SIZE)
        work: dict[str, Step] = {
            "volume": partial(self._renderers.image, self._plan.camera),
            "generate": timed,
            **{p: partial(pack, p) for p in precisions if p != "exact"},
        }
        seconds = take_turns(self._runtime, work, self._plan.generations, warm_up=False)
        return {precision: forms[precision] for precision in precisions}, seconds

    def _rows(
        self, angle: float, settings: list[Setting], renderers: dict[str, VDIRenderer]
    ) -> list[dict[str, Any]]:
        """Compare and time a group's settings at one view, in turn with the volume."""
        camera = self._plan.camera.azimuth(angle)
        reference, _ = self._renderers.reference(camera, angle)
        frames: dict[str, Step] = {"volume": self._renderers.frames(camera)[_BASELINE]}
        near = []
        for setting in settings:
            self._step(f"{setting.name}: {angle:g} degrees")
            frame = partial(
                renderers[setting.precision].image,
                camera,
                self._drawn_size(setting),
                skip_empty=setting.skip_empty,
            )
            image: Image = frame()
            near.append(accuracy(enlarged(image, self._plan.window_size), reference))
            frames[setting.name] = frame
        seconds = take_turns(self._runtime, frames, self._plan.repeats)
        return [
            {
                "angle": angle,
                "to_volume": one,
                "seconds": seconds[setting.name],
                "volume_seconds": seconds["volume"],
            }
            for setting, one in zip(settings, near, strict=True)
        ]

    def _drawn_size(self, setting: Setting) -> tuple[int, int]:
        width, height = self._plan.window_size
        return max(1, round(width * setting.preview)), max(1, round(height * setting.preview))


def _sizes(vdi: VDI) -> dict[str, Any]:
    """Return how large a VDI is; ``bytes_file`` is of a ``.vdi`` in the default compression."""
    counts = vdi.counts
    occupied = int(np.count_nonzero(counts))
    saved: int | None
    with tempfile.TemporaryDirectory() as folder:
        try:
            saved = vdi.save(Path(folder) / "vdi.vdi").stat().st_size
        except VDIError:  # no room for it: nothing else is lost
            saved = None
    return {
        "window_size": list(vdi.window_size),
        "supersegments": vdi.n_supersegments,
        "mean_length": vdi.n_supersegments / occupied if occupied else 0.0,
        "longest_list": int(counts.max()),
        "bytes_file": saved,
    }


def _refused(setting: Setting, error: BaseException) -> dict[str, Any]:
    return {
        "name": setting.name,
        "setting": setting.to_dict(),
        "refused": f"{type(error).__name__}: {error}",
        "vdi": None,
        "generation": None,
        "angles": [],
    }
