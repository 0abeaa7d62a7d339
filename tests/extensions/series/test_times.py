"""Series and volumes that change in time among VTK's algorithms: times announced and asked for."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from plugin_scenes import soft_ball
from strategies import random_vdi
from vtk_sources import ready_source, some_property

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError, UnsupportedError
from pyvista_vdi.vtk_pipeline import VDIReader, VDIToImage, vdi_from_image
from pyvista_vdi.vtk_pipeline.filters.inputs import SourceInput
from pyvista_vdi.vtk_pipeline.filters.temporal import steps_and_times
from pyvista_vdi.vtk_pipeline.vtk import (
    VTKPythonAlgorithmBase,
    vtkDataObject,
    vtkExtractVOI,
    vtkImageData,
    vtkMultiBlockDataGroupFilter,
    vtkRTAnalyticSource,
    vtkStreamingDemandDrivenPipeline,
)

TIMES = (0.5, 1.0, 4.0)
#: Times that are asked for, and the step that is nearest to each; of two, the earlier.
ASKED = ((0.5, 0), (3.0, 2), (2.5, 1), (-7.0, 0), (1e9, 2), (1.0, 1))


@pytest.fixture
def path(tmp_path):
    vdis = [random_vdi(np.random.default_rng(seed)) for seed in range(3)]
    assert len({vdi.window_size for vdi in vdis}) == 3
    return pvdi.VDISeries(vdis, TIMES).save(tmp_path / "a.vdis")


def reader_of(path):
    reader = VDIReader()
    reader.SetFileName(path)
    return reader


def announced(algorithm):
    """What an algorithm's output port says of times: the steps and the range."""
    algorithm.UpdateInformation()
    information, keys = algorithm.GetOutputInformation(0), vtkStreamingDemandDrivenPipeline
    if not information.Has(keys.TIME_STEPS()):
        assert not information.Has(keys.TIME_RANGE())
        return None
    return information.Get(keys.TIME_STEPS()), information.Get(keys.TIME_RANGE())


def time_of(image):
    information, key = image.GetInformation(), vtkDataObject.DATA_TIME_STEP()
    return information.Get(key) if information.Has(key) else None


def test_the_reader_gives_the_step_nearest_to_the_time_down_the_pipeline(path):
    """Each asks what is before it for its time: filters of VTK's, ours, and a mapper."""
    series, reader, mapper = pvdi.read(path), reader_of(path), pvdi.VDIMapper()
    voi, picture = vtkExtractVOI(), VDIToImage()
    for each in (voi, picture, mapper):
        each.SetInputConnection(reader.GetOutputPort())
    assert announced(reader) == announced(voi) == announced(picture) == (TIMES, (0.5, 4.0))
    reader.Update()
    assert vdi_from_image(reader.GetOutputDataObject(0)).equals(series[0])
    assert mapper.GetVDI().equals(series[0])
    for time, step in ASKED:
        reader.UpdateTimeStep(time)
        image = reader.GetOutputDataObject(0)
        assert vdi_from_image(image).equals(series[step])
        assert mapper.GetVDI().equals(series[step])
        picture.UpdateTimeStep(time)
        assert time_of(image) == time_of(picture.GetOutputDataObject(0)) == TIMES[step]
        assert picture.GetOutputDataObject(0).GetDimensions()[:2] == series[step].picture_size


SIZE = (24, 18)
CAMERA = pvdi.Camera((5, 4, 3), (0, 0, 0), (0, 0, 1), view_angle=25)


class Moving(VTKPythonAlgorithmBase):
    """A ball that moves and fades; ``read`` lists the steps that it has given."""

    def __init__(self, balls=None):
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkImageData")
        self.balls = [ball_at(step) for step in range(3)] if balls is None else balls
        self.read = []

    def RequestInformation(self, request, inputs, outputs):
        information, keys = outputs.GetInformationObject(0), vtkStreamingDemandDrivenPipeline
        information.Set(keys.WHOLE_EXTENT(), self.balls[0].GetExtent(), 6)
        information.Set(keys.TIME_STEPS(), TIMES, len(TIMES))
        information.Set(keys.TIME_RANGE(), (TIMES[0], TIMES[-1]), 2)
        return 1

    def RequestData(self, request, inputs, outputs):
        information = outputs.GetInformationObject(0)
        key = vtkStreamingDemandDrivenPipeline.UPDATE_TIME_STEP()
        wanted = information.Get(key) if information.Has(key) else 0.0
        step = int(np.argmin(np.abs(np.array(TIMES) - wanted)))
        self.read.append(step)
        image = vtkImageData.GetData(outputs, 0)
        image.ShallowCopy(self.balls[step])
        image.GetInformation().Set(vtkDataObject.DATA_TIME_STEP(), TIMES[step])
        return 1


