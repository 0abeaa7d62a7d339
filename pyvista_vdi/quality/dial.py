"""Chooses the settings of a VDI for a quality target, from a short measurement.

What may be chosen is a ladder of settings (:data:`LADDER`). Three small measurements tell what each
rung gives: a few tiles of one new view are rendered by the volume and by VDIs with few or short
lists, and the rest is inferred. docs/dial.md says how, and how well that predicts.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.errors import InvalidArgumentError, warn_external
from pyvista_vdi.model.options import GenerationOptions, QualityTarget
from pyvista_vdi.model.packing import Precision
from pyvista_vdi.model.vdi import VDI

#: Edges along lists, see :func:`~pyvista_vdi.model.metrics.list_edges`, that a picture from V_O may
#: have at most, and the goals for which that is held: below, squares are the price of speed.
MAX_LIST_EDGES = 1.25
SSIM_WITHOUT_SQUARES = 0.96

#: How fast the loss across lists falls beyond half a list per pixel: its exponent is the first
#: number plus the second times the exponent between a fifth and a half. Fitted to the cases of
#: docs/decisions/dial.md.
EXPONENT = (1.15, 0.05)
#: Range of that exponent over the fitted cases, with some room.
_EXPONENTS = (0.6, 1.8)
#: A frame's time over that of the rough VDI's, as powers of the density and the longest list over
#: its own. Fitted on a CPU, at 09bbf10.
FRAME_COST = (0.44, 0.27)

_UNAVOIDABLE = (
    "; {:.3f} of the loss is what the generating view's window does not cover, or light that moves "
    "with the camera: another generating view helps, other settings do not"
)

#: Options that are chosen, or left no room for.
_CHOSEN = ("max_supersegments", "tolerance", "precision")

#: Share of a limit in bytes that is left free: lists are counted on a sample of the rays.
_BYTES_MARGIN = 0.05
#: Bytes of a list and of a supersegment on a device, in the 8-byte form: a list that is not empty
#: has two supersegments' room for its header.
_LIST_BYTES, _SUPERSEGMENT_BYTES, _HEADER_BYTES = 4, 8, 16


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

    def applied_to(self, options: GenerationOptions) -> GenerationOptions:
        """Return options with what this rung says."""
        return replace(options, max_supersegments=self.max_supersegments, precision=self.precision)


#: What is measured. The VDI of ``ROUGH`` also says where tiles are to lie, how long lists are and
#: what a frame takes.
ROUGH = Setting(1 / 5, 40)
SPARSE = Setting(1 / 5, 10)
DENSE = Setting(1 / 2, 10)

#: What a dial chooses from. No rung has fewer or shorter lists than the one before it.
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


def refuse_settings(target: QualityTarget, options: GenerationOptions) -> None:
    """Refuse options that are chosen for a target where they do not have their defaults."""
    fixed = [f"{name}={value!r}" for name, value in options.given.items() if name in _CHOSEN]
    if fixed:
        asked = ", ".join(f"{name}={value!r}" for name, value in target.to_dict().items())
        raise InvalidArgumentError(
            f"{asked} chooses the settings of the VDI, among them {', '.join(fixed)}: leave out "
            "one or the other"
        )


@dataclass(frozen=True)
class Prediction:
    """What a rung of the ladder is predicted to give.

    Attributes
    ----------
    setting : Setting
        The rung.
    window_size : (int, int)
        Lists along each edge of the VDI's window.
    ssim : float
        SSIM, at the target's angle, of a picture of the window asked for against volume rendering.
    nbytes : int
        Bytes of the VDI on the device.
    fps : float
        Full frames of that window per second.
    list_edges : float
        Edges along lists of the picture from V_O; 0 with a list per pixel or more.
    """

    setting: Setting
    window_size: tuple[int, int]
    ssim: float
    nbytes: int
    fps: float
    list_edges: float = 0.0


@dataclass(frozen=True)
class Choice:
    """What was chosen for a target.

    Attributes
    ----------
    target : QualityTarget
        What was asked.
    prediction : Prediction
        The rung that was chosen, and what it is predicted to give.
    missed : tuple of str
        What cannot be reached, each a sentence with the values and a remedy.
    window_size : (int, int)
        The window asked for.
    """

    target: QualityTarget
    prediction: Prediction
    missed: tuple[str, ...]
    window_size: tuple[int, int]

    def to_dict(self) -> dict[str, Any]:
        """Return it for a VDI's metadata: see docs/dial.md."""
        chosen = self.prediction
        return {
            "asked": self.target.to_dict(),
            "angle": self.target.target_angle,
            "window_size": list(self.window_size),
            "chosen": {
                "window_size": list(chosen.window_size),
                "max_supersegments": chosen.setting.max_supersegments,
                "precision": chosen.setting.precision,
            },
            "predicted": {
                "ssim": round(chosen.ssim, 4),
                "bytes": chosen.nbytes,
                "fps": float(f"{chosen.fps:.3g}"),
                "list_edges": float(f"{chosen.list_edges:.3g}"),
            },
            "missed": list(self.missed),
        }


