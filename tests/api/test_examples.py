"""The shipped volumes, and the errors for those that are not there."""

from __future__ import annotations

import re

import numpy as np
import pytest
from real_data import require_data

from pyvista_vdi import examples
from pyvista_vdi.errors import DataNotFoundError, InvalidArgumentError, InvalidVolumeError

SHIPPED = sorted(examples.SHIPPED)
READ_ON_EVERY_CHANGE = ("aneurism", "catphan", "tooth")
OTHERS = sorted({*examples.VOLUMES} - {*SHIPPED, *READ_ON_EVERY_CHANGE})


@pytest.mark.parametrize(
    "name",
    [
        *SHIPPED,
        *(pytest.param(name, marks=pytest.mark.real_data) for name in READ_ON_EVERY_CHANGE),
        *(pytest.param(name, marks=[pytest.mark.real_data, pytest.mark.slow]) for name in OTHERS),
    ],
)
def test_same_grid_as_pyvista_reads(name):
    pyvista = pytest.importorskip("pyvista")
    if name not in SHIPPED:
        require_data(name)
    expected = pyvista.read(examples.path(name))
    grid = examples.load_data(name)
    assert isinstance(grid, pyvista.ImageData)
    assert grid.dimensions == expected.dimensions
    assert grid.spacing == expected.spacing
    assert grid.origin == expected.origin
    assert np.array_equal(grid.direction_matrix, expected.direction_matrix)
    assert grid.active_scalars_name == examples.VOLUMES[name][1]
    assert grid.active_scalars.dtype == expected.active_scalars.dtype
    assert np.array_equal(grid.active_scalars, expected.active_scalars)


def test_absent_without_the_variable(monkeypatch, tmp_path):
    with pytest.raises(InvalidArgumentError, match=r"'brian'.*aneurism.*brain"):
        examples.load_data("brian")
    monkeypatch.delenv(examples.DATA_VARIABLE, raising=False)
    with pytest.raises(DataNotFoundError, match=r"aneurism_256_u8.*PYVISTA_VDI_DATA.* names None"):
        examples.load_data("aneurism")
    assert examples.available() == tuple(SHIPPED)
    # Nor is the current folder searched
    (tmp_path / examples.VOLUMES["aneurism"][0]).write_bytes(b"")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(examples.DATA_VARIABLE, "")
    assert "aneurism" not in examples.available()


def test_absent_and_damaged_files_are_named(monkeypatch, tmp_path):
    monkeypatch.setenv(examples.DATA_VARIABLE, str(tmp_path))
    with pytest.raises(FileNotFoundError, match="aneurism_256_u8.*" + re.escape(str(tmp_path))):
        examples.load_data("aneurism")
    broken = tmp_path / examples.VOLUMES["aneurism"][0]
    whole = examples.path("brain").read_bytes()
    for content in (b"NRRD0004\ntype: uint8\n", whole[: len(whole) // 2]):
        broken.write_bytes(content)
        with pytest.raises(InvalidVolumeError, match=re.escape(str(broken))):
            examples.load_data("aneurism", as_volume=True)
