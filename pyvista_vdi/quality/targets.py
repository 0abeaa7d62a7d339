"""Resolves what is asked of a VDI to its settings: a preset by a table, a target by trials.

What may be chosen is a ladder of settings (:data:`LADDER`). A goal, and each limit, is found on it
by bisection: a VDI is made by a rung, and what it gives is measured. docs/dial.md says how well.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi import registry
from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError, warn_external
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.metrics import SSIM_WINDOW
from pyvista_vdi.model.options import GenerationOptions, GenerationRequest, QualityTarget
from pyvista_vdi.model.packing import Precision
from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.model.types import ClientLike
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.view_error import ViewErrorEstimator, world_centre
from pyvista_vdi.raycasting.raycast import render_vdi

#: Goals from which on no rung has fewer than half a list per pixel along each edge: below, a list
#: covers several pixels, whose squares people see and SSIM does not.
SSIM_WITHOUT_SQUARES = 0.96
#: Frames of a VDI that are timed; the shortest counts.
_FRAMES = 2
#: Options that are chosen, or left no room for.
_CHOSEN = ("max_supersegments", "tolerance", "precision")
#: Bytes of a list and of a supersegment on a device, in the 8-byte form: a list that is not empty
#: has two supersegments' room for its header.
_LIST_BYTES, _SUPERSEGMENT_BYTES, _HEADER_BYTES = 4, 8, 16


@dataclass(frozen=True)
class Setting:
    """One rung of the ladder."""

    lists: float  # along an edge of the VDI's window, over the pixels of the window asked for
    max_supersegments: int
    precision: Precision = "8-byte"

    def applied_to(self, request: GenerationRequest) -> GenerationRequest:
        """Return a request, whose window is that of the pictures, with what this rung says."""
        longest, precision = self.max_supersegments, self.precision
        options = replace(request.options, max_supersegments=longest, precision=precision)
        width, height = (max(1, round(self.lists * edge)) for edge in request.window_size)
        return request.replace(options=options, window_size=(width, height))


#: Degrees by which the view is turned from V_O for which the SSIM is predicted.
TARGET_ANGLE = 30.0

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
            said.append(f"{predicted['bytes'] / 2**20:.1f} MiB")
            said.append(f"{predicted['fps']:.3g} full frames/s")
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
        asked = ", ".join(f"{name}={value!r}" for name, value in target.given.items())
        raise InvalidArgumentError(
            f"{asked} chooses the settings of the VDI, among them {', '.join(fixed)}: leave out "
            "one or the other"
        )


def bytes_of(vdi: VDI) -> int:
    """Return the bytes of a VDI on the device in its 8-byte form."""
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

    The window of the request is that of the pictures, and the VDI's metadata say what was chosen.
    A name alone is looked up. A goal takes the first rung that reaches it, and no rung above the
    limits; without a goal it is the best within them. Errors are those of
    :func:`~pyvista_vdi.generation.generate.generate_vdi`, and InvalidArgumentError if the window is
    too small for an SSIM.
    """
    refuse_settings(target, request.options)
    rung, ssim = PRESETS.get(target.quality or "", (len(LADDER) - 1, 0.0))
    if target.quality is not None and target.full_fps is None and target.max_bytes is None:
        vdi = generate_vdi(LADDER[rung].applied_to(request))
        return _described(vdi, rung, target, request.window_size, {"ssim": ssim}, [])
    trials = _Trials(request)
    # A name means its rung, a number the first that reaches it
    goal = 0.0 if target.ssim is None or target.quality is not None else target.ssim
    if goal > 0:
        least = 2 if goal >= SSIM_WITHOUT_SQUARES else 0
        rung = _first(least, rung, lambda k: trials.ssim(k) >= goal)
    wanted, missed = rung, []
    # Limits come before the goal, and of the limits bytes before frames per second
    if (most := target.max_bytes) is not None:
        rung = _first(0, rung + 1, lambda k: bytes_of(trials.vdi(k)) > most) - 1
        if rung < 0:
            missed.append(
                f"max_bytes={most} cannot be kept: the smallest VDI that a target chooses has "
                f"{bytes_of(trials.vdi(0))} bytes; allow more, or ask for a smaller window"
            )
    if (rate := target.full_fps) is not None:
        rung = _first(0, max(rung, 0) + 1, lambda k: trials.fps(k) < rate) - 1
        if rung < 0:
            width, height = request.window_size
            missed.append(
                f"{rate:g} full frames per second cannot be reached on this device: for {width} x "
                f"{height} pixels it is {trials.fps(0):.3g} at most; ask for fewer, or for a "
                "smaller window (a plotter keeps target_fps while the view moves by drawing fewer "
                "pixels)"
            )
    rung = max(rung, 0)
    vdi, ssim, given = trials.vdi(rung), trials.ssim(rung), target.given
    if target.ssim is not None and (rung < wanted or ssim < goal):
        limits = " and ".join(f"{n}={given[n]}" for n in ("max_bytes", "full_fps") if n in given)
        asked = next(f"{n}={given[n]!r}" for n in ("quality", "target_ssim") if n in given)
        missed.append(
            f"{asked} is not reached at {TARGET_ANGLE:g} degrees: SSIM is {ssim:.3f} for "
            + (f"what is within {limits}; allow more" if rung < wanted else "the best settings")
            + ", ask for less"
        )
    fps = float(f"{trials.fps(rung):.3g}")
    predicted = {"ssim": round(ssim, 4), "bytes": bytes_of(vdi), "fps": fps}
    return _described(vdi, rung, target, request.window_size, predicted, missed)


