"""VDI to image, on a device."""

from contextlib import ExitStack

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import DeviceBuffer, get_runtime, padded
from pyvista_vdi.model.options import FrameRequest
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.raycasting.choose import choose
from pyvista_vdi.raycasting.picking import FirstHit
from pyvista_vdi.raycasting.prepared import prepared_vdi
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
    with ExitStack() as stack:
        keep = stack.enter_context
        image = keep(runtime.result(shape, name="image", out=out))
        enqueue(Scene.of(prepared, request, keep), image)
        return runtime.download(image, out)


def render_first_hits(vdi: VDI, request: FrameRequest, hit: FirstHit) -> NDArray[np.float32]:
    """Return the view depth at which each pixel's ray first hits something that can be seen.

    float32 (height, width), world units, top row first; infinite where nothing is hit.
    """
    runtime = get_runtime(request.device)
    prepared = prepared_vdi(runtime, vdi)
    with ExitStack() as stack:
        keep = stack.enter_context
        image = keep(runtime.buffer(request.window_size[::-1], name="depth of first hits"))
        scene = Scene.of(prepared, request, keep, hit)
        enqueue(scene, image)
        t = runtime.download(image)
    return (t + scene.reference_depth).astype(np.float32)


def enqueue(scene: Scene, image: DeviceBuffer) -> None:
    """Enqueue the kernel that draws a scene into ``image``, float32 (H, W, 4) on the device.

    Where hits are asked for, t of each ray's first one, float32 (H, W). Pixels beside
    :attr:`Scene.part` are cleared, but not beside :attr:`Scene.only`.
    """
    runtime = scene.prepared.runtime
    variant = choose(scene)
    pixels = scene.size[0] * scene.size[1]
    if not variant.whole and scene.only is None and scene.part.pixels < pixels:
        nothing, numbers = (0.0, 4 * pixels) if scene.hit is None else (np.inf, pixels)
        items = padded(numbers, _CLEARING_GROUP)
        cleared = runtime.bind("raycasting/clear.cl", "clear_image", image=image)
        cleared(items, _CLEARING_GROUP, numbers=numbers, nothing=nothing)
    arguments = {**scene.arguments(), **variant.arguments}
    launch = runtime.bind(*variant.kernel, variant.switches, **arguments, image=image)
    launch(variant.items, variant.group)
