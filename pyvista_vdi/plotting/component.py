"""``Plotter.add_vdi``, with ``add_volume``'s arguments, and ``Plotter.vdi``, what it has beside."""

from __future__ import annotations

import inspect
import io
import os
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, get_type_hints

import pyvista as pv
import pyvista.plotting  # whole: pv.Plotter is missing while another thread imports it

from pyvista_vdi import registry
from pyvista_vdi.model.arguments import takes
from pyvista_vdi.model.types import AnyVolume
from pyvista_vdi.plotting.actor import PlotterVDIActor
from pyvista_vdi.plotting.adding import Addition, added
from pyvista_vdi.plotting.registration import Component
from pyvista_vdi.vtk_pipeline.vtk import weakly

if TYPE_CHECKING:
    from pyvista_vdi.plotting.editor import TransferFunctionEditor


@pv.register_plotter_component("add_vdi", override=True)  # of registration._Pending
class AddVDI(Component):
    """Add VDIs to a plotter: ``plotter.add_vdi(volume)``; :meth:`__call__` has the arguments.

    Parameters
    ----------
    plotter : pyvista.BasePlotter
        Held weakly.
    """

    @takes(
        **get_type_hints(Addition),
        without=("lights",),  # they are the plotter's
        order=inspect.signature(pv.Plotter.add_volume).parameters,
        aliases={"rng": "clim", "colormap": "cmap", "backface_culling": "culling"},
    )
    def __call__(self, volume: AnyVolume, **asked: Any) -> PlotterVDIActor | list[Any]:
        """Add a volume that turns fluently: frames are raycast from its VDI where it serves.

        All arguments of ``Plotter.add_volume`` are taken, with its names, defaults and meaning;
        what cannot be honoured is refused by name. The picture is ``add_volume``'s.

        In a window on the screen, frames get fewer pixels while the view moves, as many as
        ``target_fps`` allows; a view for which the VDI does not do is given one of its own, in the
        background. What is drawn off-screen, and every screenshot, is full, and drawn by the VDI or
        the volume itself, whichever is right; a script that takes one picture makes no VDI.

        Parameters
        ----------
        volume : pyvista.ImageData, numpy.ndarray, pyvista.MultiBlock, Volume, path, or VDIs
            A uniform grid, or a rectilinear one of equidistant points; a NumPy array as
            ``add_volume`` takes it; blocks of uniform grids; a file, or a store, of which the level
            that the view requires is shown. Or a VDI, also as
            ``pyvista.read("x.vdi")`` gives it, a :class:`VDISeries`, which ``actor.player``
            plays, or a :class:`VDISet`, of which the nearest to the
            view is drawn. With VDIs nothing is generated, arguments that only a volume can honour
            are refused, and where nobody has set the camera, the plotter opens from the VDI's own
            view. A :class:`DeferredVDI`, or a series or a set of such, takes a look (``cmap``,
            ``opacity``, ``clim`` ...), which ``actor.prop`` changes.

        Returns
        -------
        PlotterVDIActor or list
            A ``pyvista.Volume``; ``actor.vdi`` is the VDI, made whenever it is asked for and there
            is none, before the first picture too, for the view that this would have,
            ``actor.regenerate()`` makes another from the current view, and ``actor.status`` says
            how it is drawn. Changes to ``actor.prop`` or to the array's values are in the next
            picture. A ``MultiBlock`` gives a list of actors.

        Raises
        ------
        TypeError
            If a keyword is unknown. Other errors are, besides, those that ``add_volume`` raises: a
            TypeError for a type that is not taken, a KeyError for an array that is not there.
        InvalidVolumeError, InvalidArgumentError, InvalidCameraError, InvalidVDIError
            If an argument cannot be used.
        UnsupportedError
            If something is asked for that a VDI cannot honour.
        NoDeviceError, MissingDependencyError
            If there is no device, or a colour map's package is not installed.

        Examples
        --------
        >>> import pyvista as pv
        >>> import pyvista_vdi
        >>> plotter = pv.Plotter()
        >>> actor = plotter.add_vdi(pyvista_vdi.examples.load_brain(), cmap="bone")
        >>> plotter.show()  # doctest: +SKIP
        """
        plotter = self._plotter
        look = replace(asked.pop("look"), theme=plotter.theme)
        made: Any = added(plotter, volume, Addition(look=look, **asked))
        found = [made]
        while found:  # lists of blocks within blocks
            each = found.pop()
            if isinstance(each, list):
                found += each
            else:
                self._made.append(weakly(each))
        return made  # type: ignore[no-any-return]

    __doc__ = __call__.__doc__  # PyVista hands out an object where users look for the method

    def __plotter_close__(self) -> None:
        """Release images and textures, even where the user keeps an actor."""
        for weak in self._made:
            actor = weak()
            if actor is not None and actor.mapper is not None:
                actor.mapper.driver.release()
        self._made.clear()


@pv.register_plotter_component("vdi", override=True)  # of registration._Pending
class PlotterVDIs(Component):
    """What a plotter's VDIs have beside them: a page of the scene, and editors.

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

    def add_transfer_function_editor(
        self,
        actor: Any,
        *,
        loc: Sequence[float] = (0.58, 0.66),
        size: Sequence[float] = (0.4, 0.32),
    ) -> TransferFunctionEditor:
        """Edit the opacities and colours of a volume over its picture and its values' histogram.

        A double-click on it gives it the mouse, as with all charts of PyVista's, and one beside it
        gives it back to the camera. Then points of the opacity curve are dragged, added by a click,
        and deleted by the Delete key.

        Parameters
        ----------
        actor : pyvista.Volume or vtkVolume
            Of ``add_volume``, or of ``add_vdi`` with a volume or a :class:`DeferredVDI`. Its
            property is edited; what others change of it is shown with the next frame.
        loc, size : (float, float), optional
            Lower left corner, and width and height, as shares of the viewport.

        Returns
        -------
        TransferFunctionEditor
            The same by program: ``points``, ``apply_cmap``, ``remove``.

        Raises
        ------
        UnsupportedError
            If there is nothing to edit: RGBA brings its colours, and so does a VDI without its
            volume, unless it keeps values.
        InvalidArgumentError
            If the actor is no volume of this plotter, or another argument cannot be used.
        """
        from pyvista_vdi.plotting.editor import TransferFunctionEditor

        editor = TransferFunctionEditor(self._plotter, actor, loc, size)
        for each in self._made:
            if each.actor is actor:
                each.remove()
        self._made = [*(each for each in self._made if each.renderer is not None), editor]
        self._plotter.render()
        return editor

    def __plotter_close__(self) -> None:
        """Observe nothing any more."""
        for each in self._made:
            each.remove()