def describe(metadata: dict[str, Any]) -> str | None:
    """Return in one line what was chosen for a VDI with such metadata; ``None`` if nothing was."""
    dial: Any = metadata.get("dial")
    try:
        chosen, predicted = dial["chosen"], dial["predicted"]
        width, height = chosen["window_size"]
        return (
            f"chosen {width} x {height} lists of up to {chosen['max_supersegments']}, "
            f"predicted SSIM {predicted['ssim']:.3f} at {dial['angle']:g}°, "
            f"predicted {predicted['bytes'] / 2**20:.1f} MiB, "
            f"predicted {predicted['fps']:.3g} full frames/s"
            + (", target missed" if dial["missed"] else "")
        )
    except (TypeError, KeyError, ValueError):  # no dial's, or of a file that somebody has written
        return None


def warn_missed(vdi: VDI) -> None:
    """Warn of each target that a VDI could not be made to reach."""
    for missed in vdi.metadata.get("dial", {}).get("missed", ()):
        warn_external(missed)


def bytes_of(vdi: VDI) -> int:
    """Return the bytes of a VDI on the device in its 8-byte form, as they are predicted."""
    occupied = int(np.count_nonzero(vdi.counts))
    per_list = _SUPERSEGMENT_BYTES * vdi.n_supersegments + _HEADER_BYTES * occupied
    return per_list + _LIST_BYTES * (vdi.counts.size + 1)


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
    missed = []
    within = len(ladder)
    if target.max_bytes is not None:
        free = (1 - _BYTES_MARGIN) * target.max_bytes
        within = max(1, sum(rung.nbytes <= free for rung in ladder))
        if ladder[0].nbytes > target.max_bytes:
            missed.append(
                f"max_bytes={target.max_bytes} cannot be kept: the smallest VDI that a dial makes "
                f"is predicted to have {ladder[0].nbytes} bytes; allow more, or ask for a smaller "
                "window"
            )
    if target.full_fps is not None:
        fast = sum(rung.fps >= target.full_fps for rung in ladder[:within])
        if fast == 0:
            missed.append(
                f"{target.full_fps:g} full frames per second cannot be reached on this device: "
                f"for {window_size[0]} x {window_size[1]} pixels {ladder[0].fps:.3g} are predicted "
                "at most; ask for fewer, or for a smaller window (a plotter keeps target_fps while "
                "the view moves by drawing fewer pixels)"
            )
        within = max(1, fast)
    if target.ssim is None:
        return Choice(target, ladder[within - 1], tuple(missed), window_size)
    most_edges = MAX_LIST_EDGES if target.ssim >= SSIM_WITHOUT_SQUARES else math.inf
    reaching = (rung.ssim >= target.ssim and rung.list_edges <= most_edges for rung in ladder)
    wanted = next((i for i, reached in enumerate(reaching) if reached), len(ladder) - 1)
    rung = ladder[min(wanted, within - 1)]
    name = f"quality={target.quality!r}" if target.quality else "target_ssim"
    limits = [f"{n}={v}" for n, v in target.to_dict().items() if n in ("max_bytes", "full_fps")]
    if rung.ssim < target.ssim:
        held = within <= wanted
        missed.append(
            f"{name} asks for an SSIM of {target.ssim:g} at {target.target_angle:g} degrees; "
            f"{rung.ssim:.3f} is predicted for "
            + (f"what is within {' and '.join(limits)}" if held else "the best settings")
            + ("; allow more, or ask for less" if held else "; ask for less, or a smaller angle")
            + (_UNAVOIDABLE.format(least) if least > (1 - rung.ssim) / 2 else "")
        )
    elif rung.list_edges > most_edges:
        lists = " x ".join(str(n) for n in rung.window_size)
        missed.append(
            f"{name} asks for pictures without squares: {lists} lists, which are what is within "
            f"{' and '.join(limits)}, are predicted to show edges of {rung.list_edges:.2g} times "
            f"the steps between them, above {most_edges:g}; allow more, or ask for a smaller "
            "window"
        )
    return Choice(target, rung, tuple(missed), window_size)


