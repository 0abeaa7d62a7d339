"""One volume rendered by VTK's mappers, our volume raycaster and a VDI, side by side.

Pictures are compared at the accuracy step (half the smallest spacing unless given), frames are
timed with steps of one voxel in every volume renderer (``docs/conventions.md``). The candidates
take turns, after one frame each that is not counted, and the median is reported.
"""

from __future__ import annotations

import math
import os
import statistics
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.io.progress import Pieces
from pyvista_vdi.measure.clock import Step, Times, take_turns
from pyvista_vdi.measure.harness import (
    ROOMS,
    WARM_UP_SIZE,
    Bench,
    Case,
    Image,
    check_angles,
    check_count,
)
from pyvista_vdi.measure.results import Results, describe_system, now
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.metrics import Comparison, compare_images, over_background
from pyvista_vdi.model.standard_cases import ANGLES, WINDOW_SIZE
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.raycasting.prepared import prepared_vdi

#: What takes part, by the keys of :attr:`AngleResult.seconds` and of the pictures.
NAMES = {
    "vdi": "VDI",
    "raycaster": "our volume raycaster",
    "gpu": "VTK GPU mapper",
    "fixed_point": "VTK fixed-point mapper",
}

#: Bytes of a supersegment in the dense, uncompressed form that sizes are compared with.
_DENSE_BYTES = 24

#: Panels of a row, in this order; those that were not rendered are left out.
_COLUMNS = ("gpu", "fixed_point", "raycaster", "vdi")

#: Pairs of pictures, by the names that a view's comparisons have.
_PAIRS = {
    "vdi_to_raycaster": "VDI / our raycaster",
    "raycaster_to_gpu": "our raycaster / VTK GPU",
    "fixed_point_to_gpu": "VTK fixed-point / VTK GPU",
}

#: Width of a panel in the picture, pixels; larger frames are scaled down to it.
PANEL_WIDTH = 640

#: The last panel: absolute difference of VDI and raycaster, times this.
DIFFERENCE_GAIN = 8

_CAPTION_HEIGHT, _GAP = 26, 4

Images = dict[str, Image]


@dataclass(frozen=True)
class Settings:
    """What is measured: a classification, by arguments of :func:`pyvista_vdi.generate`, and views.

    ``window_size`` is that of the VDI and of all frames, ``angles`` are degrees of ``Azimuth`` from
    V_O. ``sample_distance`` is the accuracy step, model units, half the smallest spacing by
    default; ``repeats`` are timed frames of each candidate and view, of which 0 compares pictures
    and times nothing. ``vtk``: whether VTK's mappers take part; ``name``: what the volume and the
    transfer function are called in the report.
    """

    classification: Mapping[str, Any]
    window_size: tuple[int, int] = WINDOW_SIZE
    angles: tuple[float, ...] = ANGLES
    max_supersegments: int = 20
    precision: str = "exact"
    sample_distance: float | None = None
    repeats: int = 3
    vtk: bool = True
    device: Any = None
    name: str = "volume"

    def __post_init__(self) -> None:
        check_count("repeats", self.repeats, least=0)
        check_angles(self.angles)


@dataclass(frozen=True)
class Timing:
    """Seconds of repeated work: the median and the worst."""

    median: float
    worst: float

    @classmethod
    def of(cls, taken: Times) -> Timing:
        """Return what repetitions by the wall's clock come to."""
        return cls(statistics.median(taken["clock"]), max(taken["clock"]))


@dataclass(frozen=True)
class AngleResult:
    """What was found at one view, degrees from V_O.

    The VDI is compared with our volume raycaster; this one, and VTK's fixed-point mapper, with
    VTK's GPU mapper, ``None`` without VTK. ``seconds`` are frame times at steps of one voxel, by
    the keys of :data:`NAMES`; empty if not timed.
    """

    angle: float
    vdi_to_raycaster: Comparison
    raycaster_to_gpu: Comparison | None
    fixed_point_to_gpu: Comparison | None
    seconds: dict[str, Timing]

    @property
    def ratio_to_vtk(self) -> float | None:
        """VDI's frame time over that of the faster of VTK's mappers."""
        return self._over("gpu", "fixed_point")

    @property
    def ratio_to_raycaster(self) -> float | None:
        """VDI's frame time over that of our volume raycaster."""
        return self._over("raycaster")

    def _over(self, *names: str) -> float | None:
        peers = [self.seconds[name].median for name in names if name in self.seconds]
        return self.seconds["vdi"].median / min(peers) if peers else None


