"""Volumes of zarr, OME-Zarr and HDF5: metadata as the reference implementation writes them."""

from __future__ import annotations

import copy
import json
import pickle
import shutil
import warnings
from pathlib import Path

import numpy as np
import pytest

import pyvista_vdi as pvdi
from pyvista_vdi.errors import (
    InvalidVolumeError,
    UnsupportedError,
)

VALUES = np.random.default_rng(5).integers(0, 250, (2, 3, 8, 16, 24)).astype(np.uint16)
AXES = [
    {"name": "t", "type": "time", "unit": "second"},
    {"name": "c", "type": "channel"},
    {"name": "z", "type": "space", "unit": "micrometer"},
    {"name": "y", "type": "space", "unit": "micrometer"},
    {"name": "x", "type": "space", "unit": "micrometer"},
]


def pyramid(values, count=3):
    """Values at full, half, ... resolution along z, y and x."""
    return [values[..., :: 2**k, :: 2**k, :: 2**k] for k in range(count)]


def placed(count, dimensions=5, spacing=(2.0, 0.5, 0.25), origin=(10.0, 20.0, 30.0)):
    """Scale and translation of each level."""
    before = [1.0] * (dimensions - 3)
    return [
        [
            {"type": "scale", "scale": [*before, *(s * 2**k for s in spacing)]},
            {"type": "translation", "translation": [0.0] * (dimensions - 3) + [*origin]},
        ]
        for k in range(count)
    ]


def write_ome(path, version="0.4", values=VALUES, axes=AXES):
    """Write an image by ome-zarr-py."""
    writer = pytest.importorskip("ome_zarr.writer", reason="ome-zarr is not installed")
    zarr = pytest.importorskip("zarr")
    formats = pytest.importorskip("ome_zarr.format")
    if not hasattr(formats, "FormatV" + version.replace(".", "")):
        pytest.skip(f"this ome-zarr writes no {version}: it needs Python 3.11")
    of = getattr(formats, "FormatV" + version.replace(".", ""))()
    new = {"zarr_format": of.zarr_format} if hasattr(of, "zarr_format") else {}
    group = zarr.open_group(str(path), mode="w", **new)
    levels = pyramid(values)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of zarr, which ome-zarr calls as it was
        writer.write_multiscale(
            levels,
            group,
            fmt=of,
            axes=axes,
            coordinate_transformations=placed(len(levels), values.ndim),
            storage_options={"chunks": (1,) * (values.ndim - 3) + (4, 8, 8)},
        )
    return path


def change(path, edit):
    """Change the attributes of a group of zarr format 2, consolidated metadata left out."""
    file = path / ".zattrs"
    attributes = json.loads(file.read_text())
    edit(attributes["multiscales"][0])
    file.write_text(json.dumps(attributes))


@pytest.fixture(scope="module", params=["0.4", "0.5"])
def image(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("stores") / "x.ome.zarr"
    return write_ome(path, request.param), request.param


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    return write_ome(tmp_path_factory.mktemp("stores") / "x.ome.zarr")


@pytest.fixture
def ome(written, tmp_path):
    """An image that a test may change."""
    return Path(shutil.copytree(written, tmp_path / "x.ome.zarr"))


def test_spacing_axes_levels_time_and_channel(image):
    path, version = image
    volume = pvdi.read_volume(path, time=1, channel=2)
    assert isinstance(volume, pvdi.Volume)
    assert volume.chunked
    assert volume.store.kind == f"OME-Zarr {version}"
    assert volume.store.axes == ("t", "c", "z", "y", "x")
    assert volume.store.unit == "micrometer"
    assert volume.dimensions == (24, 16, 8)
    assert volume.spacing == (0.25, 0.5, 2.0)
    assert volume.origin == (30.0, 20.0, 10.0)
    assert volume.array.chunks == (4, 8, 8)
    np.testing.assert_array_equal(volume.load().array, VALUES[1, 2])
    box = (slice(1, 7), slice(3, 16), slice(5, 6))
    np.testing.assert_array_equal(volume.array[box], VALUES[1, 2][box])
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(volume)).array[box], VALUES[1, 2][box])
    for level in (1, 2):
        coarse = pvdi.read_volume(path, level=level, channel=1)
        assert coarse.level == level
        assert coarse.spacing == tuple(s * 2**level for s in (0.25, 0.5, 2.0))
        np.testing.assert_array_equal(
            coarse.load().array, VALUES[0, 1, :: 2**level, :: 2**level, :: 2**level]
        )


