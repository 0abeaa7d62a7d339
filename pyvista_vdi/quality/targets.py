"""Resolves what is asked of a VDI to its settings: a preset by a table, a target by a measurement.

What may be chosen is a ladder of settings (:data:`LADDER`). Three small VDIs, of few or short
lists, tell what each rung gives: a few tiles of one new view are rendered by them and by the
volume, and the rest is inferred. docs/dial.md says how, and how well that predicts.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi import registry
from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import (
    Cancelled,
    InvalidArgumentError,
    UnsupportedError,
    warn_external,
)
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.coverage import bounds_corners
from pyvista_vdi.model.metrics import SSIM_WINDOW
from pyvista_vdi.model.options import GenerationOptions, GenerationRequest, QualityTarget
from pyvista_vdi.model.packing import Precision
from pyvista_vdi.model.render_options import FrameRequest, RenderOptions
from pyvista_vdi.model.types import ClientLike
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.view_error import ViewErrorEstimator, tiles_ssim, world_centre
from pyvista_vdi.raycasting.raycast import render_vdi

#: Goals from which on no rung has fewer than half a list per pixel along each edge: below, a list
#: covers several pixels, whose squares people see and SSIM does not.
SSIM_WITHOUT_SQUARES = 0.96
#: How fast the loss across lists falls beyond half a list per pixel: its exponent is the first
#: number plus the second times the exponent between a fifth and a half, within this range. Fitted
#: to the cases of docs/decisions/dial.md.
EXPONENT, _EXPONENTS = (1.15, 0.05), (0.6, 1.8)
#: A frame's time over that of the rough VDI's, as powers of the density and the longest list over
#: its own. Fitted on a CPU, at 09bbf10.
FRAME_COST = (0.44, 0.27)
#: Tiles that are measured, and their edge in pixels: docs/decisions/dial.md.
TILES, TILE_SIZE = 9, 32
#: Frames of the rough VDI that are timed; the shortest counts.
_FRAMES = 2
#: Options that are chosen, or left no room for.
_CHOSEN = ("max_supersegments", "tolerance", "precision")
#: Share of a limit in bytes that is left free: lists are counted on a sample of the rays.
_BYTES_MARGIN = 0.05
#: Bytes of a list and of a supersegment on a device, in the 8-byte form: a list that is not empty
#: has two supersegments' room for its header.
_LIST_BYTES, _SUPERSEGMENT_BYTES, _HEADER_BYTES = 4, 8, 16

_TOO_LARGE = (
    "max_bytes={} cannot be kept: the smallest VDI that a target chooses has {} bytes; allow more, "
    "or ask for a smaller window"
)
_UNAVOIDABLE = (
    "; {:.3f} of the loss is what the generating view's window does not cover, or light that moves "
    "with the camera: another generating view helps, other settings do not"
)


@dataclass(frozen=True)
class Setting:
    """One rung of the ladder.

    Attributes
    ----------
    lists : float
        Lists along an edge of the VDI's window, over the pixels of the window asked for.
    max_supersegments : int
        Longest list.
    precision : str
        Of the supersegments, see :meth:`VDI.with_precision`.
    """

    lists: float
    max_supersegments: int
    precision: Precision = "8-byte"

    def window_size(self, window_size: tuple[int, int]) -> tuple[int, int]:
        """Return the VDI's window for pictures of ``window_size``."""
        width, height = (max(1, round(self.lists * edge)) for edge in window_size)
        return width, height

    def applied_to(self, request: GenerationRequest) -> GenerationRequest:
        """Return a request with what this rung says."""
        longest, precision = self.max_supersegments, self.precision
        options = replace(request.options, max_supersegments=longest, precision=precision)
        return request.replace(options=options, window_size=self.window_size(request.window_size))


#: What is chosen from. No rung has fewer or shorter lists than the one before it.
LADDER = (
    Setting(1 / 4, 10),
    Setting(1 / 3, 10),
    Setting(1 / 2, 10),
    Setting(1 / 2, 15),
    Setting(3 / 4, 15),
    Setting(1, 15),
    Setting(1, 20),
    Setting(1, 30),
    Setting(3 / 2, 30),
    Setting(2, 30),
)
#: The rungs of the names, and the mean SSIM that was measured: docs/dial.md.
PRESETS = {"fast": (1, 0.945), "balanced": (3, 0.961), "high": (6, 0.980)}
#: What is measured. The VDI of ``ROUGH`` also says where tiles are to lie, how long lists are and
#: what a frame takes.
ROUGH, SPARSE, DENSE = Setting(1 / 5, 40), Setting(1 / 5, 10), Setting(1 / 2, 10)


