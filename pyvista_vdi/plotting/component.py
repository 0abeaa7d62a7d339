"""``Plotter.add_vdi``: a VDI in place of a volume, with ``add_volume``'s arguments."""

from __future__ import annotations

import contextlib
import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import InvalidArgumentError, InvalidArgumentTypeError, UnsupportedError
from pyvista_vdi.model.classification import (
    DEFAULTS,
    Classification,
    range_to_classify,
    refuse_unknown,
)
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.model.vdi import VDI
from pyvista_vdi.plotting.actor import PlotterVDIActor, PlotterVDIMapper
from pyvista_vdi.plotting.blocks import add_blocks
from pyvista_vdi.plotting.classify import Looks, blending_name, note_mapper, stored_table
from pyvista_vdi.plotting.progress import progress_callback
from pyvista_vdi.plotting.registration import Component
from pyvista_vdi.plotting.volumes import as_image, held
from pyvista_vdi.quality.dial import TARGET_ANGLE, Dial, refuse_settings
from pyvista_vdi.quality.frame_state import Policy, checked_draw, checked_policy, checked_rate
from pyvista_vdi.quality.regeneration_policy import REGENERATE_BELOW, checked_bound
from pyvista_vdi.vtk_pipeline.filters.convert import is_vdi_image, vdi_from_image
from pyvista_vdi.vtk_pipeline.filters.source import VDISource
from pyvista_vdi.vtk_pipeline.filters.view import as_array
from pyvista_vdi.vtk_pipeline.vtk import vtkMultiBlockDataSet, vtkVolume, vtkWeakReference

#: ``add_volume``'s aliases.
_ALIASES = {"rng": "clim", "colormap": "cmap", "backface_culling": "culling"}

#: Arguments that say nothing of a VDI, beside those of its looks and its generation.
_OF_A_VOLUME = (
    *("resolution", "categories", "camera", "coverage", "quality", "target_ssim", "full_fps"),
    *("max_bytes", "target_angle"),
)

#: What ``add_actor`` understands as culling, besides nothing.
_CULLING = (True, "back", "backface", "b", "front", "frontface", "f")

#: SSIM by which a view may fall below what was asked for before it regenerates.
_BELOW_GOAL = 0.02


