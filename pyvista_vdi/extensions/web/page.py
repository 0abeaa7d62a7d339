"""One HTML file with the viewer and a VDI: opens from disk, offline, and loads nothing."""

from __future__ import annotations

import base64
import binascii
import copy
import html
import io
import os
import re
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from pyvista_vdi._version import __version__
from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError, VDIFileError
from pyvista_vdi.extensions.series.archive import SERIES, write_to
from pyvista_vdi.extensions.series.series import VDISeries
from pyvista_vdi.extensions.sets.files import SET, about
from pyvista_vdi.extensions.sets.vdi_set import VDISet
from pyvista_vdi.extensions.web.bundle import viewer_script
from pyvista_vdi.io.progress import Progress
from pyvista_vdi.io.vdi_file import reader, writer
from pyvista_vdi.io.vdi_file.layout import COARSE, DEFLATE
from pyvista_vdi.io.vdi_file.reader import FileInfo
from pyvista_vdi.model.compositing import opacity, transmittance
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.metrics import check_background, over_background
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.model.whole_file import check_writable, whole_file

#: What the script elements that hold a .vdi file as base64 say of themselves.
DATA_TYPE = "application/vdi+base64"

#: The same, of what is beside the VDI: see web/scenes/scene.py.
_SCENE = '<script type="application/vdi-scene+base64">{}</script>\n'

#: Longest edge of the still picture, pixels, and the quality of its JPEG.
_STILL_EDGE, _STILL_QUALITY = 480, 75

#: Bytes of a part of a series, which a page decodes from base64 at once; a multiple of three.
_PART = 3 << 20
#: Bytes of a page within which its data begin: behind the still picture.
_HEAD = 1 << 20
#: Where in a ZIP its first member's name stands, and base64 text of all that may be looked for.
_NAME_AT, _NAMES = 30, 128

# To its end, or to that of a file that was cut
_DATA = re.compile(rb'<script type="%b">([^<]*)' % re.escape(DATA_TYPE).encode())

