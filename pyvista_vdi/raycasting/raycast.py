"""VDI to image, on a device."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi.device import DeviceBuffer, get_runtime, padded
from pyvista_vdi.errors import DeviceMemoryError, InvalidArgumentError
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.ray_forms import reference_depth
from pyvista_vdi.model.render_options import FrameRequest
from pyvista_vdi.model.vdi import VDI, with_arrays
from pyvista_vdi.raycasting.choose import choose
from pyvista_vdi.raycasting.kernels import CLEAR_HITS, CLEAR_IMAGE
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
    prepared = prepared_vdi(runtime, checked_vdi(vdi))
    shape, out = (*request.size[::-1], 4), request.out
    with (
        runtime.result(shape, name="image") if out is None else runtime.target(out, "image")
    ) as image:
        draw(prepared, request, image)
        return runtime.download(image, out)


def render_first_hits(vdi: VDI, request: FrameRequest, hit: FirstHit) -> NDArray[np.float32]:
    """Return the view depth at which each pixel's ray first hits something that can be seen.

    float32 (height, width), world units, top row first; infinite where nothing is hit.
    """
    runtime = get_runtime(request.device)
    prepared = prepared_vdi(runtime, checked_vdi(vdi))
    with runtime.buffer(request.size[::-1], name="depth of first hits") as image:
        draw(prepared, request, image, hit)
        t = runtime.download(image)
    return (t + reference_depth(request.camera, vdi.bounds)).astype(np.float32)


def checked_vdi(vdi: Any) -> VDI:
    """Return a VDI; anything else is refused."""
    if not isinstance(vdi, VDI):
        raise InvalidArgumentError(f"expected a VDI, got {type(vdi).__name__}")
    return vdi


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
        clear = CLEAR_IMAGE if scene.hit is None else CLEAR_HITS
        cleared = runtime.bind(clear, pixels=pixels, image=image)
        cleared(padded(pixels, _CLEARING_GROUP), _CLEARING_GROUP)
    launch = runtime.bind(
        variant.kernel, variant.switches, **arguments, **variant.arguments, image=image
    )
    launch(variant.items, variant.group)


#: Bands at most: of fewer rows each a device that holds none of them holds nothing useful.
_MOST = 256


def render_fitting(vdi: VDI, request: FrameRequest) -> NDArray[np.float32]:
    """Raycast a VDI as a whole, or in as many bands as the device's memory asks for.

    Bands are uploaded for each frame. The picture is that of the whole but for the rounding of one
    more compositing per band; a VDI in a packed form is drawn by its supersegments as they are
    unpacked. DeviceMemoryError if not even a small part of it fits.
    """
    try:
        return render_vdi(vdi, request)
    except DeviceMemoryError:
        n = 2
        while n <= min(_MOST, checked_vdi(vdi).window_size[1]):
            try:
                return render_in_bands(vdi, request, n)
            except DeviceMemoryError:
                n *= 2
        raise


def render_in_bands(vdi: VDI, request: FrameRequest, n: int) -> NDArray[np.float32]:
    """Raycast a VDI in n bands of rows, each by itself."""
    image: NDArray[np.float32] | None = None
    cuts = np.linspace(0, vdi.window_size[1], n + 1).round().astype(int).tolist()
    for k in in_order(vdi, cuts, request.camera):
        behind = render_vdi(band(vdi, cuts[k], cuts[k + 1]), request)
        image = behind if image is None else image + (1 - image[..., 3:]) * behind
    assert image is not None  # there are bands
    return image


def band(vdi: VDI, y0: int, y1: int) -> VDI:
    """Return the lists in rows y0 to y1 - 1, from the bottom, as a VDI."""
    width, height = vdi.window_size
    first, last = (int(vdi.offsets[y * width]) for y in (y0, y1))
    offsets = vdi.offsets[y0 * width : y1 * width + 1] - np.uint64(first)
    return with_arrays(
        vdi,
        vdi.arrays.take(offsets, slice(first, last)),
        camera=vdi.camera.tile((width, height), (0, height - y1), (width, y1 - y0)),
        window_size=(width, y1 - y0),
    )


def in_order(vdi: VDI, cuts: list[int], camera: Camera) -> list[int]:
    """Return the bands between some rows so that none comes after one that it may hide."""
    height = vdi.window_size[1]
    own = vdi.camera
    to_own = own.model_to_view @ np.linalg.inv(camera.model_to_view)
    eye = to_own @ (0.0, 0.0, 0.0, 1.0)
    if camera.parallel_projection:
        eye = to_own @ (0.0, 0.0, -1.0, 0.0)
    half = own.half_extent(vdi.window_size)[1]
    above = []  # whether the new eye is above the plane below band k
    for row in cuts[1:-1]:
        slope = half * (2 * row / height - 1 + own.window_center[1])
        at_row = slope * eye[3] if own.parallel_projection else slope * eye[2]
        above.append(eye[1] > at_row)
    # A plane says which of its two bands comes first: bands are taken as soon as none must precede
    order: list[int] = []
    left = set(range(len(cuts) - 1))
    while left:
        for k in sorted(left):
            below_first = k > 0 and k - 1 in left and not above[k - 1]
            above_first = k < len(above) and k + 1 in left and above[k]
            if not (below_first or above_first):
                order.append(k)
                left.remove(k)
                break
    return order
