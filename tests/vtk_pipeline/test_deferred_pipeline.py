"""Values that are kept, in a VTK pipeline: a picture's property classifies them."""

from __future__ import annotations

import numpy as np
import pytest
from plugin_scenes import soft_ball
from settings import with_settings

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.vtk_pipeline import VDIToImage, vdi_to_image
from pyvista_vdi.vtk_pipeline.vtk import vtk_to_numpy, vtkVolumeProperty

CAMERA = pvdi.Camera((0, -6, 2), (0, 0, 0), (0, 0, 1))
SIZE = (24, 18)
KEPT = {"value_range": (30, 220)}


def shown_by(prop, vdi):
    image = pvdi.render(vdi.classified(volume_property=prop), vdi.camera)
    return image[::-1].reshape(-1, 4)


def pixels(picture):
    return vtk_to_numpy(picture.GetImage().GetPointData().GetArray("premultiplied"))


def some_property():
    prop = vtkVolumeProperty()
    prop.GetRGBTransferFunction().RemoveAllPoints()
    prop.GetScalarOpacity().RemoveAllPoints()  # VTK's has two
    prop.GetRGBTransferFunction().AddRGBPoint(30, 0, 0.5, 1)
    prop.GetRGBTransferFunction().AddRGBPoint(220, 1, 0.5, 0)
    prop.GetScalarOpacity().AddPoint(30, 0)
    prop.GetScalarOpacity().AddPoint(220, 0.9)
    return prop


def test_a_property_classifies_the_values_of_a_picture(default_runtime):
    direct = {"classification": "deferred", **KEPT, "device": default_runtime}
    kept = pvdi.generate(soft_ball(12), CAMERA, SIZE, **with_settings(**direct))
    prop, picture = some_property(), VDIToImage()
    picture.SetInputData(vdi_to_image(kept))
    with pytest.raises(InvalidArgumentError, match="SetVolumeProperty"):
        picture.Update()
    picture.SetVolumeProperty(prop)
    first = pixels(picture).copy()
    np.testing.assert_array_equal(first, shown_by(prop, kept))
    prop.GetScalarOpacity().AddPoint(100, 0)
    np.testing.assert_array_equal(pixels(picture), shown_by(prop, kept))
    assert np.abs(pixels(picture) - first).max() > 0.1
