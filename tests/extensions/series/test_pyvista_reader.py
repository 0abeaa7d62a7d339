"""``.vdis`` files by ``pyvista.read`` and ``get_reader``: each step is its VDI."""

from __future__ import annotations

import numpy as np
import pytest
import pyvista as pv
from strategies import random_vdi

import pyvista_vdi as pvdi
from pyvista_vdi.errors import VDIFileError
from pyvista_vdi.extensions.series.pyvista_reader import SeriesReader
from pyvista_vdi.vtk_pipeline.filters.convert import vdi_from_image


@pytest.fixture
def series(tmp_path):
    vdis = [random_vdi(np.random.default_rng(seed)) for seed in range(3)]
    return pvdi.read(pvdi.VDISeries.of(vdis, (0.5, 1.0, 4.0)).save(tmp_path / "a.vdis"))


def reader_of(path):
    return pv.get_reader(path) if pv.version_info >= (0, 49) else SeriesReader(path)


def test_a_series_has_a_reader_with_times(series, tmp_path):
    first = pv.read(tmp_path / "a.vdis")
    assert isinstance(first, pv.ImageData)
    assert vdi_from_image(first).equals(series[0])
    reader = reader_of(tmp_path / "a.vdis")
    assert isinstance(reader, pv.TimeReader)
    assert reader.number_time_points == 3
    assert reader.time_values == [0.5, 1.0, 4.0]
    assert reader.time_point_value(1) == 1.0
    assert reader.active_time_value == 0.5
    for value, step in ((3.0, 2), (0.9, 1), (0.5, 0)):
        reader.set_active_time_value(value)
        assert reader.active_time_value == series.times[step]
        assert vdi_from_image(reader.read()).equals(series[step])
    images = []
    for point in range(3):
        reader.set_active_time_point(point)
        assert reader.active_time_value == series.times[point]
        images.append(reader.read())
    # What was read stays what it is
    assert all(vdi_from_image(image).equals(series[i]) for i, image in enumerate(images))


def test_what_is_no_series_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError):
        pv.read(tmp_path / "absent.vdis")
    (tmp_path / "a.vdis").write_bytes(b"something else")
    reader = reader_of(tmp_path / "a.vdis")
    with pytest.raises(VDIFileError, match="is not a series of VDIs"):
        reader.read()
    with pytest.raises(VDIFileError, match="is not a series of VDIs"):
        _ = reader.time_values
