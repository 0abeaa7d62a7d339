"""Raycast a VDI, several, or a volume, and pick: the public functions that make pictures."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

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
from pyvista_vdi.model.types import CameraLike, DeviceLike, ShownLike, VolumeLike, WindowSize
from pyvista_vdi.model.vdi import VDI, DeferredVDI
from pyvista_vdi.raycasting.picking import DEFAULT_OPACITY, FirstHit

if TYPE_CHECKING:
    from pyvista_vdi.raycasting.picking import Pick


#: Options of pictures of one VDI.
_OF_ONE = ("preview_samples", "transmittance_cutoff")


class _OfSeveral(RenderOptions):
    """Options of one VDI or, some of them, lists for several: what takes them checks them."""

    def __post_init__(self) -> None:
        """Keep them as they are given."""


@takes(
    options=_OfSeveral,
    kinds={
        "clipping_planes": "ArrayLike | Sequence[ArrayLike | None] | None",
        "opacity_multiplier": "float | Sequence[float]",
    },
)
def render(
    vdi: ShownLike | Sequence[ShownLike],
    camera: CameraLike,
    options: _OfSeveral,
    window_size: WindowSize | None = None,
    *,
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
    camera : pyvista.Camera or vtkCamera or Camera, or (position, focal point, view up)
        The new view V_N. Its model transform places the VDI's model frame in the world.
    window_size : (int, int), optional
        Width and height of the image in pixels; by default those the VDI was made for,
        :attr:`VDI.picture_size`. Of several VDIs, it can be left out where all have the same.
    opaque_depth : array_like of float32, shape (H, W), optional
        Depth at which each ray ends: distance from the eye along the view direction, world
        units, top row first; infinity where nothing is opaque.
    model_transforms : sequence of array_like of float, shape (4, 4), optional
        Where the model frame of each of several VDIs is; the camera's model transform for all by
        default.
    device : str, int or device, optional
        Where it runs; by default ``PYVISTA_VDI_DEVICE``, else the best device found.

    Returns
    -------
    numpy.ndarray
        float32 (H, W, 4), premultiplied RGBA, top row first, no background blended in.

    Raises
    ------
    InvalidVDIError, InvalidCameraError, InvalidArgumentError
        If an argument cannot be used.
    NoDeviceError, DeviceMemoryError, DeviceError, KernelBuildError
        If there is no device, or it fails.
    """
    view, several = Camera.from_any(camera), isinstance(vdi, list | tuple)
    shown: list[Any] = list(vdi) if isinstance(vdi, list | tuple) else [vdi]
    ends = {each.value_range for each in shown if getattr(each, "value_range", None)}
    if look and not ends:
        refuse_unknown(look, "render", inspect.signature(render).parameters)
    # Have a value look the same in all of them: what is not said is of all their ranges
    if look and len(ends) > 1 and not look.keys() & {"clim", *IN_PLACE}:
        look["clim"] = (min(low for low, _ in ends), max(high for _, high in ends))
    for number, each in enumerate(shown if look else ()):
        if getattr(each, "value_range", None):
            shown[number] = each.classified(**look, device=device)
    if several or model_transforms is not None:
        for name in options.given.keys() & {*_OF_ONE}:
            raise InvalidArgumentError(f"{name} is for a single VDI: leave it out for several")
        from pyvista_vdi.raycasting.multi_vdi import common_window_size, placed_vdis, render_vdis

        # Of sets take what is nearest to the view from where they are placed
        given = list(model_transforms) if np.iterable(model_transforms) else []
        views = [view] * len(shown)
        for number, matrix in enumerate(given if len(given) == len(shown) else ()):
            if _is_of_views(shown[number]):
                views[number] = view.replace(model_transform=matrix)
        seen = [_seen(each, place) for each, place in zip(shown, views, strict=True)]
        planes, factors = options.clipping_planes, options.opacity_multiplier
        placed = placed_vdis(seen, view, model_transforms, planes, options.cropping, factors)
        size: Any = common_window_size(placed) if window_size is None else window_size
        return render_vdis(placed, FrameRequest(view, size, RenderOptions(), opaque_depth, device))
    one: Any = shown[0] if _is_of_views(shown[0]) else as_vdi(shown[0])
    size = one.picture_size if window_size is None else window_size
    request = FrameRequest(view, size, RenderOptions(**vars(options)), opaque_depth, device)
    if _is_of_views(one):
        from pyvista_vdi.raycasting.multi_vdi import blended

        return blended([(as_vdi(part), weight) for part, weight in one.parts(view)], request)
    from pyvista_vdi.raycasting.raycast import render_vdi

    return render_vdi(one, request)


@takes(options=RenderOptions, without=_OF_ONE)
def render_depth(
    vdi: ShownLike,
    camera: CameraLike,
    options: RenderOptions,
    window_size: WindowSize | None = None,
    *,
    opacity_threshold: float = DEFAULT_OPACITY,
    accumulated: bool = True,
    opaque_depth: ArrayLike | None = None,
    device: DeviceLike | None = None,
    **look: Any,
) -> NDArray[np.float32]:
    """Raycast a VDI for where it begins to be seen: :func:`pick` for every pixel of a view.

    Parameters
    ----------
    vdi, camera, window_size, opaque_depth, device
        As for :func:`render`.
    opacity_threshold, accumulated
        What counts as a hit: as for :func:`pick`.

    Returns
    -------
    numpy.ndarray
        View depth of each pixel's hit, float32 (H, W), world units, top row first; infinite where
        nothing is hit. It can be passed as another :func:`render`'s ``opaque_depth``.

    Raises
    ------
    InvalidVDIError, InvalidCameraError, InvalidArgumentError
        If an argument cannot be used.
    NoDeviceError, DeviceMemoryError, DeviceError, KernelBuildError
        If there is no device, or it fails.
    """
    view = Camera.from_any(camera)
    shown: Any = vdi
    if look and getattr(vdi, "value_range", None):
        shown = shown.classified(**look, device=device)
    elif look:
        refuse_unknown(look, "render_depth", inspect.signature(render_depth).parameters)
    seen = _seen(shown, view)
    usual = getattr(shown, "picture_size", seen.picture_size)
    size: Any = usual if window_size is None else window_size
    request = FrameRequest(view, size, options, opaque_depth, device)
    from pyvista_vdi.raycasting.raycast import render_first_hits

    return render_first_hits(seen, request, FirstHit.of(opacity_threshold, accumulated))


