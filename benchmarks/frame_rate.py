"""Whether a frame rate is kept along a camera path, by giving up pixels, on a real device.

Writes ``frame_rate_WxH.json`` (the path, every frame, the shares) and ``.png``. See README.md in
this folder for what is judged.
"""

from __future__ import annotations

import argparse
import math
import statistics
import sys
import time
from collections.abc import Iterable
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from common import (  # beside this file
    add_looks,
    add_size,
    looks_of,
    new_parser,
    results_file,
    save,
    subject_of,
)
from tqdm import tqdm

from pyvista_vdi import examples
from pyvista_vdi.api import render
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.measure.clock import median, take_turns
from pyvista_vdi.measure.report import describe_system, new_figure, save_figure
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.frame_rate import FLOOR, RECENT_FRAMES, FrameRateController

#: Frames between those whose time at the floor and in full quality is measured beforehand.
STRIDE = 6

#: Frames that are not judged: the controller knows nothing yet.
FIRST = 10

#: Widest turns along the path, degrees from V_O.
AZIMUTH, ELEVATION = 60.0, 25.0


def main() -> int:
    """Measure, write and plot."""
    options = parsed()
    volume, classified, view = subject_of(options.volume, options)
    vdi = generate_vdi(volume, view, options.size, classified, device=options.device)
    path = camera_path(options.frames)
    cameras = [view.azimuth(azimuth).elevation(elevation) for azimuth, elevation in path]
    drawn = Drawing(vdi, cameras, options.size, options.device)

    limits = drawn.limits()
    full_seconds = statistics.median(limits["full"])
    target = options.target_fps or options.speedup / full_seconds
    controller = FrameRateController(target, threshold=options.threshold)
    frames = drawn.interaction(controller, options.repeats)

    results = {
        "window_size": list(options.size),
        "volume": options.volume,
        **looks_of(options),
        "system": describe_system(options.device),
        "target_fps": target,
        "full_fps": 1 / full_seconds,
        "threshold": options.threshold,
        "floor": FLOOR,
        "limits": limits,
        "judged": judged(frames, limits, target, options.threshold),
        "frames": [
            {"azimuth": azimuth, "elevation": elevation, **frame}
            for (azimuth, elevation), frame in zip(path, frames, strict=True)
        ],
    }
    target_file = results_file("frame_rate", options)
    save(results, target_file)
    write_plot(results, target_file.with_suffix(".png"))
    print(f"{target:.1f} frames per second aimed at; {1 / full_seconds:.1f} in full quality")
    for name, value in results["judged"].items():
        print(f"{name}: {value if value is None else round(value, 3)}")
    print(f"Written: {target_file}, and .png beside it")
    return 0


def parsed() -> argparse.Namespace:
    """Return the options."""
    parser = new_parser(__doc__, repeats=3, repeated="of each frame, for its median time")
    add_size(parser)
    parser.add_argument("--volume", choices=sorted(examples.VOLUMES), default="brain")
    add_looks(parser, max_supersegments=None)
    parser.add_argument("--frames", type=int, default=360)
    aim = parser.add_mutually_exclusive_group()
    aim.add_argument("--target-fps", type=float, metavar="FPS")
    aim.add_argument(
        "--speedup",
        type=float,
        default=2.5,
        help="target, as a multiple of the rate in full quality (the path's median)",
    )
    parser.add_argument("--threshold", type=float, default=0.1)
    return parser.parse_args()


def camera_path(n_frames: int) -> list[tuple[float, float]]:
    """Return azimuth and elevation from V_O at each frame, degrees: one closed turn of the hand."""
    turns = [2 * math.pi * i / n_frames for i in range(n_frames)]
    return [(AZIMUTH * math.sin(turn), ELEVATION * math.sin(2 * turn)) for turn in turns]


