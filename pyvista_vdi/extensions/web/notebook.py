"""What notebooks show of VDIs, and of plotters with VDIs."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from pyvista_vdi.errors import MissingDependencyError, warn_external
from pyvista_vdi.extensions.web.shown import Shown, seen_of, shell, still
from pyvista_vdi.model.collection import VDICollection


def mime_bundle(
    vdi: Shown,
    include: Collection[str] | None = None,
    exclude: Collection[str] | None = None,
) -> Any:
    """Return what IPython shows of a VDI, a series or a set: a viewer and a picture.

    Or what there can be of it.
    """
    in_a_terminal = shell() is not None and not hasattr(shell(), "kernel")
    of_values = isinstance(vdi, VDICollection) and vdi.value_range is not None
    if in_a_terminal or of_values:  # pages of several show colours
        return {}
    try:
        from pyvista_vdi.extensions.web.widget import VDIWidget
    except MissingDependencyError as error:
        picture, text = still(seen_of(vdi)), {"text/plain": f"{vdi!r}\n{error}"}
        return text if picture is None else {**text, "image/png": picture}
    data, metadata = VDIWidget(vdi)._repr_mimebundle_(include=include, exclude=exclude)
    return {**data, "text/plain": repr(vdi)}, metadata


def show_plotter(plotter: Any, *, screenshot: Any = None, **options: Any) -> Any:
    """Return what a notebook shows of a plotter: PyVista's backend ``"vdi"``.

    PyVista takes a backend that a package brings by itself where trame's are not installed. So a
    scene without VDIs, and one of several renderers, is shown as if there were no such backend.

    A picture is saved as ``screenshot``; ``options`` are those of PyVista's other backends.
    """
    import pyvista as pv
    from pyvista.jupyter.notebook import handle_plotter

    from pyvista_vdi.extensions.web.scene import is_vdi, scene_of

    plotter.render()  # VDIs are made in the first frame
    props = (prop for renderer in plotter.renderers for prop in renderer.GetViewProps())
    try:
        if any(is_vdi(prop) and prop.GetVisibility() for prop in props):
            from pyvista_vdi.extensions.web.plotter_widget import PlotterWidget

            if len(plotter.renderers) == 1:
                scene = scene_of(plotter, "the notebook's viewer", follow=True)
                picture = plotter.screenshot(screenshot, return_img=True)
                return PlotterWidget(plotter, scene, picture)
            warn_external("the notebook's viewer shows VDIs of one renderer alone, not subplots")
    except MissingDependencyError as error:
        warn_external(str(error))
    # The backend that PyVista would take if there were no "vdi"
    others = [one.name for one in pv.registered_jupyter_backends() if one.name != "vdi"]
    backend = "trame" if "trame" in others else next(iter(others), "static")
    return handle_plotter(plotter, backend=backend, screenshot=screenshot, **options)
