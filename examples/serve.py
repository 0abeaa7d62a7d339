"""A volume that changes, served to web pages: it stays here, and pages turn what they were sent.

What one should see: open the URL that is printed. A glowing ball swells as the slider "Time" moves;
brightness, opacity and clipping are changed in the page. Ctrl-C ends the server.

The port is the argument (8765 without one; 0 takes a free one).
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np
import pyvista as pv

from pyvista_vdi.extensions import web


class Swelling(Sequence):
    """Time steps that are computed when somebody wants to see them."""

    def __init__(self, steps: int, n: int = 96) -> None:
        self.steps, self.n = steps, n

    def __len__(self) -> int:
        return self.steps

    def __getitem__(self, step: int) -> pv.ImageData:
        n = self.n
        volume = pv.ImageData(dimensions=(n, n, n), spacing=(2 / (n - 1),) * 3, origin=(-1, -1, -1))
        x, y, z = volume.points.T
        ripples = 1 + 0.15 * np.sin(8 * x) * np.sin(8 * y) * np.sin(8 * z)
        radius = np.sqrt(x**2 + y**2 + z**2) * ripples
        size = 0.4 + 0.5 * step / max(1, self.steps - 1)
        volume["density"] = (255 * np.clip(1 - radius / size, 0, 1)).astype(np.uint8)
        return volume


if __name__ == "__main__":
    web.serve(
        Swelling(8),
        port=int(sys.argv[1]) if len(sys.argv) > 1 else 8765,
        cmap="inferno",
        opacity="sigmoid_5",
        clim=(0, 255),
    )
