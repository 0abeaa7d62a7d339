"""VDISource among VTK's own algorithms: readers, filters, cameras that move, aborts.

All tests act on sources made by the same helpers: hence more than 500 lines.
"""

from __future__ import annotations

import gc
import inspect

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import LOOKS, soft_ball
from vtkmodules.vtkCommonCore import vtkObject
from vtkmodules.vtkCommonExecutionModel import vtkTrivialProducer
from vtkmodules.vtkFiltersCore import vtkCellDataToPointData, vtkContourFilter
from vtkmodules.vtkFiltersGeneral import vtkMultiBlockDataGroupFilter
from vtkmodules.vtkFiltersSources import vtkSphereSource
from vtkmodules.vtkImagingCore import (
    vtkExtractVOI,
    vtkImageCast,
    vtkImagePermute,
    vtkImageResample,
    vtkRTAnalyticSource,
)
from vtkmodules.vtkIOImage import vtkMetaImageReader, vtkMetaImageWriter, vtkNrrdReader
from vtkmodules.vtkIOXML import vtkXMLImageDataReader, vtkXMLImageDataWriter

import pyvista_vdi as pvdi
from pyvista_vdi.errors import (
    Cancelled,
    InvalidArgumentError,
    InvalidCameraError,
    InvalidVDIError,
    InvalidVolumeError,
    UnsupportedError,
)
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.vtk_pipeline.filters.convert import vdi_to_image

pytestmark = pytest.mark.gl

SIZE = (40, 30)


def red_property():
    prop = pv.VolumeProperty(
        lookup_table=pv.LookupTable("viridis", scalar_range=LOOKS["clim"]),
        interpolation_type="linear",
        opacity_unit_distance=LOOKS["opacity_unit_distance"],
    )
    prop.GetScalarOpacity().RemoveAllPoints()
    prop.GetScalarOpacity().AddPoint(0, 0)
    prop.GetScalarOpacity().AddPoint(255, 1)
    return prop


def camera_at(x, y, z):
    camera = pv.Camera()
    camera.position, camera.focal_point, camera.up = (x, y, z), (0, 0, 0), (0, 0, 1)
    return camera


def ready_source(producer=None, camera=None):
    """A source behind an algorithm, or of the soft ball."""
    source = pvdi.VDISource()
    if producer is None:
        source.SetInputDataObject(soft_ball(12))
    else:
        source.SetInputConnection(producer.GetOutputPort())
    source.SetVolumeProperty(red_property())
    source.SetCamera(camera_at(5, 4, 3) if camera is None else camera)
    source.SetWindowSize(*SIZE)
    return source


def executions(source):
    """Count how often it executes."""
    counted = []
    source.AddObserver("StartEvent", lambda *_: counted.append(1))
    return counted


# -- behind readers and filters --------------------------------------------------------------------


def file_of(image, path, writer):
    writer.SetInputData(image)
    writer.SetFileName(str(path))
    writer.Write()


def nrrd(folder, image):
    import nrrd as pynrrd

    header = {"space directions": np.diag(image.spacing), "space origin": image.origin}
    header["space dimension"] = 3
    array = image["v"].reshape(image.dimensions, order="F")
    pynrrd.write(str(folder / "a.nrrd"), array, header)
    reader = vtkNrrdReader()
    reader.SetFileName(str(folder / "a.nrrd"))
    return reader


def meta_image(folder, image):
    file_of(image, folder / "a.mha", vtkMetaImageWriter())
    reader = vtkMetaImageReader()
    reader.SetFileName(str(folder / "a.mha"))
    return reader


def vti(folder, image):
    file_of(image, folder / "a.vti", vtkXMLImageDataWriter())
    reader = vtkXMLImageDataReader()
    reader.SetFileName(str(folder / "a.vti"))
    return reader


def filtered(make):
    def behind(folder, image):
        algorithm = make()
        algorithm.SetInputData(image)
        return algorithm

    return behind


def extract():
    algorithm = vtkExtractVOI()
    algorithm.SetVOI(2, 9, 3, 11, 1, 8)  # its extent begins there, not at 0
    return algorithm


def extract_every_second():
    algorithm = extract()
    algorithm.SetSampleRate(2, 1, 2)
    return algorithm


def resample():
    algorithm = vtkImageResample()
    for axis, factor in enumerate((0.8, 1.7, 1.0)):
        algorithm.SetAxisMagnificationFactor(axis, factor)
    return algorithm


