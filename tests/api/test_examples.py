"""The shipped volumes, and the errors for those that are not there."""

from __future__ import annotations

import hashlib
import re
import sys
from importlib import resources

import numpy as np
import pytest
from real_data import require_data

from pyvista_vdi import examples
from pyvista_vdi.errors import (
    DataNotFoundError,
    InvalidArgumentError,
    InvalidVolumeError,
    MissingDependencyError,
)

SHIPPED = sorted(name for name, example in examples.VOLUMES.items() if example.shipped)
READ_ON_EVERY_CHANGE = ("aneurism", "catphan", "tooth")
OTHERS = sorted({*examples.VOLUMES} - {*SHIPPED, *READ_ON_EVERY_CHANGE})


def test_three_volumes_are_shipped_and_small():
    assert SHIPPED == ["brain", "ct", "rayleigh_taylor"]
    assert sum(examples.path(name).stat().st_size for name in SHIPPED) < 8_000_000


def test_crops_are_of_known_volumes():
    parts = {name: example.part_of for name, example in examples.VOLUMES.items() if example.part_of}
    assert parts == {"ct": "catphan"}
    assert {*examples.WHOLE} == {*examples.VOLUMES} - {*parts}


@pytest.mark.parametrize("name", SHIPPED)
def test_checksum_is_the_one_in_the_provenance(name):
    file = examples.path(name)
    readme = (resources.files("pyvista_vdi.data") / "README.md").read_text(encoding="utf-8")
    section = readme.partition(f"## {file.name}")[2].partition("\n## ")[0]
    stated = re.search(r"sha256 \| `([0-9a-f]{64})`", section)
    assert stated, f"README.md states no checksum of {file.name}"
    assert hashlib.sha256(file.read_bytes()).hexdigest() == stated.group(1)
    assert "| terms |" in section
    assert "| source |" in section


@pytest.mark.parametrize(
    ("name", "shape", "dtype", "spacing", "quantity", "ends"),
    [
        ("brain", (181, 217, 181), "uint8", (1.0, 1.0, 1.0), "intensity", (0, 133)),
        ("rayleigh_taylor", (192, 192, 192), "uint8", None, "concentration", (0, 255)),
        (
            "ct",
            (19, 412, 412),
            "int16",
            (0.48828125, 0.48828125, 2.5),
            "hounsfield",
            (-1000, 1810),
        ),
    ],
)
def test_shipped_volumes(name, shape, dtype, spacing, quantity, ends):
    volume = examples.load_data(name, as_volume=True)
    assert volume.array.shape == shape
    assert volume.array.dtype == dtype
    assert spacing in (None, volume.spacing)
    assert volume.name == quantity
    assert (volume.array.min(), volume.array.max()) == ends


def test_the_fluids_meet_along_z():
    array = examples.load_data("rayleigh_taylor", as_volume=True).array
    means = [[np.take(array, end, axis).mean() for end in (0, -1)] for axis in range(3)]
    z, y, x = (abs(first - last) for first, last in means)
    assert z > 200, means
    assert max(x, y) < 10, means


def test_ct_is_in_hounsfield_units():
    array = examples.load_data("ct", as_volume=True).array
    pins = {  # row, column: air, PMP, LDPE, polystyrene, acrylic, Delrin, Teflon
        (325, 206): -1000,
        (102, 146): -200,
        (206, 86): -100,
        (309, 146): -35,
        (309, 265): 120,
        (206, 325): 340,
        (102, 265): 990,
    }
    for (y, x), nominal in pins.items():
        found = array[2:9, y - 4 : y + 5, x - 4 : x + 5].mean()
        # Noise of 19 in 567 voxels, correlated over some; cone-beam artefacts
        assert found == pytest.approx(nominal, abs=20), (y, x)


@pytest.mark.real_data
def test_ct_is_a_part_of_its_source():
    require_data("catphan")
    whole, part = (examples.load_data(name, as_volume=True) for name in ("catphan", "ct"))
    assert np.array_equal(part.array, whole.array[27:46, 50:462, 50:462])
    assert part.spacing == pytest.approx(whole.spacing, rel=1e-12)  # 2.500000000000046 there


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
    assert grid.active_scalars_name == examples.VOLUMES[name].quantity
    assert grid.active_scalars.dtype == expected.active_scalars.dtype
    assert np.array_equal(grid.active_scalars, expected.active_scalars)


def test_absent_without_the_variable(monkeypatch, tmp_path):
    with pytest.raises(InvalidArgumentError, match=r"'brian'.*aneurism.*brain"):
        examples.load_data("brian")
    monkeypatch.delenv(examples.DATA_VARIABLE, raising=False)
    with pytest.raises(DataNotFoundError, match=r"PYVISTA_VDI_DATA is not set.*aneurism_256_u8"):
        examples.load_data("aneurism")
    assert examples.available() == tuple(SHIPPED)
    # Nor is the current folder searched
    (tmp_path / examples.VOLUMES["aneurism"].file_name).write_bytes(b"")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(examples.DATA_VARIABLE, "")
    assert "aneurism" not in examples.available()


def test_absent_and_damaged_files_are_named(monkeypatch, tmp_path):
    monkeypatch.setenv(examples.DATA_VARIABLE, str(tmp_path))
    with pytest.raises(FileNotFoundError, match=re.escape(str(tmp_path)) + r".*aneurism_256_u8"):
        examples.load_data("aneurism")
    broken = tmp_path / examples.VOLUMES["aneurism"].file_name
    whole = examples.path("brain").read_bytes()
    for content in (b"NRRD0004\ntype: uint8\n", whole[: len(whole) // 2]):
        broken.write_bytes(content)
        with pytest.raises(InvalidVolumeError, match=re.escape(str(broken))):
            examples.load_data("aneurism", as_volume=True)


def test_oblique_axes_and_anisotropy(monkeypatch, tmp_path):
    nrrd = pytest.importorskip("nrrd")
    # z, y, x = 2, 3, 4; x and y turned by 30 degrees, spacings 0.5, 2 and 3
    array = np.arange(24, dtype=np.int16).reshape(2, 3, 4)
    cos, sin = np.cos(np.pi / 6), np.sin(np.pi / 6)
    direction = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    spacing = np.array([0.5, 2.0, 3.0])
    header = {
        "space dimension": 3,
        "space directions": direction.T * spacing[:, None],
        "space origin": [10.0, 20.0, 30.0],
    }
    file = tmp_path / examples.VOLUMES["aneurism"].file_name
    nrrd.write(str(file), array, header, index_order="C")
    monkeypatch.setenv(examples.DATA_VARIABLE, str(tmp_path))
    volume = examples.load_data("aneurism", as_volume=True)
    assert np.array_equal(volume.array, array)
    # one rounding each for the square, the sum and the root
    np.testing.assert_allclose(volume.spacing, spacing, rtol=4 * np.finfo(float).eps)
    np.testing.assert_allclose(volume.direction, direction, rtol=8 * np.finfo(float).eps)
    assert volume.origin == (10.0, 20.0, 30.0)


def test_without_pyvista_the_way_out_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(MissingDependencyError, match=r"as_volume=True.*pyvista-vdi\[plot\]"):
        examples.load_brain()
