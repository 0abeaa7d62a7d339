"""What a server serves: a volume or time steps of one, of which it makes VDIs for views.

Everything here may be called from several threads; none of it knows clients or sockets. What a
client says is checked before anything is done about it. docs/web.md, "Served", has the protocol.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import chain
from typing import Any

import numpy as np

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import InvalidArgumentError, VDIError
from pyvista_vdi.extensions.web.shown import bare_file, camera_of, viewer_camera
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.inputs import as_volume
from pyvista_vdi.model.options import GenerationOptions, GenerationRequest
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.model.view import SLACK, View, bounds_corners, projected
from pyvista_vdi.volume.rays import checked_sample_distance

#: Longest edge of a client's picture, pixels.
MAX_PICTURE_EDGE = 8192
#: Numbers are no larger than this, and lenses no smaller than its inverse: forms of rays are
#: products of a few of them.
_LARGEST = 1e12


class BadMessageError(ValueError):
    """A message that is none of the protocol's."""


@dataclass(frozen=True)
class Wish:
    """What a client wants to see: the last that it has said of everything."""

    view: View | None = None  # its camera, and the size of its picture; ``None`` before it has said
    step: int = 0  # of the time steps


class Source:
    """A volume, or time steps of one, and how VDIs of it are made.

    ``offer`` is what clients are told: the entries of hello.
    """

    def __init__(
        self,
        volumes: Sequence[Any],
        looks: Classification,
        options: GenerationOptions,
        *,
        lists: int,
        device: Any = None,
    ) -> None:
        if len(volumes) == 0:
            raise InvalidArgumentError("there is no volume to serve: give at least one time step")

        # Those that are kept on host and device
        self._volume = lru_cache(2)(
            lambda step: as_volume(volumes[step], looks.scalars, looks.preference)
        )
        self._transfer_function = lru_cache(4)(
            lambda step: looks.transfer_function_of(self._volume(step))
        )
        self._runtime = get_runtime(device)
        self._options, self._lists = options, lists
        # What is wrong with the look or the step is refused now, not to a client
        first = self._volume(0)
        self._transfer_function(0)
        checked_sample_distance(first, options.sample_distance)
        self.offer: dict[str, Any] = {
            "bounds": list(first.bounds),
            "camera": viewer_camera(filling_camera(first.bounds, (4, 3))),
            "steps": len(volumes),
        }

    def make(self, wish: Wish, cancelled: Callable[[], bool]) -> tuple[tuple[int, int], bytes]:
        """Make the VDI of a client's view; return its size and its file.

        That is empty where nothing of the volume is in view.
        """
        assert wish.view is not None
        camera, size = wish.view.camera, wish.view.size
        # Before the device is held: these wait for each other
        volume, look = self._volume(wish.step), self._transfer_function(wish.step)
        # Cut the window down to what can be seen of the volume, or keep all of it where a corner is
        # behind the eye or close to it
        corners, window = bounds_corners(volume.bounds), np.asarray(size)
        pixels = projected(camera, size, corners)
        if pixels is None:
            depths = corners @ camera.model_to_view[2, :3] + camera.model_to_view[2, 3]
            pixels = np.array([(0, 0), size if depths.max() > 0 else (0, 0)])
        low, high = np.clip([pixels.min(axis=0), pixels.max(axis=0)], 0, window)
        # Take whole lists of it: pixels, or larger ones where these are too many
        share = min(1.0, math.sqrt(self._lists / max(1.0, np.prod(high - low))))
        grid = np.maximum(1, (window * share).astype(int))
        low = np.floor(low / window * grid + SLACK).astype(int)
        high = np.ceil(high / window * grid - SLACK).astype(int)
        lists = (high - low).tolist()
        if min(lists) <= 0:
            return (0, 0), b""
        view = camera.tile(grid, (low[0], grid[1] - high[1]), lists)
        with self._runtime.background(cancelled):
            request = GenerationRequest(volume, look, view, lists, self._options, self._runtime)
            vdi = generate_vdi(request)
        return vdi.window_size, bare_file(vdi)


def wish_after(text: str, wish: Wish, offer: Mapping[str, Any]) -> Wish:
    """Return what a client wants after a message; ``offer``: what hello lists."""
    try:
        match json.loads(text):
            case {"type": "view", "camera": state, "size": [_, _] as size, **rest} if not rest:
                camera = camera_of(state)
                lens = camera.parallel_scale if camera.parallel_projection else camera.view_angle
                places = (camera.position, camera.focal_point, camera.view_up, camera.window_center)
                _numbers("a camera", [*chain(*places), lens, 1 / lens])
                width, height = _numbers("size", size, 1, MAX_PICTURE_EDGE, whole=True)
                return replace(wish, view=View(camera, (width, height)))
            case {"type": "time", "step": step, **rest} if not rest:
                (step,) = _numbers("step", [step], 0, offer["steps"] - 1, whole=True)
                return replace(wish, step=step)
        raise BadMessageError(f"a view or a time with its entries is one; got {text:.40}")
    # No JSON, not the entries of its type, or no camera
    except (KeyError, TypeError, ValueError, RecursionError, VDIError) as error:
        raise BadMessageError(f"the message is none of the protocol's: {error}") from None


def _numbers(
    name: str, values: Any, low: float = -_LARGEST, high: float = _LARGEST, *, whole: bool = False
) -> tuple[Any, ...]:
    kinds = (int,) if whole else (int, float)  # neither booleans nor NaN
    if not all(type(value) in kinds and low <= value <= high for value in values):
        raise BadMessageError(f"{name} has numbers from {low:g} to {high:g}")
    return tuple(values) if whole else tuple(map(float, values))