@dataclass(frozen=True)
class Prediction:
    """What a rung of the ladder is predicted to give; for a preset, the SSIM alone."""

    setting: Setting
    ssim: float  # at the target's angle, of a picture of the window asked for
    nbytes: int | None = None  # on the device
    fps: float | None = None  # full frames per second


@dataclass(frozen=True)
class Choice:
    """What was chosen for a target.

    Attributes
    ----------
    rung : int
        Of the ladder.
    prediction : Prediction
        What it is predicted to give.
    missed : tuple of str
        What cannot be reached, each a sentence with the values and a remedy.
    """

    rung: int
    prediction: Prediction
    missed: tuple[str, ...] = ()

    def to_dict(self, target: QualityTarget, window_size: tuple[int, int]) -> dict[str, Any]:
        """Return it for a VDI's metadata: see docs/dial.md."""
        chosen, setting = self.prediction, self.prediction.setting
        predicted: dict[str, Any] = {"ssim": round(chosen.ssim, 4)}
        if chosen.nbytes is not None and chosen.fps is not None:
            predicted |= {"bytes": chosen.nbytes, "fps": float(f"{chosen.fps:.3g}")}
        return {
            "asked": target.to_dict(),
            "angle": target.target_angle,
            "window_size": list(window_size),
            "chosen": {
                "window_size": list(setting.window_size(window_size)),
                "max_supersegments": setting.max_supersegments,
                "precision": setting.precision,
            },
            "predicted": predicted,
            "missed": list(self.missed),
        }


def describe(metadata: dict[str, Any]) -> str | None:
    """Return in one line what was chosen for a VDI with such metadata; ``None`` if nothing was."""
    dial: Any = metadata.get("dial")
    try:
        chosen, predicted = dial["chosen"], dial["predicted"]
        width, height = chosen["window_size"]
        said = [
            f"chosen {width} x {height} lists of up to {chosen['max_supersegments']}",
            f"predicted SSIM {predicted['ssim']:.3f} at {dial['angle']:g}°",
        ]
        if "bytes" in predicted:
            said.append(f"predicted {predicted['bytes'] / 2**20:.1f} MiB")
            said.append(f"predicted {predicted['fps']:.3g} full frames/s")
        return ", ".join(said + ["target missed"] * bool(dial["missed"]))
    except (TypeError, KeyError, ValueError):  # no dial's, or of a file that somebody has written
        return None


def warn_missed(vdi: VDI) -> None:
    """Warn of each target that a VDI could not be made to reach."""
    for missed in vdi.metadata.get("dial", {}).get("missed", ()):
        warn_external(missed)


def refuse_settings(target: QualityTarget, options: GenerationOptions) -> None:
    """Refuse options that are chosen for a target where they do not have their defaults."""
    fixed = [f"{name}={value!r}" for name, value in options.given.items() if name in _CHOSEN]
    if fixed:
        asked = ", ".join(f"{name}={value!r}" for name, value in target.to_dict().items())
        raise InvalidArgumentError(
            f"{asked} chooses the settings of the VDI, among them {', '.join(fixed)}: leave out "
            "one or the other"
        )


def bytes_of(vdi: VDI) -> int:
    """Return the bytes of a VDI on the device in its 8-byte form, as they are predicted."""
    occupied = int(np.count_nonzero(vdi.counts))
    per_list = _SUPERSEGMENT_BYTES * vdi.n_supersegments + _HEADER_BYTES * occupied
    return per_list + _LIST_BYTES * (vdi.counts.size + 1)