def cast():
    algorithm = vtkImageCast()
    algorithm.SetOutputScalarTypeToShort()
    return algorithm


def permute():
    algorithm = vtkImagePermute()
    algorithm.SetFilteredAxes(1, 2, 0)
    return algorithm


PRODUCERS = {
    "nrrd": nrrd,
    "meta image": meta_image,
    "vti": vti,
    "voi": filtered(extract),
    "voi, every second": filtered(extract_every_second),
    "resample": filtered(resample),
    "cast": filtered(cast),
    "permute": filtered(permute),
}


def some_image():
    """No two axes alike."""
    ball = soft_ball(12)
    image = pv.ImageData(dimensions=(12, 12, 10), spacing=(0.15, 0.2, 0.25), origin=(-1, -1.1, -1))
    image["v"] = ball["v"].reshape(12, 12, 12)[:10].astype(np.float32).ravel()
    return image


def by_hand(image):
    """The same points in an image whose extent begins at 0, from its own geometry."""
    extent = image.GetExtent()
    plain = pv.ImageData(
        dimensions=image.GetDimensions(),
        spacing=image.GetSpacing(),
        origin=[
            o + s * e
            for o, s, e in zip(image.GetOrigin(), image.GetSpacing(), extent[::2], strict=True)
        ],
    )
    plain["v"] = pv.wrap(image).point_data.active_scalars.copy()
    return plain


@pytest.mark.parametrize("kind", PRODUCERS)
def test_the_vdi_is_that_of_the_image_itself(kind, tmp_path):
    producer = PRODUCERS[kind](tmp_path, some_image())
    source = ready_source(producer)
    bounds = source.GetInputBounds()
    vdi = source.GetVDI()
    image = producer.GetOutput()
    if kind != "voi, every second":  # which announces another origin than it gives
        assert bounds == pytest.approx(image.GetBounds())
    assert source.GetInputBounds() == pytest.approx(image.GetBounds())
    expected = pvdi.generate(
        by_hand(image), camera_at(5, 4, 3), SIZE, volume_property=red_property()
    )
    assert vdi.n_supersegments > 500
    assert vdi.equals(expected)
    output = source.GetOutputDataObject(0)
    assert output.GetDimensions() == (*SIZE, 1)


def test_a_changed_filter_upstream_makes_another_and_nothing_else_does():
    voi = filtered(extract)(None, some_image())
    source = ready_source(voi)
    counted = executions(source)
    first = source.GetVDI()
    assert source.GetVDI() is first
    assert len(counted) == 1
    voi.SetVOI(2, 9, 3, 11, 2, 8)
    second = source.GetVDI()
    assert not second.equals(first)
    assert len(counted) == 2


def test_only_a_part_is_asked_for_and_all_is_given():
    """A downstream filter that streams asks for a piece: lists cannot be cut out of field data."""
    source = ready_source()
    source.UpdateExtent((0, 9, 0, 9, 0, 0))
    assert source.GetOutputDataObject(0).GetDimensions() == (*SIZE, 1)


# -- what is no image ------------------------------------------------------------------------------


def multi_block():
    blocks = vtkMultiBlockDataGroupFilter()
    blocks.AddInputDataObject(soft_ball(6))
    blocks.AddInputDataObject(soft_ball(6))
    return blocks


@pytest.mark.parametrize(
    ("producer", "message"),
    [
        (multi_block(), "MultiBlockDataSet is not a uniform grid.*blocks one by one"),
        (vtkSphereSource(), "PolyData is not a uniform grid.*voxelise it"),
    ],
)
def test_a_producer_of_something_else_is_refused_by_name(producer, message):
    source = ready_source()
    before = source.GetVDI()
    with pytest.raises(UnsupportedError, match=message):
        source.SetInputConnection(producer.GetOutputPort())
    assert source.GetVDI() is before, "the input before stays"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (pv.MultiBlock([soft_ball(6)]), "MultiBlock.* is not a uniform grid.*blocks one by one"),
        (pv.PartitionedDataSet([soft_ball(6)]), "Partitioned.*is not a uniform grid.*one by one"),
        (pv.RectilinearGrid(*[np.arange(2.0)] * 3), "RectilinearGrid.*resample it"),
        (pv.Table({"a": np.ones(2)}), "Table is not a uniform grid"),
    ],
    ids=["blocks", "partitions", "rectilinear", "table"],
)
def test_what_only_an_update_can_tell_is_refused_by_name(data, message, expected_messages):
    producer = vtkTrivialProducer()  # it promises a vtkDataObject
    producer.SetOutput(data)
    source = ready_source()
    source.SetInputConnection(producer.GetOutputPort())
    assert source.GetInputBounds() is None
    for ask in (source.Update, source.GetVDI, source.GetVolume, source.MakeRequest):
        with pytest.raises(UnsupportedError, match=message):
            ask()
    downstream = vtkCellDataToPointData()
    downstream.SetInputConnection(source.GetOutputPort())
    source.Modified()
    downstream.Update()
    assert downstream.GetOutput().GetNumberOfPoints() == 0
    assert "is not a uniform grid" in expected_messages.GetOutput()
    assert expected_messages.GetOutput().count("VDISource") == 1, "not once for each block"
    source.SetInputDataObject(soft_ball(12))
    assert source.GetVDI().n_supersegments > 500


