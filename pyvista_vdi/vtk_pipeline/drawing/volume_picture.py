"""The volume itself, drawn in place of its VDI: until that is made, or because it is better."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import Runtime, get_runtime
from pyvista_vdi.errors import DeviceMemoryError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.quality.background import TRIAL_SIZE
from pyvista_vdi.quality.frame_rate import FLOOR
from pyvista_vdi.quality.frame_state import FrameTook
from pyvista_vdi.quality.pace import reduced
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.render import picture_room, raycast_medium, raycast_volume
from pyvista_vdi.vtk_pipeline.drawing.frame import Frame
from pyvista_vdi.vtk_pipeline.filters.source import Request

#: Pictures that tell what a volume's rays cost, of which the fastest counts: what disturbs one by
#: milliseconds has the volume seem too dear to be drawn, which no frame would ever correct.
_TRIALS = 5

_numbers = itertools.count()


class VolumePicture:
    """Volume and look of a request, raycast as generation samples them, in the VDI's light.

    It is right from every view. The voxels go to the device once, for it and for the generation,
    and stay there when only the look changes.

    Parameters
    ----------
    request : Request
        What the VDI is being made of.
    placeholder : bool
        Whether it is drawn until a VDI has been made, and not for its own sake.
    in_bricks : bool
        Whether it may be brick by brick, where the device cannot hold it in one piece: a person
        would wait too long for such a picture.

    Attributes
    ----------
    number : int
        By which it is known.
    bounds : tuple of float
        The volume's, model frame.
    shaded : bool
        Whether it is lit.
    pictures : int
        How many were drawn.

    Raises
    ------
    VDIError
        If the device cannot hold the volume so.
    """

    def __init__(
        self, request: Request, *, placeholder: bool = False, in_bricks: bool = False
    ) -> None:
        self.request = request
        self.placeholder = placeholder
        self.number = next(_numbers)
        self.bounds = request.volume.bounds
        self.shaded = request.transfer_function.shading is not None
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
            with medium.giving_bricks_back():  # to be taken by each picture, for its own size
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
        return raycast_medium(self._medium, frame, lit_from=lit_from or self.request.generating[0])


class VolumePictures:
    """The volumes that a mapper draws: for their own sake, and until a VDI is made."""

    def __init__(self) -> None:
        self.lasting: VolumePicture | None = None
        self.placeholder: VolumePicture | None = None

    def wait_by(self, wanted: Request) -> VolumePicture:
        """Return the volume of what a VDI is being made of; VDIError is raised if there is none."""
        if self.placeholder is None or self.placeholder.request is not wanted:
            self.placeholder = None  # its buffers go before others are taken
            self.placeholder = VolumePicture(wanted, placeholder=True)
        return self.placeholder

    def get(
        self, content: Any, request: Callable[[], Request], *, in_bricks: bool
    ) -> VolumePicture:
        """Return the volume of a content, made of the request; VDIError is raised if it cannot."""
        self.placeholder = None
        if self.lasting is None or self.lasting.request.content != content:
            self.lasting = None
            self.lasting = VolumePicture(request(), in_bricks=in_bricks)
        return self.lasting


def prepared(runtime: Runtime, request: Request, *, time: bool) -> FrameTook | None:
    """Draw a volume in vain, so that all is compiled; return what a ray takes, if that is asked.

    By pictures of as many pixels as a preview has at least.
    """
    camera, volume = request.screen.camera, VolumePicture(request)
    volume.picture(FrameRequest(camera, (TRIAL_SIZE, TRIAL_SIZE)))
    if not time:
        return None
    trial, taken = Frame.of(camera, reduced(request.screen.size, FLOOR), volume.bounds), []
    for _ in range(_TRIALS):
        began = runtime.clock()
        volume.picture(FrameRequest(camera, trial.size))
        taken.append(runtime.clock() - began)
    return FrameTook("volume", 0.0, trial.covered, min(taken))
