"""What every measurement shares: cases, who draws them, and the run over them."""

import math
import statistics
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import DeviceError, InvalidArgumentError, VDIError
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.measure.clock import Step, Times, take_turns
from pyvista_vdi.measure.results import Results, across
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.checks import as_whole
from pyvista_vdi.model.host_memory import require_free_memory
from pyvista_vdi.model.metrics import compare_images
from pyvista_vdi.model.options import GenerationOptions, GenerationRequest, MediumOptions
from pyvista_vdi.model.render_options import FrameRequest, RenderOptions
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.raycasting.prepared import prepared_vdi
from pyvista_vdi.raycasting.raycast import draw, render_vdi
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.rays import checked_sample_distance
from pyvista_vdi.volume.render import draw_medium, raycast_medium, raycast_volume

#: Who draws, by the keys of the results, and what tables call them.
CANDIDATES: Mapping[str, str] = {
    "vdi": "VDI, f",
    "vdi_skipping": "VDI, f_e",
    "volume": "render_volume",
    "volume_skipping": "render_volume, skipping",
    "vtk_gpu": "VTK GPU",
    "vtk_fixed_point": "VTK fixed point",
}

#: Rooms whose code decides the figures of a VDI beside volume rendering.
ROOMS = ("generation", "raycasting", "volume")

#: Window in which everything is generated once before anything is timed, pixels.
WARM_UP_SIZE = (64, 36)

#: Copies of the volume that VTK's GPU mapper makes on the host where there is no GPU: the texture,
#: and what it is filled from.
_VTK_COPIES = 2

#: Repetitions of frames that are enqueued at once.
_QUEUES = 3

#: What makes a row that says why it has no figures.
REFUSALS = (VDIError, MemoryError)

Image = NDArray[np.float32]

#: Called with the finished fraction, 0 to 1, and what is being done.
Progress = Callable[..., object]

_Made = TypeVar("_Made")


@dataclass(frozen=True)
class Case:
    """What one row of a measurement is about.

    ``angle`` is in degrees of ``Azimuth`` from V_O, ``options`` are what else was chosen, such as
    ``(("max_supersegments", 15),)``, ``candidates`` who draws if not all do, and ``what`` says what
    is measured where a run measures several things.
    """

    volume: str
    look: str | None = None
    window_size: tuple[int, int] | None = None
    angle: float | None = None
    zoom: float = 1.0
    options: tuple[tuple[str, Any], ...] = ()
    candidates: tuple[str, ...] = ()
    what: str | None = None

    @property
    def chosen(self) -> dict[str, Any]:
        """The options by name."""
        return dict(self.options)

    @property
    def name(self) -> str:
        """What people call it: ``"brain, soft, 1280x720, max_supersegments 15, 5 degrees"``."""
        size, angle = self.window_size, self.angle
        parts = [self.volume, self.look, size and across(size)]
        parts += [f"{name} {value}" for name, value in self.options]
        parts += [None if angle is None else f"{angle:g} degrees"]
        parts += [None if self.zoom == 1 else f"zoomed by {self.zoom:g}", *self.candidates]
        return ", ".join(part for part in (*parts, self.what) if part)

    def to_dict(self) -> dict[str, Any]:
        """Return what tells it from others, as results have it: only what was given."""
        found: dict[str, Any] = {"what": self.what, "volume": self.volume, "look": self.look}
        found |= {"window_size": self.window_size, **self.chosen, "angle": self.angle}
        found |= {"zoom": None if self.zoom == 1 else self.zoom}
        found |= {"candidates": self.candidates or None}
        return {name: value for name, value in found.items() if value is not None}

    def camera(self, view: Camera) -> Camera:
        """Return its view, where V_O is another."""
        turned = view.azimuth(self.angle or 0.0)
        return turned.replace(view_angle=turned.view_angle / self.zoom)


def run(
    cases: Iterable[Case],
    measure: Callable[[Case], Mapping[str, Any]],
    results: Results,
    progress: Progress | None = None,
    refused: tuple[type[BaseException], ...] = REFUSALS,
) -> None:
    """Measure the cases that the results lack, and write the file after every one.

    Errors that are ``refused`` become rows with that, the reason. Cases that share a volume, a
    bench or a VDI should follow each other: see :class:`Latest`.

    ``measure`` returns a case's figures, in values that JSON can hold. ``progress`` is called with
    the finished fraction and the case's name.
    """
    missing = [case for case in cases if results.row(case.to_dict()) is None]
    for done, case in enumerate(missing):
        if progress is not None:
            progress(done / len(missing), case.name)
        try:
            figures = measure(case)
        except refused as error:
            figures = {"refused": f"{type(error).__name__}: {error}"}
        results.add(case.to_dict(), **figures)
    if progress is not None:
        progress(1.0)


