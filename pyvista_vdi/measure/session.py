"""What measurements share: who draws, how a VDI is made and sized, progress, refusals, checks."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import Runtime
from pyvista_vdi.errors import InvalidArgumentError, VDIError
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.measure.clock import WALL, Step, Times, take_turns
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.checks import as_whole
from pyvista_vdi.model.host_memory import require_free_memory
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.render_options import FrameRequest, RenderOptions
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.raycasting.raycast import render_vdi
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.render import raycast_medium

#: Who takes part, by the keys of the results, and what tables call them.
CANDIDATES: Mapping[str, str] = {
    "vdi": "VDI, f",
    "vdi_skipping": "VDI, f_e",
    "volume": "render_volume",
    "volume_skipping": "render_volume, skipping",
    "vtk_gpu": "VTK GPU",
    "vtk_fixed_point": "VTK fixed point",
}

#: Window in which everything is drawn or generated once before anything is timed, pixels.
WARM_UP_SIZE = (64, 36)

#: Copies of the volume that VTK's GPU mapper makes on the host where there is no GPU: the texture,
#: and what it is filled from.
_VTK_COPIES = 2

Image = NDArray[np.float32]

#: Called with the finished fraction, 0 to 1, and, where it is known, what is being done.
Progress = Callable[..., object]


class Steps:
    """Counts pieces of work and reports their share."""

    def __init__(self, progress: Progress | None, total: int) -> None:
        self._progress, self._total, self._done = progress, max(1, total), 0

    def __call__(self, *doing: str, finished: int = 0) -> None:
        """Say what is being done, after some pieces are finished."""
        self._done += finished
        if self._progress is not None:
            self._progress(min(1.0, self._done / self._total), *doing)

    def begin(self, doing: str) -> None:
        """Say what is being done: a piece, finished by the time of the next call."""
        self(doing)
        self._done += 1


def refusal(error: BaseException) -> str:
    """Return why something was not measured."""
    return f"{type(error).__name__}: {error}"


def check_count(name: str, value: int, least: int = 1) -> None:
    """Refuse what is no number of repetitions, or makes no sense as one."""
    if not (isinstance(value, int) and least <= as_whole(value) <= 1000):
        raise InvalidArgumentError(
            f"{name} must be a whole number from {least} to 1000; got {value!r}"
        )


def check_angles(angles: Sequence[float]) -> None:
    """Refuse angles that are none, and those that are given twice."""
    if not angles or not all(math.isfinite(a) for a in angles):
        raise InvalidArgumentError(f"angles must be one or more numbers of degrees; got {angles!r}")
    if len(set(angles)) < len(angles):
        raise InvalidArgumentError(f"an angle is given twice: {angles!r}")


def sizes_of(vdi: VDI) -> dict[str, Any]:
    """Return how large a VDI is, on the host and as a ``.vdi`` in the default compression."""
    counts = vdi.counts
    occupied = int(np.count_nonzero(counts))
    saved: int | None = None
    with tempfile.TemporaryDirectory() as folder:
        begin = time.perf_counter()
        with suppress(VDIError):  # no room for it: nothing else is lost
            saved = vdi.save(Path(folder) / "vdi.vdi").stat().st_size
        seconds = time.perf_counter() - begin
    return {
        "lists": int(counts.size),
        "occupied_lists": occupied,
        "supersegments": vdi.n_supersegments,
        "mean_length": vdi.n_supersegments / occupied if occupied else 0.0,
        "longest_list": int(counts.max()),
        "bytes_raw": vdi.nbytes,
        "bytes_saved": saved,
        "save_seconds": seconds if saved is not None else None,
    }


def accuracy(image: Image, reference: Image) -> dict[str, float]:
    """Return what tables say of a picture beside another; the settings are those of ``metrics``."""
    found = compare_images(image, reference)
    return {"ssim": found.ssim, "psnr": found.psnr, "worst_pixel": found.worst_pixel}


def seen(image: Image, angle: float, remedy: str = "") -> Image:
    """Return the volume's picture, or refuse to compare anything with a black one."""
    if not image.any():
        raise InvalidArgumentError(f"nothing is to be seen at {angle:g} degrees{remedy}")
    return image


def enlarged(image: Image, size: tuple[int, int]) -> Image:
    """Return an image in the window's size, by linear interpolation as the texture unit's."""
    from skimage.transform import resize  # loads SciPy

    width, height = size
    if image.shape[:2] == (height, width):
        return image
    # Pixel centres keep their places and edges are extended, as GL_LINEAR and CLAMP_TO_EDGE do
    whole: Image = resize(image, (height, width, 4), order=1, mode="edge", anti_aliasing=False)
    return whole


