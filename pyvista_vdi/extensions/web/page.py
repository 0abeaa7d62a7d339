"""One HTML file with the viewer and a VDI: opens from disk, offline, and loads nothing."""

from __future__ import annotations

import base64
import binascii
import html
import io
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi._version import __version__
from pyvista_vdi.errors import InvalidArgumentError, VDIFileError
from pyvista_vdi.extensions.sets.vdi_set import VDISet
from pyvista_vdi.extensions.web.bundle import viewer_script
from pyvista_vdi.extensions.web.shown import Shown, as_shown, file_of, seen_of
from pyvista_vdi.io.png import to_bytes
from pyvista_vdi.io.progress import Progress
from pyvista_vdi.io.vdi_file import reader
from pyvista_vdi.io.vdi_file.layout import DEFLATE
from pyvista_vdi.io.vdi_file.reader import FileInfo
from pyvista_vdi.model.metrics import check_background
from pyvista_vdi.model.vdi import VDI, DeferredVDI
from pyvista_vdi.model.whole_file import check_writable, whole_file

#: What the script elements that hold a .vdi file as base64 say of themselves.
DATA_TYPE = "application/vdi+base64"
#: The same, of what is beside the VDI: see web/scene.py.
_SCENE_TYPE = "application/vdi-scene+base64"

#: Longest edge of the still picture, pixels, and the quality of its JPEG.
_STILL_EDGE, _STILL_QUALITY = 480, 75

#: Bytes of a part of a file, which a page decodes from base64 at once; a multiple of three.
_PART = 3 << 20
#: Bytes of a page within which its data begin: behind the still picture.
_HEAD = 1 << 20
#: Where in a ZIP its first member's name stands, and base64 text of all that may be looked for.
_NAME_AT, _NAMES = 30, 128

# To its end, or to that of a file that was cut
_DATA = re.compile(rb'<script type="%b">([^<]*)' % re.escape(DATA_TYPE).encode())

# Nothing is loaded, from nowhere: what the page needs is in it.
POLICY = "default-src 'unsafe-inline' 'unsafe-eval' data: blob:"

# The coarse level stands before the script, which finds it there; the rest may still be coming.
_PAGE = """\
<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="pyvista-vdi {version}">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<title>{title}</title>
<style>
html, body {{ height: 100%; margin: 0; background: {background}; color: gray; }}
vdi-viewer {{ width: 100%; height: 100%; aspect-ratio: auto; }}
vdi-viewer:not(:defined) {{ display: block; text-align: center; }}
vdi-viewer > img {{ max-width: 100%; max-height: 100%; }}
p {{ font: 14px sans-serif; text-align: center; }}
{style}main {{ display: contents; }}
h1 {{ position: absolute; width: 1px; height: 1px; margin: 0; overflow: hidden; }}
</style>
</head>
<body>
<main>
<h1>{title}</h1>
{body}</main>
</body>
</html>
"""

_VIEW = """\
<vdi-viewer background="{background}" fit="{fit}" hash=""{autoplay}>
<img alt="{title}" src="data:image/jpeg;base64,{still}">
{parts}</vdi-viewer>
"""

_NO_SCRIPT = (
    "<noscript><p>Scripts are turned off: this is a still picture of what could be turned.</p>"
    "</noscript>\n"
)


def page_of(
    file: tuple[bytes, int] | None,
    still: NDArray[np.uint8],
    size: Sequence[int],
    *,
    title: str,
    background: str,
    autoplay: bool = False,
    scene: bytes | None = None,
) -> str:
    """Return a page with a viewer and what it shows.

    ``file``: of :func:`file_of`; ``None`` if all is in the ``scene``, see web/scene.py. ``still``:
    uint8 (H, W, 3), the picture where nothing can be turned; it is shown as ``size``, or smaller.
    ``background``: as CSS has it.
    """
    text = viewer_script(*["scene.js"] * (scene is not None))
    parts = [] if file is None else in_parts(*file)
    data = [f'<script type="{DATA_TYPE}">{_text(part)}</script>\n' for part in parts]
    beside = "" if scene is None else f'<script type="{_SCENE_TYPE}">{_text(scene)}</script>\n'
    script = f"{beside}<script>\n{text}</script>\n"
    element = _VIEW.format(
        title=html.escape(title),
        background=background,
        fit="{}/{}".format(*size),
        autoplay=" autoplay" if autoplay else "",
        still=_text(_jpeg(still, size)),
        parts="".join([_NO_SCRIPT, *data[:1], script, *data[1:]]),
    )
    return html_page(title, element, background, POLICY)


def html_page(title: str, body: str, background: str, policy: str, style: str = "") -> str:
    """Return a page for what is seen, as large as the window."""
    return _PAGE.format(
        version=__version__,
        policy=policy,
        title=html.escape(title),
        background=background,
        style=style,
        body=body,
    )


