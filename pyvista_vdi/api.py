"""The public functions: a thin façade over the engine that takes VTK's and PyVista's objects too.

Converters are imported only where an argument needs them: for a :class:`Volume`, a
:class:`Camera` and a :class:`TransferFunction` neither VTK nor PyVista is loaded. More than half of
these lines document arguments, as ``help(pyvista_vdi.generate)`` is complete by itself: hence more
than 500 lines.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.checks import as_flag, check_callback
from pyvista_vdi.model.classification import BLENDINGS, DEFAULTS, IN_PLACE, Classification
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.inputs import as_vdi, as_volume
from pyvista_vdi.model.options import GenerationOptions, MediumOptions
from pyvista_vdi.model.render_options import TRANSMITTANCE_CUTOFF, FrameRequest, RenderOptions
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.quality.dial import TARGET_ANGLE, Dial, warn_missed
from pyvista_vdi.raycasting.picking import DEFAULT_OPACITY, FirstHit

if TYPE_CHECKING:
    from pyvista_vdi.generation.estimate import Estimate
    from pyvista_vdi.raycasting.picking import Pick

__all__ = ["estimate", "generate", "pick", "read", "render", "render_depth", "render_volume"]

_Function = TypeVar("_Function", bound=Callable[..., Any])


def _classified(function: _Function) -> _Function:
    """Show the classification arguments by name in the signature that ``help`` prints."""
    signature = inspect.signature(function)
    own = [p for p in signature.parameters.values() if p.kind is not p.VAR_KEYWORD]
    defaults = {**DEFAULTS, **dict.fromkeys(IN_PLACE)}
    shared = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default)
        for name, default in defaults.items()
    ]
    function.__signature__ = signature.replace(  # type: ignore[attr-defined]
        parameters=[*own, *shared]
    )
    return function


@_classified
def generate(
    volume: Any,
    camera: Any,
    window_size: Sequence[int],
    *,
    max_supersegments: int = 20,
    criterion: str = "least-error",
    sample_distance: float | None = None,
    tolerance: float = 0.0,
    view_cone: float = 60.0,
    precision: str = "exact",
    quality: str | None = None,
    target_ssim: float | None = None,
    target_fps: float | None = None,
    max_bytes: int | None = None,
    target_angle: float = TARGET_ANGLE,
    lights: Any = None,
    ambient_occlusion: Any = None,
    memory_limit: int | float | str | None = None,
    client: Any = None,
    device: Any = None,
    progress: Callable[[float], object] | None = None,
    **classification: Any,
) -> VDI:
    """Generate a VDI: cut every pixel's ray through a classified volume into supersegments.

    Parameters
    ----------
    volume : pyvista.ImageData or vtkImageData or Volume
        Scalars on a uniform grid; spacing, origin and direction matrix are honoured, cell data
        are converted as ``Plotter.add_volume`` does.
    camera : pyvista.Camera or vtkCamera or Camera
        The generating view V_O.
    window_size : (int, int)
        Width and height in pixels: lists along each edge of the viewport.
    max_supersegments : int
        Longest list, 1 to 4096. A promise: never exceeded, and nothing non-transparent is
        dropped for it.
    criterion : {"least-error", "homogeneity"}
        What decides where a list that must be shortened is cut: merging at least error, or the
        paper's threshold on differences. See
        :class:`pyvista_vdi.model.options.GenerationOptions`.
    sample_distance : float, optional
        Length of a step along the ray, model units; half the smallest spacing by default.
    tolerance : float
        Error per list that may be traded for shorter lists; 0 uses the budget.
    view_cone : float
        Half angle in degrees of the cone of new views that must be served: the wider, the more
        of the budget goes to what V_O cannot see.
    precision : {"exact", "16-byte", "8-byte"}
        What a supersegment takes on devices and in files, see :meth:`VDI.with_precision`.
    quality : {"reference", "high", "balanced", "fast"}, optional
        Choose the settings by how good pictures are to be: an SSIM of 0.98, 0.96 or 0.93 against
        volume rendering, and with the first two no squares of lists. ``"reference"`` is what is
        made where nothing is given. The dial, which is this argument and the four below, measures
        the scene on the device, once, and then chooses the lists of the window,
        ``max_supersegments`` and ``precision``, so that these and ``tolerance`` cannot be given as
        well. ``window_size`` is then that of the pictures, and the VDI's own may be smaller or
        larger. ``vdi.metadata["dial"]`` says what was chosen and what it is predicted to give;
        docs/dial.md, how well.
    target_ssim : float, optional
        The same by a number, 0 to 1, in place of ``quality``.
    target_fps : float, optional
        Least full frames per second, predicted for this device. Goes before quality.
    max_bytes : int, optional
        Most bytes of the VDI on the device; files are smaller. Goes before all others. Limits
        without a quality give the best that is within them.
    target_angle : float
        Degrees by which the view is turned from V_O for which the SSIM is predicted.
    lights : renderer, or sequence of Light, vtkLight or pyvista.Light, optional
        What a shaded volume is lit by; one headlight by default, which is VTK's. PyVista's
        plotters have a light kit: pass ``plotter.renderer`` for its lights. They are baked into
        the colours as they stand at V_O.
    ambient_occlusion : bool, float or AmbientOcclusion, optional
        Darken what is hidden from the light around it: ``True``, or the radius up to which
        something hides, model units. Baked into the colours.
    memory_limit : int, float or str, optional
        Most bytes to take on the device, or a text such as ``"2 GiB"``; by default what the device
        has. A volume that does not fit goes there brick by brick: that takes more time, and the
        VDI is the same to the last bit. See docs/performance.md, "Larger than memory". Of a chunked
        volume blocks are smaller.
    client : distributed.Client or str, optional
        Of a Dask cluster, or the address of its scheduler. Its workers make the VDI of a chunked
        volume (a :class:`Volume` of a Dask, zarr or h5py array, or of :func:`open_volume`), whose
        files all of them must find. Without it such a volume is made block by block on the local
        device. See docs/large_volumes.md.
    device : str, int or device, optional
        Where it runs; by default ``PYVISTA_VDI_DEVICE``, else the best device found.
    progress : callable, optional
        Called with the finished fraction, 0 to 1; work stops if it returns ``False``.
    **classification
        ``Plotter.add_volume``'s arguments of the same names, defaults and meaning: scalars,
        preference, clim, n_colors, opacity, cmap, flip_scalars, opacity_unit_distance,
        log_scale, shade, ambient, diffuse, specular, specular_power, blending; and
        ``interpolation`` (``"nearest"``, which is what ``add_volume`` draws, or ``"linear"``).
        In their place either ``volume_property`` (a ``vtkVolumeProperty``) or
        ``transfer_function`` (a :class:`TransferFunction`, which needs no PyVista).

    Returns
    -------
    VDI
        The supersegments of every list, with the view and what made them.

    Raises
    ------
    TypeError
        If a keyword is unknown.
    InvalidVolumeError, InvalidCameraError, InvalidArgumentError
        If an argument cannot be used.
    UnsupportedError
        If another blending mode is asked for, or what else a VDI cannot honour.
    MissingDependencyError
        If a colour map or an opacity is named and PyVista is not installed.
    NoDeviceError, DeviceMemoryError, DeviceError, KernelBuildError
        If there is no device, or it fails.
    Cancelled
        If ``progress`` returned ``False``.

    Warns
    -----
    VDIWarning
        If a target cannot be reached; the nearest is made.

    Examples
    --------
    >>> import pyvista_vdi as pvdi
    >>> from pyvista_vdi.model.standard_cases import filling_camera
    >>> volume = pvdi.examples.load_brain(as_volume=True)
    >>> camera = filling_camera(volume.bounds, (640, 360))
    >>> vdi = pvdi.generate(volume, camera, (640, 360), cmap="bone")  # doctest: +SKIP
    """
    looks = _looks(generate, classification)
    check_callback(progress)
    view = Camera.from_any(camera)
    dial = Dial.of(quality, target_ssim, target_fps, max_bytes, target_angle)
    options = GenerationOptions(
        max_supersegments=max_supersegments,
        criterion=criterion,
        sample_distance=sample_distance,
        tolerance=tolerance,
        view_cone=view_cone,
        precision=precision,
        lights=lights,
        ambient_occlusion=ambient_occlusion,
        memory_limit=memory_limit,  # type: ignore[arg-type]  # a text becomes bytes
    )
    volume = as_volume(volume, looks.scalars, looks.preference)
    metadata = {"classification": looks.describe(), "scalars": volume.name}
    from pyvista_vdi.quality.generate_anywhere import generate_anywhere

    vdi = generate_anywhere(
        volume,
        view,
        window_size,
        looks.transfer_function(volume),
        dial,
        options,
        client=client,
        device=device,
        progress=progress,
        metadata=metadata,
    )
    warn_missed(vdi)
    return vdi


def render(
    vdi: Any,
    camera: Any,
    window_size: Sequence[int] | None = None,
    *,
    opaque_depth: ArrayLike | None = None,
    clipping_planes: Any = None,
    cropping: Any = None,
    opacity_multiplier: Any = 1.0,
    model_transforms: Sequence[ArrayLike] | None = None,
    skip_empty: bool = True,
    preview_samples: int | None = None,
    transmittance_cutoff: float | None = None,
    device: Any = None,
) -> NDArray[np.float32]:
    """Raycast a VDI, or several in one scene, from a new view.

    Parameters
    ----------
    vdi : VDI or VDISet or vtkImageData, or list or tuple of them
        What :func:`generate` or :func:`read` returned, or its VTK form (``pv.read("x.vdi")``).
        A :class:`VDISet` shows what was made nearest to the view, by itself blended with what is
        about as near.
        Several are merged by depth along each ray; their order does not matter, to the last bit.
    camera : pyvista.Camera or vtkCamera or Camera
        The new view V_N. Its model transform places the VDI's model frame in the world.
    window_size : (int, int), optional
        Width and height of the image in pixels; by default those the VDI was made for,
        :attr:`VDI.picture_size`. Of several VDIs, it can be left out where all have the same.
    opaque_depth : array_like of float32, shape (H, W), optional
        Depth at which each ray ends: distance from the eye along the view direction, world
        units, top row first; infinity where nothing is opaque.
    clipping_planes : array_like of float, shape (k, 6), optional
        Origin and normal of each plane, world coordinates; the side that the normal points to
        is kept, as with VTK's mappers. They cut all of several VDIs; a list of such arrays, or of
        ``None``, cuts each by its own.
    cropping : Cropping or vtkVolumeMapper or sequence of six numbers or pair, optional
        Which of 27 regions of the data's own coordinates are drawn, as in ``vtkVolumeMapper``: a
        :class:`Cropping`, a mapper's, x_low, x_high, y_low, y_high, z_low and z_high of a box, or
        a pair of those planes and the regions (flags, or ``"fence"``, ``"cross"`` ...). For
        several VDIs a list with one of these, or ``None``, for each.
    opacity_multiplier : float, default: 1.0
        Factor of the extinction, 0 or above: 2 is twice as dense. For what is not opaque it is
        the same as dividing the opacity unit distance by it. For several VDIs one for all, or a
        list with one for each.
    model_transforms : sequence of array_like of float, shape (4, 4), optional
        Where the model frame of each of several VDIs is; the camera's model transform for all by
        default.
    skip_empty : bool, default: True
        Pass by space without supersegments; the picture is the same to the last bit.
    preview_samples : int, optional
        An approximation (paper section 5): look the VDI up at so many points of each ray instead
        of intersecting its supersegments. A smaller ``window_size`` is the better one: see
        docs/decisions/previews.md. For a single VDI only.
    transmittance_cutoff : float, optional
        A ray ends where less light than this is left, 0 to below 1; 10⁻⁶ by default. No channel
        loses more than that: 0.004 changes a picture of 8 bits by one step at most, and saves a
        fifth to two fifths of the work where things are opaque. For a single VDI only.
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
    view = Camera.from_any(camera)
    if isinstance(vdi, list | tuple) or model_transforms is not None:
        if preview_samples is not None:
            raise InvalidArgumentError(
                "preview_samples is for a single VDI: give several a smaller window_size"
            )
        if transmittance_cutoff is not None:
            raise InvalidArgumentError(
                "transmittance_cutoff is for a single VDI: leave it out for several"
            )
        from pyvista_vdi.raycasting.multi_vdi import render_vdis
        from pyvista_vdi.raycasting.placed import common_window_size, placed_vdis

        several = list(vdi) if isinstance(vdi, list | tuple) else [vdi]
        placed = placed_vdis(
            _seen_in_scene(several, view, model_transforms),
            view,
            model_transforms=model_transforms,
            clipping_planes=clipping_planes,
            cropping=cropping,
            opacity_multiplier=opacity_multiplier,
            skip_empty=skip_empty,
        )
        size = common_window_size(placed) if window_size is None else window_size
        frame = _frame(None, view, size, RenderOptions(), opaque_depth, device)
        return render_vdis(placed, frame)
    options = RenderOptions(
        clipping_planes,
        cropping,
        opacity_multiplier,
        skip_empty,
        preview_samples,
        TRANSMITTANCE_CUTOFF if transmittance_cutoff is None else transmittance_cutoff,
    )
    if _is_of_views(vdi):
        from pyvista_vdi.raycasting.blend import blended

        parts = vdi.parts(view)
        return blended(parts, _frame(vdi, view, window_size, options, opaque_depth, device))
    vdi = as_vdi(vdi)
    from pyvista_vdi.raycasting.bands import render_fitting

    return render_fitting(vdi, _frame(vdi, view, window_size, options, opaque_depth, device))


