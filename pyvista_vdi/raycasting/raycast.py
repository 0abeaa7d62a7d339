"""VDI to image, on a device."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import DeviceBuffer, get_runtime, padded
from pyvista_vdi.model.options import FrameRequest
from pyvista_vdi.model.ray_forms import reference_depth
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.choose import choose
from pyvista_vdi.raycasting.picking import FirstHit
from pyvista_vdi.raycasting.prepared import PreparedVDI, prepared_vdi
from pyvista_vdi.raycasting.scene import Scene

#: Work-items per group that clear an image.
_CLEARING_GROUP = 256


def render_vdi(vdi: VDI, request: FrameRequest) -> NDArray[np.float32]:
    """Raycast a VDI from any view (paper section 3); into ``request.out``, if it is given.

    Premultiplied RGBA, float32 (height, width, 4), top row first. The VDI is uploaded once per
    device and kept as long as the object lives.
    """
    runtime = get_runtime(request.device)
    prepared = prepared_vdi(runtime, vdi)
    shape, out = (*request.window_size[::-1], 4), request.out
    with runtime.result(shape, name="image", out=out) as image:
        draw(prepared, request, image)
        return runtime.download(image, out)


def render_first_hits(vdi: VDI, request: FrameRequest, hit: FirstHit) -> NDArray[np.float32]:
    """Return the view depth at which each pixel's ray first hits something that can be seen.

    float32 (height, width), world units, top row first; infinite where nothing is hit.
    """
    runtime = get_runtime(request.device)
    prepared = prepared_vdi(runtime, vdi)
    with runtime.buffer(request.window_size[::-1], name="depth of first hits") as image:
        draw(prepared, request, image, hit)
        t = runtime.download(image)
    return (t + reference_depth(request.camera, vdi.bounds)).astype(np.float32)


def draw(
    prepared: PreparedVDI, request: FrameRequest, image: DeviceBuffer, hit: FirstHit | None = None
) -> None:
    """Enqueue the drawing of a frame into ``image``, float32 (H, W, 4) on the device.

    With ``hit``, t of each ray's first hit in its place, float32 (H, W).
    """
    scene = Scene.of(prepared, request, hit)
    # Buffers that are host memory in use are waited for when they are released
    with scene.on_device() as (forms, ends):
        enqueue(scene, scene.arguments(forms, ends), image)


def enqueue(scene: Scene, arguments: dict[str, Any], image: DeviceBuffer) -> None:
    """Enqueue the kernel that draws a scene, whose :meth:`Scene.arguments` are given.

    Pixels beside :attr:`Scene.part` are cleared, but not beside :attr:`Scene.only`.
    """
    runtime = scene.prepared.runtime
    variant = choose(runtime, scene)
    pixels = scene.size[0] * scene.size[1]
    if not variant.whole and scene.only is None and scene.part.pixels < pixels:
        nothing, numbers = (0.0, 4 * pixels) if scene.hit is None else (np.inf, pixels)
        items = padded(numbers, _CLEARING_GROUP)
        cleared = runtime.bind("raycasting/clear.cl", "clear_image", image=image)
        cleared(items, _CLEARING_GROUP, numbers=numbers, nothing=nothing)
    launch = runtime.bind(
        *variant.kernel, variant.switches, **arguments, **variant.arguments, image=image
    )
    launch(variant.items, variant.group)
