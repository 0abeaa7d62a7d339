"""``Plotter.add_vdi``: a VDI in place of a volume, with ``add_volume``'s arguments."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pyvista as pv
import pyvista.plotting  # whole: pv.Plotter is missing while another thread imports it

from pyvista_vdi.model.arguments import takes
from pyvista_vdi.model.types import AnyVolume
from pyvista_vdi.plotting.actor import PlotterVDIActor
from pyvista_vdi.plotting.adding import Addition, added
from pyvista_vdi.plotting.registration import Component
from pyvista_vdi.vtk_pipeline.vtk import weakly


@pv.register_plotter_component("add_vdi", override=True)  # of registration._Pending
class AddVDI(Component):
    """Add VDIs to a plotter: ``plotter.add_vdi(volume)``; :meth:`__call__` has the arguments.

    Parameters
    ----------
    plotter : pyvista.BasePlotter
        Held weakly.
    """

    def __init__(self, plotter: Any) -> None:
        super().__init__(plotter)
        self._actors: list[Callable[[], Any]] = []

    @takes(
        asked=Addition,
        order=inspect.signature(pv.Plotter.add_volume).parameters,
        aliases={"rng": "clim", "colormap": "cmap", "backface_culling": "culling"},
    )
    def __call__(self, volume: AnyVolume, asked: Addition) -> PlotterVDIActor | list[Any]:
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
            that the view requires is shown (``actor.level``). Or a VDI, also as
            ``pyvista.read("x.vdi")`` gives it, a :class:`VDISeries`, which plays
            (``actor.play()``, ``actor.time``), or a :class:`VDISet`, of which the nearest to the
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
            how it is drawn. Changes to ``actor.prop``, to the array's values or to the mask are in
            the next picture. A ``MultiBlock`` gives a list of actors.

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
        asked = replace(asked, look=replace(asked.look, theme=self._plotter._theme))
        made = added(self._plotter, volume, asked)
        self._remember(made)
        return made  # type: ignore[no-any-return]

    __doc__ = __call__.__doc__  # PyVista hands out an object where users look for the method

    def _remember(self, made: Any) -> None:
        """Keep actors in mind, weakly, until the plotter is closed."""
        for each in made if isinstance(made, list) else [made]:
            if isinstance(each, list):
                self._remember(each)
            else:
                self._actors.append(weakly(each))

    def __plotter_close__(self) -> None:
        """Release images and textures, even where the user keeps an actor."""
        for weak in self._actors:
            actor = weak()
            if actor is not None and actor._refinement is not None:
                actor._refinement.stop()
            if actor is not None and actor.mapper is not None:
                actor.mapper.driver.release()
        self._actors.clear()

    def __plotter_deep_clean__(self) -> None:
        """Nothing else is held."""