def generate_anywhere(
    request: GenerationRequest, target: QualityTarget, client: ClientLike | None = None
) -> VDI:
    """Generate a VDI of a volume in memory, or of a chunked one in blocks, here or by workers.

    A target takes of a store the level that the view requires, and loads it. Errors are those of
    :func:`pyvista_vdi.generate`.
    """
    name = request.volume.name
    if request.volume.chunked:
        if target and client is not None:
            raise UnsupportedError(
                "quality, target_ssim, full_fps and max_bytes measure the scene on this "
                f"machine, and {name!r} is left to a client: give max_supersegments, or leave "
                "client out"
            )
        if target:  # which takes many looks at the whole
            view, size = request.camera, request.window_size
            loaded = request.volume.load_in_view(view, window_size=size)
            return generate_anywhere(request.replace(volume=loaded), target)
        return registry.generator("blocks")(request, client)  # type: ignore[no-any-return]
    if client is not None:
        raise InvalidArgumentError(
            f"client is for chunked volumes, and {name!r} is in memory: give a Volume of a "
            "Dask array (dask.array.from_array), or leave client out"
        )
    return generate_to_target(request, target) if target else generate_vdi(request)


def generate_to_target(request: GenerationRequest, target: QualityTarget) -> VDI:
    """Make a VDI by the settings that are chosen for a target.

    The window of the request is that of the pictures, and the VDI's metadata say what was chosen;
    one that turns out to have more bytes than the target allows is made again, a rung below. Errors
    are those of :func:`~pyvista_vdi.generation.generate.generate_vdi` and of :func:`choose`.
    """
    refuse_settings(target, request.options)
    choice, size = choose(request, target), request.window_size
    while True:
        asked = choice.prediction.setting.applied_to(request)
        dial = choice.to_dict(target, size)
        vdi = generate_vdi(asked.replace(metadata={**request.metadata, "dial": dial}))
        limit, taken = target.max_bytes, bytes_of(vdi)
        if limit is None or taken <= limit:
            return vdi
        if choice.rung == 0:
            said = dial["missed"] or [_TOO_LARGE.format(limit, taken)]
            vdi.metadata["dial"] = {**dial, "missed": said}
            return vdi
        lower = choice.rung - 1
        prediction = replace(choice.prediction, setting=LADDER[lower], nbytes=limit)
        choice = Choice(lower, prediction, choice.missed)


def choose(request: GenerationRequest, target: QualityTarget) -> Choice:
    """Choose how a VDI is to be made.

    Parameters
    ----------
    request : GenerationRequest
        What is asked for. Its window is that of the pictures; its ``progress`` is called with 0
        between the parts of a measurement.
    target : QualityTarget
        What is to be reached. A name alone is looked up, and nothing is measured.

    Returns
    -------
    Choice
        The first rung of the ladder that reaches the goal, and no rung above the limits. Without
        a goal, the best within the limits.

    Raises
    ------
    InvalidArgumentError
        If the window is too small for an SSIM, or another argument cannot be used.
    Cancelled
        If ``progress`` returned False.
    """
    rung, ssim = PRESETS.get(target.quality or "", (len(LADDER) - 1, 0.0))
    if target.quality is not None and target.full_fps is None and target.max_bytes is None:
        return Choice(rung, Prediction(LADDER[rung], ssim))
    size = request.window_size
    if min(size) < SSIM_WINDOW:
        raise InvalidArgumentError(
            f"a window of {size[0]} x {size[1]} pixels has no SSIM to choose settings by: it "
            f"takes {SSIM_WINDOW} along each edge; choose max_supersegments and window yourself"
        )
    measured = measure(request, target.target_angle)
    return chosen(target, predictions(measured, size), size, measured.least)


