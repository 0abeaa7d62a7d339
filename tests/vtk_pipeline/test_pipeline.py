"""VDIMapper and VDIActor in windows of VTK's own, without a plotter."""

from __future__ import annotations

import gc
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from plugin_scenes import TOLERANCE, soft_ball, vdi_of_one_list
from vtk_sources import ready_source, some_property
from watched_windows import on_screen

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidVDIError, VDIWarning
from pyvista_vdi.vtk_pipeline import VDIReader
from pyvista_vdi.vtk_pipeline.drawing.frame import as_array, view_of
from pyvista_vdi.vtk_pipeline.filters.convert import vdi_to_image
from pyvista_vdi.vtk_pipeline.vtk import (
    BACKEND,
    vtkActor,
    vtkCamera,
    vtkGPUVolumeRayCastMapper,
    vtkPolyDataMapper,
    vtkRenderer,
    vtkRenderWindow,
    vtkSphereSource,
    vtkTrivialProducer,
    vtkVolume,
)

pytestmark = pytest.mark.gl


def window_with(*renderers, size=(120, 100)):
    window = vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.SetSize(*size)
    for renderer in renderers:
        window.AddRenderer(renderer)
    return window


def picture(window):
    for _ in range(2):  # the first frame in a second window may lack the actor
        window.Render()
    return on_screen(window)


def our_actor(source=None):
    if source is None:
        source = ready_source(
            InputDataObject=soft_ball(),
            Camera=None,
            WindowSize=None,
            MaxSupersegments=64,
            SampleDistance=0.02,
        )
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
    actor.SetProperty(some_property())
    return actor


def scene_of(volume, camera=None):
    """A volume and an opaque sphere, half inside the ball."""
    sphere, mapper, actor = vtkSphereSource(), vtkPolyDataMapper(), vtkActor()
    sphere.SetCenter(0.4, 0.2, 0.5)
    sphere.SetRadius(0.5)
    mapper.SetInputConnection(sphere.GetOutputPort())
    actor.SetMapper(mapper)
    renderer = vtkRenderer()
    renderer.SetBackground(0.2, 0.3, 0.4)
    renderer.AddVolume(volume)
    renderer.AddActor(actor)
    if camera is None:
        renderer.ResetCamera()
    else:
        renderer.SetActiveCamera(camera)
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


def test_bounds_are_those_of_the_file_that_a_reader_has_by_now(tmp_path):
    vdi_of_one_list().save(tmp_path / "other.vdi")
    reader, mapper, actor = VDIReader(), pvdi.VDIMapper(), pvdi.VDIActor()
    reader.SetFileName(str(tmp_path / "other.vdi"))
    mapper.SetInputConnection(reader.GetOutputPort())
    actor.SetMapper(mapper)
    assert actor.GetBounds() == vdi_of_one_list().bounds
    source = ready_source()
    source.SetInputDataObject(soft_ball(12).translate((5, 0, 0)))
    source.GetVDI().save(tmp_path / "moved.vdi")
    reader.SetFileName(str(tmp_path / "moved.vdi"))
    np.testing.assert_allclose(actor.GetBounds(), (4, 6, -1, 1, -1, 1), atol=1e-6)


def test_given_view_is_used_and_the_scenes_camera_is_not():
    actor = our_actor(ready_source())
    picture(window_with(scene_of(actor)))
    assert actor.vdi.camera.position == (5, 4, 3)
    assert actor.vdi.window_size == (40, 30)


def test_one_actor_in_two_windows_and_two_viewports():
    actor = our_actor()
    first = scene_of(actor)
    window = window_with(first)
    alone = picture(window)
    second = scene_of(actor, first.GetActiveCamera())
    other = window_with(second)
    np.testing.assert_array_equal(picture(other), alone)
    np.testing.assert_array_equal(picture(window), alone)
    camera = vtkCamera()
    camera.DeepCopy(first.GetActiveCamera())
    camera.Azimuth(90)
    third = scene_of(actor, camera)
    second.SetViewport(0, 0, 0.5, 1)
    third.SetViewport(0.5, 0, 1, 1)
    other.AddRenderer(third)
    other.SetSize(240, 100)
    halves = picture(other)
    np.testing.assert_array_equal(halves[:, :120], alone)
    assert np.abs(halves[:, 120:] - alone).max() > 40


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
    assert picture(window_with(scene_of(actor))).max() > 0


def test_no_leaks_in_pure_vtk(no_leaks):
    window = window_with(scene_of(our_actor()), scene_of(our_actor(ready_source())))
    picture(window)
    window.Finalize()
    del window
    gc.collect()


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
    backward = as_array(camera.GetModelViewTransformMatrix())[2]
    eye, forward = np.array(camera.GetPosition()), np.array(camera.GetDirectionOfProjection())
    to_view, lens = view_of(matrix, aspect, backward)
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


@pytest.mark.parametrize(
    ("imports", "loaded"),
    [
        ("import pyvista_vdi as p; p.VDIActor", "'pyvista' in sys.modules"),
        (
            "import pyvista_vdi.vtk_pipeline.filters.convert",
            "any('OpenGL' in name for name in sys.modules)",
        ),
    ],
    ids=["the pipeline without pyvista", "converters without OpenGL"],
)
def test_imports_load_no_more_than_they_need(imports, loaded):
    if "OpenGL" in loaded and BACKEND != "vtkmodules":
        pytest.skip(f"{BACKEND} loads its OpenGL modules with vtkRenderingCore")
    code = f"import sys; {imports}; sys.exit({loaded})"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
