"""VDIToImage, VDIReader and VDIWriter: what a VTK pipeline ends in, without a window."""

from __future__ import annotations

import numpy as np
import pytest
from extension_marks import cases
from plugin_scenes import soft_ball

import pyvista_vdi as pvdi
from pyvista_vdi.io import to_bytes
from pyvista_vdi.vtk_pipeline import (
    VDIReader,
    VDIToImage,
    VDIWriter,
    vdi_from_image,
    vdi_to_image,
)
from pyvista_vdi.vtk_pipeline.vtk import (
    vtk_to_numpy,
    vtkCamera,
    vtkStreamingDemandDrivenPipeline,
)


@pytest.fixture(scope="module")
def vdi(default_runtime):
    camera = pvdi.Camera((3, -5, 2), (0, 0, 0), (0, 0, 1))
    return pvdi.generate(soft_ball(), camera, (40, 30), cmap="viridis", opacity="linear")


@pytest.fixture
def picture(vdi):
    picture = VDIToImage()
    picture.SetInputDataObject(vdi_to_image(vdi))
    return picture


def reader_of(path):
    reader = VDIReader()
    reader.SetFileName(path)
    return reader


def pixels(image, name="premultiplied"):
    """Return a point array of an image as (height, width, 4), top row first."""
    width, height, depth = image.GetDimensions()
    assert depth == 1
    array = vtk_to_numpy(image.GetPointData().GetArray(name))
    return array.reshape(height, width, 4)[::-1]


def extent(algorithm):
    algorithm.UpdateInformation()
    key = vtkStreamingDemandDrivenPipeline.WHOLE_EXTENT()
    return algorithm.GetOutputInformation(0).Get(key)


def test_picture_is_what_render_returns(picture, vdi):
    image = picture.GetImage()
    expected = pvdi.render(vdi, vdi.camera)
    assert expected[..., 3].max() > 0.2  # there is something to see
    np.testing.assert_array_equal(pixels(image), expected)
    np.testing.assert_array_equal(pixels(image, "RGBA"), to_bytes(expected))
    assert image.GetPointData().GetScalars().GetName() == "RGBA"

    picture.SetWindowSize(25, 35)
    picture.SetAzimuth(20)
    picture.SetElevation(-10)
    turned = pvdi.render(vdi, vdi.camera.azimuth(20).elevation(-10), (25, 35))
    np.testing.assert_array_equal(pixels(picture.GetImage()), turned)

    camera = vtkCamera()
    camera.SetPosition(-4, -4, 1)
    picture.SetCamera(camera)
    picture.SetAzimuth(0)
    picture.SetElevation(0)
    picture.SetWindowSize(None)
    np.testing.assert_array_equal(pixels(picture.GetImage()), pvdi.render(vdi, camera))


@pytest.mark.parametrize("suffix", cases(".vdi", ".exr"))
def test_files_keep_every_bit(vdi, suffix, tmp_path):
    path = tmp_path / f"ball{suffix}"
    writer = VDIWriter()
    writer.SetInputData(vdi_to_image(vdi))
    writer.SetFileName(path)
    writer.Write()
    reader, picture = reader_of(path), VDIToImage()
    assert extent(reader) == (0, 39, 0, 29, 0, 0)
    picture.SetInputConnection(reader.GetOutputPort())
    picture.Update()
    found = vdi_from_image(reader.GetOutputDataObject(0))
    assert found.equals(vdi if suffix == ".vdi" else pvdi.read(path))
    assert reader.GetFileName() == writer.GetFileName() == str(path)