@dataclass(frozen=True)
class Report:
    """All that was found, ready for JSON by :meth:`to_dict`.

    ``case`` holds volume, classification, window, limits and steps; ``system`` device, driver,
    OpenGL and versions; ``sizes`` supersegments, lists, and bytes: of the volume, of the VDI in the
    process's memory and on the device, of its dense form. ``full_raycast_seconds`` are those of our
    volume raycaster at the step of generation without early termination; ``None`` where nothing was
    timed. ``angles`` has the results by view, ``begun`` says when the measurement began.
    """

    case: dict[str, Any]
    system: dict[str, str]
    sizes: dict[str, int]
    generation_seconds: Timing | None
    full_raycast_seconds: Timing | None
    angles: list[AngleResult] = field(default_factory=list)
    begun: str | None = None

    @property
    def generation_ratio(self) -> float | None:
        """Generation time over that of the full raycast at the same step."""
        if self.generation_seconds is None or self.full_raycast_seconds is None:
            return None
        return self.generation_seconds.median / self.full_raycast_seconds.median

    def results(self, path: str | os.PathLike[str] | None = None) -> Results:
        """Return everything as the JSON has it: a row of the VDI, and one of each view."""
        described = asdict(self)
        plan, angles = described["case"], described["angles"]
        results = Results.begun("compare", plan, rooms=ROOMS, path=path)
        results.data |= {"system": self.system, "begun": self.begun or results.data["begun"]}
        case = partial(Case, plan["name"], window_size=tuple(plan["window_size"]))
        names = ("generation_seconds", "full_raycast_seconds")
        times = {name: described[name] for name in names}
        ratio = {"generation_ratio": self.generation_ratio}
        results.add(case(what="vdi").to_dict(), **self.sizes, **times, **ratio)
        for result, figures in zip(self.angles, angles, strict=True):
            ratios = {n: getattr(result, n) for n in ("ratio_to_vtk", "ratio_to_raycaster")}
            view = case(angle=figures.pop("angle"), what="view")
            results.add(view.to_dict(), **figures, **ratios)
        return results

    def to_dict(self) -> dict[str, Any]:
        """Return the same in values that JSON can hold; infinite and undefined become null."""
        return self.results().data


def measure(
    volume: Volume, settings: Settings, progress: Callable[[float], object] | None = None
) -> tuple[Report, VDI, dict[float, Images]]:
    """Render one volume in every way, compare the pictures and time the frames.

    ``progress`` is called with the finished fraction, 0 to 1. Returns the figures, what was
    generated from V_O, and the pictures by angle and by the keys of :data:`NAMES`, float32 (H, W, 3
    or 4) over black. Raises MissingDependencyError or DeviceError if VTK takes part and cannot be
    loaded, or draws nothing, or the OpenCL device fails; InvalidArgumentError if the transfer
    function leaves nothing to see.
    """
    looks = Classification.composited(settings.classification, "compare")
    done, begun = Pieces(progress, 1 + 2 * len(settings.angles)), now()
    with Bench(
        volume,
        looks.transfer_function_of(volume),
        settings.window_size,
        device=settings.device,
        vtk=settings.vtk,
        sample_distance=settings.sample_distance,
        volume_property=_property(volume, settings) if settings.vtk else None,
    ) as bench:
        for error in bench.left_out.values():
            raise error
        vdi, generation, full_raycast = _generated(bench, settings)
        done()
        images, seconds = {}, {}
        for angle in settings.angles:
            images[angle] = _images(bench, vdi, angle)
            done()
        for angle in settings.angles:
            seconds[angle] = _frame_times(bench, vdi, angle, settings.repeats)
            done()
        system = describe_system(settings.device)
        if bench.opengl is not None:
            system["opengl"] = bench.opengl
        lists = math.prod(settings.window_size)
        case = {
            "name": settings.name,
            "dimensions": list(volume.dimensions),
            "spacing": list(volume.spacing),
            "dtype": str(volume.array.dtype),
            "window_size": list(settings.window_size),
            "max_supersegments": settings.max_supersegments,
            "precision": settings.precision,
            "sample_distance": bench.step,
            "timing_sample_distance": bench.voxel,
            "repeats": settings.repeats,
            "camera": bench.view.to_dict(),
            "classification": looks.describe(),
        }
        sizes = {
            "volume_bytes": volume.array.nbytes,
            "supersegments": vdi.n_supersegments,
            "occupied_lists": int(np.count_nonzero(vdi.counts)),
            "lists": lists,
            "vdi_bytes": vdi.nbytes,
            "device_bytes": prepared_vdi(bench.runtime, vdi).list_bytes,
            "dense_bytes": lists * settings.max_supersegments * _DENSE_BYTES,
        }
        results = [
            AngleResult(
                angle,
                compare_images(found["vdi"], found["raycaster"]),
                compare_images(found["raycaster"], found["gpu"]) if settings.vtk else None,
                compare_images(found["fixed_point"], found["gpu"]) if settings.vtk else None,
                seconds[angle],
            )
            for angle, found in images.items()
        ]
        report = Report(case, system, sizes, generation, full_raycast, results, begun)
        return report, vdi, images


