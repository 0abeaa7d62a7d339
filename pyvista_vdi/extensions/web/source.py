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

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.extensions.web.camera import viewer_camera
from pyvista_vdi.extensions.web.messages import Wish
from pyvista_vdi.extensions.web.shown import bare_file
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.coverage import SLACK, bounds_corners, projected
from pyvista_vdi.model.inputs import as_volume
from pyvista_vdi.model.options import GenerationOptions, GenerationRequest
from pyvista_vdi.model.standard_cases import filling_camera
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

        # Those that are kept on host and device
        self._volume = lru_cache(2)(
            lambda step: as_volume(volumes[step], looks.scalars, looks.preference)
        )
        self._transfer_function = lru_cache(4)(
            lambda step, look: replace(looks, **dict(look)).transfer_function_of(self._volume(step))
        )
        self._runtime = get_runtime(device)
        self._options, self._lists = options, lists
        # What is wrong with the look or the step is refused now, not to a client
        first, table = self._volume(0), self._transfer_function(0, ())
        begun = {"cmap": looks.cmap, "opacity": looks.opacity}
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
        first = np.floor(low / window * grid + SLACK).astype(int)
        lists = np.ceil(high / window * grid - SLACK).astype(int) - first
        if (lists <= 0).any():
            return (0, 0), b""
        made = (int(lists[0]), int(lists[1]))
        corner = (int(first[0]), int(grid[1] - first[1] - lists[1]))
        view = camera.tile(grid, corner, made)
        with self._runtime.background(cancelled):
            request = GenerationRequest(volume, look, view, made, self._options, self._runtime)
            vdi = generate_vdi(request)
        return made, bare_file(vdi)