def test_a_mapper_says_what_it_needs_in_place_of_blocks():
    mapper, blocks = pvdi.VDIMapper(), multi_block()
    with pytest.raises(InvalidVDIError, match="MultiBlock.*is not a VDI"):
        mapper.SetInputConnection(blocks.GetOutputPort())


def test_a_mapper_keeps_what_it_is_connected_to(tmp_path):
    """A VTK port does not: a reader that only the mapper knows would be gone."""

    def connected():
        file_of(vdi_to_image(ready_source().GetVDI()), tmp_path / "v.vti", vtkXMLImageDataWriter())
        reader = vtkXMLImageDataReader()
        reader.SetFileName(str(tmp_path / "v.vti"))
        mapper = pvdi.VDIMapper()
        mapper.SetInputConnection(reader.GetOutputPort())
        return mapper

    mapper = connected()
    gc.collect()
    assert mapper.painter.input.stamp()[0] > 0
    assert mapper.GetVDI().n_supersegments > 500


def test_a_reader_without_its_file(tmp_path, expected_messages):
    source = ready_source()
    source.GetVDI()
    reader = vtkXMLImageDataReader()
    reader.SetFileName(str(tmp_path / "none.vti"))
    source.SetInputConnection(reader.GetOutputPort())
    for ask in (source.Update, source.GetVDI):
        with pytest.raises(InvalidVolumeError, match="VTK's output window says why"):
            ask()
    assert "none.vti" in expected_messages.GetOutput()


def test_no_input_at_all(expected_messages):
    source = pvdi.VDISource()
    source.SetVolumeProperty(red_property())
    with pytest.raises(InvalidVolumeError, match=r"has no input: call SetInputDataObject"):
        source.GetVDI()


# -- a camera that is followed ---------------------------------------------------------------------


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
    camera.Elevation(5)
    assert source.GetMTime() > stamp
    third = source.GetVDI()
    assert third.camera == pvdi.Camera.from_any(camera)
    assert source.GetVDI() is third
    assert len(counted) == 2
    camera.Azimuth(10)
    source.TrackCameraOff()
    last = source.GetCamera()
    assert last == pvdi.Camera.from_any(camera), "as it is when it is no longer followed"
    camera.Azimuth(10)
    assert source.GetCamera() == source.GetVDI().camera == last
    assert source.GetTrackCamera() is False


def test_a_followed_camera_that_only_gets_another_clipping_range_changes_nothing():
    camera = camera_at(5, 4, 3)
    source = ready_source(camera=camera)
    source.SetTrackCamera(True)
    first, stamp = source.GetVDI(), source.GetMTime()
    camera.SetClippingRange(0.1, 77)
    camera.Modified()
    camera.SetPosition(5, 4, 3)
    assert source.GetMTime() == stamp
    assert source.GetVDI() is first


def test_the_pipeline_itself_follows():
    camera = camera_at(5, 4, 3)
    source = ready_source(camera=camera)
    source.TrackCameraOn()
    downstream = vtkCellDataToPointData()
    downstream.SetInputConnection(source.GetOutputPort())
    downstream.Update()
    first = source.GetCurrentVDI()
    downstream.Update()
    assert source.GetCurrentVDI() is first
    camera.Azimuth(20)
    downstream.Update()
    assert source.GetCurrentVDI().camera == pvdi.Camera.from_any(camera)


