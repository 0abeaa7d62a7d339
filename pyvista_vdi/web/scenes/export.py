"""``plotter.export_html`` of a plotter with VDIs: one page that shows its scene."""

from __future__ import annotations

import io
import os
import warnings
from pathlib import Path
from typing import Any

from pyvista_vdi.errors import VDIWarning
from pyvista_vdi.io.whole_file import whole_file
from pyvista_vdi.web.page import assembled
from pyvista_vdi.web.scenes.scene import scene_of


def export_html(plotter: Any, filename: str | os.PathLike[str] | None) -> io.StringIO | None:
    """Write a page that shows a plotter's scene, as ``Plotter.export_html`` does.

    Parameters
    ----------
    plotter : pyvista.BasePlotter
        Its active renderer is shown; it is drawn, and VDIs that are missing are made.
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
    renderer = plotter.renderer
    scene = scene_of(renderer, renderer.actors)
    left_out = [*scene.left_out, *around(plotter)]
    if left_out:
        warnings.warn(
            f"the page shows the scene without {', '.join(left_out)}", VDIWarning, stacklevel=3
        )
    target = None if filename is None else Path(filename).with_suffix(".html")
    page = assembled(
        scene.vdi.with_precision("8-byte"),
        title=plotter.title if target is None else target.stem,
        background=scene.background,
        still=picture,
        still_size=renderer.GetSize(),
        scene=scene.data,
    )
    if target is None:
        return io.StringIO(page.decode())
    with whole_file(target) as stream:
        stream.write(page)
    return None


def drawn(plotter: Any) -> Any:
    """Draw a plotter, so that its VDIs are there; return the active renderer's picture.

    A window that has not been shown is drawn off-screen.
    """
    window = plotter.render_window
    if plotter._first_time:  # as Plotter.show begins
        plotter._on_first_render_request()
    hidden = not window.GetMapped() and not window.GetOffScreenRendering()
    if hidden:
        window.SetOffScreenRendering(1)
    plotter.render()
    picture = plotter.screenshot(return_img=True)
    if hidden:
        window.SetOffScreenRendering(0)
    left, bottom, right, top = plotter.renderer.GetViewport()
    height, width = picture.shape[:2]
    rows = slice(round(height * (1 - top)), round(height * (1 - bottom)))
    return picture[rows, round(width * left) : round(width * right), :3]


def around(plotter: Any) -> list[str]:
    """Name what a plotter shows beside its active renderer's props."""
    renderer = plotter.renderer
    left_out = []
    others = [r for r in plotter.renderers if r is not renderer]
    if any(r.GetViewProps().GetNumberOfItems() for r in others):
        left_out.append("the other subplots")
    return left_out
