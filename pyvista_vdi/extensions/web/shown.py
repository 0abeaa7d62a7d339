"""What viewers show, a VDI, a series or a set: as the file that they are sent, and as a picture.

And cameras as the viewer's JavaScript has them: VTK's names, and no more than it draws by.
"""

from __future__ import annotations

import copy
import io
import math
import sys
import zipfile
from base64 import b64encode
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.api import render
from pyvista_vdi.errors import InvalidCameraError, InvalidVDIError, NoDeviceError, UnsupportedError
from pyvista_vdi.extensions.series.archive import write_to as write_several
from pyvista_vdi.extensions.series.series import VDISeries
from pyvista_vdi.extensions.sets.vdi_set import VDISet
from pyvista_vdi.io import to_bytes
from pyvista_vdi.io.progress import Progress
from pyvista_vdi.io.vdi_file.layout import COARSE, DEFLATE
from pyvista_vdi.io.vdi_file.writer import write_to
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.inputs import as_vdi
from pyvista_vdi.model.vdi import VDI, DeferredVDI, picture_view

Shown: TypeAlias = "VDI | DeferredVDI | VDISeries | VDISet"

#: Of deflate: files are a hundredth longer than by 6, its default, in half the time.
EFFORT = 4

#: Planes that the viewer clips a VDI to (MOST_CLIPPING_PLANES of viewer/shader.js).
MOST_PLANES = 24

_ENTRIES = (
    "position", "focal_point", "view_up", "view_angle", "parallel_scale", "window_center",
)  # fmt: skip

#: Longest edge of the picture beside a widget, pixels.
_STILL_EDGE = 800


def as_shown(shown: Any) -> Shown:
    """Return what a viewer can show, or raise InvalidVDIError."""
    if not isinstance(shown, VDISeries | VDISet):
        return shown if isinstance(shown, DeferredVDI) else as_vdi(shown)
    if shown.value_range is not None:
        of = "series" if isinstance(shown, VDISeries) else "set"
        raise InvalidVDIError(
            f"this {of} keeps values, which have no colours yet, and a viewer edits those of one "
            f"VDI alone: pass {of}.classified(cmap=..., opacity=...)"
        )
    as_vdi(shown[0])
    return shown


def seen_of(shown: Shown, *, camera: Any = None, time: float | None = None, **look: Any) -> VDI:
    """Return the VDI that is seen: the step of a time, or the one that is nearest to a view.

    ``look``: the transfer function of values; UnsupportedError if it is given to what has colours.
    """
    if isinstance(shown, DeferredVDI):
        return shown.classified(**look)
    if look:
        raise UnsupportedError(
            f"a viewer shows a VDI in the colours that it has: leave out {', '.join(look)}, or "
            "generate with classification='deferred'"
        )
    if isinstance(shown, VDISet):
        return shown[shown.nearest(shown.camera if camera is None else camera)]
    if isinstance(shown, VDISeries):
        return shown[0 if time is None else shown.nearest(time)]
    return shown


def file_of(
    shown: Shown,
    precision: str | None = None,
    level: int | None = None,
    *,
    seen: VDI | None = None,
    progress: Progress | None = None,
) -> tuple[bytes, int]:
    """Return the file of what is shown, and how many bytes of it give a first picture.

    ``precision`` is "8-byte" by default. ``seen``: of values those with the colours that editing
    begins with.
    """
    stream, precision = io.BytesIO(), precision or "8-byte"
    if isinstance(shown, VDISeries | VDISet):
        options: Any = {"precision": precision, "compression": DEFLATE, "level": level}
        first = write_several(stream, shown, progress=progress, **options)
        return stream.getvalue(), first
    kept = shown.with_precision(precision)
    if isinstance(kept, DeferredVDI):
        begun = kept.classified() if seen is None else seen
        kept = copy.copy(kept)
        kept.metadata = {**kept.metadata, "transfer_function": begun.metadata["transfer_function"]}
    write_to(stream, kept, DEFLATE, level, progress)
    with zipfile.ZipFile(stream) as archive:
        members = archive.infolist()
    behind = members[2 if members[1].filename == COARSE else 1]
    return stream.getvalue(), behind.header_offset


