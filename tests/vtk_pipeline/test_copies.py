"""Copies and new instances of actors, mappers and sources: the same picture, or a word."""

from __future__ import annotations

import numpy as np
import pytest
from pipelines import Scene, image_of, is_blank, values

import pyvista_vdi as pvdi
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkPlane,
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