class Bench:
    """One volume in our raycaster and in VTK's mappers, for one window; and VDIs of it.

    Frames are timed with steps of one voxel and compared with steps of half a voxel, which is the
    step that VDIs are generated with. ``left_out`` names the candidates that cannot draw it, and
    why.
    """

    def __init__(
        self,
        runtime: Runtime,
        volume: Volume,
        table: TransferFunction,
        size: tuple[int, int],
        vtk: bool,
    ) -> None:
        self._runtime, self._volume, self._table, self.size = runtime, volume, table, size
        self.view = filling_camera(volume.bounds, size)
        self.voxel = min(volume.spacing)
        self.step = self.voxel / 2
        self._accurate = DeviceVolume(runtime, volume, table, sample_distance=self.step)
        self._timed = {
            "volume": DeviceVolume(
                runtime, volume, table, sample_distance=self.voxel, skip_empty=False
            ),
            "volume_skipping": DeviceVolume(runtime, volume, table, sample_distance=self.voxel),
        }
        self._references: dict[float, tuple[Image, dict[str, float] | None]] = {}
        self._baselines: dict[str, Any] = {}
        self.left_out: dict[str, str] = {}
        self._open = ExitStack()
        if vtk:
            self._find_baselines(volume, table)

    @property
    def opengl(self) -> str | None:
        """OpenGL renderer and version of VTK's GPU mapper, if it takes part."""
        return self._baselines["vtk_gpu"].opengl if "vtk_gpu" in self._baselines else None

    def generate(
        self,
        view: Camera,
        size: tuple[int, int],
        repeats: int,
        *,
        before: Mapping[str, Step] | None = None,
        forms: Sequence[str] = (),
        clocks: Mapping[str, Callable[[], float]] = WALL,
        **options: Any,
    ) -> tuple[dict[str, VDI], dict[str, Times]]:
        """Generate a VDI as often as is timed, in turn with other work; kernels are compiled first.

        Returns it as ``exact``, and in packed ``forms`` under their precisions; and the times of
        ``generate``, of packing, and of the other work.
        """
        made: dict[str, VDI] = {}

        def generate(size: tuple[int, int]) -> None:
            made.clear()
            device = self._runtime
            made["exact"] = generate_vdi(
                self._volume, view, size, self._table, device=device, **options
            )

        def pack(precision: str) -> None:
            made[precision] = made["exact"].with_precision(precision)

        generate(WARM_UP_SIZE)
        packing = {form: partial(pack, form) for form in forms if form != "exact"}
        work: dict[str, Step] = {**(before or {}), "generate": partial(generate, size), **packing}
        taken = take_turns(work, repeats, runtime=self._runtime, warm_up=False, clocks=clocks)
        return made, taken

    def image(self, camera: Camera) -> Image:
        """Draw at the accurate step, premultiplied RGBA (H, W, 4)."""
        return raycast_medium(self._accurate, FrameRequest(camera, self.size))

    def reference(self, camera: Camera, angle: float) -> tuple[Image, dict[str, float] | None]:
        """Return our picture of a view, and how near VTK's is; both are kept for other VDIs.

        A black picture raises InvalidArgumentError.
        """
        if angle not in self._references:
            image = seen(self.image(camera), angle)
            theirs = self._vtk_image(camera)
            near = None if theirs is None else accuracy(image, theirs)
            self._references[angle] = (image, near)
        return self._references[angle]

    def _vtk_image(self, camera: Camera) -> Image | None:
        """Draw by VTK's GPU mapper at the accurate step, RGB (H, W, 3); ``None`` without it."""
        gpu = self._baselines.get("vtk_gpu")
        if gpu is None:
            return None
        try:
            gpu.set_sample_distance(self.step)
            image: Image = gpu.image(camera)
        except VDIError as error:
            self.left_out["vtk_gpu"] = str(error)
            del self._baselines["vtk_gpu"]
            return None
        return image

    def frames(self, camera: Camera) -> dict[str, Step]:
        """Return what draws a frame, by candidate; ours ends with the picture on the host."""
        steps: dict[str, Step] = {
            name: partial(raycast_medium, medium, FrameRequest(camera, self.size))
            for name, medium in self._timed.items()
        }
        for name, baseline in self._baselines.items():
            baseline.set_sample_distance(self.voxel)
            steps[name] = partial(baseline.render, camera)
        return steps

    def close(self) -> None:
        """Release VTK's windows."""
        self._open.close()
        self._baselines.clear()

    def _find_baselines(self, volume: Volume, table: TransferFunction) -> None:
        from pyvista_vdi.measure.vtk_baselines import (
            MAPPERS,
            VTKBaseline,
            property_from_transfer_function,
        )

        for mapper in MAPPERS:
            try:
                if mapper == "gpu":
                    require_free_memory(
                        _VTK_COPIES * volume.array.nbytes,
                        f"the volume {volume.name!r} in VTK's GPU mapper as well, beside ours,",
                        "take a smaller one, or a machine with more memory",
                    )
                prop = property_from_transfer_function(volume, table)
                baseline = VTKBaseline(volume, prop, self.size, mapper, self.voxel)
            except VDIError as error:
                self.left_out[f"vtk_{mapper}"] = str(error)
                continue
            self._open.callback(baseline.close)
            self._baselines[f"vtk_{mapper}"] = baseline


class VDIRenderer:
    """One VDI on the device, drawn without and with skipping of empty space."""

    def __init__(self, runtime: Runtime, vdi: VDI, size: tuple[int, int]) -> None:
        self._runtime, self._vdi, self._size = runtime, vdi, size

    def image(self, camera: Camera, size: tuple[int, int] | None = None, **options: Any) -> Image:
        """Draw a frame; premultiplied RGBA (H, W, 4) on the host."""
        looks = RenderOptions(**options)
        frame = FrameRequest(camera, size or self._size, looks, device=self._runtime)
        return render_vdi(self._vdi, frame)

    def frames(self, camera: Camera) -> dict[str, Step]:
        """Return what draws a frame, by candidate."""
        return {
            "vdi": partial(self.image, camera, skip_empty=False),
            "vdi_skipping": partial(self.image, camera),
        }
