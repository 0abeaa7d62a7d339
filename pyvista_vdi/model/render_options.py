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

    Raises
    ------
    InvalidArgumentError
        If the shape is another, a value is not finite or a normal is zero.
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

    Options that compare equal give the same picture of the same view.

    Parameters
    ----------
    clipping_planes : array_like of float, shape (k, 6), optional
        Origin and normal of each plane, world coordinates; the normal's side is kept. Held as
        tuples.
    cropping : Cropping or what makes one, optional
        Which regions of the model frame are drawn: see :meth:`pyvista_vdi.Cropping.from_any`.
    opacity_multiplier : float
        Factor of the extinction, 0 or above.
    skip_empty : bool
        Pass by what is empty, where that gains time. The picture is the same to the last bit.
    preview_samples : int, optional
        Look a VDI up at so many points of each ray instead of intersecting its supersegments
        (paper section 5): an approximation. Fewer pixels are the better one.
    transmittance_cutoff : float
        A ray ends where less than this is left, 0 to below 1. It bounds what any channel of the
        image can lose.

    Raises
    ------
    InvalidArgumentError
        If one of them cannot be used.
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

    def replace(self, **changes: Any) -> RenderOptions:
        """Return the same options but for some of them."""
        return replace(self, **changes)


@dataclass(frozen=True, eq=False)
class FrameRequest:
    """A frame that is asked for: the view, how it looks, and where its picture goes.

    Parameters
    ----------
    camera : Camera or vtkCamera or pyvista.Camera
        The new view V_N. Its ``model_transform`` says where the model frame is now.
    size : (int, int)
        Width and height of the picture in pixels.
    options : RenderOptions
        How it is to look.
    opaque_depth : array_like of float, shape (height, width), optional
        View depth at which each ray ends, world units, top row first; inf where nothing is opaque.
        Checked where rays are made of it.
    device : optional
        See :func:`pyvista_vdi.list_devices`.
    out : numpy.ndarray, optional
        Array for the picture, float32 (height, width, 4), C-contiguous. A CPU device draws into it
        without a copy if it begins at a multiple of 4096 bytes
        (:func:`pyvista_vdi.device.aligned_empty`).

    Raises
    ------
    InvalidCameraError, InvalidArgumentError
        If the camera, the size or ``out`` cannot be used.
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

    def replace(self, **changes: Any) -> FrameRequest:
        """Return the same request but for some of its fields."""
        return replace(self, **changes)