def render_depth(
    vdi: Any,
    camera: Any,
    window_size: Sequence[int] | None = None,
    *,
    opacity_threshold: float = DEFAULT_OPACITY,
    accumulated: bool = True,
    opaque_depth: ArrayLike | None = None,
    clipping_planes: ArrayLike | None = None,
    cropping: Any = None,
    opacity_multiplier: float = 1.0,
    skip_empty: bool = True,
    device: Any = None,
) -> NDArray[np.float32]:
    """Raycast a VDI for where it begins to be seen: :func:`pick` for every pixel of a view.

    Parameters
    ----------
    vdi, camera, window_size, opaque_depth, clipping_planes, cropping, opacity_multiplier
        As for :func:`render`.
    skip_empty, device
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
    seen = _seen(vdi, view)
    from pyvista_vdi.raycasting.raycast import render_first_hits

    options = RenderOptions(clipping_planes, cropping, opacity_multiplier, skip_empty)
    frame = _frame(_made_for(vdi, seen), view, window_size, options, opaque_depth, device)
    return render_first_hits(seen, frame, FirstHit.of(opacity_threshold, accumulated))


def pick(
    vdi: Any,
    camera: Any,
    pixel: Sequence[float],
    window_size: Sequence[int] | None = None,
    *,
    opacity_threshold: float = DEFAULT_OPACITY,
    accumulated: bool = True,
    opaque_depth: float | None = None,
    clipping_planes: ArrayLike | None = None,
    cropping: Any = None,
    opacity_multiplier: float = 1.0,
) -> Pick | None:
    """Return what a pixel shows of a VDI: the first supersegment that reaches an opacity.

    Parameters
    ----------
    vdi : VDI or VDISet or vtkImageData
        As for :func:`render`; of a set the hit is one of the VDI nearest to the view.
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
    clipping_planes, cropping, opacity_multiplier
        As for :func:`render`.

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
    seen = _seen(vdi, view)
    from pyvista_vdi.raycasting.picking import pick_vdi

    options = RenderOptions(clipping_planes, cropping, opacity_multiplier)
    frame = _frame(_made_for(vdi, seen), view, window_size, options, opaque_depth)
    return pick_vdi(seen, frame, pixel, FirstHit.of(opacity_threshold, accumulated))


