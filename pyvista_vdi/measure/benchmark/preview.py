"""Table 2: previews at target rates, in the two ways there are."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.measure.benchmark.candidates import Image, VDIRenderer, accuracy, median
from pyvista_vdi.measure.benchmark.paper import paper_targets
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
    full: dict[str, list[float]],
    reference: Image,
) -> list[dict[str, Any]]:
    """Keep each target rate of the paper's Table 2 and look at the picture.

    The rates are multiples of the full frame's, as the paper's are of its 24 frames per second,
    so that they ask the same of every device.

    Parameters
    ----------
    draw : VDIRenderer
        The VDI.
    camera : Camera
        The view.
    size : (int, int)
        Window, pixels.
    full : dict
        Times of the full frame with skipping, see :func:`.candidates.take_turns`.
    reference : numpy.ndarray
        The volume's own picture.

    Returns
    -------
    list of dict
        A row per way and target.
    """
    whole = draw.image(camera)
    full_seconds = median(full)
    if full_seconds is None:
        raise InvalidArgumentError("the full frame has no times: repeats must be 1 or more")
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
    for _ in range(_SETTLING_FRAMES):
        samples = controller.choose(most)
        seconds, _ = _timed(way, samples)
        controller.record(samples, seconds, seconds)
    samples = controller.choose(most)
    frames = [_timed(way, samples) for _ in range(_MEASURED_FRAMES)]
    return samples, [seconds for seconds, _ in frames], frames[-1][1]


def _timed(way: Way, samples: int) -> tuple[float, Image]:
    begin = time.perf_counter()
    image = way(samples)
    return time.perf_counter() - begin, image


def enlarged(image: Image, size: tuple[int, int]) -> Image:
    """Return an image in the window's size, by linear interpolation as the texture unit's."""
    from skimage.transform import resize  # loads SciPy

    width, height = size
    if image.shape[:2] == (height, width):
        return image
    # Pixel centres keep their places and edges are extended, as GL_LINEAR and CLAMP_TO_EDGE do
    whole: Image = resize(image, (height, width, 4), order=1, mode="edge", anti_aliasing=False)
    return whole
