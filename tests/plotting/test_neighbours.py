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
    vtkPropAssembly,
)

pytestmark = pytest.mark.gl

WINDOW = (120, 100)
VIEW = ((4.5, 4.0, 3.0), (0.2, 0.0, 0.0), (0.0, 0.0, 1.0))


def beside() -> pv.PolyData:
    """A mesh whose half is inside the ball."""
    return pv.Sphere(radius=0.5, center=(0.5, 0.7, 0.5), theta_resolution=12, phi_resolution=12)


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
