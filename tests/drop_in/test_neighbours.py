"""Every kind of neighbour that a volume may have in a scene."""

import numpy as np
import pyvista as pv
from drop_in.stage import Kind
from drop_in.volumes import grid

kind = Kind("Neighbours in the scene")

INSIDE, LEFT = (0.4, -0.3, 0.3), (-0.6, 0.4, 0)


def neighbour(name, put, *, both=False, quick=False):
    """Add a case of a neighbour that comes after the volume, and one in which it comes before."""

    def after(pl, add):
        add(grid(), show_scalar_bar=False)
        put(pl)

    def before(pl, add):
        put(pl)
        add(grid(), show_scalar_bar=False)

    kind.add(name, after, quick=quick)
    if both:
        kind.add(f"{name}, added before", before)


def mesh(name, make, *, both=False, quick=False, **looks):
    """Add cases of a mesh."""
    neighbour(name, lambda pl: pl.add_mesh(make(), **looks), both=both, quick=quick)


def method(name, *arguments, both=False, **keywords):
    """Add cases of what a plotter's method of that name puts there."""
    neighbour(name, lambda pl: getattr(pl, name)(*arguments, **keywords), both=both)


def ball(**how):
    return pv.Sphere(**{"radius": 0.5, "center": INSIDE, **how})


def ball_and(other):
    return pv.MultiBlock([ball(), other])


def spline():
    return pv.Spline(np.random.default_rng(0).uniform(-1, 1, (8, 3)), 60)


BARE = {"show_scalar_bar": False}
CORNERS = np.array([[-1.0, -1, -1], [1, 1, 1], [1, -1, 1], [-1, 1, 1]])
PLACES = np.array([[0.0, 0, 0], [1, 1, 1], [-1, 1, 0]])
EDGE = {"x_length": 0.5, "y_length": 0.5, "z_length": 0.5}
LINES = {"render_lines_as_tubes": True, "line_width": 6, "color": "k"}
VALUES = np.arange(842.0)

mesh("opaque sphere inside", ball, color="w", both=True, quick=True)
mesh("sphere in front", lambda: ball(center=(1.5, 1.5, 1.5)), color="red")
mesh("translucent sphere", ball, color="red", opacity=0.4, both=True, quick=True)
mesh("wireframe", ball, style="wireframe", color="k", line_width=2, both=True)
method("add_points", ball().points, color="red", point_size=4, both=True)
method("add_lines", CORNERS, color="k", width=3, both=True)
mesh("lines as tubes", spline, **LINES)
mesh("contours of the volume", lambda: grid().contour([150.0]), opacity=0.5, **BARE, both=True)
mesh("a mesh of opacities", ball, scalars=VALUES, opacity="linear", **BARE)
mesh("a PBR mesh", ball, pbr=True, metallic=0.6, roughness=0.4, color="w", both=True)
mesh("a MultiBlock", lambda: ball_and(pv.Cube(center=LEFT, **EDGE)), both=True, quick=True)
neighbour(
    "add_composite",
    lambda pl: pl.add_composite(ball_and(pv.Cone(center=LEFT)), color="w"),
    both=True,
)
method("add_text", "Title", font_size=8, both=True)
method("add_point_labels", PLACES, ["a", "b", "c"], both=True)
ALWAYS = {"always_visible": True, "shape_color": "yellow"}
neighbour(
    "labels that are always visible",
    lambda pl: pl.add_point_labels(PLACES[:1], ["inside"], **ALWAYS),
)
method("add_axes", both=True)
method("show_grid")
method("add_bounding_box", color="k")
method("add_legend", [("one", "red"), ("two", "blue")], bcolor="w")
neighbour("add_light", lambda pl: pl.add_light(pv.Light(position=(5, 5, 5), color="red")))


@kind.case(quick=True)
def two_volumes_that_are_apart(pl, add):
    add(grid(), **BARE)
    add(grid(14, origin=(1.3, 1, 1)), cmap="hot", **BARE)


def near_and_far(pl, add, *, reverse=False):
    """Two volumes, the farther one first."""
    both = [(grid(16, origin=(-5, -1, -1)), "hot"), (grid(16), "viridis")]
    for volume, cmap in both[::-1] if reverse else both:
        add(volume, cmap=cmap, **BARE)
    pl.view_vector((1, 0.05, 0.05), viewup=(0, 0, 1))


kind.add("two volumes behind each other", near_and_far)


@kind.case(note="add_volume draws the one added last over the other; added from far to near")
def two_volumes_added_from_near_to_far(pl, add):
    near_and_far(pl, add, reverse=add.ours)


@kind.case()
def a_volume_and_an_ordinary_volume(pl, add):
    other = pl.add_volume(grid(14, origin=(1.3, 1, 1)), cmap="hot", **BARE)
    other.prop.interpolation_type = "linear"
    add(grid(), **BARE)


@kind.case(note="add_volume draws each over those before; one volume of both, side by side")
def two_volumes_that_touch(pl, add):
    whole = grid((24, 24, 24))
    looks = {"clim": (0, 255), "opacity_unit_distance": 0.1, **BARE}
    if not add.ours:
        add(whole, **looks)
        return
    add(whole.extract_subset((0, 12, 0, 23, 0, 23)), **looks)
    add(whole.extract_subset((12, 23, 0, 23, 0, 23)), **looks)


test_neighbours = kind.test()
