"""``Plotter.add_vdi``: a VDI in place of a volume, with ``add_volume``'s arguments."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import pyvista as pv
from numpy.typing import ArrayLike, NDArray

from pyvista_vdi.model.classification import ArrayChoice, refuse_keywords
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.deferred import DeferredVDI
from pyvista_vdi.model.options import Deferral, GenerationOptions, QualityTarget
from pyvista_vdi.model.render_options import DrawingOptions, Policy
from pyvista_vdi.model.types import (
    CameraLike,
    ColorMapLike,
    Coverage,
    Criterion,
    DeviceLike,
    Draw,
    Interpolation,
    MatrixLike,
    MemoryLike,
    OcclusionLike,
    OpacityLike,
    Precision,
    Preference,
    Quality,
    RangeLike,
    ScalarsLike,
    VDILike,
    VolumeLike,
)
from pyvista_vdi.plotting.actor import PlotterVDIActor
from pyvista_vdi.plotting.adding import Addition, Placement, added, added_blocks
from pyvista_vdi.plotting.classify import Looks, blending_name, note_mapper
from pyvista_vdi.plotting.registration import Component
from pyvista_vdi.vtk_pipeline.vtk import vtkMultiBlockDataSet, weakly

#: What is added: a volume, or what is made of one already.
Volumes: TypeAlias = VolumeLike | VDILike | NDArray[Any] | VDICollection | DeferredVDI

#: ``add_volume``'s aliases.
_ALIASES = ("rng", "colormap", "backface_culling")


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

    def __call__(
        self,
        volume: Volumes,
        scalars: ScalarsLike | None = None,
        clim: RangeLike | None = None,
        resolution: Sequence[float] | None = None,
        opacity: OpacityLike = "linear",
        n_colors: int = 256,
        cmap: ColorMapLike | None = None,
        flip_scalars: bool = False,
        reset_camera: bool | None = None,
        name: str | None = None,
        ambient: float | None = None,
        categories: bool | int = False,
        culling: bool | str = False,
        multi_colors: bool = False,
        blending: str | int = "composite",
        mapper: str | None = None,
        scalar_bar_args: dict[str, Any] | None = None,
        show_scalar_bar: bool | None = None,
        annotations: dict[float, str] | None = None,
        pickable: bool = True,
        preference: Preference = "point",
        opacity_unit_distance: float | None = None,
        shade: bool = False,
        diffuse: float | None = 0.7,
        specular: float | None = 0.2,
        specular_power: float | None = 10.0,
        render: bool | None = True,
        user_matrix: MatrixLike | None = None,
        log_scale: bool = False,
        *,
        resample: str | Sequence[int] | None = None,
        mask: VolumeLike | NDArray[Any] | None = None,
        max_supersegments: int = 20,
        criterion: Criterion = "least-error",
        sample_distance: float | None = None,
        tolerance: float = 0.0,
        view_cone: float = 60.0,
        precision: Precision = "exact",
        quality: Quality | None = None,
        target_ssim: float | None = None,
        full_fps: float | None = None,
        max_bytes: float | None = None,
        target_angle: float = 30.0,
        ambient_occlusion: OcclusionLike | None = None,
        memory_limit: MemoryLike | None = None,
        interpolation: Interpolation = "nearest",
        camera: CameraLike | None = None,
        coverage: Coverage = "bounds",
        target_fps: float | None = 30.0,
        adjust_multi_samples: bool = True,
        regenerate: Policy = "auto",
        regenerate_below: float | None = None,
        draw: Draw = "auto",
        status: bool = False,
        device: DeviceLike | None = None,
        progress_bar: bool | Callable[[float], object] | None = None,
        classification: str = "baked",
        value_range: RangeLike | None = None,
        importance: ArrayLike | None = None,
        **aliases: Any,
    ) -> PlotterVDIActor | list[Any]:
        """Add a volume that turns fluently: frames are raycast from its VDI where it serves.

        All arguments of ``Plotter.add_volume`` are taken, with its names, defaults and meaning;
        what cannot be honoured is refused by name. The picture is ``add_volume``'s.

        In a window on the screen, frames get fewer pixels while the view moves, as many as
        ``target_fps`` allows, and all of them as soon as it rests; a view for which the VDI does
        not do is given one of its own, made in the background while the old one is drawn. What is
        drawn off-screen, and every screenshot, is full, and drawn by the VDI or the volume itself,
        whichever is right for the view; a script that takes one picture makes no VDI.

        Parameters
        ----------
        volume : pyvista.ImageData, numpy.ndarray, pyvista.MultiBlock, Volume, path, or VDIs
            A file as :func:`pyvista_vdi.read_volume` or :func:`pyvista_vdi.read` reads it; of a
            store, what :func:`pyvista_vdi.open_volume` opens, the level that the view requires
            (``actor.level``), and a finer one when the view comes nearer. A
            uniform grid, or a rectilinear one of equidistant points (other grids are refused,
            with the remedy), a NumPy array as ``add_volume`` takes it, blocks of uniform grids, a
            VDI, a VDI as ``pyvista.read("x.vdi")`` gives it, a :class:`VDISeries`, which plays
            (``actor.play()``, ``actor.time``), or a :class:`VDISet`, of which the nearest to the
            view is drawn. With VDIs nothing is generated, and arguments that
            only a volume can honour are refused; where nobody has set the camera, the plotter opens
            from the VDI's own view, ``plotter.camera = vdi.camera.to_pyvista()``. A
            :class:`DeferredVDI`, or a series or a set of such, takes a look (``cmap``,
            ``opacity``, ``clim`` ...), which ``actor.prop`` changes.
        scalars : str or numpy.ndarray, optional
            Name of an array, or the values, per point or per cell; RGBA as uint8 (n, 4).
        clim : float or (float, float), optional
            Range of the colour map; all values by default.
        resolution : (float, float, float), optional
            Spacing of a NumPy array; 1 by default.
        opacity : str or float or array_like
            As in ``add_volume``: an array of length ``n_colors`` is taken as it is, 0 to 255;
            a shorter one is 0 to 1 and interpolated.
        n_colors : int
            Entries of the colour map.
        cmap : str, list, matplotlib colour map or pyvista.LookupTable, optional
            Colour map; the theme's by default.
        flip_scalars : bool
            Reverse the colour map.
        reset_camera, name, culling, pickable, render
            As in ``add_volume``.
        ambient, diffuse, specular, specular_power, shade
            As in ``add_volume``: without ``shade`` the others change nothing. A shaded VDI is lit
            by the lights of the plotter that shows it, as they stand in its generating view: lights
            that follow the camera move in the picture when the VDI is regenerated; other lights,
            and another place among lights of the scene, regenerate it.
        categories : bool or int
            As many colours as there are different values, or this many.
        multi_colors : bool
            Give each block of a ``MultiBlock`` a colour map of its own.
        mapper : str, optional
            Names of VTK's volume mappers are taken and mean nothing: a VDI has its own.
        blending : {"composite", "maximum", "minimum", "average", "additive"}
            What becomes of the scalars along a ray: ``"composite"``; a VDI has no other.
        scalar_bar_args, show_scalar_bar, annotations
            As in ``add_volume``.
        preference : {"point", "cell"}
            Which array, where points and cells both have one of that name.
        opacity_unit_distance : float, optional
            Length over which opacities are reached, model units; the volume's diagonal over its
            mean number of cells by default.
        user_matrix : array_like, shape (4, 4), optional
            Places the actor in the world.
        log_scale : bool
            Map values to colours by their logarithm.
        resample : "auto" or (int, int, int), optional
            Resample any grid, and blocks of them, to a uniform one of so many points along x, y
            and z; ``"auto"``: voxels as large as the mean cell, a uniform grid as it is. What lies
            outside their cells is not drawn. With ``categories``, by the nearest value. The log
            says the largest and the mean difference at the grid's own points.
        mask : pyvista.DataSet, Volume, numpy.ndarray or path, optional
            Labels of the volume's points, or of its cells: where they are 0, nothing is drawn. A
            grid may have its axes mirrored or in another order.
        max_supersegments : int
            Longest list, 1 to 4096.
        criterion : {"least-error", "homogeneity"}
            What decides where a list that must be shortened is cut, see
            :func:`pyvista_vdi.generate`.
        sample_distance : float, optional
            Length of a step along a ray, model units; half the smallest spacing by default.
        tolerance : float
            Error that may be traded for shorter lists.
        view_cone : float
            Half angle of the cone of new views that must be served, degrees.
        precision : {"exact", "8-byte"}
            What a supersegment takes, see :meth:`pyvista_vdi.VDI.with_precision`.
        quality : {"reference", "high", "balanced", "fast"}, optional
            Choose the settings by how good pictures are to be, from a short measurement: see
            :func:`pyvista_vdi.generate`. ``actor.status.dial`` says what was chosen and what it is
            predicted to give. A view regenerates by itself where its SSIM falls 0.02 below what
            was asked for, if that is below ``regenerate_below``.
        target_ssim, max_bytes, target_angle : optional
            As for :func:`pyvista_vdi.generate`.
        full_fps : float, optional
            Least **full** frames per second of the VDI that is chosen: ``target_fps`` of
            :func:`pyvista_vdi.generate`. ``target_fps`` below is kept by drawing fewer pixels,
            whatever the VDI.
        ambient_occlusion : bool, float or AmbientOcclusion, optional
            Darken what is hidden from the light around it: ``True``, or the radius up to which
            something hides, model units.
        memory_limit : int, float or str, optional
            Most memory to take on the device, see :func:`pyvista_vdi.generate`.
        interpolation : {"nearest", "linear"}
            Between voxels; ``add_volume`` draws ``"nearest"``.
        camera : pyvista.Camera or vtkCamera or Camera, optional
            The generating view; by default that of the first picture, and that of the frame where
            ``regenerate`` says so.
        coverage : {"bounds", "view"}
            ``"bounds"``: the VDI covers the whole volume, so that neither panning nor zooming out
            shows a cut edge. ``"view"``: it covers the window.
        target_fps : float, optional
            Frames per second to be kept while the view moves. ``None``: the interactor's
            ``DesiredUpdateRate``, as for VTK's own levels of detail; 0: every frame is full.
        adjust_multi_samples : bool
            Go without multisampling while the view moves and frames would be late for
            ``target_fps``: it smooths the edges of meshes. At rest, and in pictures that are kept,
            it is as the plotter has it.
        regenerate : {"auto", "never"} or callable
            When a view gets a VDI of its own. ``"auto"``: where the estimated SSIM of its picture
            against volume rendering is below ``regenerate_below``; in windows on the screen only,
            and a VDI without its volume says once that it is seen from where it does not serve.
            A callable gets ``actor.status`` once per frame and returns whether to regenerate; it
            is asked off-screen, too, and the VDI is then made before the frame. ``"never"``: only
            ``actor.regenerate()``. Changed data and transfer functions are always made anew.
        regenerate_below : float, optional
            Estimated SSIM, 0 to 1, below which a VDI does not do for a view: ``regenerate="auto"``
            makes another, by default below 0.95 (while the view moves, twice the error is borne),
            and ``draw="auto"`` draws the volume in its place, by default below 0.98 or without the
            detail of the picture's pixels.
        draw : {"auto", "vdi", "volume"}
            What is raycast where the volume is at hand. ``"auto"``: in windows on the screen, each
            frame by what is expected to give the better picture within ``target_fps``, the VDI
            near its generating view and the volume far from it; at rest by what is there sooner,
            where the VDI does. Off-screen the volume, until so many pictures of nearly the same
            view are taken that a VDI costs less, and then that where it does; never by measured
            time. ``"vdi"``: always the VDI. ``"volume"``: always the volume, by
            :func:`pyvista_vdi.render_volume`'s kernel, right from every view. Volumes that overlap
            are drawn by VDIs. ``actor.status.drawn`` says what was.
        status : bool
            Show ``actor.status`` in the upper left corner.
        device : str or int, optional
            The OpenCL device; by default ``PYVISTA_VDI_DEVICE``, else the best one found.
        progress_bar : bool or callable, optional
            By default a bar on a terminal, if generating takes over a second; ``True`` shows it
            elsewhere, too, ``False`` never; a callable gets the fraction done, and stops the work
            if it returns ``False``. Ctrl-C stops it as well.
        classification : {"baked", "deferred"}
            When scalars are classified: as the VDI is made, or by whoever shows it. Deferred, one
            :class:`DeferredVDI` is made with the first picture, of its view or ``camera``, and
            ``actor.prop`` and its lookup table classify it: what is changed there is seen in the
            next frame, and nothing is generated again.
        value_range : (float, float), optional
            Least and largest scalar to keep, where deferred: as for :func:`pyvista_vdi.generate`.
        importance : array_like of float, optional
            How much errors count over the range, where deferred: as there.
        **aliases
            ``rng``, ``colormap`` and ``backface_culling``, as in ``add_volume``.

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
        refuse_keywords(aliases, AddVDI.__call__, "add_vdi", _ALIASES)
        clim, cmap = aliases.get("rng", clim), aliases.get("colormap", cmap)
        if mapper is not None:
            note_mapper(mapper)
        # Fields in their order, as in api/vdis.py
        asked = Addition(
            array=ArrayChoice.checked(scalars, preference, blending_name(blending)),
            look=Looks.checked(
                *(clim, n_colors, opacity, cmap, flip_scalars, opacity_unit_distance, log_scale),
                *(shade, ambient, diffuse, specular, specular_power, interpolation),
                *(categories, annotations, self._plotter._theme),
            ),
            options=GenerationOptions.checked(
                *(sample_distance, None, ambient_occlusion, memory_limit),
                *(max_supersegments, criterion, tolerance, view_cone, precision),
            ),
            target=QualityTarget.checked(quality, target_ssim, full_fps, max_bytes, target_angle),
            drawing=DrawingOptions.checked(
                target_fps, adjust_multi_samples, regenerate, regenerate_below, draw
            ),
            place=Placement.checked(
                *(name, aliases.get("backface_culling", culling), reset_camera, pickable, render),
                *(user_matrix, scalar_bar_args, show_scalar_bar, status, multi_colors),
            ),
            resolution=resolution,
            resample=resample,
            mask=mask,
            camera=camera,
            coverage=coverage,
            device=device,
            progress_bar=progress_bar,
            deferral=Deferral.checked(classification, value_range, importance),
        )
        if isinstance(volume, vtkMultiBlockDataSet):
            return added_blocks(self._plotter, volume, asked, self._remember)
        return added(self._plotter, volume, asked, self._remember)

    __doc__ = __call__.__doc__  # PyVista hands out an object where users look for the method

    def _remember(self, actor: PlotterVDIActor) -> None:
        """Keep an actor in mind, weakly, until the plotter is closed."""
        self._actors.append(weakly(actor))

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
