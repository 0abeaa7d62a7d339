"""PyVista's own ``read`` and ``save``: every format gives every bit back."""

from __future__ import annotations

import inspect

import numpy as np
import pytest
import pyvista as pv
from strategies import random_vdi

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError, InvalidVDIError, VDIFileError
from pyvista_vdi.extensions.series.pyvista_reader import SeriesReader
from pyvista_vdi.vtk_pipeline.filters.convert import is_vdi_image, vdi_from_image, vdi_to_image


@pytest.fixture
def vdi():
    return random_vdi(np.random.default_rng(3))


@pytest.mark.parametrize("suffix", [".vdi", ".exr", ".vti", ".VDI"])
def test_save_and_read_give_every_bit_back(suffix, vdi, tmp_path):
    path = tmp_path / f"a{suffix}"
    pv.wrap(vdi_to_image(vdi)).save(path)
    image = pv.read(path)
    assert isinstance(image, pv.ImageData)
    assert is_vdi_image(image)
    assert vdi_from_image(image).equals(vdi)
    assert vdi_from_image(image).metadata == vdi.metadata
    plotter = pv.Plotter(off_screen=True, window_size=[32, 24])
    assert plotter.add_vdi(image).vdi.equals(vdi)


def test_options_of_saving_and_reading(vdi, tmp_path):
    image = pv.wrap(vdi_to_image(vdi))
    for options in ({}, {"level": 1}, {"level": 9}):
        image.save(tmp_path / "a.vdi", **options)
        vdi.save(tmp_path / "same.vdi", **options)
        assert (tmp_path / "a.vdi").read_bytes() == (tmp_path / "same.vdi").read_bytes()
    with pytest.raises(InvalidArgumentError, match="options compression, level, precision; got"):
        image.save(tmp_path / "b.vdi", exact=False)
    image.save(tmp_path / "a.exr", exact=False)
    assert not (tmp_path / "b.vdi").exists()
    if "kwargs" in inspect.signature(pv.read).parameters:  # PyVista 0.48 hands no options on
        view = pvdi.Camera((0, 0, 5), (0, 0, 0), (0, 1, 0))
        assert vdi_from_image(pv.read(tmp_path / "a.exr", camera=view)).n_supersegments > 0


@pytest.mark.parametrize("name", ["a.vdi", "a.exr"])
def test_what_is_no_vdi_is_not_saved_as_one(name, tmp_path):
    with pytest.raises(InvalidVDIError, match=r"holds no VDI .*dataset\.vdi\.generate"):
        pv.ImageData(dimensions=(3, 3, 3)).save(tmp_path / name)
    with pytest.raises(InvalidVDIError, match="a PolyData that holds no VDI"):
        pv.Sphere().save(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_no_deep_image_is_refused(tmp_path):
    (tmp_path / "a.exr").write_bytes(b"something else")
    with pytest.raises(VDIFileError, match=r"a\.exr"):
        pv.read(tmp_path / "a.exr")


def test_nothing_of_pyvista_is_shadowed():
    written = {".exr", ".vdi"}
    ours = {*written, ".vdis"}
    for registered, theirs in ((pv.registered_readers(), ours), (pv.registered_writers(), written)):
        found = {each.extension for each in registered if "pyvista_vdi" in each.source}
        assert found == theirs
    assert not ours & set(pv.ImageData._WRITERS)
    assert not ours & set(pv.core.utilities.reader.CLASS_READERS)


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
