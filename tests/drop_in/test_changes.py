"""Every kind of change: of the actor, its property and table, of data, and of the scene."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
from drop_in.stage import Kind, half_voxel_steps, shot
from drop_in.volumes import grid, values

kind = Kind("Changes after the first picture")


def change(name: str, act: Any, *, again: bool = True, **how: Any) -> None:
    """Add a case: a picture before and one after ``act(plotter, actor, volume)``."""
    arguments = how.pop("arguments", {})

    def scene(pl: pv.Plotter, add: Any) -> list[Any]:
        volume = grid()
        actor = add(volume, **{"show_scalar_bar": False, **arguments})
        before = shot(pl)
        act(pl, actor, volume)
        return [before, shot(pl)]

    kind.add(name, scene, **how)


def to(target: str, **values: Any) -> Any:
    """Return an act that sets attributes."""

    def act(pl: Any, actor: Any, volume: Any) -> None:
        place = {
            "actor": actor,
            "prop": actor.prop,
            "table": actor.mapper.lookup_table,
            "mapper": actor.mapper,
        }[target]
        for key, value in values.items():
            setattr(place, key, value)

    return act


# -- the actor
change("visibility", to("actor", visibility=False))
change("position", to("actor", position=(0.4, 0.2, 0)), quick=True)
change("scale", to("actor", scale=(1.2, 0.8, 1.0)))
change("orientation", to("actor", orientation=(20, 30, 10)))
change("rotate_x", lambda pl, actor, v: actor.rotate_x(40))
change("rotate_y", lambda pl, actor, v: actor.rotate_y(40))
change("rotate_z", lambda pl, actor, v: actor.rotate_z(40))
change("origin", lambda pl, actor, v: (setattr(actor, "origin", (1, 0, 0)), actor.rotate_z(30)))
change(
    "user_matrix", to("actor", user_matrix=pv.Transform().rotate_y(30).translate(0.2, 0, 0).matrix)
)
change("a clipping plane", lambda pl, actor, v: actor.mapper.AddClippingPlane(plane()))
change(
    "two clipping planes",
    lambda pl, actor, v: [
        actor.mapper.AddClippingPlane(plane(n)) for n in ((1, 0.5, 0), (0, 0.2, -1))
    ],
)
change("remove_actor", lambda pl, actor, v: pl.remove_actor(actor), quick=True)
change(
    "remove_actor and add_actor", lambda pl, actor, v: (pl.remove_actor(actor), pl.add_actor(actor))
)
change("clear", lambda pl, actor, v: pl.clear())
change("clear_actors", lambda pl, actor, v: pl.clear_actors())
change(
    "add_actor of a copy", lambda pl, actor, v: (pl.remove_actor(actor), pl.add_actor(actor.copy()))
)
change("deep copy with another place", lambda pl, actor, v: moved(pl, actor))

# -- its property
change("prop.shade", to("prop", shade=True))
change("prop.interpolation_type", to("prop", interpolation_type="linear"), quick=True)
change("prop.opacity_unit_distance", to("prop", opacity_unit_distance=0.5))
change("prop.ambient", to("prop", ambient=0.8), arguments={"shade": True})
change("prop.diffuse", to("prop", diffuse=0.2), arguments={"shade": True})
change("prop.specular", to("prop", specular=1.0, specular_power=50), arguments={"shade": True})
change("prop.apply_lookup_table", lambda pl, actor, v: actor.prop.apply_lookup_table(table("hot")))
change(
    "another VolumeProperty",
    lambda pl, actor, v: setattr(
        actor, "prop", pv.VolumeProperty(lookup_table=table("hot"), opacity_unit_distance=0.3)
    ),
)
change(
    "a copy of the property",
    lambda pl, actor, v: setattr(actor, "prop", changed(actor.prop.copy())),
)
change("prop.independent_components", to("prop", independent_components=True))
change("table.cmap", to("table", cmap="inferno"), quick=True)
change("table.scalar_range", to("table", scalar_range=(50, 150)))
change(
    "table.apply_opacity",
    lambda pl, actor, v: actor.mapper.lookup_table.apply_opacity([0, 0.5, 0, 0.9]),
)
change("table.apply_cmap", lambda pl, actor, v: actor.mapper.lookup_table.apply_cmap("hot", 256))
change("VTK's colour function", lambda pl, actor, v: actor.prop.SetColor(color_function()))
change(
    "VTK's opacity function", lambda pl, actor, v: actor.prop.SetScalarOpacity(opacity_function())
)
change(
    "VTK's gradient opacity",
    lambda pl, actor, v: actor.prop.SetGradientOpacity(gradient_function()),
    arguments={"opacity": 0.3},
)

# -- data
change(
    "values in place",
    lambda pl, actor, v: v["values"].__setitem__(slice(None), values(24, 1).ravel() * 255),
    quick=True,
    note="",
)
change(
    "values and Modified",
    lambda pl, actor, v: (
        v["values"].__setitem__(slice(None), values(24, 1).ravel() * 255),
        v.Modified(),
    ),
)
change(
    "another array of the name",
    lambda pl, actor, v: v.__setitem__("values", (values(24, 1).ravel() * 255).astype(np.float32)),
)
change("another origin", lambda pl, actor, v: setattr(v, "origin", (0, 0, 0)))
change("another spacing", lambda pl, actor, v: setattr(v, "spacing", (0.1, 0.05, 0.1)))
change(
    "another active array",
    lambda pl, actor, v: (v.__setitem__("other", 255 - v["values"]), v.set_active_scalars("other")),
)


# -- the scene
def replaced(pl: pv.Plotter, add: Any) -> list[Any]:
    add(grid(), name="ball", show_scalar_bar=False)
    before = shot(pl)
    add(grid(seed=1), name="ball", cmap="hot", show_scalar_bar=False)
    return [before, shot(pl)]


kind.add("replaced by name", replaced, quick=True)


@kind.case()
def a_loop_that_replaces_by_name(pl: pv.Plotter, add: Any) -> list[Any]:
    out = []
    for i in range(4):
        add(grid(seed=i / 3), name="ball", clim=(0, 255), show_scalar_bar=False)
        out.append(shot(pl))
    return out


@kind.case()
def removed_by_name_and_added_again(pl: pv.Plotter, add: Any) -> None:
    add(grid(), name="ball", show_scalar_bar=False)
    shot(pl)
    pl.remove_actor("ball")
    add(grid(seed=1), show_scalar_bar=False)


@kind.case()
def a_mesh_that_moves_through(pl: pv.Plotter, add: Any) -> list[Any]:
    add(grid(), show_scalar_bar=False)
    mesh = pl.add_mesh(pv.Sphere(radius=0.4), color="w", reset_camera=False)
    out = []
    for x in (-1, 0, 1):
        mesh.position = (x, x, x)
        out.append(shot(pl))
    return out


@kind.case()
def one_grid_in_two_plots(pl: pv.Plotter, add: Any) -> list[Any]:
    volume, out = grid(), []
    for k in range(2):
        other = pv.Plotter(window_size=(200, 150), off_screen=True)
        volume[f"v{k}"] = (values(24, k).ravel() * (50 + 200 * k)).astype(np.float32)
        add(volume, to=other, scalars=f"v{k}")
        out.append(shot(other))
    return out


@kind.case(window={"shape": (1, 2), "window_size": (300, 150)})
def one_grid_twice_with_other_data(pl: pv.Plotter, add: Any) -> None:
    volume = grid()
    for k in range(2):
        pl.subplot(0, k)
        volume["s"] = (values(24, k).ravel() * (50 + 200 * k)).astype(np.float32)
        volume.set_active_scalars("s")
        add(volume)


@kind.case()
def one_grid_twice_at_other_places(pl: pv.Plotter, add: Any) -> None:
    volume = grid()
    add(volume, show_scalar_bar=False)
    volume.origin = (1.5, 0, 0)
    add(volume, show_scalar_bar=False, cmap="hot", name="second")


@kind.case()
def a_light_that_moves(pl: pv.Plotter, add: Any) -> list[Any]:
    add(grid(), shade=True, show_scalar_bar=False)
    light = pv.Light(position=(0, 5, 0), light_type="scene light")
    pl.add_light(light)
    before = shot(pl)
    light.position = (5, -5, 0)
    return [before, shot(pl)]


@kind.case(quick=True)
def a_small_turn(pl: pv.Plotter, add: Any) -> list[Any]:
    add(grid(), show_scalar_bar=False)
    before = shot(pl)
    pl.camera.azimuth += 5
    return [before, shot(pl)]


@kind.case()
def an_orbit(pl: pv.Plotter, add: Any) -> list[Any]:
    actor = add(grid(), show_scalar_bar=False)
    out = [shot(pl)]
    for _ in range(3):
        pl.camera.Azimuth(90)
        if add.ours:
            actor.regenerate()
        out.append(shot(pl))
    return out


def film(name: str, begin: Any) -> None:
    """Add a case of frames written to a file."""

    def scene(pl: pv.Plotter, add: Any) -> list[Any]:
        import tempfile
        from pathlib import Path

        from PIL import Image, ImageSequence

        volume = grid()
        add(volume, clim=(0, 255), show_scalar_bar=False)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / name
            begin(pl, path)
            for i in range(3):
                volume["values"][:] = values(24, i / 2).ravel() * 255
                volume.Modified()
                pl.write_frame()
            pl.close()
            with Image.open(path) as image:
                return [np.asarray(f.convert("RGB")) for f in ImageSequence.Iterator(image)]

    kind.add(f"a film: {name}", scene)


film("a.gif", lambda pl, path: pl.open_gif(str(path)))


# -- widgets
def widget(name: str, put: Any, **how: Any) -> None:
    """Add a case of a widget beside or on the volume."""

    def scene(pl: pv.Plotter, add: Any) -> None:
        put(pl, add(grid(), show_scalar_bar=False))

    kind.add(name, scene, **how)


widget(
    "add_volume_clip_plane of the actor",
    lambda pl, actor: pl.add_volume_clip_plane(actor, normal="x"),
)
widget(
    "add_volume_clip_plane, normal and origin",
    lambda pl, actor: pl.add_volume_clip_plane(actor, normal=(1, 1, 0), origin=(0.2, 0, 0)),
)
widget(
    "add_volume_clip_plane, not implicit",
    lambda pl, actor: pl.add_volume_clip_plane(actor, normal="y", implicit=False),
)


@kind.case()
def a_clip_plane_of_a_grid(pl: pv.Plotter, add: Any) -> None:
    """``add_vdi_clip_plane(grid)`` in place of ``add_volume_clip_plane(grid)``."""
    put = pl.add_vdi_clip_plane if add.ours else pl.add_volume_clip_plane
    put(grid(), normal="x", show_scalar_bar=False)
    if not add.ours:
        half_voxel_steps(pl.volume)


widget(
    "add_slider_widget",
    lambda pl, actor: pl.add_slider_widget(lambda value: None, (0, 1), title="x"),
)
widget(
    "a slider that sets the range",
    lambda pl, actor: pl.add_slider_widget(
        lambda value: setattr(actor.mapper.lookup_table, "scalar_range", (value, 255)),
        (0, 100),
        value=60,
    ),
)
widget(
    "add_checkbox_button_widget",
    lambda pl, actor: pl.add_checkbox_button_widget(actor.SetVisibility, value=True, size=20),
)
widget("add_box_widget", lambda pl, actor: pl.add_box_widget(lambda box: None))
widget("add_plane_widget", lambda pl, actor: pl.add_plane_widget(lambda normal, origin: None))
widget("add_line_widget", lambda pl, actor: pl.add_line_widget(lambda line: None))
widget("add_sphere_widget", lambda pl, actor: pl.add_sphere_widget(lambda center: None, radius=0.3))
widget(
    "add_text_slider_widget",
    lambda pl, actor: pl.add_text_slider_widget(lambda value: None, ["a", "b"]),
)
widget("add_measurement_widget", lambda pl, actor: pl.add_measurement_widget())
widget("enable_point_picking", lambda pl, actor: pl.enable_point_picking(show_message=False))
widget("enable_mesh_picking", lambda pl, actor: pl.enable_mesh_picking(show_message=False))
widget("add_key_event", lambda pl, actor: pl.add_key_event("a", lambda: None))
widget("enable_trackball_actor_style", lambda pl, actor: pl.enable_trackball_actor_style())
widget("enable_terrain_style", lambda pl, actor: pl.enable_terrain_style())
widget("track_mouse_position", lambda pl, actor: pl.track_mouse_position())
widget("add_on_render_callback", lambda pl, actor: pl.add_on_render_callback(lambda p: None))
widget("add_timer_event", lambda pl, actor: pl.add_timer_event(2, 100, lambda step: None))


def plane(normal: Any = (1, 0.5, 0)) -> Any:
    from vtkmodules.vtkCommonDataModel import vtkPlane

    made = vtkPlane()
    made.SetOrigin(0.1, 0, 0)
    made.SetNormal(*normal)
    return made


def table(cmap: str) -> pv.LookupTable:
    made = pv.LookupTable(cmap=cmap, scalar_range=(0, 255))
    made.apply_opacity([0, 0.3, 0.1, 0.8])
    return made


def changed(prop: pv.VolumeProperty) -> pv.VolumeProperty:
    prop.opacity_unit_distance = 0.4
    return prop


def moved(pl: pv.Plotter, actor: Any) -> None:
    other = actor.copy()
    other.position = (2.2, 0, 0)
    pl.add_actor(other)


def color_function() -> Any:
    from vtkmodules.vtkRenderingCore import vtkColorTransferFunction

    made = vtkColorTransferFunction()
    made.AddRGBPoint(0, 0, 0, 1)
    made.AddRGBPoint(150, 1, 1, 0)
    made.AddRGBPoint(255, 1, 0, 0)
    return made


def opacity_function() -> Any:
    from vtkmodules.vtkCommonDataModel import vtkPiecewiseFunction

    made = vtkPiecewiseFunction()
    for x, y in ((0, 0), (100, 0.0), (130, 0.3), (255, 0.6)):
        made.AddPoint(x, y)
    return made


def gradient_function() -> Any:
    from vtkmodules.vtkCommonDataModel import vtkPiecewiseFunction

    made = vtkPiecewiseFunction()
    made.AddPoint(0, 0)
    made.AddPoint(400, 1)
    return made


test_changes = kind.test()
