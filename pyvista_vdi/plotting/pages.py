"""``plotter.vdi``: what is done with a plotter's VDIs."""

from __future__ import annotations

import io
import os

import pyvista as pv
import pyvista.plotting  # whole: pv.Plotter is missing while another thread imports it

from pyvista_vdi import registry
from pyvista_vdi.plotting.registration import Component


@pv.register_plotter_component("vdi", override=True)  # of registration._Pending
class PlotterVDIs(Component):
    """Writes pages of a plotter's scene: ``plotter.vdi.export_html("scene.html")``.

    Parameters
    ----------
    plotter : pyvista.BasePlotter
        Held weakly.
    """

    def export_html(self, filename: str | os.PathLike[str] | None) -> io.StringIO | None:
        """Write one HTML file that shows the plotter's scene, VDIs included, and turns it.

        It opens from disk, offline, in any browser with WebGL 2, and needs no trame. A series
        plays in it, and of a set the VDI nearest to the view is drawn.

        Parameters
        ----------
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
        InvalidArgumentError
            If the plotter is gone, or has subplots.

        Examples
        --------
        >>> import pyvista as pv
        >>> plotter = pv.Plotter(off_screen=True)
        >>> actor = plotter.add_vdi(pv.Wavelet(), cmap="bone")
        >>> plotter.vdi.export_html("scene.html")  # doctest: +SKIP
        """
        export = registry.method("plotter.vdi.export_html")
        return export(self._plotter, filename)  # type: ignore[no-any-return]
