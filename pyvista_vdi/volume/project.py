"""Projections of a volume: the blend modes of volume rendering beside compositing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import get_runtime
from pyvista_vdi.device.work_order import block_items
from pyvista_vdi.errors import UnsupportedError
from pyvista_vdi.model.options import MediumOptions
from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.model.transfer_function import TransferFunction
from pyvista_vdi.model.volume import Volume
from pyvista_vdi.volume.classified_volume import DeviceVolume
from pyvista_vdi.volume.march_step import march_step
from pyvista_vdi.volume.render import ClippedRays


def project_volume(
    volume: Volume,
    transfer_function: TransferFunction,
    request: FrameRequest,
    blending: str,
    sampling: MediumOptions,
) -> NDArray[np.float32]:
    """Render a volume by another blend mode than compositing: see ``docs/conventions.md``.

    Premultiplied RGBA, float32 (H, W, 4), top row first. Every step is sampled, and no ray ends
    early.
    """
    _refuse_light(volume, transfer_function, request, blending, sampling)
    runtime = get_runtime(request.device)
    medium = DeviceVolume(
        runtime, volume, transfer_function, sampling, skip_empty=False, by_scalar=False
    )
    clipped = ClippedRays(medium, request)
    width, height = request.size
    defines = {**medium.defines, **clipped.defines, blending.upper(): 1}
    low, high = volume.finite_range()
    span = high - low or 1.0
    with (
        runtime.upload(clipped.forms, "rays") as forms,
        runtime.upload(
            np.zeros(1, np.float32) if clipped.ends is None else clipped.ends, "opaque depth"
        ) as depth,
        runtime.result((height, width, 4), name="image") as image,
    ):
        march_step(runtime, "volume/project.cl", "project", defines).launch(
            runtime,
            block_items(width, height),
            *medium.medium_arguments(request.camera),
            forms,
            np.int32(clipped.planes),
            np.float32(medium.sample_distance),
            np.float32(medium.unit_distance),
            np.int32(width),
            np.int32(height),
            depth,
            np.int32(clipped.ends is not None),
            *clipped.cropped.arguments,
            np.float32(medium.unit / span),
            np.float32((medium.zero - low) / span),
            image,
        )
        return runtime.download(image)


def _refuse_light(
    volume: Volume,
    transfer_function: TransferFunction,
    request: FrameRequest,
    blending: str,
    sampling: MediumOptions,
) -> None:
    """Raise UnsupportedError for what only compositing has."""
    asked = {
        "RGBA values": volume.rgba,
        "shade": transfer_function.shading is not None,
        "gradient opacity": transfer_function.gradient_opacities is not None,
        "ambient_occlusion": sampling.ambient_occlusion is not None,
        "opacity_multiplier": request.options.opacity_multiplier != 1.0,
        "memory_limit": sampling.memory_limit is not None,
    }
    for name, given in asked.items():
        if given:
            raise UnsupportedError(
                f"blending={blending!r} does not go with {name}: leave one of them out"
            )