def test_a_camera_on_its_way_through_nonsense():
    """Position, focal point and up are set one after the other, and may be no view in between."""
    camera = camera_at(5, 4, 3)
    source = ready_source(camera=camera)
    source.TrackCameraOn()
    first = source.GetVDI()
    camera.SetPosition(0, 0, 9)  # along view up
    with pytest.raises(InvalidCameraError, match="is parallel"):
        source.GetVDI()
    assert source.GetCurrentVDI() is first
    camera.SetViewUp(0, 1, 0)
    assert source.GetVDI().camera.position == (0, 0, 9)


def test_another_camera_is_followed_then_and_a_view_of_ours_is_not():
    old, new = camera_at(5, 4, 3), camera_at(3, 4, 5)
    source = ready_source(camera=old)
    source.TrackCameraOn()
    source.SetCamera(new)
    source.GetVDI()
    stamp = source.GetMTime()
    old.Azimuth(10)
    assert source.GetMTime() == stamp
    new.Azimuth(10)
    assert source.GetVDI().camera == pvdi.Camera.from_any(new)
    fixed = pvdi.Camera((4, 4, 4), (0, 0, 0), (0, 0, 1))
    source.SetCamera(fixed)
    stamp = source.GetMTime()
    new.Azimuth(10)
    assert source.GetMTime() == stamp
    assert source.GetVDI().camera == fixed


def test_a_followed_camera_in_a_scene():
    """Off-screen a frame waits for the VDI of its own view."""
    plotter = pv.Plotter(window_size=(60, 50), off_screen=True)
    actor = plotter.add_vdi(soft_ball(12), show_scalar_bar=False)
    actor.mapper.GetSource().TrackCameraOn()
    plotter.show(auto_close=False)
    for _ in range(2):
        plotter.camera.Azimuth(15)
        plotter.render()
        shown = actor.mapper.GetSource().GetCamera()
        assert shown.position == pytest.approx(plotter.camera.position)
        assert actor.vdi is actor.mapper.GetSource().GetVDI()
    plotter.close()


def test_following_keeps_nothing_alive(no_leaks):
    camera = camera_at(5, 4, 3)
    source = ready_source(camera=camera)
    source.TrackCameraOn()
    source.GetVDI()
    del source
    gc.collect()
    camera.Azimuth(10)  # the observer finds nobody
    assert isinstance(camera, vtkObject)
    del camera
    gc.collect()


# -- aborts ----------------------------------------------------------------------------------------


def counting(downstream):
    return downstream.GetOutput().GetNumberOfPoints()


def behind(source):
    downstream = vtkCellDataToPointData()
    downstream.SetInputConnection(source.GetOutputPort())
    return downstream


@pytest.mark.parametrize("how", ["SetAbortExecuteAndUpdateTime", "AbortExecuteOn"])
@pytest.mark.parametrize("when", [0.0, 0.3, 1.0])
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
    assert counting(downstream) == 0
    assert source.GetCurrentVDI() is before
    assert downstream.GetAbortOutput()
    with pytest.raises(Cancelled):
        source.Update()
    assert source.GetOutputDataObject(0).GetNumberOfPoints() == 0
    assert source.GetCurrentVDI() is before
    source.RemoveObserver(tag)
    downstream.Update()
    assert counting(downstream) == SIZE[0] * SIZE[1]
    assert source.GetVDI().counts.max() <= 4


def test_an_aborted_update_from_c_is_made_up_for_by_the_next():
    source = ready_source()
    tag = source.AddObserver("ProgressEvent", lambda caller, _: caller.AbortExecuteOn())
    downstream = behind(source)
    downstream.Update()
    assert counting(downstream) == 0
    source.RemoveObserver(tag)
    downstream.Update()  # nothing was modified
    assert counting(downstream) == SIZE[0] * SIZE[1]


def test_an_abort_before_the_update_is_of_that_update():
    source = ready_source()
    source.SetAbortExecuteAndUpdateTime()
    with pytest.raises(Cancelled, match="before it began"):
        source.Update()
    assert source.GetVDI().n_supersegments > 500


def test_an_abort_upstream_is_passed_on():
    upstream = vtkRTAnalyticSource()
    upstream.SetWholeExtent(-5, 5, -5, 5, -5, 5)
    source = ready_source(upstream)
    upstream.SetAbortExecuteAndUpdateTime()
    downstream = vtkContourFilter()
    downstream.SetInputConnection(source.GetOutputPort())
    downstream.Update()
    assert downstream.GetAbortOutput()
    assert source.GetAbortOutput()
    assert source.GetCurrentVDI() is None
    upstream.SetAbortExecute(0)
    assert source.GetVDI().bounds == (-5, 5, -5, 5, -5, 5)


