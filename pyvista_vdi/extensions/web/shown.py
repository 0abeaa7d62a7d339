"""What viewers show, a VDI, a series or a set: as the file that they are sent, and as a picture."""

from __future__ import annotations

import copy
import io
import sys
import zipfile
from base64 import b64encode
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.api import render
from pyvista_vdi.errors import InvalidVDIError, NoDeviceError, UnsupportedError
from pyvista_vdi.extensions.series.archive import write_to as write_several
from pyvista_vdi.extensions.series.series import VDISeries
from pyvista_vdi.extensions.sets.vdi_set import VDISet
from pyvista_vdi.extensions.web.camera import camera_of, viewer_camera
from pyvista_vdi.io import to_bytes
from pyvista_vdi.io.progress import Progress
from pyvista_vdi.io.vdi_file.layout import COARSE, DEFLATE
from pyvista_vdi.io.vdi_file.writer import write_to
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.inputs import as_vdi
from pyvista_vdi.model.vdi import VDI, picture_view

Shown: TypeAlias = "VDI | DeferredVDI | VDISeries | VDISet"

#: Of deflate: files are a hundredth longer than by 6, its default, in half the time.
EFFORT = 4

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
    precision: str = "8-byte",
    level: int | None = None,
    *,
    seen: VDI | None = None,
    coarse: bool = True,
    progress: Progress | None = None,
) -> tuple[bytes, int]:
    """Return the file of what is shown, and how many bytes of it give a first picture.

    ``seen``: of values those with the colours that editing begins with.
    """
    stream = io.BytesIO()
    if isinstance(shown, VDISeries | VDISet):
        options: Any = {"precision": precision, "compression": DEFLATE, "level": level}
        first = write_several(stream, shown, progress=progress, **options)
        return stream.getvalue(), first
    kept = shown.with_precision(precision)
    lists = kept.lists
    if isinstance(kept, DeferredVDI):
        begun = kept.classified() if seen is None else seen
        lists = copy.copy(lists)
        lists.metadata = {**kept.metadata, "transfer_function": begun.metadata["transfer_function"]}
    write_to(stream, lists, DEFLATE, level, progress, coarse=coarse)
    with zipfile.ZipFile(stream) as archive:
        members = archive.infolist()
    behind = members[2 if members[1].filename == COARSE else 1]
    return stream.getvalue(), behind.header_offset


def bare_file(vdi: VDI) -> bytes:
    """Return the file of a VDI in the 8-byte form without metadata, of which a page knows nothing.

    A table of 4096 colours would be longer than a small VDI.
    """
    bare = copy.copy(vdi.with_precision("8-byte"))
    bare.metadata = {}
    return file_of(bare, level=EFFORT)[0]


def picture(
    vdi: VDI,
    camera: dict[str, Any],
    window_size: Sequence[int] | None = None,
    *,
    background: Sequence[float] | None = None,
    clipping_planes: ArrayLike | None = None,
    placed: ArrayLike | None = None,
    opacity_multiplier: float = 1.0,
) -> NDArray[np.uint8]:
    """Return what a viewer shows: uint8 (H, W, 3) RGB, or (H, W, 4) without a background.

    ``placed``: the model transform, by default the VDI's own; the viewer's camera has none.
    """
    placed = vdi.camera.model_transform if placed is None else placed
    view = camera_of(camera).replace(model_transform=placed)
    how: Any = {"clipping_planes": clipping_planes, "opacity_multiplier": opacity_multiplier}
    return to_bytes(render(vdi, view, window_size, **how), background)


def still(vdi: VDI, camera: Any = None, *, longest: int = 800, **how: Any) -> str | None:
    """Return a view, the VDI's own by default, as base64 PNG; ``None`` without a device.

    Its longer edge has at most ``longest`` pixels. ``how``: of :func:`picture`.
    """
    own, own_size = picture_view(vdi)
    share = min(1, longest / max(own_size))
    size = [max(1, round(edge * share)) for edge in own_size]
    try:
        return png(picture(vdi, camera or viewer_camera(own, own_size), size, **how))
    except NoDeviceError:
        return None


def png(pixels: NDArray[np.uint8]) -> str:
    """Return an image, uint8 (H, W, 3) or (H, W, 4), as base64 PNG."""
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, format="png")
    return b64encode(stream.getvalue()).decode()


def in_a_terminal() -> bool:
    """Whether IPython shows text alone; other notebooks may have no IPython."""
    return _shell() is not None and not hasattr(_shell(), "kernel")


def _shell() -> Any:
    ipython = sys.modules.get("IPython")
    return None if ipython is None else ipython.get_ipython()


def with_still(data: Any, picture: str | None, widget: Any) -> Any:
    """Return a widget's output with a picture, base64 PNG, for where there can be no view.

    In a notebook in which it has no view the picture is shown by an output of its own: of one
    output, what shows notebooks takes the view alone.
    """
    if picture is None:
        return data
    if hasattr(_shell(), "kernel"):
        script = _STAND_IN.format(picture=picture, key=widget._key, model_id=widget.model_id)
        _shell().display_pub.publish({"application/javascript": script})
    return {**data, "image/png": picture}
