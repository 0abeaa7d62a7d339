"""The pixels in which a preview shows something: OpenGL fills no others."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

_GL_SCISSOR_BOX = 0x0C10

#: Left, bottom, width and height in pixels of the framebuffer.
Box = tuple[int, int, int, int]


def shown_box(image: NDArray[np.float32], origin: tuple[int, int], size: tuple[int, int]) -> Box:
    """Return the pixels of a viewport that a smaller image may show something in.

    Parameters
    ----------
    image : ndarray of float32, shape (h, w, 4)
        Premultiplied RGBA, top row first, interpolated linearly to the viewport.
    origin, size : (int, int)
        The viewport's lower left corner and size, framebuffer pixels.

    Returns
    -------
    (int, int, int, int)
        Left, bottom, width and height in framebuffer pixels; zeros where nothing is shown.
    """
    there: NDArray[Any] = np.asarray(image.any(axis=2))
    box = []
    edges = np.any(there, axis=0), np.any(there[::-1], axis=1)
    for at_pixels, pixels, start in zip(edges, size, origin, strict=True):
        (at,) = np.nonzero(at_pixels)
        if len(at) == 0:
            return 0, 0, 0, 0
        # A texel reaches to the centres of its neighbours: half a texel beyond its edges
        n = len(at_pixels)
        low = max(0, int((at[0] - 0.5) * pixels / n) - 1)
        high = min(pixels, int((at[-1] + 1.5) * pixels / n) + 2)
        box += [(start + low, high - low)]
    (left, width), (bottom, height) = box
    return left, bottom, width, height


class Scissor:
    """The window's scissor box, narrowed while a mapper draws; VTK's renderer has it tested."""

    def __init__(self) -> None:
        self._before: tuple[Any, list[int]] | None = None  # OpenGL's state, and its scissor box

    def narrow(self, window: Any, box: Box) -> None:
        """Draw in this box alone, and within what was set, until :meth:`end`."""
        # What a frame that VTK broke off has left is not set again: each renderer sets its own box
        state, before = window.GetState(), [0, 0, 0, 0]
        state.vtkglGetIntegerv(_GL_SCISSOR_BOX, before)
        low = [max(a, b) for a, b in zip(before[:2], box[:2], strict=True)]
        high = [min(before[i] + before[i + 2], box[i] + box[i + 2]) for i in (0, 1)]
        state.vtkglScissor(*low, *(max(0, h - b) for b, h in zip(low, high, strict=True)))
        self._before = state, before

    def end(self) -> None:
        """Set what was set before."""
        before, self._before = self._before, None
        if before is not None:
            before[0].vtkglScissor(*before[1])