def bare_file(vdi: VDI) -> bytes:
    """Return the file of a VDI in the 8-byte form without metadata, of which a page knows nothing.

    A table of 4096 colours would be longer than a small VDI.
    """
    bare = copy.copy(vdi)
    bare.metadata = {}
    return file_of(bare, level=EFFORT)[0]


def still(
    vdi: VDI,
    camera: dict[str, Any] | None = None,
    *,
    background: Sequence[float] | None = None,
    clipping_planes: ArrayLike | None = None,
) -> str | None:
    """Return what a viewer shows of a view, by default the VDI's own, as base64 PNG.

    Its longer edge has at most 800 pixels; straight RGBA without a background. ``None`` without a
    device. The model is where it was for the VDI: the viewer's camera says nothing of it.
    """
    own, own_size = picture_view(vdi)
    share = min(1, _STILL_EDGE / max(own_size))
    size = [max(1, round(edge * share)) for edge in own_size]
    state = viewer_camera(own, own_size) if camera is None else camera
    view = camera_of(state).replace(model_transform=vdi.camera.model_transform)
    try:
        image = render(vdi, view, size, clipping_planes=clipping_planes)
    except NoDeviceError:
        return None
    return png(to_bytes(image, background))


def png(pixels: NDArray[np.uint8]) -> str:
    """Return an image, uint8 (H, W, 3) or (H, W, 4), as base64 PNG."""
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, format="png")
    return b64encode(stream.getvalue()).decode()


def shell() -> Any:
    """Return IPython's shell, which has a ``kernel`` if it shows more than text, or None."""
    return getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()


def with_still(data: Any, picture: str | None, key: str) -> Any:
    """Return a widget's output with a picture, base64 PNG, for where there can be no view.

    What shows notebooks takes the view alone of an output that has both, and nbconvert's pages
    fetch from elsewhere what draws that. So a kernel gives the picture an output of its own, which
    the viewer of that ``key`` takes away when it comes: see widget.py.
    """
    if picture is None:
        return data
    if not hasattr(shell(), "kernel"):
        return {**data, "image/png": picture}
    image = f'<img data-vdi="{key}" style="max-width: 100%" alt="a still picture of a volume" '
    html = f'{image}src="data:image/png;base64,{picture}">'
    shell().display_pub.publish({"text/html": html, "text/plain": "a still picture of a volume"})
    return data


def viewer_camera(camera: Any, window_size: Sequence[int] = (1, 1)) -> dict[str, Any]:
    """Return any camera, or a dictionary of that form, as ``viewer.camera`` takes it.

    It has ``position``, ``focal_point``, ``view_up``, and ``view_angle`` (vertical, degrees) or
    ``parallel_scale``; ``window_center`` where it is not the middle. ``window_size``: of its
    picture, which turns a horizontal opening angle into a vertical one. InvalidCameraError if it is
    no camera, or has other entries or values.
    """
    view = camera_of(camera) if isinstance(camera, dict) else Camera.from_any(camera)
    _, half_height = view.half_extent(window_size)
    state: dict[str, Any] = {name: list(getattr(view, name)) for name in _ENTRIES[:3]}
    if any(view.window_center):
        state["window_center"] = list(view.window_center)
    if view.parallel_projection:
        return {**state, "parallel_scale": half_height}
    if not view.use_horizontal_view_angle:  # to the last bit
        return {**state, "view_angle": view.view_angle}
    return {**state, "view_angle": 2 * math.degrees(math.atan(half_height))}


def camera_of(state: dict[str, Any]) -> Camera:
    """Return the camera that a dictionary of the viewer's form describes; InvalidCameraError."""
    unknown = sorted(set(state) - set(_ENTRIES))
    if unknown:
        raise InvalidCameraError(
            f"a viewer's camera has {', '.join(_ENTRIES)}; got {', '.join(unknown)}"
        )
    parallel = "parallel_scale" in state
    return Camera.from_dict({**state, "parallel_projection": parallel})