def chosen(
    target: QualityTarget,
    ladder: Sequence[Prediction],
    window_size: tuple[int, int],
    least: float = 0.0,
) -> Choice:
    """Choose from what the rungs are predicted to give.

    Limits come before the goal, and of the limits bytes before frames per second: what breaks a
    limit is never taken for a better picture. ``least`` is the loss that no rung avoids.
    """
    missed, within = [], len(ladder)
    if target.max_bytes is not None:
        free = (1 - _BYTES_MARGIN) * target.max_bytes
        within = max(1, sum((rung.nbytes or 0) <= free for rung in ladder))
        if (ladder[0].nbytes or 0) > target.max_bytes:
            missed.append(_TOO_LARGE.format(target.max_bytes, ladder[0].nbytes))
    if target.full_fps is not None:
        fast = sum((rung.fps or 0) >= target.full_fps for rung in ladder[:within])
        if fast == 0:
            missed.append(
                f"{target.full_fps:g} full frames per second cannot be reached on this device: "
                f"for {window_size[0]} x {window_size[1]} pixels {ladder[0].fps:.3g} are predicted "
                "at most; ask for fewer, or for a smaller window (a plotter keeps target_fps while "
                "the view moves by drawing fewer pixels)"
            )
        within = max(1, fast)
    if target.ssim is None:
        return Choice(within - 1, ladder[within - 1], tuple(missed))
    # A name means its rung, a number the first that reaches it
    fewest = 0.5 if target.ssim >= SSIM_WITHOUT_SQUARES else 0.0
    wanted, name = len(ladder) - 1, f"target_ssim={target.ssim:g}"
    if target.quality is not None:
        wanted, name = PRESETS[target.quality][0], f"quality={target.quality!r}"
    else:
        reach = (r.ssim >= target.ssim and r.setting.lists >= fewest for r in ladder)
        wanted = next((i for i, reached in enumerate(reach) if reached), wanted)
    rung = min(wanted, within - 1)
    held, given = within <= wanted, target.to_dict()
    limits = " and ".join(f"{n}={given[n]}" for n in ("max_bytes", "full_fps") if n in given)
    if held or (ladder[rung].ssim < target.ssim and target.quality is None):
        missed.append(
            f"{name} is not reached at {target.target_angle:g} degrees: an SSIM of "
            f"{ladder[rung].ssim:.3f} is predicted for "
            + (f"what is within {limits}; allow more, or ask for less" if held else "")
            + ("" if held else "the best settings; ask for less, or a smaller angle")
            + (_UNAVOIDABLE.format(least) if least > (1 - ladder[rung].ssim) / 2 else "")
        )
    return Choice(rung, ladder[rung], tuple(missed))


# What a scene is measured by, and what follows


@dataclass(frozen=True)
class Measurement:
    """What was measured of one scene on one device.

    ``rough``, ``sparse``, ``dense``: 1 - SSIM of the picture by a VDI of the settings
    :data:`ROUGH`, :data:`SPARSE` and :data:`DENSE`; ``least``: that of what no VDI of this view
    does better, as what its window does not cover is missing, and light that has moved with the
    camera is baked in. ``counts``: lists of the rough VDI by their length, int64.
    ``frame_seconds``: of a full frame of the rough VDI.
    """

    rough: float
    sparse: float
    dense: float
    counts: NDArray[np.int64]
    frame_seconds: float
    least: float = 0.0


def predictions(
    measured: Measurement,
    window_size: tuple[int, int],
    *,
    exponent: tuple[float, float] = EXPONENT,
    frame_cost: tuple[float, float] = FRAME_COST,
) -> tuple[Prediction, ...]:
    """Return what each rung of the ladder is predicted to give for pictures of ``window_size``.

    The loss 1 - SSIM is taken as a sum: what any VDI of this view loses; what is lost across lists,
    which depends on their density s alone and falls as a power of it; and along lists, b / N_S.
    Two longest lists at one density give b; two densities at one longest list give the power up to
    half a list per pixel, and, by a relation fitted to many scenes, beyond.
    """

    def per(setting: Setting) -> float:
        return 1 / setting.max_supersegments

    along = max(0.0, (measured.sparse - measured.rough) / (per(SPARSE) - per(ROUGH)))
    across = max(0.0, measured.dense - measured.least - along * per(DENSE))
    sparse = max(across, measured.sparse - measured.least - along * per(SPARSE))
    power = math.log(sparse / across) / math.log(DENSE.lists / SPARSE.lists) if across else 1.0
    beyond = float(np.clip(exponent[0] + exponent[1] * power, *_EXPONENTS))
    out = []
    for setting in LADDER:
        ratio = setting.lists / DENSE.lists
        loss = across * ratio ** -(power if ratio < 1 else beyond)
        loss += along * per(setting) + measured.least
        cost = (setting.lists / ROUGH.lists) ** frame_cost[0]
        cost *= (setting.max_supersegments / ROUGH.max_supersegments) ** frame_cost[1]
        # Lists that are longer are cut, and there are as many of each length as in the sample
        pixels = math.prod(setting.window_size(window_size))
        counts = measured.counts
        lengths = np.minimum(np.arange(len(counts)), setting.max_supersegments)
        taken = _SUPERSEGMENT_BYTES * float(counts @ lengths)
        taken += _HEADER_BYTES * float(counts[1:].sum())
        nbytes = round(taken * pixels / counts.sum()) + _LIST_BYTES * (pixels + 1)
        fps = 1.0 / (measured.frame_seconds * cost)
        out.append(Prediction(setting, 1.0 - min(1.0, loss), nbytes, fps))
    return tuple(out)


