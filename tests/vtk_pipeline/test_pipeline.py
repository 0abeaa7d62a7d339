"""VDISource, VDIMapper and VDIActor in pure VTK: no PyVista in the scene."""

from __future__ import annotations

import gc
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from plugin_scenes import LOOKS, TOLERANCE, soft_ball, vdi_of_one_list
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPiecewiseFunction
from vtkmodules.vtkCommonExecutionModel import vtkTrivialProducer
from vtkmodules.vtkFiltersCore import vtkCellDataToPointData
from vtkmodules.vtkFiltersSources import vtkSphereSource
from vtkmodules.vtkImagingCore import vtkImageShiftScale
from vtkmodules.vtkIOXML import vtkXMLImageDataReader, vtkXMLImageDataWriter
from vtkmodules.vtkRenderingCore import (
    vtkActor,
    vtkCamera,
    vtkColorTransferFunction,
    vtkPolyDataMapper,
    vtkRenderer,
    vtkRenderWindow,
    vtkVolume,
    vtkVolumeProperty,
    vtkWindowToImageFilter,
)
from vtkmodules.vtkRenderingVolume import vtkGPUVolumeRayCastMapper

import pyvista_vdi as pvdi
from pyvista_vdi.errors import (
    Cancelled,
    InvalidArgumentError,
    InvalidCameraError,
    InvalidVDIError,
    UnsupportedError,
    VDIWarning,
)
from pyvista_vdi.vtk_pipeline.drawing.frame import as_array, view_of
from pyvista_vdi.vtk_pipeline.filters.convert import vdi_from_image, vdi_to_image
from pyvista_vdi.vtk_pipeline.interaction.estimation import Estimation

pytestmark = pytest.mark.gl


def red_property():
    prop = vtkVolumeProperty()
    opacity, color = vtkPiecewiseFunction(), vtkColorTransferFunction()
    opacity.AddPoint(0, 0)
    opacity.AddPoint(255, 1)
    color.AddRGBPoint(0, 1, 1, 0)
    color.AddRGBPoint(255, 1, 0, 0)
    prop.SetScalarOpacity(opacity)
    prop.SetColor(color)
    prop.SetScalarOpacityUnitDistance(LOOKS["opacity_unit_distance"])
    prop.SetInterpolationTypeToLinear()
    return prop


def camera_at(x, y, z):
    camera = vtkCamera()
    camera.SetPosition(x, y, z)
    camera.SetViewUp(0, 0, 1)
    return camera


def ready_source(**settings):
    source = pvdi.VDISource()
    source.SetInputDataObject(soft_ball(12))
    source.SetVolumeProperty(red_property())
    source.SetCamera(camera_at(5, 4, 3))
    source.SetWindowSize(40, 30)
    for name, value in settings.items():
        getattr(source, f"Set{name}")(value)
    return source


def window_with(*renderers, size=(240, 200)):
    window = vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.SetSize(*size)
    for renderer in renderers:
        window.AddRenderer(renderer)
    return window


def picture(window):
    window.Render()
    grab = vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    grab.Update()
    image = grab.GetOutput()
    width, height, _ = image.GetDimensions()
    values = vtk_to_numpy(image.GetPointData().GetScalars())
    return values.reshape(height, width, 3)[::-1].astype(int)


def executions(source):
    """Count how often it executes."""
    counted = []
    source.AddObserver("StartEvent", lambda *_: counted.append(1))
    return counted


# -- the source ------------------------------------------------------------------------------------


def test_source_makes_what_generate_makes():
    source = ready_source(
        MaxSupersegments=7,
        Criterion="length",
        SampleDistance=0.05,
        Tolerance=0.01,
        ViewCone=20.0,
        MemoryLimit="1 GiB",
    )
    expected = pvdi.generate(
        soft_ball(12),
        camera_at(5, 4, 3),
        (40, 30),
        volume_property=red_property(),
        max_supersegments=7,
        criterion="length",
        sample_distance=0.05,
        tolerance=0.01,
        view_cone=20.0,
    )
    assert source.GetVDI().equals(expected)
    assert vdi_from_image(source.GetOutputDataObject(0)).equals(expected)
    assert source.GetOutputDataObject(0).GetDimensions() == (40, 30, 1)
    assert source.GetMaxSupersegments() == 7
    assert source.GetCriterion() == "length"
    assert source.GetSampleDistance() == 0.05
    assert source.GetTolerance() == 0.01
    assert source.GetViewCone() == 20.0
    assert source.GetMemoryLimit() == 2**30
    assert source.GetWindowSize() == (40, 30)


