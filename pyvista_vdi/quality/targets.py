"""Resolves what is asked of a VDI to its settings: a preset by a table, a target by one probe.

What may be chosen is a ladder of settings (:data:`LADDER`). Of one rung a VDI is made, and what it
gives is measured; what the others would give follows by a table. docs/dial.md says how well.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi import registry
from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError, warn_external
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.metrics import SSIM_WINDOW
from pyvista_vdi.model.options import (
    FrameRequest,
    GenerationOptions,
    GenerationRequest,
    QualityTarget,
)
from pyvista_vdi.model.packing import Precision
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
#: Bytes on a device in the 8-byte form; a list that is not empty has a header.
_LIST_BYTES, _SUPERSEGMENT_BYTES, _HEADER_BYTES = 8, 8, 16


@dataclass(frozen=True)
class Setting:
    """One rung of the ladder."""

    lists: float  # along an edge of the VDI's window, over the pixels of the window asked for
    max_supersegments: int
    # 1 - SSIM, bytes and a frame's time over those of the probe: docs/decisions/dial.md
    loss: float
    size: float
    time: float
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
    Setting(1 / 4, 10, 1.99, 0.20, 0.73),
    Setting(1 / 3, 10, 1.56, 0.36, 0.77),
    Setting(1 / 2, 10, 1.03, 0.81, 0.91),
    Setting(1 / 2, 15, 1.00, 1.00, 1.00),
    Setting(3 / 4, 15, 0.67, 2.25, 1.16),
    Setting(1, 15, 0.39, 4.00, 1.31),
    Setting(1, 20, 0.36, 4.64, 1.42),
    Setting(1, 30, 0.35, 5.67, 1.57),
    Setting(3 / 2, 30, 0.22, 12.75, 1.91),
    Setting(2, 30, 0.15, 22.66, 2.27),
)
#: The rung that is made first, and by how much a rung may miss by the table and yet be tried.
PROBE, TRIED = 3, 1.1
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
    if target and fixed:
        asked = ", ".join(f"{name}={value!r}" for name, value in target.given.items())
        raise InvalidArgumentError(
            f"{asked} chooses the settings of the VDI, among them {', '.join(fixed)}: leave out "
            "one or the other"
        )


def bytes_of(vdi: VDI) -> int:
    """Return the bytes of a VDI on the device in its 8-byte form."""
    of_lists = _LIST_BYTES * vdi.counts.size + _HEADER_BYTES * np.count_nonzero(vdi.counts)
    return int(of_lists + _SUPERSEGMENT_BYTES * vdi.n_supersegments)


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
            loaded = request.volume.load(view, window_size=size)
            return generate_anywhere(request.replace(volume=loaded), target)
        return registry.method("generating by blocks")(request, client)  # type: ignore[no-any-return]
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
        found = trials.settled("loss", range(least, rung + 1), 1 - goal)
        rung = rung if found is None else found
    wanted, missed = rung, []
    # Limits come before the goal, and of the limits bytes before frames per second
    if (most := target.max_bytes) is not None:
        found = trials.settled("size", range(rung, -1, -1), most)
        rung = found or 0
        if found is None:
            missed.append(
                f"max_bytes={most} cannot be kept: the smallest VDI that a target chooses has "
                f"{trials.size(0)} bytes; allow more, or ask for a smaller window"
            )
    if (rate := target.full_fps) is not None:
        found = trials.settled("time", range(rung, -1, -1), 1 / rate)
        rung = found or 0
        if found is None:
            width, height = request.window_size
            missed.append(
                f"{rate:g} full frames per second cannot be reached on this device: for {width} x "
                f"{height} pixels it is {1 / trials.time(0):.3g} at most; ask for fewer, or for a "
                "smaller window"
            )
    vdi, ssim, given = trials.vdi(rung), 1 - trials.loss(rung), target.given
    if target.ssim is not None and (rung < wanted or ssim < goal):
        limits = " and ".join(f"{n}={given[n]}" for n in ("max_bytes", "full_fps") if n in given)
        asked = next(f"{n}={given[n]!r}" for n in ("quality", "target_ssim") if n in given)
        missed.append(
            f"{asked} is not reached at {TARGET_ANGLE:g} degrees: SSIM is {ssim:.3f} for "
            + (f"what is within {limits}; allow more" if rung < wanted else "the best settings")
            + ", ask for less"
        )
    fps = float(f"{1 / trials.time(rung):.3g}")
    predicted = {"ssim": round(ssim, 4), "bytes": trials.size(rung), "fps": fps}
    return _described(vdi, rung, target, request.window_size, predicted, missed)


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
        asked = (request.volume, request.transfer_function, request.options)
        self._estimator = ViewErrorEstimator(*asked, device=self.request.device)
        self.vdi, self.size = cache(self._vdi), cache(self._size)
        self.loss, self.time = cache(self._loss), cache(self._time)

    def _vdi(self, rung: int) -> VDI:
        return generate_vdi(LADDER[rung].applied_to(self.request))

    def _size(self, rung: int) -> int:
        return bytes_of(self.vdi(rung))

    def _loss(self, rung: int) -> float:
        """Estimate 1 - SSIM of the target view."""
        vdi = self.vdi(rung)
        return 1 - self._estimator.estimate(vdi, self.view.camera, self.view.window_size).ssim

    def _time(self, rung: int) -> float:
        """Return the seconds of a full frame."""
        seconds = []
        for _ in range(_FRAMES):
            start = time.perf_counter()
            render_vdi(self.vdi(rung), self.view)
            seconds.append(max(time.perf_counter() - start, 1e-9))
        return min(seconds)

    def settled(self, what: str, rungs: Sequence[int], most: float) -> int | None:
        """Return the first of some rungs with no more loss, size or time; ``None`` if none has.

        They are tried one after the other from where the table expects it.
        """
        measured, tabled = getattr(self, what), [getattr(each, what) for each in LADDER]
        unit = measured(PROBE) / tabled[PROBE]
        few = (i for i, k in enumerate(rungs) if unit * tabled[k] <= TRIED * most)
        return next((k for k in rungs[next(few, len(rungs) - 1) :] if measured(k) <= most), None)


def turned(camera: Camera, bounds: Sequence[float], degrees: float) -> Camera:
    """Return a view turned about ``view_up`` through the centre of bounds in the model frame.

    The view of :meth:`Camera.azimuth` where the camera looks at that centre.
    """
    centre = world_centre(camera, bounds)
    axis = np.asarray(camera.view_up) / np.linalg.norm(camera.view_up)
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))

    def around(point: ArrayLike) -> NDArray[np.float64]:  # Rodrigues' formula
        v = np.asarray(point) - centre
        along = axis * (axis @ v)
        return np.asarray(centre + along + (v - along) * cosine + np.cross(axis, v) * sine)

    return camera.replace(position=around(camera.position), focal_point=around(camera.focal_point))
