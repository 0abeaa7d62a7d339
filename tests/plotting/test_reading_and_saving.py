"""PyVista's own ``read`` and ``save``: every format gives every bit back."""

from __future__ import annotations

import inspect

import numpy as np
import pytest
import pyvista as pv
from extension_marks import cases
from strategies import random_vdi

import pyvista_vdi as pvdi
from pyvista_vdi.errors import InvalidArgumentError, InvalidVDIError
from pyvista_vdi.vtk_pipeline.filters.convert import is_vdi_image, vdi_from_image, vdi_to_image


@pytest.fixture
def vdi():
    return random_vdi(np.random.default_rng(3))


@pytest.mark.parametrize("suffix", cases(".vdi", ".exr", ".VDI"))
def test_save_and_read_give_it_back(suffix, vdi, tmp_path):
    path = tmp_path / f"a{suffix}"
    pv.wrap(vdi_to_image(vdi)).save(path)
    image = pv.read(path)
    assert isinstance(image, pv.ImageData)
    assert is_vdi_image(image)
    assert vdi_from_image(image).metadata == vdi.metadata
    plotter = pv.Plotter(off_screen=True, window_size=[32, 24])
    shown = plotter.add_vdi(image).vdi
    assert shown.equals(vdi_from_image(image))
    if suffix == ".exr":  # rounded
        assert np.array_equal(shown.optical_depth, vdi.optical_depth)
    else:
        assert shown.equals(vdi)


@pytest.mark.extension("deep_exr")
def test_options_of_saving_and_reading(vdi, tmp_path):
    image = pv.wrap(vdi_to_image(vdi))
    for options in ({}, {"level": 1}, {"level": 9}):
        image.save(tmp_path / "a.vdi", **options)
        vdi.save(tmp_path / "same.vdi", **options)
        assert (tmp_path / "a.vdi").read_bytes() == (tmp_path / "same.vdi").read_bytes()
    with pytest.raises(InvalidArgumentError, match="options compression, level, precision; got"):
        image.save(tmp_path / "b.vdi", thickness=1)
    image.save(tmp_path / "a.exr")
    assert not (tmp_path / "b.vdi").exists()
    if "kwargs" in inspect.signature(pv.read).parameters:  # PyVista 0.48 hands no options on
        view = pvdi.Camera((0, 0, 5), (0, 0, 0), (0, 1, 0))
        assert vdi_from_image(pv.read(tmp_path / "a.exr", camera=view)).n_supersegments > 0


@pytest.mark.parametrize("name", cases("a.vdi", "a.exr"))
def test_what_is_no_vdi_is_not_saved_as_one(name, tmp_path):
    with pytest.raises(InvalidVDIError, match=r"holds no VDI .*dataset\.vdi\.generate"):
        pv.ImageData(dimensions=(3, 3, 3)).save(tmp_path / name)
    with pytest.raises(InvalidVDIError, match="PolyData that holds no VDI"):
        pv.Sphere().save(tmp_path / name)
    assert list(tmp_path.iterdir()) == []