class Latest(Generic[_Made]):
    """Keeps what was made for the latest key; for another it is closed, and made anew.

    What making it raised is kept as well, and raised again for the same key. ``make`` is called
    with the parts of a key.
    """

    def __init__(self, make: Callable[..., _Made]) -> None:
        self._make = make
        self._key: Any = None
        self._found: list[_Made] = []
        self._error: BaseException | None = None

    def __call__(self, *key: Any) -> _Made:
        """Return what belongs to a key."""
        if key != self._key:
            self.close()
            self._key = key
            try:
                self._found.append(self._make(*key))
            except REFUSALS as error:
                self._error = error
        if self._error is not None:
            raise self._error
        return self._found[0]

    def close(self) -> None:
        """Drop what is kept, and close it if it can be closed."""
        for one in self._found:
            getattr(one, "close", lambda: None)()
        self._found.clear()
        self._key = self._error = None

    def __enter__(self) -> "Latest[_Made]":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


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
        raise InvalidArgumentError(f"an angle is given twice: {angles!r}; give each once")


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
    """One volume with one transfer function in one window: VDIs of it, our raycaster and VTK's.

    Frames are timed with steps of one ``voxel``. Pictures are compared with those of our raycaster
    at shorter steps, half a voxel unless ``sample_distance`` is given, which are also those
    that VDIs are generated with. VTK's mappers are "raycast alone", in windows of their own without
    multisampling: ``vtk`` holds those that take part, by the keys of :data:`CANDIDATES`, and
    ``left_out`` the errors of those that cannot.

    ``volume``, ``table``: the scalars, and how they look. ``window_size``: of all frames, pixels.
    ``device``, ``vtk``: OpenCL device of ours, and whether VTK's mappers take part. ``view``: V_O;
    the view that the volume fills unless given. ``volume_property``: how the volume looks to VTK;
    as `table` says unless given.
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
        self.left_out: dict[str, VDIError] = {}
        self._media: dict[tuple[float, bool], DeviceVolume] = {}
        self._references: dict[Camera, Image] = {}
        self._near: dict[Camera, dict[str, float]] = {}
        self._open = ExitStack()
        if not vtk:
            return
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
                prop = volume_property or property_from_transfer_function(volume, table)
                baseline = VTKBaseline(volume, prop, window_size, mapper, self.voxel)
            except VDIError as error:
                self.left_out[f"vtk_{mapper}"] = error
                continue
            self._open.callback(baseline.close)
            self.vtk[f"vtk_{mapper}"] = baseline

    @property
    def opengl(self) -> str | None:
        """OpenGL renderer and version of VTK's GPU mapper, if it takes part."""
        return self.vtk["vtk_gpu"].opengl if "vtk_gpu" in self.vtk else None

    def generate(
        self, window_size: tuple[int, int] | None = None, view: Camera | None = None, **options: Any
    ) -> VDI:
        """Generate a VDI, by default from V_O in the bench's window and step."""
        device = options.pop("device", self.runtime)
        made = GenerationOptions(**{"sample_distance": self.step, **options})
        place = view or self.view, window_size or self.size
        return generate_vdi(GenerationRequest(self.volume, self.table, *place, made, device))

    def timed_generation(
        self,
        repeats: int,
        window_size: tuple[int, int] | None = None,
        *,
        before: Mapping[str, Step] | None = None,
        precisions: Sequence[str] = (),
        **options: Any,
    ) -> tuple[dict[str, VDI], dict[str, Times]]:
        """Generate a VDI as often as is timed, in turn with other work; kernels are compiled first.

        Returns it as ``exact``, and packed under its ``precisions``; and the times of
        ``generate``, of packing, and of the other work.
        """
        made: dict[str, VDI] = {}

        def generate() -> None:
            made.clear()
            made["exact"] = self.generate(window_size, **options)

        def pack(precision: str) -> None:
            made[precision] = made["exact"].with_precision(precision)

        self.generate(WARM_UP_SIZE, **options)
        packing = {name: partial(pack, name) for name in precisions if name != "exact"}
        work: dict[str, Step] = {**(before or {}), "generate": generate, **packing}
        return made, take_turns(work, repeats, runtime=self.runtime, warm_up=False)

    def raycast(
        self,
        camera: Camera,
        window_size: tuple[int, int] | None = None,
        sample_distance: float | None = None,
        **options: Any,
    ) -> Image:
        """Draw the volume as ``render_volume`` does, by default at the step of comparisons."""
        sampling = MediumOptions(sample_distance=sample_distance or self.step)
        frame = self._request(camera, window_size, options)
        return raycast_volume(self.volume, self.table, frame, sampling)

    def _request(
        self, camera: Camera, size: tuple[int, int] | None, options: dict[str, Any]
    ) -> FrameRequest:
        looks = RenderOptions(**options)
        return FrameRequest(camera, size or self.size, looks, device=self.runtime)

    def image(self, camera: Camera) -> Image:
        """Draw the volume at the step of comparisons, premultiplied RGBA (H, W, 4)."""
        return self._volume_frame(camera, self.step)

    def reference(self, camera: Camera) -> Image:
        """Return the same picture, kept for other VDIs; a black one raises InvalidArgumentError."""
        if camera not in self._references:
            self._references[camera] = self.image(camera)
        if not self._references[camera].any():
            raise InvalidArgumentError(
                "nothing is to be seen: the transfer function leaves the whole volume transparent"
            )
        return self._references[camera]

    def vtk_image(self, camera: Camera, name: str = "vtk_gpu") -> Image:
        """Draw by one of VTK's mappers at the step of comparisons, RGB (H, W, 3)."""
        self.vtk[name].set_sample_distance(self.step)
        image: Image = self.vtk[name].image(camera)
        return image

    def near_vtk(self, camera: Camera) -> dict[str, float] | None:
        """Return how near our reference and VTK's GPU mapper are; ``None`` where it draws not."""
        if "vtk_gpu" in self.vtk and camera not in self._near:
            try:
                self._near[camera] = accuracy(self.reference(camera), self.vtk_image(camera))
            except DeviceError as error:
                self.left_out["vtk_gpu"] = error
                del self.vtk["vtk_gpu"]
        return self._near.get(camera)

    def draw(
        self, vdi: VDI, camera: Camera, window_size: tuple[int, int] | None = None, **options: Any
    ) -> Image:
        """Draw a VDI; premultiplied RGBA (H, W, 4) on the host."""
        return render_vdi(vdi, self._request(camera, window_size, options))

    def frames(self, camera: Camera, vdi: VDI | None = None) -> dict[str, Step]:
        """Return what draws a frame, by the keys of :data:`CANDIDATES`.

        Ours end with the picture on the host, VTK's in its framebuffer.
        """
        steps: dict[str, Step] = {}
        if vdi is not None:
            steps["vdi"] = partial(self.draw, vdi, camera, skip_empty=False)
            steps["vdi_skipping"] = partial(self.draw, vdi, camera)
        steps["volume"] = partial(self._volume_frame, camera, self.voxel, skip_empty=False)
        steps["volume_skipping"] = partial(self._volume_frame, camera, self.voxel)
        return steps | {name: partial(self._vtk_frame, name, camera) for name in self.vtk}

    def queued(self, made: Mapping[str, VDI], camera: Camera, count: int) -> dict[str, float]:
        """Return the median seconds of a frame of ours of which ``count`` are enqueued at once.

        Each of another view, a ten-thousandth of a degree on, and left on the device: what the
        host does for a frame is in it, what brings its picture there is not. ``made``: the VDI as
        ``exact``, and packed by its precisions.
        """
        prepared = {precision: prepared_vdi(self.runtime, vdi) for precision, vdi in made.items()}
        views = [camera.azimuth(1e-4 * n) for n in range(count)]
        requests = [FrameRequest(view, self.size) for view in views]
        plain = [replace(each, options=RenderOptions(skip_empty=False)) for each in requests]
        media = {skips: self._medium(self.voxel, skip_empty=skips) for skips in (False, True)}
        with self.runtime.buffer((*self.size[::-1], 4), name="image") as image:

            def frames(
                enqueue: Callable[..., None], of: Any, asked: Sequence[FrameRequest]
            ) -> None:
                for request in asked:
                    enqueue(of, request, image)
                self.runtime.finish()

            work: dict[str, Step] = {
                "vdi": partial(frames, draw, prepared["exact"], plain),
                "vdi_skipping": partial(frames, draw, prepared["exact"], requests),
                "volume": partial(frames, draw_medium, media[False], plain),
                "volume_skipping": partial(frames, draw_medium, media[True], requests),
            }
            for precision in [name for name in made if name != "exact"]:
                work[f"vdi_{precision}"] = partial(frames, draw, prepared[precision], requests)
            times = take_turns(work, _QUEUES, warm_up=False)
        return {name: statistics.median(taken["clock"]) / count for name, taken in times.items()}

    def _vtk_frame(self, name: str, camera: Camera) -> None:
        self.vtk[name].set_sample_distance(self.voxel)
        self.vtk[name].render(camera)

    def _volume_frame(self, camera: Camera, step: float, *, skip_empty: bool = True) -> Image:
        medium = self._medium(step, skip_empty=skip_empty)
        return raycast_medium(medium, FrameRequest(camera, self.size))

    def _medium(self, step: float, *, skip_empty: bool) -> DeviceVolume:
        """Return the volume on the device, where it stays with the bench."""
        if (step, skip_empty) not in self._media:
            given = (self.runtime, self.volume, self.table)
            medium = DeviceVolume(*given, sample_distance=step, skip_empty=skip_empty)
            self._media[step, skip_empty] = medium
        return self._media[step, skip_empty]

    def close(self) -> None:
        """Release VTK's windows, and what lies on the device."""
        self._open.close()
        self.vtk.clear()
        self._media.clear()

    def __enter__(self) -> "Bench":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()
