"""What a person is told of a VDI on the screen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.costs import RenderMode
from pyvista_vdi.quality.targets import describe


@dataclass(frozen=True)
class VDIStatus:
    """How a VDI was drawn in the last frame, and what goes on behind it.

    Attributes
    ----------
    mode : {"none", "full", "preview"}
        Nothing drawn yet, one ray per pixel, or fewer.
    samples : int
        Rays that were cast: pixels of the image.
    full_samples : int
        Pixels of the viewport.
    fps : float or None
        Frames per second of the window: mean of an interaction's last frames; at rest, what the
        last frame would allow. ``None`` before the first whole frame.
    angle : float or None
        Between the view and V_O, degrees; ``None`` without a VDI.
    magnification : float or None
        Pixels of the view that are as wide as one of the VDI's lists; ``None`` without a VDI.
    coverage : float or None
        Share, 0 to 1, of the view's rays through the volume that the VDI has all of; ``None``
        without a VDI.
    ssim : float or None
        Estimated SSIM of the VDI's picture of this view against volume rendering; ``None`` where
        nothing asked for it.
    progress : float or None
        Share done, 0 to 1, of the VDI that is being made in the background; ``None`` if none is.
    generation : int
        How many VDIs were shown so far, this one included.
    stand_in : bool
        Whether the volume itself was drawn, because the VDI shows what has changed since.
    drawn : {"vdi", "volume"}
        What was raycast: the VDI, or the volume itself, for whatever reason.
    vdi : VDI or None
        The one that is shown, or is to be replaced.
    time : float or None
        That of the step of a series; ``None`` where no series is shown.
    """

    mode: Literal["none", "full", "preview"]
    samples: int
    full_samples: int
    fps: float | None
    angle: float | None
    ssim: float | None
    progress: float | None
    generation: int
    vdi: VDI | None
    stand_in: bool = False
    drawn: RenderMode = "vdi"
    time: float | None = None
    magnification: float | None = None
    coverage: float | None = None

    @property
    def share(self) -> float:
        """Share of the viewport's pixels that a ray was cast for, 0 to 1."""
        return self.samples / self.full_samples if self.full_samples else 0.0

    def __str__(self) -> str:
        what = f"{self.mode}, the volume itself" if self.drawn == "volume" else self.mode
        told = [
            (self.fps, "{:.3g} frames/s"),
            (self.angle, "{:.0f}° from the generating view"),
            (self.ssim, "SSIM about {:.3f}"),
            (self.time, "time {:g}"),
            (self.generation or None, "VDI no. {}"),
            (None if self.vdi is None else describe(self.vdi.metadata), "{}"),
            (self.progress, "making the next: {:.0%}"),
        ]
        parts = [f"{what}: {self.share:.0%} of {self.full_samples} pixels"]
        return ", ".join(parts + [text.format(value) for value, text in told if value is not None])