# Nothing is loaded, from nowhere: what the page needs is in it.
_POLICY = "default-src 'unsafe-inline' 'unsafe-eval' data: blob:"

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
main {{ display: contents; }}
h1 {{ position: absolute; width: 1px; height: 1px; margin: 0; overflow: hidden; }}
</style>
</head>
<body>
<main>
<h1>{title}</h1>
{views}</main>
</body>
</html>
"""

_VIEW = """\
<vdi-viewer background="{background}"{attributes}>
<img alt="{title}" src="data:image/jpeg;base64,{still}">
{parts}</vdi-viewer>
"""

_NO_SCRIPT = (
    "<noscript><p>Scripts are turned off: this is a still picture of what could be turned.</p>"
    "</noscript>\n"
)


@dataclass
class View:
    """What a viewer in a page shows."""

    vdi: VDI | None  # as it is sent; ``None`` if all is in the scene, or it is a series
    background: str  # as CSS has it
    still: NDArray[np.uint8]  # uint8 (H, W, 3), the picture where nothing can be turned
    still_size: Sequence[int]  # width and height that it is shown as, or smaller
    #: What is seen beside the VDI: see :mod:`pyvista_vdi.extensions.web.scenes.scene`
    scene: bytes | None = None
    attributes: dict[str, str] = field(default_factory=dict)  # of the element
    #: Parts of the file of a series or a set; the first shows its first VDI
    series: Sequence[bytes] = ()
    deferred: Mapping[str, Any] | None = None  # what lists that keep values are about


def page(
    vdi: VDI | DeferredVDI,
    *,
    title: str = "VDI",
    background: Sequence[float] = (0.0, 0.0, 0.0),
    controls: str = "all",
    precision: str | None = None,
    level: int | None = None,
    progress: Progress | None = None,
    **look: Any,
) -> bytes:
    """Return an HTML page that shows a VDI, as large as the window, behind it an RGB from 0 to 1.

    ``precision`` is "8-byte" by default, and ``level`` (of deflate) 6. ``controls="none"`` leaves
    out the bar of buttons. A page of a :class:`DeferredVDI` holds its values, and its transfer
    function is edited there; ``look``: what that begins with, the arguments of
    :meth:`DeferredVDI.classified`.
    """
    if isinstance(vdi, DeferredVDI):
        begun = vdi.classified(**look)
        view = _view_of(begun, background)
        view.vdi, view.deferred = edited(vdi.with_precision(precision or "8-byte"), begun)
    else:
        refuse_look(look)
        view = _view_of(vdi, background)
        view.vdi = vdi.with_precision(precision or "8-byte")
    return assembled([view], title=title, controls=controls, level=level, progress=progress)


def edited(kept: DeferredVDI, begun: VDI) -> tuple[VDI, Mapping[str, Any]]:
    """Return the lists whose transfer function a viewer edits, and what they are about.

    ``begun``: the same with the colours that editing begins with.
    """
    lists = copy.copy(kept.lists)
    told = begun.metadata["transfer_function"]
    lists.metadata = {**kept.metadata, "transfer_function": told}
    return lists, kept.about


def refuse_look(look: Mapping[str, Any]) -> None:
    """Raise UnsupportedError if there is one, as what has colours takes none."""
    if look:
        raise UnsupportedError(
            f"a viewer shows a VDI in the colours that it has: leave out {', '.join(look)}, or "
            "generate with classification='deferred'"
        )


def assembled(
    views: Sequence[View],
    *,
    title: str,
    controls: str = "all",
    level: int | None = None,
    progress: Progress | None = None,
) -> bytes:
    """Return a page with one or several viewers. :func:`read` gives the first one's VDI back."""
    without = check_controls(controls)
    title = html.escape(title)
    parts_of = {
        "scene": any(view.scene is not None for view in views),
        "series": any(view.series for view in views),
        "values": any(view.deferred is not None for view in views),
    }
    parts = []
    for number, view in enumerate(views):
        files = list(view.series)
        if view.vdi is not None:
            stream = io.BytesIO()
            shown = progress if number == 0 else None
            writer.write_to(stream, view.vdi, DEFLATE, level, shown, deferred=view.deferred)
            data = stream.getvalue()
            cut = _end_of_coarse(stream)
            files = [data[:cut], data[cut:]]
        of = f' data-of="{number}"' if number else ""  # read() looks for the first one's
        texts = [f'<script type="{DATA_TYPE}"{of}>{_text(part)}</script>\n' for part in files]
        first, rest = "".join(texts[:1]), "".join(texts[1:])
        scene = "" if view.scene is None else _SCENE.format(_text(view.scene))
        viewer = "" if number else viewer_script(**parts_of)
        script = f"<script>\n{viewer}</script>\n" if viewer else ""
        width, height = view.still_size
        shares = {} if number else {"hash": ""}  # what the first one shows is in the address
        said = {"fit": f"{width}/{height}", **shares, **without, **view.attributes}
        named = {name: html.escape(value) for name, value in said.items()}
        parts.append(
            _VIEW.format(
                title=title,
                background=view.background,
                attributes="".join(f' {name}="{value}"' for name, value in named.items()),
                still=_text(_jpeg(view.still, view.still_size)),
                parts=("" if number else _NO_SCRIPT) + first + scene + script + rest,
            )
        )
    text = _PAGE.format(
        version=__version__,
        policy=_POLICY,
        title=title,
        background=views[0].background,
        views="".join(parts),
    )
    return text.encode()


def write(
    vdi: VDI | DeferredVDI,
    path: str | os.PathLike[str],
    *,
    compression: str = DEFLATE,
    level: int | None = None,
    precision: str | None = None,
    title: str | None = None,
    background: Sequence[float] = (0.0, 0.0, 0.0),
    controls: str = "all",
    progress: Progress | None = None,
    **look: Any,
) -> Path:
    """Write a page with a VDI: see :func:`pyvista_vdi.io.write`, and :func:`page`.

    ``compression`` is deflate, the one that browsers decode; the title is the file's name by
    default.
    """
    target = Path(os.path.realpath(path))
    content = page(
        vdi,
        title=target.stem if title is None else title,
        background=background,
        controls=controls,
        precision=precision,
        level=level,
        progress=progress,
        **look,
    )
    with whole_file(target) as stream:
        stream.write(content)
    return target


