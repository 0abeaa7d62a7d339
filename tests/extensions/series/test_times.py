"""Series and volumes that change in time among VTK's algorithms: times announced and asked for."""

from __future__ import annotations

import numpy as np
import pytest
from plugin_scenes import soft_ball
from strategies import random_vdi
from vtk_sources import ready_source, some_property

import pyvista_vdi as pvdi
from pyvista_vdi.vtk_pipeline import VDIReader, VDIToImage, vdi_from_image
from pyvista_vdi.vtk_pipeline.vtk import (
    VTKPythonAlgorithmBase,
    vtkDataObject,
    vtkImageData,
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


def announced(algorithm):
    """What an algorithm's output port says of times: the steps and the range."""
    algorithm.UpdateInformation()
    information, keys = algorithm.GetOutputInformation(0), vtkStreamingDemandDrivenPipeline
    return information.Get(keys.TIME_STEPS()), information.Get(keys.TIME_RANGE())


def time_of(image):
    information, key = image.GetInformation(), vtkDataObject.DATA_TIME_STEP()
    return information.Get(key) if information.Has(key) else None


def test_the_reader_gives_the_step_nearest_to_the_time_down_the_pipeline(path):
    """Each asks what is before it for its time: a filter, and a mapper."""
    series, reader, mapper = pvdi.read(path), VDIReader(), pvdi.VDIMapper()
    reader.SetFileName(path)
    picture = VDIToImage()
    for each in (picture, mapper):
        each.SetInputConnection(reader.GetOutputPort())
    assert announced(reader) == announced(picture) == (TIMES, (0.5, 4.0))
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


def source_of(producer):
    return ready_source(producer, CAMERA, WindowSize=SIZE)


@pytest.fixture(scope="module")
def vdis(default_runtime):
    """What generate makes of each step."""
    made = [
        pvdi.generate(ball_at(step), CAMERA, SIZE, volume_property=some_property())
        for step in range(3)
    ]
    assert not made[0].equals(made[1])
    return made


def test_each_source_keeps_its_time_whatever_others_ask_for(vdis):
    producer = Moving()
    early, late = source_of(producer), source_of(producer)
    early.UpdateTimeStep(0.5)
    late.UpdateTimeStep(4.0)
    for source, step in ((early, 0), (late, 2), (early, 0)):
        assert source.vdi().equals(vdis[step])
        assert time_of(source.GetOutputDataObject(0)) == TIMES[step]
    # Without a time of its own a source takes what there is
    third = source_of(producer)
    producer.UpdateTimeStep(1.0)
    assert third.GetVDI().equals(vdis[1])
