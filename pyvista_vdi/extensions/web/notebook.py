"""What notebooks show of VDIs, and of plotters with VDIs."""

from __future__ import annotations

import html
from collections.abc import Collection
from typing import Any

from pyvista_vdi.errors import MissingDependencyError, warn_external
from pyvista_vdi.extensions.web.shown import Shown, in_a_terminal, seen_of, still
from pyvista_vdi.model.vdi import VDI

#: Longest edge of a thumbnail, pixels.
_THUMBNAIL = 240


def mime_bundle(
    vdi: Shown,
    include: Collection[str] | None = None,
    exclude: Collection[str] | None = None,
) -> Any:
    """Return what IPython shows of a VDI, a series or a set: a viewer and a picture.

    Or what there can be of it.
    """
    if in_a_terminal():
        return {}
    try:
        from pyvista_vdi.extensions.web.widget import VDIWidget
    except MissingDependencyError as error:
        picture, text = still(seen_of(vdi)), {"text/plain": f"{vdi!r}\n{error}"}
        if picture is None:
            return text
        shown = f"{_html(vdi, picture)}<br>{html.escape(str(error))}"
        return {**text, "text/html": shown, "image/png": picture}
    data, metadata = VDIWidget(vdi)._repr_mimebundle_(include=include, exclude=exclude)
    return {**data, "text/plain": repr(vdi)}, metadata


def show_plotter(plotter: Any, *, screenshot: Any = None, **options: Any) -> Any:
    """Return what a notebook shows of a plotter: PyVista's backend ``"vdi"``.

    PyVista takes a backend that a package brings by itself where trame's are not installed. So a
    scene without VDIs is shown as if there were no such backend.

    All renderers of the plotter are shown, and a picture is saved as ``screenshot``; ``options``
    are those of PyVista's other backends.
    """
    import pyvista as pv
    from pyvista.jupyter.notebook import handle_plotter

    from pyvista_vdi.extensions.web.scene import is_vdi, scenes_of

    plotter.render()  # VDIs are made in the first frame
    props = (prop for renderer in plotter.renderers for prop in renderer.GetViewProps())
    try:
        if any(is_vdi(prop) and prop.GetVisibility() for prop in props):
            from pyvista_vdi.extensions.web.plotter_widget import PlotterWidget, SubplotsWidget

            scenes = scenes_of(plotter, "the notebook's viewer", follow=True)
            picture = plotter.screenshot(screenshot, return_img=True)
            if len(scenes) > 1:
                return SubplotsWidget(plotter, scenes, picture)
            return PlotterWidget(plotter, plotter.renderer, scenes[0], picture)
    except MissingDependencyError as error:
        warn_external(str(error))
    # The backend that PyVista would take if there were no "vdi"
    others = [one.name for one in pv.registered_jupyter_backends() if one.name != "vdi"]
    backend = "trame" if "trame" in others else next(iter(others), "static")
    return handle_plotter(plotter, backend=backend, screenshot=screenshot, **options)


def html_of(vdi: VDI) -> str | None:
    """Return a thumbnail and the figures of a VDI, or the figures alone; nothing in a terminal."""
    return None if in_a_terminal() else _html(vdi, still(vdi, longest=_THUMBNAIL))


def _html(vdi: Shown, picture: str | None) -> str:
    words = f"<code>{html.escape(repr(vdi))}</code>"
    return words if picture is None else f'<img src="data:image/png;base64,{picture}"><br>{words}'
