"""A VDISource that is ready to make a small VDI, and what counts its work."""

from __future__ import annotations

import pyvista as pv
from plugin_scenes import CLASSIFICATION, soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.vtk_pipeline.vtk import vtkCellDataToPointData

SIZE = (40, 30)


def some_property():
    """Viridis, and opaque as the value."""
    prop = pv.VolumeProperty(
        lookup_table=pv.LookupTable("viridis", scalar_range=CLASSIFICATION["clim"]),
        interpolation_type="linear",
        opacity_unit_distance=CLASSIFICATION["opacity_unit_distance"],
    )
    prop.GetScalarOpacity().RemoveAllPoints()
    prop.GetScalarOpacity().AddPoint(0, 0)
    prop.GetScalarOpacity().AddPoint(255, 1)
    return prop


def camera_at(x, y, z):
    """A camera that looks at the origin."""
    camera = pv.Camera()
    camera.position, camera.focal_point, camera.up = (x, y, z), (0, 0, 0), (0, 0, 1)
    return camera


def ready_source(producer=None, camera=None, **settings):
    """A source behind an algorithm, or of the soft ball; ``settings`` as its methods call them."""
    source = pvdi.VDISource()
    if producer is None:
        source.SetInputDataObject(soft_ball(12))
    else:
        source.SetInputConnection(producer.GetOutputPort())
    source.SetVolumeProperty(some_property())
    source.SetCamera(camera_at(5, 4, 3) if camera is None else camera)
    source.SetWindowSize(*SIZE)
    for name, value in settings.items():
        getattr(source, f"Set{name}")(value)
    return source


def executions(algorithm):
    """Count how often it executes."""
    counted = []
    algorithm.AddObserver("StartEvent", lambda *_: counted.append(1))
    return counted


def behind(algorithm):
    """A filter of VTK's behind an algorithm, which updates it from C++."""
    downstream = vtkCellDataToPointData()
    downstream.SetInputConnection(algorithm.GetOutputPort())
    return downstream