def write(
    shown: Shown,
    path: str | os.PathLike[str],
    *,
    compression: str = DEFLATE,
    title: str | None = None,
    background: Sequence[float] = (0.0, 0.0, 0.0),
    precision: str | None = None,
    level: int | None = None,
    autoplay: bool = False,
    progress: Progress | None = None,
    **look: Any,
) -> Path:
    """Write a page that shows a VDI, as large as the window, behind it an RGB from 0 to 1.

    Or one that plays a series, with ``autoplay`` as soon as it is opened, or shows a set: see
    :func:`pyvista_vdi.io.write`. ``compression`` is deflate, the one that browsers decode; by
    default ``level`` is 6, ``precision`` "8-byte", and ``title`` the file's name. A page of a
    :class:`DeferredVDI` holds its values, and its transfer function is edited there; ``look``: what
    that begins with, the arguments of :meth:`DeferredVDI.classified`.
    """
    if compression != DEFLATE:
        raise InvalidArgumentError(f"pages are compressed by deflate; got {compression!r}")
    target = check_writable(path)
    shown = as_shown(shown)
    seen = seen_of(shown, **look)
    still = to_bytes(_from_generating_view(seen), background)
    # That of the view that it was made for
    size = seen.window_size if "screen" in seen.metadata else seen.picture_size
    size = shown.window_size if isinstance(shown, VDISet) else size
    percents = " ".join(f"{100 * channel:g}%" for channel in check_background(background))
    content = page_of(
        file_of(shown, precision, level, seen=seen, progress=progress),
        still,
        size,
        title=target.stem if title is None else title,
        background=f"rgb({percents})",
        autoplay=autoplay,
    )
    with whole_file(target) as stream:
        stream.write(content.encode())
    return target


def in_parts(data: bytes, first: int) -> list[bytes]:
    """Return the parts in which a page holds a file: the first has ``first`` bytes, or a few more.

    Base64 text is decoded by threes of bytes.
    """
    first = -(-first // 3) * 3
    return [data[:first], *(data[k : k + _PART] for k in range(first, len(data), _PART))]


def read(path: str | os.PathLike[str], *, progress: Progress | None = None) -> VDI | DeferredVDI:
    """Read the VDI that a page shows: see :func:`pyvista_vdi.io.read`."""
    return reader.read(path, progress=progress, stream=data_in(path))


def read_info(path: str | os.PathLike[str]) -> FileInfo:
    """Read what a page's VDI says about itself: see :func:`pyvista_vdi.io.read_info`."""
    return reader.read_info(path, stream=data_in(path))


def begins_with(path: str | os.PathLike[str], head: str) -> bool:
    """Whether the file in a page is a ZIP whose first member has that name."""
    try:
        with Path(path).open("rb") as stream:
            found = _DATA.search(stream.read(_HEAD))
    except (OSError, TypeError, ValueError):
        return False
    text = found[1].lstrip()[:_NAMES] if found else b""
    try:
        return base64.b64decode(text)[_NAME_AT:].startswith(head.encode())
    except binascii.Error:
        return False


def data_in(path: str | os.PathLike[str]) -> BinaryIO:
    """Return the file in a page, of a VDI, a series or a set."""
    try:
        content = Path(path).read_bytes()
    except (OSError, TypeError, ValueError) as error:
        raise VDIFileError(
            f"{path} cannot be read: {getattr(error, 'strerror', None) or error}"
        ) from error
    parts = _DATA.findall(content)
    if not parts:
        raise VDIFileError(
            f"{path} is not a page with a VDI: it has no <script type={DATA_TYPE!r}>; "
            "such a page is written by VDI.save() or 'pyvista-vdi convert'"
        )
    try:
        return io.BytesIO(base64.b64decode(b"".join(b"".join(parts).split()), validate=True))
    except binascii.Error as error:
        raise VDIFileError(
            f"{path} is damaged: what it holds of a VDI is no base64 ({error}); "
            "copy it from its source again, or generate the VDI anew"
        ) from error


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode()


def _jpeg(pixels: NDArray[np.uint8], size: Sequence[int]) -> bytes:
    """Return a picture as a small JPEG."""
    from PIL import Image

    scale = min(1.0, _STILL_EDGE / max(size))
    small = (max(1, round(size[0] * scale)), max(1, round(size[1] * scale)))
    stream = io.BytesIO()
    Image.fromarray(pixels).resize(small).save(stream, format="jpeg", quality=_STILL_QUALITY)
    return stream.getvalue()


def _from_generating_view(vdi: VDI) -> NDArray[np.float64]:
    """Composite each list's own supersegments: premultiplied RGBA (H, W, 4), top row first."""
    counts = vdi.counts.reshape(-1)
    tau = np.minimum(vdi.optical_depth, 100.0).astype(np.float64)
    sums = np.concatenate([[0.0], np.cumsum(tau)])
    before = sums[:-1] - np.repeat(sums[vdi.offsets.view(np.int64)[:-1]], counts)
    share = np.exp(-np.maximum(before, 0.0)) * -np.expm1(-tau)
    own = np.repeat(np.arange(len(counts)), counts)
    channels = [*(share * vdi.color.T.astype(np.float64)), share]
    picture = np.empty((*vdi.window_size[::-1], 4))
    for k, channel in enumerate(channels):
        picture[..., k] = np.bincount(own, channel, len(counts)).reshape(picture.shape[:2])
    return picture[::-1]
