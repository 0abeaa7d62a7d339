"""The images of a mapper's last frames, and the raycast of another one."""

from __future__ import annotations

import numpy as np

from pyvista_vdi.device import aligned_empty
from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.raycasting.multi_vdi import blended
from pyvista_vdi.raycasting.raycast import render_vdi
from pyvista_vdi.vtk_pipeline.drawing.frame import Drawn, Frame, Image, Recent, same_depth

#: What a frame shows of which nothing can be drawn.
NOTHING = Drawn(np.zeros((1, 1, 4), dtype=np.float32))


class Images:
    """Images that are kept, by what they are of, and the memory of one that is kept no longer."""

    def __init__(self) -> None:
        self._kept: Recent[Drawn] = Recent()
        self._of: tuple[str, int] | None = None  # which VDI, or volume
        self._free: Image | None = None  # shown by no frame, not even the last
        self._raycasts = 0

    def get(self, frame: Frame) -> Drawn | None:
        """Return the image of exactly this frame, if there is one."""
        if self._of != (frame.way, frame.number):
            self._of = (frame.way, frame.number)
            self._kept.clear()
        drawn = self._kept.get(frame.key)
        return drawn if drawn is not None and same_depth(drawn.depth, frame.depth) else None

    def raycast(self, frame: Frame, device: object) -> Drawn:
        """Return the image, and keep it; the memory of one that goes is for the next raycast."""
        width, height = frame.size
        # Fresh memory costs a page fault for every 4096 bytes that are written
        pixels, self._free = self._free, None
        if pixels is None or pixels.size < width * height * 4:
            pixels = aligned_empty(width * height * 4, np.float32)
        out = pixels[: height * width * 4].reshape(height, width, 4)
        request = FrameRequest(frame.camera, frame.size, frame.options, frame.depth, device, out)
        seen = frame.few_lists or frame.vdi
        if frame.volume is not None:
            image = frame.volume.picture(request, frame.lit_from)
        elif frame.parts and frame.few_lists is None:
            image = blended(frame.parts, request)
        else:
            assert seen is not None
            image = render_vdi(seen, request)
        self._raycasts += 1
        drawn = Drawn(
            image,
            frame.full_size,
            frame.depth,
            self._raycasts,
            placeholder=frame.volume is not None and frame.volume.placeholder,
            way=frame.way,
            pixels=pixels,
        )
        gone = self._kept.keep(frame.key, drawn)
        if gone is not None:
            self._free = gone.pixels
        return drawn

    @property
    def any(self) -> bool:
        """Whether there are any."""
        return bool(self._kept)

    def clear(self) -> None:
        """Drop all."""
        self._kept.clear()
        self._free = None
