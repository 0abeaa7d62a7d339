"""Raycast a VDI, several, or a volume, and pick: the public functions that make pictures."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.arguments import refuse_unknown, takes
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.checks import as_flag
from pyvista_vdi.model.classification import IN_PLACE, Classification
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.inputs import as_vdi, as_volume
from pyvista_vdi.model.options import FrameRequest, MediumOptions, RenderOptions
from pyvista_vdi.model.types import (
    CameraLike,
    CroppingLike,
    DeviceLike,
    ShownLike,
    VolumeLike,
    WindowSize,
)
from pyvista_vdi.model.vdi import DeferredVDI
from pyvista_vdi.raycasting.picking import FirstHit, Pick, pick_vdi

#: Options of pictures of one VDI.
_OF_ONE = ("preview_samples", "transmittance_cutoff")


@takes(options=RenderOptions)
def render(
    vdi: ShownLike | Sequence[ShownLike],
    camera: CameraLike,
    options: RenderOptions,
    window_size: WindowSize | None = None,
    *,
    clipping_planes: ArrayLike | Sequence[ArrayLike | None] | None = None,
    cropping: CroppingLike | None = None,
    opacity_multiplier: float | Sequence[float] = RenderOptions.opacity_multiplier,
    opaque_depth: ArrayLike | None = None,
    model_transforms: Sequence[ArrayLike] | None = None,
    device: DeviceLike | None = None,
    **look: Any,
) -> NDArray[np.float32]:
    """Raycast a VDI, or several in one scene, from a new view.

    Parameters
    ----------
    vdi : VDI or VDISet or vtkImageData, or list or tuple of them
        What :func:`generate` or :func:`read` returned, or its VTK form (``pv.read("x.vdi")``).
        A :class:`VDISet` shows what was made nearest to the view, by itself blended with what is
        about as near.
        Several are merged by depth along each ray; their order does not matter, to the last bit.
        ``clipping_planes`` cut all of them, or each its own in a list of such arrays, ``None`` for
        none; ``cropping`` is then a list with an entry for each, ``opacity_multiplier`` may be.
        A :class:`DeferredVDI`, or a set of such, takes the words of
        :meth:`DeferredVDI.classified` (``cmap``, ``opacity``, ``clim`` ...) as well; of several,
        those that keep values take them.
    model_transforms : sequence of array_like of float, shape (4, 4), optional
        Where the model frame of each of several VDIs is; the camera's model transform for all by
        default.

    Returns
    -------
    numpy.ndarray
        float32 (H, W, 4), premultiplied RGBA, top row first, no background blended in.
    """
    view = Camera.from_any(camera)
    shown: list[Any] = list(vdi) if isinstance(vdi, list | tuple) else [vdi]
    if look:
        shown = _with_look(shown, look, render, device=device)
    if isinstance(vdi, list | tuple) or model_transforms is not None:
        for name in options.given:
            raise InvalidArgumentError(f"{name} is for a single VDI: leave it out for several")
        from pyvista_vdi.raycasting.multi_vdi import common_window_size, placed_vdis, render_vdis

        # Of sets take what is nearest to the view from where they are placed
        given = list(model_transforms) if np.iterable(model_transforms) else []
        views = [view] * len(shown)
        for number, matrix in enumerate(given if len(given) == len(shown) else ()):
            if _is_of_views(shown[number]):
                views[number] = view.replace(model_transform=matrix)
        seen = [_in_view(each, place)[0] for each, place in zip(shown, views, strict=True)]
        of_each = clipping_planes, cropping, opacity_multiplier
        placed = placed_vdis(seen, view, model_transforms, *of_each)
        size: Any = common_window_size(placed) if window_size is None else window_size
        return render_vdis(placed, FrameRequest(view, size, RenderOptions(), opaque_depth, device))
    options = options.replace(
        clipping_planes=clipping_planes, cropping=cropping, opacity_multiplier=opacity_multiplier
    )
    one: Any = shown[0] if _is_of_views(shown[0]) else as_vdi(shown[0])
    size = one.picture_size if window_size is None else window_size
    request = FrameRequest(view, size, options, opaque_depth, device)
    if _is_of_views(one):
        from pyvista_vdi.raycasting.multi_vdi import blended

        return blended([(as_vdi(part), weight) for part, weight in one.parts(view)], request)
    from pyvista_vdi.raycasting.raycast import render_vdi

    return render_vdi(one, request)


@takes(options=RenderOptions, hit=FirstHit, without=_OF_ONE)
def render_depth(
    vdi: ShownLike,
    camera: CameraLike,
    options: RenderOptions,
    hit: FirstHit,
    window_size: WindowSize | None = None,
    *,
    opaque_depth: ArrayLike | None = None,
    device: DeviceLike | None = None,
    **look: Any,
) -> NDArray[np.float32]:
    """Raycast a VDI for where it begins to be seen: :func:`pick` for every pixel of a view.

    Parameters
    ----------
    vdi : VDI or VDISet or vtkImageData
        As for :func:`render`.

    Returns
    -------
    numpy.ndarray
        View depth of each pixel's hit, float32 (H, W), world units, top row first; infinite where
        nothing is hit. It can be passed as another :func:`render`'s ``opaque_depth``.
    """
    view = Camera.from_any(camera)
    (shown,) = _with_look([vdi], look, render_depth, device=device) if look else [vdi]
    seen, usual = _in_view(shown, view)
    size: Any = usual if window_size is None else window_size
    request = FrameRequest(view, size, options, opaque_depth, device)
    from pyvista_vdi.raycasting.raycast import render_first_hits

    return render_first_hits(seen, request, hit)


@takes(options=RenderOptions, hit=FirstHit, without=_OF_ONE)
def pick(
    vdi: ShownLike,
    camera: CameraLike,
    pixel: Sequence[float],
    options: RenderOptions,
    hit: FirstHit,
    window_size: WindowSize | None = None,
    *,
    opaque_depth: float | None = None,
    **look: Any,
) -> Pick | None:
    """Return what a pixel shows of a VDI: the first supersegment that reaches an opacity.

    Parameters
    ----------
    vdi : VDI or VDISet or vtkImageData
        As for :func:`render`; of a set the hit is one of the VDI nearest to the view. Of a
        :class:`DeferredVDI`, with the words of its look, the hit has a value.
    pixel : (float, float)
        x and y in pixels, VTK's display coordinates: whole numbers are pixels' centres and y = 0
        is the bottom row, so that pixel (x, y) is ``image[height - 1 - y, x]`` of a picture.
    opaque_depth : float, optional
        View depth at which the ray ends, world units.

    Returns
    -------
    Pick or None
        The supersegment, and where the ray enters it; ``None`` where nothing is hit.

    Notes
    -----
    A single ray, walked in float64 on the host: no device is needed.
    """
    view = Camera.from_any(camera)
    (shown,) = _with_look([vdi], look, pick) if look else [vdi]
    seen, usual = _in_view(shown, view)
    size: Any = usual if window_size is None else window_size
    stored = vdi[vdi.nearest(view)] if isinstance(vdi, VDICollection) and look else vdi
    kept = stored if isinstance(stored, DeferredVDI) else None
    request = FrameRequest(view, size, options, opaque_depth)
    return pick_vdi(seen, request, pixel, hit, kept)


@takes(look=Classification, medium=MediumOptions, options=RenderOptions, without=_OF_ONE)
def render_volume(
    volume: VolumeLike,
    camera: CameraLike,
    window_size: WindowSize,
    look: Classification,
    medium: MediumOptions,
    options: RenderOptions,
    *,
    opaque_depth: ArrayLike | None = None,
    early_termination: bool = True,
    device: DeviceLike | None = None,
) -> NDArray[np.float32]:
    """Raycast the volume itself: direct volume rendering, the baseline of a VDI.

    Parameters
    ----------
    early_termination : bool
        Stop a ray where what is behind can no longer be seen.

    Returns
    -------
    numpy.ndarray
        float32 (H, W, 4), premultiplied RGBA, top row first, no background blended in.
    """
    view, read = Camera.from_any(camera), as_volume(volume, look.scalars, look.preference)
    if not as_flag(early_termination, "early_termination"):
        options = options.replace(transmittance_cutoff=0.0)
    table = look.transfer_function_of(read)
    size: Any = window_size
    request = FrameRequest(view, size, options, opaque_depth, device)
    from pyvista_vdi.volume.render import raycast_volume

    return raycast_volume(read, table, request, medium)


def _with_look(
    shown: list[Any], look: dict[str, Any], function: Callable[..., Any], **where: Any
) -> list[Any]:
    """Return what is shown, with a look where it stores scalars; refused where nothing does."""
    ends = {each.value_range for each in shown if getattr(each, "value_range", None)}
    if not ends:
        refuse_unknown(look, function.__name__, inspect.signature(function).parameters)
    # Have a value look the same in all of them: what is not said is of all their ranges
    if len(ends) > 1 and not look.keys() & {"clim", *IN_PLACE}:
        look["clim"] = (min(low for low, _ in ends), max(high for _, high in ends))
    return [
        each.classified(**look, **where) if getattr(each, "value_range", None) else each
        for each in shown
    ]


def _is_of_views(vdi: Any) -> bool:
    """Whether these are VDIs of several views, among which a picture's view chooses."""
    return isinstance(vdi, VDICollection) and vdi.times is None


def _in_view(shown: Any, view: Camera) -> tuple[Any, Any]:
    """Return the VDI that is shown, of a set that nearest to the view, and the picture's size."""
    seen = as_vdi(shown[shown.nearest(view)] if _is_of_views(shown) else shown)
    return seen, getattr(shown, "picture_size", seen.picture_size)