class Drawing:
    """A VDI drawn along a camera path with as many pixels as are asked for.

    Parameters
    ----------
    vdi : VDI
        What is drawn.
    cameras : list of Camera
        The views, in order.
    size : (int, int)
        Width and height of a frame in full quality, pixels.
    device : str, optional
        Where.
    """

    def __init__(
        self, vdi: VDI, cameras: list[Camera], size: tuple[int, int], device: str | None
    ) -> None:
        self._vdi = vdi
        self._cameras = cameras
        self._size = size
        self._device = device
        self._full = size[0] * size[1]
        for share in (1, FLOOR):  # builds the kernels, uploads the VDI
            self._draw(0, round(self._full * share))

    def limits(self) -> dict[str, Any]:
        """Measure what a frame takes at the floor and in full quality, along the path."""
        numbers = list(range(0, len(self._cameras), STRIDE))
        shares = {"floor": FLOOR, "full": 1.0}
        limits: dict[str, Any] = {"frame": numbers, "floor": [], "full": []}
        for number in tqdm(numbers, desc="limits", unit="view"):
            work = {
                name: partial(self._draw, number, round(self._full * share))
                for name, share in shares.items()
            }
            for name, taken in take_turns(work, 3, warm_up=False).items():
                limits[name].append(median(taken))
        return limits

    def interaction(self, controller: FrameRateController, repeats: int) -> list[dict[str, Any]]:
        """Draw the path as the controller wants it.

        Each frame is drawn again at once, so that the median tells what the chosen pixels take
        without the noise; the controller sees the first time only.
        """
        frames = []
        for number in tqdm(range(len(self._cameras)), desc="path", unit="frame"):
            start = time.perf_counter()
            chosen = controller.choose(self._full)
            samples, work = self._draw(number, chosen)
            seconds = time.perf_counter() - start
            controller.record(samples, work, seconds)
            again = [self._draw(number, chosen)[1] for _ in range(repeats - 1)]
            frames.append(
                {
                    "chosen": chosen,
                    "samples": samples,
                    "work": work,
                    "seconds": seconds,
                    "median_seconds": statistics.median([seconds, *again]),
                }
            )
        return frames

    def _draw(self, number: int, samples: int) -> tuple[int, float]:
        """Draw a view; return its pixels and what they took, seconds."""
        width, height = self._reduced(samples)
        start = time.perf_counter()
        render(self._vdi, self._cameras[number], (width, height), device=self._device)
        return width * height, time.perf_counter() - start

    def _reduced(self, samples: int) -> tuple[int, int]:
        """Return the window of the frame's shape that has about as many pixels as samples."""
        scale = math.sqrt(samples / self._full)
        width, height = (max(1, round(n * scale)) for n in self._size)
        return width, height


def judged(
    frames: list[dict[str, Any]], limits: dict[str, Any], target: float, threshold: float
) -> dict[str, float | None]:
    """Return the shares of attainable frames that keep the rate, and how often the choice turns.

    A frame is attainable where the target's period lies between the times at the floor and in full
    quality, which are interpolated between the views that were measured, and where no frame in
    full quality was faster than the target when drawn.
    """
    numbers = np.arange(len(frames))
    floor, full = (np.interp(numbers, limits["frame"], limits[name]) for name in ("floor", "full"))
    seconds, median, samples = (
        np.array([frame[name] for frame in frames])
        for name in ("seconds", "median_seconds", "chosen")
    )
    attainable = (floor <= 1 / target) & (1 / target <= full) & (numbers >= FIRST)
    attainable &= (samples < samples.max()) | (median > 1 / target)
    # The mean of the frames up to and with each; those before RECENT_FRAMES are not judged
    mean = np.convolve(seconds, np.full(RECENT_FRAMES, 1 / RECENT_FRAMES))[: len(frames)]

    def share(times: Any) -> float | None:
        """Share of the attainable frames within the threshold; None where there are none."""
        kept = np.abs(1 / (target * times) - 1) <= threshold
        return float(np.mean(kept[attainable])) if attainable.any() else None

    return {
        "attainable": float(np.mean(attainable[FIRST:])),
        "mean_of_five_within_threshold": share(mean),
        "repeated_frames_within_threshold": share(median),
        "single_frames_within_threshold": share(seconds),
        "changes_per_frame": float(np.mean(np.diff(samples) != 0)),
        "turns_per_frame": turns(samples) / len(frames),
    }


def turns(samples: Iterable[float]) -> int:
    """Count how often a growing choice begins to shrink, or the other way round."""
    steps = [b - a for a, b in pairwise(samples) if a != b]
    return sum((a > 0) != (b > 0) for a, b in pairwise(steps))


def write_plot(results: dict[str, Any], target: Path) -> None:
    """Plot times with the target's band above, pixels and angle below."""
    frames, limits = results["frames"], results["limits"]
    period, threshold = 1e3 / results["target_fps"], results["threshold"]
    figure = new_figure((9, 6))
    times, pixels = figure.subplots(2, 1, sharex=True)
    times.axhspan(
        period / (1 + threshold), period / (1 - threshold), color="C2", alpha=0.25, label="target"
    )
    times.plot([1e3 * frame["seconds"] for frame in frames], ".", color="0.6", label="frame")
    times.plot([1e3 * frame["median_seconds"] for frame in frames], color="C0", label="repeated")
    for name, style in (("full", "--"), ("floor", ":")):
        seconds = [1e3 * s for s in limits[name]]
        times.plot(limits["frame"], seconds, style, color="C3", label=f"with {name} pixels")
    times.set(ylabel="ms", ylim=(0, 1.1e3 * max(limits["full"])))
    times.legend(fontsize=8, ncols=5, loc="upper center")
    full = math.prod(results["window_size"])
    pixels.step(range(len(frames)), [frame["chosen"] / full for frame in frames], where="mid")
    pixels.set(ylabel="share of the pixels", xlabel="frame", ylim=(0, 1.05))
    angle = pixels.twinx()
    angle.plot([frame["azimuth"] for frame in frames], color="C1", linewidth=1)
    angle.set_ylabel("azimuth from V_O, degrees", color="C1")
    figure.tight_layout()
    save_figure(figure, target, 90)


if __name__ == "__main__":
    sys.exit(main())
