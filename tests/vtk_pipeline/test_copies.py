"""Copies and new instances of actors, mappers and sources: the same picture, or a word."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from pipelines import Scene, image_of, is_blank, property_of, values
from plugin_scenes import LOOKS, soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError, VDIWarning
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkActor,
    vtkGPUVolumeRayCastMapper,
    vtkPlane,
    vtkPolyDataMapper,
    vtkSphereSource,
    vtkVolume,
)

pytestmark = pytest.mark.gl


@pytest.fixture
def scene():
    scene = Scene("auto")
    scene.set_input(image_of(values()))
    plane = vtkPlane()
    plane.SetOrigin(6, 6, 6)
    scene.mapper.AddClippingPlane(plane)
    scene.mapper.SetOpacityMultiplier(1.5)
    scene.mapper.SetCropping(True)
    scene.mapper.SetCroppingRegionPlanes(0, 9, 2, 12, 0, 12)
    scene.actor.SetPosition(1, 2, 3)
    scene.reset()
    return scene


def in_place_of(scene, actor):
    scene.renderer.RemoveVolume(scene.actor)
    scene.renderer.AddVolume(actor)
    return scene.picture()


def copied_actor(scene):
    actor = scene.actor.NewInstance()
    actor.ShallowCopy(scene.actor)
    assert actor.GetProperty() is scene.actor.GetProperty()
    return actor


def copied_mapper(scene):
    mapper = scene.mapper.NewInstance()
    mapper.ShallowCopy(scene.mapper)
    actor = pvdi.VDIActor()
    actor.SetMapper(mapper)
    actor.SetPosition(scene.actor.GetPosition())
    return actor


@pytest.mark.parametrize("copied", [copied_actor, copied_mapper])
def test_a_copy_draws_what_the_original_draws(scene, copied):
    before = scene.picture()
    assert not is_blank(before)
    copy = copied(scene)
    assert type(copy) is pvdi.VDIActor
    assert copy.GetMapper() is not scene.mapper
    np.testing.assert_array_equal(in_place_of(scene, copy), before)
    scene.property.GetScalarOpacity().AddPoint(120, 0)  # of the source, which both have
    assert np.abs(scene.picture() - before).mean() > 0.01
    scene.renderer.RemoveVolume(copy)
    copy.GetMapper().RemoveAllClippingPlanes()  # none of the original's
    assert scene.mapper.GetClippingPlanes().GetNumberOfItems() == 1


def test_a_copy_of_a_plotter_s_actor_has_its_colours():
    plotter = pv.Plotter(window_size=(80, 60))
    actor = plotter.add_vdi(soft_ball(12), **LOOKS)
    plotter.show(auto_close=False)
    before = plotter.screenshot(return_img=True)
    copy = actor.NewInstance()
    copy.ShallowCopy(actor)
    assert copy.mapper.lookup_table is actor.mapper.lookup_table
    assert copy.mapper.scalar_range == actor.mapper.scalar_range
    plotter.remove_actor(actor)
    plotter.add_actor(copy, reset_camera=False)
    plotter.render()
    np.testing.assert_array_equal(plotter.screenshot(return_img=True), before)


def test_copies_of_volumes_that_are_no_vdis_are_refused(scene):
    volume = vtkVolume()
    volume.SetMapper(vtkGPUVolumeRayCastMapper())
    with pytest.raises(InvalidArgumentError, match="needs a VDIMapper; got"):
        scene.actor.ShallowCopy(volume)
    with pytest.raises(InvalidArgumentError, match="copies a VDIMapper; got .*VDISource"):
        scene.mapper.ShallowCopy(volume.GetMapper())
    assert not is_blank(scene.picture())


@pytest.mark.parametrize("drawn", [False, True])
def test_a_volume_of_vtks_with_the_mapper_of_an_actor_is_told_of_the_remedy(scene, drawn):
    before = scene.picture() if drawn else None
    copy, elsewhere = vtkVolume(), Scene("vtk")
    copy.ShallowCopy(scene.actor)
    with pytest.warns(VDIWarning, match=r"behind another volume: .*VDIActor\(\).ShallowCopy"):
        assert is_blank(in_place_of(elsewhere, copy))
    elsewhere.close()
    if drawn:  # VTK 9.4 leaves one pixel of a corner black
        assert (scene.picture() != before).any(axis=-1).sum() <= 1


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("opacities", [(), (1.0,), (0.4, 0.6), (1.0, 0.5)])
@pytest.mark.parametrize("way", ["auto", "vdi"])
def test_peeling_of_volumes_draws_a_vdi_as_without(opacities, way):
    """VTK's ray caster draws pieces between translucent layers; a picture is drawn once."""
    scene = Scene(way, property_of(unit=1.0))
    scene.set_input(image_of(values()))
    for i, opacity in enumerate(opacities):
        sphere, mapper, actor = vtkSphereSource(), vtkPolyDataMapper(), vtkActor()
        sphere.SetCenter(4 + 4 * i, 6, 8)
        sphere.SetRadius(3)
        mapper.SetInputConnection(sphere.GetOutputPort())
        actor.SetMapper(mapper)
        actor.GetProperty().SetOpacity(opacity)
        scene.renderer.AddActor(actor)
    scene.window.SetAlphaBitPlanes(1)
    scene.renderer.SetUseDepthPeeling(1)
    scene.reset()
    wanted = scene.picture()
    scene.renderer.SetUseDepthPeelingForVolumes(1)
    with pytest.warns(VDIWarning, match="UseDepthPeelingForVolumes.*VTK's own mapper") as said:
        peeled = scene.picture()
    assert len(said) == 1
    assert np.abs(np.round(255 * (peeled - wanted))).max() <= 2  # bytes, rounded layer by layer
    np.testing.assert_array_equal(scene.picture(), peeled)
    scene.renderer.SetUseDepthPeelingForVolumes(0)
    np.testing.assert_array_equal(scene.picture(), wanted)
