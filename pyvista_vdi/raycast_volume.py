"""Direct volume rendering on a device: the baseline that a VDI is measured against."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import rays
from .ambient_occlusion import AmbientOcclusion
from .blocks import GROUP, block_items
from .camera import Camera, check_window_size
from .cropping import Cropping, checked_opacity_multiplier
from .device_volume import DeviceVolume
from .lighting import Lights
from .opencl_runtime import Runtime, get_runtime
from .raycast import TRANSMITTANCE_CUTOFF
from .transfer_function import TransferFunction
from .volume import Volume


def raycast_volume(
    volume: Volume,
    camera: Camera,
    window_size: Sequence[int],
    transfer_function: TransferFunction,
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
    device: Any = None,
) -> NDArray[np.float32]:
    """Render a classified volume directly.

    Samples at the midpoints of equal steps, composited front to back by the same kernel code that
    generates VDIs.

    Parameters
    ----------
    volume : Volume
        The scalars.
    camera : Camera
        The view.
    window_size : (int, int)
        Width and height in pixels.
    transfer_function : TransferFunction
        Scalar to colour and opacity.
    sample_distance : float, optional
        Length of a step, model units; half the smallest spacing by default.
    opaque_depth : array_like of float, shape (height, width), optional
        View depth at which each ray ends, world units, top row first; inf where nothing is opaque.
    clipping_planes : array_like of float, shape (k, 6), optional
        Origin and normal of each plane, world coordinates; the normal's side is kept.
    cropping : Cropping or what makes one, optional
        Which regions of the model frame are drawn: see :meth:`pyvista_vdi.Cropping.from_any`.
    opacity_multiplier : float
        Factor of the optical depth of every step, 0 or above.
    early_termination : bool
        End a ray where less than :data:`~pyvista_vdi.raycast.TRANSMITTANCE_CUTOFF` is left.
    skip_empty : bool
        Pass by blocks that are transparent; the picture is the same to the last bit.
    lights : optional
        What a shaded volume is lit by; see :meth:`pyvista_vdi.Lights.from_any`.
    ambient_occlusion : optional
        Darken what is hidden from the light around it, see
        :meth:`pyvista_vdi.AmbientOcclusion.from_any`.
    device : optional
        See :func:`pyvista_vdi.list_devices`.

    Returns
    -------
    numpy.ndarray
        Premultiplied RGBA, float32 (height, width, 4), top row first.
    """
    camera = Camera.from_any(camera)
    size = check_window_size(window_size)
    runtime = get_runtime(device)
    medium = DeviceVolume(
        runtime,
        volume,
        transfer_function,
        sample_distance,
        skip_empty=skip_empty,
        lights=Lights.from_any(lights),
        ambient_occlusion=AmbientOcclusion.from_any(ambient_occlusion),
    )
    return raycast_medium(
        runtime,
        medium,
        camera,
        size,
        opaque_depth=opaque_depth,
        clipping_planes=clipping_planes,
        cropping=Cropping.from_any(cropping),
        opacity_multiplier=checked_opacity_multiplier(opacity_multiplier),
        early_termination=early_termination,
    )


def raycast_medium(
    runtime: Runtime,
    medium: DeviceVolume,
    camera: Camera,
    size: tuple[int, int],
    *,
    opaque_depth: ArrayLike | None = None,
    clipping_planes: ArrayLike | None = None,
    cropping: Cropping | None = None,
    opacity_multiplier: float = 1.0,
    early_termination: bool = True,
) -> NDArray[np.float32]:
    """Render a volume that is on the device already; see :func:`raycast_volume`."""
    width, height = size
    march = medium.forms(camera, size, clipping_planes)
    ends = rays.checked_opaque_depth(opaque_depth, size, march.rays)
    cropped = rays.cropped(march.rays, cropping, medium.volume.bounds)
    planes = march.planes + len(cropped.planes)
    forms = march.packed(*cropped.planes, *cropped.forms)
    defines = {**medium.defines, **march.defines, **cropped.defines}
    multiplier: tuple[np.float32, ...] = ()
    if opacity_multiplier != 1.0:
        defines["OPACITY_MULTIPLIER"] = 1
        multiplier = (np.float32(opacity_multiplier),)
    kernel = runtime.kernel("vdi/render_volume.cl", "render_volume", defines)
    with (
        runtime.upload(forms, "rays") as form_buffer,
        runtime.upload(np.zeros(1, np.float32) if ends is None else ends, "opaque depth") as depth,
        runtime.result((height, width, 4), name="image") as image,
    ):
        runtime.launch(
            kernel,
            block_items(width, height),
            GROUP,
            *medium.medium_arguments(camera),
            form_buffer,
            np.int32(planes),
            np.float32(medium.sample_distance),
            np.float32(medium.unit_distance),
            np.int32(width),
            np.int32(height),
            depth,
            np.int32(ends is not None),
            np.float32(TRANSMITTANCE_CUTOFF if early_termination else -1.0),
            *cropped.arguments,
            *multiplier,
            image,
        )
        return runtime.download(image)
