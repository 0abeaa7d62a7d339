"""``plotter.vdi.export_html``: one page that shows a plotter's scene."""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pyvista_vdi.errors import warn_external
from pyvista_vdi.extensions.series.series import Called
from pyvista_vdi.extensions.series.steps_writer import KEY_EVERY, StepsWriter
from pyvista_vdi.extensions.series.steps_writer import write_all as write_series
from pyvista_vdi.extensions.sets.files import write_all as write_set
from pyvista_vdi.extensions.sets.vdi_set import VDISet
from pyvista_vdi.extensions.web.page import View, assembled, check_controls, in_parts
from pyvista_vdi.extensions.web.placing import thinned
from pyvista_vdi.extensions.web.scenes.scene import css, scene_of
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
        left_out += [f"all but one of {what}" for what in several_of(renderer, scene.actors[1:])]
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
            view.attributes["style"] = _placed(renderer) + _border(plotter)
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


def several_of(renderer: Any, actors: Sequence[Any]) -> list[str]:
    """Name the series and sets that actors show one VDI of."""
    called = {actor: name for name, actor in renderer.actors.items() if "(Addr" not in name}
    return [
        f"the {len(shown)} {kind} ({called.get(actor, type(actor).__name__)})"
        for actor in actors
        for shown, kind in ((actor.series, "steps of a series"), (actor.vdi_set, "VDIs of a set"))
        if shown is not None
    ]


def _series_of(actor: Any) -> list[bytes]:
    """Return the series or the set that an actor shows as a page holds it; none of one VDI."""
    series, stream = actor.series, io.BytesIO()
    shown = actor.vdi_set if series is None else series
    if shown is None:
        return []
    vdis = Called(lambda i: thinned(shown[i], actor.opacity_multiplier), range(len(shown)))
    if series is None:
        size, bounds = shown.window_size, shown.bounds
        same = VDISet(vdis, shown.cameras, window_size=size, bounds=bounds, about=shown.about)
        cut = write_set(stream, StepsWriter("8-byte", 0.0, 1, "zstd", None), same)
    else:
        writer = StepsWriter("8-byte", 0.0, KEY_EVERY, "zstd", None)
        cut = write_series(stream, writer, vdis, series.times, None)
    return in_parts(stream.getvalue(), cut)


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
