"""Makes VDIs of one volume for a set, and judges pictures of them by the volume's."""

from __future__ import annotations

import dataclasses
import io
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.extensions.series.steps_writer import StepsWriter
from pyvista_vdi.extensions.sets.vdi_set import VDISet
from pyvista_vdi.generation.generate import generate_vdi
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.coverage import bounds_corners, covering_view
from pyvista_vdi.model.metrics import SSIM_WINDOW, compare_images
from pyvista_vdi.model.options import GenerationOptions, GenerationRequest
from pyvista_vdi.model.packing import Packed8
from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.quality.tiles import REACH, seen_region
from pyvista_vdi.quality.view_error import ViewErrorEstimator
from pyvista_vdi.raycasting.multi_vdi import blended

#: Lists and their lengths of a V_O that comes to help, over those of the others.
FINER = 1.3
#: Options of generation that the volume's picture has, too.
_MEDIUM = ("sample_distance", "lights", "ambient_occlusion", "memory_limit")


@dataclass(frozen=True)
class SetSettings:
    """How the VDIs of a set are made."""

    lists: float  # lists along an edge over pixels of the pictures
    max_supersegments: int  # longest list
    views: int  # V_Os to begin with
    nbytes: float = math.nan  # expected bytes of their VDIs; NaN where nothing was measured
    #: Lists along an edge, and the longest list, of a V_O that comes to help over the others': 1
    #: where the user has said what they are
    growth: tuple[float, float] = (FINER, FINER)

    def finer(self) -> SetSettings:
        """Return those of a V_O that comes to help where others did not do."""
        denser, longer = self.growth
        longest = math.ceil(longer * self.max_supersegments)
        return dataclasses.replace(self, lists=denser * self.lists, max_supersegments=longest)


class ViewMaker:
    """Makes VDIs that cover all of one volume, for pictures of one window, and judges them."""

    def __init__(
        self,
        volume: Volume,
        transfer_function: TransferFunction,
        window_size: tuple[int, int],
        options: GenerationOptions,
        metadata: dict[str, Any],
        device: Any = None,
    ) -> None:
        self.volume, self.window_size = volume, window_size
        self._table, self._options = transfer_function, options
        self._metadata, self._device = metadata, device
        self._medium: ViewErrorEstimator | None = None

    def __call__(self, view: Camera, lists: float, max_supersegments: int) -> VDI:
        """Return the VDI of a view."""
        width, height = (max(1, round(lists * edge)) for edge in self.window_size)
        corners = bounds_corners(self.volume.bounds)
        covering = covering_view(view, (width, height), corners)
        camera, size = covering or (view, (width, height))
        options = replace(self._options, max_supersegments=max_supersegments)
        request = GenerationRequest(
            self.volume, self._table, camera, size, options, self._device, metadata=self._metadata
        )
        return _lean(generate_vdi(request))

    def of(self, settings: SetSettings) -> Callable[[Camera], VDI]:
        """Return what makes the VDI of a view by these settings."""
        return lambda view: self(view, settings.lists, settings.max_supersegments)

    def truth(self, view: Camera) -> Truth | None:
        """Return the volume's picture of a view; ``None`` where nothing is seen."""
        if self._medium is None:
            medium = {n: getattr(self._options, n) for n in _MEDIUM}
            self._medium = ViewErrorEstimator(
                self.volume, self._table, device=self._device, **medium
            )
        found = seen_region(view, self.window_size, (self.volume.bounds, self.volume.bounds))
        if found is None:
            return None
        # With what SSIM looks at around each pixel, as far as there are pixels
        first = np.maximum(np.asarray(found.first) - REACH, 0)
        end = np.minimum(np.add(found.first, found.extent) + REACH, self.window_size)
        width, height = (int(n) for n in np.maximum(end - first, SSIM_WINDOW))
        lens = view.tile(self.window_size, [int(n) for n in first], (width, height))
        inner = (width - 2 * REACH) * (height - 2 * REACH)
        whole = math.prod(edge - 2 * REACH for edge in self.window_size)
        picture = self._medium.volume_tile(lens, (width, height))
        return Truth(lens, (width, height), picture, inner / whole, self._device)

    def ssim(self, parts: Sequence[tuple[VDI, float]], view: Camera) -> float:
        """Return the SSIM of a view that is blended of VDIs; 1 where nothing is seen."""
        truth = self.truth(view)
        return 1.0 if truth is None else truth.ssim(*parts)


@dataclass(frozen=True, eq=False)
class Truth:
    """The volume's picture of what is seen of it in a view."""

    lens: Camera
    size: tuple[int, int]
    picture: NDArray[np.float32]
    share: float  # of the whole picture's pixels that have an SSIM
    device: Any

    def ssim(self, *parts: tuple[VDI, float]) -> float:
        """Return the SSIM of the picture of the whole view that is blended of VDIs."""
        seen = blended(parts, FrameRequest(self.lens, self.size, device=self.device))
        return 1.0 - self.share * (1.0 - compare_images(seen, self.picture).ssim)


@dataclass(frozen=True)
class Growth:
    """Makes VDIs of other views of a set's volume."""

    maker: ViewMaker
    settings: SetSettings
    goal: float

    def __call__(self, camera: Camera) -> VDI:
        """Return a VDI of a view, made as those of the set."""
        return self.maker.of(self.settings)(camera)

    def lacking(self, vdi_set: VDISet, camera: Camera) -> VDI | None:
        """Return a finer VDI of a view that does not reach the goal, else None."""
        if self.maker.ssim(vdi_set.parts(camera), camera) >= self.goal:
            return None
        return self.maker.of(self.settings.finer())(camera)


def file_bytes(vdi: VDI) -> int:
    """Return what a VDI takes in a .vdiset file with the defaults of :meth:`VDISet.save`."""
    stream = io.BytesIO()
    StepsWriter("8-byte", 0.0, 1, "zstd", 1).write(stream, vdi, 0.0)
    return stream.tell()


def _lean(vdi: VDI) -> VDI:
    """Return a packed VDI without the arrays that are unpacked when they are asked for."""
    if not isinstance(vdi.packing, Packed8):
        return vdi
    return VDI._of_packing(
        vdi.camera,
        vdi.window_size,
        vdi.offsets,
        vdi.packing,
        vdi.bounds,
        depth_origin=vdi.depth_origin,
        metadata=vdi.metadata,
    )
