"""VDISource among VTK's own algorithms: readers, filters, cameras that move, aborts."""

from __future__ import annotations

import gc

import pytest
import pyvista as pv
from plugin_scenes import soft_ball
from vtk_sources import SIZE, behind, camera_at, executions, ready_source

import pyvista_vdi as pvdi
from pyvista_vdi import errors
from pyvista_vdi.vtk_pipeline.filters.convert import vdi_to_image
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkTrivialProducer,
    vtkXMLImageDataReader,
    vtkXMLImageDataWriter,
)

pytestmark = pytest.mark.gl


def test_it_executes_only_when_something_has_changed():
    source, other = ready_source(), pv.Plotter(off_screen=True).renderer
    counted = executions(source)
    prop, volume = source.GetVolumeProperty(), source.GetInputDataObject(0, 0)
    source.SetLights(other)
    source.SetMetadata({"a": 1})
    source.Update()
    stamp = source.GetMTime()
    for name, value in (
        ("Camera", camera_at(5, 4, 3)),
        ("MaxSupersegments", 20),
        ("Lights", other),
        ("Metadata", {"a": 1}),
        ("SampleDistance", None),
        ("Tolerance", 0.0),
        ("ViewCone", 60.0),
        ("Coverage", "view"),
        ("WindowSize", SIZE),
        ("VolumeProperty", prop),
        ("Scalars", None),
        ("TrackCamera", False),
    ):
        getattr(source, f"Set{name}")(value)
        assert source.GetMTime() == stamp, name
    source.Update()
    assert len(counted) == 1
    first = source.GetVDI()
    changes = [
        lambda: prop.GetScalarOpacity().AddPoint(100, 0.1),
        lambda: prop.GetRGBTransferFunction().AddRGBPoint(100, 0, 1, 0),
        lambda: prop.SetScalarOpacityUnitDistance(0.3),
        lambda: source.SetCamera(camera_at(5, 5, 5)),
        lambda: source.SetMaxSupersegments(5),
        lambda: volume.GetPointData().GetScalars().Modified(),
    ]
    for count, change in enumerate(changes, start=2):
        change()
        source.Update()
        assert len(counted) == count
    assert not source.GetVDI().equals(first)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("Camera", r"has no camera \(SetCamera\)"),
        ("WindowSize", r"no window size \(SetWindowSize\)"),
        ("VolumeProperty", "no volume property"),
        ("InputDataObject", "has no input: call SetInputDataObject"),
    ],
)
def test_what_is_missing_is_named(setting, message, expected_messages):
    source = ready_source(**{setting: None})
    for ask in (source.Update, source.GetVDI):
        with pytest.raises((errors.InvalidArgumentError, errors.InvalidVolumeError), match=message):
            ask()
    behind(source).Update()  # from C++: nothing can be raised
    said = "0 connections" if setting == "InputDataObject" else "VDISource has no"
    assert said in expected_messages.GetOutput()


def file_of(image, path, writer):
    writer.SetInputData(image)
    writer.SetFileName(str(path))
    writer.Write()


def read_from(path, reader):
    reader.SetFileName(str(path))
    return reader


def test_what_only_an_update_can_tell_is_refused_by_name(expected_messages):
    producer = vtkTrivialProducer()  # it promises a vtkDataObject
    producer.SetOutput(pv.MultiBlock([soft_ball(6)]))
    source = ready_source(producer)
    assert source.GetInputBounds() is None
    for ask in (source.Update, source.GetVDI, source.GetVolume, source.MakeRequest):
        with pytest.raises(errors.UnsupportedError, match="MultiBlock.* is not a uniform grid"):
            ask()
    downstream = behind(source)
    source.Modified()
    downstream.Update()
    assert downstream.GetOutput().GetNumberOfPoints() == 0
    assert "is not a uniform grid" in expected_messages.GetOutput()
    assert expected_messages.GetOutput().count("VDISource") == 1, "not once for each block"
    source.SetInputDataObject(soft_ball(12))
    assert source.GetVDI().n_supersegments > 500