def test_occlusion_is_part_of_what_a_view_is_judged_by():
    """The estimate that decides about another VDI renders the occluded volume as well."""
    source = ready_source(AmbientOcclusion=pvdi.AmbientOcclusion(0.5, strength=1.0))
    assert source.GetAmbientOcclusion() == pvdi.AmbientOcclusion(0.5, strength=1.0)
    vdi, request = source.GetVDI(), source.GetCurrentRequest()
    assert vdi.metadata["ambient_occlusion"]["radius"] == 0.5
    estimation = Estimation()
    estimation.start(vdi, request, request.screen)
    estimation._worker.join()
    judged = estimation.take()
    assert judged.error.ssim > 0.9999
    estimation.close()
    source.SetAmbientOcclusion(None)
    plain = source.GetVDI()
    assert "ambient_occlusion" not in plain.metadata
    assert vdi.color.mean() < 0.8 * plain.color.mean()


def test_source_executes_only_when_something_changed():
    source = ready_source()
    counted = executions(source)
    prop, volume = source.GetVolumeProperty(), source.GetInputDataObject(0, 0)
    changes = [
        lambda: None,
        lambda: source.Update(),
        lambda: source.SetCamera(camera_at(5, 4, 3)),  # equal
        lambda: source.SetMaxSupersegments(20),  # equal
        lambda: source.SetAmbientOcclusion(False),  # equal
    ]
    source.Update()
    for change in changes:
        change()
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


def test_source_reads_through_a_pipeline_and_is_read_by_one():
    upstream = vtkImageShiftScale()
    upstream.SetInputData(soft_ball(12))
    upstream.SetScale(0.5)
    source = ready_source()
    source.SetInputConnection(upstream.GetOutputPort())
    # bounds are known before anything has executed
    assert source.GetInputBounds() == pytest.approx(soft_ball(12).GetBounds())
    downstream = vtkCellDataToPointData()
    downstream.SetInputConnection(source.GetOutputPort())
    downstream.Update()
    assert downstream.GetOutput().GetPointData().GetArray("count").GetNumberOfTuples() == 1200
    before = source.GetVDI()
    upstream.SetScale(1.0)
    assert source.GetVDI().optical_depth.sum() > before.optical_depth.sum()


def test_vti_file_between_two_pipelines(tmp_path):
    source = ready_source()
    writer = vtkXMLImageDataWriter()
    writer.SetInputConnection(source.GetOutputPort())
    writer.SetFileName(str(tmp_path / "vdi.vti"))
    writer.Write()
    reader = vtkXMLImageDataReader()
    reader.SetFileName(str(tmp_path / "vdi.vti"))
    mapper = pvdi.VDIMapper()
    mapper.SetInputConnection(reader.GetOutputPort())
    assert mapper.GetVDI().equals(source.GetVDI())
    assert mapper.GetBounds() == pytest.approx(soft_ball(12).GetBounds())


def test_progress_events_and_abort():
    source = ready_source()
    fractions = []
    source.AddObserver("ProgressEvent", lambda caller, _: fractions.append(caller.GetProgress()))
    source.Update()
    assert fractions[-1] == 1.0
    assert fractions == sorted(fractions)
    before = source.GetVDI()
    source.SetMaxSupersegments(4)
    tag = source.AddObserver("ProgressEvent", lambda caller, _: caller.SetAbortExecute(1))
    with pytest.raises(Cancelled):
        source.Update()
    assert source.GetCurrentVDI() is before
    source.RemoveObserver(tag)
    assert source.GetVDI().counts.max() <= 4


