"""A VDI beside what a plotter draws in different ways, before and after it: as beside a volume.

The judge is the same scene with ``add_volume``. Where VTK's own volume is missing or wrong, which
is known and said, it is our picture of the plain scene. ``tests/drop_in/test_neighbours.py`` has
everything else that a plotter can add.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import (
    TOLERANCE,
    add_judge,
    add_nothing,
    add_ours,
    assert_as_vtk,
    draw,
    soft_ball,
)
from pyvista import Plotter

from pyvista_vdi.vtk_pipeline.vtk import (
    vtkAssembly,
    # Before any widget: else PyVista 0.49's pv.Spline fails once a spline widget was added
    vtkCommonComputationalGeometry,  # noqa: F401
    vtkPlane,
    vtkPropAssembly,
)

pytestmark = pytest.mark.gl

WINDOW = (120, 100)
VIEW = ((4.5, 4.0, 3.0), (0.2, 0.0, 0.0), (0.0, 0.0, 1.0))

Add = Callable[[Plotter], object]


def beside() -> pv.PolyData:
    """A mesh whose half is inside the ball."""
    return pv.Sphere(radius=0.5, center=(0.5, 0.7, 0.5), theta_resolution=12, phi_resolution=12)


def checks() -> pv.Texture:
    squares = np.indices((16, 16)).sum(axis=0) % 2 * 255
    return pv.Texture(np.repeat(squares[..., np.newaxis], 3, axis=2).astype(np.uint8))


def sky() -> pv.Texture:
    """A cube map of six plain colours."""
    texture = pv.Texture()
    texture.SetMipmap(True)
    texture.SetInterpolate(True)
    texture.cube_map = True
    for face, color in enumerate(np.eye(6, 3) * 120 + 100):
        image = pv.ImageData(dimensions=(8, 8, 1))
        image["color"] = np.tile(color, (64, 1)).astype(np.uint8)
        texture.SetInputDataObject(face, image)
    return texture


def lit_by_the_sky(plotter: Plotter) -> None:
    plotter.set_environment_texture(sky(), is_srgb=True)
    plotter.renderer.GetEnvMapPrefiltered().SetPrefilterLevels(3)  # of 8 x 8 texels
    plotter.renderer.GetEnvMapPrefiltered().SetPrefilterMaxSamples(8)
    plotter.renderer.GetEnvMapIrradiance().SetIrradianceSize(8)
    plotter.renderer.GetEnvMapIrradiance().SetIrradianceStep(0.5)
    plotter.renderer.GetEnvMapLookupTable().SetLUTSize(16)
    plotter.renderer.GetEnvMapLookupTable().SetLUTSamples(8)
    plotter.add_mesh(beside(), pbr=True, metallic=0.8, roughness=0.2, color="w")


def textured(plotter: Plotter) -> None:
    mesh = pv.Plane(center=(0.4, 0.5, 0.2), direction=(1, 0.6, 0.3), i_size=2, j_size=2)
    plotter.add_mesh(mesh, texture=checks())


def charted(plotter: Plotter) -> None:
    chart = pv.Chart2D(size=(0.4, 0.4), loc=(0.0, 0.6))
    chart.line([0, 1, 2], [2, 1, 3])
    plotter.add_chart(chart)


def blocks(plotter: Plotter) -> None:
    cube = pv.Cube(center=(0.9, -0.4, 0.3), x_length=0.7, y_length=0.7, z_length=0.7)
    plotter.add_mesh(pv.MultiBlock({"ball": beside(), "cube": cube}), multi_colors=True)


def tubes(plotter: Plotter) -> None:
    t = np.linspace(0, 6, 20)
    line = pv.Spline(np.column_stack([np.cos(t), np.sin(t), t / 4 - 0.7]), 20)
    plotter.add_mesh(line, color="k", line_width=3, render_lines_as_tubes=True)


def labels(plotter: Plotter) -> None:
    corners = pv.PolyData([[0.9, 0.5, 0.5], [0.2, 0.9, 0.8], [-0.8, 0.4, 0.9]])
    plotter.add_point_labels(corners, ["a", "b", "c"], font_size=8)


#: What a plotter can add, or switch on, that VTK's own volume is right beside.
KINDS: dict[str, Add] = {
    "texture": textured,
    "multi-block": blocks,
    "environment": lit_by_the_sky,
    "skybox": lambda p: p.add_actor(sky().to_skybox()),
    "gaussians": lambda p: p.add_mesh(beside(), style="points_gaussian", point_size=6),
    "tubes": tubes,
    "point labels": labels,
    "chart": charted,
    "plane widget": lambda p: p.add_plane_widget(lambda *_: None),
}
#: Likewise, and at night.
MORE: dict[str, Add] = {
    "vertices": lambda p: p.add_mesh(beside(), show_vertices=True),
    "cursor": lambda p: p.add_cursor(bounds=(-1, 1, -1, 1, -1, 1)),
    "box widget": lambda p: p.add_box_widget(lambda *_: None),
    "slider": lambda p: p.add_slider_widget(lambda *_: None, (0, 1)),
    "line widget": lambda p: p.add_line_widget(lambda *_: None),
    "sphere widget": lambda p: p.add_sphere_widget(lambda *_: None, radius=0.6),
    "spline widget": lambda p: p.add_spline_widget(lambda *_: None),
    "button": lambda p: p.add_checkbox_button_widget(lambda *_: None, size=20),
    "clip plane of a mesh": lambda p: p.add_mesh_clip_plane(beside()),
    "measurement": lambda p: p.add_measurement_widget(),
}

#: Pixels in which a mesh itself differs: points and lines at the window's very last bits.
STRAYS = 6


def picture(kind: Add, add: Callable[..., object], *, later: bool = False) -> np.ndarray:
    """Draw a scene; ``later``: the neighbour comes when the volume has been drawn."""
    plotter = pv.Plotter(window_size=WINDOW)
    plotter.set_background("lightsteelblue")
    if later:
        add(plotter, soft_ball(16))
        plotter.camera_position = VIEW
        plotter.show(auto_close=False)
        kind(plotter)
    else:
        kind(plotter)
        add(plotter, soft_ball(16), reset_camera=False)
    plotter.camera_position = VIEW
    plotter.camera.parallel_scale = 1.8
    plotter.show(auto_close=False)
    image = plotter.screenshot(return_img=True)[..., :3].astype(int)
    plotter.close()
    return image


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] * (k % 3 > 0 or name in MORE))
        for k, name in enumerate({**KINDS, **MORE})
    ],
)
def test_a_vdi_beside_it_is_drawn_as_a_volume_is(name):
    kind = {**KINDS, **MORE}[name]
    judge = picture(kind, add_judge)
    assert np.abs(judge - picture(kind, add_nothing)).max() > 40, "VTK's volume is not seen"
    for later in (False, True):
        off = np.abs(picture(kind, add_ours, later=later) - judge).max(axis=-1)
        count = np.count_nonzero(off > TOLERANCE)
        assert count <= STRAYS, f"later={later}: {count} pixels are off by up to {off.max()}"


@pytest.mark.parametrize(
    ("kind", "how"), [(vtkPropAssembly, "one"), (vtkPropAssembly, "nested"), (vtkAssembly, "two")]
)
def test_parts_of_an_assembly_are_drawn(kind, how):
    """All of them, and what they end at: the assembly is not asked while it walks its parts."""

    def scene(plotter, add):
        parts = [add(plotter, soft_ball(16)) for _ in range(2 if how == "two" else 1)]
        if add is add_nothing:
            return
        if how == "two":
            # In front of the other one: VTK blends volumes in the order of adding
            parts[1].user_matrix = pv.Transform().translate(1.5, 1.4, 1.1).matrix
        assembly = kind()
        for part in parts:
            plotter.remove_actor(part, render=False)
            assembly.AddPart(part)
        if how == "nested":
            inner, assembly = assembly, kind()
            assembly.AddPart(inner)
        plotter.add_actor(assembly, reset_camera=False)
        plotter.add_mesh(beside(), color="w", reset_camera=False)

    assert_as_vtk(scene, lambda p: shot_from(p, VIEW), window_size=WINDOW)


def shot_from(plotter: Plotter, view: object) -> np.ndarray:
    plotter.camera_position = view
    plotter.show(auto_close=False)  # VTK's first frame with depth of field is black
    return plotter.screenshot(return_img=True)


def before_a_wall(plotter: Plotter, add: Callable[..., object], **looks: object) -> None:
    plotter.disable_anti_aliasing()  # passes draw without
    add(plotter, soft_ball(16), **looks)
    plotter.add_mesh(pv.Plane(center=(0, 0, -1.2), i_size=5, j_size=5), color="w")
    plotter.add_mesh(beside(), color="w")


def seen_under(
    enable: Callable[[Plotter], object] | None, add: Callable[..., object], **looks: object
) -> np.ndarray:
    def scene(plotter, add):
        if enable is not None:
            enable(plotter)
        before_a_wall(plotter, add, **looks)

    return draw(add, scene, lambda p: shot_from(p, VIEW), window_size=WINDOW)


@pytest.mark.parametrize("shade", [True, False])
def test_screen_space_ambient_occlusion_keeps_the_vdi(expected_messages, shade):
    """It is as dark as what is behind it; VTK's own volume is missing here."""
    ours = seen_under(Plotter.enable_ssao, add_ours, shade=shade)
    plain = seen_under(None, add_ours, shade=shade)
    dark = seen_under(Plotter.enable_ssao, add_nothing) / seen_under(None, add_nothing)
    assert np.abs(plain - seen_under(None, add_nothing)).max() > 40
    # 1 of 255 in the dividend is rounded, and in the picture: at the darkest mesh 1 in 80 of 255
    assert np.abs(ours - plain * dark).max() <= TOLERANCE
    said = expected_messages.GetOutput()
    assert said.count("ERROR") == said.count("Shading must be")