@_classified
def render_volume(
    volume: Any,
    camera: Any,
    window_size: Sequence[int],
    *,
    sample_distance: float | None = None,
    opaque_depth: ArrayLike | None = None,
    clipping_planes: ArrayLike | None = None,
    cropping: Any = None,
    opacity_multiplier: float = 1.0,
    early_termination: bool = True,
    skip_empty: bool = True,
    lights: Any = None,
    ambient_occlusion: Any = None,
    memory_limit: int | float | str | None = None,
    device: Any = None,
    **classification: Any,
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
    sample_distance : float, optional
        Length of a step along the ray, model units; half the smallest spacing by default.
    opaque_depth, clipping_planes, cropping, opacity_multiplier
        As for :func:`render`.
    early_termination : bool
        Stop a ray where what is behind can no longer be seen.
    skip_empty : bool, default: True
        Pass by blocks of the volume that are transparent; the picture is the same to the last bit.
    lights : renderer, or sequence of Light, vtkLight or pyvista.Light, optional
        As for :func:`generate`; lights that move with the camera are those of this view.
    ambient_occlusion : bool, float or AmbientOcclusion, optional
        As for :func:`generate`.
    memory_limit : int, float or str, optional
        As for :func:`generate`; the picture is the same to the last bit.
    device : str, int or device, optional
        Where it runs; by default ``PYVISTA_VDI_DEVICE``, else the best device found.
    **classification
        As for :func:`generate`, and ``blending="maximum"``, ``"minimum"``, ``"average"`` and
        ``"additive"``, as in ``add_volume``: the greatest or the least scalar along a ray is
        classified; or opacity times scalar, which is 0 to 1 over the volume's range, is averaged
        or integrated over opacity unit distances, as a grey value.

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
        If ``blending`` does not go with another argument, or for what else cannot be honoured.
    MissingDependencyError
        If a colour map or an opacity is named and PyVista is not installed.
    NoDeviceError, DeviceMemoryError, DeviceError, KernelBuildError
        If there is no device, or it fails.
    """
    looks = _looks(render_volume, classification, BLENDINGS)
    view = Camera.from_any(camera)
    volume = as_volume(volume, looks.scalars, looks.preference)
    cutoff = TRANSMITTANCE_CUTOFF if as_flag(early_termination, "early_termination") else 0.0
    options = RenderOptions(
        clipping_planes, cropping, opacity_multiplier, skip_empty, transmittance_cutoff=cutoff
    )
    transfer_function = looks.transfer_function(volume)
    request = _frame(None, view, window_size, options, opaque_depth, device)
    sampling = MediumOptions(
        sample_distance=sample_distance,
        lights=lights,
        ambient_occlusion=ambient_occlusion,
        memory_limit=memory_limit,  # type: ignore[arg-type]  # a text becomes bytes
    )
    if looks.blending != BLENDINGS[0]:
        from pyvista_vdi.volume.project import project_volume

        return project_volume(volume, transfer_function, request, looks.blending, sampling)
    from pyvista_vdi.volume.render import raycast_volume

    return raycast_volume(volume, transfer_function, request, sampling)


def read(path: str | os.PathLike[str], **options: Any) -> Any:
    """Read a VDI from a file that :meth:`VDI.save` or VTK wrote, or any deep OpenEXR image.

    Or a series or a set of them.

    Parameters
    ----------
    path : path-like
        A ``.vdi`` file, an OpenEXR deep image, whose name ends in ``.exr``, or a VDI's VTK form
        in one of VTK's image files, ``.vti``, or a page with a VDI in it, ``.html``. Or the series
        in a ``.vdis`` file, or the set in a ``.vdiset`` file, whose VDIs are read when they are
        asked for.
    **options
        For ``.exr`` files of other programs: ``camera``, the view that the image shows, where
        the file does not say it; ``thickness``, world units, given to samples that have none
        (surfaces); ``linear``, whether the colours are linear light. For all files ``progress``,
        called with the finished fraction, 0 to 1.

    Returns
    -------
    VDI or VDISeries or VDISet
        The same to the last bit if this package wrote the file; what is lost with other programs'
        files is said in the documentation of files.

    Raises
    ------
    VDIFileError
        If the file is absent, foreign, of a newer version, truncated or damaged; the message
        says which.
    InvalidArgumentError
        If an option is not one of the file's format.

    Warns
    -----
    VDIWarning
        If an ``.exr`` file of ours was changed by another program, or has colours outside 0 to 1.
    """
    from pyvista_vdi.io import read as read_file

    return read_file(path, **options)


@_classified
def estimate(
    volume: Any,
    window_size: Sequence[int],
    *,
    max_supersegments: int = 20,
    criterion: str = "least-error",
    ambient_occlusion: Any = None,
    memory_limit: int | float | str | None = None,
    device: Any = None,
    **classification: Any,
) -> Estimate:
    """Return how much memory generating a VDI takes, before it is taken.

    Parameters
    ----------
    volume : pyvista.ImageData or vtkImageData or Volume
        What the VDI would be made of.
    window_size : (int, int)
        Width and height in pixels.
    max_supersegments : int
        Longest list.
    criterion : {"least-error", "homogeneity"}
        As for :func:`generate`.
    ambient_occlusion : bool, float or AmbientOcclusion, optional
        As for :func:`generate`.
    memory_limit : int, float or str, optional
        As for :func:`generate`; the volume's share is then what is left of it.
    device : str, optional
        As for :func:`generate`: a GPU makes more of a VDI at a time.
    **classification
        As for :func:`generate`: scalars whose range is narrow for how far it is from 0 take four
        bytes each.

    Returns
    -------
    Estimate
        Bytes of the volume, of the VDI at worst, of the working buffers, and their sum.

    Raises
    ------
    InvalidVolumeError, InvalidArgumentError
        If an argument cannot be used.
    NoDeviceError
        If there is no usable device, or not the one that was asked for.
    """
    looks = _looks(estimate, classification)
    volume = as_volume(volume, looks.scalars, looks.preference)
    from pyvista_vdi.generation.estimate import estimate as estimate_bytes

    return estimate_bytes(
        volume,
        window_size,
        max_supersegments=max_supersegments,
        criterion=criterion,
        ambient_occlusion=ambient_occlusion,
        memory_limit=memory_limit,
        transfer_function=looks.transfer_function(volume),
        device=device,
    )


def _is_of_views(vdi: Any) -> bool:
    """Whether these are VDIs of several views, among which a picture's view chooses."""
    return isinstance(vdi, VDICollection) and vdi.times is None


def _seen(vdi: Any, view: Camera) -> VDI:
    """Return what a user calls a VDI as one: of a set that which is nearest to the view."""
    return vdi[vdi.nearest(view)] if _is_of_views(vdi) else as_vdi(vdi)


def _seen_in_scene(
    vdis: Sequence[Any], view: Camera, model_transforms: Sequence[ArrayLike] | None
) -> list[VDI]:
    """Return the VDIs of a scene, each seen where its model transform places it."""
    given = list(model_transforms) if np.iterable(model_transforms) else ()
    if model_transforms is None or len(given) != len(vdis):  # refused where it is used
        return [_seen(vdi, view) for vdi in vdis]
    return [
        _seen(vdi, view.replace(model_transform=placed)) if _is_of_views(vdi) else as_vdi(vdi)
        for vdi, placed in zip(vdis, given, strict=True)
    ]


def _made_for(vdi: Any, seen: VDI) -> Any:
    """Return what knows the size of pictures: the set, where there is one."""
    return vdi if _is_of_views(vdi) else seen


def _frame(
    vdi: Any,
    camera: Camera,
    window_size: Sequence[int] | None,
    options: RenderOptions,
    opaque_depth: ArrayLike | None,
    device: Any = None,
) -> FrameRequest:
    """Return the request of a frame, by default of the size that a VDI was made for."""
    size: Any = window_size if vdi is None or window_size is not None else vdi.picture_size
    return FrameRequest(camera, size, options, opaque_depth, device)


def _looks(
    function: Callable[..., Any], given: dict[str, Any], blendings: Sequence[str] = BLENDINGS[:1]
) -> Classification:
    """Return the classification arguments of a call, checked."""
    names = tuple(inspect.signature(function).parameters)
    return Classification(given, function.__name__, names, blendings)