@dataclass(frozen=True)
class Measurement:
    """What was measured of one scene on one device.

    ``rough``, ``sparse``, ``dense``: 1 - SSIM of the picture by a VDI of the settings
    :data:`ROUGH`, :data:`SPARSE` and :data:`DENSE`; ``least``: that of what no VDI of this V_O does
    better, as what its window does not cover is missing, and light that has moved with the camera
    is baked in. ``counts``: lists of the rough VDI by their length, int64. ``frame_seconds``: of a
    full frame of the rough VDI. ``list_edges``: of the picture from V_O, by lists per pixel below
    1.
    """

    rough: float
    sparse: float
    dense: float
    counts: NDArray[np.int64]
    frame_seconds: float
    least: float = 0.0
    list_edges: Mapping[float, float] = field(default_factory=dict)


def predictions(
    measured: Measurement,
    window_size: tuple[int, int],
    *,
    exponent: tuple[float, float] = EXPONENT,
    frame_cost: tuple[float, float] = FRAME_COST,
) -> tuple[Prediction, ...]:
    """Return what each rung of the ladder is predicted to give for pictures of ``window_size``.

    Notes
    -----
    The loss 1 - SSIM is taken as a sum: what any VDI of this V_O loses; what is lost across lists,
    which depends on their density s alone and falls as a power of it; and along lists, b / N_S.
    Two longest lists at one density give b; two densities at one longest list give the power up to
    half a list per pixel, and, by a relation fitted to many scenes, beyond.
    """
    along = max(0.0, (measured.sparse - measured.rough) / (_per(SPARSE) - _per(ROUGH)))
    across = max(0.0, measured.dense - measured.least - along * _per(DENSE))
    sparse = max(across, measured.sparse - measured.least - along * _per(SPARSE))
    power = _exponent(sparse, across)
    beyond = float(np.clip(exponent[0] + exponent[1] * power, *_EXPONENTS))
    out = []
    for setting in LADDER:
        ratio = setting.lists / DENSE.lists
        loss = across * ratio ** -(power if ratio < 1 else beyond)
        loss += along * _per(setting) + measured.least
        cost = (setting.lists / ROUGH.lists) ** frame_cost[0]
        cost *= (setting.max_supersegments / ROUGH.max_supersegments) ** frame_cost[1]
        out.append(
            Prediction(
                setting,
                setting.window_size(window_size),
                1.0 - min(1.0, loss),
                _bytes(measured.counts, setting, window_size),
                1.0 / (measured.frame_seconds * cost),
                measured.list_edges.get(setting.lists, 0.0),
            )
        )
    return tuple(out)


def _per(setting: Setting) -> float:
    return 1 / setting.max_supersegments


def _exponent(sparse: float, dense: float) -> float:
    """Return the power of the density that a loss falls by, from a fifth to half a list."""
    return math.log(sparse / dense) / math.log(DENSE.lists / SPARSE.lists) if dense > 0 else 1.0


def _bytes(counts: NDArray[np.int64], setting: Setting, window_size: tuple[int, int]) -> int:
    """Predict the bytes on the device of the 8-byte form."""
    width, height = setting.window_size(window_size)
    share = width * height / counts.sum()
    lengths = np.minimum(np.arange(len(counts)), setting.max_supersegments)
    supersegments, occupied = float(counts @ lengths), float(counts[1:].sum())
    per_list = _SUPERSEGMENT_BYTES * supersegments + _HEADER_BYTES * occupied
    return round(share * per_list) + _LIST_BYTES * (width * height + 1)
