"""``Plotter``: PyVista's, as editors and type checkers see it with what this package adds."""

from __future__ import annotations

import pyvista as pv

from pyvista_vdi.plotting.add_transfer_function_editor import AddTransferFunctionEditor
from pyvista_vdi.plotting.clip_plane import AddVDIClipPlane
from pyvista_vdi.plotting.component import AddVDI
from pyvista_vdi.plotting.pages import PlotterVDIs


class Plotter(pv.Plotter):
    """A :class:`pyvista.Plotter` that says what this package adds to it.

    Every plotter of PyVista's has ``add_vdi`` where this package is installed; tools that read code
    do not know that. Of this one they complete and check ``add_vdi``, ``add_vdi_clip_plane``,
    ``add_transfer_function_editor`` and ``vdi.export_html``. It does what PyVista's does, and takes
    its arguments.

    Examples
    --------
    >>> import pyvista_vdi as pvdi
    >>> plotter = pvdi.Plotter(off_screen=True)
    >>> actor = plotter.add_vdi(pvdi.examples.load_brain(), cmap="mri-brain")
    >>> plotter.close()
    """

    add_vdi: AddVDI
    add_vdi_clip_plane: AddVDIClipPlane
    add_transfer_function_editor: AddTransferFunctionEditor
    vdi: PlotterVDIs
