"""What notebooks show of VDIs, and of plotters with VDIs."""

from __future__ import annotations

import html
import sys
from collections.abc import Collection
from typing import Any

from pyvista_vdi.errors import MissingDependencyError, warn_external
from pyvista_vdi.extensions.web.still import still
from pyvista_vdi.model.vdi import VDI

#: Longest edge of a thumbnail, pixels.
_THUMBNAIL = 240


def mime_bundle(
    vdi: VDI, include: Collection[str] | None = None, exclude: Collection[str] | None = None
) -> Any:
    """Return what IPython shows of a VDI: a viewer and a picture, or what there can be of it."""
    if _in_a_terminal():
        return {}
    try:
        from pyvista_vdi.extensions.web.widget import VDIWidget
    except MissingDependencyError as error:
        return _without_a_viewer(vdi, str(error))
    data, metadata = VDIWidget(vdi)._repr_mimebundle_(include=include, exclude=exclude)
    return {**data, "text/plain": repr(vdi)}, metadata


def show_plotter(plotter: Any, *, screenshot: Any = None, **options: Any) -> Any:
    """Return what a notebook shows of a plotter: PyVista's backend ``"vdi"``.

    PyVista takes a backend that a package brings by itself where trame's are not installed. So a
    scene without VDIs is shown as if there were no such backend.

    Parameters
    ----------
    plotter : pyvista.Plotter
        Its active renderer is shown.
    screenshot : path-like or file-like, optional
        Where a picture is saved besides.
    **options
        Those of PyVista's other backends, for scenes without VDIs.

    Returns
    -------
    PlotterWidget
        The viewer; or what another backend returns.
    """
    from pyvista_vdi.vtk_pipeline.drawing.actor import VDIActorMethods

    plotter.render()  # VDIs are made in the first frame
    renderer = plotter.renderer
    shown = [actor for actor in renderer.actors.values() if actor.GetVisibility()]
    if not any(isinstance(actor, VDIActorMethods) for actor in shown):
        return _shown_by_pyvista(plotter, screenshot, options)
    try:
        from pyvista_vdi.extensions.web.plotter_widget import PlotterWidget
    except MissingDependencyError as error:
        warn_external(str(error))
        return _shown_by_pyvista(plotter, screenshot, options)
    from pyvista_vdi.extensions.web.scenes.export import around, several_of
    from pyvista_vdi.extensions.web.scenes.scene import scene_of

    scene = scene_of(renderer, renderer.actors, camera=False)
    without = [*scene.left_out, *around(plotter)]
    if without:
        warn_external(
            f"the notebook's viewer shows the scene without {', '.join(without)}: see all by "
            'jupyter_backend="server"'
        )
    steps = several_of(renderer, [actor for actor in scene.actors if actor.series is not None])
    if steps:
        warn_external(
            f"the notebook's viewer shows one of {', '.join(steps)}, and has no controls: set "
            "actor.time and call plotter.render() for another, or have a page that plays written "
            "by plotter.vdi.export_html"
        )
    return PlotterWidget(plotter, scene, plotter.screenshot(screenshot, return_img=True))


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


def _without_a_viewer(vdi: VDI, why: str) -> dict[str, str]:
    text = {"text/plain": f"{vdi!r}\n{why}"}
    picture = still(vdi)
    if picture is None:
        return text
    shown = f"{_html(vdi, picture)}<br>{html.escape(why)}"
    return {**text, "text/html": shown, "image/png": picture}


def html_of(vdi: VDI) -> str | None:
    """Return a thumbnail and the figures of a VDI, or the figures alone; nothing in a terminal."""
    return None if _in_a_terminal() else _html(vdi, still(vdi, longest=_THUMBNAIL))


def _html(vdi: VDI, picture: str | None) -> str:
    words = f"<code>{html.escape(repr(vdi))}</code>"
    return words if picture is None else f'<img src="data:image/png;base64,{picture}"><br>{words}'
