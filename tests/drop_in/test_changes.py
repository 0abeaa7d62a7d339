"""Every kind of change: of the actor, its property and table, of data, and of the scene."""

import numpy as np
import pyvista as pv
from drop_in.stage import Kind, half_voxel_steps, shot
from drop_in.volumes import grid, values

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


change("visibility", to("actor", visibility=False))
change("position", to("actor", position=(0.4, 0.2, 0)), quick=True)
change("scale", to("actor", scale=(1.2, 0.8, 1.0)))
MATRIX = pv.Transform().rotate_y(30).translate(0.2, 0, 0).matrix
change("user_matrix", to("actor", user_matrix=MATRIX))
change("a clipping plane", clip((1, 0.5, 0)))
change("remove_actor", lambda pl, a, v: pl.remove_actor(a), quick=True)
change("remove_actor and add_actor", lambda pl, a, v: (pl.remove_actor(a), pl.add_actor(a)))
change("clear", lambda pl, a, v: pl.clear())


def table():
    made = pv.LookupTable(cmap="hot", scalar_range=(0, 255))
    made.apply_opacity([0, 0.3, 0.1, 0.8])
    return made


def other_property(pl, actor, volume):
    actor.prop = pv.VolumeProperty(lookup_table=table(), opacity_unit_distance=0.3)


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


prop("shade", True)
prop("interpolation_type", "linear", quick=True)
prop("opacity_unit_distance", 0.5)
change("prop.specular", to("prop", specular=1.0, specular_power=50), shade=True)
change("prop.apply_lookup_table", lambda pl, a, v: a.prop.apply_lookup_table(table()))
change("another VolumeProperty", other_property)
change("table.cmap", to("table", cmap="inferno"), quick=True)
change("table.scalar_range", to("table", scalar_range=(50, 150)))
change("table.apply_opacity", lambda pl, a, v: table_of(a).apply_opacity([0, 0.5, 0, 0.9]))
change("VTK's colour function", color_function)
change("VTK's opacity function", opacity_function)


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
change("another array of the name", another_array)
change("another origin", lambda pl, a, v: setattr(v, "origin", (0, 0, 0)))
change("another active array", another_active_array)

BARE = {"show_scalar_bar": False}


@kind.case(quick=True)
def replaced_by_name(pl, add):
    add(grid(), name="ball", **BARE)
    yield shot(pl)
    add(grid(seed=1), name="ball", cmap="hot", **BARE)
    yield shot(pl)


@kind.case()
def a_mesh_that_moves_through(pl, add):
    add(grid(), **BARE)
    mesh = pl.add_mesh(pv.Sphere(radius=0.4), color="w", reset_camera=False)
    for x in (-1, 0, 1):
        mesh.position = (x, x, x)
        yield shot(pl)


@kind.case(quick=True)
def a_small_turn(pl, add):
    add(grid(), **BARE)
    yield shot(pl)
    pl.camera.azimuth += 5
    yield shot(pl)


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


@kind.case()
def a_clip_plane_of_a_grid(pl, add):
    """``add_volume_clip_plane(add_vdi(grid))`` in place of ``add_volume_clip_plane(grid)``."""
    shown = add(grid(), **BARE) if add.ours else grid()
    pl.add_volume_clip_plane(shown, normal="x", **({} if add.ours else BARE))
    if not add.ours:
        half_voxel_steps(pl.volume)


def nothing(*_):
    pass


method("add_slider_widget", nothing, (0, 1), title="x")

test_changes = kind.test()
