"""Every kind of change: of the actor, its property and table, of data, and of the scene."""

import tempfile
from pathlib import Path

import numpy as np
import pyvista as pv
from drop_in.stage import WINDOW, Kind, half_voxel_steps, shot
from drop_in.volumes import grid, values
from PIL import Image, ImageSequence

from pyvista_vdi.vtk_pipeline.vtk import vtkColorTransferFunction, vtkPiecewiseFunction, vtkPlane

kind = Kind("Changes after the first picture")


def change(name, act, *, quick=False, **arguments):
    """Add a case: a picture before and one after ``act(plotter, actor, volume)``."""

    def scene(pl, add):
        volume = grid()
        actor = add(volume, **{"show_scalar_bar": False, **arguments})
        yield shot(pl)
        act(pl, actor, volume)
        yield shot(pl)

    kind.add(name, scene, quick=quick)


def table_of(actor):
    return actor.mapper.lookup_table


def to(of, **attributes):
    """An act that sets attributes of the actor, its property, or its table."""

    def act(pl, actor, volume):
        target = {"actor": actor, "prop": actor.prop, "table": table_of(actor)}[of]
        for key, value in attributes.items():
            setattr(target, key, value)

    return act


def prop(name, value, *, quick=False, **arguments):
    change(f"prop.{name}", to("prop", **{name: value}), quick=quick, **arguments)


def clip(*normals):
    """An act that clips by planes."""

    def act(pl, actor, volume):
        for normal in normals:
            plane = vtkPlane()
            plane.SetOrigin(0.1, 0, 0)
            plane.SetNormal(*normal)
            actor.mapper.AddClippingPlane(plane)

    return act


def add_moved_copy(pl, actor, volume):
    other = actor.copy()
    other.position = (2.2, 0, 0)
    pl.add_actor(other)


change("visibility", to("actor", visibility=False))
change("position", to("actor", position=(0.4, 0.2, 0)), quick=True)
change("scale", to("actor", scale=(1.2, 0.8, 1.0)))
change("orientation", to("actor", orientation=(20, 30, 10)))
for axis in "xyz":
    change(f"rotate_{axis}", lambda pl, a, v, name=f"rotate_{axis}": getattr(a, name)(40))
change("origin", lambda pl, a, v: (setattr(a, "origin", (1, 0, 0)), a.rotate_z(30)))
MATRIX = pv.Transform().rotate_y(30).translate(0.2, 0, 0).matrix
change("user_matrix", to("actor", user_matrix=MATRIX))
change("a clipping plane", clip((1, 0.5, 0)))
change("two clipping planes", clip((1, 0.5, 0), (0, 0.2, -1)))
change("remove_actor", lambda pl, a, v: pl.remove_actor(a), quick=True)
change("remove_actor and add_actor", lambda pl, a, v: (pl.remove_actor(a), pl.add_actor(a)))
change("clear", lambda pl, a, v: pl.clear())
change("clear_actors", lambda pl, a, v: pl.clear_actors())
change("add_actor of a copy", lambda pl, a, v: (pl.remove_actor(a), pl.add_actor(a.copy())))
change("deep copy with another place", add_moved_copy)


def table():
    made = pv.LookupTable(cmap="hot", scalar_range=(0, 255))
    made.apply_opacity([0, 0.3, 0.1, 0.8])
    return made


def other_property(pl, actor, volume):
    actor.prop = pv.VolumeProperty(lookup_table=table(), opacity_unit_distance=0.3)


def copied_property(pl, actor, volume):
    copy = actor.prop.copy()
    copy.opacity_unit_distance = 0.4
    actor.prop = copy


def function(*points):
    made = vtkPiecewiseFunction()
    for point in points:
        made.AddPoint(*point)
    return made


def color_function(pl, actor, volume):
    made = vtkColorTransferFunction()
    for point in ((0, 0, 0, 1), (150, 1, 1, 0), (255, 1, 0, 0)):
        made.AddRGBPoint(*point)
    actor.prop.SetColor(made)


def opacity_function(pl, actor, volume):
    points = ((0, 0), (100, 0.0), (130, 0.3), (255, 0.6))
    actor.prop.SetScalarOpacity(function(*points))


def gradient_opacity(pl, actor, volume):
    actor.prop.SetGradientOpacity(function((0, 0), (400, 1)))


prop("shade", True)
prop("interpolation_type", "linear", quick=True)
prop("opacity_unit_distance", 0.5)
prop("ambient", 0.8, shade=True)
prop("diffuse", 0.2, shade=True)
change("prop.specular", to("prop", specular=1.0, specular_power=50), shade=True)
change("prop.apply_lookup_table", lambda pl, a, v: a.prop.apply_lookup_table(table()))
change("another VolumeProperty", other_property)
change("a copy of the property", copied_property)
prop("independent_components", True)
change("table.cmap", to("table", cmap="inferno"), quick=True)
change("table.scalar_range", to("table", scalar_range=(50, 150)))
change("table.apply_opacity", lambda pl, a, v: table_of(a).apply_opacity([0, 0.5, 0, 0.9]))
change("table.apply_cmap", lambda pl, a, v: table_of(a).apply_cmap("hot", 256))
change("VTK's colour function", color_function)
change("VTK's opacity function", opacity_function)
change("VTK's gradient opacity", gradient_opacity, opacity=0.3)


def other_values():
    return (values(24, 1).ravel() * 255).astype(np.float32)


def in_place(pl, actor, volume):
    volume["values"][:] = other_values()


def another_array(pl, actor, volume):
    volume["values"] = other_values()


def another_active_array(pl, actor, volume):
    volume["other"] = 255 - volume["values"]
    volume.set_active_scalars("other")