def write_series(
    series: VDISeries,
    path: str | os.PathLike[str],
    *,
    precision: str = "8-byte",
    compression: str = DEFLATE,
    level: int | None = None,
    title: str | None = None,
    background: Sequence[float] = (0.0, 0.0, 0.0),
    controls: str = "all",
    autoplay: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Write a page that plays a series: see :meth:`pyvista_vdi.VDISeries.save`, and :func:`page`.

    With ``autoplay`` it plays as soon as it is opened.
    """
    view = _view_of(series[0], background)
    view.attributes = {"autoplay": ""} if autoplay else {}
    how = {"precision": precision, "compression": compression, "level": level}
    return _write_several(view, path, series, title, controls, progress=progress, **how)


def write_set(
    vdi_set: VDISet,
    path: str | os.PathLike[str],
    *,
    precision: str = "8-byte",
    compression: str = DEFLATE,
    level: int | None = None,
    title: str | None = None,
    background: Sequence[float] = (0.0, 0.0, 0.0),
    controls: str = "all",
    progress: Progress | None = None,
) -> Path:
    """Write a page that shows a set: see :meth:`pyvista_vdi.VDISet.save`, and :func:`page`."""
    view = _view_of(vdi_set[vdi_set.nearest(vdi_set.camera)], background)
    view.still_size = vdi_set.window_size
    how = {"precision": precision, "compression": compression, "level": level}
    return _write_several(view, path, vdi_set, title, controls, progress=progress, **how)


def _write_several(
    view: View,
    path: str | os.PathLike[str],
    vdis: VDISeries | VDISet,
    title: str | None,
    controls: str,
    **how: Any,
) -> Path:
    """Write a page of a series or a set that a viewer shows."""
    target = Path(os.path.realpath(check_writable(Path(path))))
    check_controls(controls)
    view.series = in_parts(*several(vdis, **how))
    content = assembled([view], title=target.stem if title is None else title, controls=controls)
    with whole_file(target) as out:
        out.write(content)
    return target


def several(vdis: VDISeries | VDISet, **how: Any) -> tuple[bytes, int]:
    """Return the file of a series or a set, and how many bytes of it show its first VDI."""
    stream = io.BytesIO()
    if isinstance(vdis, VDISeries):
        cut = write_to(stream, SERIES, {"times": vdis.times}, vdis, **how)
    else:
        cut = write_to(stream, SET, about(vdis), vdis, **how)
    return stream.getvalue(), cut


def check_controls(controls: str) -> dict[str, str]:
    """Return the attributes of a viewer with "all" controls or "none"."""
    if controls not in ("all", "none"):
        raise InvalidArgumentError(f'controls is "all" or "none"; got {controls!r}')
    return {} if controls == "all" else {"controls": controls}


def in_parts(data: bytes, cut: int) -> list[bytes]:
    """Return the parts in which a page holds a series or a set; the first has ``cut`` bytes.

    Or a few more: base64 text is decoded by threes of bytes.
    """
    cut = -(-cut // 3) * 3
    return [data[:cut], *(data[k : k + _PART] for k in range(cut, len(data), _PART))]


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


def _end_of_coarse(stream: BinaryIO) -> int:
    """Return how many bytes of a .vdi file show its coarse level, as a multiple of three."""
    with zipfile.ZipFile(stream) as archive:
        members = archive.infolist()
    behind = 2 if members[1].filename == COARSE else 1
    return -(-members[behind].header_offset // 3) * 3


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


def _view_of(vdi: VDI, background: Sequence[float]) -> View:
    """Return what shows a VDI from its generating view, which is still to be added."""
    behind = check_background(background)
    percents = " ".join(f"{100 * channel:g}%" for channel in behind)
    still = np.rint(over_background(_from_generating_view(vdi), background) * 255)
    size = vdi.window_size if "screen" in vdi.metadata else vdi.picture_size  # of that view
    return View(None, f"rgb({percents})", still.astype(np.uint8), size)


def _from_generating_view(vdi: VDI) -> NDArray[np.float64]:
    """Composite each list's own supersegments: premultiplied RGBA (H, W, 4), top row first."""
    counts = vdi.counts.reshape(-1)
    tau = np.minimum(vdi.optical_depth, 100.0).astype(np.float64)
    sums = np.concatenate([[0.0], np.cumsum(tau)])
    before = sums[:-1] - np.repeat(sums[vdi.offsets.view(np.int64)[:-1]], counts)
    share = transmittance(np.maximum(before, 0.0)) * opacity(tau)
    own = np.repeat(np.arange(len(counts)), counts)
    channels = [*(share * vdi.color.T.astype(np.float64)), share]
    picture = np.empty((*vdi.window_size[::-1], 4))
    for k, channel in enumerate(channels):
        picture[..., k] = np.bincount(own, channel, len(counts)).reshape(picture.shape[:2])
    return picture[::-1]