@takes(options=RenderOptions, without=_OF_ONE)
def pick(
    vdi: ShownLike,
    camera: CameraLike,
    pixel: Sequence[float],
    options: RenderOptions,
    window_size: WindowSize | None = None,
    *,
    opacity_threshold: float = DEFAULT_OPACITY,
    accumulated: bool = True,
    opaque_depth: float | None = None,
    **look: Any,
) -> Pick | None:
    """Return what a pixel shows of a VDI: the first supersegment that reaches an opacity.

    Parameters
    ----------
    vdi : VDI or VDISet or vtkImageData
        As for :func:`render`; of a set the hit is one of the VDI nearest to the view. Of a
        :class:`DeferredVDI`, with the words of its look, the hit has a value.
    camera : pyvista.Camera or vtkCamera or Camera
        The view. Its model transform places the VDI's model frame in the world.
    pixel : (float, float)
        x and y in pixels, VTK's display coordinates: whole numbers are pixels' centres and y = 0
        is the bottom row, so that pixel (x, y) is ``image[height - 1 - y, x]`` of a picture.
    window_size : (int, int), optional
        Width and height of the view in pixels; :attr:`VDI.picture_size` by default.
    opacity_threshold : float
        Opacity that the hit has to reach, at least 0 and less than 1; the default is that of
        VTK's pickers for volumes. With 0, whatever absorbs light at all is hit.
    accumulated : bool, default: True
        Compare the opacity of the ray from its beginning, 1 - exp(-(tau_0 + ... + tau_k)): the hit
        is the first supersegment with which the ray has become as opaque as that. ``False``
        compares each supersegment's own, 1 - exp(-tau_k) over the length that the ray crosses
        of it, and looks through haze; but it depends on how finely the lists are cut, and where
        the ray runs across the lists, it crosses little of each.
    opaque_depth : float, optional
        View depth at which the ray ends, world units.

    Returns
    -------
    Pick or None
        The supersegment, and where the ray enters it; ``None`` where nothing is hit.

    Raises
    ------
    InvalidVDIError, InvalidCameraError, InvalidArgumentError
        If an argument cannot be used.

    Notes
    -----
    A single ray, walked in float64 on the host: no device is needed.
    """
    view = Camera.from_any(camera)
    near: Any = vdi[vdi.nearest(view)] if isinstance(vdi, VDICollection) and look else vdi
    kept = near if isinstance(near, DeferredVDI) else None
    if kept is not None and look:
        near = kept.classified(**look)
    elif look:
        refuse_unknown(look, "pick", inspect.signature(pick).parameters)
    seen = _seen(near, view)
    usual = getattr(vdi, "picture_size", seen.picture_size)
    size: Any = usual if window_size is None else window_size
    from pyvista_vdi.raycasting.picking import pick_vdi

    request = FrameRequest(view, size, options, opaque_depth)
    return pick_vdi(seen, request, pixel, FirstHit.of(opacity_threshold, accumulated), kept)


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
    volume : pyvista.ImageData or vtkImageData or Volume
        As for :func:`generate`.
    camera : pyvista.Camera or vtkCamera or Camera
        The view.
    window_size : (int, int)
        Width and height in pixels.
    opaque_depth : array_like of float32, shape (H, W), optional
        As for :func:`render`.
    early_termination : bool
        Stop a ray where what is behind can no longer be seen.
    device : str, int or device, optional
        Where it runs; by default ``PYVISTA_VDI_DEVICE``, else the best device found.

    Returns
    -------
    numpy.ndarray
        float32 (H, W, 4), premultiplied RGBA, top row first, no background blended in.

    Raises
    ------
    TypeError
        If a keyword is unknown.
    InvalidVolumeError, InvalidCameraError, InvalidArgumentError
        If an argument cannot be used.
    UnsupportedError
        If another blending mode is asked for, or what else cannot be honoured.
    MissingDependencyError
        If a colour map or an opacity is named and PyVista is not installed.
    NoDeviceError, DeviceMemoryError, DeviceError, KernelBuildError
        If there is no device, or it fails.
    """
    view, read = Camera.from_any(camera), as_volume(volume, look.scalars, look.preference)
    if not as_flag(early_termination, "early_termination"):
        options = options.replace(transmittance_cutoff=0.0)
    table = look.transfer_function_of(read)
    size: Any = window_size
    request = FrameRequest(view, size, options, opaque_depth, device)
    from pyvista_vdi.volume.render import raycast_volume

    return raycast_volume(read, table, request, medium)


def _is_of_views(vdi: Any) -> bool:
    """Whether these are VDIs of several views, among which a picture's view chooses."""
    return isinstance(vdi, VDICollection) and vdi.times is None


def _seen(vdi: Any, view: Camera) -> VDI:
    """Return the VDI that is shown: of a set that which is nearest to the view."""
    return vdi[vdi.nearest(view)] if _is_of_views(vdi) else as_vdi(vdi)
