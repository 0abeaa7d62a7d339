"""What notebooks show of VDIs, and of plotters with VDIs."""

from __future__ import annotations

import html
import sys
from collections.abc import Collection
from typing import Any

from pyvista_vdi.errors import MissingDependencyError, warn_external
from pyvista_vdi.extensions.series.series import VDISeries
from pyvista_vdi.extensions.sets.vdi_set import VDISet
from pyvista_vdi.extensions.web.still import still
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.vdi import VDI

#: Longest edge of a thumbnail, pixels.
_THUMBNAIL = 240


def mime_bundle(
    vdi: VDI | DeferredVDI | VDISeries | VDISet,
    include: Collection[str] | None = None,
    exclude: Collection[str] | None = None,
) -> Any:
    """Return what IPython shows of a VDI, a series or a set: a viewer and a picture.

    Or what there can be of it.
    """
    if _in_a_terminal():
        return {}
    try:
        from pyvista_vdi.extensions.web.widget import VDIWidget
    except MissingDependencyError as error:
        shown = vdi.classified() if isinstance(vdi, DeferredVDI) else vdi
        return _without_a_viewer(shown, str(error))
    data, metadata = VDIWidget(vdi)._repr_mimebundle_(include=include, exclude=exclude)
    return {**data, "text/plain": repr(vdi)}, metadata


def show_plotter(plotter: Any, *, screenshot: Any = None, **options: Any) -> Any:
    """Return what a notebook shows of a plotter: PyVista's backend ``"vdi"``.

    PyVista takes a backend that a package brings by itself where trame's are not installed. So a
    scene without VDIs is shown as if there were no such backend.

    Parameters
    ----------
    plotter : pyvista.Plotter
        All of its renderers are shown.
    screenshot : path-like or file-like, optional
        Where a picture is saved besides.
    **options
        Those of PyVista's other backends, for scenes without VDIs.

    Returns
    -------
    PlotterWidget or SubplotsWidget
        The viewer, or a box with one for each renderer; or what another backend returns.
    """
    from pyvista_vdi.vtk_pipeline.drawing.actor import VDIActorMethods

    plotter.render()  # VDIs are made in the first frame
    actors = [actor for renderer in plotter.renderers for actor in renderer.actors.values()]
    shown = [actor for actor in actors if actor.GetVisibility()]
    if not any(isinstance(actor, VDIActorMethods) for actor in shown):
        return _shown_by_pyvista(plotter, screenshot, options)
    try:
        from pyvista_vdi.extensions.web.plotter_widget import PlotterWidget, SubplotsWidget
    except MissingDependencyError as error:
        warn_external(str(error))
        return _shown_by_pyvista(plotter, screenshot, options)
    from pyvista_vdi.extensions.web.scenes.export import not_played
    from pyvista_vdi.extensions.web.scenes.scene import scene_of

    scenes, without = [], []
    for renderer in plotter.renderers:
        scene = scene_of(renderer, renderer.actors, camera=False, needs_vdi=False)
        without += scene.left_out
        without += [f"all but one of {what}" for what in not_played(renderer, scene.actors)]
        scenes.append(scene)
    if without:
        words = ", ".join(dict.fromkeys(without))
        warn_external(
            f"the notebook's viewer shows the scene without {words}: see all by "
            'jupyter_backend="server"'
        )
    picture = plotter.screenshot(screenshot, return_img=True)
    if len(scenes) > 1:
        return SubplotsWidget(plotter, scenes, picture)
    return PlotterWidget(plotter, plotter.renderer, scenes[0], picture)


def _shown_by_pyvista(plotter: Any, screenshot: Any, options: dict[str, Any]) -> Any:
    """Show a plotter by the backend that PyVista would take if there were no ``"vdi"``."""
    import pyvista as pv
    from pyvista.jupyter.notebook import handle_plotter

    others = [one.name for one in pv.registered_jupyter_backends() if one.name != "vdi"]
    backend = "trame" if "trame" in others else next(iter(others), "static")
    return handle_plotter(plotter, backend=backend, screenshot=screenshot, **options)


def _in_a_terminal() -> bool:
    """Whether IPython shows text alone; other notebooks may have no IPython at all."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    return shell is not None and not hasattr(shell, "kernel")


def _without_a_viewer(vdi: VDI | VDISeries | VDISet, why: str) -> dict[str, str]:
    text = {"text/plain": f"{vdi!r}\n{why}"}
    first = vdi[vdi.nearest(vdi.camera)] if isinstance(vdi, VDISet) else vdi
    picture = still(first[0] if isinstance(first, VDISeries) else first)
    if picture is None:
        return text
    shown = f"{_html(vdi, picture)}<br>{html.escape(why)}"
    return {**text, "text/html": shown, "image/png": picture}


def html_of(vdi: VDI) -> str | None:
    """Return a thumbnail and the figures of a VDI, or the figures alone; nothing in a terminal."""
    return None if _in_a_terminal() else _html(vdi, still(vdi, longest=_THUMBNAIL))


def _html(vdi: VDI | VDISeries | VDISet, picture: str | None) -> str:
    words = f"<code>{html.escape(repr(vdi))}</code>"
    return words if picture is None else f'<img src="data:image/png;base64,{picture}"><br>{words}'
