"""Projections of a volume: the blend modes of volume rendering beside compositing."""

from __future__ import annotations

from contextlib import ExitStack

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
from pyvista_vdi.volume.kernels import PROJECT, PROJECT_16
from pyvista_vdi.volume.render import ClippedRays
from pyvista_vdi.volume.variant import RayLaunch

#: In the kernel's order (``volume/projection.cl``), from 1 on.
_BLEND_MODES = ("maximum", "minimum", "average", "additive")


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
    low, high = volume.finite_range()
    span = high - low or 1.0
    with ExitStack() as stack:
        keep = stack.enter_context
        forms = keep(runtime.upload(clipped.forms, "rays"))
        ends = None
        if clipped.ends is not None:
            ends = keep(runtime.upload(clipped.ends, "opaque depth"))
        image = keep(runtime.result((height, width, 4), name="image"))
        launch = RayLaunch(
            runtime,
            PROJECT,
            PROJECT_16,
            {**clipped.variant.defines, "BLEND_MODE": _BLEND_MODES.index(blending) + 1},
            one_by_one=clipped.variant.one_by_one,
            **medium.medium_arguments(request.camera),
            view=medium.rays.view(request.size, clipped.planes),
            forms=forms,
            opaque_depth=ends,
            regions=clipped.regions,
            per_range=medium.unit / span,
            at_zero=(medium.zero - low) / span,
            image=image,
        )
        launch(block_items(width, height))
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
