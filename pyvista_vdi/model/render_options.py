"""What is asked of a picture: how it is to look, and the frame that is to be filled.

One record goes from the public functions, from VTK's mapper and from the measurements down to the
kernels. It is checked once, where it is made.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import as_float, as_whole
from pyvista_vdi.model.cropping import Cropping, checked_opacity_multiplier
from pyvista_vdi.model.options import Options, option, record

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
    if planes is None:
        return ()
    wanted = "clipping_planes must be (k, 6) finite numbers, origin and normal of each plane"
    try:
        table = np.asarray(planes, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidArgumentError(f"{wanted}; got {planes!r}") from error
    if table.size == 0:
        return ()
    if table.ndim != 2 or table.shape[1] != 6 or not np.isfinite(table).all():
        raise InvalidArgumentError(f"{wanted}; got shape {table.shape}")
    if not table[:, 3:].any(axis=1).all():
        raise InvalidArgumentError("a clipping plane's normal is zero: give its direction")
    return tuple(map(tuple, table.tolist()))


def checked_preview_samples(samples: Any) -> int | None:
    """Return a number of samples per ray as an int between 1 and :data:`MAX_PREVIEW_SAMPLES`."""
    if samples is None:
        return None
    number = as_whole(samples)
    if not 1 <= number <= MAX_PREVIEW_SAMPLES:
        raise InvalidArgumentError(
            f"preview_samples must be a whole number from 1 to {MAX_PREVIEW_SAMPLES}; "
            f"got {samples!r}"
        )
    return int(number)


def checked_transmittance_cutoff(cutoff: Any) -> float:
    """Return a transmittance at which rays end, as a float from 0 to below 1."""
    number = as_float(cutoff)
    if not 0 <= number < 1:
        raise InvalidArgumentError(
            "transmittance_cutoff must be a number from 0 to below 1, such as 0.004 for a "
            f"difference of 1/255 at most; got {cutoff!r}"
        )
    return number


@record
@dataclass(frozen=True)
class RenderOptions(Options):
    """How a VDI, or a volume, is drawn; the public functions' arguments of these names.

    Options that compare equal give the same picture of the same view. Clipping planes are held as
    tuples; the side of each to which its normal points is kept.
    """

    clipping_planes: Any = option(
        None, "origin and normal of each plane, world coordinates", checked_planes
    )
    cropping: Any = option(
        None, "which of 27 regions of the data's own coordinates are drawn", Cropping.from_any
    )
    opacity_multiplier: float = option(
        1.0, "factor of the extinction, 0 or above", checked_opacity_multiplier
    )
    skip_empty: bool = option(True, "pass by what is empty")
    preview_samples: int | None = option(
        None, "look a VDI up at so many points of each ray", checked_preview_samples
    )
    transmittance_cutoff: float = option(
        None,
        "a ray ends where less light than this is left",
        lambda cutoff: checked_transmittance_cutoff(
            TRANSMITTANCE_CUTOFF if cutoff is None else cutoff
        ),
    )

    def replace(self, **changes: Any) -> "RenderOptions":
        """Return the same options but for some of them."""
        return replace(self, **changes)


@dataclass(frozen=True, eq=False)
class FrameRequest:
    """A frame that is asked for: the view V_N, how it looks, and where its picture goes.

    The camera's ``model_transform`` says where the model frame is now. ``opaque_depth`` is the view
    depth at which each ray ends, world units, (height, width), top row first, inf where nothing is
    opaque; it is checked where rays are made of it. ``out`` is an array for the picture, float32
    (height, width, 4), C-contiguous: a CPU device draws into it without a copy if it begins at a
    multiple of 4096 bytes (:func:`pyvista_vdi.device.aligned_empty`).
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
        out, shape = self.out, (*self.size[::-1], 4)
        if out is not None and (out.shape != shape or out.dtype != np.float32):
            raise InvalidArgumentError(
                f"out must be float32 of the image's shape {shape}; got {out.dtype}, {out.shape}"
            )

    def replace(self, **changes: Any) -> "FrameRequest":
        """Return the same request but for some of its fields."""
        return replace(self, **changes)


#: When a view gets a VDI of its own; a function gets the actor's status.
Policy: TypeAlias = Literal["auto", "never"] | Callable[[Any], object]


def checked_rate(name: str, value: Any) -> float:
    """Return a rate in frames per second; 0 or above, finite."""
    rate = as_float(value)
    if isinstance(value, bool) or not 0 <= rate < math.inf:
        raise InvalidArgumentError(
            f"{name} must be a number of frames per second, 0 or above; got {value!r}"
        )
    return rate


def checked_policy(policy: Any) -> Policy:
    """Return ``"auto"``, ``"never"`` or a callable; refuse anything else."""
    if policy in ("auto", "never") or callable(policy):
        return policy  # type: ignore[no-any-return]
    raise InvalidArgumentError(
        "regenerate must be 'auto', 'never' or a callable that takes a VDIStatus and says whether "
        f"to regenerate; got {policy!r}"
    )


def checked_bound(ssim: Any) -> float:
    """Return an SSIM between 0 and 1."""
    bound = as_float(ssim)
    if isinstance(ssim, bool) or not 0 <= bound <= 1:
        raise InvalidArgumentError(
            f"regenerate_below must be an SSIM between 0 and 1; got {ssim!r}"
        )
    return bound


def checked_draw(draw: Any) -> Literal["auto", "vdi", "volume"]:
    """Return what is drawn, ``"auto"``, ``"vdi"`` or ``"volume"``; refuse anything else."""
    if draw in ("auto", "vdi", "volume"):
        return draw  # type: ignore[no-any-return]
    raise InvalidArgumentError(f"draw must be 'auto', 'vdi' or 'volume'; got {draw!r}")


@record
@dataclass(frozen=True)
class DrawingOptions(Options):
    """How frames are drawn, with the names and defaults of :meth:`AddVDI.__call__`."""

    target_fps: float | None = option(
        30.0,
        "frames per second to be kept while the view moves",
        lambda rate: None if rate is None else checked_rate("target_fps", rate),
    )
    adjust_multi_samples: bool = option(
        True, "go without multisampling while the view moves and frames would be late"
    )
    regenerate: Policy = option("auto", "when a view gets a VDI of its own", checked_policy)
    regenerate_below: float | None = option(
        None,
        "estimated SSIM, 0 to 1, below which a VDI does not do for a view",
        lambda ssim: None if ssim is None else checked_bound(ssim),
    )
    draw: Literal["auto", "vdi", "volume"] = option(
        "auto", "what is raycast where the volume is at hand", checked_draw
    )
