"""VDIToImage, VDIReader and VDIWriter: what a VTK pipeline ends in, without a window."""

from __future__ import annotations

import numpy as np
import pytest
from extension_marks import cases
from plugin_scenes import soft_ball, vdi_of_one_list
from vtk_sources import ready_source

import pyvista_vdi as pvdi
from pyvista_vdi import errors
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
    vtkDataObject,
    vtkImageData,
    vtkImageFlip,
    vtkStreamingDemandDrivenPipeline,
    vtkXMLImageDataReader,
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


@pytest.mark.parametrize("kind", [VDIToImage, VDIWriter, pvdi.VDISource])
def test_what_has_no_input_says_so(kind, expected_messages, tmp_path):
    end = kind()
    ask, error = end.Update, errors.InvalidVDIError
    if kind is VDIWriter:
        end.SetFileName(str(tmp_path / "a.vdi"))
        ask = end.Write
    elif kind is pvdi.VDISource:
        end, error = ready_source(InputDataObject=None), errors.InvalidVolumeError
        ask = end.GetVDI
    with pytest.raises(error, match=rf"{kind.__name__} has no input"):
        ask()
    if kind is pvdi.VDISource:  # of what was there before, nothing is left
        end.SetInputDataObject(soft_ball(4))
        end.GetVDI()
    reader = vtkXMLImageDataReader()
    reader.SetFileName(str(tmp_path / "none.vti"))
    end.SetInputConnection(reader.GetOutputPort())
    with pytest.raises(error, match=r"VTK's output window says why"):
        ask()
    with pytest.raises(error, match=r"VTK's output window says why"):
        (ask if kind is VDIWriter else end.Update)()
    assert "none.vti" in expected_messages.GetOutput()
    assert not list(tmp_path.iterdir())


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


@pytest.mark.parametrize("degrees", ["x", None, np.nan, np.inf])
def test_a_picture_is_turned_by_a_finite_angle(degrees, picture):
    for turn in (picture.SetAzimuth, picture.SetElevation):
        with pytest.raises(
            errors.InvalidArgumentError, match=f"must be finite degrees; got {degrees!r}"
        ):
            turn(degrees)
    assert (picture.GetAzimuth(), picture.GetElevation()) == (0, 0)


def test_a_picture_holds_none_of_its_input(picture):
    """VTK before 9.7 frees memory twice where an attribute of a filter is the last to hold data."""
    picture.Update()
    held = [*vars(picture).values()]
    held += [part for each in held if isinstance(each, tuple | list) for part in each]
    assert held
    assert not [each for each in held if isinstance(each, vtkDataObject)]


def test_extent_is_known_before_the_picture(picture, vdi):
    for size in (None, (7, 5)):
        picture.SetWindowSize(size)
        width, height = size or vdi.window_size
        assert extent(picture) == (0, width - 1, 0, height - 1, 0, 0)
    assert picture.GetOutputDataObject(0).GetNumberOfPoints() == 0


@pytest.mark.parametrize("given", ["data", "file"])
def test_pictures_of_a_dials_vdi_have_the_size_that_was_asked_for(given, picture, vdi, tmp_path):
    names = ("camera", "window_size", "offsets", "front", "back", "color", "optical_depth")
    arrays = {name: getattr(vdi, name) for name in (*names, "bounds", "depth_origin")}
    lists = pvdi.VDI(**arrays, metadata={"dial": {"window_size": [64, 48]}})
    picture.SetInputDataObject(vdi_to_image(lists))
    if given == "file":
        reader = reader_of(lists.save(tmp_path / "ball.vdi"))
        picture.SetInputConnection(reader.GetOutputPort())
    behind = vtkImageFlip()  # it asks for what was announced before there was a picture
    behind.SetInputConnection(picture.GetOutputPort())
    behind.SetFilteredAxis(1)
    behind.Update()
    flipped = pixels(behind.GetOutput(), "RGBA")[::-1]
    np.testing.assert_array_equal(flipped, to_bytes(pvdi.render(lists, lists.camera, (64, 48))))
    picture.SetWindowSize(7, 5)
    behind.Update()
    assert behind.GetOutput().GetDimensions() == (7, 5, 1)


def test_picture_is_made_again_only_if_something_changed(picture):
    image = picture.GetInputDataObject(0, 0)
    made = picture.GetImage().GetMTime()
    picture.SetAzimuth(0)
    assert picture.GetImage().GetMTime() == made
    picture.SetAzimuth(5)
    assert picture.GetImage().GetMTime() > made
    other = vdi_of_one_list()
    image.ShallowCopy(vdi_to_image(other))
    turned = pvdi.render(other, other.camera.azimuth(5))
    np.testing.assert_array_equal(pixels(picture.GetImage()), turned)


def test_what_is_no_vdi_has_no_picture(vdi, expected_messages):
    picture, volume = VDIToImage(), vtkImageData()
    picture.SetInputDataObject(vdi_to_image(vdi))
    picture.Update()
    volume.SetDimensions(3, 3, 3)
    picture.SetInputDataObject(volume)
    with pytest.raises(errors.InvalidVDIError, match="is not a VDI"):
        picture.Update()
    assert picture.GetOutputDataObject(0).GetNumberOfPoints() == 0
    assert expected_messages.GetOutput() == ""
    picture.GetExecutive().Update()  # VTK's own update cannot raise
    said = "VDIToImage: this vtkImageData is not a VDI"
    assert said in expected_messages.GetOutput()


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


def test_files_are_written_as_asked_for(vdi, tmp_path):
    writer = VDIWriter()
    writer.SetInputData(vdi_to_image(vdi))
    writer.SetFileName(tmp_path / "a.vdi")
    assert (writer.GetPrecision(), writer.GetCompression()) == (None, None)
    writer.SetPrecision("8-byte")
    writer.SetCompression("zstd")
    writer.Write()
    vdi.save(tmp_path / "b.vdi", precision="8-byte", compression="zstd")
    assert (tmp_path / "a.vdi").read_bytes() == (tmp_path / "b.vdi").read_bytes()
    with pytest.raises(errors.InvalidArgumentError, match="precision must be .*'4-byte'"):
        writer.SetPrecision("4-byte")
    writer.SetCompression("zip")
    with pytest.raises(errors.InvalidArgumentError, match="compression of .*'zip'"):
        writer.Write()


def test_files_say_what_is_wrong(vdi, tmp_path):
    with pytest.raises(errors.InvalidArgumentError, match="SetFileName"):
        VDIReader().Update()
    with pytest.raises(errors.VDIFileError, match="absent.vdi cannot be read"):
        reader_of(tmp_path / "absent.vdi").Update()
    for name, data, error, message in (
        (None, vdi_to_image(vdi), errors.InvalidArgumentError, "SetFileName"),
        ("ball.png", vdi_to_image(vdi), errors.VDIFileError, "png"),
        ("ball.vdi", vtkImageData(), errors.InvalidVDIError, "is not a VDI"),
    ):
        writer = VDIWriter()
        writer.SetInputData(data)
        if name is not None:
            writer.SetFileName(tmp_path / name)
        with pytest.raises(error, match=message):
            writer.Write()
    assert list(tmp_path.iterdir()) == []