def test_shadows_are_drawn_as_over_a_volume():
    judge = seen_under(Plotter.enable_shadows, add_judge)
    ours = seen_under(Plotter.enable_shadows, add_ours)
    assert np.abs(ours - judge).max() <= TOLERANCE


def test_a_mapper_s_data_set_is_what_was_added():
    ball = soft_ball(16)
    plotter = pv.Plotter(window_size=WINDOW)
    actor = add_ours(plotter, ball)
    assert actor.mapper.dataset.dimensions == ball.dimensions
    np.testing.assert_array_equal(actor.mapper.dataset["v"], ball["v"])
    vdi = actor.regenerate()
    alone = plotter.add_vdi(vdi)
    assert alone.mapper.dataset.bounds == pytest.approx(ball.bounds)
    other = ball.copy()
    other["v"] = ball["v"][::-1].copy()
    actor.mapper.dataset = other
    assert not actor.regenerate().equals(vdi)


@pytest.mark.parametrize("of", ["mapper", "actor"])
def test_a_copy_of_the_mapper_draws_the_same_behind_another_actor(of):
    plotter = pv.Plotter(window_size=WINDOW)
    plotter.set_background("lightsteelblue")
    actor = add_ours(plotter, soft_ball(16))
    plane = vtkPlane()
    plane.SetNormal(1, 0.3, 0)
    actor.mapper.AddClippingPlane(plane)
    actor.mapper.SetCroppingRegionPlanes(-0.45, 0.3, -0.2, 0.5, -0.4, 0.25)
    actor.mapper.SetCroppingRegionFlagsToFence()
    actor.mapper.CroppingOn()
    actor.opacity_multiplier = 2.0
    plotter.camera_position = VIEW
    before = plotter.screenshot(return_img=True)
    other = actor.copy() if of == "actor" else type(actor)()
    if of == "mapper":
        other.mapper = actor.mapper.copy()
    assert other.opacity_multiplier == other.mapper.GetOpacityMultiplier() == 2.0
    assert other.mapper.scalar_range == actor.mapper.scalar_range
    plotter.remove_actor(actor)
    plotter.add_actor(other, reset_camera=False)
    np.testing.assert_array_equal(plotter.screenshot(return_img=True), before)
