"""VDIMapper and VDIActor in windows of VTK's own, without a plotter."""

from __future__ import annotations

import gc

import numpy as np
import pytest
from plugin_scenes import TOLERANCE, soft_ball, vdi_of_one_list
from vtk_sources import ready_source, some_property
from watched_windows import on_screen

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidVDIError
from pyvista_vdi.vtk_pipeline.filters.convert import vdi_to_image
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkActor,
    vtkCamera,
    vtkGPUVolumeRayCastMapper,
    vtkPolyDataMapper,
    vtkRenderer,
    vtkRenderWindow,
    vtkSphereSource,
    vtkTrivialProducer,
    vtkVolume,
)

pytestmark = pytest.mark.gl


def window_with(*renderers, size=(120, 100)):
    window = vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.SetSize(*size)
    for renderer in renderers:
        window.AddRenderer(renderer)
    return window


def picture(window):
    for _ in range(2):  # the first frame in a second window may lack the actor
        window.Render()
    return on_screen(window)


def our_actor(source=None):
    if source is None:
        source = ready_source(
            InputDataObject=soft_ball(),
            Camera=None,
            WindowSize=None,
            MaxSupersegments=64,
            SampleDistance=0.02,
        )
    mapper = pvdi.VDIMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    actor = pvdi.VDIActor()
    actor.SetMapper(mapper)
    return actor


def judging_actor():
    mapper = vtkGPUVolumeRayCastMapper()
    mapper.SetInputData(soft_ball())
    mapper.SetAutoAdjustSampleDistances(0)
    mapper.SetSampleDistance(0.02)
    actor = vtkVolume()
    actor.SetMapper(mapper)
    actor.SetProperty(some_property())
    return actor


def scene_of(volume, camera=None):
    """A volume and an opaque sphere, half inside the ball."""
    sphere, mapper, actor = vtkSphereSource(), vtkPolyDataMapper(), vtkActor()
    sphere.SetCenter(0.4, 0.2, 0.5)
    sphere.SetRadius(0.5)
    mapper.SetInputConnection(sphere.GetOutputPort())
    actor.SetMapper(mapper)
    renderer = vtkRenderer()
    renderer.SetBackground(0.2, 0.3, 0.4)
    renderer.AddVolume(volume)
    renderer.AddActor(actor)
    if camera is None:
        renderer.ResetCamera()
    else:
        renderer.SetActiveCamera(camera)
    return renderer


def test_pipeline_draws_as_vtks_volume():
    ours = picture(window_with(scene_of(our_actor())))
    judge = picture(window_with(scene_of(judging_actor())))
    assert np.ptp(judge.reshape(-1, 3), axis=0).max() > 100
    assert np.abs(ours - judge).max() <= TOLERANCE


def test_one_actor_in_two_windows_and_two_viewports():
    actor = our_actor()
    first = scene_of(actor)
    window = window_with(first)
    alone = picture(window)
    second = scene_of(actor, first.GetActiveCamera())
    other = window_with(second)
    np.testing.assert_array_equal(picture(other), alone)
    np.testing.assert_array_equal(picture(window), alone)
    camera = vtkCamera()
    camera.DeepCopy(first.GetActiveCamera())
    camera.Azimuth(90)
    third = scene_of(actor, camera)
    second.SetViewport(0, 0, 0.5, 1)
    third.SetViewport(0.5, 0, 1, 1)
    other.AddRenderer(third)
    other.SetSize(240, 100)
    halves = picture(other)
    np.testing.assert_array_equal(halves[:, :120], alone)
    assert np.abs(halves[:, 120:] - alone).max() > 40


def test_mapper_takes_vdis_and_their_images_and_no_volumes():
    vdi = vdi_of_one_list()
    mapper = pvdi.VDIMapper()
    for put in (mapper.SetVDI, mapper.SetInputData):
        put(vdi)
        assert mapper.GetVDI() is vdi
    mapper.SetInputDataObject(vdi_to_image(vdi))
    assert mapper.GetVDI().equals(vdi)
    assert mapper.GetBounds() == (-1, 1, -1, 1, -1, 1)
    with pytest.raises(TypeError, match="blend_mode"):
        pvdi.VDIMapper(blend_mode=1)
    with pytest.raises(InvalidVDIError, match="put a VDISource between a volume and the mapper"):
        mapper.SetInputData(soft_ball())
    producer = vtkTrivialProducer()
    producer.SetOutput(soft_ball())
    with pytest.raises(InvalidVDIError, match="is not a VDI.*VDISource"):
        mapper.SetInputConnection(producer.GetOutputPort())
    assert mapper.GetVDI().equals(vdi), "what was there stays"


def test_no_leaks_in_pure_vtk(no_leaks):
    scenes = [scene_of(our_actor()), scene_of(our_actor(ready_source()))]
    window = window_with(*scenes)
    picture(window)
    window.Finalize()
    del window
    gc.collect()
    assert scenes[0].GetVolumes().GetLastProp().status.fps is None, "its window is gone"
