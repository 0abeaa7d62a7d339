"""The raycast of a frame's image: of a VDI, or of its volume."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import DeviceMemoryError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.host_memory import aligned_empty
from pyvista_vdi.model.options import FrameRequest
from pyvista_vdi.quality.plan import RenderMode
from pyvista_vdi.raycasting.multi_vdi import blended
from pyvista_vdi.raycasting.raycast import render_vdi
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.render import picture_room, raycast_medium, raycast_volume
from pyvista_vdi.vtk_pipeline.drawing.frame import Frame, Image, ends_of_rays
from pyvista_vdi.vtk_pipeline.filters.source import Request


class VolumePicture:
    """Volume and look of a request, raycast as generation samples them.

    It is right from every view. The voxels go to the device once, for it and for the generation,
    and stay there when only the look changes.

    Parameters
    ----------
    request : Request
        What a VDI of it would be made of.
    in_bricks : bool
        Whether it may be brick by brick, where the device cannot hold it in one piece: a person
        would wait too long for such a picture.

    Attributes
    ----------
    bounds : tuple of float
        The volume's, model frame.
    pictures : int
        How many were drawn.

    Raises
    ------
    VDIError
        If the device cannot hold the volume so.
    """

    def __init__(self, request: Request, *, in_bricks: bool = False) -> None:
        self.request = request
        self.bounds = request.volume.bounds
        self.pictures = 0
        volume, sampling = request.volume, request.options
        room = picture_room(
            request.screen.size, sampling.memory_limit, sampling.occlusion_bytes(volume)
        )
        runtime = get_runtime(request.device)
        look = request.transfer_function
        medium = DeviceVolume(runtime, volume, look, sampling, room=room)
        self._medium: DeviceVolume | None = medium
        if medium.bricks is not None:
            with medium.bricks:  # to be taken by each picture, for its own size
                self._medium = None
                if not in_bricks:
                    raise DeviceMemoryError(f"the volume {volume.name!r} is held brick by brick")

    def picture(self, frame: FrameRequest, lit_from: Camera | None = None) -> NDArray[np.float32]:
        """Return the picture, premultiplied RGBA, float32 (H, W, 4), top row first.

        ``lit_from`` is the view whose light falls on it, in place of the VDI's; brick by brick it
        is the picture's own.
        """
        self.pictures += 1
        if self._medium is None:
            made = self.request
            return raycast_volume(
                made.volume, made.transfer_function, frame.replace(device=made.device), made.options
            )
        return raycast_medium(self._medium, frame, lit_from=lit_from or self.request.camera)


@dataclass(frozen=True, eq=False)
class Drawn:
    """An image that was raycast, kept without what VTK has.

    ``pixels`` is the memory that it begins, 1D: another image may be raycast into it when this one
    is shown no longer.
    """

    image: Image  # premultiplied RGBA, (H, W, 4), top row first
    full_size: tuple[int, int] | None = None  # the viewport's; None before the first image
    key: Any = None  # all that it depends on, but for the depth
    depth: Image | None = None  # that ended its rays
    joint: bool = False  # a part of a picture that other actors show the rest of
    way: RenderMode = "vdi"  # what was raycast
    pixels: Image | None = None

    @property
    def preview(self) -> bool:
        """Whether it has fewer pixels than the viewport."""
        return self.full_size not in (None, self.image.shape[1::-1])


#: What a frame shows of which nothing can be drawn.
NOTHING = Drawn(np.zeros((1, 1, 4), dtype=np.float32))


def raycast(frame: Frame, device: object, pixels: Image | None) -> Drawn:
    """Return the image of a frame, in memory that is given where that is large enough."""
    width, height = size = frame.size
    # Fresh memory costs a page fault for every 4096 bytes that are written, and a GPU copies into
    # what is page-locked in half the time
    if pixels is None or pixels.size < width * height * 4:
        runtime = get_runtime(device)
        empty = aligned_empty if runtime.is_cpu else runtime.pinned
        pixels = empty((width * height * 4,), np.dtype(np.float32))
    out = pixels[: height * width * 4].reshape(height, width, 4)
    request = FrameRequest(frame.camera, size, frame.options, ends_of_rays(frame), device, out)
    if frame.volume is not None:
        image = frame.volume.picture(request, frame.lit_from)
    elif frame.parts:
        image = blended(frame.parts, request)
    else:
        assert frame.vdi is not None
        image = render_vdi(frame.vdi, request)
    of = (frame.full_size, frame.key, frame.depth)
    return Drawn(image, *of, way=frame.way, pixels=pixels)
