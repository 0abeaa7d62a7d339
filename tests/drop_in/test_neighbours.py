"""Every kind of neighbour that a volume may have in a scene."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
from drop_in.stage import Kind
from drop_in.volumes import grid

kind = Kind("Neighbours in the scene")

INSIDE = (0.4, -0.3, 0.3)


def neighbour(name: str, put: Any, *, first: bool = True, **how: Any) -> None:
    """Add cases of a neighbour that comes after the volume, and before it."""

    def after(pl: pv.Plotter, add: Any) -> None:
        add(grid(), show_scalar_bar=False)
        put(pl)

    def before(pl: pv.Plotter, add: Any) -> None:
        put(pl)
        add(grid(), show_scalar_bar=False)

    quick = how.pop("quick", False)
    kind.add(name, after, quick=quick, **how)
    if first:
        kind.add(f"{name}, added before", before, **how)


def ball(**how: Any) -> pv.PolyData:
    return pv.Sphere(**{"radius": 0.5, "center": INSIDE, **how})


neighbour("opaque sphere inside", lambda pl: pl.add_mesh(ball(), color="w"), quick=True)
neighbour(
    "sphere in front",
    lambda pl: pl.add_mesh(ball(center=(1.5, 1.5, 1.5)), color="red"),
    first=False,
)
neighbour(
    "sphere behind",
    lambda pl: pl.add_mesh(ball(center=(-1.5, -1.5, -1.5)), color="red"),
    first=False,
)
neighbour(
    "translucent sphere", lambda pl: pl.add_mesh(ball(), color="red", opacity=0.4), quick=True
)
neighbour(
    "translucent plane",
    lambda pl: pl.add_mesh(
        pv.Plane(direction=(1, 1, 0), i_size=2, j_size=2), color="red", opacity=0.5
    ),
    first=False,
)
neighbour("wireframe", lambda pl: pl.add_mesh(ball(), style="wireframe", color="k", line_width=2))
neighbour(
    "points as spheres",
    lambda pl: pl.add_mesh(ball(), style="points", point_size=6, render_points_as_spheres=True),
    first=False,
)
neighbour(
    "points_gaussian",
    lambda pl: pl.add_mesh(ball(), style="points_gaussian", point_size=8),
    first=False,
)
neighbour("add_points", lambda pl: pl.add_points(ball().points, color="red", point_size=4))
neighbour(
    "add_lines",
    lambda pl: pl.add_lines(
        np.array([[-1.0, -1, -1], [1, 1, 1], [1, -1, 1], [-1, 1, 1]]), color="k", width=3
    ),
)
neighbour(
    "lines as tubes",
    lambda pl: pl.add_mesh(
        pv.Spline(np.random.default_rng(0).uniform(-1, 1, (8, 3)), 60),
        render_lines_as_tubes=True,
        line_width=6,
        color="k",
    ),
    first=False,
)
neighbour(
    "edges shown",
    lambda pl: pl.add_mesh(pv.Cube(x_length=1, y_length=1, z_length=1), show_edges=True),
    first=False,
)
neighbour(
    "silhouette",
    lambda pl: pl.add_mesh(ball(), silhouette={"color": "red", "line_width": 4}),
    first=False,
)
neighbour("outline", lambda pl: pl.add_mesh(grid().outline(), color="k"))
neighbour(
    "contours of the volume",
    lambda pl: pl.add_mesh(grid().contour([150.0]), opacity=0.5, show_scalar_bar=False),
)
neighbour(
    "contours, moving isovalue",
    lambda pl: pl.add_mesh(grid().contour(4), style="wireframe", show_scalar_bar=False),
    first=False,
)
neighbour(
    "orthogonal slices", lambda pl: pl.add_mesh(grid().slice_orthogonal(), show_scalar_bar=False)
)
neighbour(
    "slices along an axis",
    lambda pl: pl.add_mesh(grid().slice_along_axis(n=4), show_scalar_bar=False),
    first=False,
)
neighbour(
    "a threshold's cells",
    lambda pl: pl.add_mesh(grid(14).threshold(180), show_scalar_bar=False),
    first=False,
)
neighbour("arrows", lambda pl: pl.add_arrows(np.zeros((3, 3)), np.eye(3) * 1.5), first=False)
neighbour(
    "glyphs",
    lambda pl: pl.add_mesh(
        grid(6).glyph(orient=False, scale="values", factor=0.002, geom=pv.Cone()),
        show_scalar_bar=False,
    ),
    first=False,
)
neighbour(
    "streamlines' tubes",
    lambda pl: pl.add_mesh(pv.Line((-1, -1, 0), (1, 1, 0.5)).tube(radius=0.08), color="tan"),
    first=False,
)
neighbour(
    "a mesh of scalars",
    lambda pl: pl.add_mesh(ball(), scalars=np.arange(842.0), cmap="jet"),
    first=False,
)
neighbour(
    "a mesh of RGB",
    lambda pl: pl.add_mesh(
        ball(),
        scalars=np.random.default_rng(0).integers(0, 255, (842, 3)).astype(np.uint8),
        rgb=True,
    ),
    first=False,
)
neighbour(
    "a mesh of opacities",
    lambda pl: pl.add_mesh(
        ball(), scalars=np.arange(842.0), opacity="linear", show_scalar_bar=False
    ),
    first=False,
)
neighbour(
    "smooth and specular mesh",
    lambda pl: pl.add_mesh(ball(), smooth_shading=True, specular=1.0, color="w"),
    first=False,
)
neighbour(
    "a PBR mesh", lambda pl: pl.add_mesh(ball(), pbr=True, metallic=0.6, roughness=0.4, color="w")
)
neighbour(
    "a mesh without lighting",
    lambda pl: pl.add_mesh(ball(), lighting=False, color="green"),
    first=False,
)
neighbour(
    "a textured mesh",
    lambda pl: pl.add_mesh(
        pv.Plane(center=(0, 0, 0), i_size=2, j_size=2),
        texture=pv.Texture(np.random.default_rng(0).integers(0, 255, (8, 8, 3)).astype(np.uint8)),
    ),
)
neighbour(
    "backface_params",
    lambda pl: pl.add_mesh(
        ball().clip("x", origin=INSIDE), color="w", backface_params={"color": "red"}
    ),
    first=False,
)
neighbour("culled mesh", lambda pl: pl.add_mesh(ball(), culling="front", color="w"), first=False)
neighbour(
    "a MultiBlock",
    lambda pl: pl.add_mesh(
        pv.MultiBlock(
            [ball(), pv.Cube(center=(-0.6, 0.4, 0), x_length=0.5, y_length=0.5, z_length=0.5)]
        )
    ),
    quick=True,
)
neighbour(
    "add_composite",
    lambda pl: pl.add_composite(pv.MultiBlock([ball(), pv.Cone(center=(-0.6, 0.4, 0))]), color="w"),
)
neighbour(
    "a translucent MultiBlock",
    lambda pl: pl.add_composite(
        pv.MultiBlock([ball(), pv.Cone(center=(-0.6, 0.4, 0))]), color="w", opacity=0.5
    ),
    first=False,
)
neighbour("an environment texture", lambda pl: environment(pl), first=False)
neighbour("a skybox", lambda pl: pl.add_actor(cubemap().to_skybox()), first=False)
neighbour("add_text", lambda pl: pl.add_text("Title", font_size=8))
neighbour(
    "add_text in the middle",
    lambda pl: pl.add_text("A volume", position=(60, 70), font_size=10, color="red"),
    first=False,
)
neighbour("add_title", lambda pl: pl.add_title("Title", font_size=8), first=False)
neighbour(
    "add_point_labels",
    lambda pl: pl.add_point_labels(np.array([[0.0, 0, 0], [1, 1, 1], [-1, 1, 0]]), ["a", "b", "c"]),
)
neighbour(
    "labels that are always visible",
    lambda pl: pl.add_point_labels(
        np.array([[0.0, 0, 0]]), ["inside"], always_visible=True, shape_color="yellow"
    ),
    first=False,
)
neighbour(
    "add_point_scalar_labels", lambda pl: pl.add_point_scalar_labels(grid(2), "values"), first=False
)
neighbour("a billboard", lambda pl: pl.add_actor(billboard()), first=False)
neighbour("Text3D", lambda pl: pl.add_mesh(pv.Text3D("VDI", depth=0.2), color="red"), first=False)
neighbour("add_axes", lambda pl: pl.add_axes())
neighbour("add_box_axes", lambda pl: pl.add_box_axes(), first=False)
neighbour(
    "add_camera_orientation_widget", lambda pl: pl.add_camera_orientation_widget(), first=False
)
neighbour("add_north_arrow_widget", lambda pl: pl.add_north_arrow_widget(), first=False)
neighbour("add_axes_at_origin", lambda pl: pl.add_axes_at_origin(labels_off=True), first=False)
neighbour("show_grid", lambda pl: pl.show_grid(), first=False)
neighbour(
    "show_bounds",
    lambda pl: pl.show_bounds(grid="back", location="outer", ticks="both"),
    first=False,
)
neighbour("add_bounding_box", lambda pl: pl.add_bounding_box(color="k"), first=False)
neighbour("add_floor", lambda pl: pl.add_floor("-z", color="tan", pad=0.2), first=False)
neighbour(
    "a translucent floor",
    lambda pl: pl.add_floor("-z", opacity=0.4, color="blue", pad=0.2),
    first=False,
)
neighbour(
    "add_legend",
    lambda pl: pl.add_legend([("one", "red"), ("two", "blue")], bcolor="w"),
    first=False,
)
neighbour("add_legend_scale", lambda pl: pl.add_legend_scale(), first=False)
neighbour("add_ruler", lambda pl: pl.add_ruler((-1, -1, -1), (1, -1, -1)), first=False)
neighbour("add_background_image", lambda pl: background_image(pl), first=False)
neighbour("add_logo_widget", lambda pl: pl.add_logo_widget(), first=False)
neighbour("a chart", lambda pl: pl.add_chart(chart()), first=False)
neighbour(
    "add_light", lambda pl: pl.add_light(pv.Light(position=(5, 5, 5), color="red")), first=False
)
neighbour(
    "remove_all_lights and a mesh",
    lambda pl: (pl.remove_all_lights(), pl.add_mesh(ball(), color="w")),
    first=False,
)
neighbour("a light that shows itself", lambda pl: light_actor(pl), first=False)
neighbour("a camera's frustum", lambda pl: frustum(pl), first=False)
neighbour("an assembly of meshes", lambda pl: pl.add_actor(assembly()), first=False)
neighbour(
    "an image as a mesh",
    lambda pl: pl.add_mesh(grid(8), opacity=0.3, show_scalar_bar=False),
    first=False,
)
neighbour("a slice actor", lambda pl: pl.add_actor(image_slice()))
neighbour("an image actor", lambda pl: pl.add_actor(image_actor()), first=False)
neighbour(
    "two scalar bars",
    lambda pl: (
        pl.add_mesh(ball(), scalars=np.arange(842.0)),
        pl.add_scalar_bar("other", vertical=True),
    ),
    first=False,
)
neighbour("an LOD actor", lambda pl: pl.add_actor(lod()), first=False)
neighbour("a follower", lambda pl: pl.add_actor(follower(pl)), first=False)


def cubemap() -> pv.Texture:
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


def environment(pl: pv.Plotter) -> None:
    """Light of a cube map, in few samples: filtering it takes Mesa long."""
    pl.renderer.GetEnvMapIrradiance().SetIrradianceSize(4)
    pl.renderer.GetEnvMapIrradiance().SetIrradianceStep(0.4)
    pl.renderer.GetEnvMapPrefiltered().SetPrefilterMaxSamples(4)
    pl.set_environment_texture(cubemap())


def billboard() -> Any:
    from vtkmodules.vtkRenderingCore import vtkBillboardTextActor3D

    actor = vtkBillboardTextActor3D()
    actor.SetInput("billboard")
    actor.SetPosition(0.3, 0, 1)
    return actor


def background_image(pl: pv.Plotter) -> None:
    import tempfile
    from pathlib import Path

    from PIL import Image

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.png"
        Image.fromarray(
            np.random.default_rng(0).integers(0, 99, (6, 8, 3)).astype(np.uint8)
        ).resize((200, 150)).save(path)
        pl.add_background_image(str(path))


def chart() -> pv.Chart2D:
    made = pv.Chart2D(size=(0.4, 0.4), loc=(0.05, 0.05))
    made.line([0, 1, 2], [0, 2, 1])
    return made


def light_actor(pl: pv.Plotter) -> None:
    light = pv.Light(
        position=(1, 1, 1), focal_point=(0, 0, 0), cone_angle=20, positional=True, show_actor=True
    )
    pl.add_light(light)


def frustum(pl: pv.Plotter) -> None:
    camera = pv.Camera()
    camera.position, camera.focal_point, camera.clipping_range = (2, 2, 0), (0, 0, 0), (0.5, 2)
    pl.add_mesh(camera.view_frustum(1.0), style="wireframe", color="k")


def assembly() -> Any:
    from vtkmodules.vtkRenderingCore import vtkAssembly

    made = vtkAssembly()
    for center in (INSIDE, (-0.6, 0.4, 0)):
        made.AddPart(pv.Actor(mapper=pv.DataSetMapper(ball(center=center, radius=0.3))))
    return made


def image_slice() -> Any:
    from vtkmodules.vtkRenderingCore import vtkImageSlice
    from vtkmodules.vtkRenderingImage import vtkImageResliceMapper

    made, mapper = vtkImageSlice(), vtkImageResliceMapper()
    mapper.SetInputData(grid())
    made.SetMapper(mapper)
    made.GetProperty().SetColorWindow(255)
    made.GetProperty().SetColorLevel(127)
    return made


def image_actor() -> Any:
    from vtkmodules.vtkRenderingCore import vtkImageActor

    made = vtkImageActor()
    made.SetInputData(grid(dtype=np.uint8))
    made.SetDisplayExtent(0, 23, 0, 23, 12, 12)
    return made


def lod() -> Any:
    from vtkmodules.vtkRenderingLOD import vtkLODActor

    made = vtkLODActor()
    made.SetMapper(pv.DataSetMapper(ball()))
    return made


def follower(pl: pv.Plotter) -> Any:
    from vtkmodules.vtkRenderingCore import vtkFollower

    made = vtkFollower()
    made.SetMapper(pv.DataSetMapper(pv.Plane(i_size=1, j_size=1)))
    made.SetPosition(0.5, 0, 0.8)
    made.SetCamera(pl.camera)
    return made


# -- several volumes
def apart(pl: pv.Plotter, add: Any) -> None:
    add(grid(), show_scalar_bar=False)
    add(grid(14, origin=(1.3, 1, 1)), cmap="hot", show_scalar_bar=False)


kind.add("two volumes that are apart", apart, quick=True)


@kind.case()
def two_volumes_behind_each_other(pl: pv.Plotter, add: Any) -> None:
    add(grid(16, origin=(-5, -1, -1)), cmap="hot", show_scalar_bar=False)
    add(grid(16), show_scalar_bar=False)
    pl.view_vector((1, 0.05, 0.05), viewup=(0, 0, 1))


@kind.case(note="add_volume draws the one added last over the other; added from far to near")
def two_volumes_added_from_near_to_far(pl: pv.Plotter, add: Any) -> None:
    both = [(grid(16), "viridis"), (grid(16, origin=(-5, -1, -1)), "hot")]
    for volume, cmap in both if add.ours else both[::-1]:
        add(volume, cmap=cmap, show_scalar_bar=False)
    pl.view_vector((1, 0.05, 0.05), viewup=(0, 0, 1))


@kind.case()
def five_volumes(pl: pv.Plotter, add: Any) -> None:
    for i, cmap in enumerate(("bone", "hot", "viridis", "Blues", "Greens")):
        add(grid(10, seed=i % 2, origin=(2.5 * i, 0, 0)), cmap=cmap, show_scalar_bar=False)
    pl.view_xz()


@kind.case()
def a_volume_and_an_ordinary_volume(pl: pv.Plotter, add: Any) -> None:
    other = pl.add_volume(grid(14, origin=(1.3, 1, 1)), show_scalar_bar=False, cmap="hot")
    other.prop.interpolation_type = "linear"
    add(grid(), show_scalar_bar=False)


@kind.case(note="add_volume draws each over those before; one volume of both, side by side")
def two_volumes_that_touch(pl: pv.Plotter, add: Any) -> None:
    whole = grid((24, 24, 24))
    looks = {"show_scalar_bar": False, "clim": (0, 255), "opacity_unit_distance": 0.1}
    if not add.ours:
        add(whole, **looks)
        return
    add(whole.extract_subset((0, 12, 0, 23, 0, 23)), **looks)
    add(whole.extract_subset((12, 23, 0, 23, 0, 23)), **looks)


test_neighbours = kind.test()
