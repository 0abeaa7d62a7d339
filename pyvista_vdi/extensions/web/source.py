"""What a server serves: a volume or time steps of one, of which it makes VDIs for views.

Everything here may be called from several threads; none of it knows clients or sockets.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from importlib.util import find_spec
from typing import Any

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.extensions.web.messages import Look, Offer, Wish
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.coverage import bounds_corners, view_in_sight
from pyvista_vdi.model.inputs import as_volume
from pyvista_vdi.model.options import GenerationOptions, GenerationRequest
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.volume.rays import checked_sample_distance

#: Volumes, and looks of them, that are kept on host and device.
_VOLUMES = 2
_LOOKS = 4

#: The colour maps and opacity mappings that clients may choose.
_NAMED = {
    "cmap": (
        *("viridis", "plasma", "inferno", "magma", "cividis", "turbo", "gray", "bone", "hot"),
        *("copper", "coolwarm", "twilight", "jet"),
    ),
    "opacity": (
        *("linear", "linear_r", "geom", "geom_r", "sigmoid", "sigmoid_3", "sigmoid_5"),
        *("sigmoid_7", "sigmoid_10", "sigmoid_15", "sigmoid_20", "foreground"),
    ),
}


class Source:
    """A volume, or time steps of one, and how VDIs of it are made."""

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

        def classify(step: int, look: Look) -> TransferFunction:
            changes = {name: value for name, value in vars(look).items() if value is not None}
            return looks.changed(changes).transfer_function_of(self.volume(step))

        self.volume = lru_cache(_VOLUMES)(load)
        self.transfer_function = lru_cache(_LOOKS)(classify)
        self.runtime = get_runtime(device)
        self._options, self._lists = options, lists
        first = self.volume(0)
        self.bounds = first.bounds
        # What is wrong with the look or the step is refused now, not to a client
        self.range = self.transfer_function(0, Look()).scalar_range
        checked_sample_distance(first, options.sample_distance)
        named = {name: getattr(looks, name) for name in _NAMED}
        self.started_with = {n: v for n, v in named.items() if isinstance(v, str)}
        free = find_spec("pyvista") is not None and not first.rgba and not looks.in_place
        choices = (
            tuple(dict.fromkeys((*names, *filter(None, [self.started_with.get(name)]))))
            for name, names in _NAMED.items()
        )
        self.offer = Offer(len(volumes), *(choices if free else ()))

    def make(self, wish: Wish, cancelled: Callable[[], bool]) -> VDI | None:
        """Make the VDI of a client's view; ``None`` where nothing of the volume is in view."""
        assert wish.view is not None
        camera, size = wish.view.camera, wish.view.size
        corners = bounds_corners(self.volume(wish.step).bounds)
        seen = view_in_sight(camera, size, corners)
        if seen is not None and math.prod(seen[1]) > self._lists:
            share = math.sqrt(self._lists / math.prod(seen[1]))
            fewer = tuple(max(1, int(edge * share)) for edge in size)
            seen = view_in_sight(camera, fewer, corners)
        if seen is None:
            return None
        # Before the device is held: these wait for each other
        volume = self.volume(wish.step)
        look = self.transfer_function(wish.step, wish.look)
        with self.runtime.background(cancelled):
            request = GenerationRequest(volume, look, *seen, self._options, self.runtime)
            return generate_vdi(request)
