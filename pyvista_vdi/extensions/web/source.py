"""What a server serves: a volume or time steps of one, of which it makes VDIs for views.

Everything here may be called from several threads; none of it knows clients or sockets.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.extensions.web.camera import viewer_camera
from pyvista_vdi.extensions.web.messages import Wish
from pyvista_vdi.extensions.web.shown import bare_file
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.coverage import SLACK, bounds_corners, projected
from pyvista_vdi.model.inputs import as_volume
from pyvista_vdi.model.options import GenerationOptions, GenerationRequest
from pyvista_vdi.model.standard_cases import filling_camera
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.volume.rays import checked_sample_distance

#: The colour maps and opacity mappings that clients may choose.
_CMAPS = (
    *("viridis", "plasma", "inferno", "magma", "cividis", "turbo", "gray", "bone", "hot"),
    *("copper", "coolwarm", "twilight", "jet"),
)
_OPACITIES = (
    *("linear", "linear_r", "geom", "geom_r", "sigmoid", "sigmoid_3", "sigmoid_5"),
    *("sigmoid_7", "sigmoid_10", "sigmoid_15", "sigmoid_20", "foreground"),
)


class Source:
    """A volume, or time steps of one, and how VDIs of it are made.

    ``offer`` is what clients are told, and may choose from: the entries of hello.
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

        def load(step: int) -> Volume:
            return as_volume(volumes[step], looks.scalars, looks.preference)

        def classify(step: int, look: tuple[tuple[str, Any], ...]) -> TransferFunction:
            return replace(looks, **dict(look)).transfer_function_of(self._volume(step))

        # Those that are kept on host and device
        self._volume = lru_cache(2)(load)
        self._transfer_function = lru_cache(4)(classify)
        self._runtime = get_runtime(device)
        self._options, self._lists = options, lists
        # What is wrong with the look or the step is refused now, not to a client
        first, table = self._volume(0), self._transfer_function(0, ())
        begun: dict[str, Any] = {"cmap": looks.cmap, "opacity": looks.opacity}
        checked_sample_distance(first, options.sample_distance)
        free = find_spec("pyvista") is not None and not first.rgba and not looks.in_place
        self.offer: dict[str, Any] = {
            "bounds": list(first.bounds),
            "camera": viewer_camera(filling_camera(first.bounds, (4, 3))),
            "steps": len(volumes),
            "cmaps": list(_CMAPS) if free else [],
            "opacities": list(_OPACITIES) if free else [],
            "look": {name: look for name, look in begun.items() if isinstance(look, str)},
            "range": list(table.scalar_range),
        }

    def make(self, wish: Wish, cancelled: Callable[[], bool]) -> tuple[tuple[int, int], bytes]:
        """Make the VDI of a client's view; return its size and its file.

        That is empty where nothing of the volume is in view.
        """
        assert wish.view is not None
        camera, size = wish.view.camera, wish.view.size
        # Before the device is held: these wait for each other
        volume = self._volume(wish.step)
        look = self._transfer_function(wish.step, wish.look)
        corners = bounds_corners(volume.bounds)
        seen = _view_in_sight(camera, size, corners)
        if seen is not None and math.prod(seen[1]) > self._lists:
            share = math.sqrt(self._lists / math.prod(seen[1]))
            fewer = tuple(max(1, int(edge * share)) for edge in size)
            seen = _view_in_sight(camera, fewer, corners)
        if seen is None:
            return (0, 0), b""
        with self._runtime.background(cancelled):
            request = GenerationRequest(volume, look, *seen, self._options, self._runtime)
            vdi = generate_vdi(request)
        return vdi.window_size, bare_file(vdi)


def _view_in_sight(
    camera: Camera, size: Sequence[int], corners: NDArray[np.float64]
) -> tuple[Camera, tuple[int, int]] | None:
    """Cut a view's window down to the whole pixels in which a volume's corners can be seen.

    All of the window where a corner is behind the eye or close to it. ``None`` if nothing of the
    volume is in the window.
    """
    pixels = projected(camera, size, corners)
    low, high = np.zeros(2), np.asarray(size, dtype=np.float64)
    if pixels is not None:
        low = np.maximum(low, np.floor(pixels.min(axis=0) + SLACK))
        high = np.minimum(high, np.ceil(pixels.max(axis=0) - SLACK))
    elif ((corners @ camera.model_to_view[2, :3] + camera.model_to_view[2, 3]) <= 0).all():
        return None
    width, height = (int(n) for n in high - low)
    if width <= 0 or height <= 0:
        return None
    corner = (int(low[0]), size[1] - int(high[1]))
    return camera.tile(size, corner, (width, height)), (width, height)
