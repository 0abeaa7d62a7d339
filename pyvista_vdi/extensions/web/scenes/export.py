"""``plotter.vdi.export_html``: one page that shows a plotter's scene."""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pyvista_vdi.errors import warn_external
from pyvista_vdi.extensions.web.page import View, assembled, check_controls, in_parts, several
from pyvista_vdi.extensions.web.placing import several_of
from pyvista_vdi.extensions.web.scenes.scene import scene_of
from pyvista_vdi.extensions.web.still import part_of
from pyvista_vdi.model.whole_file import whole_file


def export_html(
    plotter: Any, filename: str | os.PathLike[str] | None, *, controls: str = "all"
) -> io.StringIO | None:
    """Write a page of a plotter's scene: see ``plotting.pages.PlotterVDIs.export_html``.

    All of its renderers are shown; it is drawn, and VDIs that are missing are made.
    """
    check_controls(controls)
    picture = drawn(plotter)
    left_out: list[str] = []
    views = []
    several = len(plotter.renderers) > 1
    # Which they are, not how they look: cameras of PyVista that are alike are equal
    cameras = [r.GetActiveCamera().GetAddressAsString("") for r in plotter.renderers]
    for renderer, camera in zip(plotter.renderers, cameras, strict=True):
        scene = scene_of(renderer, renderer.actors, needs_vdi=False)
        left_out += scene.left_out
        left_out += [f"all but one of {what}" for what in not_played(renderer, scene.actors)]
        series = [] if scene.actor is None else _series_of(scene.actor)
        view = View(
            None if series or scene.vdi is None else scene.vdi.with_precision("8-byte"),
            scene.background,
            part_of(picture, renderer),
            renderer.GetSize(),
            scene.data,
            series=series,
        )
        if several:
            view.attributes["style"] = _placed(renderer)
            view.attributes["data-link"] = str(cameras.index(camera))
        views.append(view)
    if left_out:
        words = ", ".join(dict.fromkeys(left_out))
        warn_external(f"the page shows the scene without {words}")
    target = None if filename is None else Path(filename).with_suffix(".html")
    # The first can be read again
    views.sort(key=lambda view: view.vdi is None and not view.series)
    page = assembled(
        views, title=plotter.title if target is None else target.stem, controls=controls
    )
    if target is None:
        return io.StringIO(page.decode())
    with whole_file(target) as stream:
        stream.write(page)
    return None


def not_played(renderer: Any, actors: Sequence[Any]) -> list[str]:
    """Name the series and sets of which one VDI is shown: all but the first actor's."""
    called = {actor: name for name, actor in renderer.actors.items() if "(Addr" not in name}
    return [
        f"the {len(shown)} {kind} ({called.get(actor, type(actor).__name__)})"
        for actor in actors[1:]
        for shown, kind in ((actor.series, "steps of a series"), (actor.vdi_set, "VDIs of a set"))
        if shown is not None
    ]


def _series_of(actor: Any) -> list[bytes]:
    """Return the series or the set that an actor shows as a page holds it; none of one VDI."""
    shown = several_of(actor)
    return [] if shown is None else in_parts(*several(shown, compression="deflate"))


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


def _placed(renderer: Any) -> str:
    """Return where a renderer is in its window, as CSS."""
    left, bottom, right, top = (f"{100 * edge:g}%" for edge in renderer.GetViewport())
    size = f"width: calc({right} - {left}); height: calc({top} - {bottom})"
    return f"position: absolute; left: {left}; bottom: {bottom}; {size}"
