"""``volume.vdi.generate(...)``: the accessor on PyVista's data sets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pyvista as pv

from pyvista_vdi.api import generate
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.vtk_pipeline.filters.convert import require_image


@pv.register_dataset_accessor("vdi", pv.DataSet)
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
