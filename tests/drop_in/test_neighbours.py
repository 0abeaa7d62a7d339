"""Every kind of neighbour that a volume may have in a scene."""

import tempfile
from pathlib import Path

import numpy as np
import pyvista as pv
from drop_in.stage import Kind
from drop_in.volumes import grid
from PIL import Image
from vtk_builds import vtk_or_skip

from pyvista_vdi.vtk_pipeline.vtk import (
    vtkAssembly,
    vtkFollower,
    vtkImageActor,
    vtkImageSlice,
)

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


def actor(name, make, *, both=False):
    neighbour(name, lambda pl: pl.add_actor(make(pl)), both=both)


def ball(**how):
    return pv.Sphere(**{"radius": 0.5, "center": INSIDE, **how})


def ball_and(other):
    return pv.MultiBlock([ball(), other])


def noise(*shape, high=255):
    return np.random.default_rng(0).integers(0, high, shape).astype(np.uint8)


def tilted_plane():
    return pv.Plane(direction=(1, 1, 0), i_size=2, j_size=2)


def spline():
    return pv.Spline(np.random.default_rng(0).uniform(-1, 1, (8, 3)), 60)


def glyphs():
    return grid(6).glyph(orient=False, scale="values", factor=0.002, geom=pv.Cone())


def tube():
    return pv.Line((-1, -1, 0), (1, 1, 0.5)).tube(radius=0.08)


def frustum():
    camera = pv.Camera()
    camera.position, camera.focal_point, camera.clipping_range = (2, 2, 0), (0, 0, 0), (0.5, 2)
    return camera.view_frustum(1.0)


def cubemap():
    """Six faces of different colours."""
    texture = pv.Texture()
    texture.SetMipmap(True)
    texture.SetInterpolate(True)
    texture.cube_map = True
    for i in range(6):
        face = pv.ImageData(dimensions=(8, 8, 1))
        shade = np.zeros((64, 3), np.uint8)
        shade[:, i % 3] = 120 + 20 * i
        face["c"] = shade
        texture.SetInputDataObject(i, face)
    return texture


def environment(pl):
    """Light of a cube map, in few samples: filtering it takes Mesa long."""
    pl.renderer.GetEnvMapIrradiance().SetIrradianceSize(4)
    pl.renderer.GetEnvMapIrradiance().SetIrradianceStep(0.4)
    pl.renderer.GetEnvMapPrefiltered().SetPrefilterMaxSamples(4)
    pl.set_environment_texture(cubemap())


def billboard(pl):
    made = vtk_or_skip("vtkBillboardTextActor3D")()
    made.SetInput("billboard")
    made.SetPosition(0.3, 0, 1)
    return made


def background_image(pl):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.png"
        Image.fromarray(noise(6, 8, 3, high=99)).resize((200, 150)).save(path)
        pl.add_background_image(str(path))


def chart(pl):
    made = pv.Chart2D(size=(0.4, 0.4), loc=(0.05, 0.05))
    made.line([0, 1, 2], [0, 2, 1])
    pl.add_chart(made)


def light_that_shows_itself(pl):
    place = {"position": (1, 1, 1), "focal_point": (0, 0, 0), "cone_angle": 20}
    pl.add_light(pv.Light(**place, positional=True, show_actor=True))


def assembly(pl):
    made = vtkAssembly()
    for center in (INSIDE, LEFT):
        made.AddPart(pv.Actor(mapper=pv.DataSetMapper(ball(center=center, radius=0.3))))
    return made


def image_slice(pl):
    made, mapper = vtkImageSlice(), vtk_or_skip("vtkImageResliceMapper")()
    mapper.SetInputData(grid())
    made.SetMapper(mapper)
    made.GetProperty().SetColorWindow(255)
    made.GetProperty().SetColorLevel(127)
    return made


def image_actor(pl):
    made = vtkImageActor()
    made.SetInputData(grid(dtype=np.uint8))
    made.SetDisplayExtent(0, 23, 0, 23, 12, 12)
    return made


def lod(pl):
    made = vtk_or_skip("vtkLODActor")()
    made.SetMapper(pv.DataSetMapper(ball()))
    return made


def follower(pl):
    made = vtkFollower()
    made.SetMapper(pv.DataSetMapper(pv.Plane(i_size=1, j_size=1)))
    made.SetPosition(0.5, 0, 0.8)
    made.SetCamera(pl.camera)
    return made


def two_bars(pl):
    pl.add_mesh(ball(), scalars=np.arange(842.0))
    pl.add_scalar_bar("other", vertical=True)


def mesh_without_lights(pl):
    pl.remove_all_lights()
    pl.add_mesh(ball(), color="w")


BARE = {"show_scalar_bar": False}
CORNERS = np.array([[-1.0, -1, -1], [1, 1, 1], [1, -1, 1], [-1, 1, 1]])
PLACES = np.array([[0.0, 0, 0], [1, 1, 1], [-1, 1, 0]])
EDGE = {"x_length": 0.5, "y_length": 0.5, "z_length": 0.5}
LINES = {"render_lines_as_tubes": True, "line_width": 6, "color": "k"}
POINTS = {"style": "points", "point_size": 6, "render_points_as_spheres": True}
VALUES = np.arange(842.0)

