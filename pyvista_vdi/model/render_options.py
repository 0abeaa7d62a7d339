"""What is asked of a picture: how it is to look, and the frame that is to be filled.

One record goes from the public functions, from VTK's mapper and from the measurements down to the
kernels. It is checked once, where it is made.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import Number, as_floats
from pyvista_vdi.model.cropping import Cropping
from pyvista_vdi.model.options import Options, option, record
from pyvista_vdi.model.types import Coverage, Draw, Policy

#: A ray ends where less transmittance than this is left, unless told otherwise: no channel loses
#: more than that.
TRANSMITTANCE_CUTOFF = 1e-6
#: Most samples of a ray in a preview: each has a half, and float32 counts halves up to 2^24.
MAX_PREVIEW_SAMPLES = 2**23

#: Origin and normal of each plane; the side that the normal points to is kept.
Planes: TypeAlias = tuple[tuple[float, ...], ...]


def checked_planes(planes: Any) -> Planes:
    """Return clipping planes as tuples of six floats; none for ``None``.

    InvalidArgumentError if the shape is another, a value is not finite or a normal is zero.
    """
    if planes is None or (np.iterable(planes) and not [*planes]):
        return ()
    table = as_floats(planes)
    shaped = table.ndim == 2 and table.shape[1] == 6 and np.isfinite(table).all()
    if not shaped or not table[:, 3:].any(axis=1).all():
        raise InvalidArgumentError(
            "clipping_planes must be (k, 6) finite numbers, origin and normal of each plane, which "
            f"is not zero; got {planes!r}"
        )
    return tuple(map(tuple, table.tolist()))


@record
@dataclass(frozen=True)
class SceneOptions(Options):
    """What of a VDI, or of a volume, is drawn, and how dense it is."""

    clipping_planes: Any = option(
        None,
        "origin and normal of each plane, world coordinates",
        "Shape (k, 6); the side that the normal points to is kept, as with VTK's mappers.",
        check=checked_planes,
        takes="ArrayLike | None",
    )
    cropping: Any = option(
        None,
        "which of 27 regions of the data's own coordinates are drawn",
        "A :class:`Cropping`, a mapper's, the six planes of a box, or a pair of these and regions: "
        'flags, or ``"fence"``, ``"cross"`` ...',
        check=Cropping.from_any,
        takes="CroppingLike | None",
    )
    opacity_multiplier: float = option(
        1.0,
        "factor of the extinction, 0 or above",
        "2 is twice as dense, as by half of the opacity unit distance.",
        check=Number("a finite factor of the extinction, 0 (transparent) or above"),
    )

    def drawn(self) -> RenderOptions:
        """Return how it is drawn where nothing else is said."""
        return RenderOptions(**{name: getattr(self, name) for name in self.declared})


@record
@dataclass(frozen=True)
class RenderOptions(SceneOptions):
    """How a VDI, or a volume, is drawn.

    Options that compare equal give the same picture of the same view.
    """

    preview_samples: int | None = option(
        None,
        "look a VDI up at so many points of each ray",
        "An approximation (paper section 5); a smaller ``window_size`` is the better one. For a "
        "single VDI only.",
        check=Number(
            f"a whole number from 1 to {MAX_PREVIEW_SAMPLES}", 1, MAX_PREVIEW_SAMPLES, whole=True
        ),
    )
    transmittance_cutoff: float = option(
        TRANSMITTANCE_CUTOFF,
        "a ray ends where less light than this is left, 0 to below 1",
        "No channel loses more: 0.004 changes a picture of 8 bits by one step at most, and saves a "
        "fifth to two fifths of the work where things are opaque. For a single VDI only.",
        check=Number(
            "a number from 0 to below 1, such as 0.004 for a difference of 1/255 at most",
            high=np.nextafter(1.0, 0.0),
        ),
        setting=True,
    )
    skip_empty: bool = True

    replace = replace


@dataclass(frozen=True, eq=False)
class FrameRequest:
    """A frame that is asked for: the view V_N, how it looks, and where its picture goes.

    The camera's ``model_transform`` says where the model frame is now. ``opaque_depth`` is the view
    depth at which each ray ends, world units, (height, width), top row first, inf where nothing is
    opaque; it is checked where rays are made of it. ``out`` is an array for the picture, float32
    (height, width, 4), C-contiguous: a CPU device draws into it without a copy if it begins at a
    multiple of 4096 bytes (:func:`pyvista_vdi.model.host_memory.aligned_empty`).
    """

    camera: Camera
    size: tuple[int, int]
    options: RenderOptions = field(default_factory=RenderOptions)
    opaque_depth: ArrayLike | None = None
    device: Any = None
    out: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "camera", Camera.from_any(self.camera))
        put(self, "size", check_window_size(self.size))

    replace = replace


@record
@dataclass(frozen=True)
class DrawingOptions(Options):
    """How frames are drawn."""

    target_fps: float | None = option(
        30.0,
        "frames per second to be kept while the view moves",
        "By drawing fewer pixels. ``None``: the interactor's ``DesiredUpdateRate``, as for VTK's "
        "own levels of detail; 0: every frame is full.",
        check=Number("a number of frames per second, 0 or above"),
    )
    regenerate: Policy = option(
        "auto",
        "when a view gets a VDI of its own",
        '``"auto"``: in windows on the screen, where the estimated SSIM of its picture is below '
        "``regenerate_below``. "
        '``"never"``: only ``actor.regenerate()``. Changed data and transfer functions are always '
        "made anew.",
    )
    regenerate_below: float | None = option(
        None,
        "estimated SSIM, 0 to 1, below which a VDI does not do for a view",
        '``regenerate="auto"`` makes another, by default below 0.95, and ``draw="auto"`` draws the '
        "volume in its place, by default below 0.98.",
        check=Number("an SSIM between 0 and 1", 0, 1),
        setting=True,
    )
    draw: Draw = option(
        "auto",
        "what is raycast where the volume is at hand",
        '``"auto"``: on the screen by what gives the better picture within ``target_fps``, the VDI '
        "near its view and the volume far from it; off-screen the volume. Volumes that overlap are "
        "drawn by VDIs. ``actor.status.drawn`` says what was drawn.",
    )
    coverage: Coverage = option(
        "bounds",
        "what the VDI's window covers",
        '``"bounds"``: the whole volume, so that neither panning nor zooming out shows a cut edge. '
        '``"view"``: the window.',
        setting=True,
    )
