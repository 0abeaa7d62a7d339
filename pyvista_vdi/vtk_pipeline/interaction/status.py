"""What a person is told of a VDI on the screen: its status, corner texts and warnings."""

from __future__ import annotations

import logging
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, Literal

from pyvista_vdi.errors import InvalidArgumentError, VDIWarning, warn_external
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.costs import RenderMode
from pyvista_vdi.quality.targets import describe
from pyvista_vdi.vtk_pipeline.vtk import vtkCornerAnnotation, weakly

_log = logging.getLogger(__name__)

#: VTK's names of the corners.
CORNERS = {
    "lower left": vtkCornerAnnotation.LowerLeft,
    "lower right": vtkCornerAnnotation.LowerRight,
    "upper left": vtkCornerAnnotation.UpperLeft,
    "upper right": vtkCornerAnnotation.UpperRight,
}

#: Largest font of the corner text, points.
_FONT_SIZE = 14
#: Progress after which a text is drawn again though nothing else has changed.
_PROGRESS_STEP = 0.05


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

    @property
    def dial(self) -> dict[str, Any] | None:
        """What a dial chose for the VDI, and what it predicts; ``None`` where there is none.

        See ``vdi.metadata["dial"]`` in docs/dial.md.
        """
        return None if self.vdi is None else self.vdi.metadata.get("dial")

    def __str__(self) -> str:
        if self.mode == "none":
            parts = ["no VDI drawn yet"]
        else:
            what = f"{self.mode}, the volume itself" if self.drawn == "volume" else self.mode
            parts = [f"{what}: {self.share:.0%} of {self.full_samples} pixels"]
        if self.fps is not None:
            parts.append(f"{self.fps:.3g} frames/s")
        if self.angle is not None:
            parts.append(f"{self.angle:.0f}° from the generating view")
        if self.coverage is not None and self.coverage < 1:
            parts.append(f"{self.coverage:.0%} covered")
        if self.ssim is not None:
            parts.append(f"SSIM about {self.ssim:.3f}")
        if self.time is not None:
            parts.append(f"time {self.time:g}")
        elif self.generation:
            parts.append(f"VDI no. {self.generation}")
        chosen = None if self.vdi is None else describe(self.vdi.metadata)
        if chosen is not None:
            parts.append(chosen)
        if self.progress is not None:
            parts.append(f"making the next: {self.progress:.0%}")
        return ", ".join(parts)


class CornerTexts:
    """Annotations that show a status; the renderers own them."""

    def __init__(self) -> None:
        self._texts: list[tuple[Callable[[], Any], Callable[[], Any], int]] = []
        self._progress: float | None = None

    def add(self, renderer: Any, corner: str) -> vtkCornerAnnotation:
        """Add one to a corner of a renderer."""
        if corner not in CORNERS:
            raise InvalidArgumentError(f"corner must be one of {tuple(CORNERS)}; got {corner!r}")
        annotation = vtkCornerAnnotation()
        annotation.SetMaximumFontSize(_FONT_SIZE)
        annotation.PickableOff()
        look = annotation.GetTextProperty()  # white on a shade: legible on any background
        look.SetColor(1.0, 1.0, 1.0)
        look.SetBackgroundColor(0.0, 0.0, 0.0)
        look.SetBackgroundOpacity(0.5)
        renderer.AddViewProp(annotation)
        self._texts.append((weakly(annotation), weakly(renderer), CORNERS[corner]))
        return annotation

    def write(self, renderer: Any, status: Callable[[], VDIStatus]) -> None:
        """Show the status in the frame that this renderer is drawing."""
        if self._texts:
            self._texts = [text for text in self._texts if text[0]() is not None]
        for text, where, corner in self._texts:
            if where() is not renderer:
                continue
            annotation, now = text(), status()
            self._progress = now.progress
            lines = str(now).replace(", ", "\n")
            if annotation.GetText(corner) != lines:
                annotation.SetText(corner, lines)
                # It was laid out in the opaque pass, which is over when volumes are drawn
                annotation.RenderOpaqueGeometry(renderer)

    def are_behind(self, progress: float | None) -> bool:
        """Whether there are texts, and what they say of the progress is too old."""
        if not self._texts or progress == self._progress:
            return False
        if progress is None or self._progress is None:
            return True
        return abs(progress - self._progress) >= _PROGRESS_STEP


class Warnings:
    """Says each thing once, as a :class:`~pyvista_vdi.VDIWarning`.

    Exceptions cannot pass through VTK's renderer.
    """

    def __init__(self) -> None:
        self._said: set[Hashable] = set()

    def warn(
        self, message: str, error: BaseException | None = None, *, cause: Hashable = None
    ) -> None:
        """Warn, unless this, or its cause, was said before; a traceback goes to the log."""
        if error is not None:
            _log.debug("%s", message, exc_info=error)
        if (cause or message) in self._said:
            return
        self._said.add(cause or message)
        try:
            warn_external(message)
        except VDIWarning:  # warnings are errors: the log is what is left
            _log.error(message)

    def forget(self) -> None:
        """Forget what was said, so that it is said again if it comes up again."""
        self._said.clear()
