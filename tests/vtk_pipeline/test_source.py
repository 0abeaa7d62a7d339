"""VDISource among VTK's own algorithms: readers, filters, cameras that move, aborts."""

from __future__ import annotations

import gc
import inspect
from types import FunctionType, ModuleType

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import soft_ball
from settings import with_settings
from vtk_builds import vtk_or_skip
from vtk_sources import SIZE, behind, camera_at, executions, ready_source, some_property

import pyvista_vdi as pvdi
from pyvista_vdi import errors
from pyvista_vdi.model.options import GenerationOptions
from pyvista_vdi.vtk_pipeline.filters.convert import vdi_from_image, vdi_to_image
from pyvista_vdi.vtk_pipeline.vtk import (
    vtkExtractVOI,
    vtkImageCast,
    vtkImagePermute,
    vtkImageResample,
    vtkImageShiftScale,
    vtkMetaImageReader,
    vtkMultiBlockDataGroupFilter,
    vtkNrrdReader,
    vtkTrivialProducer,
    vtkXMLImageDataReader,
    vtkXMLImageDataWriter,
)

pytestmark = pytest.mark.gl


def test_it_makes_what_generate_makes():
    settings = {
        "max_supersegments": 7,
        "criterion": "homogeneity",
        "sample_distance": 0.05,
        "tolerance": 0.01,
        "view_cone": 20.0,
        "memory_limit": 2**30,
    }
    names = {name: name.title().replace("_", "") for name in settings}
    source = ready_source(**{names[name]: value for name, value in settings.items()})
    source.SetMemoryLimit("1 GiB")
    expected = pvdi.generate(
        soft_ball(12),
        camera_at(5, 4, 3),
        SIZE,
        volume_property=some_property(),
        **with_settings(**settings),
    )
    assert source.GetVDI().equals(expected)
    assert vdi_from_image(source.GetOutputDataObject(0)).equals(expected)
    assert source.GetOutputDataObject(0).GetDimensions() == (*SIZE, 1)
    assert {name: getattr(source, f"Get{names[name]}")() for name in names} == settings
    assert source.GetWindowSize() == SIZE
    source.SetMetadata({"patient": "knee"})
    assert source.GetVDI().metadata["patient"] == "knee"


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


def test_options_are_set_one_by_one_or_all_at_once():
    source = ready_source()
    before = source.GetMTime()
    source.SetOptions(GenerationOptions(tolerance=0.25, memory_limit="1 GiB"))
    assert source.GetMTime() > before
    assert (source.GetTolerance(), source.GetMemoryLimit()) == (0.25, 2**30)
    source.SetViewCone(30)
    assert source.GetOptions() == GenerationOptions(
        tolerance=0.25, memory_limit=2**30, view_cone=30
    )