change("values in place", in_place, quick=True)
change("values and Modified", lambda pl, a, v: (in_place(pl, a, v), v.Modified()))
change("another array of the name", another_array)
change("another origin", lambda pl, a, v: setattr(v, "origin", (0, 0, 0)))
change("another spacing", lambda pl, a, v: setattr(v, "spacing", (0.1, 0.05, 0.1)))
change("another active array", another_active_array)

BARE = {"show_scalar_bar": False}


@kind.case(quick=True)
def replaced_by_name(pl, add):
    add(grid(), name="ball", **BARE)
    yield shot(pl)
    add(grid(seed=1), name="ball", cmap="hot", **BARE)
    yield shot(pl)


@kind.case()
def a_loop_that_replaces_by_name(pl, add):
    for i in range(4):
        add(grid(seed=i / 3), name="ball", clim=(0, 255), **BARE)
        yield shot(pl)


@kind.case()
def removed_by_name_and_added_again(pl, add):
    add(grid(), name="ball", **BARE)
    shot(pl)
    pl.remove_actor("ball")
    add(grid(seed=1), **BARE)


@kind.case()
def a_mesh_that_moves_through(pl, add):
    add(grid(), **BARE)
    mesh = pl.add_mesh(pv.Sphere(radius=0.4), color="w", reset_camera=False)
    for x in (-1, 0, 1):
        mesh.position = (x, x, x)
        yield shot(pl)


@kind.case()
def one_grid_in_two_plots(pl, add):
    volume = grid()
    for k in range(2):
        other = pv.Plotter(window_size=WINDOW, off_screen=True)
        volume[f"v{k}"] = (values(24, k).ravel() * (50 + 200 * k)).astype(np.float32)
        add(volume, to=other, scalars=f"v{k}")
        yield shot(other)


@kind.case(window={"shape": (1, 2), "window_size": (300, 150)})
def one_grid_twice_with_other_data(pl, add):
    volume = grid()
    for k in range(2):
        pl.subplot(0, k)
        volume["s"] = (values(24, k).ravel() * (50 + 200 * k)).astype(np.float32)
        volume.set_active_scalars("s")
        add(volume)


@kind.case()
def one_grid_twice_at_other_places(pl, add):
    volume = grid()
    add(volume, **BARE)
    volume.origin = (1.5, 0, 0)
    add(volume, cmap="hot", name="second", **BARE)


@kind.case()
def a_light_that_moves(pl, add):
    add(grid(), shade=True, **BARE)
    light = pv.Light(position=(0, 5, 0), light_type="scene light")
    pl.add_light(light)
    yield shot(pl)
    light.position = (5, -5, 0)
    yield shot(pl)


@kind.case(quick=True)
def a_small_turn(pl, add):
    add(grid(), **BARE)
    yield shot(pl)
    pl.camera.azimuth += 5
    yield shot(pl)


@kind.case()
def an_orbit(pl, add):
    actor = add(grid(), **BARE)
    yield shot(pl)
    for _ in range(3):
        pl.camera.Azimuth(90)
        if add.ours:
            actor.regenerate()
        yield shot(pl)


@kind.case(name="a film: a.gif")
def _(pl, add):
    volume = grid()
    add(volume, clim=(0, 255), **BARE)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.gif"
        pl.open_gif(str(path))
        for i in range(3):
            volume["values"][:] = values(24, i / 2).ravel() * 255
            volume.Modified()
            pl.write_frame()
        pl.close()
        with Image.open(path) as image:
            yield from [np.asarray(f.convert("RGB")) for f in ImageSequence.Iterator(image)]


def widget(name, put):
    """Add a case of a widget beside or on the volume."""

    def scene(pl, add):
        put(pl, add(grid(), **BARE))

    kind.add(name, scene)


def method(name, *arguments, **keywords):
    """Add a case of a plotter's method."""
    widget(name, lambda pl, actor: getattr(pl, name)(*arguments, **keywords))


def clip_plane(case, **how):
    put = "add_volume_clip_plane"
    widget(f"{put}{case}", lambda pl, actor: pl.add_volume_clip_plane(actor, **how))


clip_plane(" of the actor", normal="x")
clip_plane(", normal and origin", normal=(1, 1, 0), origin=(0.2, 0, 0))
clip_plane(", not implicit", normal="y", implicit=False)


@kind.case()
def a_clip_plane_of_a_grid(pl, add):
    """``add_volume_clip_plane(add_vdi(grid))`` in place of ``add_volume_clip_plane(grid)``."""
    shown = add(grid(), **BARE) if add.ours else grid()
    pl.add_volume_clip_plane(shown, normal="x", **({} if add.ours else BARE))
    if not add.ours:
        half_voxel_steps(pl.volume)


def range_by_slider(pl, actor):
    def moved(value):
        table_of(actor).scalar_range = (value, 255)

    pl.add_slider_widget(moved, (0, 100), value=60)


def nothing(*_):
    pass


method("add_slider_widget", nothing, (0, 1), title="x")
widget("a slider that sets the range", range_by_slider)
BUTTON = {"value": True, "size": 20}
name = "add_checkbox_button_widget"
widget(name, lambda pl, actor: pl.add_checkbox_button_widget(actor.SetVisibility, **BUTTON))
for each in ("box", "plane", "line"):
    method(f"add_{each}_widget", nothing)
method("add_sphere_widget", nothing, radius=0.3)
method("add_text_slider_widget", nothing, ["a", "b"])
method("add_measurement_widget")
method("enable_point_picking", show_message=False)
method("enable_mesh_picking", show_message=False)
method("add_key_event", "a", lambda: None)
method("enable_trackball_actor_style")
method("enable_terrain_style")
method("track_mouse_position")
method("add_on_render_callback", nothing)
method("add_timer_event", 2, 100, nothing)

test_changes = kind.test()