def _first(low: int, high: int, holds: Callable[[int], bool]) -> int:
    """Return the first number from ``low`` on of which something holds; ``high`` if of none."""
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if holds(middle) else (middle + 1, high)
    return low


def _described(
    vdi: VDI,
    rung: int,
    target: QualityTarget,
    size: tuple[int, int],
    predicted: dict[str, Any],
    missed: list[str],
) -> VDI:
    """Return a VDI whose metadata say what was chosen: see docs/dial.md."""
    vdi.metadata["dial"] = {
        "asked": target.given,
        "angle": TARGET_ANGLE,
        "window_size": list(size),
        "chosen": {
            "window_size": list(vdi.window_size),
            "max_supersegments": LADDER[rung].max_supersegments,
            "precision": LADDER[rung].precision,
        },
        "predicted": predicted,
        "missed": missed,
    }
    return vdi


class _Trials:
    """VDIs of the rungs, each made when it is asked for, and what they give in the target view."""

    def __init__(self, request: GenerationRequest) -> None:
        size = request.window_size
        if min(size) < SSIM_WINDOW:
            raise InvalidArgumentError(
                f"a window of {size[0]} x {size[1]} pixels has no SSIM to choose settings by: it "
                f"takes {SSIM_WINDOW} along each edge; choose max_supersegments and window yourself"
            )
        self.request = request.replace(device=get_runtime(request.device))
        camera = turned(request.camera, request.volume.bounds, TARGET_ANGLE)
        self.view = FrameRequest(camera, size, device=self.request.device)
        self.vdi, self.ssim, self.fps = cache(self._vdi), cache(self._ssim), cache(self._fps)

    @cached_property
    def _estimator(self) -> ViewErrorEstimator:
        asked, device = self.request, self.request.device
        return ViewErrorEstimator(
            asked.volume, asked.transfer_function, asked.options, device=device
        )

    def _vdi(self, rung: int) -> VDI:
        return generate_vdi(LADDER[rung].applied_to(self.request))

    def _ssim(self, rung: int) -> float:
        """Estimate for the target view."""
        return self._estimator.estimate(self.vdi(rung), self.view.camera, self.view.size).ssim

    def _fps(self, rung: int) -> float:
        """Full frames per second."""
        seconds = []
        for _ in range(_FRAMES):
            start = time.perf_counter()
            render_vdi(self.vdi(rung), self.view)
            seconds.append(max(time.perf_counter() - start, 1e-9))
        return 1 / min(seconds)


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