@pytest.mark.parametrize(
    ("setting", "value", "error", "message"),
    [
        ("Camera", None, InvalidArgumentError, r"has no camera \(SetCamera\)"),
        ("WindowSize", None, InvalidArgumentError, r"no window size \(SetWindowSize\)"),
        ("VolumeProperty", None, InvalidArgumentError, r"no volume property"),
    ],
)
def test_source_names_what_is_missing(setting, value, error, message):
    source = ready_source(**{setting: value})
    with pytest.raises(error, match=message):
        source.Update()


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda s: s.SetWindowSize(0, 5), InvalidArgumentError, "between 1 and .*got 0 x 5"),
        (lambda s: s.SetMaxSupersegments(5000), InvalidArgumentError, "1 to 4096; got 5000"),
        (lambda s: s.SetCamera("front"), InvalidCameraError, "vtkCamera.*got str"),
        (lambda s: s.SetCamera(camera_at(0, 0, 9)), InvalidCameraError, "view_up .* is parallel"),
        (lambda s: s.SetInputDataObject(vtkSphereSource()), UnsupportedError, "not a uniform grid"),
        (lambda s: s.SetScalars("v", "edge"), InvalidArgumentError, "'point' or 'cell'"),
    ],
    ids=["window", "budget", "camera", "eye", "input", "preference"],
)
def test_source_checks_settings_when_they_are_set(call, error, message):
    source = ready_source()
    with pytest.raises(error, match=message):
        call(source)
    source.Update()  # as before


def test_problem_in_an_update_from_c_goes_to_vtks_output_window(expected_messages):
    source = ready_source(Camera=None)
    downstream = vtkCellDataToPointData()
    downstream.SetInputConnection(source.GetOutputPort())
    downstream.Update()
    assert "VDISource has no camera" in expected_messages.GetOutput()


# -- mapper and actor ------------------------------------------------------------------------------


def opaque_sphere():
    sphere = vtkSphereSource()
    sphere.SetCenter(0.4, 0.2, 0.5)
    sphere.SetRadius(0.5)
    mapper = vtkPolyDataMapper()
    mapper.SetInputConnection(sphere.GetOutputPort())
    actor = vtkActor()
    actor.SetMapper(mapper)
    return actor


def our_actor(source=None):
    if source is None:
        source = pvdi.VDISource()
        source.SetInputDataObject(soft_ball())
        source.SetVolumeProperty(red_property())
        source.SetMaxSupersegments(64)
        source.SetSampleDistance(0.02)
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
    actor.SetProperty(red_property())
    return actor


def scene_of(volume):
    renderer = vtkRenderer()
    renderer.SetBackground(0.2, 0.3, 0.4)
    renderer.AddVolume(volume)
    renderer.AddActor(opaque_sphere())
    renderer.ResetCamera()
    return renderer


def test_pipeline_draws_as_vtks_volume():
    ours = picture(window_with(scene_of(our_actor())))
    judge = picture(window_with(scene_of(judging_actor())))
    assert np.ptp(judge.reshape(-1, 3), axis=0).max() > 100
    assert np.abs(ours - judge).max() <= TOLERANCE


def test_bounds_are_right_before_the_first_frame():
    renderer, actor = vtkRenderer(), our_actor()
    renderer.AddVolume(actor)
    assert renderer.ComputeVisiblePropBounds() == pytest.approx(soft_ball().GetBounds())
    moved = soft_ball()
    moved.origin = (3, 4, 5)
    actor.GetMapper().GetSource().SetInputDataObject(moved)
    assert renderer.ComputeVisiblePropBounds() == pytest.approx(moved.GetBounds())


def test_given_view_is_used_and_the_scenes_camera_is_not():
    source = ready_source()
    actor = our_actor(source)
    picture(window_with(scene_of(actor)))
    assert actor.vdi.camera.position == (5, 4, 3)
    assert actor.vdi.window_size == (40, 30)


def test_one_actor_in_two_windows_and_two_viewports():
    actor = our_actor()
    first = scene_of(actor)
    window = window_with(first)
    alone = picture(window)
    second = vtkRenderer()
    second.SetBackground(0.2, 0.3, 0.4)
    second.AddVolume(actor)
    second.AddActor(opaque_sphere())
    second.SetActiveCamera(first.GetActiveCamera())
    other = window_with(second)
    np.testing.assert_array_equal(picture(other), alone)
    np.testing.assert_array_equal(picture(window), alone)
    third = vtkRenderer()
    third.SetBackground(0.2, 0.3, 0.4)
    third.AddVolume(actor)
    third.AddActor(opaque_sphere())
    camera = vtkCamera()
    camera.DeepCopy(first.GetActiveCamera())
    camera.Azimuth(90)
    third.SetActiveCamera(camera)
    second.SetViewport(0, 0, 0.5, 1)
    third.SetViewport(0.5, 0, 1, 1)
    other.AddRenderer(third)
    other.SetSize(480, 200)
    halves = picture(other)
    np.testing.assert_array_equal(halves[:, :240], alone)
    assert np.abs(halves[:, 240:] - alone).max() > 40


