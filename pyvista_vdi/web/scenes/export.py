"""``plotter.export_html`` of a plotter with VDIs: one page that shows its scene."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import Any

from pyvista_vdi.errors import warn_external
from pyvista_vdi.io.whole_file import whole_file
from pyvista_vdi.web.page import View, assembled
from pyvista_vdi.web.scenes.scene import css, scene_of


def export_html(plotter: Any, filename: str | os.PathLike[str] | None) -> io.StringIO | None:
    """Write a page that shows a plotter's scene, as ``Plotter.export_html`` does.

    Parameters
    ----------
    plotter : pyvista.BasePlotter
        All of its renderers are shown; it is drawn, and VDIs that are missing are made.
    filename : path-like or None
        Where the page is written; ``.html`` is put in the place of another suffix.

    Returns
    -------
    io.StringIO or None
        The page, if there is no file name.

    Warns
    -----
    VDIWarning
        Of what is not shown, by name.

    Raises
    ------
    VDIFileError
        If the file cannot be written.
    """
    picture = drawn(plotter)
    left_out: list[str] = []
    views = []
    several = len(plotter.renderers) > 1
    cameras = [renderer.GetActiveCamera() for renderer in plotter.renderers]
    for renderer in plotter.renderers:
        scene = scene_of(renderer, renderer.actors, needs_vdi=False)
        left_out += scene.left_out
        view = View(
            None if scene.vdi is None else scene.vdi.with_precision("8-byte"),
            scene.background,
            part_of(picture, renderer),
            renderer.GetSize(),
            scene.data,
        )
        if several:
            view.attributes["style"] = _placed(renderer) + _border(plotter)
            view.attributes["data-link"] = str(cameras.index(renderer.GetActiveCamera()))
        views.append(view)
    if left_out:
        words = ", ".join(dict.fromkeys(left_out))
        warn_external(f"the page shows the scene without {words}")
    target = None if filename is None else Path(filename).with_suffix(".html")
    views.sort(key=lambda view: view.vdi is None)  # the first can be read again
    page = assembled(views, title=plotter.title if target is None else target.stem)
    if target is None:
        return io.StringIO(page.decode())
    with whole_file(target) as stream:
        stream.write(page)
    return None


def drawn(plotter: Any) -> Any:
    """Draw a plotter, so that its VDIs are there; return its picture, uint8 (H, W, 3).

    A window that has not been shown is drawn off-screen.
    """
    window = plotter.render_window
    if plotter._first_time:  # as Plotter.show begins
        plotter._on_first_render_request()
    hidden = not window.GetMapped() and not window.GetOffScreenRendering()
    if hidden:
        window.SetOffScreenRendering(1)
    try:
        plotter.render()
        return plotter.screenshot(return_img=True)[..., :3]
    finally:
        if hidden:
            window.SetOffScreenRendering(0)


def part_of(picture: Any, renderer: Any) -> Any:
    """Return the part of a window's picture that a renderer has drawn."""
    left, bottom, right, top = renderer.GetViewport()
    height, width = picture.shape[:2]
    rows = slice(round(height * (1 - top)), round(height * (1 - bottom)))
    return picture[rows, round(width * left) : round(width * right)]


def _placed(renderer: Any) -> str:
    """Return where a renderer is in its window, as CSS."""
    left, bottom, right, top = (f"{100 * edge:g}%" for edge in renderer.GetViewport())
    size = f"width: calc({right} - {left}); height: calc({top} - {bottom})"
    return f"position: absolute; left: {left}; bottom: {bottom}; {size}"


def _border(plotter: Any) -> str:
    """Return the lines between subplots as CSS, where a plotter has some."""
    overlay = getattr(plotter.renderers, "border_overlay_renderer", None)
    framed = [r for r in (overlay, *plotter.renderers) if r is not None and r.has_border]
    if not framed:
        return ""
    color = css(framed[0].border_color.float_rgb)
    return f"; outline: {framed[0].border_width / 2:g}px solid {color}"


def around(plotter: Any) -> list[str]:
    """Name what a plotter shows beside its active renderer."""
    others = [r for r in plotter.renderers if r is not plotter.renderer]
    return ["the other subplots"] * any(r.GetViewProps().GetNumberOfItems() for r in others)