mesh("opaque sphere inside", ball, color="w", both=True, quick=True)
mesh("sphere in front", lambda: ball(center=(1.5, 1.5, 1.5)), color="red")
mesh("sphere behind", lambda: ball(center=(-1.5, -1.5, -1.5)), color="red")
mesh("translucent sphere", ball, color="red", opacity=0.4, both=True, quick=True)
mesh("translucent plane", tilted_plane, color="red", opacity=0.5)
mesh("wireframe", ball, style="wireframe", color="k", line_width=2, both=True)
mesh("points as spheres", ball, **POINTS)
mesh("points_gaussian", ball, style="points_gaussian", point_size=8)
method("add_points", ball().points, color="red", point_size=4, both=True)
method("add_lines", CORNERS, color="k", width=3, both=True)
mesh("lines as tubes", spline, **LINES)
mesh("edges shown", lambda: pv.Cube(x_length=1, y_length=1, z_length=1), show_edges=True)
mesh("silhouette", ball, silhouette={"color": "red", "line_width": 4})
mesh("outline", lambda: grid().outline(), color="k", both=True)
mesh("contours of the volume", lambda: grid().contour([150.0]), opacity=0.5, **BARE, both=True)
mesh("contours, moving isovalue", lambda: grid().contour(4), style="wireframe", **BARE)
mesh("orthogonal slices", lambda: grid().slice_orthogonal(), **BARE, both=True)
mesh("slices along an axis", lambda: grid().slice_along_axis(n=4), **BARE)
mesh("a threshold's cells", lambda: grid(14).threshold(180), **BARE)
neighbour("arrows", lambda pl: pl.add_arrows(np.zeros((3, 3)), np.eye(3) * 1.5))
mesh("glyphs", glyphs, **BARE)
mesh("streamlines' tubes", tube, color="tan")
mesh("a mesh of scalars", ball, scalars=VALUES, cmap="jet")
mesh("a mesh of RGB", ball, scalars=noise(842, 3), rgb=True)
mesh("a mesh of opacities", ball, scalars=VALUES, opacity="linear", **BARE)
mesh("smooth and specular mesh", ball, smooth_shading=True, specular=1.0, color="w")
mesh("a PBR mesh", ball, pbr=True, metallic=0.6, roughness=0.4, color="w", both=True)
mesh("a mesh without lighting", ball, lighting=False, color="green")
SQUARE = {"center": (0, 0, 0), "i_size": 2, "j_size": 2}
neighbour(
    "a textured mesh",
    lambda pl: pl.add_mesh(pv.Plane(**SQUARE), texture=pv.Texture(noise(8, 8, 3))),
    both=True,
)
BACK = {"color": "red"}
mesh("backface_params", lambda: ball().clip("x", origin=INSIDE), color="w", backface_params=BACK)
mesh("culled mesh", ball, culling="front", color="w")
mesh("a MultiBlock", lambda: ball_and(pv.Cube(center=LEFT, **EDGE)), both=True, quick=True)
neighbour(
    "add_composite",
    lambda pl: pl.add_composite(ball_and(pv.Cone(center=LEFT)), color="w"),
    both=True,
)
neighbour(
    "a translucent MultiBlock",
    lambda pl: pl.add_composite(ball_and(pv.Cone(center=LEFT)), color="w", opacity=0.5),
)
neighbour("an environment texture", environment)
actor("a skybox", lambda pl: cubemap().to_skybox())
method("add_text", "Title", font_size=8, both=True)
TEXT = {"position": (60, 70), "font_size": 10, "color": "red"}
neighbour("add_text in the middle", lambda pl: pl.add_text("A volume", **TEXT))
method("add_title", "Title", font_size=8)
method("add_point_labels", PLACES, ["a", "b", "c"], both=True)
ALWAYS = {"always_visible": True, "shape_color": "yellow"}
neighbour(
    "labels that are always visible",
    lambda pl: pl.add_point_labels(PLACES[:1], ["inside"], **ALWAYS),
)
neighbour("add_point_scalar_labels", lambda pl: pl.add_point_scalar_labels(grid(2), "values"))
actor("a billboard", billboard)
mesh("Text3D", lambda: pv.Text3D("VDI", depth=0.2), color="red")
method("add_axes", both=True)
method("add_box_axes")
method("add_camera_orientation_widget")
method("add_north_arrow_widget")
method("add_axes_at_origin", labels_off=True)
method("show_grid")
method("show_bounds", grid="back", location="outer", ticks="both")
method("add_bounding_box", color="k")
method("add_floor", "-z", color="tan", pad=0.2)
FLOOR = {"opacity": 0.4, "color": "blue", "pad": 0.2}
neighbour("a translucent floor", lambda pl: pl.add_floor("-z", **FLOOR))
method("add_legend", [("one", "red"), ("two", "blue")], bcolor="w")
method("add_legend_scale")
method("add_ruler", (-1, -1, -1), (1, -1, -1))
neighbour("add_background_image", background_image)
method("add_logo_widget")
neighbour("a chart", chart)
neighbour("add_light", lambda pl: pl.add_light(pv.Light(position=(5, 5, 5), color="red")))
neighbour("remove_all_lights and a mesh", mesh_without_lights)
neighbour("a light that shows itself", light_that_shows_itself)
mesh("a camera's frustum", frustum, style="wireframe", color="k")
actor("an assembly of meshes", assembly)
mesh("an image as a mesh", lambda: grid(8), opacity=0.3, **BARE)
actor("a slice actor", image_slice, both=True)
actor("an image actor", image_actor)
neighbour("two scalar bars", two_bars)
actor("an LOD actor", lod)
actor("a follower", follower)


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
def five_volumes(pl, add):
    for i, cmap in enumerate(("bone", "hot", "viridis", "Blues", "Greens")):
        add(grid(10, seed=i % 2, origin=(2.5 * i, 0, 0)), cmap=cmap, **BARE)
    pl.view_xz()


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