def test_a_plain_volume_before_the_mapper_is_told_what_to_do():
    mapper = pvdi.VDIMapper()
    mapper.SetVDI(vdi_of_one_list())
    volume = vtkVolume()
    volume.SetMapper(mapper)
    window = window_with(scene_of(volume))
    with pytest.warns(VDIWarning, match="use VDIActor in place of vtkVolume"):
        window.Render()


def test_mapper_takes_vdis_and_their_images_and_no_volumes():
    vdi = vdi_of_one_list()
    mapper = pvdi.VDIMapper()
    for put in (mapper.SetVDI, mapper.SetInputData):
        put(vdi)
        assert mapper.GetVDI() is vdi
    mapper.SetInputDataObject(vdi_to_image(vdi))
    assert mapper.GetVDI().equals(vdi)
    assert mapper.GetBounds() == (-1, 1, -1, 1, -1, 1)
    with pytest.raises(InvalidVDIError, match="put a VDISource between a volume and the mapper"):
        mapper.SetInputData(soft_ball())
    producer = vtkTrivialProducer()
    producer.SetOutput(soft_ball())
    with pytest.raises(InvalidVDIError, match="is not a VDI.*VDISource"):
        mapper.SetInputConnection(producer.GetOutputPort())
    assert mapper.GetVDI().equals(vdi), "what was there stays"


def test_nothing_at_the_input_draws_nothing():
    actor = pvdi.VDIActor()
    actor.SetMapper(pvdi.VDIMapper())
    assert actor.vdi is None
    with_it = picture(window_with(scene_of(actor)))
    assert with_it.max() > 0


def test_no_leaks_in_pure_vtk(no_leaks):
    window = window_with(scene_of(our_actor()), scene_of(our_actor(ready_source())))
    picture(window)
    window.Finalize()
    del window
    gc.collect()


# -- the frame's view ------------------------------------------------------------------------------


@given(
    st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(2, 9)),
    st.floats(1, 120),
    st.tuples(st.floats(-2, 2), st.floats(-2, 2)),
    st.booleans(),
    st.floats(0.2, 4),
    st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-2, 2)),
)
def test_view_of_a_matrix_projects_as_the_matrix(position, angle, center, parallel, aspect, point):
    camera = vtkCamera()
    camera.SetPosition(*position)
    camera.SetFocalPoint(0.1, 0.2, -0.3)
    camera.SetViewUp(0.1, 1, 0.2)
    camera.SetViewAngle(angle)
    camera.SetWindowCenter(*center)
    camera.SetParallelProjection(parallel)
    camera.SetParallelScale(1.7)
    matrix = as_array(camera.GetCompositeProjectionTransformMatrix(aspect, -1, 1))
    eye, forward = np.array(camera.GetPosition()), np.array(camera.GetDirectionOfProjection())
    to_view, lens = view_of(matrix, aspect, eye=eye, forward=forward)
    # rigid: lengths of the optical model are taken from it
    np.testing.assert_allclose(to_view[:3, :3] @ to_view[:3, :3].T, np.eye(3), atol=1e-9)
    ours = pvdi.Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), **lens)
    size = (round(1000 * aspect), 1000)
    half = np.array(ours.half_extent(size)) * (aspect / (size[0] / size[1]), 1)
    x, y, z, _ = to_view @ (*point, 1.0)
    assume(parallel or -z > 0.01)  # in front of the eye
    depth = 1.0 if parallel else -z
    expected = matrix @ (*point, 1.0)
    ndc = np.array([x, y]) / (half * depth) - ours.window_center
    np.testing.assert_allclose(ndc, expected[:2] / expected[3], rtol=1e-6, atol=1e-6)
    assert -z == pytest.approx(forward @ (point - eye), abs=1e-9)


def test_importing_the_pipeline_does_not_import_pyvista():
    code = "import sys, pyvista_vdi as p; p.VDIActor; sys.exit('pyvista' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_converters_load_no_opengl():
    code = (
        "import sys, pyvista_vdi.vtk_pipeline.filters.convert; "
        "sys.exit(any('OpenGL' in name for name in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
