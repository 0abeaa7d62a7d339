"""VDIs in assemblies; ``tests/drop_in/test_neighbours.py`` has what else a plotter can add."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import add_nothing, assert_as_vtk, soft_ball
from pyvista import Plotter

from pyvista_vdi.vtk_pipeline.vtk import vtkAssembly, vtkPropAssembly

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