def test_a_mapper_behind_a_file_keeps_its_reader(tmp_path):
    """A VTK port does not: a reader that only the mapper knows would be gone."""
    made, path = ready_source().GetVDI(), tmp_path / "v.vti"

    def connected():
        file_of(vdi_to_image(made), path, vtkXMLImageDataWriter())
        reader, mapper = read_from(path, vtkXMLImageDataReader()), pvdi.VDIMapper()
        mapper.SetInputConnection(reader.GetOutputPort())
        return mapper

    mapper = connected()
    gc.collect()
    assert mapper.driver.input.stamp()[0] > 0
    assert mapper.GetVDI().equals(made)
    assert mapper.GetBounds() == pytest.approx(soft_ball(12).GetBounds())


def test_a_copy_is_kept_unless_the_camera_is_followed():
    camera = camera_at(5, 4, 3)
    source = ready_source(camera=camera)
    assert not source.GetTrackCamera()
    first, counted, stamp = source.GetVDI(), executions(source), source.GetMTime()
    camera.Azimuth(10)
    assert source.GetVDI() is first
    assert source.GetMTime() == stamp
    source.TrackCameraOn()  # it has moved already
    assert source.GetMTime() > stamp
    second = source.GetVDI()
    assert second.camera == source.GetCamera() == pvdi.Camera.from_any(camera)
    stamp = source.GetMTime()
    camera.SetClippingRange(0.1, 77)  # which is no other view
    camera.Modified()
    assert source.GetMTime() == stamp
    assert source.GetVDI() is second
    camera.Elevation(5)
    assert source.GetMTime() > stamp
    third = source.GetVDI()
    assert third.camera == pvdi.Camera.from_any(camera)
    assert source.GetVDI() is third
    assert len(counted) == 2
    camera.Azimuth(10)
    behind(source).Update()  # the pipeline itself follows
    assert source.GetCurrentVDI().camera == pvdi.Camera.from_any(camera)
    assert len(counted) == 3
    camera.Azimuth(10)
    source.TrackCameraOff()
    last = source.GetCamera()
    assert last == pvdi.Camera.from_any(camera), "as it is when it is no longer followed"
    camera.Azimuth(10)
    assert source.GetCamera() == source.GetVDI().camera == last
    assert source.GetTrackCamera() is False


def test_a_camera_on_its_way_through_nonsense():
    """Position, focal point and up are set one after the other, and may be no view in between."""
    camera = camera_at(5, 4, 3)
    source = ready_source(camera=camera)
    source.TrackCameraOn()
    first = source.GetVDI()
    camera.SetPosition(0, 0, 9)  # along view up
    with pytest.raises(errors.InvalidCameraError, match="is parallel"):
        source.GetVDI()
    assert source.GetCurrentVDI() is first
    camera.SetViewUp(0, 1, 0)
    assert source.GetVDI().camera.position == (0, 0, 9)


def test_following_keeps_nothing_alive(no_leaks):
    camera = camera_at(5, 4, 3)
    source = ready_source(camera=camera)
    source.TrackCameraOn()
    source.GetVDI()
    del source
    gc.collect()
    camera.Azimuth(10)  # the observer finds nobody
    del camera
    gc.collect()


@pytest.mark.parametrize(
    ("how", "when"), [("SetAbortExecuteAndUpdateTime", 0.0), ("AbortExecuteOn", 0.3)]
)
def test_an_abort_leaves_nothing_half_done_and_the_next_update_works(how, when):
    source = ready_source()
    before = source.GetVDI()
    source.SetMaxSupersegments(4)

    def stop(caller, _):
        if caller.GetProgress() >= when:
            getattr(caller, how)()

    tag = source.AddObserver("ProgressEvent", stop)
    downstream = behind(source)
    downstream.Update()  # from C++: nothing is raised, and nothing written
    assert downstream.GetOutput().GetNumberOfPoints() == 0
    assert source.GetCurrentVDI() is before
    assert downstream.GetAbortOutput()
    with pytest.raises(errors.Cancelled):
        source.Update()
    assert source.GetOutputDataObject(0).GetNumberOfPoints() == 0
    assert source.GetCurrentVDI() is before
    source.RemoveObserver(tag)
    downstream.Update()  # nothing was modified
    assert downstream.GetOutput().GetNumberOfPoints() == SIZE[0] * SIZE[1]
    assert source.GetVDI().counts.max() <= 4