def test_a_callback_that_returns_false_stops_the_work():
    source = ready_source()
    source.SetProgressCallback(lambda fraction: False)
    with pytest.raises(Cancelled):
        source.Update()
    source.SetProgressCallback(None)
    assert source.GetVDI().n_supersegments > 500


# -- properties ------------------------------------------------------------------------------------


def test_setting_what_is_set_already_modifies_nothing():
    source = ready_source()
    renderer = pv.Plotter(off_screen=True).renderer
    source.SetLights(renderer)
    source.SetMetadata({"a": 1})
    stamp = source.GetMTime()
    source.SetLights(renderer)
    source.SetMetadata({"a": 1})
    source.SetMaxSupersegments(20)
    source.SetSampleDistance(None)
    source.SetTolerance(0.0)
    source.SetViewCone(60.0)
    source.SetCoverage("view")
    source.SetWindowSize(SIZE)
    source.SetCamera(camera_at(5, 4, 3))
    source.SetVolumeProperty(source.GetVolumeProperty())
    source.SetScalars(None)
    source.SetTrackCamera(False)
    assert source.GetMTime() == stamp
    source.GetVolumeProperty().GetScalarOpacity().AddPoint(50, 0.5)
    assert source.GetMTime() > stamp
    renderer.GetRenderWindow()
    pv.close_all()


def test_metadata_that_are_added_later_are_in_the_vdi():
    source = ready_source()
    assert "patient" not in source.GetVDI().metadata
    source.SetMetadata({"patient": "knee"})
    assert source.GetVDI().metadata["patient"] == "knee"


def test_progress_begins_rises_and_ends():
    source = ready_source()
    fractions, callbacks = [], []
    source.AddObserver("ProgressEvent", lambda caller, _: fractions.append(caller.GetProgress()))
    source.SetProgressCallback(callbacks.append)
    source.Update()
    assert fractions == sorted(fractions)
    assert callbacks == sorted(callbacks)
    assert fractions[-1] == callbacks[-1] == 1.0
    assert len(set(fractions)) >= 2


def test_options_are_set_one_by_one_or_all_at_once():
    source = ready_source()
    before = source.GetMTime()
    source.SetOptions(GenerationOptions(tolerance=0.25, memory_limit="1 GiB"))
    assert source.GetMTime() > before
    assert (source.GetTolerance(), source.GetMemoryLimit()) == (0.25, 2**30)
    source.SetViewCone(degrees=30)
    assert source.GetOptions() == GenerationOptions(
        tolerance=0.25, memory_limit=2**30, view_cone=30
    )
    before = source.GetMTime()
    source.SetViewCone(30.0)
    assert source.GetMTime() == before
    with pytest.raises(TypeError, match="sample_distance must be a positive length.*got 'far'"):
        source.SetSampleDistance("far")
    for wrong in (lambda: source.SetViewCone(91), lambda: source.SetSampleDistance(0.0)):
        with pytest.raises(InvalidArgumentError, match=r"got (91|0\.0)"):
            wrong()


def test_methods_from_a_table_say_what_they_do():
    for method, name, arguments, doc in (
        (pvdi.VDISource.SetViewCone, "SetViewCone", ["self", "degrees"], "Set the half angle"),
        (pvdi.VDISource.GetCoverage, "GetCoverage", ["self"], "Return what the VDI's window"),
        (pvdi.VDIMapper.SetRegenerateBelow, "SetRegenerateBelow", ["self", "ssim"], "Set the est"),
    ):
        assert method.__name__ == name
        assert list(inspect.signature(method).parameters) == arguments
        assert method.__doc__.startswith(doc)


def test_a_source_holds_properties_and_cameras_in_vtk_alone():
    """VTK before 9.7 frees memory twice where a gone source's attributes are the last to."""
    prop, camera = red_property(), camera_at(5, 4, 3)
    source = ready_source(camera=camera)
    source.SetVolumeProperty(prop)
    source.TrackCameraOn()
    held = vars(source), vars(source._given), *source._observed
    for thing in (prop, camera, prop.GetScalarOpacity()):
        assert not any(by is each for by in gc.get_referrers(thing) for each in held)
    address = prop.GetAddressAsString("")
    del prop, camera, thing
    gc.collect()
    assert isinstance(source.GetVolumeProperty(), pv.VolumeProperty)
    assert source.GetVolumeProperty().GetAddressAsString("") == address
    assert source.GetVDI() is not None
