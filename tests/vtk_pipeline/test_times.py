"""Series and volumes that change in time among VTK's algorithms: times announced and asked for."""

from __future__ import annotations

import numpy as np
import pytest
from strategies import random_vdi
from vtkmodules.vtkCommonDataModel import vtkDataObject
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkImagingCore import vtkExtractVOI

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError, VDIFileError
from pyvista_vdi.vtk_pipeline import VDIReader, VDIToImage, vdi_from_image

TIMES = (0.5, 1.0, 4.0)
#: Times that are asked for, and the step that is nearest to each; of two, the earlier.
ASKED = ((0.5, 0), (3.0, 2), (2.5, 1), (-7.0, 0), (1e9, 2), (1.0, 1))


@pytest.fixture
def path(tmp_path):
    vdis = [random_vdi(np.random.default_rng(seed)) for seed in range(3)]
    assert len({vdi.window_size for vdi in vdis}) == 3
    return pvdi.VDISeries.of(vdis, TIMES).save(tmp_path / "a.vdis")


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


# -- the reader ------------------------------------------------------------------------------------


def test_the_reader_gives_the_step_nearest_to_the_time(path):
    series, reader = pvdi.read(path), reader_of(path)
    assert announced(reader) == (TIMES, (0.5, 4.0))
    reader.Update()
    assert vdi_from_image(reader.GetOutputDataObject(0)).equals(series[0])
    for time, step in ASKED:
        reader.UpdateTimeStep(time)
        image = reader.GetOutputDataObject(0)
        assert vdi_from_image(image).equals(series[step])
        assert time_of(image) == TIMES[step]


def test_a_step_is_read_once(path):
    executed, reader = [], reader_of(path)
    reader.AddObserver("StartEvent", lambda *_: executed.append(1))
    for time, n in ((3.0, 1), (3.0, 1), (0.5, 2), (3.0, 3)):
        reader.UpdateTimeStep(time)
        reader.Update()
        assert len(executed) == n
    opened = reader.GetSeries()
    reader.UpdateTimeStep(1.0)
    assert reader.GetSeries() is opened


def test_times_go_down_the_pipeline(path):
    """Through a filter of VTK's, and one of ours; each asks what is before it for its time."""
    series, reader, voi, picture = pvdi.read(path), reader_of(path), vtkExtractVOI(), VDIToImage()
    voi.SetInputConnection(reader.GetOutputPort())
    picture.SetInputConnection(reader.GetOutputPort())
    assert announced(voi) == announced(picture) == (TIMES, (0.5, 4.0))
    for time, step in ASKED:
        picture.UpdateTimeStep(time)
        image = picture.GetOutputDataObject(0)
        assert time_of(image) == TIMES[step]
        assert image.GetDimensions()[:2] == series[step].picture_size


def test_a_mapper_draws_the_step_that_was_asked_for(path):
    series, reader, mapper = pvdi.read(path), reader_of(path), pvdi.VDIMapper()
    mapper.SetInputConnection(reader.GetOutputPort())
    assert mapper.GetVDI().equals(series[0])
    for time, step in ASKED:
        reader.UpdateTimeStep(time)
        assert mapper.GetVDI().equals(series[step])


def test_a_series_grows_while_it_is_read(path, tmp_path):
    series, reader = pvdi.read(path), reader_of(tmp_path / "b.vdis")
    mapper = pvdi.VDIMapper()
    with pytest.raises(VDIFileError, match=r"b\.vdis cannot be read"):
        reader.Update()
    assert announced(reader) is None
    with pvdi.SeriesWriter(tmp_path / "b.vdis", precision=series[0].precision) as writer:
        for i, vdi in enumerate(series):
            writer.append(vdi, TIMES[i])
            assert announced(reader)[0] == TIMES[: i + 1]
            reader.UpdateTimeStep(9.0)
            assert time_of(reader.GetOutputDataObject(0)) == TIMES[i]
            if i == 0:
                mapper.SetInputConnection(reader.GetOutputPort())
            assert mapper.GetVDI().equals(vdi)


def test_files_of_one_vdi_have_no_time(path, tmp_path):
    vdi, reader = pvdi.read(path)[1], reader_of(path)
    reader.UpdateTimeStep(4.0)
    vdi.save(tmp_path / "a.vdi")
    reader.SetFileName(tmp_path / "a.vdi")
    assert announced(reader) is None
    reader.Update()
    image = reader.GetOutputDataObject(0)
    assert vdi_from_image(image).equals(vdi)
    assert time_of(image) is None
    with pytest.raises(VDIFileError, match="is not a series"):
        reader.GetSeries()


def test_what_is_wrong_with_a_series_is_said(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1  # in the middle step
    path.write_bytes(content)
    reader = reader_of(path)
    assert announced(reader) == (TIMES, (0.5, 4.0))
    reader.UpdateTimeStep(0.5)
    with pytest.raises(VDIFileError, match="step 1 is not what was written"):
        reader.UpdateTimeStep(1.0)
    with pytest.raises(InvalidArgumentError, match="finite"):
        reader.UpdateTimeStep(float("nan"))
    reader.UpdateTimeStep(4.0)
    assert time_of(reader.GetOutputDataObject(0)) == 4.0
