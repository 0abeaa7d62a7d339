"""Pictures that stand where no viewer can, or does not turn: stills."""

from __future__ import annotations

import io
import sys
from base64 import b64encode
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.api import render
from pyvista_vdi.errors import NoDeviceError
from pyvista_vdi.extensions.web.camera import camera_of, viewer_camera
from pyvista_vdi.io import to_bytes
from pyvista_vdi.model.vdi import VDI, picture_view

#: Longest edge of a picture that is kept in a saved notebook, pixels.
_EDGE = 800

#: What an output does that has a picture, for where a widget's view comes to nothing: in a page
#: that nbconvert has written with the widget's state, which has the view in place of the picture,
#: and fetches from elsewhere what draws it; and in a notebook that is opened without its kernel.
#: Viewers say that they are there in ``pyvistaVDIs``, and take the picture away.
_STAND_IN = """\
((place) => {{
  const show = () => {{
    if (!place || globalThis.pyvistaVDIs?.has("{key}")) return;
    place.insertAdjacentHTML("beforeend", '<img data-vdi="{key}" style="max-width: 100%" '
      + 'alt="a still picture of a volume" src="data:image/png;base64,{picture}">');
  }};
  const views = 'script[type="application/vnd.jupyter.widget-view+json"]';
  if (document.readyState === "loading") {{
    document.addEventListener("DOMContentLoaded", () => {{
      const among = [...document.querySelectorAll(views)];
      if (among.some(({{ textContent }}) => textContent.includes("{model_id}"))) show();
    }});
  }} else setTimeout(show, 3000);
}})(typeof element === "undefined" ? null : element[0] ?? element);
"""


def picture(
    vdi: VDI,
    camera: dict[str, Any],
    window_size: Sequence[int] | None = None,
    background: Sequence[float] | None = None,
    clipping_planes: ArrayLike | None = None,
) -> NDArray[np.uint8]:
    """Return what a viewer shows: uint8 (H, W, 3) RGB, or (H, W, 4) without a background."""
    # Where the model is in the world is the VDI's own: the viewer's camera does not say it
    placed = vdi.camera.model_transform
    view = camera_of(camera).replace(model_transform=placed)
    image = render(vdi, view, window_size, clipping_planes=clipping_planes)
    return to_bytes(image, background)


def still(
    vdi: VDI,
    camera: dict[str, Any] | None = None,
    background: Sequence[float] | None = None,
    clipping_planes: ArrayLike | None = None,
    longest: int = _EDGE,
) -> str | None:
    """Return a view, the VDI's own by default, as base64 PNG; ``None`` without a device.

    Its longer edge has at most ``longest`` pixels.
    """
    own, own_size = picture_view(vdi)
    share = min(1, longest / max(own_size))
    size = [max(1, round(edge * share)) for edge in own_size]
    camera = viewer_camera(own, own_size) if camera is None else camera
    try:
        return png(picture(vdi, camera, size, background, clipping_planes))
    except NoDeviceError:
        return None


def part_of(picture: Any, renderer: Any) -> Any:
    """Return the part of a window's picture that a renderer has drawn."""
    left, bottom, right, top = renderer.GetViewport()
    height, width = picture.shape[:2]
    rows = slice(round(height * (1 - top)), round(height * (1 - bottom)))
    return picture[rows, round(width * left) : round(width * right)]


def png(pixels: NDArray[np.uint8]) -> str:
    """Return an image, uint8 (H, W, 3) or (H, W, 4), as base64 PNG."""
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, format="png")
    return b64encode(stream.getvalue()).decode()


def stand_in(picture: str, key: str, model_id: str) -> None:
    """Show a picture, base64 PNG, in a notebook in which a widget has no view.

    It is an output of its own: of one output, what shows notebooks takes the view alone.
    """
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    if shell is not None and hasattr(shell, "kernel"):
        script = _STAND_IN.format(picture=picture, key=key, model_id=model_id)
        shell.display_pub.publish({"application/javascript": script})