@pytest.mark.parametrize(
    ("method", "value", "error", "message"),
    [
        ("SetWindowSize", (0, 5), errors.InvalidArgumentError, "between 1 and .*got 0 x 5"),
        ("SetMaxSupersegments", (5000,), errors.InvalidArgumentError, "1 to 4096; got 5000"),
        ("SetViewCone", (91,), errors.InvalidArgumentError, "got 91"),
        ("SetSampleDistance", (0.0,), errors.InvalidArgumentError, r"got 0\.0"),
        ("SetSampleDistance", ("far",), TypeError, "must be a positive length.*got 'far'"),
        ("SetCamera", ("front",), errors.InvalidCameraError, "vtkCamera.*got str"),
        ("SetCamera", (camera_at(0, 0, 9),), errors.InvalidCameraError, "view_up .* is parallel"),
        ("SetScalars", ("v", "edge"), errors.InvalidArgumentError, "'point' or 'cell'"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_settings_are_checked_when_they_are_set(method, value, error, message):
    source = ready_source()
    with pytest.raises(error, match=message):
        getattr(source, method)(*value)
    source.Update()  # as before


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


@pytest.mark.parametrize("error", [KeyboardInterrupt(), KeyError("x")])
def test_what_is_no_error_of_this_package_is_said_by_its_kind(
    error, expected_messages, monkeypatch
):
    def fail(*_):
        raise error

    source = ready_source()
    monkeypatch.setattr(source, "_execute", fail)
    behind(source).Update()  # from C++: nothing can be raised
    assert f"VDISource: {type(error).__name__}" in expected_messages.GetOutput()


def file_of(image, path, writer):
    writer.SetInputData(image)
    writer.SetFileName(str(path))
    writer.Write()


def read_from(path, reader):
    reader.SetFileName(str(path))
    return reader


def nrrd(folder, image):
    import nrrd as pynrrd

    header = {"space directions": np.diag(image.spacing), "space origin": image.origin}
    header["space dimension"] = 3
    array = image["v"].reshape(image.dimensions, order="F")
    pynrrd.write(str(folder / "a.nrrd"), array, header)
    return read_from(folder / "a.nrrd", vtkNrrdReader())


def meta_image(folder, image):
    file_of(image, folder / "a.mha", vtk_or_skip("vtkMetaImageWriter")())
    return read_from(folder / "a.mha", vtkMetaImageReader())


def vti(folder, image):
    file_of(image, folder / "a.vti", vtkXMLImageDataWriter())
    return read_from(folder / "a.vti", vtkXMLImageDataReader())


def filtered(kind, **settings):
    def make(_folder, image):
        algorithm = kind()
        algorithm.SetInputData(image)
        for name, value in settings.items():
            getattr(algorithm, f"Set{name}")(*value)
        return algorithm

    return make


def resample(folder, image):
    algorithm = filtered(vtkImageResample)(folder, image)
    for axis, factor in enumerate((0.8, 1.7, 1.0)):
        algorithm.SetAxisMagnificationFactor(axis, factor)
    return algorithm


#: Its extent begins there, not at 0.
VOI = (2, 9, 3, 11, 1, 8)
PRODUCERS = {
    "nrrd": nrrd,
    "meta image": meta_image,
    "vti": vti,
    "voi": filtered(vtkExtractVOI, VOI=VOI),
    "voi, every second": filtered(vtkExtractVOI, VOI=VOI, SampleRate=(2, 1, 2)),
    "resample": resample,
    "cast": filtered(vtkImageCast, OutputScalarTypeToShort=()),
    "permute": filtered(vtkImagePermute, FilteredAxes=(1, 2, 0)),
}


def some_image():
    """No two axes alike."""
    ball = soft_ball(12)
    image = pv.ImageData(dimensions=(12, 12, 10), spacing=(0.15, 0.2, 0.25), origin=(-1, -1.1, -1))
    image["v"] = ball["v"].reshape(12, 12, 12)[:10].astype(np.float32).ravel()
    return image


def by_hand(image):
    """The same points in an image whose extent begins at 0, from its own geometry."""
    first = np.multiply(image.GetSpacing(), image.GetExtent()[::2])
    plain = pv.ImageData(
        dimensions=image.GetDimensions(),
        spacing=image.GetSpacing(),
        origin=np.add(image.GetOrigin(), first),
    )
    plain["v"] = pv.wrap(image).point_data.active_scalars.copy()
    return plain


@pytest.mark.parametrize("kind", PRODUCERS)
def test_the_vdi_is_that_of_the_image_itself(kind, tmp_path):
    producer = PRODUCERS[kind](tmp_path, some_image())
    source = ready_source(producer)
    mapper = pvdi.VDIMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    bounds = mapper.GetBounds()
    vdi = source.GetVDI()
    image = producer.GetOutput()
    assert bounds == pytest.approx(image.GetBounds())
    expected = pvdi.generate(
        by_hand(image), camera_at(5, 4, 3), SIZE, volume_property=some_property()
    )
    assert vdi.n_supersegments > 500
    assert vdi.equals(expected)
    assert source.GetOutputDataObject(0).GetDimensions() == (*SIZE, 1)


def test_a_change_upstream_makes_another_and_nothing_else_does():
    upstream = vtkImageShiftScale()
    upstream.SetInputData(soft_ball(12))
    upstream.SetScale(0.5)
    source = ready_source(upstream)
    counted = executions(source)
    first = source.GetVDI()
    assert source.GetVDI() is first
    assert len(counted) == 1
    downstream = behind(source)
    downstream.Update()
    assert downstream.GetOutput().GetPointData().GetArray("count").GetNumberOfTuples() == 1200
    upstream.SetScale(1.0)
    assert source.GetVDI().optical_depth.sum() > first.optical_depth.sum()
    assert len(counted) == 2
    # What streams asks for a piece: lists cannot be cut out of field data
    source.UpdateExtent((0, 9, 0, 9, 0, 0))
    assert source.GetOutputDataObject(0).GetDimensions() == (*SIZE, 1)


def multi_block():
    blocks = vtkMultiBlockDataGroupFilter()
    blocks.AddInputDataObject(soft_ball(6))
    blocks.AddInputDataObject(soft_ball(6))
    return blocks


def test_a_mapper_refuses_a_producer_of_something_else_by_name():
    producer = multi_block()
    with pytest.raises(errors.InvalidVDIError, match="MultiBlock.*is not a VDI"):
        pvdi.VDIMapper().SetInputConnection(producer.GetOutputPort())


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (
            pv.MultiBlock([soft_ball(6)]),
            "MultiBlock.* is not a uniform grid.*one by one",
        ),
        (pv.PartitionedDataSet([soft_ball(6)]), "Partitioned.*is not a uniform grid.*one by one"),
        (pv.RectilinearGrid(*[np.arange(2.0)] * 3), "RectilinearGrid.*resample a grid"),
        (pv.Table({"a": np.ones(2)}), "Table is not a uniform grid"),
    ],
    ids=["blocks", "partitions", "rectilinear", "table"],
)
def test_what_only_an_update_can_tell_is_refused_by_name(data, message, expected_messages):
    producer = vtkTrivialProducer()  # it promises a vtkDataObject
    producer.SetOutput(data)
    source = ready_source(producer)
    for ask in (source.Update, source.GetVDI, source.GetVolume, source.MakeRequest):
        with pytest.raises(errors.UnsupportedError, match=message):
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


def test_a_copy_of_the_camera_is_kept():
    camera = camera_at(5, 4, 3)
    source = ready_source(camera=camera)
    first, stamp = source.GetVDI(), source.GetMTime()
    camera.Azimuth(10)
    assert source.GetVDI() is first
    assert source.GetMTime() == stamp


def test_progress_begins_rises_and_ends_and_a_callback_stops_the_work():
    source = ready_source()
    fractions, callbacks = [], []
    source.AddObserver("ProgressEvent", lambda caller, _: fractions.append(caller.GetProgress()))
    source.SetProgressCallback(callbacks.append)
    source.Update()
    for seen in (fractions, callbacks):
        assert seen == sorted(seen)
        assert seen[-1] == 1.0
    assert len(set(fractions)) >= 2
    before = source.GetVDI()
    source.SetMaxSupersegments(4)
    source.SetProgressCallback(lambda fraction: False)
    with pytest.raises(errors.Cancelled):
        source.Update()
    assert source.GetCurrentVDI() is before
    source.SetProgressCallback(None)
    assert source.GetVDI().counts.max() <= 4


@pytest.mark.parametrize("when", [0.0, 0.3, 1.0])
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
    assert source.GetCurrentVDI() is before
    with pytest.raises(errors.Cancelled):
        source.Update()
    assert source.GetOutputDataObject(0).GetNumberOfPoints() == 0
    assert source.GetCurrentVDI() is before
    source.RemoveObserver(tag)
    downstream.Update()  # nothing was modified
    assert downstream.GetOutput().GetNumberOfPoints() == SIZE[0] * SIZE[1]
    assert source.GetVDI().counts.max() <= 4


def test_methods_from_a_table_say_what_they_do():
    for method, name, arguments, doc in (
        (pvdi.VDISource.SetViewCone, "SetViewCone", ["self", "value"], "Set `view_cone`"),
        (pvdi.VDISource.GetCoverage, "GetCoverage", ["self"], "Return what the VDI covers"),
        (pvdi.VDIMapper.SetRegenerateBelow, "SetRegenerateBelow", ["self", "value"], "Set the est"),
    ):
        assert method.__name__ == name
        assert list(inspect.signature(method).parameters) == arguments
        assert method.__doc__.startswith(doc)


def test_a_source_holds_properties_in_vtk_alone():
    """VTK before 9.7 frees memory twice where a gone source's attributes are the last to."""
    prop, camera = some_property(), camera_at(5, 4, 3)
    source = ready_source(camera=camera)
    source.SetVolumeProperty(prop)
    reached, found = [vars(source)], set()
    while reached:
        each = reached.pop()
        if id(each) not in found and not isinstance(each, type | ModuleType | FunctionType):
            found.add(id(each))
            reached += gc.get_referents(each)
    assert not found & {id(prop), id(camera), id(prop.GetScalarOpacity())}
    address = prop.GetAddressAsString("")
    del prop, camera
    gc.collect()
    assert isinstance(source.GetVolumeProperty(), pv.VolumeProperty)
    assert source.GetVolumeProperty().GetAddressAsString("") == address
    assert source.GetVDI() is not None
