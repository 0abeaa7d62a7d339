"""Generate a VDI, say what that takes, and read one: the public functions that need no picture."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, NoReturn

from numpy.typing import ArrayLike

from pyvista_vdi.errors import warn_external
from pyvista_vdi.model.classification import Classification, refuse_keywords
from pyvista_vdi.model.inputs import as_volume
from pyvista_vdi.model.levels import nearest_depth
from pyvista_vdi.model.options import Deferral, GenerationOptions, GenerationRequest, QualityTarget
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.types import (
    CameraLike,
    ClientLike,
    ColorMapLike,
    DeviceLike,
    LightsLike,
    MemoryLike,
    OcclusionLike,
    OpacityLike,
    Progress,
    RangeLike,
    ScalarsLike,
    VolumeLike,
    VTKObject,
    WindowSize,
)
from pyvista_vdi.model.vdi import VDI

if TYPE_CHECKING:
    from pyvista_vdi.generation.slices import Estimate


def generate(
    volume: VolumeLike,
    camera: CameraLike,
    window_size: WindowSize,
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
    max_bytes: float | None = None,
    target_angle: float = 30.0,
    lights: LightsLike | None = None,
    ambient_occlusion: OcclusionLike | None = None,
    memory_limit: MemoryLike | None = None,
    client: ClientLike | None = None,
    device: DeviceLike | None = None,
    progress: Progress | None = None,
    scalars: ScalarsLike | None = None,
    preference: str = "point",
    clim: RangeLike | None = None,
    n_colors: int = 256,
    opacity: OpacityLike = "linear",
    cmap: ColorMapLike | None = None,
    flip_scalars: bool = False,
    opacity_unit_distance: float | None = None,
    log_scale: bool = False,
    shade: bool = False,
    ambient: float | None = None,
    diffuse: float | None = 0.7,
    specular: float | None = 0.2,
    specular_power: float | None = 10.0,
    blending: str = "composite",
    interpolation: str = "nearest",
    volume_property: VTKObject | None = None,
    transfer_function: TransferFunction | None = None,
    classification: str = "baked",
    value_range: RangeLike | None = None,
    importance: ArrayLike | None = None,
    **unknown: NoReturn,
) -> VDI:
    """Generate a VDI: cut every pixel's ray through a classified volume into supersegments.

    Parameters
    ----------
    volume : pyvista.ImageData or vtkImageData or Volume
        Scalars on a uniform grid; spacing, origin and direction matrix are honoured, cell data
        are converted as ``Plotter.add_volume`` does.
    camera : pyvista.Camera or vtkCamera or Camera, or (position, focal point, view up)
        The generating view V_O.
    window_size : (int, int)
        Width and height in pixels: lists along each edge of the viewport.
    max_supersegments : int
        Longest list, 1 to 4096. A promise: never exceeded, and nothing non-transparent is
        dropped for it.
    criterion : {"least-error", "homogeneity"}
        What decides where a list that must be shortened is cut: merging where the error is least,
        or the paper's threshold on differences. See
        :class:`pyvista_vdi.model.options.GenerationOptions`.
    sample_distance : float, optional
        Length of a step along a ray, model units; half the smallest spacing by default.
    tolerance : float
        Error that may be traded for shorter lists, per list; 0 uses the budget.
    view_cone : float
        Half angle of the cone of new views that must be served, degrees: the wider, the more of
        the budget goes to what V_O cannot see.
    precision : {"exact", "8-byte"}
        What a supersegment takes on devices and in files, see :meth:`VDI.with_precision`.
    quality : {"reference", "high", "balanced", "fast"}, optional
        Choose the settings by how good pictures are to be: an SSIM of 0.98, 0.96 or 0.93 against
        volume rendering, and with the first two no squares of lists. ``"reference"`` is what is
        made where nothing is given. This argument and the four below have
        the scene measured on the device, once, and then choose the lists of the window,
        ``max_supersegments`` and ``precision``, so that these and ``tolerance`` cannot be given as
        well. ``window_size`` is then that of the pictures, and the VDI's own may be smaller or
        larger. ``vdi.metadata["dial"]`` says what was chosen and what it is predicted to give;
        docs/dial.md, how well.
    target_ssim : float, optional
        The same by a number, 0 to 1, in place of ``quality``.
    target_fps : float, optional
        Least full frames per second, predicted for this device. Goes before quality.
    max_bytes : int, optional
        Most bytes of the VDI on the device, not of files. Goes before all others. Limits
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
        Most memory to take on the device: bytes, or a text such as ``"2 GiB"``; by default what
        the device has. A volume that does not fit goes there brick by brick: that takes more time,
        and the VDI is the same to the last bit. See docs/performance.md, "Larger than memory". Of
        a chunked volume blocks are smaller.
    client : distributed.Client or str, optional
        Of a Dask cluster, or the address of its scheduler. Its workers make the VDI of a chunked
        volume (a :class:`Volume` of a Dask, zarr or h5py array, or of :func:`open_volume`), whose
        files all of them must find. Without it such a volume is made block by block on the local
        device. See docs/large_volumes.md.
    device : str, int or device, optional
        Where it runs; by default ``PYVISTA_VDI_DEVICE``, else the best device found.
    progress : callable, optional
        Called with the finished fraction, 0 to 1; work stops if it returns ``False``.
    scalars, preference, clim, n_colors, opacity, cmap, flip_scalars, opacity_unit_distance
        As in ``Plotter.add_volume``: names, defaults and meaning.
    log_scale, shade, ambient, diffuse, specular, specular_power, blending
        Likewise; of a VDI ``blending`` is ``"composite"``.
    interpolation : {"nearest", "linear"}
        Between voxels; ``add_volume`` draws ``"nearest"``.
    volume_property : vtkVolumeProperty, optional
        In place of the others, as it is.
    transfer_function : TransferFunction, optional
        In place of the others; it needs no PyVista.
    classification : {"baked", "deferred"}
        When scalars are classified: as the VDI is made, or by whoever shows it. A deferred one
        keeps values in place of colours, is a :class:`DeferredVDI`, and ``classified(cmap=...,
        opacity=...)`` makes a VDI of it, without the volume: docs/deferred.md. Of the look it takes
        ``interpolation`` only.
    value_range : (float, float), optional
        Least and largest scalar to keep, where deferred; all by default. What is outside is empty.
    importance : array_like of float, optional
        How much errors count over the range, where deferred: points (scalar, weight), or weights
        at equal distances over ``value_range``; 1 by default. Scalars of weight 0 are empty.

    Returns
    -------
    VDI or DeferredVDI
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
        If a target cannot be reached (the nearest is made), or the camera sees no volume.

    Examples
    --------
    >>> import pyvista_vdi as pvdi
    >>> from pyvista_vdi.model.standard_cases import filling_camera
    >>> volume = pvdi.examples.load_brain(as_volume=True)
    >>> camera = filling_camera(volume.bounds, (640, 360))
    >>> vdi = pvdi.generate(volume, camera, (640, 360), cmap="bone")  # doctest: +SKIP
    """
    refuse_keywords(unknown, generate)
    # Records are made of their fields in order: one that is put between others shifts what follows
    # here and in plotting/component.py, which tests/api/test_options.py finds
    look = Classification.checked(
        *(scalars, preference, blending, clim, n_colors, opacity, cmap, flip_scalars),
        *(opacity_unit_distance, log_scale, shade, ambient, diffuse, specular, specular_power),
        *(interpolation, volume_property, transfer_function),
    )
    look.require_composite()
    deferral = Deferral.checked(classification, value_range, importance)
    target = QualityTarget.checked(quality, target_ssim, target_fps, max_bytes, target_angle)
    options = GenerationOptions.checked(
        *(sample_distance, lights, ambient_occlusion, memory_limit),
        *(max_supersegments, criterion, tolerance, view_cone, precision),
    )
    read = as_volume(volume, scalars, preference)
    if deferral.deferred:
        look.require_no_look()
        deferral.refuse_target(target)
    from pyvista_vdi.generation.deferred import generate_deferred, unclassified, warn_of_range

    request = GenerationRequest(
        volume=read,
        transfer_function=(
            unclassified(interpolation) if deferral.deferred else look.transfer_function_of(read)
        ),
        camera=camera,  # type: ignore[arg-type]  # which it checks
        window_size=window_size,  # type: ignore[arg-type]  # likewise
        options=options,
        device=device,
        progress=progress,
        metadata={"classification": look.describe(), "scalars": read.name},
    )
    from pyvista_vdi.quality.dial import warn_missed
    from pyvista_vdi.quality.probe import generate_anywhere

    vdi: Any
    if deferral.deferred:
        vdi = generate_deferred(request, deferral, lambda it: generate_anywhere(it, target, client))
        warn_of_range(vdi, read)
    else:
        vdi = generate_anywhere(request, target, client)
    warn_missed(vdi)
    if not vdi.n_supersegments and nearest_depth(read, request.camera, request.window_size) is None:
        warn_external(f"the VDI is empty: the camera sees nothing of the bounds {read.bounds}")
    return vdi  # type: ignore[no-any-return]


def estimate(
    volume: VolumeLike,
    window_size: WindowSize,
    *,
    max_supersegments: int = 20,
    criterion: str = "least-error",
    ambient_occlusion: OcclusionLike | None = None,
    memory_limit: MemoryLike | None = None,
    device: DeviceLike | None = None,
    scalars: ScalarsLike | None = None,
    preference: str = "point",
    clim: RangeLike | None = None,
    n_colors: int = 256,
    opacity: OpacityLike = "linear",
    cmap: ColorMapLike | None = None,
    flip_scalars: bool = False,
    opacity_unit_distance: float | None = None,
    log_scale: bool = False,
    shade: bool = False,
    ambient: float | None = None,
    diffuse: float | None = 0.7,
    specular: float | None = 0.2,
    specular_power: float | None = 10.0,
    blending: str = "composite",
    interpolation: str = "nearest",
    volume_property: VTKObject | None = None,
    transfer_function: TransferFunction | None = None,
    **unknown: NoReturn,
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
    scalars, preference, clim, n_colors, opacity, cmap, flip_scalars, opacity_unit_distance
        As for :func:`generate`: scalars whose range is narrow for how far it is from 0 take four
        bytes each.
    log_scale, shade, ambient, diffuse, specular, specular_power, blending, interpolation
        As for :func:`generate`.
    volume_property, transfer_function
        As for :func:`generate`.

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
    refuse_keywords(unknown, estimate)
    look = Classification.checked(
        *(scalars, preference, blending, clim, n_colors, opacity, cmap, flip_scalars),
        *(opacity_unit_distance, log_scale, shade, ambient, diffuse, specular, specular_power),
        *(interpolation, volume_property, transfer_function),
    )
    look.require_composite()
    read = as_volume(volume, scalars, preference)
    from pyvista_vdi.generation.slices import estimate as estimate_bytes

    return estimate_bytes(
        read,
        window_size,
        max_supersegments=max_supersegments,
        criterion=criterion,
        ambient_occlusion=ambient_occlusion,
        memory_limit=memory_limit,
        transfer_function=look.transfer_function_of(read),
        device=device,
    )


def read(path: str | os.PathLike[str], **options: Any) -> Any:
    """Read a VDI from a file that :meth:`VDI.save` wrote, or any deep OpenEXR image.

    Or a series or a set of them.

    Parameters
    ----------
    path : path-like
        A ``.vdi`` file, an OpenEXR deep image, whose name ends in ``.exr``, or a page with a VDI in
        it, ``.html``. Or the series in a ``.vdis`` file, or the set in a ``.vdiset`` file, whose
        VDIs are read when they are asked for.
    **options
        For ``.exr`` files of other programs: ``camera``, the view that the image shows, where
        the file does not say it; ``thickness``, world units, given to samples that have none
        (surfaces). For all files ``progress``, called with the finished fraction, 0 to 1.

    Returns
    -------
    VDI or DeferredVDI or VDISeries or VDISet
        The same to the last bit if this package wrote the file, of ``.exr`` within float32's
        rounding (docs/files.md).

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
