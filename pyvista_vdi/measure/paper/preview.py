"""Table 2: previews at target rates, in the two ways there are."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable
from typing import Any

from pyvista_vdi.measure.clock import Times, take_turns
from pyvista_vdi.measure.paper.published import paper_targets
from pyvista_vdi.measure.session import Image, VDIRenderer, accuracy, enlarged
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.quality.frame_rate import FrameRateController

#: Frames in which the controller may find its choice, and those that are measured afterwards.
_SETTLING_FRAMES = 12
_MEASURED_FRAMES = 5

#: Samples of a ray that count as full quality where samples along rays are given up.
_MOST_SAMPLES = 64

#: Draws a frame with so many samples in all.
Way = Callable[[int], Image]


def measure_preview(
    draw: VDIRenderer,
    camera: Camera,
    size: tuple[int, int],
    full: Times,
    reference: Image,
) -> list[dict[str, Any]]:
    """Keep each target rate of the paper's Table 2 and look at the picture; a row per way and rate.

    The rates are multiples of the full frame's, as the paper's are of its 24 frames per second, so
    that they ask the same of every device. ``full`` holds the times of the full frame with
    skipping, ``reference`` the volume's own picture.
    """
    whole = draw.image(camera)
    full_seconds = statistics.median(full["clock"])
    width, height = size

    def fewer_pixels(pixels: int) -> Image:
        edge = math.sqrt(pixels / (width * height))
        return draw.image(camera, (max(1, round(width * edge)), max(1, round(height * edge))))

    def fewer_samples(samples: int) -> Image:
        return draw.image(camera, preview_samples=samples)

    ways: dict[str, tuple[Way, int]] = {
        "fewer pixels": (fewer_pixels, width * height),
        "samples per ray": (fewer_samples, _MOST_SAMPLES),
    }
    rows = []
    for speed_up, ssim in paper_targets():
        for name, (way, most) in ways.items():
            samples, taken, image = _kept(way, most, speed_up / full_seconds)
            shown = enlarged(image, size)
            rows.append(
                {
                    "way": name,
                    "target_speed_up": speed_up,
                    "samples": samples,
                    "share": samples / most,
                    "seconds": {"clock": taken, "device": []},
                    "to_full": accuracy(shown, whole),
                    "to_volume": accuracy(shown, reference),
                    "paper_ssim": ssim,
                }
            )
    return rows


def _kept(way: Way, most: int, target_fps: float) -> tuple[int, list[float], Image]:
    """Let the controller find its choice; return it, the frames' times and the last picture."""
    way(most)  # not counted: its kernel may have to be compiled
    controller = FrameRateController(target_fps, floor=1 / most)
    image: list[Image] = []

    def frames(samples: int, repeats: int) -> list[float]:
        def frame() -> None:
            image[:] = [way(samples)]

        return take_turns({"way": frame}, repeats, warm_up=False)["way"]["clock"]

    for _ in range(_SETTLING_FRAMES):
        samples = controller.choose(most)
        (seconds,) = frames(samples, 1)
        controller.record(samples, seconds, seconds)
    samples = controller.choose(most)
    return samples, frames(samples, _MEASURED_FRAMES), image[0]
