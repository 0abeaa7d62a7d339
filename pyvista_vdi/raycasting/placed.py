"""Several VDIs of one scene: where each is and how it looks, and the order in which they count."""

from __future__ import annotations

import hashlib
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.render_options import RenderOptions
from pyvista_vdi.model.vdi import VDI

_digests: weakref.WeakKeyDictionary[VDI, bytes] = weakref.WeakKeyDictionary()


@dataclass(frozen=True)
class PlacedVDI:
    """A VDI and where it is in a scene.

    Attributes
    ----------
    vdi : VDI
        The medium.
    camera : Camera
        The new view; its ``model_transform`` says where this VDI's model frame is.
    options : RenderOptions
        How it looks. Several VDIs have neither previews nor another cutoff than the default.
    """

    vdi: VDI
    camera: Camera
    options: RenderOptions = field(default_factory=RenderOptions)


def placed_vdis(
    vdis: Sequence[VDI],
    camera: Camera,
    model_transforms: Sequence[ArrayLike] | None = None,
    clipping_planes: Any = None,
    cropping: Any = None,
    opacity_multiplier: float | Sequence[float] = 1.0,
    skip_empty: bool = True,
) -> list[PlacedVDI]:
    """Return VDIs with what :func:`pyvista_vdi.render` was given for all, or for each, of them.

    Raises
    ------
    InvalidArgumentError
        If there is none, or there are not as many values as VDIs.
    """
    count = len(vdis)
    for vdi in vdis:
        if not isinstance(vdi, VDI):
            raise InvalidArgumentError(f"expected VDIs, got {type(vdi).__name__} among them")
    if not vdis:
        raise InvalidArgumentError("there is no VDI to render: the sequence is empty")
    cameras = [camera] * count
    if model_transforms is not None:
        matrices = list(model_transforms) if np.iterable(model_transforms) else []
        wanted = "model_transforms must have one matrix for each of the {} VDIs"
        matrices = _each(matrices, count, wanted, got=len(matrices))
        cameras = [camera.replace(model_transform=matrix) for matrix in matrices]
    croppings: Sequence[Any] = [None] * count
    if cropping is not None:
        wanted = "cropping must be a list with an entry for each of the {} VDIs, None where "
        wanted += "nothing is cropped"
        croppings = _each(cropping, count, wanted, got=cropping)
    multipliers: Sequence[Any] = [opacity_multiplier] * count
    if isinstance(opacity_multiplier, list | tuple):
        wanted = "opacity_multiplier must be a number, or one for each of the {} VDIs"
        multipliers = _each(opacity_multiplier, count, wanted, got=opacity_multiplier)
    planes = _planes_of_each(clipping_planes, count)
    each = zip(planes, croppings, multipliers, strict=True)
    options = [RenderOptions(*one, skip_empty=skip_empty) for one in each]
    return [PlacedVDI(*one) for one in zip(vdis, cameras, options, strict=True)]


def canonical_order(placed: Sequence[PlacedVDI], depths: Sequence[float]) -> list[int]:
    """Return the indices of VDIs in an order that does not depend on the one they are given in.

    Sums of floats depend on it where there are more than two, and so does where light is known to
    have ended: that of ``depths``, so that those behind end where those before are opaque.
    """
    tied = len(set(depths)) < len(depths)
    keys = [_key(one) if tied else () for one in placed]
    return sorted(range(len(placed)), key=lambda i: (depths[i], keys[i]))


def _key(placed: PlacedVDI) -> tuple[bytes, ...]:
    options = placed.options
    planes = np.asarray(options.clipping_planes, dtype=np.float64).tobytes()
    looks = repr((options.cropping, options.opacity_multiplier)).encode()
    return _digest(placed.vdi), placed.camera.model_transform.tobytes(), planes, looks


def _digest(vdi: VDI) -> bytes:
    """Return a digest of all that a VDI's picture depends on; computed once."""
    known = _digests.get(vdi)
    if known is None:
        digest = hashlib.blake2b(digest_size=16)
        scalars = (vdi.camera, vdi.window_size, vdi.bounds, vdi.depth_origin)
        digest.update(repr(scalars).encode())
        digest.update(vdi.camera.model_transform.tobytes())
        for array in (vdi.offsets, vdi.front, vdi.back, vdi.color, vdi.optical_depth):
            digest.update(array.data)
        known = _digests[vdi] = digest.digest()
    return known


def common_window_size(placed: Sequence[PlacedVDI]) -> tuple[int, int]:
    """Return the size of the pictures of VDIs, all of which must have the same."""
    sizes = {one.vdi.picture_size for one in placed}
    if len(sizes) > 1:
        raise InvalidArgumentError(
            f"the VDIs have different window sizes, {sorted(sizes)}: say which the image is to "
            "have (window_size=)"
        )
    return sizes.pop()


def _each(values: Any, count: int, wanted: str, *, got: object) -> list[Any]:
    """Return a list or a tuple with one value for each VDI; anything else is refused."""
    if not isinstance(values, list | tuple) or len(values) != count:
        raise InvalidArgumentError(f"{wanted.format(count)}; got {got!r}")
    return list(values)


def _planes_of_each(planes: Any, count: int) -> list[ArrayLike | None]:
    """Return each VDI's clipping planes: the same for all, or one entry for each."""
    if planes is None:
        return [None] * count
    try:
        shape = np.shape(np.asarray(planes, dtype=np.float64))
    except (
        TypeError,
        ValueError,
        OverflowError,
    ):  # None among them, or different numbers of planes
        shape = ()
    if len(shape) == 2:
        return [planes] * count
    wanted = "clipping_planes must be (k, 6), or have such an array or None for each of the {} VDIs"
    return _each(list(planes) if np.iterable(planes) else [], count, wanted, got=planes)