def _property(volume: Volume, settings: Settings) -> Any:
    """Return how VTK's mappers see the volume: the property that ``add_volume`` would make."""
    from pyvista_vdi.measure.vtk_baselines import add_volume_property

    # Which array it is, has been chosen
    arguments = {
        name: value
        for name, value in settings.classification.items()
        if name not in ("scalars", "preference")
    }
    if "transfer_function" in arguments:
        raise InvalidArgumentError(
            "VTK's mappers take no transfer_function: give add_volume's arguments or a "
            "volume_property, or leave VTK out"
        )
    return arguments.get("volume_property") or add_volume_property(volume, arguments)


def _generated(bench: Bench, settings: Settings) -> tuple[VDI, Timing | None, Timing | None]:
    """Generate the VDI, in turn with a full raycast at the same step where that is timed."""
    limit, precision = settings.max_supersegments, settings.precision
    options: dict[str, Any] = {"max_supersegments": limit, "precision": precision}
    if settings.repeats == 0:
        return bench.generate(**options), None, None
    # Without skipping: the plain baseline that the paper compares with
    whole = partial(bench.raycast, bench.view, skip_empty=False, transmittance_cutoff=0.0)
    whole(window_size=WARM_UP_SIZE)
    made, taken = bench.timed_generation(settings.repeats, before={"raycast": whole}, **options)
    return made["exact"], Timing.of(taken["generate"]), Timing.of(taken["raycast"])


def _images(bench: Bench, vdi: VDI, angle: float) -> Images:
    """Render the accurate pictures of one view."""
    camera = bench.view.azimuth(angle)
    images = {name.removeprefix("vtk_"): bench.vtk_image(camera, name) for name in bench.vtk}
    images["raycaster"] = bench.raycast(camera, skip_empty=False)
    images["vdi"] = bench.draw(vdi, camera)
    if not images["raycaster"].any():
        raise InvalidArgumentError(
            f"nothing is to be seen at {angle:g} degrees: the transfer function leaves the whole "
            "volume transparent; choose another opacity or clim"
        )
    return images


def _frame_times(bench: Bench, vdi: VDI, angle: float, repeats: int) -> dict[str, Timing]:
    """Time frames at steps of one voxel."""
    if repeats == 0:
        return {}
    camera = bench.view.azimuth(angle)
    frames = bench.frames(camera, vdi)
    raycast = partial(bench.raycast, camera, None, bench.voxel, skip_empty=False)
    chosen: dict[str, Step] = {"vdi": frames["vdi_skipping"], "raycaster": raycast}
    chosen |= {name.removeprefix("vtk_"): frames[name] for name in bench.vtk}
    taken = take_turns(chosen, repeats)
    return {name: Timing.of(times) for name, times in taken.items()}


