"""One volume with one transfer function in one window, drawn by all who can, and timed in turn."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.checks import Number
from pyvista_vdi.model.host_memory import require_host_memory
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.options import (
    FrameRequest,
    GenerationOptions,
    GenerationRequest,
    RenderOptions,
)
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.raycasting.raycast import render_vdi
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.rays import checked_sample_distance
from pyvista_vdi.volume.render import raycast_medium

Image = NDArray[np.float32]

#: A piece of work; its result is not looked at.
Step = Callable[[], object]


def take_turns(
    work: Mapping[str, Step],
    repeats: int,
    *,
    warm_up: bool = True,
) -> dict[str, list[float]]:
    """Time pieces of work, one after the other in turn, and return the seconds by name.

    ``warm_up``: do each once before, so that nothing is compiled or uploaded while it is timed.
    """
    for step in work.values() if warm_up else ():
        step()
    taken: dict[str, list[float]] = {name: [] for name in work}
    for _ in range(repeats):
        for name, step in work.items():
            begin = time.perf_counter()
            step()
            taken[name].append(time.perf_counter() - begin)
    return taken


def ratio(ours: Sequence[float], theirs: Sequence[float]) -> float:
    """Return the median of each repetition over the other's in the same round."""
    return statistics.median(a / b for a, b in zip(ours, theirs, strict=True))


def describe_system(bench: Bench) -> dict[str, str]:
    """Return device, driver, OpenGL and the versions that a measured figure depends on."""
    info = bench.runtime.info
    described = {"device": info.full_name, "driver": info.driver}
    if "gpu" in bench.vtk:
        described["OpenGL"] = bench.vtk["gpu"].opengl
    for name in ("pyvista-vdi", "numpy", "pyopencl", "scikit-image", "vtk", "pyvista"):
        with suppress(PackageNotFoundError):
            described[name] = version(name)
    return described


def accuracy(image: Image, reference: Image) -> dict[str, float]:
    """Return what tables say of a picture beside another; the settings are those of ``metrics``."""
    found = compare_images(image, reference)
    worst, brightness = found.worst_pixel, found.mean_brightness_ratio
    return {"ssim": found.ssim, "psnr": found.psnr, "worst_pixel": worst, "brightness": brightness}


def check_plan(angles: Sequence[float], least: int = 1, **counts: int) -> None:
    """Refuse angles that are none, and numbers of repetitions that make no sense."""
    for name, count in counts.items():
        Number(low=least, high=1000, whole=True, name=name)(count)
    if not angles or not all(math.isfinite(a) for a in angles):
        raise InvalidArgumentError(f"angles must be one or more numbers of degrees; got {angles!r}")


def as_json(value: Any) -> Any:
    """Return a value for JSON: whole arrays as lists, null for what is infinite or undefined."""
    if isinstance(value, Mapping):
        return {str(key): as_json(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [as_json(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


class Bench:
    """VDIs of a volume, our raycaster and VTK's mappers, all in one window.

    Frames are timed with steps of one ``voxel``. Pictures are compared with those of our raycaster
    at shorter steps, half a voxel unless ``sample_distance`` is given, which are also those
    that VDIs are generated with. VTK's mappers draw in windows of their own without multisampling:
    ``vtk`` holds them, if they take part, as "gpu" and "fixed_point". ``view`` is V_O, the view
    that the volume fills unless given; ``volume_property`` how the volume looks to VTK, as `table`
    says unless given.
    """

    def __init__(
        self,
        volume: Volume,
        table: TransferFunction,
        window_size: tuple[int, int],
        *,
        device: Any = None,
        vtk: bool = True,
        view: Camera | None = None,
        sample_distance: float | None = None,
        volume_property: Any = None,
    ) -> None:
        self.volume, self.table, self.size = volume, table, window_size
        self.runtime = get_runtime(device)
        self.view = view or filling_camera(volume.bounds, window_size)
        self.voxel = min(volume.spacing)
        self.step = checked_sample_distance(volume, sample_distance)
        self.vtk: dict[str, Any] = {}
        self._media: dict[tuple[float, bool], DeviceVolume] = {}
        self._references: dict[Camera, Image] = {}
        if not vtk:
            return
        from pyvista_vdi.measure.vtk_mappers import MAPPERS, VTKMapper, property_of

        prop = volume_property or property_of(volume, table)
        # Without a GPU its mapper makes a texture on the host, and what this is filled from
        need, what = 2 * volume.array.nbytes, f"{volume.name!r} in VTK's GPU mapper as well"
        require_host_memory(need, what, "take a smaller one, or no VTK (vtk=False)", free=True)
        for name in MAPPERS:
            self.vtk[name] = VTKMapper(volume, prop, window_size, name)

    def generate(self, window_size: tuple[int, int] | None = None, **options: Any) -> VDI:
        """Generate a VDI from V_O, by default in the bench's window and step."""
        made = GenerationOptions(**{"sample_distance": self.step, **options})
        seen = self.volume, self.table, self.view, window_size or self.size
        return generate_vdi(GenerationRequest(*seen, made, self.runtime))

    def draw(
        self, vdi: VDI, camera: Camera, window_size: tuple[int, int] | None = None, **options: Any
    ) -> Image:
        """Draw a VDI; premultiplied RGBA (H, W, 4) on the host."""
        frame = camera, window_size or self.size, RenderOptions(**options)
        return render_vdi(vdi, FrameRequest(*frame, device=self.runtime))

    def raycast(
        self, camera: Camera, step: float | None = None, *, skip_empty: bool = True, **options: Any
    ) -> Image:
        """Draw the volume, which stays on the device, by default at the step of comparisons."""
        key = step or self.step, skip_empty
        if key not in self._media:
            own = self.runtime, self.volume, self.table
            self._media[key] = DeviceVolume(*own, sample_distance=key[0], skip_empty=skip_empty)
        shown = RenderOptions(**options)
        return raycast_medium(self._media[key], FrameRequest(camera, self.size, shown))

    def reference(self, camera: Camera) -> Image:
        """Return the same picture, kept for other VDIs; a black one raises InvalidArgumentError."""
        if camera not in self._references:
            self._references[camera] = self.raycast(camera)
        if not self._references[camera].any():
            raise InvalidArgumentError(
                "nothing is to be seen: all of it is transparent; choose another opacity or clim"
            )
        return self._references[camera]

    def frames(self, camera: Camera, vdi: VDI | None = None) -> dict[str, Step]:
        """Return what draws a frame at steps of one voxel: "vdi", "volume" and those of ``vtk``.

        Ours end with the picture on the host, VTK's in its framebuffer.
        """
        steps: dict[str, Step] = {} if vdi is None else {"vdi": partial(self.draw, vdi, camera)}
        steps["volume"] = partial(self.raycast, camera, self.voxel)
        return steps | {n: partial(each.render, camera, self.voxel) for n, each in self.vtk.items()}

    def close(self) -> None:
        """Release VTK's windows, and what lies on the device."""
        for mapper in self.vtk.values():
            mapper.close()
        self.vtk.clear()
        self._media.clear()