def ball_at(step):
    ball = soft_ball(8)
    ball["v"] = ball["v"] * (1 - 0.3 * step)
    ball.origin = (-1 + 0.25 * step, -1, -1)
    return ball


def made_of(volume, camera=CAMERA, size=SIZE):
    return pvdi.generate(volume, camera, size, volume_property=some_property())


def source_of(producer):
    return ready_source(producer, CAMERA, WindowSize=SIZE)


@pytest.fixture(scope="module")
def vdis(default_runtime):
    """What generate makes of each step."""
    made = [made_of(ball_at(step)) for step in range(3)]
    assert made[0].n_supersegments > 200
    assert not made[0].equals(made[1])
    assert not made[1].equals(made[2])
    return made


def test_a_source_makes_a_vdi_of_the_time_that_is_asked_for(vdis):
    producer = Moving()
    source = source_of(producer)
    assert announced(source) == (TIMES, (0.5, 4.0))
    for time, step in ASKED:
        source.UpdateTimeStep(time)
        vdi = source.GetVDI()
        assert vdi.equals(vdis[step])
        assert time_of(source.GetOutputDataObject(0)) == TIMES[step]
        reads = len(producer.read)
        source.UpdateTimeStep(TIMES[step])
        # Of the same data none is made again; VTK 9.4 has the producer make them again
        assert source.GetVDI() is vdi or len(producer.read) > reads


def test_each_source_keeps_its_time_whatever_others_ask_for(vdis):
    producer = Moving()
    early, late = source_of(producer), source_of(producer)
    early.UpdateTimeStep(0.5)
    late.UpdateTimeStep(4.0)
    for source, step in ((early, 0), (late, 2), (early, 0)):
        assert source.GetVolume().origin == ball_at(step).origin
        assert source.MakeRequest().volume.origin == ball_at(step).origin
        assert SourceInput(source).vdi().equals(vdis[step])
    # Without a time of its own a source takes what there is
    third = source_of(producer)
    producer.UpdateTimeStep(1.0)
    assert third.GetVDI().equals(vdis[1])


@pytest.fixture
def drawn():
    """A producer, the source behind it, and the plotter and the actor that draw its VDI."""
    producer = Moving()
    source, mapper, actor = source_of(producer), pvdi.VDIMapper(), pvdi.VDIActor()
    mapper.SetInputConnection(source.GetOutputPort())
    mapper.SetDraw("vdi")
    actor.SetMapper(mapper)
    plotter = pv.Plotter(off_screen=True, window_size=SIZE)
    plotter.renderer.AddVolume(actor)
    return producer, source, plotter, actor


@pytest.mark.gl
def test_a_mapper_draws_the_time_that_is_asked_of_the_source_or_before_it(vdis, drawn):
    producer, source, plotter, actor = drawn
    plotter.show(auto_close=False)
    for asked in (producer, source):
        for time, step in ASKED[:3]:
            asked.UpdateTimeStep(time)
            plotter.render()
            assert actor.vdi.equals(vdis[step])


def test_a_series_of_a_source_with_times(vdis):
    """Each step is read when its turn comes."""
    producer = Moving()
    prop = some_property()
    series = pvdi.generate_series(producer, CAMERA, SIZE, volume_property=prop, precision="exact")
    assert producer.read == [0, 1, 2]
    assert series.times == TIMES
    for step in range(3):
        assert series[step].equals(vdis[step])
    assert producer.read == [0, 1, 2]


def test_what_cannot_be_a_series_is_refused():
    with pytest.raises(InvalidArgumentError, match="vtkRTAnalyticSource announces no time steps"):
        pvdi.generate_series(vtkRTAnalyticSource(), CAMERA, SIZE)
    two_blocks = Moving()
    blocks, times = steps_and_times(two_blocks)
    assert (len(blocks), times) == (3, TIMES)
    assert two_blocks.read == []
    group = vtkMultiBlockDataGroupFilter()
    group.AddInputConnection(two_blocks.GetOutputPort())
    group.AddInputConnection(two_blocks.GetOutputPort())
    with pytest.raises(UnsupportedError, match="MultiBlock"):
        pvdi.generate_series(group, CAMERA, SIZE)
