"""``volume.vdi.generate(...)`` and ``.plot(...)``: the accessor on PyVista's data sets."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from importlib import import_module
from typing import Any

import pyvista as pv

from pyvista_vdi.api import generate
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.vtk_pipeline.filters.convert import require_image


@pv.register_dataset_accessor("vdi", pv.DataSet, override=True)  # of registration._Pending
class VDIAccessor:
    """Makes VDIs of a data set: ``volume.vdi``.

    Parameters
    ----------
    dataset : pyvista.DataSet
        Any; what is not a ``pyvista.ImageData`` is refused when it is used, with the remedy.
    """

    def __init__(self, dataset: pv.DataSet) -> None:
        self._dataset = dataset

    def generate(self, camera: Any, window_size: Sequence[int], **arguments: Any) -> VDI:
        """Generate a VDI of this volume.

        Parameters
        ----------
        camera : pyvista.Camera or vtkCamera or Camera
            The generating view, for instance ``plotter.camera``.
        window_size : (int, int)
            Width and height in pixels: lists along each edge of the viewport.
        **arguments
            All keyword arguments of :func:`pyvista_vdi.generate`: ``add_volume``'s
            classification, ``max_supersegments``, ``sample_distance`` and so on.

        Returns
        -------
        VDI
            The VDI.

        Examples
        --------
        >>> import pyvista as pv
        >>> volume = pv.Wavelet()
        >>> plotter = pv.Plotter(off_screen=True)
        >>> plotter.camera = pv.Camera()
        >>> plotter.camera.position = (60, 20, 50)
        >>> vdi = volume.vdi.generate(plotter.camera, (64, 48), cmap="bone")  # doctest: +SKIP
        """
        return generate(require_image(self._dataset), camera, window_size, **arguments)

    def plot(
        self,
        *,
        cpos: Any = None,
        zoom: Any = None,
        background: Any = None,
        text: str = "",
        show_axes: bool | None = None,
        show_bounds: bool = False,
        show_grid: bool = False,
        parallel_projection: bool = False,
        eye_dome_lighting: bool = False,
        anti_aliasing: Any = None,
        **arguments: Any,
    ) -> Any:
        """Show this volume's VDI in a window of its own, as ``plot(volume=True)`` shows the volume.

        Parameters
        ----------
        cpos, zoom, background, text, show_axes, show_bounds, show_grid, parallel_projection
            As for ``pyvista.plot``.
        eye_dome_lighting, anti_aliasing
            As for ``pyvista.plot``.
        **arguments
            Those of ``pyvista.Plotter`` (``off_screen``, ``window_size``, ``theme`` and so on) and
            of its ``show`` (``screenshot``, ``return_img``, ``jupyter_backend`` and so on); all
            others go to ``Plotter.add_vdi``.

        Returns
        -------
        object
            What ``Plotter.show`` returns: a picture with ``return_img=True``, the camera's position
            with ``return_cpos=True``, else nothing, or a notebook's viewer.

        Raises
        ------
        TypeError
            If a keyword is unknown.

        Examples
        --------
        >>> import pyvista as pv
        >>> pv.Wavelet().vdi.plot(cmap="bone", zoom=1.2)  # doctest: +SKIP
        """
        shown = self._dataset
        if isinstance(shown, VDI):
            arguments.setdefault("window_size", [*shown.picture_size])
        import_module("pyvista.plotting")  # pv.Plotter is missing while another thread does so
        plotter = pv.Plotter(**_taken(arguments, pv.Plotter.__init__))
        showing = _taken(arguments, pv.Plotter.show, "jupyter_kwargs")
        try:
            if plotter.theme.axes.show if show_axes is None else show_axes:
                plotter.add_axes()
            if background is not None:
                plotter.set_background(background)
            plotter.add_vdi(shown, **arguments)
            if text:
                plotter.add_text(text)
            if show_grid:
                plotter.show_grid()
            elif show_bounds:
                plotter.show_bounds()
            if cpos is not None:
                plotter.camera_position = cpos
            if parallel_projection:
                plotter.enable_parallel_projection()
            if eye_dome_lighting:
                plotter.enable_eye_dome_lighting()
            if anti_aliasing is False:
                plotter.disable_anti_aliasing()
            elif anti_aliasing is not None:
                plotter.enable_anti_aliasing("msaa" if anti_aliasing is True else anti_aliasing)
            if zoom is not None:
                plotter.camera.zoom(zoom)
            return plotter.show(**showing)
        except BaseException:
            plotter.close()  # PyVista keeps those that are not
            raise


def _taken(arguments: dict[str, Any], function: Any, *more: str) -> dict[str, Any]:
    """Take those of the arguments that are a function's own, and return them."""
    own = {*inspect.signature(function).parameters, *more}
    return {name: arguments.pop(name) for name in [*arguments] if name in own}
