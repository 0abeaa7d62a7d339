"""Direct volume rendering on a device: the baseline that a VDI is measured against."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.device import Runtime, get_runtime
from pyvista_vdi.device import ray_forms as rays
from pyvista_vdi.device.work_order import GROUP, block_items
from pyvista_vdi.model.ambient_occlusion import AmbientOcclusion, OcclusionGrid
from pyvista_vdi.model.camera import Camera, check_window_size
from pyvista_vdi.model.checks import memory_limit_bytes
from pyvista_vdi.model.cropping import Cropping, checked_opacity_multiplier
from pyvista_vdi.model.lighting import Lights
from pyvista_vdi.model.render_options import TRANSMITTANCE_CUTOFF
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.volume.bricks import SAMPLE_BYTES, Room, StepSampler
from pyvista_vdi.volume.classified_volume import DeviceVolume

#: Steps of a ray that are sampled at a time where the volume is on the device brick by brick.
_PART_STEPS = 128
#: Bytes of a ray's state between them: colour, transmittance and what they have rounded off.
_STATE_BYTES = 32
#: Bytes of samples and states at a time, and how many such parts a memory limit has room for.
_PART_BYTES, _PARTS_IN_LIMIT = 32 * 2**20, 8
#: Bytes of the image, and of the depth at which a ray ends, for each pixel.
_PIXEL_BYTES = 16 + 4


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
    memory_limit: Any = None,
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
        End a ray where less than :data:`~pyvista_vdi.raycasting.raycast.TRANSMITTANCE_CUTOFF` is
        left.
    skip_empty : bool
        Pass by blocks that are transparent; the picture is the same to the last bit.
    lights : optional
        What a shaded volume is lit by; see :meth:`pyvista_vdi.Lights.from_any`.
    ambient_occlusion : optional
        Darken what is hidden from the light around it, see
        :meth:`pyvista_vdi.AmbientOcclusion.from_any`.
    memory_limit : int, float or str, optional
        Most bytes to take on the device, see
        :func:`~pyvista_vdi.generation.generate.generate_vdi`.
    device : optional
        See :func:`pyvista_vdi.list_devices`.

    Returns
    -------
    numpy.ndarray
        Premultiplied RGBA, float32 (height, width, 4), top row first.
    """
    camera = Camera.from_any(camera)
    size = check_window_size(window_size)
    memory = memory_limit_bytes(memory_limit)
    occlusion = AmbientOcclusion.from_any(ambient_occlusion)
    grid = 0 if occlusion is None else OcclusionGrid.of(volume, occlusion).nbytes
    runtime = get_runtime(device)
    medium = DeviceVolume(
        runtime,
        volume,
        transfer_function,
        sample_distance,
        skip_empty=skip_empty,
        lights=Lights.from_any(lights),
        ambient_occlusion=occlusion,
        room=picture_room(size, memory, grid),
    )
    with medium.giving_bricks_back():
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


def picture_room(size: tuple[int, int], memory_limit: int | None, occlusion: int = 0) -> Room:
    """Return the room for a volume beside an image and the grid of an occlusion.

    Parameters
    ----------
    size : (int, int)
        Width and height of the image in pixels.
    memory_limit : int or None
        Most bytes in all.
    occlusion : int
        Bytes of the occlusion's grid.
    """
    width, height = size
    items = block_items(width, _rows_of_part(size, memory_limit))
    working = width * height * _PIXEL_BYTES + items * _STATE_BYTES + occlusion
    rays = f"an image of {width} x {height} pixels"
    return Room(memory_limit, working, items * _PART_STEPS, rays)


def _rows_of_part(size: tuple[int, int], memory_limit: int | None) -> int:
    """Return how many rows of pixels are sampled at a time where the volume is in bricks."""
    most = _PART_BYTES
    if memory_limit is not None:
        most = min(most, memory_limit // _PARTS_IN_LIMIT)
    width, height = size
    per_block_row = block_items(width, 4) * (_PART_STEPS * SAMPLE_BYTES + _STATE_BYTES)
    return min(height, 4 * max(1, most // per_block_row))


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
    lit_from: Camera | None = None,
) -> NDArray[np.float32]:
    """Render a volume that is on the device already; see :func:`raycast_volume`.

    ``lit_from`` is the view that decides the light of a shaded volume in place of ``camera``.
    """
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
    kernel = runtime.kernel("volume/render_volume.cl", "render_volume", defines)
    with ExitStack() as stack:
        keep = stack.enter_context
        form_buffer = keep(runtime.upload(forms, "rays"))
        no_ends = np.zeros(1, np.float32)
        depth = keep(runtime.upload(no_ends if ends is None else ends, "opaque depth"))
        image = keep(runtime.result((height, width, 4), name="image"))
        begin = (
            form_buffer,
            np.int32(planes),
            np.float32(medium.sample_distance),
            np.float32(medium.unit_distance),
        )

        def launch(items: int, sampled: Sequence[Any], part: Sequence[Any]) -> None:
            runtime.launch(
                kernel,
                items,
                GROUP,
                *medium.medium_arguments(lit_from or camera),
                *sampled,
                *begin,
                np.int32(width),
                np.int32(height),
                depth,
                np.int32(ends is not None),
                np.float32(TRANSMITTANCE_CUTOFF if early_termination else -1.0),
                *cropped.arguments,
                *multiplier,
                *part,
                image,
            )

        if medium.bricks is None:
            launch(block_items(width, height), (), ())
        else:
            # Some steps of some rows at a time; the state of the rays goes on from step to step
            rows = _rows_of_part(size, medium.bricks.memory_limit)
            items = block_items(width, rows)
            states = keep(runtime.buffer((items, 2, 4), name="states of rays"))
            sampler = keep(
                StepSampler(
                    runtime,
                    medium.bricks,
                    medium.medium_arguments(lit_from or camera),
                    defines,
                    begin,
                    size,
                    items * _PART_STEPS,
                    None if ends is None else depth,
                )
            )
            for first_row in range(0, height, rows):
                now = min(rows, height - first_row)
                for first_step in range(0, medium.most_steps, _PART_STEPS):
                    sampled = sampler.sample(first_row, now, first_step, _PART_STEPS)
                    part = (np.int32(n) for n in (first_row, now, first_step, _PART_STEPS))
                    launch(block_items(width, now), sampled, (*part, states))
        return runtime.download(image)
