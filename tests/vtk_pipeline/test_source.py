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
        ("AmbientOcclusion", False),
        ("Lights", other),
        ("Metadata", {"a": 1}),
        ("SampleDistance", None),
        ("Tolerance", 0.0),
        ("ViewCone", 60.0),
        ("Coverage", "view"),
        ("WindowSize", SIZE),
        ("VolumeProperty", prop),
        ("Scalars", None),
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
        lambda: source.SetAmbientOcclusion(True),
        lambda: source.SetAmbientOcclusion(pvdi.AmbientOcclusion(0.3, strength=0.5)),
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
        ("InputDataObject", "has no input"),
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


@pytest.mark.parametrize("when", [0.0, 0.3])
def test_an_abort_leaves_nothing_half_done_and_the_next_update_works(when):
    source = ready_source()
    before = source.GetVDI()
    source.SetMaxSupersegments(4)

    def stop(caller, _):
        if caller.GetProgress() >= when:
            caller.AbortExecuteOn()

    tag = source.AddObserver("ProgressEvent", stop)
    downstream = behind(source)
    downstream.Update()  # from C++: nothing is raised, and nothing written
    assert downstream.GetOutput().GetNumberOfPoints() == 0
    assert source.last is before
    with pytest.raises(errors.Cancelled):
        source.Update()
    assert source.GetOutputDataObject(0).GetNumberOfPoints() == 0
    assert source.last is before
    source.RemoveObserver(tag)
    downstream.Update()  # nothing was modified
    assert downstream.GetOutput().GetNumberOfPoints() == SIZE[0] * SIZE[1]
    assert source.GetVDI().counts.max() <= 4
