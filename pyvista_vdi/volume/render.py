"""Direct volume rendering on a device: the baseline that a VDI is measured against."""

from contextlib import ExitStack, nullcontext
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import get_runtime
from pyvista_vdi.device.constants import block_items
from pyvista_vdi.model import ray_forms as rays
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.options import FrameRequest, MediumOptions
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.volume.bricks import SAMPLE_BYTES, Room, StepSampler
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.rays import RayLaunch

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
    transfer_function: TransferFunction,
    request: FrameRequest,
    sampling: MediumOptions,
) -> NDArray[np.float32]:
    """Render a classified volume directly: premultiplied RGBA, float32 (H, W, 4), top row first.

    Samples at the midpoints of equal steps, composited front to back by the same kernel code that
    generates VDIs.
    """
    occlusion = sampling.occlusion_bytes(volume)
    room = picture_room(request.window_size, sampling.memory_limit, occlusion)
    medium = DeviceVolume(
        get_runtime(request.device),
        volume,
        transfer_function,
        sampling,
        skip_empty=request.options.skip_empty,
        room=room,
    )
    with medium.bricks or nullcontext():
        return raycast_medium(medium, request)


def picture_room(size: tuple[int, int], memory_limit: int | None, occlusion: int = 0) -> Room:
    """Return the room for a volume beside an image and so many bytes of an occlusion's grid."""
    width, height = size
    items = block_items(width, _rows_of_part(size, memory_limit))
    working = width * height * _PIXEL_BYTES + items * _STATE_BYTES + occlusion
    rays = f"an image of {width} x {height} pixels"
    return Room(memory_limit, working, items * _PART_STEPS * SAMPLE_BYTES, rays)


def _rows_of_part(size: tuple[int, int], memory_limit: int | None) -> int:
    """Return how many rows of pixels are sampled at a time where the volume is in bricks."""
    most = _PART_BYTES
    if memory_limit is not None:
        most = min(most, memory_limit // _PARTS_IN_LIMIT)
    width, height = size
    per_block_row = block_items(width, 4) * (_PART_STEPS * SAMPLE_BYTES + _STATE_BYTES)
    return min(height, 4 * max(1, most // per_block_row))


def raycast_medium(
    medium: DeviceVolume, request: FrameRequest, *, lit_from: Camera | None = None
) -> NDArray[np.float32]:
    """Render a volume that is on the device already; see :func:`raycast_volume`.

    ``lit_from`` is the view that decides the light of a shaded volume in place of the request's.
    A cutoff of 0 ends no ray.
    """
    runtime, camera, options = medium.runtime, request.camera, request.options
    width, height = size = request.window_size
    bricks, upload = medium.bricks, partial(runtime.upload, brief=True)
    march = medium.rays.forms(camera, size, options.clipping_planes)
    variant = replace(medium.variant, double_float=march.double_float)
    opaque = rays.checked_opaque_depth(request.opaque_depth, size, march.rays)
    cut, beyond, regions = rays.cropped(march.rays, options.cropping, medium.volume.bounds)
    planes = march.planes + len(cut)
    with ExitStack() as stack:
        keep = stack.enter_context
        image = keep(runtime.result((height, width, 4), name="image"))
        forms = keep(upload(rays.packed([*march.forms, *cut, *beyond]), "rays"))
        ends = None if opaque is None else keep(upload(opaque, "opaque depth"))
        medium_arguments = medium.medium_arguments(lit_from or camera)
        draw = partial(
            RayLaunch,
            runtime,
            "volume/render_volume.cl",
            "render_volume",
            variant.defines,
            one_by_one=variant.one_by_one or bricks is not None,
            **medium_arguments,
            forms=forms,
            opaque_depth=ends,
            transmittance_cutoff=options.transmittance_cutoff or -1.0,
            opacity_multiplier=options.opacity_multiplier,
            regions=regions,
            image=image,
        )
        view = medium.rays.view(size, planes)
        if bricks is None:
            draw(samples=None, states=None)(block_items(width, height), view=view)
            return runtime.download(image)
        # Some steps of some rows at a time; the state of the rays goes on from step to step
        rows = _rows_of_part(size, bricks.memory_limit)
        items = block_items(width, rows)
        states = keep(runtime.buffer((items, 2, 4), name="states of rays"))
        room = items * _PART_STEPS
        sampler = StepSampler(runtime, bricks, medium_arguments, variant, forms, room, keep, ends)
        launch = draw(samples=sampler.samples, states=states)
        for first_row in range(0, height, rows):
            now = min(rows, height - first_row)
            for first_step in range(0, medium.most_steps, _PART_STEPS):
                view |= {"first_row": first_row, "rows": now}
                view |= {"first_step": first_step, "steps": _PART_STEPS}
                sampler.sample(view)
                launch(block_items(width, now), view=view)
        return runtime.download(image)