def with_transformation(entry):
    return lambda image: image["datasets"][0].update(coordinateTransformations=[entry])


@pytest.mark.parametrize(
    ("edit", "error", "message"),
    [
        (lambda i: i.update(version="0.2"), UnsupportedError, "OME-Zarr 0.2: 0.4 and 0.5"),
        (
            lambda i: i["axes"].append(i["axes"].pop(3)),
            UnsupportedError,
            "z, y, x must be among them",
        ),
        (lambda i: i.pop("axes"), InvalidVolumeError, "break OME-Zarr .KeyError: 'axes'"),
        (with_transformation({"type": "affine"}), UnsupportedError, "type 'affine'"),
    ],
)
def test_metadata_that_cannot_be_followed_are_refused(edit, error, message, ome):
    change(ome, edit)
    with pytest.raises(error, match=message):
        pvdi.read_volume(ome)


def test_zarr_array_and_group(tmp_path):
    zarr = pytest.importorskip("zarr")
    group = zarr.open_group(str(tmp_path / "x.zarr"), mode="w")
    kind = {"mode": "w", "chunks": (4, 8, 8), "dtype": "u2"}
    for name, values in zip("ab", VALUES[0], strict=False):
        zarr.open(str(tmp_path / "x.zarr" / name), shape=values.shape, **kind)[...] = values
    group["b"].attrs["spacing"] = [3.0, 2.0, 1.0]
    with pytest.raises(InvalidVolumeError, match=r"holds several: open one of .*x\.zarr::a, "):
        pvdi.read_volume(tmp_path / "x.zarr")
    deep = group.create_group("deep")
    for name in ("c", "d"):
        zarr.open(str(tmp_path / "x.zarr" / "deep" / name), mode="w", shape=(4, 4, 4), dtype="u2")
    with pytest.raises(InvalidVolumeError, match=r"open one of .*x\.zarr::deep/c, .*::deep/d"):
        pvdi.read_volume(f"{tmp_path}/x.zarr::{deep.path}")
    for path in (f"{tmp_path}/x.zarr::b", tmp_path / "x.zarr" / "b"):
        volume = pvdi.read_volume(path)
        assert volume.spacing == (1.0, 2.0, 3.0)
        np.testing.assert_array_equal(volume.load().array, VALUES[0, 1])


def test_hdf5(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "x.h5"
    with h5py.File(path, "w") as file:
        one = file.create_dataset("deep/one", data=VALUES[0], chunks=(1, 4, 8, 8))
        one.attrs["element_size_um"] = [2.0, 0.5, 0.25]
    volume = pvdi.read_volume(path, time=1)  # of the only one
    assert volume.store.axes == ("t", "z", "y", "x")
    assert len(volume.store.times) == len(VALUES[0])
    np.testing.assert_array_equal(volume.at_time(0).load().array, VALUES[0, 0])
    assert volume.store.unit == "micrometer"
    assert volume.spacing == (0.25, 0.5, 2.0)
    np.testing.assert_array_equal(volume.load().array, VALUES[0, 1])
    del volume  # which has it open
    with h5py.File(path, "a") as file:
        two = file.create_dataset("two", data=VALUES[0].transpose(1, 0, 2, 3))
        for label, dimension in zip("ztyx", two.dims, strict=True):
            dimension.label = label
        three = file.create_dataset("three", data=VALUES[:, 0])
        for label, dimension in zip("tzyx", three.dims, strict=True):
            dimension.label = label
    with pytest.raises(InvalidVolumeError, match=r"holds several.*x\.h5::deep/one") as kept:
        pvdi.read_volume(path)
    with h5py.File(path, "a"):
        assert kept.value  # which holds no file open
    with pytest.raises(InvalidVolumeError, match=r"no array 'four'"):
        pvdi.read_volume(f"{path}::/four")
    between = pvdi.read_volume(f"{path}::/two", time=1)  # time lies between z and y
    np.testing.assert_array_equal(between.load().array, VALUES[0, 1])
    labelled = pvdi.read_volume(f"{path}::/three", time=1)
    np.testing.assert_array_equal(labelled.load().array, VALUES[1, 0])
    again = pickle.loads(pickle.dumps(labelled))
    np.testing.assert_array_equal(again.load().array, VALUES[1, 0])
    np.testing.assert_array_equal(copy.deepcopy(again).store.levels[0].array, VALUES[:, 0])
    assert (again.time, again.spacing) == (1, labelled.spacing)
