"""``Plotter.add_vdi_clip_plane``: a VDI with a plane widget that clips it."""

from __future__ import annotations

import inspect
from typing import Any

import pyvista as pv
import pyvista.plotting  # whole: pv.Plotter is missing while another thread imports it

from pyvista_vdi.plotting.registration import Component


@pv.register_plotter_component("add_vdi_clip_plane", override=True)  # of registration._Pending
class AddVDIClipPlane(Component):
    """Adds VDIs that a plane widget clips: ``plotter.add_vdi_clip_plane(volume)``.

    ``plotter``: held weakly.
    """

    def __call__(self, volume: Any, **arguments: Any) -> Any:
        """Clip a VDI by a plane widget, as ``Plotter.add_volume_clip_plane`` clips a volume.

        Moving the plane makes no other VDI.

        Parameters
        ----------
        volume : pyvista.ImageData or numpy.ndarray or Volume or VDI or PlotterVDIActor
            What :meth:`AddVDI.__call__` takes, or the actor that it has returned.
        **arguments
            Those of ``Plotter.add_volume_clip_plane`` (``normal``, ``origin``,
            ``interaction_event`` and so on); all others go to ``Plotter.add_vdi``, and none may be
            given with an actor.

        Returns
        -------
        vtkImplicitPlaneWidget or vtkPlaneWidget
            The widget. The actor is ``plotter.volume``.

        Raises
        ------
        InvalidArgumentError
            If the plotter is gone.
        TypeError
            If a keyword is unknown.

        Examples
        --------
        >>> import pyvista as pv
        >>> plotter = pv.Plotter()
        >>> widget = plotter.add_vdi_clip_plane(pv.Wavelet(), normal="x", cmap="bone")
        >>> plotter.show()  # doctest: +SKIP
        """
        plotter = self._plotter
        taken = inspect.signature(type(plotter).add_volume_clip_plane).parameters
        own = {name: arguments.pop(name) for name in [*arguments] if name in taken}
        if not isinstance(volume, pv.plotting.volume.Volume):
            volume, arguments = plotter.add_vdi(volume, **arguments), {}
        return plotter.add_volume_clip_plane(volume, **own, **arguments)