@pv.register_plotter_component("add_vdi", override=True)  # of registration._Pending
class AddVDI(Component):
    """Adds VDIs to a plotter: ``plotter.add_vdi(volume)``.

    Parameters
    ----------
    plotter : pyvista.BasePlotter
        Held weakly.
    """

    def __init__(self, plotter: Any) -> None:
        super().__init__(plotter)
        self._actors: list[Any] = []

    def __call__(
        self,
        volume: Any,
        scalars: Any = None,
        clim: Any = None,
        resolution: Any = None,
        opacity: Any = "linear",
        n_colors: int = 256,
        cmap: Any = None,
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
        preference: Literal["point", "cell"] = "point",
        opacity_unit_distance: float | None = None,
        shade: bool = False,
        diffuse: float | None = 0.7,
        specular: float | None = 0.2,
        specular_power: float | None = 10.0,
        render: bool | None = True,
        user_matrix: Any = None,
        log_scale: bool = False,
        *,
        max_supersegments: int = 20,
        criterion: Literal["least-error", "homogeneity"] = "least-error",
        sample_distance: float | None = None,
        tolerance: float = 0.0,
        view_cone: float = 60.0,
        precision: Literal["exact", "16-byte", "8-byte"] = "exact",
        quality: Literal["reference", "high", "balanced", "fast"] | None = None,
        target_ssim: float | None = None,
        full_fps: float | None = None,
        max_bytes: int | None = None,
        target_angle: float = TARGET_ANGLE,
        ambient_occlusion: Any = None,
        memory_limit: float | str | None = None,
        interpolation: Literal["nearest", "linear"] = "nearest",
        camera: Any = None,
        coverage: Literal["bounds", "view"] = "bounds",
        target_fps: float | None = 30.0,
        adjust_multi_samples: bool = True,
        regenerate: Policy = "auto",
        regenerate_below: float | None = None,
        draw: Literal["auto", "vdi", "volume"] = "auto",
        status: bool = False,
        device: Any = None,
        progress_bar: bool | Callable[[float], object] | None = None,
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
        volume : pyvista.ImageData, numpy.ndarray, pyvista.MultiBlock, Volume, or one or more VDIs
            A uniform grid, or a rectilinear one of equidistant points (other grids are refused,
            with the remedy), a NumPy array as ``add_volume`` takes it, blocks of uniform grids, a
            VDI, a VDI as ``pyvista.read("x.vdi")`` gives it, a :class:`VDISeries`, which plays
            (``actor.play()``, ``actor.time``), or a :class:`VDISet`, of which the nearest to the
            view is drawn. With VDIs nothing is generated, and arguments that
            only a volume can honour are refused.
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
            The theme's by default.
        flip_scalars : bool
            Reverse the colour map.
        reset_camera, name, culling, pickable, render
            As in ``add_volume``.
        ambient, diffuse, specular, specular_power, shade
            As in ``add_volume``: without ``shade`` the others change nothing. A shaded VDI is lit
            by the plotter's lights as they stand in its generating view: lights that follow the
            camera move in the picture when the VDI is made anew, and other lights make it anew.
        categories : bool or int
            As many colours as there are different values, or this many.
        multi_colors : bool
            Give each block of a ``MultiBlock`` a colour map of its own.
        mapper : str, optional
            Names of VTK's volume mappers are taken and mean nothing: a VDI has its own.
        blending : str
            ``"composite"`` only.
        scalar_bar_args, show_scalar_bar, annotations
            As in ``add_volume``.
        preference : {"point", "cell"}
            Which array, where points and cells both have one of that name.
        opacity_unit_distance : float, optional
            Model units; the volume's diagonal over its mean number of cells by default.
        user_matrix : array_like, shape (4, 4), optional
            Places the actor in the world.
        log_scale : bool
            Map values to colours by their logarithm.
        max_supersegments : int
            Longest list, 1 to 4096.
        criterion : {"least-error", "homogeneity"}
            What decides where a list that must be shortened is cut, see
            :func:`pyvista_vdi.generate`.
        sample_distance : float, optional
            Length of a step, model units; half the smallest spacing by default.
        tolerance : float
            Error that may be traded for shorter lists.
        view_cone : float
            Half angle of the cone of views that must be served, degrees.
        precision : {"exact", "16-byte", "8-byte"}
            What a supersegment takes, see :meth:`pyvista_vdi.VDI.with_precision`.
        quality : {"reference", "high", "balanced", "fast"}, optional
            Choose lists, ``max_supersegments`` and ``precision`` by how good pictures are to be,
            from a short measurement: see :func:`pyvista_vdi.generate`. ``actor.status.dial`` says
            what was chosen and what it is predicted to give. A view regenerates by itself where
            its SSIM falls 0.02 below what was asked for, if that is below ``regenerate_below``.
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
            Most bytes that generating may take on the device, see :func:`pyvista_vdi.generate`.
        interpolation : {"nearest", "linear"}
            Between voxels; ``add_volume`` draws ``"nearest"``.
        camera : pyvista.Camera or vtkCamera or Camera, optional
            The generating view; by default the plotter's camera at the first render, and that of
            the frame where ``regenerate`` says so.
        coverage : {"bounds", "view"}
            ``"bounds"``: the VDI covers the whole volume, so that neither panning nor zooming out
            shows a cut edge. ``"view"``: it covers the window.
        target_fps : float, optional
            Frames per second to be kept while the view moves. ``None``: the interactor's
            ``DesiredUpdateRate``, as for VTK's own levels of detail; 0: every frame is full.
        adjust_multi_samples : bool
            Go without multisampling, which smooths the edges of meshes, while the view moves and
            frames would be late for ``target_fps``. At rest, and in pictures that are kept, it is
            as the plotter has it.
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
        **aliases
            ``rng``, ``colormap`` and ``backface_culling``, as in ``add_volume``.

        Returns
        -------
        PlotterVDIActor or list
            A ``pyvista.Volume``; ``actor.vdi`` is the current VDI, made now where there is none,
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
        refuse_unknown(aliases, "add_vdi", (*_ALIASES, *_DEFAULTS))
        clim, cmap = aliases.get("rng", clim), aliases.get("colormap", cmap)
        culling = aliases.get("backface_culling", culling)
        arguments = {k: v for k, v in locals().items() if k in _DEFAULTS and k != "volume"}
        plotter = self._plotter
        if mapper is not None:
            note_mapper(mapper)
        if not isinstance(scalar_bar_args, Mapping | None):
            raise InvalidArgumentTypeError(
                f"scalar_bar_args must be a dictionary; got {scalar_bar_args!r}"
            )
        if culling and (culling.lower() if isinstance(culling, str) else culling) not in _CULLING:
            raise InvalidArgumentError(
                f"culling must be False or one of {_CULLING}; got {culling!r} (faces are a mesh's: "
                "it changes nothing of a volume)"
            )
        if isinstance(volume, vtkMultiBlockDataSet):
            actors: list[Any] = []
            with _all_or_nothing(plotter, actors):
                for added in add_blocks(self, volume, arguments):
                    actors.append(added)
            return actors
        if target_fps is not None:
            checked_rate("target_fps", target_fps)
        checked_policy(regenerate)
        if regenerate_below is not None:
            checked_bound(regenerate_below)
        checked_draw(draw)
        dial = Dial.of(quality, target_ssim, full_fps, max_bytes, target_angle)
        options = GenerationOptions(
            max_supersegments=max_supersegments,
            criterion=criterion,
            sample_distance=sample_distance,
            tolerance=tolerance,
            view_cone=view_cone,
            precision=precision,
            ambient_occlusion=ambient_occlusion,
            memory_limit=memory_limit,  # type: ignore[arg-type]
        )
        refuse_settings(dial, options)
        looks = Looks(
            clim=clim,
            n_colors=n_colors,
            opacity=opacity,
            cmap=cmap,
            flip_scalars=flip_scalars,
            log_scale=log_scale,
            categories=categories,
            annotations=annotations,
            theme=plotter._theme,
            opacity_unit_distance=opacity_unit_distance,
            interpolation=interpolation,
            shade=shade,
            ambient=ambient,
            diffuse=diffuse,
            specular=specular,
            specular_power=specular_power,
        )
        get_runtime(device)  # a missing device is said here, not while a frame is drawn
        blending = blending_name(blending)
        classified = {"scalars": scalars, "preference": preference, "blending": blending}
        changed = _changed({**classified, **vars(looks)}, DEFAULTS)
        several = volume if isinstance(volume, VDICollection) else None
        if several is not None:
            volume = several[0]  # which all steps, and all views, look like
        shown: VDI | VDISource
        prop: Any = None
        if isinstance(volume, VDI) or is_vdi_image(volume):
            others = {**{name: arguments[name] for name in _OF_A_VOLUME}, **vars(options)}
            _refuse_with_a_vdi([*changed, *_changed(others, _DEFAULTS)], draw)
            shown = volume if isinstance(volume, VDI) else vdi_from_image(volume)
            title = str(shown.metadata.get("scalars") or "Data")
            table = stored_table(shown)
            if table is None:
                if show_scalar_bar or scalar_bar_args or annotations:
                    raise UnsupportedError(
                        "this VDI's metadata holds no transfer function, so there is no scalar bar "
                        "to show: leave out show_scalar_bar, scalar_bar_args and annotations"
                    )
                show_scalar_bar, table = False, pv.LookupTable()
            if annotations:
                table.annotations = annotations
            scalar_range = table.scalar_range
        else:
            shown = source = VDISource()
            image, array_name = as_image(volume, scalars, resolution)
            described = Classification(changed, "add_vdi").describe()
            source.SetMetadata({"classification": described})
            data = held(image)
            named = None if array_name is None else data.GetPointData().GetArray(array_name)
            if named is not None and preference == "point":
                # As add_volume: another may be made the active one of the mapper's dataset
                data.GetPointData().SetActiveScalars(array_name)
                array_name = None
            source.SetInputDataObject(data)
            source.SetScalars(array_name, preference)
            source.SetOptions(options)
            source.SetDial(
                quality,
                target_ssim=target_ssim,
                target_fps=full_fps,
                max_bytes=max_bytes,
                target_angle=target_angle,
            )
            source.SetCoverage(coverage)
            source.SetDevice(device)
            source.SetProgressCallback(progress_callback(progress_bar))
            read = source.GetVolume()
            # As add_volume: values that come without a name have none
            title = read.name if scalars is None or isinstance(scalars, str) else ""
            if read.rgba:
                looks, show_scalar_bar = looks.of_rgba(), False
            looks = replace(looks, clim=range_to_classify(scalars, looks.clim))
            table = looks.lookup_table(read.array)
            scalar_range = looks.scalar_range(table, read)
            prop = looks.volume_property(table, read.default_unit_distance, rgba=read.rgba)
            looks.light(prop)
            source.SetLights(plotter.renderer)
            source.SetVolumeProperty(prop)
            if camera is not None:
                source.SetCamera(camera, _matrix(plotter, user_matrix))

        vdi_mapper = PlotterVDIMapper(theme=plotter._theme)
        vdi_mapper.scalar_range = scalar_range  # before there is a table that it would change
        vdi_mapper.lookup_table = table
        vdi_mapper.SetDevice(device)
        vdi_mapper.SetTargetFrameRate(target_fps)
        vdi_mapper.SetAutoAdjustMultiSamples(adjust_multi_samples)
        vdi_mapper.SetRegenerate(regenerate)
        if dial is not None and dial.ssim is not None:  # not above what the VDI is made for
            given = REGENERATE_BELOW if regenerate_below is None else regenerate_below
            regenerate_below = min(given, max(0.0, dial.ssim - _BELOW_GOAL))
        vdi_mapper.SetRegenerateBelow(regenerate_below)
        vdi_mapper.SetDraw(draw)
        actor = self._actor(vdi_mapper, shown if several is None else several, prop, user_matrix)
        themed = plotter._theme.show_scalar_bar or scalar_bar_args
        with _all_or_nothing(plotter, actor):
            plotter.add_actor(
                actor,
                reset_camera=reset_camera,
                name=name,
                culling="backface" if culling is True else culling,
                pickable=pickable,
                render=not plotter._first_time if render is None else render,
            )
            if themed if show_scalar_bar is None else show_scalar_bar:
                plotter.add_scalar_bar(**{"title": title, **(scalar_bar_args or {})})
            if status:
                actor.show_status(plotter)
        plotter.renderer.Modified()
        return actor

    def _actor(self, mapper: Any, shown: Any, prop: Any, user_matrix: Any) -> PlotterVDIActor:
        """Return an actor for what is shown, which the plotter takes for its own."""
        actor = PlotterVDIActor()
        if prop is not None:
            actor.prop = prop
        if isinstance(shown, VDI | VDICollection):
            mapper.SetInputData(shown)
        else:
            mapper.SetInputConnection(shown.GetOutputPort())
        actor.mapper = mapper
        actor.user_matrix = np.eye(4) if user_matrix is None else user_matrix
        weak = vtkWeakReference()
        weak.Set(actor)
        self._actors.append(weak)
        self._plotter.mapper, self._plotter.volume = mapper, actor  # as add_volume does
        return actor

    def __plotter_close__(self) -> None:
        """Release images and textures, even where the user keeps an actor."""
        for weak in self._actors:
            actor = weak.Get()
            if actor is not None and actor.mapper is not None:
                actor.mapper.driver.release()
        self._actors.clear()

    def __plotter_deep_clean__(self) -> None:
        """Nothing else is held."""


# PyVista hands out an object of the class, or the class, where a user looks for the method
AddVDI.__doc__ = AddVDI.__call__.__doc__
_signature = inspect.signature(AddVDI.__call__)
AddVDI.__signature__ = _signature.replace(  # type: ignore[attr-defined]
    parameters=[each for each in _signature.parameters.values() if each.name != "self"]
)

#: ``add_vdi``'s arguments and their defaults.
_DEFAULTS = {
    name: parameter.default
    for name, parameter in _signature.parameters.items()
    if name not in ("self", "aliases")
}


@contextlib.contextmanager
def _all_or_nothing(plotter: Any, actors: Any) -> Iterator[None]:
    """Take an actor, or several, away again where something is refused on the way."""
    try:
        yield
    except BaseException:
        plotter.remove_actor(actors, reset_camera=False, render=False)
        raise


def _changed(given: Mapping[str, Any], defaults: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments that differ from their defaults."""
    return {
        name: given[name]
        for name, default in defaults.items()
        if name in given and not _is_default(given[name], default)
    }


def _refuse_with_a_vdi(changed: list[str], draw: str) -> None:
    """Refuse what only a volume can honour, of the arguments that are not their defaults."""
    if changed:
        raise UnsupportedError(
            f"{', '.join(sorted(changed))} cannot be given with a VDI: its classification, view "
            "and lists were fixed when it was generated; generate another from the volume"
        )
    if draw == "volume":
        raise UnsupportedError(
            "draw='volume' draws the volume, and this is a VDI without one: leave draw out"
        )


def _is_default(value: Any, default: Any) -> bool:
    if value is default:
        return True
    simple = isinstance(value, str | int | float) and type(value) is type(default)
    return simple and bool(value == default)


def _matrix(plotter: Any, user_matrix: Any) -> NDArray[np.float64]:
    """Return the actor's matrix as it will be in the scene, with the renderer's scale."""
    stand_in = vtkVolume()
    stand_in.SetScale(*plotter.renderer.scale)
    if user_matrix is not None:
        stand_in.SetUserMatrix(pv.vtkmatrix_from_array(np.asarray(user_matrix, dtype=float)))
    return as_array(stand_in.GetMatrix())