def table(report: Report) -> str:
    """Return what :func:`measure` found as text of fixed width, without a newline at the end."""
    case = report.case
    width, height = case["window_size"]
    dimensions = " x ".join(str(n) for n in case["dimensions"])
    lines = [
        f"{case['name']}: {dimensions} {case['dtype']}, {width} x {height} lists",
        f"at most {case['max_supersegments']} supersegments ({case['precision']})",
        f"step: {case['sample_distance']:g} model units",
        *(f"{name}: {value}" for name, value in report.system.items()),
        *("", "Pictures                   degrees      SSIM   PSNR dB  worst/255  brightness"),
    ]
    for name, label in _PAIRS.items():
        lines += [
            f"{label:<26} {result.angle:7g}  {near.ssim:8.5f}  {near.psnr:8.2f}  "
            f"{near.worst_pixel:9.2f}  {near.mean_brightness_ratio:10.4f}"
            for result in report.angles
            if (near := getattr(result, name)) is not None
        ]
    if case["repeats"]:
        names = [name for name in NAMES if name in report.angles[0].seconds]
        lines += ["", f"Frames, ms (median of {case['repeats']}; steps of one voxel)"]
        lines += ["degrees" + "  ".join(f"{NAMES[n]:>22}" for n in names) + "   VDI / VTK"]
        for result in report.angles:
            times = "  ".join(f"{result.seconds[n].median * 1e3:22.1f}" for n in names)
            ratio = result.ratio_to_vtk
            over = "-" if ratio is None else f"{ratio:9.2f}"
            lines += [f"{result.angle:7g}{times}   {over}"]
        lines += ["VDI / VTK: the VDI's frame time over that of the faster of VTK's two mappers"]
        if report.generation_seconds is not None:
            against = f"{report.generation_ratio:.2f} x our raycaster"
            lines += ["", f"Generation {report.generation_seconds.median:.2f} s"]
            lines += [f"that is {against}, same step, no early termination"]
    sizes = {name: f"{n / 2**20:.1f} MiB" for name, n in report.sizes.items() if "bytes" in name}
    saved = f", file {sizes['file_bytes']}" if "file_bytes" in sizes else ""
    about_lists = f"{report.sizes['occupied_lists']} of {report.sizes['lists']} lists"
    lines += ["", f"Sizes: volume {sizes['volume_bytes']}, VDI {sizes['vdi_bytes']} in memory, "]
    lines[-1] += (
        f"{sizes['device_bytes']} on the device ({report.sizes['supersegments']} supersegments in "
        f"{about_lists}), dense form {sizes['dense_bytes']}{saved}"
    )
    return "\n".join(lines)


def contact_sheet(report: Report, images: Mapping[float, Images]) -> NDArray[np.uint8]:
    """Return all panels in one picture: a row per angle, a column per renderer.

    uint8 (height, width, 3), top row first; black behind the panels, captions above them.
    """
    from PIL import Image, ImageDraw, ImageFont

    columns = [name for name in _COLUMNS if name in next(iter(images.values()))]
    width, height = report.case["window_size"]
    panel = (min(width, PANEL_WIDTH), max(1, round(height * min(width, PANEL_WIDTH) / width)))
    step = (panel[0] + _GAP, panel[1] + _CAPTION_HEIGHT + _GAP)
    size = ((len(columns) + 1) * step[0] - _GAP, len(images) * step[1] - _GAP)
    sheet = Image.new("RGB", size, "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(16)
    for row, result in enumerate(report.angles):
        pictures = {n: over_background(images[result.angle][n]) for n in columns}
        panels = [(f"{NAMES[n]}, {result.angle:g} degrees", pictures[n]) for n in columns]
        off = DIFFERENCE_GAIN * np.abs(pictures["vdi"] - pictures["raycaster"])
        ssim = f"SSIM {result.vdi_to_raycaster.ssim:.4f}"
        panels.append((f"|VDI - our raycaster| x {DIFFERENCE_GAIN}, {ssim}", off))
        for column, (caption, picture) in enumerate(panels):
            x, y = column * step[0], row * step[1]
            draw.text((x + 4, y + 4), caption, fill="black", font=font)
            pixels = np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8)
            scaled = Image.fromarray(pixels).resize(panel, Image.Resampling.LANCZOS)
            sheet.paste(scaled, (x, y + _CAPTION_HEIGHT))
    return np.asarray(sheet)
