"""What ``add_vdi`` does with what it was asked for: a source or a VDI, a mapper and an actor."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import cycle
from typing import Any, NamedTuple

import numpy as np
import pyvista as pv

from pyvista_vdi.api import generate
from pyvista_vdi.device import get_runtime
from pyvista_vdi.errors import (
    InvalidArgumentTypeError,
    UnsupportedError,
    warn_external,
)
from pyvista_vdi.generation.deferred import kept_range
from pyvista_vdi.io import read
from pyvista_vdi.io.files import holds
from pyvista_vdi.io.stores import StoredVolume
from pyvista_vdi.io.volumes import read_volume
from pyvista_vdi.model.camera import Camera
from pyvista_vdi.model.classification import ArrayChoice, Look, range_to_classify
from pyvista_vdi.model.collection import VDICollection
from pyvista_vdi.model.options import (
    Deferral,
    DrawingOptions,
    GenerationOptions,
    Options,
    QualityTarget,
    option,
)
from pyvista_vdi.model.types import CameraLike, DeviceLike, MatrixLike
from pyvista_vdi.model.vdi import VDI, DeferredVDI, picture_view
from pyvista_vdi.plotting.actor import PlotterVDIActor, PlotterVDIMapper, first_camera
from pyvista_vdi.plotting.classify import Looks, stored_table
from pyvista_vdi.plotting.progress import DelayedBar
from pyvista_vdi.plotting.volumes import as_grid, load
from pyvista_vdi.quality.plan import REGENERATE_BELOW
from pyvista_vdi.quality.targets import refuse_settings
from pyvista_vdi.vtk_pipeline.filters.convert import is_vdi_image, vdi_from_image
from pyvista_vdi.vtk_pipeline.filters.inputs import DeferredInput
from pyvista_vdi.vtk_pipeline.filters.source import VDISource
from pyvista_vdi.vtk_pipeline.filters.view import View, aim, as_array
from pyvista_vdi.vtk_pipeline.vtk import vtkMultiBlockDataSet

#: ``add_volume``'s names of VTK's mappers.
_MAPPERS = ("fixed_point", "gpu", "open_gl", "smart", "ugrid")

#: SSIM by which a view may fall below what was asked for before it regenerates.
_BELOW_GOAL = 0.02

#: Colour maps of blocks that are to be told apart: those of ``add_volume``.
_MAPS = ("Reds", "Greens", "Blues", "Greys", "Oranges", "Purples")


def _note_mapper(name: Any) -> None:
    if name not in (None, *_MAPPERS):
        raise InvalidArgumentTypeError(
            f"mapper={name!r} is none of VTK's volume mappers, {', '.join(_MAPPERS)}; a VDI has "
            "its own: leave it out"
        )
    if name is not None:
        warn_external(f"mapper={name!r} chooses among VTK's volume mappers and is ignored")


@dataclass(frozen=True, eq=False)
class Placement(Options):
    """Where an actor is put in a plotter, and what is shown beside it.

    reset_camera: whether the view is reset, as in ``add_volume``
    name: of the actor; another of this name is replaced
    culling: of faces, which a volume has none of
    multi_colors: give each block of a ``MultiBlock`` a colour map of its own
    mapper: of VTK's volume mappers; a VDI has its own, and none means a thing
    scalar_bar_args: of the scalar bar, as in ``add_volume``
    show_scalar_bar: whether there is a scalar bar; as the theme says
    pickable: whether it can be picked
    render: whether the plotter renders at once
    user_matrix: places the actor in the world
    """

    reset_camera: bool | None = None
    name: str | None = None
    culling: bool | str = False
    multi_colors: bool = False
    mapper: str | None = option(None, _note_mapper)
    scalar_bar_args: Mapping[str, Any] | None = option(None, kind="dict[str, Any] | None")
    show_scalar_bar: bool | None = None
    pickable: Any = option(True, kind="bool")
    render: bool | None = True
    user_matrix: MatrixLike | None = None


@dataclass(frozen=True, eq=False)
class InputOptions(Options):
    """What a VDI is made of, from where, and by what.

    resolution: spacing of a NumPy array; 1 by default
    camera: the generating view
        By default that of the first picture, and that of the frame where ``regenerate`` says so.
    device: the OpenCL device; by default ``PYVISTA_VDI_DEVICE``, else the best one found
    progress_bar: whether a bar shows how much is done; by default on a terminal, after a second
        ``True`` shows it elsewhere, too, ``False`` never; a callable gets the fraction done, and
        stops the work if it returns ``False``. Ctrl-C stops it as well.
    """

    resolution: Sequence[float] | None = None
    camera: CameraLike | None = None
    device: DeviceLike | None = None
    progress_bar: bool | Callable[[float], object] | None = None


@dataclass(frozen=True, eq=False)
class Addition:
    """All that ``add_vdi`` was asked for."""

    array: ArrayChoice
    look: Looks
    place: Placement
    making: InputOptions
    options: GenerationOptions
    target: QualityTarget
    deferral: Deferral
    drawing: DrawingOptions

    def refuse_with_a_vdi(self, looks: Mapping[str, Any] | None = None) -> None:
        """Refuse what only a volume can honour, of the arguments that are not their defaults.

        ``looks``: those of the look that are not honoured; all by default.
        """
        given = self.look.given if looks is None else looks
        changed = {*self.array.given, *given, *self.options.given, *self.deferral.given}
        changed |= {*self.making.given, *self.target.given} - {"device", "progress_bar"}
        changed |= {*self.drawing.given} & {"coverage"}
        changed -= {"lights", "annotations"}
        if changed:
            raise UnsupportedError(
                f"{', '.join(sorted(changed))} cannot be given with a VDI: its classification, "
                "view and lists were fixed when it was generated; generate another from the volume"
            )
        if self.drawing.draw == "volume":
            raise UnsupportedError(
                "draw='volume' draws the volume, and this is a VDI without one: leave draw out"
            )


class _Shown(NamedTuple):
    """What an actor shows, its colours, and what its scalar bar says."""

    thing: VDI | VDISource | DeferredInput
    table: Any
    scalar_range: tuple[float, float]
    title: str
    prop: Any = None
    bar: bool | None = None  # whether there is a scalar bar; None: as the theme says


def added(plotter: Any, volume: Any, asked: Addition) -> Any:
    """Add a volume, or what is made of one already, to a plotter, and return its actor.

    Of blocks a list is returned.
    """
    refuse_settings(asked.target, asked.options)
    if isinstance(volume, vtkMultiBlockDataSet):
        return _blocks(plotter, pv.wrap(volume), asked)
    get_runtime(asked.making.device)  # a missing device is said here, not while a frame is drawn

    # Read what is named, and find what can be shown of it
    if isinstance(volume, str | os.PathLike):
        named = asked.array.scalars if isinstance(asked.array.scalars, str) else None
        volume = read_volume(volume, array=named) if holds(volume) is None else read(volume)
    if isinstance(volume, StoredVolume):  # the level that the view requires
        camera = Camera.from_any(first_camera(plotter.renderer, volume.bounds))
        volume, look = volume.in_view(camera, window_size=plotter.window_size), asked.look
        if look.opacity_unit_distance is None:  # opacities are those of the finest level's voxels
            look = replace(look, opacity_unit_distance=volume.default_unit_distance)
        volume, asked = load(volume), replace(asked, look=look)
    several = volume if isinstance(volume, VDICollection) else None
    first = volume if several is None else several[0]  # which all steps, and all views, look like
    if is_vdi_image(first):
        first = vdi_from_image(first)
    if isinstance(first, DeferredVDI):
        given = {n: v for n, v in asked.look.given.items() if n == "interpolation"}
        asked.refuse_with_a_vdi(given)
        title = str(first.metadata.get("scalars") or "Data")
        shown = _values_shown(first, asked, first.value_range, first.unit_distance, title)
    elif isinstance(first, VDI):
        shown = _of_vdi(first, asked)
    elif asked.deferral.given:
        shown = _of_late_values(first, asked)
    else:
        shown = _of_volume(first, asked, plotter)

    # Make an actor that shows it
    actor, mapper = PlotterVDIActor(), _mapper(shown, asked, plotter.theme)
    mapper.SetInputData(shown.thing if several is None else several)
    actor.mapper = mapper
    if shown.prop is not None:  # which classifies a volume, or values that are kept
        actor.prop = shown.prop
    if isinstance(first, DeferredVDI):
        mapper.driver.input.vdi()  # refuse now what cannot be classified, and warn once
    matrix = asked.place.user_matrix
    actor.user_matrix = np.eye(4) if matrix is None else matrix

    # Put it into the plotter, which opens from the view of a VDI of its own
    plotter.mapper, plotter.volume = mapper, actor  # as add_volume does
    own: Any = first if several is None else several
    if several is not None and several.times is None and own.camera == own.cameras[0]:
        own = None  # a set that tells of no view
    with _all_or_nothing(plotter, actor):
        _put(plotter, actor, own, shown, asked.place)
    plotter.renderer.Modified()
    return actor


def _blocks(plotter: Any, blocks: Any, asked: Addition) -> list[Any]:
    """Add each block of a ``MultiBlock``; return their actors, lists of those within blocks.

    Blocks that are missing are left out, and a name gets the block's number. A block that is no
    uniform grid is refused before anything is added.
    """
    for block in blocks.recursive_iterator(skip_none=True):
        as_grid(block, None, None)
    actors: list[Any] = []
    maps = cycle(_MAPS)
    with _all_or_nothing(plotter, actors):
        for i, block in enumerate(blocks):
            if block is None:
                continue
            own = asked
            if asked.place.multi_colors:
                own = replace(own, look=replace(own.look, cmap=next(maps)))
            if asked.place.name is not None:
                own = replace(own, place=replace(own.place, name=f"{asked.place.name}-{i}"))
            actors.append(added(plotter, block, own))
    return actors


def _of_vdi(shown: VDI, asked: Addition) -> _Shown:
    """Return a VDI with the colours that it was made with, as far as its metadata has them."""
    asked.refuse_with_a_vdi()
    place, annotations = asked.place, asked.look.annotations
    bar, table = place.show_scalar_bar, stored_table(shown)
    if table is None:
        if bar or place.scalar_bar_args or annotations:
            raise UnsupportedError(
                "this VDI's metadata holds no transfer function, so there is no scalar bar "
                "to show: leave out show_scalar_bar, scalar_bar_args and annotations"
            )
        bar, table = False, pv.LookupTable()
    if annotations:
        table.annotations = annotations
    title = str(shown.metadata.get("scalars") or "Data")
    return _Shown(shown, table, table.scalar_range, title, bar=bar)


def _of_late_values(volume: Any, asked: Addition) -> _Shown:
    """Return the values of a volume, which the first picture has made for its view."""
    asked.target.refuse_deferred()
    fixed = {"coverage": asked.drawing.coverage != "bounds", "draw": asked.drawing.draw == "volume"}
    refused = " and ".join(each for each, given in fixed.items() if given)
    if refused:
        raise UnsupportedError(
            f"{refused} cannot be given with classification='deferred': that VDI is made once, of "
            f"what the view shows, and the volume is let go of; leave {refused} out, or "
            "classification"
        )
    source = _source(volume, asked)
    volume = source.GetVolume()
    ends = kept_range(volume, asked.options, asked.deferral)
    told = {"device": source.GetDevice(), "interpolation": asked.look.interpolation}
    told |= {"progress": source.GetProgressCallback(), **asked.options.given}

    def made(view: View) -> DeferredVDI:
        return generate(volume, view.camera, view.size, **told, **asked.deferral.given)

    plain = replace(asked, look=replace(asked.look, interpolation="nearest"))
    what = (ends, volume.default_unit_distance, volume.name)
    return _values_shown(made, plain, *what, volume.bounds, source.GetCamera())


def _values_shown(
    values: DeferredVDI | Callable[[View], DeferredVDI],
    asked: Addition,
    value_range: tuple[float, float],
    unit_distance: float,
    title: str,
    *late: Any,
) -> _Shown:
    """Return values with the property that classifies them, as ``add_volume`` makes it."""
    look = asked.look
    lacking = {
        "shade": "shade=True needs the volume's gradients, which a deferred VDI does not keep",
        "categories": "categories are of single values, and a deferred VDI keeps means of them",
    }
    for name, why in lacking.items():
        if getattr(look, name):
            raise UnsupportedError(
                f"{why}: leave {name} out, or add the volume without classification='deferred'"
            )
    table = look.lookup_table(np.array(value_range))
    prop = look.volume_property(table, unit_distance)
    shown = DeferredInput(values, prop, *late)
    return _Shown(shown, table, table.scalar_range, title, prop, asked.place.show_scalar_bar)


def _of_volume(volume: Any, asked: Addition, plotter: Any) -> _Shown:
    """Return a source of VDIs of a volume, classified as ``add_volume`` would."""
    scalars, look, source = asked.array.scalars, asked.look, _source(volume, asked)
    told = {name: value for name, value in look.describe().items() if name in Look.declared}
    source.SetMetadata({"classification": {**asked.array.describe(), **told}})
    source.SetCoverage(asked.drawing.coverage)
    volume = source.GetVolume()
    bar = asked.place.show_scalar_bar
    if volume.rgba:
        look, bar = look.of_rgba(), False
    look = replace(look, clim=range_to_classify(scalars, look.clim))
    table = look.lookup_table(volume.array)
    prop = look.volume_property(table, volume.default_unit_distance, rgba=volume.rgba)
    look.light(prop)
    source.of_scene = True
    source.lit_by.Set(plotter.renderer)  # whose lights are looked at by whoever asks
    # As add_volume: values that come without a name have none
    title = volume.name if scalars is None or isinstance(scalars, str) else ""
    return _Shown(source, table, look.scalar_range(table, volume), title, prop, bar)


def _source(volume: Any, asked: Addition) -> VDISource:
    """Return a source of VDIs of a volume, made as it was asked for."""
    image, name = as_grid(volume, asked.array.scalars, asked.making.resolution)
    # As add_volume, keep geometry and arrays by name as they are now, and share the points' values
    data, preference = pv.ImageData(), asked.array.preference
    data.ShallowCopy(image)
    data.GetCellData().DeepCopy(image.GetCellData())
    named = None if name is None else data.GetPointData().GetArray(name)
    if named is not None and preference == "point":
        # As add_volume: another may be made the active one of the mapper's dataset
        data.GetPointData().SetActiveScalars(name)
        name = None
    source = VDISource()
    source.SetInputDataObject(data)
    source.SetScalars(name, preference)
    source.SetOptions(asked.options)
    if asked.target:
        source.SetDial(**asked.target.given)
    source.SetDevice(asked.making.device)
    progress: Any = asked.making.progress_bar
    if not callable(progress):
        progress = None if progress is False else DelayedBar(always=bool(progress))
    source.SetProgressCallback(progress)
    if asked.making.camera is not None:
        source.SetCamera(asked.making.camera)
    return source


def _mapper(shown: _Shown, asked: Addition, theme: Any) -> Any:
    """Return a mapper that draws as it was asked for."""
    drawing, goal = asked.drawing, asked.target.ssim
    below = drawing.regenerate_below
    if goal is not None:  # not above what the VDI is made for
        given = REGENERATE_BELOW if below is None else below
        below = min(given, max(0.0, goal - _BELOW_GOAL))
    mapper = PlotterVDIMapper(theme=theme)
    mapper.scalar_range = shown.scalar_range  # before there is a table that it would change
    mapper.lookup_table = shown.table
    mapper.SetDevice(asked.making.device)
    mapper.SetTargetFrameRate(drawing.target_fps)
    mapper.SetRegenerate(drawing.regenerate)
    mapper.SetRegenerateBelow(below)
    mapper.SetDraw(drawing.draw)
    return mapper


def _put(plotter: Any, actor: Any, own: Any, shown: _Shown, place: Placement) -> None:
    """Put an actor and its scalar bar into a plotter, which opens from the view of its ``own``."""
    render = place.render is None or place.render  # which nothing does before the first picture
    camera = plotter.renderer.camera  # plotter.camera would set it
    touched = camera.is_set or camera.parallel_projection
    made = isinstance(own, VDI | DeferredVDI | VDICollection)
    opens = made and place.reset_camera is not False and not touched
    plotter.add_actor(
        actor,
        reset_camera=False if opens else place.reset_camera,
        name=place.name,
        culling=place.culling,
        pickable=place.pickable,
        render=render and not opens,
    )
    if opens:  # from its own view: others may show little of it
        aim(camera, picture_view(own)[0], as_array(actor.GetMatrix()))
        if place.reset_camera:
            plotter.reset_camera(render=False)
        plotter.renderer.reset_camera_clipping_range()
        if render:
            plotter.render()
    about, bar = place.scalar_bar_args or {}, shown.bar
    if (plotter.theme.show_scalar_bar or about) if bar is None else bar:
        plotter.add_scalar_bar(**{"title": shown.title, **about})


@contextlib.contextmanager
def _all_or_nothing(plotter: Any, actors: Any) -> Iterator[None]:
    """Take an actor, or several, away again where something is refused on the way."""
    was_set = plotter.camera_set
    try:
        yield
    except BaseException:
        plotter.remove_actor(actors, reset_camera=False, render=False)
        plotter.camera_set = was_set
        raise