def measure(request: GenerationRequest, angle: float) -> Measurement:
    """Measure losses, lengths of lists and the time of a frame, in a view turned by an angle."""
    runtime, size, volume = get_runtime(request.device), request.window_size, request.volume
    quiet = request.replace(device=runtime, progress=None, metadata={})
    look, sampling = request.transfer_function, request.options
    counted: dict[str, Any] = {"tiles": TILES, "tile_size": TILE_SIZE, "device": runtime}
    estimator = ViewErrorEstimator(volume, look, sampling, **counted)
    view = FrameRequest(turned(request.camera, volume.bounds, angle), size, device=runtime)

    def made(setting: Setting) -> VDI:
        if request.progress is not None and request.progress(0.0) is False:
            raise Cancelled("choosing the settings of a VDI was cancelled")
        return generate_vdi(setting.applied_to(quiet))

    rough = made(ROUGH)
    counts = np.bincount(rough.counts.reshape(-1), minlength=2)
    seconds = []
    for _ in range(_FRAMES):
        start = time.perf_counter()
        render_vdi(rough, view)
        seconds.append(max(time.perf_counter() - start, 1e-9))
    tiles = estimator.sample(rough, view)
    if tiles is None:
        return Measurement(0.0, 0.0, 0.0, counts, min(seconds))
    truth = estimator.tiles(tiles, view)
    vdis = (rough, made(SPARSE), made(DENSE))
    pictures = [estimator.tiles(tiles, view, vdi) for vdi in vdis]
    # What no VDI does better: the volume where the view covers it, lit as the view has it
    sides = viewport_planes(request.camera, size)
    world = request.camera.model_transform
    corners = bounds_corners(volume.bounds) @ world[:3, :3].T + world[:3, 3]
    covered = all(((corners - side[:3]) @ side[3:]).min() >= 0 for side in sides)
    if not covered or look.shading is not None:
        shown = view.replace(options=RenderOptions(clipping_planes=None if covered else sides))
        pictures.append(estimator.tiles(tiles, shown, lit_from=request.camera))
    losses = [1.0 - tiles.infer(tiles_ssim(each, truth))[0] for each in pictures]
    at_rough, sparse, dense, *least = (min(1.0, max(0.0, loss)) for loss in losses)
    return Measurement(at_rough, sparse, dense, counts, min(seconds), *least)


def viewport_planes(camera: Camera, window_size: tuple[int, int]) -> NDArray[np.float64]:
    """Return the four sides of what a view covers, as clipping planes that keep it.

    float64 (4, 6): origin and inward normal of each, world coordinates.
    """
    # 1 - u, 1 + u, 1 - v and 1 + v, times the homogeneous denominator, of world points
    matrix = camera.viewport_matrix(window_size) @ camera.view_matrix
    planes = np.stack([matrix[3] + sign * matrix[row] for row in (0, 1) for sign in (-1, 1)])
    planes /= np.linalg.norm(planes[:, :3], axis=1)[:, np.newaxis]
    origins = -planes[:, 3:] * planes[:, :3]
    return np.concatenate([origins, planes[:, :3]], axis=1)


def turned(camera: Camera, bounds: Sequence[float], degrees: float) -> Camera:
    """Return a view turned about ``view_up`` through the centre of bounds in the model frame.

    The view of :meth:`Camera.azimuth` where the camera looks at that centre.
    """
    centre = world_centre(camera, bounds)
    axis = np.asarray(camera.view_up) / np.linalg.norm(camera.view_up)
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))

    def around(point: Sequence[float]) -> NDArray[np.float64]:  # Rodrigues' formula
        v = np.asarray(point) - centre
        along = axis * (axis @ v)
        return np.asarray(centre + along + (v - along) * cosine + np.cross(axis, v) * sine)

    return camera.replace(position=around(camera.position), focal_point=around(camera.focal_point))
